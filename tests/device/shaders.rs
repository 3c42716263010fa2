//! The shaders say what the host says, and nothing that devices differ on; read with naga, so that no device is needed.

use std::collections::BTreeSet;
use std::mem::offset_of;
use std::path::Path;

use crate::common::program::names;
use crate::common::{in_crate, text_of};
use crate::device::wgsl::{
    Shape, constant, fields, float_operations, function_names, parse, unbounded_loops, uninitialized_in_loops,
    without_comments,
};
use lanesweep::engine::generated::{
    self, ATTEMPTS, ColumnBound, MAX_BOUNDS, MAX_PARAMETERS, NO_SLOT, Recipe, ReducedColumns,
};
use lanesweep::engine::gpu::shader::{
    self, GENERATOR, RANDOM, SHARED, Specialization, TALLY, TRACE, TRAFFIC, driver_shader,
};
use lanesweep::engine::gpu::{DrawnRecord, Generation, Launch, OutcomeRecord, StartRecord, Tally, exact_spirv};
use lanesweep::engine::{
    Constants, CountLayout, DeviceScene, EndReason, LaneCase, LaneOther, MotionKind, NO_STEP, Verdicts,
};
use lanesweep::model::criterion::{BtnForm, Contact, Criteria, Criterion, LateralGate};
use lanesweep::model::driver::{AttentionRule, MODELS, ModelId, NEVER};
use lanesweep::model::profile::Profile;
use lanesweep::scenario::parameterization::Variable;
use lanesweep::scenario::{Category, LATERAL_SAMPLED, Motion, SPEED_SAMPLED};

/// What [`every_record_has_the_layout_of_its_rust_twin`] looks at: name in WGSL, size of the Rust type, its fields.
type Record = (&'static str, usize, Vec<Shape>);

/// The fields of a `repr(C)` type. Each is given with its type, checked by the compiler, and the closing pattern
/// makes a field that is left out an error of compilation.
macro_rules! record {
    ($name:literal, $path:ident $(<$real:ty>)?, { $($field:ident: $kind:ty),+ $(,)? }) => {{
        type Twin = $path $(<$real>)?;
        $(let _: fn(&Twin) -> &$kind = |record| &record.$field;)+
        let _: fn(Twin) = |record| { let $path { $($field: _),+ } = record; };
        let shapes = vec![$(Shape {
            name: stringify!($field).to_owned(),
            offset: offset_of!(Twin, $field),
            size: size_of::<$kind>(),
            kind: stringify!($kind).replace(' ', "").replace("<f32>", "").replace("MODELS", &MODELS.to_string()),
        }),+];
        ($name, size_of::<Twin>(), shapes)
    }};
}

fn records() -> Vec<Record> {
    vec![
        record!("Motion", Motion<f32>, {
            kind: u32, speed_offset: u32, speed_len: u32, lateral_offset: u32, lateral_len: u32, speed_until: u32,
            lateral_until: u32, speed_initial: f32, speed_per_step: f32, speed_end: f32, lateral_initial: f32,
            lateral_per_step: f32, lateral_end: f32, lateral_towards: f32, reserved: [u32; 2],
        }),
        record!("LaneOther", LaneOther<f32>, {
            motion: Motion<f32>, half_lengths: f32, half_widths: f32, gap_offset: f32, present_from: u32,
            present_until: u32, attend_from: [u32; MODELS], used: u32, judged: u32,
        }),
        record!("LaneCase", LaneCase<f32>, {
            others: [LaneOther<f32>; 2], ego_speed: f32, ego_width: f32, lane_width: f32, horizon: u32, pair: u32,
        }),
        record!("Start", StartRecord, { kind: u32, value: f32 }),
        record!("Launch", Launch, {
            lanes: u32, headways: u32, first_case: u32, case_step: u32, first_lane: u32, lanes_between: u32, first_word: u32, first_outcome: u32,
            finished_word: u32, lanes_per_group: u32, burst_from: u32,
        }),
        record!("OutcomeRecord", OutcomeRecord, {
            word: u32, reaction_step: u32, end_step: u32, impact_speed: f32, impact_closing_speed: f32,
            min_ttc_bits: u32, btn_numerator: f32, btn_denominator: f32, min_gap_bits: u32, min_thw_bits: u32,
            max_drac_bits: u32, tet_steps: u32, tit: f32, pet_bits: u32,
        }),
    ]
}

/// The records of the generator's pipeline beside those of lanes.
fn generator_records() -> Vec<Record> {
    vec![
        record!("AttentionRule", AttentionRule<f32>, {
            kind: u32, delay_steps: u32, below_trigger: u32, threshold: f32,
        }),
        record!("ReducedColumns", ReducedColumns, {
            width: u32, instants: u32, coefficients: u32, lateral: u32, speed: u32, lead_speed: u32, ego_speed: u32,
            lead_gap: u32, duration: u32,
        }),
        record!("ColumnBound", ColumnBound, { column: u32, is_distance: u32, lower: f32, upper: f32 }),
        record!("Recipe", Recipe, {
            path: u32, lateral: u32, dimensions: u32, pair: u32, decelerates: u32, unlimited: u32, judged: u32,
            step_cap: u32, slots: [u32; 11], columns: ReducedColumns, lower: [f32; 14], upper: [f32; 14],
            bounded: u32, bounds: [ColumnBound; 8],
            min_duration: f32, longest_duration: f32, dt: f32, inverse_dt: f32, lane_change: f32,
            half_lengths: [f32; 2], half_widths: [f32; 2], principal_length: f32, ego_width: f32, lane_width: f32,
            attention: [AttentionRule<f32>; MODELS],
        }),
        record!("DrawnRecord", DrawnRecord, { tries: u32, component: u32 }),
        record!("Generation", Generation, {
            index_low: u32, index_high: u32, count: u32, seed_low: u32, seed_high: u32, purpose: u32,
            components: u32, first_mean: u32, first_deviation: u32, stride: u32,
        }),
    ]
}

/// Every built-in profile with every category: all the constants that a pipeline may get.
fn resolved() -> Vec<(String, Constants<f32>)> {
    let of = |name: &'static str, category| {
        let profile = Profile::load(name).unwrap();
        (format!("{name}, {category:?}"), Constants::resolve(&profile, category))
    };
    Profile::names().flat_map(|name| Category::ALL.map(|category| of(name, category))).collect()
}

