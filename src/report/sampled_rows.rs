//! One row per sampled lane: its point, its verdicts and its values. Void samples have no row.

use std::io::Write;

use crate::criterion::Criterion;
use crate::density::DensityModel;
use crate::sweep::{Chunk, LanePlan, NO_STEP};

/// Writes the header: units are in the names, parameters come last.
pub fn write_header(out: &mut dyn Write, density: &DensityModel) -> std::io::Result<()> {
    write!(
        out,
        "sample,category,parameterization,headway,model,collision,ttc,btn,capped,min_ttc_s,max_btn,min_gap_m,\
         contact_type,reaction_s,end_s,impact_speed_mps,impact_closing_speed_mps"
    )?;
    for parameter in density.space.parameters() {
        write!(out, ",{}", parameter.name)?;
    }
    writeln!(out)
}

/// Writes the lanes of a chunk that has outcomes, in the plan's order. Empty: did not happen, or without bound.
pub fn write_chunk(out: &mut dyn Write, plan: &LanePlan, density: &DensityModel, chunk: &Chunk) -> std::io::Result<()> {
    let Some(generator) = plan.generator() else { return Err(std::io::Error::other("the plan has no generator")) };
    let dt = plan.profile.frame.dt_s;
    let dimensions = density.space.dimensions();
    let value = |v: f64| if v.is_finite() { (v as f32).to_string() } else { String::new() };
    let time = |step: u32| {
        if step == NO_STEP { String::new() } else { ((f64::from(step) * dt * 1e9).round() / 1e9).to_string() }
    };
    let (headways, models) = (plan.headways.len(), plan.models.len());
    for (unit, lanes) in chunk.units.clone().zip(chunk.outcomes.chunks(headways * models)) {
        let drawn = generator.draw(unit);
        if drawn.is_void() {
            continue;
        }
        let point: Vec<f64> = drawn.values[..dimensions].iter().map(|&v| f64::from(v)).collect();
        let parameters: String = drawn.values[..dimensions].iter().map(|v| format!(",{v}")).collect();
        for (at, outcome) in lanes.iter().enumerate() {
            let headway = match density.space.thw_s(&point) {
                Some(_) => "sampled".to_owned(),
                None => plan.headways[at / models].to_string(),
            };
            let [collision, ttc, btn] = Criterion::ALL.map(|c| u8::from(outcome.verdicts.failed(c)));
            writeln!(
                out,
                "{unit},{},{},{headway},{},{collision},{ttc},{btn},{},{},{},{},{},{},{},{},{}{parameters}",
                density.category().key(),
                density.space.id().key,
                plan.models[at % models].name(),
                u8::from(outcome.verdicts.capped()),
                value(outcome.min_ttc),
                value(outcome.max_btn),
                value(outcome.min_gap),
                outcome.contact.code(),
                time(outcome.reaction_step),
                time(outcome.end_step),
                value(outcome.impact_speed),
                value(outcome.impact_closing_speed),
            )?;
        }
    }
    Ok(())
}
