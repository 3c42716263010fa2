//! One row per lane: verdicts, continuous values and times. Lanes of a sampling run have their point. Void samples have no row.

use std::path::Path;

use serde_json::{Map, Value};

use crate::records::{at_contact, smallest_gap_m, time_s};
use lanesweep_engine::{Chunk, Headway, LanePlan, Outcome, Trace};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_run::sampling::{Sample, SampledPoint};
use lanesweep_run::study::{Study, robust_lanes};
use lanesweep_stats::density::DensityModel;
use lanesweep_support::files::make_folder_of;
use lanesweep_support::table::{Cell, Column, ColumnKind, Table, TableFormat, TableMetadata, TableWriter, json_value};
use lanesweep_support::{Error, Result, option};

/// A table for the lanes of a study; see [`write_study_chunk`]. It is written chunk by chunk, so that memory does not
/// grow with the lanes.
///
/// # Errors
/// [`Error::Io`]; [`Error::Usage`] for an unknown ending of the name.
pub fn study_table(path: &Path, study: &Study) -> Result<TableWriter> {
    make_folder_of(path)?;
    let facts = study.facts();
    let value = if facts.reference { ColumnKind::Binary64 } else { ColumnKind::Binary32 };
    let (profile, plan_sha256) = (Some(study.plan().profile.name.clone()), Some(study.plan().hash().to_owned()));
    let metadata = TableMetadata { table: "lanes", profile, plan_sha256, synthetic: facts.synthetic };
    TableWriter::create(path, table_format(path, "rows")?, columns(value), &metadata)
}

/// A table for lanes of a sampling run; see [`write_sampled_chunk`] and [`write_sampled_lane`].
///
/// # Errors
/// [`Error::Io`]; [`Error::Usage`] for an unknown ending of the name.
pub fn sampled_table(path: &Path, sample: &Sample) -> Result<TableWriter> {
    let plan_sha256 = sample.lane_plan().map(|plan| plan.hash().to_owned());
    let (profile, synthetic) = (Some(sample.profile.name.clone()), sample.density.provenance.synthetic);
    let metadata = TableMetadata { table: "samples", profile, plan_sha256, synthetic };
    TableWriter::create(path, table_format(path, "rows")?, sampled_columns(&sample.density), &metadata)
}

/// The format of a table of lanes, from the file name that a flag gives.
///
/// # Errors
/// [`Error::Usage`] for an unknown ending of the name.
pub fn table_format(path: &Path, flag: &str) -> Result<TableFormat> {
    TableFormat::of(path, &TableFormat::EVERY, &option(flag))
}

/// The columns of a study's lanes, in their order. `value` is the arithmetic of the numbers: binary32, or binary64 of
/// the reference; they are written as the shortest text that reads back to the same bits.
#[rustfmt::skip] // a table: one line per column
pub fn columns(value: ColumnKind) -> Vec<Column> {
    let c = Column::new;
    let mut columns = vec![
        c("id", ColumnKind::Text, "", "Scenario."),
        c("category", ColumnKind::Name, "", "Kind of scenario: cut_in, cut_out or lvd (leader decelerates)."),
        c("variant", ColumnKind::Name, "", "S (as recorded) or the key of a parameterization."),
        c("headway", ColumnKind::Name, "", "Initial time headway or gap with its unit; `observed` where each case has its own."),
        c("model", ColumnKind::Name, "", "Driver model."),
    ];
    columns.extend(outcome_columns(value));
    let robust = "Moving the initial gap by 1e-9 m changes neither verdict nor contact in binary64; null for drivers outside the registry.";
    columns.push(c("robust", ColumnKind::Flag, "", robust));
    columns
}

