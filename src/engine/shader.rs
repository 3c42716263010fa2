//! Joins the files in `shaders/` to the source of one model's pipeline, with constants from the profile.

use crate::{Constants, DeviceScene};
use lanesweep_model::driver::{MODELS, ModelId};

/// Entry point of every pipeline.
pub const ENTRY: &str = "lanes";
/// Lanes per workgroup.
pub const WORKGROUP: u32 = 64;

/// Fragments that every model shares, in the order in which they are joined.
pub const SHARED: [(&str, &str); 13] = [
    ("shared/records.wgsl", include_str!("../../shaders/shared/records.wgsl")),
    ("lane.wgsl", include_str!("../../shaders/lane.wgsl")),
    ("shared/exact.wgsl", include_str!("../../shaders/shared/exact.wgsl")),
    ("shared/motion.wgsl", include_str!("../../shaders/shared/motion.wgsl")),
    ("shared/driver.wgsl", include_str!("../../shaders/shared/driver.wgsl")),
    ("shared/collision.wgsl", include_str!("../../shaders/shared/collision.wgsl")),
    ("shared/ttc.wgsl", include_str!("../../shaders/shared/ttc.wgsl")),
    ("shared/btn.wgsl", include_str!("../../shaders/shared/btn.wgsl")),
    ("shared/measures.wgsl", include_str!("../../shaders/shared/measures.wgsl")),
    ("shared/criteria.wgsl", include_str!("../../shaders/shared/criteria.wgsl")),
    ("shared/frame.wgsl", include_str!("../../shaders/shared/frame.wgsl")),
    ("shared/fast_forward.wgsl", include_str!("../../shaders/shared/fast_forward.wgsl")),
    ("shared/verdicts.wgsl", include_str!("../../shaders/shared/verdicts.wgsl")),
];

/// Fragments of sampling, twins of `src/stats/random`, for a kernel that declares their table: `normal_table:
/// array<vec4<f32>>` ([`normal_table`](lanesweep_random::normal_table)).
pub const RANDOM: [(&str, &str); 2] = [
    ("shared/philox.wgsl", include_str!("../../shaders/shared/philox.wgsl")),
    ("shared/normal.wgsl", include_str!("../../shaders/shared/normal.wgsl")),
];

/// Entry point of the generator's pipeline.
pub const GENERATE: &str = "generate";

/// Fragments of the generator in addition to [`RANDOM`], in the order in which they are joined.
pub const GENERATOR: [(&str, &str); 8] = [
    ("shared/records.wgsl", include_str!("../../shaders/shared/records.wgsl")),
    ("generate.wgsl", include_str!("../../shaders/generate.wgsl")),
    ("shared/exact.wgsl", include_str!("../../shaders/shared/exact.wgsl")),
    ("shared/motion.wgsl", include_str!("../../shaders/shared/motion.wgsl")),
    ("shared/attention.wgsl", include_str!("../../shaders/shared/attention.wgsl")),
    ("shared/recipe.wgsl", include_str!("../../shaders/shared/recipe.wgsl")),
    ("shared/points.wgsl", include_str!("../../shaders/shared/points.wgsl")),
    ("shared/decode.wgsl", include_str!("../../shaders/shared/decode.wgsl")),
];

/// Entry point of the pipeline that counts.
pub const COUNT: &str = "count_samples";

/// Fragments of the counting, in the order in which they are joined.
pub const TALLY: [(&str, &str); 2] = [
    ("shared/records.wgsl", include_str!("../../shaders/shared/records.wgsl")),
    ("tally.wgsl", include_str!("../../shaders/tally.wgsl")),
];

/// The source of the counting's pipeline.
pub fn assemble_tally() -> String {
    joined(TALLY)
}

