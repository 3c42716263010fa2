//! The motions of a task's cases as unrolled series: one series per quantity and vehicle, made once for all lanes of a
//! case. The last entry of every series is repeated, so that a batch reads [`ROWS`] entries at a time without testing
//! for the end. A [`Window`] holds one quantity for all lanes of a batch over the rows of a burst.

use crate::cpu::batch_arrays::{Floats, Track, TrackArrays, VehicleTracks, Words};
use crate::cpu::{LANES, ROWS};
use crate::lane_case::LaneCase;
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::{LATERAL_SAMPLED, Motion, SPEED_SAMPLED, Tables};

/// The pool that series lie in.
#[derive(Debug, Default)]
pub(crate) struct Series {
    entries: Vec<f32>,
}

/// Maximum number of entries of a vehicle's motion.
pub(crate) fn max_entries(step_cap: u32) -> u64 {
    3 * (u64::from(step_cap) + 1 + ROWS as u64)
}

impl Series {
    /// Empties the pool but keeps its memory.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
    }

    /// All entries.
    pub(crate) fn entries(&self) -> &[f32] {
        &self.entries
    }

    /// Unrolls the motions of a case, up to the step cap: principal vehicle, then the one ahead of it. A case without
    /// the latter has the principal's tracks twice.
    pub(crate) fn unroll(&mut self, case: &LaneCase<f32>, tables: &Tables<f32>, step_cap: u32) -> [VehicleTracks; 2] {
        let principal = self.vehicle(&case.others[0].motion, tables, step_cap);
        let ahead = if case.pair != 0 { self.vehicle(&case.others[1].motion, tables, step_cap) } else { principal };
        [principal, ahead]
    }

    fn vehicle(&mut self, motion: &Motion<f32>, tables: &Tables<f32>, step_cap: u32) -> VehicleTracks {
        let cap = step_cap.max(1);
        let speed = if motion.kind & SPEED_SAMPLED != 0 {
            let from = motion.speed_offset as usize;
            let table = &tables.speed[from..from + motion.speed_len.min(cap) as usize];
            self.track(|entries| entries.extend_from_slice(table))
        } else {
            let steps = motion.speed_until.saturating_add(1).min(cap);
            self.track(|entries| {
                let speed = |step| (motion.speed_initial + f32::from_step(step) * motion.speed_per_step).larger(0.0);
                entries.extend((0..steps).map(speed));
                entries.push(motion.speed_end);
            })
        };
        if motion.kind & LATERAL_SAMPLED != 0 {
            let from = motion.lateral_offset as usize;
            let table = &tables.lateral[from..from + motion.lateral_len.min(cap) as usize];
            let position = self.track(|entries| entries.extend(table.iter().map(|&[position, _]| position)));
            let towards = self.track(|entries| {
                entries.extend(table.iter().map(|&[_, towards]| towards));
                entries.push(0.0);
            });
            return [speed, position, towards];
        }
        let steps = motion.lateral_until.saturating_add(1).min(cap);
        let position = self.track(|entries| {
            let position = |step| motion.lateral_initial + f32::from_step(step) * motion.lateral_per_step;
            entries.extend((0..steps).map(position));
            entries.push(motion.lateral_end);
        });
        let towards = self.track(|entries| {
            entries.resize(entries.len() + steps as usize, motion.lateral_towards);
            entries.push(0.0);
        });
        [speed, position, towards]
    }

    /// Adds a series of at least one entry.
    fn track(&mut self, add: impl FnOnce(&mut Vec<f32>)) -> Track {
        let first = self.entries.len();
        add(&mut self.entries);
        let end = self.entries[self.entries.len() - 1];
        let held = self.entries[first..].iter().rev().take_while(|v| v.to_bits() == end.to_bits()).count();
        let last = self.entries.len() - held;
        self.entries.resize(last + ROWS, end);
        // The size of a task is limited far below this.
        let place = |at: usize| u32::try_from(at).expect("a task's series have less than 2^32 entries");
        Track { first: place(first), last: place(last - first) }
    }
}

