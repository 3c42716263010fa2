//! The profile's constants for one category, resolved, and the dispatch over driver models.

use crate::model::criterion::Criteria;
use crate::model::driver::{self, DriverModel, DriverProfile, ModelId};
use crate::model::profile::Profile;
use crate::model::scalar::Real;
use crate::scenario::{Category, Tables};

use super::cpu::foreign;
use super::cpu::lane_result::Ending;
use super::cpu::pending::Lanes;
use super::cpu::rules::Rules;
use super::cpu::simd::Instructions;
use super::cpu::stream::run_stream;
use super::frame::{Frame, Simulation, Start};
use super::lane::{Observer, run_lane};
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
                observer: &mut impl Observer<R>,
            ) -> Outcome<R> {
                self.run_in(id, Scene::unknown(case.pair != 0), case, tables, start, observer)
            }

            /// The same, with known properties of the case.
            #[inline]
            pub(super) fn run_in(
                &self,
                id: ModelId,
                scene: Scene,
                case: &LaneCase<R>,
                tables: &Tables<R>,
                start: Start<R>,
                observer: &mut impl Observer<R>,
            ) -> Outcome<R> {
                let (criteria, model_index) = (&self.criteria, id.index());
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
            pub fn driver_shader_constants(&self, id: ModelId) -> Vec<(&'static str, f64)> {
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
                criteria: &Criteria<f32>,
                instructions: Instructions,
                stream: &Lanes<'_>,
                entries: &[f32],
                each: impl FnMut(usize, E),
            ) {
                let model_index = id.index();
                let frame = &self.frames[model_index];
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
crate::for_every_driver_model!(declare_constants);

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
    observer: &mut impl Observer<R>,
) -> Outcome<R> {
    let driver = model.foreign().unwrap_or_else(|| unreachable!("the model is built in"));
    let outcome = foreign::run_one(constants, model, &*driver, case, tables, start, observer);
    outcome.unwrap_or_else(|error| panic!("{error}"))
}
