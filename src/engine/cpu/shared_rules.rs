//! Rules that all lanes of a stream share. Each set of rules has its own compiled loop, so the loop tests none of them.

use lanesweep_model::criterion::{BtnForm, Criteria, LateralGate};

use crate::frame::Frame;
use crate::scene::Scene;

/// A set of rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Rules {
    /// Common properties of the other vehicles.
    pub scene: Scene,
    is_ratio: bool,
    sees_overlap: bool,
    /// Rarely used rules share a loop that tests the lateral gate, the abort and which of two vehicles counts.
    is_seldom: bool,
    /// The sweep returns only verdicts: minima and maxima are not gathered.
    pub is_verdict_only: bool,
    /// The sweep returns values, so measures are gathered. Rarely used rules gather minima and maxima for verdicts too.
    pub keeps_measures: bool,
}

impl Rules {
    /// Number of sets.
    pub(crate) const SETS: u32 = 22;

    const VERDICT_ONLY: u32 = 4;
    const SELDOM: u32 = 8;
    const IN_LANE: u32 = 12;
    const STEADY_FOLLOWING: u32 = 13;
    const CROSSING: u32 = 14;
    const SELDOM_VALUES: u32 = 18;

    /// Rules of a simulation; `None` for the exact form of the BTN, which iterates and runs lane by lane.
    /// `values`: the sweep returns values, not only verdicts.
    pub(crate) fn of(frame: &Frame<f32>, criteria: &Criteria<f32>, scene: Scene, values: bool) -> Option<Rules> {
        let is_ratio = match criteria.btn.form() {
            BtnForm::EquivalentDelay => false,
            BtnForm::DistanceRatio => true,
            BtnForm::Exact => return None,
        };
        let is_seldom = is_ratio || frame.abort_above_ttc > 0.0 || frame.largest_demand;
        let sees_overlap = criteria.gate == LateralGate::Overlap && !is_seldom;
        let is_verdict_only = !values && !is_seldom;
        // Rarely used rules always test for contacts between two steps.
        let may_cross = scene.may_cross || is_seldom;
        let scene = Scene { in_lane: scene.in_lane && is_verdict_only, may_cross, ..scene };
        Some(Rules { scene, is_ratio, sees_overlap, is_seldom, is_verdict_only, keeps_measures: values })
    }

    /// Rules of steady-following steps with a single vehicle, for verdicts only.
    pub(crate) fn is_steady() -> Rules {
        Rules::from_bits(Rules::STEADY_FOLLOWING)
    }

    /// Encoded as a number below [`Rules::SETS`].
    pub(crate) const fn bits(self) -> u32 {
        if self.scene.is_steady {
            return Rules::STEADY_FOLLOWING;
        }
        if self.scene.in_lane {
            // Lateral motion is not evaluated, so there is no gate.
            return Rules::IN_LANE;
        }
        if self.is_seldom {
            let first = if self.keeps_measures { Rules::SELDOM_VALUES } else { Rules::SELDOM };
            return first + (self.scene.is_pair as u32 | (self.is_ratio as u32) << 1);
        }
        if self.scene.may_cross {
            return Rules::CROSSING + (self.sees_overlap as u32 | (self.is_verdict_only as u32) << 1);
        }
        let first = if self.is_verdict_only { Rules::VERDICT_ONLY } else { 0 };
        first + (self.scene.is_pair as u32 | (self.sees_overlap as u32) << 1)
    }

    /// Inverse of [`Rules::bits`].
    pub(crate) const fn from_bits(bits: u32) -> Rules {
        let is_pair = bits & 1 != 0;
        let scene = Scene { is_pair, always_there: !is_pair, in_lane: false, is_steady: false, may_cross: false };
        let common = Rules {
            scene,
            is_ratio: false,
            sees_overlap: false,
            is_seldom: false,
            is_verdict_only: false,
            keeps_measures: true,
        };
        let keeps_measures = bits >= Rules::SELDOM_VALUES;
        let seldom = bits.wrapping_sub(if keeps_measures { Rules::SELDOM_VALUES } else { Rules::SELDOM });
        if seldom < 4 {
            let scene = Scene { may_cross: true, ..scene };
            return Rules { scene, is_ratio: seldom & 2 != 0, is_seldom: true, keeps_measures, ..common };
        }
        if bits >= Rules::CROSSING {
            let scene = Scene { is_pair: true, always_there: false, may_cross: true, ..scene };
            let (sees_overlap, is_verdict_only) =
                ((bits - Rules::CROSSING) & 1 != 0, (bits - Rules::CROSSING) & 2 != 0);
            return Rules { scene, sees_overlap, is_verdict_only, keeps_measures: !is_verdict_only, ..common };
        }
        if bits >= Rules::IN_LANE {
            // Lateral motion is not evaluated, so there is no gate.
            let scene = Scene { is_steady: bits == Rules::STEADY_FOLLOWING, ..Scene::in_lane() };
            return Rules { scene, is_verdict_only: true, keeps_measures: false, ..common };
        }
        let is_verdict_only = bits >= Rules::VERDICT_ONLY;
        Rules { sees_overlap: bits & 2 != 0, is_verdict_only, keeps_measures: !is_verdict_only, ..common }
    }

    /// The constants of the simulation; those that the rules fix become compile-time constants.
    #[inline(always)]
    pub(crate) fn applied(self, frame: &Frame<f32>, criteria: &Criteria<f32>) -> (Frame<f32>, Criteria<f32>) {
        let form = if self.is_ratio { BtnForm::DistanceRatio } else { BtnForm::EquivalentDelay };
        let (gate, abort_above_ttc) = match (self.is_seldom, self.sees_overlap) {
            (true, _) => (criteria.gate, frame.abort_above_ttc),
            (false, true) => (LateralGate::Overlap, 0.0),
            (false, false) => (LateralGate::EgoWidth, 0.0),
        };
        let largest_demand = self.is_seldom && frame.largest_demand;
        let frame = Frame { abort_above_ttc, largest_demand, ..*frame };
        let (keeps_values, keeps_measures) = (!self.is_verdict_only, self.keeps_measures);
        (frame, Criteria { gate, keeps_values, keeps_measures, btn: criteria.btn.known_as(form), ..*criteria })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_a_set_comes_back_from_its_rules() {
        for bits in 0..Rules::SETS {
            assert_eq!(Rules::from_bits(bits).bits(), bits);
        }
    }
}
