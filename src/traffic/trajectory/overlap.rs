//! Vehicles whose boxes overlap: their sizes or their reference point are wrong, or one vehicle has two tracks.

use std::collections::BTreeSet;

use super::recording::{Recording, Track};

/// Overlap of two boxes that rounding and noise may cause, m.
const OVERLAP_M: f64 = 0.2;

/// The pairs that overlap.
pub(super) struct Overlaps {
    /// Indices into the tracks, the smaller first.
    pub pairs: BTreeSet<(usize, usize)>,
    /// The first pair in words.
    pub first: String,
}

/// One sample of a track per second, at the same frames for all tracks.
pub(super) fn each_second(recording: &Recording, track: &Track) -> impl Iterator<Item = usize> + use<> {
    let second = recording.frame_rate_hz.round().max(1.0) as usize;
    let first = (-track.first_frame).rem_euclid(second as i64) as usize;
    (first..track.len()).step_by(second)
}

/// Finds overlaps, once a second; `None` without any.
pub(super) fn overlaps(recording: &Recording) -> Option<Overlaps> {
    let mut boxes: Vec<(usize, i64, f64, usize, usize)> = Vec::new();
    for (index, track) in recording.tracks.iter().enumerate() {
        let here = |k: usize| (track.carriageway, track.first_frame + k as i64, track.s_m[k], index, k);
        boxes.extend(each_second(recording, track).map(here));
    }
    boxes.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)).then(a.3.cmp(&b.3)));
    let longest_m = recording.tracks.iter().map(|track| track.length_m).fold(0.0, f64::max);
    let mut found: Option<Overlaps> = None;
    for (at, a) in boxes.iter().enumerate() {
        let near = |b: &&(usize, i64, f64, usize, usize)| (a.0, a.1) == (b.0, b.1) && b.2 - a.2 < longest_m;
        for b in boxes[at + 1..].iter().take_while(near) {
            let (behind, ahead) = (&recording.tracks[a.3], &recording.tracks[b.3]);
            let along_m = (behind.length_m + ahead.length_m) / 2.0 - (b.2 - a.2);
            let across_m = (behind.width_m + ahead.width_m) / 2.0 - (behind.d_m[a.4] - ahead.d_m[b.4]).abs();
            if along_m > OVERLAP_M && across_m > OVERLAP_M {
                let first = || {
                    format!(
                        "vehicles {} and {} at frame {}, by {along_m:.2} m along the road",
                        behind.id, ahead.id, a.1
                    )
                };
                let found = found.get_or_insert_with(|| Overlaps { pairs: BTreeSet::new(), first: first() });
                found.pairs.insert((a.3.min(b.3), a.3.max(b.3)));
            }
        }
    }
    found
}
