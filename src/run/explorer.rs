//! What a page needs to compute maps itself, on the shaders of a device: kinds of case with their parameters, and for each
//! profile the constants of the pipelines, the recipe of the cases, and lanes whose words are known.
//!
//! A page reads all of it as JSON; it knows no driver, criterion or constant itself. A case is decoded from a point as a
//! sampled case is; the initial distance is the start of its lanes.

use lanesweep_engine::generated::{Generator, LateralPath, MAX_PARAMETERS, NO_SLOT, PointSource, Points, Recipe};
use lanesweep_engine::shader::{self, Specialization};
use lanesweep_engine::{Constants, Headway, Outcome, silent};
use lanesweep_model::criterion::BtnForm;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::{CutOutTarget, Profile};
use lanesweep_model::scenario::parameterization::{Sizes, Variable, VehicleSize};
use lanesweep_model::scenario::{CaseQuantity, Category, PlainCase, Tables};
use lanesweep_support::{Error, Place, Result};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::grid::{MapParameter, PARAMETERS, Point, is_size, without_reaction};
use crate::sampling::recipe_without_parameters;

/// A slider: a parameter of maps and its range, in its unit.
#[derive(Deserialize)]
struct Slider {
    key: String,
    from: f64,
    to: f64,
    /// The [`Variable`] of a point that it gives; `None` for an initial distance.
    variable: Option<Variable>,
}

/// A kind of case: the parameters of a kinematic parameterization.
#[derive(Deserialize)]
struct Kind {
    key: String,
    category: String,
    /// Names of sliders. Those that are no initial distance are the numbers of a point, in this order.
    parameters: Vec<String>,
}

/// The kinds of case and the sliders of the page.
const KINDS: &str = include_str!("explorer.json");

/// Starts of the lanes with known words: kind and value of the device's record.
const STARTS: [Headway; 4] = [Headway::GapM(4.0), Headway::GapM(15.0), Headway::GapM(45.0), Headway::ThwS(1.2)];
/// Cases of the lanes with known words.
const KNOWN_CASES: usize = 16;
/// The longest event of a case, s; a valid deceleration ends before.
const MAX_EVENT_S: f32 = 1e6;

