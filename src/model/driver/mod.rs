//! The reference drivers of UN R157 and its companions: one file per model, each with its constants
//! (unit, clause), its check and its reaction, written once over [`Real`].
//!
//! A driver that is a function of the calling program is registered at run time ([`ModelId::register`]).
//!
//! This module defines what a driver sees ([`View`]), what it decides ([`Hazard`]) and how it brakes. It has no time
//! loop: the engine has the only one. Parameters come from a profile; decisions go to the lane's frame.
//!
//! To add a model: one file here, its twin in `shaders/`, one line in the registry (`registry.rs`). A test builds and
//! runs the worked example in `examples/adding-a-driver-model`.

#[macro_use]
mod registry;

mod attention;
mod foreign;
mod profile;

pub use attention::{AttentionRule, BelowTrigger, LaneGeometry, NEVER, lane_centre};
pub use foreign::{Accelerations, ForeignId, LaneColumns, MAX_ACCELERATION_MPS2, VectorDriver, row};
pub use profile::{Bound, DriverProfile};
pub(crate) use profile::{SHORT_STEP_S, delay_bound_s};

use crate::scalar::{Flag, Real};

/// Declares the modules, their public names and [`ModelId`] from the registry.
macro_rules! declare_models {
    ($($(#[$attribute:meta])* $file:ident, $model:ident, $profile:ident, $name:literal;)+) => {
        $(
            mod $file;
            pub use $file::{$model, $profile};
        )+

        /// A driver model, in the order of every table.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(try_from = "String", into = "String")]
        pub enum ModelId {
            $(
                #[doc = concat!("See [`", stringify!($model), "`].")]
                $model,
            )+
            /// A driver of this process.
            Foreign(ForeignId),
        }

        impl ModelId {
            /// All built-in models, in the order of every table.
            pub const ALL: [ModelId; MODELS] = [$(ModelId::$model),+];

            /// Name in tables, files and lane keys.
            pub fn name(self) -> &'static str {
                match self {
                    $(ModelId::$model => $name,)+
                    ModelId::Foreign(id) => id.name(),
                }
            }

            /// Position in [`ModelId::ALL`]; for another driver, that of the model for which it stands.
            pub fn index(self) -> usize {
                match self {
                    ModelId::Foreign(id) => id.index(),
                    built_in => ModelId::ALL.iter().position(|model| *model == built_in).unwrap_or(0),
                }
            }
        }

        /// Number of built-in models.
        pub const MODELS: usize = [$($name),+].len();
    };
}
for_every_driver_model!(declare_models);

pub use cchdm::CutInBraking;
pub use fsm::CfsStep;

impl ModelId {
    /// Parses the name of a built-in model or a registered driver, ignoring case; `CC` and `CC_human_driver` are the
    /// JRC's names for CCHDM.
    pub fn parse(text: &str) -> Option<ModelId> {
        ModelId::built_in(text).or_else(|| ModelId::registered(text))
    }

    fn built_in(text: &str) -> Option<ModelId> {
        let folded = text.to_ascii_lowercase();
        match folded.as_str() {
            "cc" | "cc_human_driver" => Some(ModelId::Cchdm),
            _ => ModelId::ALL.into_iter().find(|m| m.name().to_ascii_lowercase() == folded),
        }
    }

    /// All names as messages list them: `Reg157, CCHDM, RSS, FSM`.
    pub fn names() -> String {
        ModelId::ALL.map(ModelId::name).join(", ")
    }
}

impl From<ModelId> for String {
    fn from(model: ModelId) -> String {
        match model {
            ModelId::Foreign(id) => id.identity().to_owned(),
            built_in => built_in.name().to_owned(),
        }
    }
}

impl TryFrom<String> for ModelId {
    type Error = String;

    fn try_from(text: String) -> Result<ModelId, String> {
        let built_in = ModelId::ALL.into_iter().find(|model| model.name() == text);
        // A plan names its driver with the fingerprint: another driver of that name is not the plan's.
        let registered = || ModelId::registered(&text).filter(|_| text.contains('@'));
        built_in
            .or_else(registered)
            .ok_or_else(|| format!("there is no driver `{text}` in this process; expected one of {}", ModelId::names()))
    }
}

/// What the ego's driver sees of one other vehicle at one step. The ego stays in the middle of its lane.
#[derive(Debug, Clone, Copy)]
pub struct View<R> {
    /// v_e, m/s.
    pub v_ego: R,
    /// Acceleration of the ego over the last step, m/s²; 0 at the start.
    pub a_ego: R,
    /// v_o, m/s.
    pub v_other: R,
    /// g: signed gap, bumper to bumper, m; negative when the vehicles overlap along the road.
    pub gap: R,
    /// h: lateral gap, m; negative when the vehicles overlap laterally.
    pub lateral_gap: R,
    /// w: lateral speed of the other vehicle towards the ego, m/s.
    pub lateral_towards: R,
    /// (L_e + L_o)/2, m: the centre distance is `gap + half_lengths`.
    pub half_lengths: R,
    /// From the ego's side to the marking of its lane, m: the lateral gap of a vehicle whose near edge is on it.
    pub marking_gap: R,
}

impl<R: Real> View<R> {
    /// dv = v_e − v_o: closing speed, m/s.
    #[inline(always)]
    pub fn closing(&self) -> R {
        self.v_ego - self.v_other
    }

    /// x_e > x_o: the centre of the other vehicle is behind that of the ego.
    #[inline(always)]
    pub fn is_behind(&self) -> Flag {
        (self.gap + self.half_lengths).is_negative()
    }
}

/// The result of a check.
#[derive(Debug, Clone, Copy)]
pub struct Hazard<R> {
    /// The situation is unsafe: the driver reacts.
    pub is_unsafe: Flag,
    /// Deceleration demanded by the driver, m/s²; models without a graded demand return their maximum.
    pub demand: R,
}

/// Latched state of the ego's driver; never reset within a lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriverState<R> {
    /// Deceleration reached so far, m/s².
    pub deceleration: R,
    /// Remaining steps of the reaction time; decremented on unsafe steps only.
    pub delay_steps: u32,
}

