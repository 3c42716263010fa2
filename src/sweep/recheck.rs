//! A device is believed lane by lane only where it was seen to be right: one in a thousand of its lanes is
//! computed again on the CPU.

use std::ops::Range;

use super::backend::Chunk;
use super::outcome::{Outcome, Verdicts};
use super::plan::{LaneKey, LanePlan};
use super::runner::LaneRunner;
use crate::{Error, Result};

/// One lane in so many is checked unless told otherwise.
pub const ONE_IN: u64 = 1000;

/// A seeded sample of a plan's lanes: one of each `one_in` consecutive ones. Which depends on the seed and the
/// lane alone, not on chunks.
pub struct Recheck<'p> {
    plan: &'p LanePlan,
    runner: LaneRunner<'p, f32>,
    seed: u64,
    one_in: u64,
}

impl<'p> Recheck<'p> {
    /// Checks one lane in `one_in` (at least 1).
    pub fn new(plan: &'p LanePlan, seed: u64, one_in: u64) -> Self {
        Recheck { plan, runner: LaneRunner::new(plan), seed, one_in: one_in.max(1) }
    }

    /// Computes the chosen lanes of a chunk again and compares every word that it has. Gives their number.
    ///
    /// # Errors
    /// [`Error::Verification`] with the first lane that differs.
    pub fn check(&self, chunk: &Chunk, device: &str) -> Result<u64> {
        self.check_some(chunk, device, self.one_in)
    }

    fn check_some(&self, chunk: &Chunk, device: &str, one_in: u64) -> Result<u64> {
        if chunk.verdicts.is_empty() {
            return Ok(0);
        }
        let end = chunk.first_lane + chunk.verdicts.len() as u64;
        let mut checked = 0;
        for lane in self.chosen(chunk.first_lane..end, one_in) {
            let at = (lane - chunk.first_lane) as usize;
            let Some(key) = self.plan.key(lane) else { continue };
            let ours = self.runner.run(&key);
            let same = match chunk.outcomes.get(at) {
                Some(theirs) => same_words(&ours.widen(), theirs),
                None => chunk.verdicts[at] == ours.verdicts,
            };
            if !same {
                return Err(self.mismatch(&key, device, chunk.verdicts[at], &ours, chunk.outcomes.get(at)));
            }
            checked += 1;
        }
        Ok(checked)
    }

    /// The chosen units of an interval, for a sweep that gives no lanes back.
    pub fn units(&self, units: Range<u64>) -> impl Iterator<Item = u64> {
        self.chosen(units, self.one_in)
    }

    /// Computes every lane of a chunk again; see [`Recheck::check`].
    ///
    /// # Errors
    /// [`Error::Verification`] with the first lane that differs.
    pub fn check_all(&self, chunk: &Chunk, device: &str) -> Result<u64> {
        self.check_some(chunk, device, 1)
    }

    /// The chosen lanes of an interval, ascending.
    fn chosen(&self, lanes: Range<u64>, one_in: u64) -> impl Iterator<Item = u64> {
        let seed = self.seed;
        (lanes.start / one_in..lanes.end.div_ceil(one_in))
            .map(move |stratum| stratum * one_in + mixed(seed, stratum) % one_in)
            .filter(move |lane| lanes.contains(lane))
    }

    fn mismatch(
        &self,
        key: &LaneKey,
        device: &str,
        theirs: Verdicts,
        ours: &Outcome<f32>,
        outcome: Option<&Outcome<f64>>,
    ) -> Error {
        let found = outcome.map_or(format!("verdict bits {:#06b}", theirs.0), |o| format!("{o:?}"));
        let expected =
            outcome.map_or(format!("verdict bits {:#06b}", ours.verdicts.0), |_| format!("{:?}", ours.widen()));
        Error::Verification(format!(
            "lane {}: {device} says {found}, the CPU {expected}. Nothing that this device computed can be trusted; \
             `lanesweep verify` tells how often it errs, --backend cpu computes without it",
            self.plan.key_text(key)
        ))
    }
}

/// Every word equal, bit for bit: NaN equals itself, 0 does not equal −0.
pub fn same_words(a: &Outcome<f64>, b: &Outcome<f64>) -> bool {
    words(a) == words(b)
}

/// An outcome as words, in the order of its fields; values as the bits of their exact widening.
pub fn words(outcome: &Outcome<f64>) -> [u64; 12] {
    [
        outcome.verdicts.0.into(),
        outcome.contact.code().into(),
        outcome.contact_with.into(),
        outcome.end as u64,
        outcome.reaction_step.into(),
        outcome.contact_step.into(),
        outcome.end_step.into(),
        outcome.impact_speed.to_bits(),
        outcome.impact_closing_speed.to_bits(),
        outcome.min_ttc.to_bits(),
        outcome.max_btn.to_bits(),
        outcome.min_gap.to_bits(),
    ]
}

/// A well-mixed number per seed and index (SplitMix64).
fn mixed(seed: u64, index: u64) -> u64 {
    let mut z = seed.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
