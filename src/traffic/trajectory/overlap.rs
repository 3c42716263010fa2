//! Vehicles whose boxes overlap: their sizes or their reference point are wrong, or one vehicle has two tracks.

use std::collections::{BTreeMap, BTreeSet};

use super::recording::Recording;
use super::tracks::range;

/// Overlap of two boxes that rounding and noise may cause, m.
const OVERLAP_M: f64 = 0.2;
/// Nobody drives as near to a vehicle ahead, or keeps the distance as exactly, for so long at such a speed: m, m, s, m/s.
const COUPLED_M: f64 = 1.0;
const MAX_PLAY_M: f64 = 0.3;
const MIN_COUPLED_S: usize = 5;
const MIN_SPEED_MPS: f64 = 5.0;

/// What is where one vehicle can be; pairs are indices into the tracks, the smaller first.
#[derive(Default)]
pub(super) struct Overlaps {
    /// The pairs that overlap.
    pub pairs: BTreeSet<(usize, usize)>,
    /// The first of them in words.
    pub first: String,
    /// The pairs that are one vehicle, such as tractor and trailer.
    pub coupled: Vec<(usize, usize)>,
}

/// Finds overlaps, once a second.
pub(super) fn overlaps(recording: &Recording) -> Overlaps {
    let mut boxes: Vec<(usize, i64, f64, usize, usize)> = Vec::new();
    // The same frames for all tracks.
    let second = recording.frame_rate_hz.round().max(1.0) as usize;
    for (index, track) in recording.tracks.iter().enumerate() {
        let first = (-track.first_frame).rem_euclid(second as i64) as usize;
        let here = |k: usize| (track.carriageway, track.first_frame + k as i64, track.s_m[k], index, k);
        boxes.extend((first..track.len()).step_by(second).map(here));
    }
    boxes.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)).then(a.3.cmp(&b.3)));
    let reach_m = recording.tracks.iter().map(|track| track.length_m).fold(0.0, f64::max) + COUPLED_M;
    let mut found = Overlaps::default();
    let mut near_m: BTreeMap<(usize, usize), Vec<f64>> = BTreeMap::new();
    for (at, a) in boxes.iter().enumerate() {
        let near = |b: &&(usize, i64, f64, usize, usize)| (a.0, a.1) == (b.0, b.1) && b.2 - a.2 < reach_m;
        for b in boxes[at + 1..].iter().take_while(near) {
            let (behind, ahead) = (&recording.tracks[a.3], &recording.tracks[b.3]);
            let pair = (a.3.min(b.3), a.3.max(b.3));
            let along_m = (behind.length_m + ahead.length_m) / 2.0 - (b.2 - a.2);
            let across_m = (behind.width_m + ahead.width_m) / 2.0 - (behind.d_m[a.4] - ahead.d_m[b.4]).abs();
            if across_m <= OVERLAP_M {
                continue;
            }
            if along_m > -COUPLED_M && behind.v_s_mps[a.4] > MIN_SPEED_MPS {
                near_m.entry(pair).or_default().push(along_m);
            }
            if along_m > OVERLAP_M {
                if found.pairs.is_empty() {
                    let (behind, ahead, frame) = (behind.id, ahead.id, a.1);
                    found.first =
                        format!("vehicles {behind} and {ahead} at frame {frame}, by {along_m:.2} m along the road");
                }
                found.pairs.insert(pair);
            }
        }
    }
    let is_coupled = |(_, of): &(_, Vec<f64>)| {
        let (low_m, high_m) = range(of.iter().copied());
        of.len() >= MIN_COUPLED_S && high_m - low_m < MAX_PLAY_M
    };
    found.coupled = near_m.into_iter().filter(is_coupled).map(|(pair, _)| pair).collect();
    found
}