/// Writes the lanes of a chunk with outcomes, in the plan's order. Null: did not happen. `robust` is false if moving
/// the initial gap by 1e-9 m changes verdicts or crash type of the f64 reference.
///
/// # Errors
/// As [`TableWriter::row`].
pub fn write_study_chunk(table: &mut TableWriter, plan: &LanePlan, chunk: &Chunk) -> Result<()> {
    let dt = plan.profile.frame.dt_s;
    let robust = robust_lanes(plan, chunk);
    for (at, outcome) in chunk.outcomes.iter().enumerate() {
        let Some(key) = plan.key(chunk.first_lane + at as u64) else { continue };
        let block = &plan.blocks[key.block];
        let id = block.units.name(key.unit);
        let mut row = vec![
            Cell::text(id.as_ref()),
            Cell::text(block.category.key()),
            Cell::text(block.variants[key.variant].as_str()),
            Cell::text(plan.headways[key.headway].to_string()),
            Cell::text(plan.models[key.model].name()),
        ];
        row.extend(outcome_cells(outcome, dt));
        row.push(robust[at].map_or(Cell::Null, Cell::Flag));
        table.row(&row)?;
    }
    Ok(())
}

/// How a lane ended, as tables and JSON documents have it: name with its unit, type, unit, meaning, value. Null: did not happen.
#[rustfmt::skip] // a table: one line per column
static OUTCOME: [OutcomeColumn; 18] = [
    ("collision", ColumnKind::Flag, "", "Failed the criterion collision.", |o, _| Cell::Flag(o.verdicts.failed(Criterion::Collision))),
    ("ttc", ColumnKind::Flag, "", "Failed the criterion TTC.", |o, _| Cell::Flag(o.verdicts.failed(Criterion::Ttc))),
    ("btn", ColumnKind::Flag, "", "Failed the criterion BTN.", |o, _| Cell::Flag(o.verdicts.failed(Criterion::Btn))),
    ("capped", ColumnKind::Flag, "", "Ended by the time cap.", |o, _| Cell::Flag(o.verdicts.capped())),
    ("min_ttc_s", ColumnKind::Binary32, "s", "Smallest time to collision; infinite where the vehicles never approached.", |o, _| Cell::Number(o.min_ttc)),
    ("max_btn", ColumnKind::Binary32, "1", "Largest Brake Threat Number; infinite where no braking avoids the contact.", |o, _| Cell::Number(o.max_btn)),
    ("min_gap_m", ColumnKind::Binary32, "m", "Smallest gap to a vehicle that TTC and BTN evaluate, bumper to bumper; at most 0 where vehicles touched, infinite where none was evaluated.", |o, _| Cell::Number(smallest_gap_m(o))),
    ("contact_type", ColumnKind::Whole, "1", "Kind of contact; 0 without one.", |o, _| Cell::Whole(i64::from(o.contact.code()))),
    ("reaction_s", ColumnKind::Binary64, "s", "When the driver first reacted; null if never.", |o, dt_s| Cell::number(time_s(o.reaction_step, dt_s))),
    ("contact_s", ColumnKind::Binary64, "s", "When vehicles touched; null if never.", |o, dt_s| Cell::number(time_s(o.contact_step, dt_s))),
    ("end_s", ColumnKind::Binary64, "s", "When the run ended.", |o, dt_s| Cell::number(time_s(o.end_step, dt_s))),
    ("impact_speed_mps", ColumnKind::Binary32, "m/s", "Speed of the ego at contact; null without one.", |o, _| Cell::number(at_contact(o, o.impact_speed))),
    ("impact_closing_speed_mps", ColumnKind::Binary32, "m/s", "Closing speed at contact; null without one.", |o, _| Cell::number(at_contact(o, o.impact_closing_speed))),
    ("min_thw_s", ColumnKind::Binary32, "s", "Smallest time headway; infinite if no vehicle was evaluated while the ego moved.", |o, _| Cell::Number(o.min_thw)),
    ("max_drac_mps2", ColumnKind::Binary32, "m/s²", "Largest deceleration rate to avoid the crash; infinite at contact.", |o, _| Cell::Number(o.max_drac)),
    ("tet_s", ColumnKind::Binary64, "s", "Time exposed TTC: time with a TTC below the profile's tet_threshold_s.", |o, dt_s| Cell::number(time_s(o.tet_steps, dt_s))),
    ("tit_s2", ColumnKind::Binary32, "s²", "Time integrated TTC: integral of threshold minus TTC over that time.", |o, _| Cell::Number(o.tit)),
    ("pet_s", ColumnKind::Binary32, "s", "Post-encroachment time of a cut-in; infinite if the ego stops before the place, null if there is none.", |o, _| Cell::number(o.pet)),
];
type OutcomeColumn = (&'static str, ColumnKind, &'static str, &'static str, OutcomeValue);
type OutcomeValue = fn(&Outcome<f64>, f64) -> Cell<'static>;

/// `value` is the arithmetic of the numbers.
pub(super) fn outcome_columns(value: ColumnKind) -> impl Iterator<Item = Column> {
    OUTCOME.iter().map(move |&(name, kind, unit, meaning, _)| {
        Column::new(name, if kind == ColumnKind::Binary32 { value } else { kind }, unit, meaning)
    })
}

pub(super) fn outcome_cells(outcome: &Outcome<f64>, dt_s: f64) -> [Cell<'static>; 18] {
    std::array::from_fn(|at| OUTCOME[at].4(outcome, dt_s))
}

/// A table with a row per trace, and how each ended, in binary64.
pub(crate) fn with_outcomes<'t>(mut table: Table, traces: impl IntoIterator<Item = &'t Trace>) -> Table {
    table.columns.extend(outcome_columns(ColumnKind::Binary64));
    for (row, trace) in table.rows.iter_mut().zip(traces) {
        row.extend(outcome_cells(&trace.outcome, trace.dt_s));
    }
    table
}