/// Constants of a generator: every override gets one.
fn generator_constants() -> Vec<(&'static str, f64)> {
    let (module, _) = parse(&shader::assemble_generator());
    let names = module.overrides.iter().map(|(_, o)| o.name.clone().unwrap());
    let recipe = Recipe { dimensions: 1, step_cap: 100, inverse_dt: 25.0, ..bytemuck::Zeroable::zeroed() };
    let (means, deviations) = (vec![1.0], vec![1.0]);
    let points = generated::Points { source: generated::PointSource::Given, dimensions: 1, means, deviations };
    let generator = generated::Generator { points, recipe, basis: Vec::new() };
    let given = generator.shader_constants();
    assert_eq!(names.collect::<BTreeSet<_>>(), given.iter().map(|(name, _)| (*name).to_owned()).collect());
    given
}

fn specialization(paired: bool) -> Specialization {
    Specialization { scene: DeviceScene::unknown(paired), values: paired, queue: !paired }
}

#[test]
fn every_model_has_the_records_the_entry_the_loops_and_the_arithmetic_that_the_host_expects() {
    for model in ModelId::ALL {
        let (module, info) = parse(&shader::assemble(model));
        same_records(&module, records());
        let [entry] = module.entry_points.as_slice() else { panic!("one entry point") };
        let expected = (shader::ENTRY, naga::ShaderStage::Compute, [shader::WORKGROUP, 1, 1]);
        assert_eq!((entry.name.as_str(), entry.stage, entry.workgroup_size), expected);
        same_constants(&module, &[("WORKGROUP", shader::WORKGROUP), ("MODELS", MODELS as u32)]);
        // As naga understands the source: no remainder, no root, no built-in function but the magnitude. The device's own
        // quotient is only a guess, and only exact_div asks for it.
        operations(&module, &info, &["exact_div"]);
        // exact_div, btn_solve, carried, the turns and the steps of lanes.
        assert_eq!(unbounded_loops(&module), (5, vec![]), "{model:?}");
    }
}