/// A driver model in the lane arithmetic: pure functions of the view and the latched state.
pub trait DriverModel<R: Real>: Copy + Send + Sync {
    // The following items are guarantees of a model that let batches of lanes skip work; the defaults guarantee
    // nothing. Tests must check each guarantee: a false one changes verdicts.

    /// The check reads [`View::lateral_towards`].
    const SEES_LATERAL_SPEED: bool = true;

    /// The check reads [`View::a_ego`].
    const SEES_OWN_ACCELERATION: bool = true;
    /// The reaction reads [`DriverState::deceleration`].
    const KEEPS_DECELERATION: bool = true;

    /// Safe distance, m ≥ 0. While both vehicles keep their speeds, m/s, a vehicle that overlaps the ego laterally is
    /// safe at every larger gap. The caller may add a margin for rounding; infinite: no guarantee.
    #[inline(always)]
    fn safe_gap(&self, _v_ego: R, _v_other: R) -> R {
        R::INFINITY
    }

    /// Whether a vehicle beside the ego is safe at every gap, speed and acceleration of the ego, at this lateral gap h
    /// ≥ 0, m, lateral speed towards the ego, m/s, and marking gap, m. It uses the comparisons of the check itself,
    /// without the lateral speed if the check does not read it.
    #[inline(always)]
    fn ignores(&self, _lateral_gap: R, _lateral_towards: R, _marking_gap: R) -> Flag {
        Flag::FALSE
    }

    /// Whether the two following functions are implemented, and the reaction neither accelerates the ego nor restarts
    /// its reaction time.
    const KNOWS_STEADY_FOLLOWING: bool = false;

    /// Distance, m ≥ 0, beyond which the driver is in steady following of a vehicle that overlaps laterally and keeps
    /// its speed. [`DriverModel::check_steady`] then agrees with the check at every deceleration of the ego. It does
    /// not increase as the ego's speed, m/s, decreases. Rounding may make it too small by a thousandth and a
    /// millimetre.
    #[inline(always)]
    fn steady_gap(&self, _v_ego: R, _v_other: R) -> R {
        R::INFINITY
    }