/// How a lane ended, for a JSON document, in binary64.
pub(crate) fn outcome_record(outcome: &Outcome<f64>, dt_s: f64) -> Map<String, Value> {
    let value = |value: OutcomeValue| json_value(ColumnKind::Binary64, &value(outcome, dt_s));
    OUTCOME.iter().map(|&(name, .., of)| (name.to_owned(), value(of))).collect()
}

/// The columns of [concrete cases](lanesweep_run::cases), in their order; `value` as in [`columns`].
#[rustfmt::skip] // a table: one line per column
pub fn case_columns(value: ColumnKind) -> Vec<Column> {
    let c = Column::new;
    let mut columns = vec![
        c("case", ColumnKind::Whole, "1", "Row of the case, from 0."),
        c("headway", ColumnKind::Name, "", "Initial time headway or gap with its unit; null where each case has its own."),
        c("model", ColumnKind::Name, "", "Driver model."),
    ];
    columns.extend(outcome_columns(value));
    columns.push(c("robust", ColumnKind::Flag, "", "False where binary64, the arithmetic of `check` and `trace`, gives another verdict (compared near limits only); null for drivers of one's own."));
    columns
}

/// A row of [`case_columns`].
pub fn case_row<'a>(
    (case, headway, model): (u64, Headway, &'a str),
    outcome: &Outcome<f64>,
    is_robust: Option<bool>,
    dt_s: f64,
) -> Vec<Cell<'a>> {
    let headway = (headway != Headway::Observed).then(|| headway.to_string());
    let mut row = vec![Cell::Whole(case as i64), headway.map_or(Cell::Null, Cell::text), Cell::text(model)];
    row.extend(outcome_cells(outcome, dt_s));
    row.push(is_robust.map_or(Cell::Null, Cell::Flag));
    row
}

