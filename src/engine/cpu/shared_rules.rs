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
    /// Measures are gathered: the sweep returns values, or the rules are rarely used.
    pub keeps_measures: bool,
}

const ALONE: Scene = Scene { in_lane: false, ..Scene::in_lane() };
const PAIR: Scene = Scene { is_pair: true, always_there: false, ..ALONE };
const STEADY: Scene = Scene { is_steady: true, ..Scene::in_lane() };
const ALONE_CROSSING: Scene = Scene { may_cross: true, ..ALONE };
const CROSSING: Scene = Scene { may_cross: true, ..PAIR };

const fn usual(scene: Scene, sees_overlap: bool, is_verdict_only: bool) -> Rules {
    let (is_ratio, is_seldom, keeps_measures) = (false, false, !is_verdict_only);
    Rules { scene, is_ratio, sees_overlap, is_seldom, is_verdict_only, keeps_measures }
}

const fn seldom(scene: Scene, is_ratio: bool, keeps_measures: bool) -> Rules {
    Rules { scene, is_ratio, sees_overlap: false, is_seldom: true, is_verdict_only: false, keeps_measures }
}

impl Rules {
    /// Every set. Lateral motion in the lane is not evaluated, so there is no gate.
    #[rustfmt::skip] // a table
    pub(crate) const ALL: [Rules; 22] = [
        usual(ALONE, false, false), usual(PAIR, false, false), usual(ALONE, true, false), usual(PAIR, true, false),
        usual(ALONE, false, true), usual(PAIR, false, true), usual(ALONE, true, true), usual(PAIR, true, true),
        usual(CROSSING, false, false), usual(CROSSING, true, false), usual(CROSSING, false, true), usual(CROSSING, true, true),
        usual(Scene::in_lane(), false, true), usual(STEADY, false, true),
        seldom(ALONE_CROSSING, false, false), seldom(CROSSING, false, false), seldom(ALONE_CROSSING, true, false), seldom(CROSSING, true, false),
        seldom(ALONE_CROSSING, false, true), seldom(CROSSING, false, true), seldom(ALONE_CROSSING, true, true), seldom(CROSSING, true, true),
    ];

    /// Rules of a simulation; `None` for the exact form of the BTN, which iterates and runs lane by lane.
    /// `values`: the sweep returns values, not only verdicts.
    pub(crate) fn of(frame: &Frame<f32>, criteria: &Criteria<f32>, scene: Scene, values: bool) -> Option<Rules> {
        // Rarely used rules always test for contacts between two steps and keep measures: fewer loops to compile.
        let rarely_used = Rules::side_by_side(criteria, scene.is_pair, true)?;
        if rarely_used.is_ratio || frame.abort_above_ttc > 0.0 || frame.largest_demand {
            return Some(rarely_used);
        }
        let sees_overlap = criteria.gate == LateralGate::Overlap;
        Some(match scene {
            Scene { in_lane: true, .. } if !values => usual(Scene::in_lane(), false, true),
            Scene { may_cross: true, .. } => usual(CROSSING, sees_overlap, !values),
            Scene { is_pair, .. } => usual(if is_pair { PAIR } else { ALONE }, sees_overlap, !values),
        })
    }

    /// The rarely used rules, which are those of lanes of drivers outside the registry: such a driver may accelerate, so
    /// any of its lanes may cross. `None` for the exact form of the BTN.
    pub(crate) fn side_by_side(criteria: &Criteria<f32>, is_pair: bool, keeps_measures: bool) -> Option<Rules> {
        let is_ratio = match criteria.btn.form() {
            BtnForm::EquivalentDelay => false,
            BtnForm::DistanceRatio => true,
            BtnForm::Exact => return None,
        };
        Some(seldom(if is_pair { CROSSING } else { ALONE_CROSSING }, is_ratio, keeps_measures))
    }

    /// Rules of steady-following steps with a single vehicle, for verdicts only.
    pub(crate) fn is_steady() -> Rules {
        usual(STEADY, false, true)
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
    use crate::Constants;
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scenario::Category;

    #[test]
    fn every_simulation_has_a_set_and_no_set_is_there_twice() {
        let constants = Constants::<f32>::resolve(&Profile::load("paper").unwrap(), Category::CutIn);
        let scenes =
            [ALONE, PAIR, Scene::in_lane(), ALONE_CROSSING, CROSSING, Scene::unknown(false), Scene::unknown(true)];
        let mut found = vec![Rules::is_steady()];
        for scene in scenes {
            for (gate, abort_above_ttc) in
                [(LateralGate::Overlap, 0.0), (LateralGate::EgoWidth, 0.0), (LateralGate::EgoWidth, 9.0)]
            {
                let frame = Frame { abort_above_ttc, ..constants.frames[0] };
                let criteria = Criteria { gate, ..constants.criteria };
                found.extend([false, true].map(|values| Rules::of(&frame, &criteria, scene, values).unwrap()));
                found.extend(Rules::side_by_side(&criteria, scene.is_pair, false));
            }
        }
        assert!(found.iter().all(|rules| Rules::ALL.contains(rules)));
        // All but those of the distance ratio.
        assert!(Rules::ALL.iter().all(|rules| rules.is_ratio || found.contains(rules)));
        assert!((0..Rules::ALL.len()).all(|at| !Rules::ALL[..at].contains(&Rules::ALL[at])));
    }
}