/// Defines the list of the models' files from the registry.
macro_rules! declare_shaders {
    ($($(#[$attribute:meta])* $file:ident, $model:ident, $profile:ident, $name:literal;)+) => {
        /// File name and text of a model's shader.
        pub fn driver_shader(model: ModelId) -> (&'static str, &'static str) {
            match model {
                $(ModelId::$model => (
                    concat!(stringify!($file), ".wgsl"),
                    include_str!(concat!("../../shaders/", stringify!($file), ".wgsl")),
                ),)+
                // The session refuses it.
                ModelId::Foreign(_) => ("", ""),
            }
        }
    };
}
lanesweep_model::for_every_driver_model!(declare_shaders);

/// Default of models whose shader does not define this function, as in its trait.
const NO_LATCH: &str = "fn keeps_braking(state: DriverState, view: View) -> bool { return false; }\n";

/// The same of models that promise nothing about where they are safe: their lanes skip no step.
const NO_PROMISE: &str = "fn safe_gap(v_ego: f32, v_other: f32) -> f32 { return UNBOUNDED; }\n\
    fn ignores(lateral_gap: f32, lateral_towards: f32, marking_gap: f32) -> bool { return false; }\n";

/// Whether lanes of a model skip quiescent steps: FSM's seldom have any, so its shader promises nothing.
fn promises(model: ModelId) -> bool {
    driver_shader(model).1.contains("fn safe_gap(")
}

/// The source of a model's pipeline: constants of the registry, the shared fragments, the model.
pub fn assemble(model: ModelId) -> String {
    joined(SHARED) + &driver_source(model)
}

/// The part of the source of a model's pipeline that other models do not have.
pub fn driver_source(model: ModelId) -> String {
    let (_, driver) = driver_shader(model);
    let latch = if driver.contains("fn keeps_braking(") { "" } else { NO_LATCH };
    let promise = if promises(model) { "" } else { NO_PROMISE };
    format!("{driver}\n{latch}{promise}")
}

/// The source of the generator's pipeline.
pub fn assemble_generator() -> String {
    joined(GENERATOR.into_iter().chain(RANDOM))
}

/// Entry point of lanes that keep their steps.
pub const TRACE: (&str, &str) = ("trace.wgsl", include_str!("../../shaders/trace.wgsl"));

/// Entry point after the generator that marks impossible traffic.
pub const TRAFFIC: (&str, &str) = ("traffic.wgsl", include_str!("../../shaders/traffic.wgsl"));

/// The shared source without an entry point, and the entry point of lanes, for a page that joins them itself.
pub fn shared_and_entry() -> [String; 2] {
    let is_entry = |(name, _): &(&str, &str)| ["lane.wgsl", "shared/verdicts.wgsl"].contains(name);
    let (entry, shared): (Vec<_>, Vec<_>) = SHARED.into_iter().partition(is_entry);
    [joined(shared), entry.into_iter().map(|(_, text)| text).collect()]
}

/// Files one after the other, after the constants of the registry.
fn joined(files: impl IntoIterator<Item = (&'static str, &'static str)>) -> String {
    files.into_iter().fold(format!("const MODELS: u32 = {MODELS}u;\n"), |source, (_, text)| source + text + "\n")
}

/// Properties that a pipeline is compiled for, in addition to the profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Specialization {
    /// What all lanes share.
    pub scene: DeviceScene,
    /// The pipeline returns continuous values, not only verdicts.
    pub values: bool,
    /// An invocation whose lane has ended takes the next one of its workgroup.
    pub queue: bool,
}

/// Steps of a burst before a device is measured: ended lanes wait for half of one, and a warp looks for them once in one.
pub const BURST: u32 = 16;
/// Maximum number of steps of a burst.
pub const LONGEST_BURST: u32 = 32;
/// Values of the `override` constants of a model's pipeline, by name.
pub fn constants(
    resolved: &Constants<f32>,
    model: ModelId,
    specialization: Specialization,
) -> Vec<(&'static str, f64)> {
    let Specialization { scene, values, queue } = specialization;
    let mut all = resolved.frames[model.index()].shader_constants();
    all.push(("frame_model", model.index() as f64));
    for (name, is_set) in [("frame_values", values), ("frame_queue", queue)] {
        all.push((name, f64::from(u8::from(is_set))));
    }
    let frame = &resolved.frames[model.index()];
    let skips = !values && promises(model) && frame.abort_above_ttc <= 0.0 && resolved.criteria.btn.has_safe_gap();
    all.extend([("frame_longest_burst", f64::from(LONGEST_BURST)), ("frame_skip", f64::from(u8::from(skips)))]);
    all.extend(scene.shader_constants(model.index()));
    all.push(("motion_inverse_dt", f64::from(resolved.frames[model.index()].inverse_dt)));
    all.extend(resolved.criteria.shader_constants());
    all.extend(resolved.driver_shader_constants(model));
    all
}
