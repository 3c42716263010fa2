//! Neighbours of each vehicle per frame, for highD's neighbour columns. Only the writer needs them.

use crate::trajectory::frame_index::{FrameIndex, VehicleAtFrame};
use crate::trajectory::{Recording, Track};

/// No vehicle.
const NOBODY: u32 = u32::MAX;

/// The vehicles around one vehicle at one instant, as indices into [`Recording::tracks`] or [`NOBODY`], in the order of highD's
/// columns: the next one ahead and behind in the same lane; in the lane to the left, then to the right, the next one ahead of
/// those that do not overlap along the road, the nearest that overlaps, and the next one behind.
pub(super) type Around = [u32; 8];

/// The neighbours of each vehicle at each of its samples. Vehicles in no lane have none.
pub(super) fn neighbours(recording: &Recording) -> Vec<Vec<Around>> {
    let tracks = &recording.tracks;
    let mut around: Vec<Vec<Around>> = tracks.iter().map(|track| vec![[NOBODY; 8]; track.len()]).collect();
    for (index, carriageway) in recording.carriageways.iter().enumerate() {
        // Ascending along the road.
        let mut lanes: Vec<Vec<VehicleAtFrame>> = vec![Vec::new(); carriageway.lane_count()];
        for present in FrameIndex::new(recording, index).frames() {
            lanes.iter_mut().for_each(Vec::clear);
            for here in present {
                let lane = tracks[here.track as usize].lane[here.sample as usize];
                if let Some(vehicles) = lanes.get_mut(usize::from(lane)) {
                    vehicles.push(*here);
                }
            }
            for (lane, vehicles) in lanes.iter().enumerate() {
                let of = |lane: Option<usize>| lane.and_then(|lane| lanes.get(lane)).map_or(&[][..], Vec::as_slice);
                for (place, &here) in vehicles.iter().enumerate() {
                    let at = |place: Option<usize>| place.and_then(|at| vehicles.get(at)).map_or(NOBODY, |v| v.track);
                    let [a, b, c] = beside(tracks, of(lane.checked_sub(1)), here);
                    let [d, e, f] = beside(tracks, of(Some(lane + 1)), here);
                    around[here.track as usize][here.sample as usize] =
                        [at(Some(place + 1)), at(place.checked_sub(1)), a, b, c, d, e, f];
                }
            }
        }
    }
    around
}

/// Those of a neighbouring lane: ahead, alongside, behind.
fn beside(tracks: &[Track], vehicles: &[VehicleAtFrame], here: VehicleAtFrame) -> [u32; 3] {
    let length_m = tracks[here.track as usize].length_m;
    let [mut ahead, mut alongside, mut behind] = [NOBODY; 3];
    let mut nearest_m = f64::INFINITY;
    for other in vehicles {
        let ahead_m = other.s_m - here.s_m;
        if ahead_m.abs() < 0.5 * (length_m + tracks[other.track as usize].length_m) {
            if ahead_m.abs() < nearest_m {
                (nearest_m, alongside) = (ahead_m.abs(), other.track);
            }
        } else if ahead_m <= 0.0 {
            behind = other.track;
        } else if ahead == NOBODY {
            ahead = other.track;
        }
    }
    [ahead, alongside, behind]
}
