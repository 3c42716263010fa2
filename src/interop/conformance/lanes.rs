//! Lanes of the `paper` profile: runs every lane of a golden table (`--scenarios S.jsonl --golden-lanes L.csv`) in f64
//! and in f32, and compares.

use std::collections::HashMap;

use super::table::{Row, Table};
use super::tally::Tally;
use crate::engine::{Constants, LaneCase, NO_STEP, Outcome, Silent, Start};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::model::scalar::Real;
use crate::scenario::parameterization::{Parameterization, ParameterizationOptions, recorded_case};
use crate::scenario::{Category, Scenario, Tables};
use crate::{Error, Place, Result};

/// Comparison of f64 with the table, and of f32 with f64.
#[derive(Debug, Clone)]
pub struct LaneComparison {
    /// f64 against the table, per category and model.
    pub tallies: Vec<Tally>,
    /// Lanes whose verdicts differ between f32 and f64, as text.
    pub f32_different: Vec<String>,
    /// Robust lanes that rounding nevertheless decides: they agree if the gap changes by 1e-9 m.
    pub ties: Vec<String>,
    /// Lanes compared.
    pub lanes: u64,
    /// Lanes whose end time differs; information only, because the end rule of the table can be read in several ways.
    pub end_differs: u64,
}

struct Encoded {
    case64: LaneCase<f64>,
    tables64: Tables<f64>,
    case32: LaneCase<f32>,
    tables32: Tables<f32>,
}

/// Compares every lane of a table.
pub fn compare_lanes(scenarios: &[Scenario], lanes: &Table, profile: &Profile) -> Result<LaneComparison> {
    let by_id: HashMap<&str, &Scenario> = scenarios.iter().map(|s| (s.id.as_str(), s)).collect();
    // The golden lanes approximate the sinusoid by 201 points; all other options are the defaults.
    let options = ParameterizationOptions { sinusoid_intervals: 200, ..ParameterizationOptions::default() };
    let dt_s = profile.frame.dt_s;
    let constants64: HashMap<Category, Constants<f64>> =
        Category::ALL.into_iter().map(|c| (c, Constants::resolve(profile, c))).collect();
    let constants32: HashMap<Category, Constants<f32>> =
        Category::ALL.into_iter().map(|c| (c, Constants::resolve(profile, c))).collect();
    let mut encoded: HashMap<(String, String), Encoded> = HashMap::new();
    let mut result =
        LaneComparison { tallies: Vec::new(), f32_different: Vec::new(), ties: Vec::new(), lanes: 0, end_differs: 0 };
    for row in lanes.rows() {
        let (id, param) = (row.text("id")?, row.text("param")?);
        let scenario = by_id.get(id).ok_or_else(|| {
            Error::input(row.place("id"), format!("there is no scenario `{id}`"), "give the scenario file it is from")
        })?;
        let key = (id.to_owned(), param.to_owned());
        if !encoded.contains_key(&key) {
            let case = match param {
                "S" => recorded_case(scenario, dt_s)?,
                // An SVD parameterization needs the fit of the table's study.
                _ => Parameterization::find(scenario.category, param)
                    .filter(|id| id.features().is_some())
                    .ok_or_else(|| {
                        let problem =
                            format!("{} has no kinematic parameterization `{param}`", scenario.category.label());
                        Error::input(row.place("param"), problem, "expected S or a kinematic one (1–4, a–d, i, ii)")
                    })?
                    .case(scenario, dt_s, &options, None)?,
            };
            let mut tables64 = Tables::default();
            let case64 = LaneCase::encode(&case, profile, &mut tables64);
            let (case32, tables32) = (case64.cast(), tables64.cast());
            encoded.insert(key.clone(), Encoded { case64, tables64, case32, tables32 });
        }
        let lane = &encoded[&key];
        let name = row.text("model")?;
        let model = ModelId::parse(name).ok_or_else(|| {
            Error::input(
                row.place("model"),
                format!("there is no model `{name}`"),
                format!("known: {}", ModelId::names()),
            )
        })?;
        let thw = row.number("thw")?;
        let reference = run(&constants64[&scenario.category], model, &lane.case64, &lane.tables64, thw);
        let lanes32 = run(&constants32[&scenario.category], model, &lane.case32, &lane.tables32, thw);
        result.lanes += 1;
        if reference.verdicts != lanes32.verdicts {
            result.f32_different.push(format!("{}: {id}/{param}/{thw}s/{name}", row.place("id")));
        }
        let label = scenario.category.label();
        let at = match result.tallies.iter().position(|t| t.label == label && t.model == Some(model)) {
            Some(at) => at,
            None => {
                result.tallies.push(Tally::new(label, Some(model)));
                result.tallies.len() - 1
            }
        };
        let mut judged = reference;
        if row.flag("robust")? && !agreement(&row, &reference, dt_s)? {
            // A tie: the table's robustness flag moves the gap but compares verdicts only. If a change of 1e-9 m gives
            // the table's values, rounding decides.
            for nudge_m in [1e-9, -1e-9] {
                let start = Start::Gap(thw * lane.case64.ego_speed + nudge_m);
                let constants = &constants64[&scenario.category];
                let nudged = constants.run(model, &lane.case64, &lane.tables64, start, &mut Silent);
                if agreement(&row, &nudged, dt_s)? {
                    judged = nudged;
                    result.ties.push(format!("{}: {id}/{param}/{thw}s/{name}", row.place("id")));
                    break;
                }
            }
        }
        compare(&mut result.tallies[at], &row, &judged, dt_s)?;
        if lanes.has("t_end") && (f64::from(reference.end_step) * dt_s - row.number("t_end")?).abs() > 1e-6 {
            result.end_differs += 1;
        }
    }
    if result.lanes == 0 {
        return Err(Error::input(Place::option("golden_lanes"), "no lane to compare", "give a table with rows"));
    }
    Ok(result)
}

