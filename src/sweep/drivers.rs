//! The profile's constants for one category, resolved, and the dispatch over driver models.

use crate::criterion::Criteria;
use crate::driver::{self, DriverModel, DriverProfile, ModelId};
use crate::profile::Profile;
use crate::scalar::Real;
use crate::scenario::{Category, Tables};

use super::batch::Fleet;
use super::frame::{Frame, Simulation, Start};
use super::instructions::Instructions;
use super::lane::{Observer, run_lane};
use super::lane_case::LaneCase;
use super::outcome::Outcome;
use super::rules::{Rules, Stream};
use super::simd::burst_for;
use super::stream::{Waiting, run_stream};

/// Makes [`Constants`] and its dispatch from the registry of driver models.
macro_rules! declare_constants {
    ($($(#[$attribute:meta])* $file:ident, $model:ident, $profile:ident, $name:literal;)+) => {
        /// Everything a lane of one category takes from the profile, as plain constants.
        #[derive(Debug, Clone, Copy)]
        pub struct Constants<R> {
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
                let (criteria, model_index) = (&self.criteria, id.index());
                let frame = &self.frames[model_index];
                match id {
                    $(ModelId::$model => {
                        let model = &self.$file;
                        run_lane(&Simulation { frame, criteria, model, model_index }, case, tables, start, observer)
                    })+
                }
            }

            /// The constants of a model by the names that its shader gives them.
            pub fn driver_shader_constants(&self, id: ModelId) -> Vec<(&'static str, f64)> {
                match id {
                    $(ModelId::$model => self.$file.shader_constants(),)+
                }
            }
        }

        impl Constants<f32> {
            /// Do lanes of such a stream run in batches, or one by one?
            pub(super) fn run_in_batches(&self, stream: Stream) -> bool {
                let has_burst = stream.instructions != Instructions::Scalar && stream.instructions.is_available();
                has_burst && Rules::of(&self.frames[0], &self.criteria, stream).is_some()
            }

            /// Runs a stream of lanes of the chosen model in batches; see [`run_stream`]. Only where they
            /// [run in batches](Constants::run_in_batches). `entries` are the series that the lanes point into.
            pub(super) fn run_stream<'c>(
                &self,
                id: ModelId,
                stream: Stream,
                entries: &[f32],
                next: impl FnMut() -> Option<Waiting<'c>>,
                each: impl FnMut(usize, Outcome<f32>),
            ) {
                const RUNS: &str = "these lanes do not run in batches";
                let (criteria, model_index) = (&self.criteria, id.index());
                let frame = &self.frames[model_index];
                let rules = Rules::of(frame, criteria, stream).expect(RUNS);
                match id {
                    $(ModelId::$model => {
                        let model = &self.$file;
                        let burst = burst_for(stream.instructions, rules).expect(RUNS);
                        let simulation = Simulation { frame, criteria, model, model_index };
                        let steps = |fleet: &mut Fleet, entries: &[f32]| burst.run(&simulation, fleet, entries);
                        run_stream(&simulation, stream.is_pair, entries, steps, next, each);
                    })+
                }
            }
        }
    };
}
for_every_driver_model!(declare_constants);