/// The columns, in their order: units are in the names, parameters come last.
#[rustfmt::skip] // a table: one line per column
fn sampled_columns(density: &DensityModel) -> Vec<Column> {
    let c = Column::new;
    let mut columns = vec![
        c("sample", ColumnKind::Whole, "1", "Index of the sample: with the seed it decides the point."),
        c("category", ColumnKind::Name, "", "Kind of scenario: cut_in, cut_out or lvd (leader decelerates)."),
        c("variant", ColumnKind::Name, "", "Key of the parameterization whose parameters were drawn."),
        c("headway", ColumnKind::Name, "", "Initial time headway or gap with its unit; `sampled` where it is a parameter."),
        c("model", ColumnKind::Name, "", "Driver model."),
    ];
    columns.extend(outcome_columns(ColumnKind::Binary32));
    columns.extend([
        c("kernel", ColumnKind::Whole, "1", "Kernel of the sample, from 0: the one that it was drawn from, or that explains a sample of importance sampling best."),
        c("scenario", ColumnKind::Name, "", "Recorded scenario of the kernel; null where the density has none."),
        c("source", ColumnKind::Name, "", "What the sample was drawn from: density, or proposal; each counts its samples from 0."),
        c("weight", ColumnKind::Binary64, "1", "What a failing lane adds to P: the weights of all failing lanes of a model, headway and criterion add up to it (`auto`: to that of `mc`). Null in the table of every lane, where all samples count the same."),
    ]);
    columns.extend(density.space.parameters().iter().map(|parameter| {
        let (name, unit) = (parameter.name.clone(), parameter.unit.clone());
        Column::new(name, ColumnKind::Binary32, unit, "Parameter that was drawn.".to_owned())
    }));
    columns
}

/// Writes the lanes of a chunk with outcomes, in the plan's order. Null: did not happen.
///
/// # Errors
/// As [`TableWriter::row`]; [`Error::Internal`] for a plan that is not sampled.
pub fn write_sampled_chunk(table: &mut TableWriter, sample: &Sample, plan: &LanePlan, chunk: &Chunk) -> Result<()> {
    let Some(generator) = plan.generator() else {
        return Err(Error::Internal("the plan has no generator".to_owned()));
    };
    let dimensions = sample.density.space.dimensions();
    let (headways, models) = (plan.headways.len(), plan.models.len());
    for (unit, lanes) in chunk.units.clone().zip(chunk.outcomes.chunks(headways * models)) {
        let drawn = generator.draw(unit);
        if drawn.is_void() {
            continue;
        }
        let drawn = SampledPoint {
            sample: unit,
            point: drawn.values[..dimensions].iter().map(|&v| f64::from(v)).collect(),
            is_of_density: true,
            kernel: generator.points.component(unit, drawn.tries),
            weight: None,
        };
        for (at, outcome) in lanes.iter().enumerate() {
            write_sampled_lane(table, sample, &drawn, (at / models, plan.models[at % models]), outcome)?;
        }
    }
    Ok(())
}

/// Writes a lane of a sample, with the index of its headway, as [`write_sampled_chunk`].
///
/// # Errors
/// As [`TableWriter::row`].
pub fn write_sampled_lane(
    table: &mut TableWriter,
    sample: &Sample,
    drawn: &SampledPoint,
    (headway, model): (usize, ModelId),
    outcome: &Outcome<f64>,
) -> Result<()> {
    let id = sample.density.space.id();
    let scenario = drawn.kernel.and_then(|kernel| sample.density.scenarios.get(kernel as usize));
    let mut row = vec![
        Cell::Whole(drawn.sample as i64),
        Cell::text(id.category.key()),
        Cell::text(id.key),
        Cell::text(sample.options.headway_name(headway)),
        Cell::text(model.name()),
    ];
    row.extend(outcome_cells(outcome, sample.profile.frame.dt_s));
    row.push(drawn.kernel.map_or(Cell::Null, |kernel| Cell::Whole(i64::from(kernel))));
    row.push(scenario.map_or(Cell::Null, |scenario| Cell::text(scenario.id.as_str())));
    row.push(Cell::text(if drawn.is_of_density { "density" } else { "proposal" }));
    row.push(Cell::number(drawn.weight));
    row.extend(drawn.point.iter().map(|&v| Cell::Number(v)));
    table.row(&row)
}
