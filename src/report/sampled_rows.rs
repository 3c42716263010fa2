//! One row per sampled lane: its point, its verdicts and its values. Void samples have no row.

use crate::engine::{Chunk, LanePlan, NO_STEP, Outcome};
use crate::model::criterion::Criterion;
use crate::stats::density::DensityModel;
use crate::support::table::{Cell, Column, Kind, TableWriter};
use crate::{Error, Result};

/// The columns, in their order: units are in the names, parameters come last.
#[rustfmt::skip] // a table: one line per column
pub fn columns(density: &DensityModel) -> Vec<Column> {
    let c = Column::new;
    let mut columns = vec![
        c("sample", Kind::Whole, "1", "Index of the sample: with the seed it decides the point."),
        c("category", Kind::Name, "", "Kind of scenario: cut_in, cut_out or lvd (leader decelerates)."),
        c("parameterization", Kind::Name, "", "Key of the parameterization whose parameters were drawn."),
        c("headway", Kind::Name, "", "Initial time headway or gap with its unit; `sampled` where it is a parameter."),
        c("model", Kind::Name, "", "Driver model."),
        c("collision", Kind::Flag, "", "Failed the criterion collision."),
        c("ttc", Kind::Flag, "", "Failed the criterion TTC."),
        c("btn", Kind::Flag, "", "Failed the criterion BTN."),
        c("capped", Kind::Flag, "", "Ended by the time cap."),
        c("min_ttc_s", Kind::Binary32, "s", "Smallest time to collision; null where the vehicles never approached."),
        c("max_btn", Kind::Binary32, "1", "Largest Brake Threat Number; null where it has no bound."),
        c("min_gap_m", Kind::Binary32, "m", "Smallest gap, bumper to bumper; null where there was none."),
        c("contact_type", Kind::Whole, "1", "Kind of contact; 0 without one."),
        c("reaction_s", Kind::Binary64, "s", "When the driver first reacted; null if never."),
        c("end_s", Kind::Binary64, "s", "When the run ended."),
        c("impact_speed_mps", Kind::Binary32, "m/s", "Speed of the ego at contact; null without one."),
        c("impact_closing_speed_mps", Kind::Binary32, "m/s", "Closing speed at contact; null without one."),
    ];
    columns.extend(density.space.parameters().iter().map(|parameter| Column {
        name: parameter.name.clone().into(),
        kind: Kind::Binary32,
        unit: parameter.unit.clone().into(),
        description: "Parameter that was drawn.".into(),
    }));
    columns
}

/// Writes the lanes of a chunk that has outcomes, in the plan's order. Null: did not happen, or without bound.
///
/// # Errors
/// As [`TableWriter::row`]; [`Error::Internal`] for a plan that is not sampled.
pub fn write_chunk(table: &mut TableWriter, plan: &LanePlan, density: &DensityModel, chunk: &Chunk) -> Result<()> {
    let Some(generator) = plan.generator() else {
        return Err(Error::Internal("the plan has no generator".to_owned()));
    };
    let dt = plan.profile.frame.dt_s;
    let dimensions = density.space.dimensions();
    let value = |v: f64| Cell::number(v.is_finite().then_some(v));
    let at_contact = |outcome: &Outcome<f64>, v: f64| Cell::number((outcome.contact_step != NO_STEP).then_some(v));
    let time = |step: u32| Cell::number((step != NO_STEP).then(|| (f64::from(step) * dt * 1e9).round() / 1e9));
    let (headways, models) = (plan.headways.len(), plan.models.len());
    for (unit, lanes) in chunk.units.clone().zip(chunk.outcomes.chunks(headways * models)) {
        let drawn = generator.draw(unit);
        if drawn.is_void() {
            continue;
        }
        let point: Vec<f64> = drawn.values[..dimensions].iter().map(|&v| f64::from(v)).collect();
        for (at, outcome) in lanes.iter().enumerate() {
            let headway = match density.space.thw_s(&point) {
                Some(_) => "sampled".to_owned(),
                None => plan.headways[at / models].to_string(),
            };
            let [collision, ttc, btn] = Criterion::ALL.map(|c| Cell::Flag(outcome.verdicts.failed(c)));
            let mut row = vec![
                Cell::Whole(unit as i64),
                Cell::text(density.category().key()),
                Cell::text(density.space.id().key.as_ref()),
                Cell::text(headway),
                Cell::text(plan.models[at % models].name()),
                collision,
                ttc,
                btn,
                Cell::Flag(outcome.verdicts.capped()),
                value(outcome.min_ttc),
                value(outcome.max_btn),
                value(outcome.min_gap),
                Cell::Whole(i64::from(outcome.contact.code())),
                time(outcome.reaction_step),
                time(outcome.end_step),
                at_contact(outcome, outcome.impact_speed),
                at_contact(outcome, outcome.impact_closing_speed),
            ];
            row.extend(point.iter().map(|&v| Cell::Number(v)));
            table.row(&row)?;
        }
    }
    Ok(())
}