/// Rows of one quantity of one vehicle.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Window {
    /// One row per step.
    pub rows: [Floats; ROWS],
    /// The series of at least one lane continues beyond these rows.
    pub moves: bool,
    /// The value is the same for all lanes of the stream at all steps.
    pub stands: bool,
}

impl Window {
    /// Before the first lane of a stream with these series.
    pub(super) fn new(tracks: impl Iterator<Item = Track>, entries: &[f32]) -> Self {
        let value = standing(tracks, entries);
        Window { rows: [[value.unwrap_or(0.0); LANES]; ROWS], moves: false, stands: value.is_some() }
    }

    /// Copies the rows from the series entry by entry; portable.
    #[inline(always)]
    pub(super) fn turn(&mut self, tracks: &TrackArrays<LANES>, steps: &Words, entries: &[f32]) {
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

/// Positions in the pool at which the lanes read their series at these steps.
#[inline(always)]
pub(crate) fn places(tracks: &TrackArrays<LANES>, steps: &Words) -> Words {
    let mut places = tracks.first;
    for ((place, &step), &last) in places.iter_mut().zip(steps).zip(&tracks.last) {
        *place += step.min(last);
    }
    places
}

/// Whether the series of some lane continues beyond its step.
#[inline(always)]
pub(crate) fn goes_on(tracks: &TrackArrays<LANES>, steps: &Words) -> bool {
    let mut on = 0;
    for (&step, &last) in steps.iter().zip(&tracks.last) {
        on |= u32::from(step < last);
    }
    on != 0
}

/// The value of all these series if they are equal and constant.
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
    use lanesweep_model::scenario::{Lateral, Speed};

    /// The unrolled series equal the motion at every step, also beyond its end.
    #[test]
    fn unrolled_series_are_the_motions() {
        let sampled = Speed::Sampled(vec![10.0, 9.0, 8.5, 8.5, 8.5]);
        let braking = Speed::Kinematic { initial_mps: 3.0, acceleration_mps2: -2.0, until_s: 2.0 };
        let change = Lateral::Kinematic { start_m: 3.5, rate_mps: -1.0, end_m: 0.25 };
        let recorded = Lateral::Sampled { position_m: vec![2.0, 1.9, 1.9], towards_mps: vec![1.0, 1.0, 0.5] };
        for (speed, lateral) in [(&sampled, &change), (&braking, &recorded), (&Speed::constant(7.0), &Lateral::Centred)]
        {
            let mut tables = Tables::default();
            let motion: Motion<f32> = Motion::encode(speed, lateral, 0.1, &mut tables).cast();
            let tables: Tables<f32> = tables.cast();
            let mut series = Series::default();
            let tracks = series.vehicle(&motion, &tables, 1200);
            let at = |track: Track, step: u32| series.entries[(track.first + step.min(track.last)) as usize];
            for step in 0..1200 {
                assert_eq!(at(tracks[0], step), motion.speed(&tables, step), "{speed:?} {step}");
                let state = motion.lateral(&tables, step);
                assert_eq!(at(tracks[1], step), state.position, "{lateral:?} {step}");
                assert_eq!(at(tracks[2], step), state.towards, "{lateral:?} {step}");
            }
            for track in tracks {
                let from = (track.first + track.last) as usize;
                assert!(series.entries[from..from + ROWS].iter().all(|&v| v == series.entries[from]));
            }
        }
    }

    /// A motion that continues to the cap has as many entries as the lane has steps.
    #[test]
    fn a_motion_without_end_is_unrolled_to_the_cap() {
        let speed = Speed::Kinematic { initial_mps: 3.0, acceleration_mps2: 0.5, until_s: f64::MAX };
        let motion = Motion::encode(&speed, &Lateral::Centred, 0.1, &mut Tables::default()).cast();
        let mut series = Series::default();
        series.vehicle(&motion, &Tables::default(), 100);
        assert!(series.entries.len() as u64 <= max_entries(100));
    }

    /// A value is constant for the stream only if all lanes, including the first, have the same constant.
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
