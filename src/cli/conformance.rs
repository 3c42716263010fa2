//! `lanesweep verify conformance`: compares other simulators' tables with our lanes.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;

use super::Exit;
use super::format::FormatFlag;
use super::source::file_of;
use crate::interop::conformance::{
    LaneComparison, Table, TableKind, Tally, compare_functions, compare_jrc, compare_lanes,
};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::records;
use crate::scenario::read_scenarios;
use crate::support::ranges::refuse_repeats;
use crate::support::readable::{count, count_of};

use crate::support::table::Table as SummaryTable;
use crate::{Error, Place, Result};

/// Compare golden tables of simulated cases with our own lanes
///
/// JRC case tables and function tables are run under the profile jrc-2021 in f64; lanes of the paper
/// profile (--scenarios with --golden-lanes) in f64 and in f32. Ends with code 5 if a collision label differs,
/// or on a robust row a type, a verdict or a value (by more than 1e-6).
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep verify conformance cutin.csv lvd.csv cutout.csv functions.csv")]
pub struct Conformance {
    /// JRC case tables or function tables (CSV)
    #[arg(value_name = "FILE", help_heading = "Data")]
    tables: Vec<PathBuf>,
    /// Scenarios of the lanes (JSON Lines)
    #[arg(long, value_name = "FILE", requires = "golden_lanes", help_heading = "Data")]
    scenarios: Option<PathBuf>,
    /// Golden lanes of the paper profile (CSV)
    #[arg(long, value_name = "FILE", requires = "scenarios", help_heading = "Data")]
    golden_lanes: Option<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
}

impl Conformance {
    pub fn run(&self) -> Result<Exit> {
        if self.tables.is_empty() && self.golden_lanes.is_none() {
            return Err(Error::usage(
                Place::item("conformance"),
                "there is nothing to compare",
                "give JRC tables, or --scenarios and --golden-lanes",
            ));
        }
        refuse_repeats(|| Place::item("FILE"), self.tables.iter().map(|path| (file_of(path), path.display())))?;
        let mut tallies = Vec::new();
        let jrc = Profile::load("jrc-2021")?;
        for path in &self.tables {
            let table = Table::read(path)?;
            tallies.extend(match table.kind()? {
                TableKind::JrcCases => compare_jrc(&table, &jrc)?,
                TableKind::Functions => compare_functions(&table, &jrc)?,
            });
        }
        let mut text = String::new();
        let mut compared = None;
        if let (Some(scenarios), Some(lanes)) = (&self.scenarios, &self.golden_lanes) {
            let mut seen = compare_lanes(&read_scenarios(scenarios)?, &Table::read(lanes)?, &Profile::load("paper")?)?;
            let _ = writeln!(
                text,
                "{} lanes of profile paper in f64 and f32: {} verdicts differ between the two; {} ties (rounding \
                 decides; equal once the gap moves by 1e-9 m); the end time differs in {} (information).",
                count(seen.lanes),
                count_of(seen.f32_different.len()),
                count_of(seen.ties.len()),
                count(seen.end_differs)
            );
            for lane in seen.ties.iter().map(|l| format!("  tie: {l}\n")) {
                text += &lane;
            }
            for lane in seen.f32_different.iter().map(|l| format!("  f32 differs: {l}\n")) {
                text += &lane;
            }
            tallies.append(&mut seen.tallies);
            compared = Some(seen);
        }
        self.format.print(|| render(&tallies) + &text, || document(&tallies, compared.as_ref()))?;
        let failed: Vec<&Tally> = tallies.iter().filter(|t| !t.passes()).collect();
        if failed.is_empty() {
            return Ok(Exit::Ok);
        }
        let complaints = failed.iter().flat_map(|t| &t.complaints).take(20);
        let list: String = complaints.map(|c| format!("\n  {c}")).collect();
        Err(Error::Verification(format!("{} of {} groups do not agree:{list}", failed.len(), tallies.len())))
    }
}

/// The content of [`render`] as JSON.
fn document(tallies: &[Tally], compared: Option<&LaneComparison>) -> Result<String> {
    let groups = tallies.iter().map(|t| {
        let deviations = t.deviations.iter().map(|d| {
            serde_json::json!({
                "quantity": d.quantity, "compared": d.compared, "largest": d.largest, "place": d.place,
            })
        });
        serde_json::json!({
            "what": t.label,
            "model": t.model.map(|m| m.name()),
            "rows": t.rows,
            "robust": t.robust,
            "reacted": t.reacted,
            "collided": t.collided,
            "labels_equal": t.labels_equal,
            "types_equal": t.types_equal,
            "fragile_different": t.fragile_different,
            "passes": t.passes(),
            "deviations": deviations.collect::<Vec<_>>(),
            "complaints": t.complaints,
        })
    });
    let lanes = compared.map(|c| {
        serde_json::json!({
            "lanes": c.lanes, "f32_different": c.f32_different, "ties": c.ties, "end_differs": c.end_differs,
        })
    });
    records::document(&serde_json::json!({
        "passes": tallies.iter().all(Tally::passes),
        "groups": groups.collect::<Vec<_>>(),
        "lanes": lanes,
    }))
}

fn render(tallies: &[Tally]) -> String {
    // Without number types, so that every column is aligned left.
    let table = SummaryTable::of(tallies)
        .column("what", |t| t.label.as_str())
        .column("model", |t| t.model.map_or("-", ModelId::name))
        .column("rows", |t| count(t.rows))
        .column("robust", |t| count(t.robust))
        .column("reacted", |t| count(t.reacted))
        .column("collided", |t| count(t.collided))
        .column("labels", |t| format!("{}/{}", count(t.labels_equal), count(t.rows)))
        .column("types", |t| format!("{}/{}", count(t.types_equal), count(t.robust)))
        .column("fragile", |t| count(t.fragile_different))
        .column("ok", |t| if t.passes() { "yes" } else { "NO" })
        .build();
    let mut text = format!("{}\nLargest deviations on robust rows:\n", table.text());
    let mut largest: Vec<(&str, u64, f64, &str)> = Vec::new();
    for deviation in tallies.iter().flat_map(|t| &t.deviations) {
        match largest.iter_mut().find(|l| l.0 == deviation.quantity) {
            Some(entry) => {
                entry.1 += deviation.compared;
                if deviation.largest > entry.2 {
                    (entry.2, entry.3) = (deviation.largest, &deviation.place);
                }
            }
            None => largest.push((deviation.quantity, deviation.compared, deviation.largest, &deviation.place)),
        }
    }
    for (quantity, compared, value, place) in largest {
        let at = if value > 0.0 { format!("  at {place}") } else { String::new() };
        let _ = writeln!(text, "  {quantity:<28} {:>7} values  {value:.2e}{at}", count(compared));
    }
    text += "labels: equal collision labels (verdicts, for lanes); fragile: rows in which rounding decides and that \
             differ (information).\n";
    text
}