/// Nothing that devices differ on, and divisions only in these functions.
fn operations(module: &naga::Module, info: &naga::valid::ModuleInfo, divided_in: &[&str]) {
    let found = float_operations(module, info);
    assert_eq!(found.forbidden, Vec::<String>::new());
    assert_eq!(found.divided_in, divided_in);
}

fn becomes_spirv(source: &str, entry: &str, constants: &[(&str, f64)]) -> bool {
    exact_spirv(source, entry, constants, false).is_ok_and(|words| !words.is_empty())
}

fn same_records(module: &naga::Module, records: impl IntoIterator<Item = Record>) {
    for (name, size, ours) in records {
        assert_eq!(fields(module, name), (size, ours), "{name}");
    }
}

fn same_constants<N: AsRef<str>>(module: &naga::Module, constants: &[(N, u32)]) {
    constants.iter().for_each(|(name, value)| assert_eq!(constant(module, name.as_ref()), *value, "{}", name.as_ref()));
}

const MOTIONS: [MotionKind; 6] = {
    use MotionKind::{Analytic, Centred, Instants, Mixed, Sampled, Sinusoid};
    [Analytic, Sampled, Mixed, Centred, Sinusoid, Instants]
};
const CONTACTS: [Contact; 3] = [Contact::None, Contact::BySide, Contact::Frontal];
const ENDS: [EndReason; 5] = {
    use EndReason::{Aborted, Cap, Contact, Settled, Standstill};
    [Contact, Settled, Standstill, Cap, Aborted]
};

/// Constants named after variants: `MotionKind::Sampled` is `MOTION_SAMPLED`.
fn coded<T: std::fmt::Debug + Copy>(prefix: &str, all: &[T], code: impl Fn(T) -> u32) -> Vec<(String, u32)> {
    let name = |of: &T| -> String {
        let text = format!("{of:?}");
        let of_char = |(at, c): (usize, char)| {
            [if at > 0 && c.is_uppercase() { "_" } else { "" }.to_owned(), c.to_uppercase().collect()]
        };
        text.char_indices().flat_map(of_char).collect()
    };
    all.iter().map(|of| (format!("{prefix}{}", name(of)), code(*of))).collect()
}

#[test]
fn the_generator_has_the_records_the_numbers_and_the_arithmetic_of_its_rust_twins() {
    let (module, info) = parse(&shader::assemble_generator());
    same_records(&module, records().into_iter().take(3).chain(generator_records()));
    let constants = [
        ("MAX_PARAMETERS", MAX_PARAMETERS as u32),
        ("MAX_BOUNDS", MAX_BOUNDS as u32),
        ("ATTEMPTS", ATTEMPTS),
        ("NO_SLOT", NO_SLOT),
        ("QUANTITIES", Variable::ALL.len() as u32),
        ("PATH_SINUSOID", generated::CasePath::Sinusoid as u32),
        ("PATH_REDUCED", generated::CasePath::Reduced as u32),
        ("LATERAL_ENTERING", generated::LateralPath::Entering as u32),
        ("LATERAL_LEAVING", generated::LateralPath::Leaving as u32),
        ("LATERAL_GONE", generated::LateralPath::Gone as u32),
        ("NEVER", NEVER),
    ];
    same_constants(&module, &constants);
    same_constants(&module, &coded("", &Variable::ALL, |of| of as u32));
    operations(&module, &info, &["exact_div"]);
    assert!(becomes_spirv(&shader::assemble_generator(), shader::GENERATE, &generator_constants()));
}

