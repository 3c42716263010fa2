//! What all lanes of a batch see of one quantity over the rows of a burst: their series, turned.

use super::batch_arrays::{Floats, LANES, ROWS, Words};
use super::series::Track;

/// Rows of one quantity of one vehicle.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Window {
    /// One row per step.
    pub rows: [Floats; ROWS],
    /// First entries of the lanes' series.
    first: Words,
    /// Their last ones, counted from the first.
    last: Words,
    /// Some lane's rows are not what it will see for ever.
    pub moves: bool,
}

impl Window {
    /// All lanes see 0.
    pub const IDLE: Self = Window { rows: [[0.0; LANES]; ROWS], first: [0; LANES], last: [0; LANES], moves: false };

    /// Gives a slot the series of its next lane.
    #[inline(always)]
    pub fn set(&mut self, k: usize, track: Track, entries: &[f32]) {
        self.first[k] = track.first;
        self.last[k] = track.last;
        // A constant that stands in all rows already needs no turn.
        let stands = track.last == 0 && self.rows[0][k].to_bits() == entries[track.first as usize].to_bits();
        self.moves |= !stands;
    }

    /// Where the lanes at these steps read their series.
    #[inline(always)]
    pub fn places(&self, steps: &Words) -> Words {
        let mut places = self.first;
        for ((place, &step), &last) in places.iter_mut().zip(steps).zip(&self.last) {
            *place += step.min(last);
        }
        places
    }

    /// Some lane's series goes on beyond its step.
    #[inline(always)]
    pub fn goes_on(&self, steps: &Words) -> bool {
        let mut on = 0;
        for (&step, &last) in steps.iter().zip(&self.last) {
            on |= u32::from(step < last);
        }
        on != 0
    }

    /// Takes the rows from the series: entry by entry, on every machine.
    #[inline(always)]
    pub fn turn(&mut self, steps: &Words, entries: &[f32]) {
        let places = self.places(steps);
        for (k, &from) in places.iter().enumerate() {
            let ahead = &entries[from as usize..from as usize + ROWS];
            for (row, &value) in self.rows.iter_mut().zip(ahead) {
                row[k] = value;
            }
        }
        self.moves = self.goes_on(steps);
    }
}
