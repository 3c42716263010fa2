//! What all lanes of a batch see of one quantity over the rows of a burst: their series, turned.

use crate::engine::cpu::batch_arrays::{Floats, TrackArrays, Words};
use crate::engine::cpu::series::Track;
use crate::engine::cpu::{LANES, ROWS};

/// Rows of one quantity of one vehicle.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(in crate::engine) struct Window {
    /// One row per step.
    pub rows: [Floats; ROWS],
    /// Some lane's rows are not what it will see for ever.
    pub moves: bool,
    /// All lanes of the stream see the same at all steps.
    pub stands: bool,
}

impl Window {
    /// Before the first lane of a stream with these series.
    pub fn new(tracks: impl Iterator<Item = Track>, entries: &[f32]) -> Self {
        let value = standing(tracks, entries);
        Window { rows: [[value.unwrap_or(0.0); LANES]; ROWS], moves: false, stands: value.is_some() }
    }

    /// Takes the rows from the series: entry by entry, on every machine.
    #[inline(always)]
    pub fn turn(&mut self, tracks: &TrackArrays<LANES>, steps: &Words, entries: &[f32]) {
        let places = places(tracks, steps);
        for (k, &from) in places.iter().enumerate() {
            let ahead = &entries[from as usize..from as usize + ROWS];
            for (row, &value) in self.rows.iter_mut().zip(ahead) {
                row[k] = value;
            }
        }
        self.moves = goes_on(tracks, steps);
    }
}

/// Where the lanes at these steps read their series.
#[inline(always)]
pub(in crate::engine) fn places(tracks: &TrackArrays<LANES>, steps: &Words) -> Words {
    let mut places = tracks.first;
    for ((place, &step), &last) in places.iter_mut().zip(steps).zip(&tracks.last) {
        *place += step.min(last);
    }
    places
}

/// Some lane's series goes on beyond its step.
#[inline(always)]
pub(in crate::engine) fn goes_on(tracks: &TrackArrays<LANES>, steps: &Words) -> bool {
    let mut on = 0;
    for (&step, &last) in steps.iter().zip(&tracks.last) {
        on |= u32::from(step < last);
    }
    on != 0
}

/// What all of these series are at every step, if they are all the same and constant.
fn standing(tracks: impl Iterator<Item = Track>, entries: &[f32]) -> Option<f32> {
    let mut found: Option<f32> = None;
    for track in tracks {
        let value = entries[track.first as usize];
        let is_new = found.is_some_and(|found| found.to_bits() != value.to_bits());
        if track.last != 0 || is_new {
            return None;
        }
        found = Some(value);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What no lane ever sees move is known once for the stream; the first one counts too.
    #[test]
    fn only_equal_constants_stand() {
        let entries = [1.0, 1.0, 2.0, 2.0];
        let track = |first, last| Track { first, last };
        let of = |tracks: &[Track]| standing(tracks.iter().copied(), &entries);
        assert_eq!(of(&[track(0, 0), track(1, 0)]), Some(1.0));
        assert_eq!(of(&[track(0, 0), track(2, 0)]), None);
        assert_eq!(of(&[track(0, 2), track(1, 0)]), None);
        assert_eq!(of(&[]), None);
    }
}