/// The kernels of a map's page, which no device of this program runs: a browser joins their sources.
#[test]
fn the_kernels_of_the_page_have_the_records_the_entries_and_the_arithmetic_of_the_others() {
    let [shared, entry] = shader::shared_and_entry();
    let constants = Constants::resolve(&Profile::load("un-r157").unwrap(), Category::CutOut);
    for model in ModelId::ALL {
        let driver = shader::driver_source(model);
        let lanes = format!("{shared}{entry}{driver}");
        let traced = format!("{shared}{}{driver}", TRACE.1);
        for (source, name, values) in [(&lanes, shader::ENTRY, false), (&traced, "trace", true)] {
            let (module, info) = parse(source);
            same_records(&module, records());
            operations(&module, &info, &["exact_div"]);
            assert_eq!(unbounded_loops(&module).1, Vec::<String>::new(), "{model:?}, {name}");
            let [entry] = module.entry_points.as_slice() else { panic!("one entry point") };
            assert_eq!((entry.name.as_str(), entry.workgroup_size), (name, [shader::WORKGROUP, 1, 1]));
            let constants = shader::constants(&constants, model, Specialization { values, ..specialization(true) });
            assert!(becomes_spirv(source, name, &constants), "{model:?}, {name}");
        }
    }
    let source = shader::assemble_generator() + TRAFFIC.1;
    let (module, info) = parse(&source);
    operations(&module, &info, &["exact_div"]);
    for entry in [shader::GENERATE, "mark_traffic"] {
        assert!(becomes_spirv(&source, entry, &generator_constants()), "{entry}");
    }
}

/// A browser refuses a pipeline without a constant, or with one that its source does not have.
#[test]
fn the_page_has_every_constant_of_its_kernels_under_every_profile() {
    let profiles: Vec<Profile> = Profile::names().map(|name| Profile::load(name).unwrap()).collect();
    let data = lanesweep::run::explorer::explorer(&profiles, &[]).unwrap();
    let overrides = |source: &str| -> BTreeSet<String> {
        parse(source).0.overrides.iter().map(|(_, of)| of.name.clone().unwrap()).collect()
    };
    let names = |of: &serde_json::Value| -> Vec<String> { of.as_object().unwrap().keys().cloned().collect() };
    let (text, generator) = (|part: &str| data["source"][part].as_str().unwrap(), data["source"]["generator"].as_str());
    let declared = ModelId::ALL
        .map(|model| overrides(&format!("{}{}{}", text("shared"), text("lanes"), shader::driver_source(model))));
    let generator = overrides(generator.unwrap());
    let settings = data["settings"].as_array().unwrap();
    // Five kinds of case; the profile whose cut-outs begin at the exposure has three.
    assert_eq!(settings.len(), 5 * profiles.len() - 2);
    for setting in settings {
        let drivers = setting["drivers"].as_array().unwrap();
        assert_eq!(drivers.len(), MODELS + 1);
        for (own, declared) in drivers.iter().zip(declared.iter().chain([&declared[0]])) {
            let all: Vec<String> = names(&setting["shared"]).into_iter().chain(names(own)).collect();
            assert_eq!(all.len(), declared.len(), "no constant twice");
            assert_eq!(&all.into_iter().collect::<BTreeSet<_>>(), declared, "{}", setting["profile"]);
        }
        assert_eq!(names(&setting["generator"]).into_iter().collect::<BTreeSet<_>>(), generator);
        assert_eq!(setting["recipe"].as_array().unwrap().len() * 4, size_of::<Recipe>());
        assert_eq!(setting["known"]["hashes"].as_array().unwrap().len(), MODELS);
    }
}

#[test]
fn the_counting_has_the_records_and_the_places_of_its_rust_twins() {
    let source = shader::assemble_tally();
    let (module, info) = parse(&source);
    let records = [
        record!("DrawnRecord", DrawnRecord, { tries: u32, component: u32 }),
        record!("Tally", Tally, { samples: u32, first_drawn: u32, words: u32 }),
    ];
    same_records(&module, records);
    let constants = [
        ("ATTEMPTS", ATTEMPTS),
        ("CRITERIA", Criterion::ALL.len() as u32),
        ("LANES_PER_WORD", u32::BITS / 4),
        ("CAPPED", Verdicts::CAPPED.into()),
        ("VOIDS", CountLayout::VOIDS as u32),
        ("TRIES", CountLayout::TRIES as u32),
        ("GATHERED", CountLayout::GATHERED as u32),
        ("WORKGROUP", shader::WORKGROUP),
    ];
    same_constants(&module, &constants);
    operations(&module, &info, &[]);
    assert_eq!(unbounded_loops(&module), (3, vec![]));
    let [entry] = module.entry_points.as_slice() else { panic!("one entry point") };
    assert_eq!(entry.name, shader::COUNT);
}

