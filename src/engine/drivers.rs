//! The profile's constants for one category, resolved, and the dispatch over driver models.

use lanesweep_model::criterion::Criteria;
use lanesweep_model::driver::{self, DriverModel, DriverProfile, ModelId};
use lanesweep_model::profile::Profile;
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::{Category, Tables};

use super::cpu::foreign::{Setting, run_one};
use super::cpu::lane_result::Ending;
use super::cpu::lane_stream::run_stream;
use super::cpu::pending_lanes::Lanes;
use super::cpu::shared_rules::Rules;
use super::cpu::simd::Instructions;
use super::frame::{Frame, Simulation, Start};
use super::lane::{Step, run_lane};
use super::lane_case::LaneCase;
use super::outcome::Outcome;
use super::scene::Scene;

/// Defines [`Constants`] and its dispatch from the registry of driver models.
macro_rules! declare_constants {
    ($($(#[$attribute:meta])* $file:ident, $model:ident, $profile:ident, $name:literal;)+) => {
        /// Everything a lane of one category takes from the profile, as plain constants.
        #[derive(Debug, Clone, Copy)]
        pub struct Constants<R> {
            /// Time step, s.
            pub dt_s: f64,
            /// Criteria.
            pub criteria: Criteria<R>,
            /// Time and end rules, per model in the order of [`ModelId::ALL`].
            pub frames: [Frame<R>; driver::MODELS],
            $(
                #[doc = $name]
                pub $file: driver::$model<R>,
            )+
        }

        impl<R: Real> Constants<R> {
            /// Resolves a profile, in f64, and rounds once.
            pub fn resolve(profile: &Profile, category: Category) -> Self {
                let dt_s = profile.frame.dt_s;
                Constants {
                    dt_s,
                    criteria: profile.criteria.resolve(),
                    frames: [$(Frame::resolve(&profile.frame, profile.$file.abort_above_ttc_s())),+],
                    $($file: profile.$file.resolve(dt_s, category),)+
                }
            }

            /// Runs one lane with the chosen model.
            #[inline]
            pub fn run(
                &self,
                id: ModelId,
                case: &LaneCase<R>,
                tables: &Tables<R>,
                start: Start<R>,
                observer: impl FnMut(&Step<R>),
            ) -> Outcome<R> {
                self.run_in(id, &self.criteria, Scene::unknown(case.pair != 0), case, tables, start, observer)
            }

            /// The same, with these criteria and known properties of the case.
            #[inline]
            #[expect(clippy::too_many_arguments, reason = "a lane has as many properties")]
            pub(super) fn run_in(
                &self,
                id: ModelId,
                criteria: &Criteria<R>,
                scene: Scene,
                case: &LaneCase<R>,
                tables: &Tables<R>,
                start: Start<R>,
                observer: impl FnMut(&Step<R>),
            ) -> Outcome<R> {
                let model_index = id.index();
                let frame = &self.frames[model_index];
                match id {
                    $(ModelId::$model => {
                        let model = &self.$file;
                        let simulation = Simulation { frame, criteria, model, model_index, scene };
                        run_lane(&simulation, case, tables, start, observer)
                    })+
                    ModelId::Foreign(_) => foreign_lane(self, id, case, tables, start, observer),
                }
            }

            /// The constants of a model by their names in its shader.
            pub(crate) fn driver_shader_constants(&self, id: ModelId) -> Vec<(&'static str, f64)> {
                match id {
                    $(ModelId::$model => self.$file.shader_constants(),)+
                    ModelId::Foreign(_) => Vec::new(),
                }
            }
        }

        impl Constants<f32> {
            /// Whether lanes run in batches on these instructions.
            pub(super) fn run_in_batches(&self, instructions: Instructions) -> bool {
                let has_burst = instructions != Instructions::Scalar && instructions.is_available();
                has_burst && Rules::of(&self.frames[0], &self.criteria, Scene::unknown(true), true).is_some()
            }

            /// Runs a stream of lanes of the selected model in batches if they [run in
            /// batches](Constants::run_in_batches). `each` receives the lane's index within the stream and its result,
            /// in the order in which lanes end. `entries` are the series that the stream's tracks index.
            pub(super) fn run_stream<E: Ending>(
                &self,
                id: ModelId,
                instructions: Instructions,
                stream: &Lanes<'_>,
                entries: &[f32],
                each: impl FnMut(usize, E),
            ) {
                let model_index = id.index();
                let (frame, criteria) = (&self.frames[model_index], &self.criteria);
                let scene = Scene::of(stream.cases, model_index, stream.may_cross);
                match id {
                    $(ModelId::$model => {
                        let simulation = Simulation { frame, criteria, model: &self.$file, model_index, scene };
                        run_stream(&simulation, instructions, stream, entries, each);
                    })+
                    ModelId::Foreign(_) => unreachable!("drivers outside the registry run side by side"),
                }
            }
        }
    };
}
lanesweep_model::for_every_driver_model!(declare_constants);

/// A single lane of a driver outside the registry.
///
/// # Panics
/// If the driver fails. Callers of single lanes have no error to return; whoever runs the verb turns the panic into one.
fn foreign_lane<R: Real>(
    constants: &Constants<R>,
    model: ModelId,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    start: Start<R>,
    observer: impl FnMut(&Step<R>),
) -> Outcome<R> {
    let driver = model.foreign().unwrap_or_else(|| unreachable!("the model is built in"));
    let Constants { dt_s, criteria, frames, .. } = constants;
    let setting = Setting::new((model, &*driver), frames[model.index()], *criteria, *dt_s);
    let outcome = run_one(&setting, case, tables, start, observer);
    outcome.unwrap_or_else(|error| panic!("{error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lanesweep_random::philox4x32_10;
    use lanesweep_support::Place;

    /// Random profiles of range limits, 0 where allowed, and numbers between.
    #[test]
    fn a_profile_that_passes_gives_finite_normal_numbers_in_binary32() {
        let paper = Profile::load("paper").unwrap();
        let bounds = paper.bounds();
        let mut value = serde_json::to_value(&paper).unwrap();
        let (mut word, mut passed) = (157, 0);
        let mut drawn = || {
            word = philox4x32_10([word, 0, 0, 0], [10, 0])[0];
            f64::from(word) / 2_f64.powi(32)
        };
        for _ in 0..8000 {
            for (key, _, bound) in &bounds {
                let size = match drawn() {
                    u if u < 0.3 => bound.smallest,
                    u if u < 0.6 => bound.largest,
                    u if u < 0.7 && bound.has_zero => 0.0,
                    u => bound.smallest * libm::pow(bound.largest / bound.smallest, u),
                };
                let number = if bound.has_negative && drawn() < 0.5 { -size } else { size };
                assert!(bound.holds(number), "{key}: {number}");
                let (table, name) = key.split_once('.').unwrap();
                value[table][name] = serde_json::json!(number);
            }
            let profile: Profile = serde_json::from_value(value.clone()).unwrap();
            if profile.check(&Place::item("drawn")).is_err() {
                // More steps than [`MAX_STEPS`], or a comfortable deceleration above the largest.
                continue;
            }
            passed += 1;
            for category in Category::ALL {
                let constants = Constants::<f32>::resolve(&profile, category);
                let of_models = ModelId::ALL.into_iter().flat_map(|id| constants.driver_shader_constants(id));
                let of_frames = constants.frames.iter().flat_map(|frame| frame.shader_constants());
                for (name, number) in of_models.chain(of_frames).chain(constants.criteria.shader_constants()) {
                    let narrow = number as f32;
                    assert!(narrow == 0.0 || narrow.is_normal(), "{name} = {number}: {profile:?}");
                }
            }
        }
        assert!(passed > 1000, "{passed}");
    }
}