fn run<R: Real>(
    constants: &Constants<R>,
    model: ModelId,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    thw: f64,
) -> Outcome<f64> {
    constants.run(model, case, tables, Start::Headway(R::from_f64(thw)), &mut Silent).widen()
}

/// Whether a lane agrees with its row in verdicts, type and every value.
fn agreement(row: &Row, ours: &Outcome<f64>, dt: f64) -> Result<bool> {
    let mut scratch = Tally::new("", None);
    compare(&mut scratch, row, ours, dt)?;
    Ok(scratch.passes() && scratch.fragile_different == 0)
}

fn compare(tally: &mut Tally, row: &Row, ours: &Outcome<f64>, dt: f64) -> Result<()> {
    let robust = row.flag("robust")?;
    let place = |column: &str| row.place(column).to_string();
    tally.rows += 1;
    tally.robust += u64::from(robust);
    tally.reacted += u64::from(ours.reaction_step != NO_STEP);
    let mut verdicts_equal = true;
    for criterion in crate::model::criterion::Criterion::ALL {
        let (we, they) = (ours.verdicts.failed(criterion), row.flag(criterion.key())?);
        if we != they {
            verdicts_equal = false;
            if robust {
                tally.complain(format!("{}: we have {we}, the table has {they}", place(criterion.key())));
            }
        }
    }
    let collided = ours.contact_step != NO_STEP;
    tally.collided += u64::from(collided);
    tally.labels_equal += u64::from(verdicts_equal || !robust);
    let same_type = f64::from(ours.contact.code()) == row.number("crash_type")?;
    tally.types_equal += u64::from(robust && same_type);
    let time = |step: u32| (step != NO_STEP).then(|| f64::from(step) * dt);
    let mut agrees = verdicts_equal && same_type;
    for (quantity, column, value) in [
        ("min TTC [s]", "min_ttc", Some(ours.min_ttc)),
        ("max BTN", "max_btn", Some(ours.max_btn)),
        ("t_react [s]", "t_react", time(ours.reaction_step)),
        ("t_crash [s]", "t_crash", time(ours.contact_step)),
        ("impact speed [m/s]", "impact_speed", collided.then_some(ours.impact_speed)),
    ] {
        let theirs = row.optional(column)?;
        // The table rounds to nine digits, so large values have fewer decimals.
        let scale = theirs.filter(|t| t.is_finite()).map_or(1.0, |t| t.abs().max(1.0));
        let scaled = |x: Option<f64>| x.map(|x| if x.is_finite() { x / scale } else { x });
        agrees &= tally.value(quantity, robust, scaled(value), scaled(theirs), &|| place(column));
    }
    tally.fragile_different += u64::from(!robust && !agrees);
    Ok(())
}