#[test]
fn every_table_has_the_stride_of_its_rust_twin() {
    let (module, _) = parse(&shader::assemble(ModelId::Fsm));
    let stride = |name: &str| {
        let (_, variable) = module.global_variables.iter().find(|(_, v)| v.name.as_deref() == Some(name)).unwrap();
        match module.types[variable.ty].inner {
            naga::TypeInner::Array { stride, size: naga::ArraySize::Dynamic, .. } => stride as usize,
            ref other => panic!("{name}: {other:?}"),
        }
    };
    let (cases, outcomes) = (size_of::<LaneCase<f32>>(), size_of::<OutcomeRecord>());
    assert_eq!(["cases", "starts", "outcomes"].map(stride), [cases, size_of::<StartRecord>(), outcomes]);
    assert_eq!(["speed_table", "lateral_table", "verdicts"].map(stride), [4, 8, 4]);
}

#[test]
fn every_override_gets_a_value_of_its_type_no_value_is_left_over_and_every_pipeline_becomes_spirv() {
    for model in ModelId::ALL {
        let source = shader::assemble(model);
        let (module, _) = parse(&source);
        let declared: BTreeSet<&str> = module.overrides.iter().map(|(_, o)| o.name.as_deref().unwrap()).collect();
        for (place, constants) in resolved() {
            for paired in [false, true] {
                let given = shader::constants(&constants, model, specialization(paired));
                assert!(becomes_spirv(&source, shader::ENTRY, &given), "{model:?}, {place}, paired {paired}");
                let names: BTreeSet<&str> = given.iter().map(|(name, _)| *name).collect();
                assert_eq!(names.len(), given.len(), "{model:?}: a constant is given twice");
                assert_eq!(names, declared, "{model:?}, {place}");
                for (_, wanted) in module.overrides.iter() {
                    let name = wanted.name.as_deref().unwrap();
                    // A default would hide a constant that the host forgets.
                    assert!(wanted.init.is_none(), "{name} has a default");
                    let value = given.iter().find(|(known, _)| *known == name).unwrap().1;
                    let naga::TypeInner::Scalar(scalar) = module.types[wanted.ty].inner else { panic!("{name}") };
                    let fits = match scalar.kind {
                        naga::ScalarKind::Bool => value == 0.0 || value == 1.0,
                        naga::ScalarKind::Uint => value == f64::from(value as u32),
                        // The host rounds once: what reaches the device is a binary32 already.
                        naga::ScalarKind::Float => value.is_finite() && value == f64::from(value as f32),
                        other => panic!("{name}: {other:?}"),
                    };
                    assert!(fits, "{model:?}, {place}: {name} = {value} is no {:?}", scalar.kind);
                }
            }
        }
    }
}

#[test]
fn constants_that_stand_on_both_sides_agree() {
    let (module, _) = parse(&shader::assemble(ModelId::Fsm));
    let expected = [
        ("SPEED_SAMPLED", SPEED_SAMPLED),
        ("LATERAL_SAMPLED", LATERAL_SAMPLED),
        ("ATTEMPTS", ATTEMPTS),
        ("LAST_STEPS", shader::LONGEST_BURST),
        ("BINADE", 1 << (f32::MANTISSA_DIGITS - 1)),
        ("NO_STEP", NO_STEP),
        ("INFINITY_BITS", f32::INFINITY.to_bits()),
        ("UNBOUNDED", f32::MAX.to_bits()),
        // Four verdict bits a lane.
        ("LANES_PER_WORD", u32::BITS / 4),
    ];
    // Numbers of the sine's polynomial in lane arithmetic.
    let sine = generated::SINE.iter().enumerate().map(|(at, of)| (format!("SINE_{at}"), (*of as f32).to_bits()));
    let expected: Vec<(String, u32)> = [
        expected.map(|(name, value)| (name.to_owned(), value)).to_vec(),
        sine.collect(),
        coded("MOTION_", &MOTIONS, |of| of as u32),
        coded("GATE_", &[LateralGate::EgoWidth, LateralGate::Overlap], |of| of as u32),
        coded("BTN_", &[BtnForm::EquivalentDelay, BtnForm::Exact, BtnForm::DistanceRatio], |of| of as u32),
        coded("CONTACT_", &CONTACTS, Contact::code),
        coded("END_", &ENDS, |of| of as u32),
    ]
    .concat();
    same_constants(&module, &expected);
    // A lane that is not over never writes its end: no reason may have its code.
    assert!(ENDS.iter().all(|end| *end as u32 != constant(&module, "END_NOT_YET")));
    // No constant without a twin is added unseen.
    let known: BTreeSet<&str> = expected.iter().map(|(name, _)| name.as_str()).collect();
    let alone = ["WORKGROUP", "MODELS", "END_NOT_YET", "MAX_TURNS", "MIN_SKIPPED", "LOOK_AGAIN", "MAX_ADDITIONS"];
    for (_, other) in module.constants.iter() {
        let name = other.name.as_deref().unwrap();
        assert!(known.contains(name) || alone.contains(&name), "{name} is compared with nothing");
    }
}

