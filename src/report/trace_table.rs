//! A case step by step, as CSV: every number that its figure draws.

use std::fmt::Write;

use crate::Result;
use crate::engine::{Mark, Trace, TracedStep, TracedVehicle};
use crate::support::table::csv_field;

const VEHICLES: [&str; 2] = ["other", "ahead"];
const COLUMNS: [&str; 11] =
    ["x_m", "y_m", "v_mps", "gap_m", "lateral_gap_m", "ttc_s", "btn", "pfs", "cfs", "present", "judged"];

/// The traces as CSV, one row per step. Several traces stand one below the other, named by a first column `lane`; a
/// single one does without. The last column names the marks of a step (`reaction`, `braking`, `contact`, joined by
/// `+`). Infinite is `inf`; a vehicle that there is not leaves its columns empty.
pub fn csv(traces: &[(String, &Trace)]) -> String {
    let vehicles = traces.iter().map(|(_, trace)| trace.vehicles).max().unwrap_or(1);
    let is_named = traces.len() > 1;
    let mut text = if is_named { "lane,".to_owned() } else { String::new() };
    text.push_str("t_s,x_ego_m,v_ego_mps,a_ego_mps2,unsafe,demand_mps2");
    for prefix in &VEHICLES[..vehicles] {
        for column in COLUMNS {
            let _ = write!(text, ",{prefix}_{column}");
        }
    }
    text.push_str(",mark\n");
    for (name, trace) in traces {
        let lane = if is_named { format!("{},", csv_field(name)) } else { String::new() };
        let marks = Mark::ALL.map(|mark| (mark, trace.step_of(mark)));
        for step in &trace.steps {
            text.push_str(&lane);
            write_step(&mut text, trace, step, vehicles);
            let here = marks.iter().filter(|(_, at)| *at == Some(step.step));
            let _ = writeln!(text, ",{}", here.map(|(mark, _)| mark.label()).collect::<Vec<_>>().join("+"));
        }
    }
    text
}

/// The same rows as a list of objects.
///
/// # Errors
/// None for what this program made.
pub fn records(traces: &[(String, &Trace)]) -> Result<serde_json::Value> {
    super::records::records(csv(traces).as_bytes())
}

fn write_step(text: &mut String, trace: &Trace, step: &TracedStep, vehicles: usize) {
    let demand = step.demand_mps2.map_or(String::new(), |demand| demand.to_string());
    let _ = write!(
        text,
        "{},{},{},{},{},{demand}",
        step.time_s,
        step.x_ego_m,
        step.v_ego_mps,
        step.a_ego_mps2,
        u8::from(step.is_unsafe)
    );
    for (k, other) in step.others[..vehicles].iter().enumerate() {
        if k < trace.vehicles {
            write_vehicle(text, other);
        } else {
            text.push_str(&",".repeat(COLUMNS.len()));
        }
    }
}

fn write_vehicle(text: &mut String, other: &TracedVehicle) {
    let TracedVehicle { x_m, y_m, v_mps, gap_m, lateral_gap_m, ttc_s, btn, pfs, cfs, is_present, is_judged } = other;
    let (present, judged) = (u8::from(*is_present), u8::from(*is_judged));
    let _ = write!(text, ",{x_m},{y_m},{v_mps},{gap_m},{lateral_gap_m},{ttc_s},{btn},{pfs},{cfs},{present},{judged}");
}
