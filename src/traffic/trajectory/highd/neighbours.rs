//! Neighbours of each vehicle per frame, for highD's neighbour columns. Only the writer needs them.

use crate::traffic::trajectory::{Recording, Track};

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

/// A vehicle of a lane at one instant.
#[derive(Clone, Copy)]
struct Here {
    s_m: f64,
    index: u32,
}

/// The neighbours of each vehicle at each of its samples. Vehicles in no lane have none.
pub(super) fn neighbours(recording: &Recording) -> Vec<Vec<Around>> {
    let tracks = &recording.tracks;
    let mut around: Vec<Vec<Around>> = tracks.iter().map(|track| vec![ALONE; track.len()]).collect();
    for (index, carriageway) in recording.carriageways.iter().enumerate() {
        let mut waiting: Vec<u32> =
            (0..tracks.len() as u32).filter(|&at| tracks[at as usize].carriageway == index).collect();
        waiting.sort_by_key(|&at| std::cmp::Reverse((tracks[at as usize].first_frame, at)));
        let mut present: Vec<u32> = Vec::new();
        let mut lanes: Vec<Vec<Here>> = vec![Vec::new(); carriageway.lane_count()];
        let mut frame = i64::MIN;
        while !(present.is_empty() && waiting.is_empty()) {
            let next = waiting.last().map_or(i64::MAX, |&at| tracks[at as usize].first_frame);
            frame = if present.is_empty() { next } else { frame + 1 };
            while let Some(at) = waiting.pop_if(|at| tracks[*at as usize].first_frame == frame) {
                present.push(at);
            }
            present.retain(|&at| tracks[at as usize].last_frame() >= frame);
            fill(&mut lanes, tracks, &present, frame);
            note(&mut around, tracks, &lanes, frame);
        }
    }
    around
}

/// Sorts the present vehicles into lanes, ascending along the road.
fn fill(lanes: &mut [Vec<Here>], tracks: &[Track], present: &[u32], frame: i64) {
    lanes.iter_mut().for_each(Vec::clear);
    for &index in present {
        let track = &tracks[index as usize];
        if let Some(sample) = track.index_of(frame)
            && let Some(lane) = lanes.get_mut(usize::from(track.lane[sample]))
        {
            lane.push(Here { s_m: track.s_m[sample], index });
        }
    }
    for lane in lanes {
        lane.sort_by(|a, b| a.s_m.total_cmp(&b.s_m).then(a.index.cmp(&b.index)));
    }
}

fn note(around: &mut [Vec<Around>], tracks: &[Track], lanes: &[Vec<Here>], frame: i64) {
    let beside = |lane: Option<usize>, here: Here| match lane.and_then(|lane| lanes.get(lane)) {
        Some(vehicles) => beside(tracks, vehicles, here),
        None => NOBODY_BESIDE,
    };
    for (lane, vehicles) in lanes.iter().enumerate() {
        for (place, &here) in vehicles.iter().enumerate() {
            let index = here.index as usize;
            let Some(sample) = tracks[index].index_of(frame) else { continue };
            let at = |place: Option<usize>| place.and_then(|place| vehicles.get(place)).map_or(NOBODY, |v| v.index);
            around[index][sample] = Around {
                preceding: at(Some(place + 1)),
                following: at(place.checked_sub(1)),
                left: beside(lane.checked_sub(1), here),
                right: beside(Some(lane + 1), here),
            };
        }
    }
}

fn beside(tracks: &[Track], vehicles: &[Here], here: Here) -> Beside {
    let length_m = tracks[here.index as usize].length_m;
    let mut found = NOBODY_BESIDE;
    let mut nearest_m = f64::INFINITY;
    for other in vehicles {
        let ahead_m = other.s_m - here.s_m;
        if ahead_m.abs() < 0.5 * (length_m + tracks[other.index as usize].length_m) {
            if ahead_m.abs() < nearest_m {
                nearest_m = ahead_m.abs();
                found.alongside = other.index;
            }
        } else if ahead_m <= 0.0 {
            found.following = other.index;
        } else if found.preceding == NOBODY {
            found.preceding = other.index;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::traffic::trajectory::{Carriageway, NO_LANE, VehicleClass};

    fn standing(id: u32, first_frame: i64, s_m: f64, lane: u16) -> Track {
        Track {
            id,
            class: VehicleClass::Car,
            length_m: 4.0,
            width_m: 1.8,
            carriageway: 0,
            first_frame,
            s_m: vec![s_m; 2],
            d_m: vec![0.0; 2],
            v_s_mps: vec![0.0; 2],
            v_d_mps: vec![0.0; 2],
            a_s_mps2: vec![0.0; 2],
            lane: vec![lane; 2],
        }
    }

    #[test]
    fn ahead_beside_and_behind_are_told_by_lane_and_overlap() {
        let recording = Recording {
            id: "01".to_owned(),
            synthetic: false,
            frame_rate_hz: 25.0,
            carriageways: vec![Carriageway { name: "2".to_owned(), lane_lines_m: vec![0.0, -3.5, -7.0] }],
            tracks: vec![
                standing(1, 1, 100.0, 1),
                standing(2, 1, 120.0, 1),
                standing(3, 2, 80.0, 1),
                standing(4, 1, 102.0, 0),
                standing(5, 1, 110.0, 0),
                standing(6, 1, 90.0, 0),
                standing(7, 1, 101.0, NO_LANE),
            ],
        };
        let around = neighbours(&recording);
        let left = Beside { preceding: 4, alongside: 3, following: 5 };
        let first = Around { preceding: 1, following: NOBODY, left, right: NOBODY_BESIDE };
        assert_eq!(around[0][0], first);
        // Vehicle 3 arrives one frame later.
        assert_eq!(around[0][1], Around { following: 2, ..first });
        assert_eq!(around[2][0].preceding, 0);
        assert_eq!(around[3][0].right, Beside { preceding: 1, alongside: 0, following: NOBODY });
        // At its second sample it is alone.
        assert_eq!(around[2][1], ALONE);
        assert_eq!(around[6], [ALONE; 2]);
    }
}