#[test]
fn the_host_reads_from_an_outcome_word_what_a_lane_writes_into_it() {
    let (module, _) = parse(&shader::assemble(ModelId::Fsm));
    let criteria: Criteria<f32> = Profile::load("paper").unwrap().criteria.resolve();
    let read = |word: u32| {
        let unbounded = f32::INFINITY.to_bits();
        let mut record: OutcomeRecord = bytemuck::Zeroable::zeroed();
        (record.word, record.btn_denominator, record.pet_bits) = (word, 1.0, NO_STEP);
        (record.reaction_step, record.end_step) = (NO_STEP, 7);
        (record.min_ttc_bits, record.min_gap_bits, record.min_thw_bits) = (unbounded, unbounded, unbounded);
        record.outcome(&criteria)
    };
    let settled = constant(&module, "END_SETTLED") << 8;
    let frontal = constant(&module, "CONTACT_FRONTAL") << 4;
    // The codes are those of the shader: `constants_that_stand_on_both_sides_agree`.
    CONTACTS.iter().for_each(|of| assert_eq!(read(of.code() << 4 | settled).unwrap().contact, *of));
    ENDS.iter().for_each(|end| assert_eq!(read((*end as u32) << 8 | frontal).unwrap().end, *end));
    assert_eq!(read(constant(&module, "END_NOT_YET") << 8), None);
    assert_eq!(read(3 << 4 | settled), None);
    // What no lane wrote: an end by contact, without one.
    assert_eq!(read(0), None);
    // The bits that `outcome` in shared/frame.wgsl sets, in its order.
    let bits = [Criterion::Collision, Criterion::Ttc, Criterion::Btn].map(|c| 1 << c.index());
    assert_eq!([bits[0], bits[1], bits[2], Verdicts::CAPPED], [1, 2, 4, 8]);
    for bit in 0..4 {
        assert_eq!(read(1 << bit | settled).unwrap().verdicts, Verdicts(1 << bit));
    }
    assert_eq!(read(1 << 6 | settled).unwrap().contact_with, 1);
}

/// Functions of the Rust file beside a shader, but for those without a twin.
fn twin_functions(folder: &str, shader: &str, no_twin: &[&str]) -> Vec<String> {
    let text = text_of(&format!("{folder}/{}", shader.replace(".wgsl", ".rs")));
    let mut names = function_names(text.split("#[cfg(test)]").next().unwrap());
    names.retain(|name| !no_twin.contains(&name.as_str()));
    names
}

#[test]
fn every_model_has_a_shader_with_the_functions_of_its_rust_file_in_their_order() {
    // What only the host does, or batches of lanes alone; and `shader_constants` is what joins the two.
    let no_twin = "default resolve bounds time_step_bounds attention abort_above_ttc_s reaction_and_margin_s safe_gap \
                   intrusion_gap_m ignores check_steady shader_constants";
    let no_twin: Vec<&str> = no_twin.split(' ').collect();
    for model in ModelId::ALL {
        let (file, shader) = driver_shader(model);
        let names = twin_functions("src/model/driver", file, &no_twin);
        // The demand of a view is part of the twin's `check`; promises are made where they pay.
        let mut in_wgsl = function_names(shader);
        in_wgsl.retain(|name| !["demand", "safe_gap", "ignores"].contains(&name.as_str()));
        assert_eq!(names, in_wgsl, "{file} and its twin");
        assert!(["initial", "check", "react"].iter().all(|required| names.contains(&(*required).to_owned())), "{file}");
    }
}