    /// The part of the check that can trigger in steady following: unsafe exactly where the check is, with the same
    /// demand. It reads speeds, gap and lengths; the other fields of the view are undefined.
    #[inline(always)]
    fn check_steady(&self, view: &View<R>) -> Hazard<R> {
        self.check(view)
    }

    /// State at the start of a lane.
    fn initial(&self) -> DriverState<R>;
    /// Checks whether this vehicle makes the situation unsafe, and how hard the ego should brake.
    fn check(&self, view: &View<R>) -> Hazard<R>;
    /// Whether a reaction that has begun continues regardless of the check. `view` is the principal vehicle's. While
    /// both vehicles keep their speeds the result never changes to true.
    #[inline(always)]
    fn keeps_braking(&self, _state: &DriverState<R>, _view: &View<R>) -> Flag {
        Flag::FALSE
    }
    /// The model's constants by their names in its shader (`override driver_…`); flags are 0 or 1.
    fn shader_constants(&self) -> Vec<(&'static str, f64)>;
    /// Reacts to one unsafe step: returns the new state and the ego's next speed, m/s, between 0 and `v_ego`.
    fn react(&self, state: DriverState<R>, hazard: &Hazard<R>, v_ego: R) -> (DriverState<R>, R);
}

/// One unsafe step of any model: the ego coasts once for the reaction time, then the deceleration follows `braking`;
/// the speed stops at 0.
#[inline(always)]
fn latched_braking<R: Real>(state: DriverState<R>, coasting: R, braking: R, v_ego: R, dt: R) -> (DriverState<R>, R) {
    let is_delayed = Flag::reached(state.delay_steps, 1);
    let applied = is_delayed.choose(coasting, braking);
    let deceleration = is_delayed.choose(state.deceleration, braking);
    let delay_steps = state.delay_steps - is_delayed.one();
    let v_next = (v_ego - applied * dt).larger(R::ZERO);
    (DriverState { deceleration, delay_steps }, v_next)
}

/// Delay in whole steps. Computed in f64: in f32, 0.6 s / 0.04 s would give 16 steps.
fn delay_steps(delay_s: f64, dt_s: f64) -> u32 {
    ((delay_s / dt_s - 1e-9).ceil().max(0.0) as u32).min(Flag::LATEST_STEP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::category::Category;
    use crate::profile::Profile;
    use lanesweep_random::philox4x32_10;

    #[test]
    fn delays_are_whole_steps_rounded_up_without_the_error_of_the_quotient() {
        assert_eq!(delay_steps(0.75, 0.1), 8);
        assert_eq!(delay_steps(0.35, 0.1), 4);
        assert_eq!(delay_steps(0.6, 0.04), 15);
        assert_eq!(delay_steps(0.0, 0.04), 0);
        // Never, as a step index that lanes can count down from.
        assert_eq!(delay_steps(f64::MAX, 0.04), Flag::LATEST_STEP);
    }

    /// Checks on random vehicles that a model keeps its guarantees about gaps and vehicles beside the lane, and that
    /// the guarantees are not weaker than necessary.
    fn keeps_its_promises<M: DriverModel<f32>>(name: &str, model: M) {
        let mut drawn = 0;
        let mut between = |min: f32, max: f32| {
            drawn += 1;
            min + (max - min) * philox4x32_10([drawn, 0, 0, 0], [7, 0])[0] as f32 / 2_f32.powi(32)
        };
        let (mut unsafe_below, mut safe, mut ignored) = (0, 0, 0);
        let (mut is_steady, mut unsteady_below) = (0, 0);
        for _ in 0..200_000 {
            let (v_ego, v_other) = (between(0.0, 45.0), between(0.0, 45.0));
            let view = View {
                v_ego,
                a_ego: 0.0,
                v_other,
                gap: between(0.0, 200.0),
                lateral_gap: between(-2.0, 0.0),
                lateral_towards: between(-2.0, 2.0),
                half_lengths: between(3.0, 10.0),
                marking_gap: between(0.4, 1.2),
            };
            let safe_gap = model.safe_gap(v_ego, v_other);
            let is_unsafe = model.check(&view).is_unsafe.holds();
            if view.gap > 1.001 * safe_gap + 0.001 {
                assert!(!is_unsafe, "{name}: {view:?} is unsafe beyond {safe_gap} m");
                safe += 1;
            } else if is_unsafe && view.gap > 0.9 * safe_gap {
                unsafe_below += 1;
            }
            let (lateral_gap, gap, a_ego) = (between(0.0, 4.0), between(-20.0, 50.0), between(-10.0, 0.0));
            let beside = View { lateral_gap, gap, a_ego, ..view };
            let is_unsafe = model.check(&beside).is_unsafe.holds();
            if model.ignores(beside.lateral_gap, beside.lateral_towards, beside.marking_gap).holds() {
                assert!(!is_unsafe, "{name}: {beside:?} is ignored and unsafe");
                ignored += 1;
            }
            if !M::KNOWS_STEADY_FOLLOWING {
                assert_eq!(model.steady_gap(v_ego, v_other), f32::INFINITY, "{name}");
                continue;
            }
            let (steady_gap, slowing) = (model.steady_gap(v_ego, v_other), View { a_ego: between(-10.0, 0.0), ..view });
            let said =
                |hazard: Hazard<f32>| (hazard.is_unsafe.holds(), hazard.is_unsafe.holds().then_some(hazard.demand));
            let hazard = model.check(&slowing);
            // Batches of lanes leave all other fields undefined.
            let seen = View { a_ego: 0.0, lateral_gap: -1.9, lateral_towards: 0.0, ..slowing };
            let is_same = said(hazard) == said(model.check_steady(&seen));
            if view.gap > 1.001 * steady_gap + 0.001 {
                assert!(is_same, "{name}: {slowing:?} does not follow steadily beyond {steady_gap} m");
                let state = DriverState { deceleration: -slowing.a_ego, delay_steps: 0 };
                let (reacting, v_next) = model.react(state, &hazard, v_ego);
                let reacts_well = v_next <= v_ego && reacting.delay_steps == 0;
                assert!(!hazard.is_unsafe.holds() || reacts_well, "{name}: {slowing:?}");
                assert!(
                    model.steady_gap(v_ego - between(0.0, 1.0) * v_ego, v_other) <= steady_gap,
                    "{name}: {slowing:?}"
                );
                is_steady += 1;
            } else if !is_same && view.gap > 0.9 * steady_gap {
                unsteady_below += 1;
            }
        }
        assert!(
            !M::KNOWS_STEADY_FOLLOWING || is_steady > 1000 && unsteady_below > 100,
            "{name}: {is_steady}, {unsteady_below}"
        );
        assert!(safe > 1000 && ignored > 1000, "{name}: {safe} safe, {ignored} ignored");
        assert!(unsafe_below > 100, "{name}: the safe distance could be smaller");
    }

    /// Covers the models that come with the crate.
    #[test]
    fn models_keep_their_promises_under_every_profile() {
        for name in Profile::names() {
            let profile = Profile::load(name).unwrap();
            let dt_s = profile.frame.dt_s;
            let always = |categories: &[Category]| categories.contains(&Category::CutOut);
            if !always(&profile.reg157.always_unsafe) {
                keeps_its_promises(name, profile.reg157.resolve::<f32>(dt_s, Category::CutOut));
            }
            if !always(&profile.cchdm.always_unsafe) {
                keeps_its_promises(name, profile.cchdm.resolve::<f32>(dt_s, Category::CutOut));
            }
            keeps_its_promises(name, profile.rss.resolve::<f32>(dt_s, Category::CutOut));
            keeps_its_promises(name, profile.fsm.resolve::<f32>(dt_s, Category::CutOut));
        }
    }

    #[test]
    fn model_names_survive_a_round_trip() {
        for model in ModelId::ALL {
            assert_eq!(ModelId::parse(model.name()), Some(model));
        }
        assert_eq!(ModelId::parse("CC_human_driver"), Some(ModelId::Cchdm));
    }
}
