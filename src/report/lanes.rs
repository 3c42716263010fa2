//! One row per lane: verdicts, continuous values and times, with the columns of the golden lanes.

use std::io::Write;

use rayon::prelude::*;

use crate::criterion::Criterion;
use crate::scalar::Real;
use crate::sweep::{Chunk, Constants, Headway, LaneKey, LanePlan, NO_STEP, Outcome, Silent, Start};

/// The header.
pub const HEADER: &str = "id,category,param,thw,model,collision,ttc,btn,min_ttc,max_btn,crash_type,t_react,t_crash,\
                          impact_speed,t_end,robust";

/// Numbers in the arithmetic they were computed in: the shortest text that reads back to the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Digits {
    /// The lane arithmetic.
    Binary32,
    /// The reference.
    Binary64,
}

impl Digits {
    fn write(self, value: f64) -> String {
        match self {
            Digits::Binary32 => (value as f32).to_string(),
            Digits::Binary64 => value.to_string(),
        }
    }
}

/// A key as a CSV field.
pub(super) fn quoted(key: &str) -> String {
    if key.contains([',', '"', '\n', '\r']) { format!("\"{}\"", key.replace('"', "\"\"")) } else { key.to_owned() }
}

/// Writes the header.
pub fn write_header(out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(out, "{HEADER}")
}

/// Writes the lanes of a chunk that has outcomes, in the plan's order. Empty: did not happen. `robust` is 0
/// where verdicts or crash type of the f64 reference change when the initial gap moves by 1e-9 m.
pub fn write_chunk(out: &mut dyn Write, plan: &LanePlan, chunk: &Chunk, digits: Digits) -> std::io::Result<()> {
    let dt = plan.profile.frame.dt_s;
    let constants: Vec<Constants<f64>> =
        plan.blocks.iter().map(|b| Constants::resolve(&plan.profile, b.category)).collect();
    // Three more lanes for each: the only part that is worth the other threads.
    let robust: Vec<bool> = (0..chunk.outcomes.len())
        .into_par_iter()
        .map(|at| {
            plan.key(chunk.first_lane + at as u64).is_some_and(|key| is_robust(&constants[key.block], plan, &key))
        })
        .collect();
    for (at, outcome) in chunk.outcomes.iter().enumerate() {
        let Some(key) = plan.key(chunk.first_lane + at as u64) else { continue };
        let block = &plan.blocks[key.block];
        let headway = plan.headways[key.headway];
        let thw = match headway {
            Headway::ThwS(thw) => decimal(thw),
            Headway::GapM(_) => String::new(),
        };
        let judged = |c: Criterion| u8::from(outcome.verdicts.failed(c));
        let time = |step: u32| if step == NO_STEP { String::new() } else { time(step, dt) };
        let impact = if outcome.contact_step == NO_STEP { String::new() } else { digits.write(outcome.impact_speed) };
        writeln!(
            out,
            "{},{},{},{thw},{},{},{},{},{},{},{},{},{},{impact},{},{}",
            quoted(&block.units.name(key.unit)),
            block.category.key(),
            block.variants[key.variant],
            plan.models[key.model].name(),
            judged(Criterion::Collision),
            judged(Criterion::Ttc),
            judged(Criterion::Btn),
            digits.write(outcome.min_ttc),
            digits.write(outcome.max_btn),
            outcome.contact.code(),
            time(outcome.reaction_step),
            time(outcome.contact_step),
            time(outcome.end_step),
            u8::from(robust[at])
        )?;
    }
    Ok(())
}

fn is_robust(constants: &Constants<f64>, plan: &LanePlan, key: &LaneKey) -> bool {
    let case = plan.case(key.block, key.unit, key.variant);
    let gap = match plan.headways[key.headway].start::<f64>() {
        Start::Headway(thw) => thw * case.ego_speed,
        Start::Gap(gap) => gap,
    };
    let run = |gap: f64| -> Outcome<f64> {
        constants.run(plan.models[key.model], &case, plan.tables(), Start::Gap(gap), &mut Silent)
    };
    let seen = |o: Outcome<f64>| (o.verdicts.0 & 0b111, o.contact);
    let middle = seen(run(gap));
    seen(run(gap - 1e-9)) == middle && seen(run(gap + 1e-9)) == middle
}

/// i·dt without the rounding error of the product.
fn time(step: u32, dt: f64) -> String {
    ((f64::from_step(step) * dt * 1e9).round() / 1e9).to_string()
}

/// 2 as `2.0`, like the golden lanes.
fn decimal(value: f64) -> String {
    format!("{value:?}")
}
