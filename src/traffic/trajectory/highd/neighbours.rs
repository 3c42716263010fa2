//! Neighbours of each vehicle per frame, for highD's neighbour columns. Only the writer needs them.

use crate::trajectory::frame_index::{FrameIndex, VehicleAtFrame};
use crate::trajectory::{Recording, Track};

/// No vehicle.
pub(super) const NOBODY: u32 = u32::MAX;

/// The vehicles around one vehicle at one instant, as indices into [`Recording::tracks`] or [`NOBODY`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Around {
    /// Next ahead in the same lane.
    pub preceding: u32,
    /// Next behind in the same lane.
    pub following: u32,
    /// In the next lane to the left.
    pub left: Beside,
    /// In the next lane to the right.
    pub right: Beside,
}

/// The vehicles of a neighbouring lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Beside {
    /// Next ahead of those that do not overlap along the road.
    pub preceding: u32,
    /// The nearest that overlaps along the road.
    pub alongside: u32,
    /// Next behind of those that do not overlap along the road.
    pub following: u32,
}

const NOBODY_BESIDE: Beside = Beside { preceding: NOBODY, alongside: NOBODY, following: NOBODY };

const ALONE: Around = Around { preceding: NOBODY, following: NOBODY, left: NOBODY_BESIDE, right: NOBODY_BESIDE };

/// The neighbours of each vehicle at each of its samples. Vehicles in no lane have none.
pub(super) fn neighbours(recording: &Recording) -> Vec<Vec<Around>> {
    let tracks = &recording.tracks;
    let mut around: Vec<Vec<Around>> = tracks.iter().map(|track| vec![ALONE; track.len()]).collect();
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
            note(&mut around, tracks, &lanes);
        }
    }
    around
}

fn note(around: &mut [Vec<Around>], tracks: &[Track], lanes: &[Vec<VehicleAtFrame>]) {
    let beside = |lane: Option<usize>, here: VehicleAtFrame| match lane.and_then(|lane| lanes.get(lane)) {
        Some(vehicles) => beside(tracks, vehicles, here),
        None => NOBODY_BESIDE,
    };
    for (lane, vehicles) in lanes.iter().enumerate() {
        for (place, &here) in vehicles.iter().enumerate() {
            let at = |place: Option<usize>| place.and_then(|place| vehicles.get(place)).map_or(NOBODY, |v| v.track);
            around[here.track as usize][here.sample as usize] = Around {
                preceding: at(Some(place + 1)),
                following: at(place.checked_sub(1)),
                left: beside(lane.checked_sub(1), here),
                right: beside(Some(lane + 1), here),
            };
        }
    }
}

fn beside(tracks: &[Track], vehicles: &[VehicleAtFrame], here: VehicleAtFrame) -> Beside {
    let length_m = tracks[here.track as usize].length_m;
    let mut found = NOBODY_BESIDE;
    let mut nearest_m = f64::INFINITY;
    for other in vehicles {
        let ahead_m = other.s_m - here.s_m;
        if ahead_m.abs() < 0.5 * (length_m + tracks[other.track as usize].length_m) {
            if ahead_m.abs() < nearest_m {
                nearest_m = ahead_m.abs();
                found.alongside = other.track;
            }
        } else if ahead_m <= 0.0 {
            found.following = other.track;
        } else if found.preceding == NOBODY {
            found.preceding = other.track;
        }
    }
    found
}