/// Everything that a page needs for these profiles, the first one first. Sizes of `fixed` hold in every case.
///
/// # Errors
/// [`Error::Internal`] if the page's own kinds, sliders and parameters do not fit together.
pub fn explorer(profiles: &[Profile], fixed: &[(&'static MapParameter, f64)]) -> Result<Value> {
    let defect = |error: serde_json::Error| Error::Internal(format!("the page's kinds of case: {error}"));
    let mut data: Value = serde_json::from_str(KINDS).map_err(defect)?;
    let sliders: Vec<Slider> = serde_json::from_value(data["sliders"].clone()).map_err(defect)?;
    let kinds: Vec<Kind> = serde_json::from_value(data["kinds"].clone()).map_err(defect)?;
    let (mut sizes, mut flags) = (Point::default(), Vec::new());
    for (parameter, value) in fixed.iter().filter(|(parameter, _)| is_size(parameter.quantity)) {
        sizes.set(parameter, *value);
        flags.push(format!("--{} {value}", flag(parameter)));
    }
    let mut settings = Vec::new();
    for profile in profiles {
        for kind in &kinds {
            let category = Category::named(&kind.category, Place::item("page"))?;
            // Cut-outs that begin at the exposure are not decoded on a device.
            if category != Category::CutOut || profile.frame.cut_out_target != CutOutTarget::Exposed {
                settings.push(setting(profile, kind, category, &sliders, &sizes)?);
            }
        }
    }
    let [shared, lanes] = shader::shared_and_entry();
    let generator = shader::assemble_generator() + shader::TRAFFIC.1;
    data["source"] = json!({ "shared": shared, "lanes": lanes, "trace": shader::TRACE.1, "generator": generator });
    let driver = |model: ModelId| json!({ "name": model.name(), "source": shader::driver_source(model) });
    data["drivers"] = json!(ModelId::ALL.map(driver));
    data["profiles"] = profiles.iter().map(|profile| profile.name.as_str()).collect();
    data["parameters"] = Value::from_iter(PARAMETERS.iter().map(|parameter| (parameter.key, described(parameter))));
    data["sizes"] = json!(flags);
    data["settings"] = json!(settings);
    data["hash"] = json!({ "basis": FNV_BASIS, "prime": FNV_PRIME });
    Ok(data)
}

/// A parameter in words, and as a flag of `check`.
fn described(parameter: &MapParameter) -> Value {
    let needs_unit = parameter.quantity.number().needs_unit();
    json!({
        "label": parameter.label, "name": parameter.name(), "unit": parameter.unit, "perSi": parameter.per_si,
        "flag": if parameter.is_relative { String::new() } else { flag(parameter) },
        "suffix": if needs_unit { parameter.unit } else { "" },
        "sign": if parameter.quantity == CaseQuantity::Deceleration { -1 } else { 1 },
    })
}

fn flag(parameter: &MapParameter) -> String {
    parameter.quantity.number().key.replace('_', "-")
}

/// The pipelines of a profile's lanes of a kind, and what is known of them.
fn setting(profile: &Profile, kind: &Kind, category: Category, sliders: &[Slider], sizes: &Point) -> Result<Value> {
    let generator = generator(profile, kind, category, sliders, sizes)?;
    let resolved = Constants::<f32>::resolve(profile, category);
    let unreacting = Constants::<f32>::resolve(&without_reaction(profile), category);
    let specialization = Specialization { scene: generator.scene(), values: false, queue: false };
    let with = |resolved: &Constants<f32>, model| shader::constants(resolved, model, specialization);
    // The last one is the ego that never reacts.
    let drivers = ModelId::ALL.iter().map(|model| with(&resolved, *model));
    let mut drivers: Vec<_> = drivers.chain([with(&unreacting, ModelId::Reg157)]).collect();
    let shared: Vec<_> = drivers[0].iter().copied().filter(|of| drivers.iter().all(|all| all.contains(of))).collect();
    drivers.iter_mut().for_each(|all| all.retain(|of| !shared.contains(of)));
    let object = |constants: &[(&'static str, f64)]| Value::from_iter(constants.iter().copied());
    let (frame, criteria) = (&profile.frame, &profile.criteria);
    Ok(json!({
        "profile": profile.name, "kind": kind.key, "dt": frame.dt_s, "stepCap": profile.step_cap(),
        "references": profile.reference_drivers.iter().map(|model| model.name()).collect::<Vec<_>>(),
        "settles": frame.end_when_settled,
        "thresholds": { "ttc": criteria.ttc_threshold_s, "btn": criteria.btn_threshold },
        "btn": {
            "isRoot": criteria.btn == BtnForm::DistanceRatio,
            "scale": if criteria.btn == BtnForm::Exact { 1.0 / criteria.max_deceleration_mps2 } else { 1.0 },
        },
        "recipe": generator.recipe.words(),
        "generator": object(&generator.shader_constants()),
        "shared": object(&shared),
        "drivers": drivers.iter().map(|constants| object(constants)).collect::<Vec<_>>(),
        "known": known(&generator, &resolved),
    }))
}

/// The generator of a kind's cases: its points are two corners of the sliders' ranges, from which the properties of all
/// cases follow, then the cases with known words.
fn generator(
    profile: &Profile,
    kind: &Kind,
    category: Category,
    sliders: &[Slider],
    fixed: &Point,
) -> Result<Generator> {
    let (frame, get) = (&profile.frame, |quantity| fixed.get(quantity));
    let case = PlainCase::of(category, &get, frame.default_length_m, frame.default_width_m);
    let target = VehicleSize { length_m: case.length_m, width_m: case.width_m };
    let ego = VehicleSize { length_m: case.ego_length_m, width_m: case.ego_width_m };
    let sizes = Sizes { ego, target, lead: Some(target), lane_width_m: case.lane_width_m };
    let (mut slots, mut lower) = ([NO_SLOT; Variable::ALL.len()], [0.0; MAX_PARAMETERS]);
    let mut points = vec![Vec::new(); 2 + KNOWN_CASES];
    let of_kind = kind.parameters.iter().filter_map(|key| sliders.iter().find(|slider| slider.key == *key));
    let numbers = of_kind.filter_map(|slider| Some((slider, slider.variable?)));
    for (at, (slider, variable)) in numbers.enumerate() {
        let parameter = MapParameter::find(category, &slider.key, "page")?;
        slots[variable as usize] = at as u32;
        // A speed across the road and a deceleration divide.
        lower[at] = if slider.from > 0.0 { f32::MIN_POSITIVE } else { 0.0 };
        for (case, point) in points.iter_mut().enumerate() {
            // Spread evenly: multiples of irrational numbers. No square is 3 more than a multiple of 4.
            let share =
                if case < 2 { case as f64 } else { ((case - 1) as f64 * f64::from(at as u32 * 4 + 3).sqrt()).fract() };
            point.push(match parameter.quantity {
                // Below the speed at which the vehicle begins, which comes second.
                CaseQuantity::EndSpeed if case > 1 => share as f32 * point[1],
                _ => parameter.si(slider.from + share * (slider.to - slider.from)) as f32,
            });
        }
    }
    let dimensions = points[0].len();
    let lateral = match category {
        Category::CutIn => LateralPath::Entering,
        Category::CutOut => LateralPath::Leaving,
        Category::Lvd => LateralPath::Centred,
    };
    let recipe = Recipe {
        lateral: lateral as u32,
        dimensions: dimensions as u32,
        decelerates: u32::from(slots[Variable::MeanDeceleration as usize] != NO_SLOT),
        slots,
        lower,
        min_duration: f32::MIN_POSITIVE,
        longest_duration: MAX_EVENT_S,
        ..recipe_without_parameters(category, &sizes, case.lateral_distance_m, profile)
    };
    let (means, deviations) = (points.into_iter().flatten().collect(), vec![0.0; dimensions]);
    let points = Points { source: PointSource::Given, dimensions, means, deviations };
    Ok(Generator { points, recipe, basis: Vec::new() })
}

/// Lanes of every driver, and a hash of their words for each.
fn known(generator: &Generator, resolved: &Constants<f32>) -> Value {
    let hash = |model: ModelId| {
        let lanes = (2..2 + KNOWN_CASES as u64).flat_map(|case| STARTS.map(|start| (case, start)));
        lanes.fold(FNV_BASIS, |hash, (case, start)| {
            let mut tables = Tables::default();
            let case = generator.case(case, &mut tables);
            let outcome = resolved.run(model, &case, &tables, start.start(), silent);
            words(&outcome).iter().fold(hash, |hash, word| (hash ^ word).wrapping_mul(FNV_PRIME))
        })
    };
    let start = |headway: Headway| match headway {
        Headway::ThwS(value) => json!([0, value]),
        headway => json!([1, headway.value()]),
    };
    json!({
        "points": &generator.points.means[2 * generator.points.dimensions..],
        "starts": STARTS.map(start),
        "hashes": ModelId::ALL.map(hash),
    })
}

/// FNV-1a over words.
const FNV_BASIS: u32 = 2_166_136_261;
const FNV_PRIME: u32 = 16_777_619;

/// The words of a device's outcome but for the quotient of the BTN, which only the device keeps.
fn words(outcome: &Outcome<f32>) -> [u32; 12] {
    let verdicts = u32::from(outcome.verdicts.0) | outcome.contact.code() << 4;
    [
        verdicts | u32::from(outcome.contact_with) << 6 | (outcome.end as u32) << 8,
        outcome.reaction_step,
        outcome.end_step,
        outcome.impact_speed.to_bits(),
        outcome.impact_closing_speed.to_bits(),
        outcome.min_ttc.to_bits(),
        outcome.min_gap.to_bits(),
        outcome.min_thw.to_bits(),
        outcome.max_drac.to_bits(),
        outcome.tet_steps,
        outcome.tit.to_bits(),
        outcome.pet.map_or(u32::MAX, f32::to_bits),
    ]
}