#[test]
fn the_fragments_of_sampling_have_the_functions_of_their_rust_files_in_their_order() {
    // What makes the tables, which only the host does; and methods that only look up a row and call what has a twin.
    let no_twin = ["normal_table", "inverse_normal_tail", "segment", "new", "table", "word", "directions"];
    // Methods have the name of their type with them in WGSL.
    for (file, shader) in RANDOM {
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        let mut names = twin_functions("src/random", name, &no_twin);
        names.iter_mut().filter(|name| *name == "words").for_each(|name| *name = "stream_words".to_owned());
        assert_eq!(names, function_names(shader), "{file} and its twin");
    }
}

#[test]
fn the_fragments_of_sampling_do_only_what_devices_agree_on() {
    let tables = "@group(0) @binding(0) var<storage, read> normal_table: array<vec4<f32>>;\n";
    let source = RANDOM.iter().fold(tables.to_owned(), |source, (_, text)| source + text);
    let (module, info) = parse(&source);
    operations(&module, &info, &[]);
    // philox4x32_10.
    assert_eq!(unbounded_loops(&module), (1, vec![]));
}

/// Names and texts of the files that pipelines are made of.
fn shader_files() -> impl Iterator<Item = (&'static str, &'static str)> {
    let of_the_page = [TRACE, TRAFFIC];
    let files = SHARED.into_iter().chain(RANDOM).chain(GENERATOR).chain(TALLY).chain(of_the_page);
    files.chain(ModelId::ALL.map(driver_shader))
}

#[test]
fn every_shader_file_is_part_of_a_pipeline() {
    let known: BTreeSet<String> = shader_files().map(|(name, _)| name.to_owned()).collect();
    let found = names(&in_crate("shaders")).into_iter().filter(|name| name.ends_with(".wgsl"));
    assert_eq!(found.collect::<BTreeSet<_>>(), known);
}

#[test]
fn only_the_entry_has_bindings_and_every_file_stays_short_and_plain() {
    for (name, text) in shader_files() {
        assert!(text.lines().count() <= 600, "{name} is longer than 600 lines");
        assert_eq!(uninitialized_in_loops(text), Vec::<String>::new(), "{name}");
        let code = without_comments(text);
        if !["lane.wgsl", "generate.wgsl", "tally.wgsl", "trace.wgsl", "traffic.wgsl"].contains(&name) {
            for word in ["@group", "@binding", "@compute", "var<"] {
                assert!(!code.contains(word), "{name} has {word}");
            }
        }
        let calls =
            "fma exp exp2 log log2 pow sin cos tan sqrt inverseSqrt min max clamp mix fract modf dot length normalize";
        for call in calls.split(' ') {
            let is_called = code.match_indices(&format!("{call}(")).any(|(at, _)| {
                let before = code[..at].chars().next_back();
                !before.is_some_and(|c| c.is_ascii_alphanumeric() || c == '_')
            });
            assert!(!is_called, "{name} calls {call}");
        }
    }
}

#[test]
fn a_loop_that_counts_up_to_no_constant_and_a_variable_in_one_that_begins_with_nothing_are_found() {
    let body = |declared: &str| {
        format!("fn f() {{\n  for (var k = 0u; k < 9u; k++) {{\n    {declared}\n  }}\n  var y: u32;\n}}")
    };
    assert_eq!(uninitialized_in_loops(&body("var x: u32;")), ["var x: u32;"]);
    assert!(uninitialized_in_loops(&body("var x: u32 = 0u;")).is_empty());
    for (body, counted) in [
        ("for (var k = 0u; k < 9u; k++) { x = x + 1.0; }", true),
        ("for (var k = 0u; k < n; k++) { x = x + 1.0; }", false),
        ("for (var k = 0u; k < 9u; k++) { if x > 1.0 { k = 0u; } }", false),
        ("loop { if x > 1.0 { break; } }", false),
        ("for (var k = 0u; k < 9u; ) { x = x + 1.0; }", false),
    ] {
        let source = format!("fn f(n: u32) -> f32 {{ var x = 0.0; {body} return x; }}");
        let (loops, unbounded) = unbounded_loops(&naga::front::wgsl::parse_str(&source).unwrap());
        assert_eq!((loops, unbounded.is_empty()), (1, counted), "{body}");
    }
}
