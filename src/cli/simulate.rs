//! `lanesweep simulate`: one concrete case, step by step, as an engineer checks it by hand.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Exit;
use super::case_flags::{CaseFlags, from_table, from_toml};
use super::configured::Configured;
use super::console::{self, Verbosity};
use super::format::FormatFlag;
use super::simulate_lanes::{Asked, Lanes, Traced, of_run, of_scenarios};
use super::source::{PlausibilityFlag, refuse_overwriting};
use crate::engine::{EndReason, LaneCase, NO_STEP, Outcome, Trace, check_time_step};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::report::records;
use crate::report::trace::{self, TraceFigure, TraceSeries};
use crate::scenario::Tables;
use crate::support::files::{make_folder, write_atomically};
use crate::support::readable::value;
use crate::support::run_dir::is_listed;
use crate::{Error, Place, Result};

/// Run one concrete scenario and print or draw its time series
///
/// The case comes from flags, from a TOML file, from a row of a table (the flags' names with `_` as keys or columns;
/// flags win), or from a finished run or a scenario file with a lane key. The series goes to stdout as CSV, the
/// outcome to stderr, the figure to --plot. Several models (--models FSM,RSS) or variants (--compare) follow one
/// another in the CSV and share the figure.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep simulate --category cut-in --ego-speed 30 --speed 20 --thw 1.2 --lateral-speed 1.0 \\\n      \
                  --plot case.svg\n  \
                  lanesweep simulate --from lanesweep-out --lane 01_cut_in_97_91_957/2/1.2s/RSS --compare S\n  \
                  lanesweep simulate --scenarios scenarios.jsonl --lane 01_cut_in_97_91_957/S/1.2s/RSS")]
pub struct Simulate {
    #[command(flatten)]
    case: CaseFlags,
    /// TOML file with the case
    #[arg(long, value_name = "FILE", conflicts_with = "table", help_heading = "Data")]
    case_file: Option<PathBuf>,
    /// Table (.csv, .parquet) with one case per row
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    table: Option<PathBuf>,
    /// Row of the table, from 1 after the header
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Data")]
    row: usize,
    /// Scenario file (.jsonl, .parquet, .csv) for --lane
    #[arg(long, value_name = "FILE", requires = "lane", help_heading = "Data")]
    scenarios: Option<PathBuf>,
    /// Folder (--out) of a study or sample, for --lane
    ///
    /// Repeats that lane with the run's profile and options, bit for bit, and says whether f64 gives another outcome.
    #[arg(long, value_name = "DIR", requires = "lane", conflicts_with_all = ["scenarios", "case_file", "table", "profile", "dt"], help_heading = "Data")]
    from: Option<PathBuf>,
    /// Lane key: scenario/variant/headway/model
    #[arg(long, value_name = "KEY", help_heading = "Data")]
    lane: Option<String>,
    /// Also other variants of the lane's scenario
    ///
    /// S (recorded; also without a value), keys of parameterizations, or all.
    #[arg(long, value_name = "VARIANTS", requires = "lane", value_delimiter = ',', num_args = 0..=1, default_missing_value = "S", help_heading = "Scenario")]
    compare: Vec<String>,
    /// Also draw the time series
    ///
    /// Speed, acceleration, gap, TTC, BTN, PFS, CFS and lateral position, with reaction, braking and contact.
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    plot: Option<PathBuf>,
    /// End of the figure's time axis [default: 2 s after the last change]
    #[arg(long, value_name = "s", requires = "plot", help_heading = "Output", hide_short_help = true)]
    plot_end: Option<f64>,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
    #[command(flatten)]
    format: FormatFlag,
}

impl Simulate {
    pub fn run(&self, configured: &Configured, verbosity: Verbosity) -> Result<Exit> {
        self.guard_plot()?;
        let lanes = self.lanes(configured)?;
        let named: Vec<(String, &Trace)> = lanes.traced.iter().map(|lane| (lane.key.clone(), &lane.trace)).collect();
        if let Some(path) = &self.plot {
            // Before the table: a reader of stdout that ends early must not cost the figure.
            if let Some(dir) = path.parent().filter(|dir| !dir.as_os_str().is_empty()) {
                make_folder(dir)?;
            }
            write_atomically(path, figure(&lanes, self.plot_end).svg().as_bytes())?;
        }
        self.format.print(|| trace::table(&named).csv(), || document(&lanes, &named))?;
        if verbosity != Verbosity::Quiet {
            lanes.traced.iter().for_each(|lane| console::say(&summary(lane, lanes.traced.len() > 1)));
        }
        Ok(if lanes.incomplete { Exit::Incomplete } else { Exit::Ok })
    }

    fn lanes(&self, configured: &Configured) -> Result<Lanes> {
        let Some(key) = &self.lane else { return self.lanes_of_flags(configured) };
        if self.case.says_a_case() {
            return Err(Error::usage(
                Place::item("--lane"),
                "the lane is a complete case: the other flags would be ignored",
                "leave out the case's flags, or --lane with its --scenarios or --from",
            ));
        }
        let asked = Asked { key, models: self.case.named_models()?, compare: &self.compare };
        match (&self.from, &self.scenarios) {
            (Some(dir), _) => of_run(dir, &asked),
            (None, Some(path)) => of_scenarios(path, &configured.profile()?, &asked, self.plausibility.policy()),
            (None, None) => {
                let help = "add --from DIR for a lane of a study or a sampling run, or --scenarios FILE";
                Err(Error::usage(Place::item("--lane"), "a key alone does not identify a lane", help))
            }
        }
    }

    /// One case from flags or files, in f64.
    fn lanes_of_flags(&self, configured: &Configured) -> Result<Lanes> {
        let profile = configured.profile()?;
        let flags = self.flags()?;
        let mut tables = Tables::default();
        let case = LaneCase::encode(&flags.case(&profile, self.plausibility.policy())?, &profile, &mut tables);
        profile.check_time_step(&flags.models()?)?;
        check_time_step(&case, &tables, profile.frame.dt_s, || Place::item("the case"))?;
        let (category, headway) = (flags.category()?, flags.headway()?);
        let traced = |model: ModelId| Traced {
            key: model.name().to_owned(),
            name: model.name().to_owned(),
            trace: Trace::record(&profile, category, &case, &tables, headway, model),
            reference: None,
        };
        let traced = flags.models()?.into_iter().map(traced).collect();
        let origin = format!("profile {}, f64, a case of flags", profile.name);
        Ok(Lanes { traced, origin, synthetic: false, incomplete: false })
    }

    fn flags(&self) -> Result<CaseFlags> {
        let file = match (&self.case_file, &self.table) {
            (Some(path), _) => from_toml(path)?,
            (None, Some(path)) => from_table(path, self.row)?,
            (None, None) => CaseFlags::default(),
        };
        let flags = self.case.over(file);
        if !flags.says_a_case() {
            let help = "give a case (--category, --ego-speed, …), --case-file, --table, or a --lane with --from or \
                        --scenarios";
            return Err(Error::usage(Place::item("lanesweep simulate"), "there is nothing to simulate", help));
        }
        Ok(flags)
    }

    /// The figure must be one and must replace no input.
    fn guard_plot(&self) -> Result<()> {
        let Some(plot) = &self.plot else { return Ok(()) };
        if let Some(until) = self.plot_end.filter(|until| !(*until > 0.0 && *until < 1e9)) {
            let problem = format!("{until} s is out of range for a time axis");
            return Err(Error::usage(Place::item("--plot-end"), problem, "give seconds above 0 and below 10^9"));
        }
        if plot.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg")) {
            let problem = format!("{} is not the name of an SVG file", plot.display());
            let help = "give a name that ends in .svg; `rsvg-convert` makes PNG and PDF of it";
            return Err(Error::usage(Place::item("--plot"), problem, help));
        }
        let inputs = [&self.case_file, &self.table, &self.scenarios];
        let inputs: Vec<PathBuf> = inputs.into_iter().flatten().cloned().collect();
        refuse_overwriting(plot, &inputs, "--plot")?;
        let is_of_run = |dir: &Path| {
            plot.parent().map(|p| if p.as_os_str().is_empty() { Path::new(".") } else { p }) == Some(dir)
                && plot.file_name().and_then(|name| name.to_str()).is_some_and(|name| is_listed(dir, name))
        };
        if self.from.as_deref().is_some_and(is_of_run) {
            let problem = format!("{} is a result of the run", plot.display());
            return Err(Error::usage(Place::item("--plot"), problem, "choose another name"));
        }
        Ok(())
    }
}

fn figure(lanes: &Lanes, until_s: Option<f64>) -> TraceFigure<'_> {
    let first = &lanes.traced[0];
    let category = first.trace.category.label();
    let title = match lanes.traced.len() {
        1 => format!("{category}: {}", first.key),
        _ => match first.key.rsplitn(4, '/').collect::<Vec<_>>()[..] {
            [_, headway, _, scenario] => format!("{category}: {scenario}, headway {headway}"),
            _ => format!("{category}, initial gap {} m", value(first.trace.initial_gap_m)),
        },
    };
    let synthetic = if lanes.synthetic && !lanes.origin.contains("SYNTHETIC") { "SYNTHETIC DATA; " } else { "" };
    let series = lanes.traced.iter().map(|lane| TraceSeries { name: lane.name.clone(), trace: &lane.trace }).collect();
    TraceFigure { title, subtitle: Some(format!("{synthetic}{}", lanes.origin)), series, until_s }
}

/// Outcomes and series as one document.
fn document(lanes: &Lanes, named: &[(String, &Trace)]) -> Result<String> {
    let outcomes = lanes.traced.iter().map(|lane| {
        let reference = lane.reference.as_ref().map(|reference| records::outcome(reference, lane.trace.dt_s));
        serde_json::json!({
            "lane": lane.key,
            "category": lane.trace.category.key(),
            "model": lane.trace.model.name(),
            "initial_gap_m": lane.trace.initial_gap_m,
            "outcome": records::outcome(&lane.trace.outcome, lane.trace.dt_s),
            "reference": reference,
        })
    });
    records::document(&serde_json::json!({
        "program": format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
        "data": lanes.origin,
        "synthetic": lanes.synthetic,
        "lanes": outcomes.collect::<Vec<_>>(),
        "steps": trace::table(named).records(),
    }))
}

/// How a lane ended, in words.
fn summary(lane: &Traced, is_one_of_many: bool) -> String {
    let Traced { key, trace, reference, .. } = lane;
    let time = |step: u32| match step {
        NO_STEP => "never".to_owned(),
        step => format!("{} s", value(trace.time_s(step))),
    };
    let outcome = &trace.outcome;
    let name = if is_one_of_many { format!("{key}: ") } else { String::new() };
    let mut text = format!(
        "{name}{} {}, initial gap {} m: {}\n  reacted: {}  end: {} ({})\n  min TTC {} s, max BTN {}, min gap {} m\n",
        trace.category.label(),
        trace.model.name(),
        value(trace.initial_gap_m),
        verdicts(outcome),
        time(outcome.reaction_step),
        time(outcome.end_step),
        end(outcome),
        value(outcome.min_ttc),
        value(outcome.max_btn),
        value(outcome.min_gap)
    );
    if let Some(reference) = reference {
        text.push_str(&match differences(outcome, reference, &time) {
            list if list.is_empty() => "  f64: the same verdicts, contact and times\n".to_owned(),
            list => format!("  f64 DIFFERS: {}\n", list.join("; ")),
        });
    }
    text
}

fn verdicts(outcome: &Outcome<f64>) -> String {
    let verdict = |c: Criterion| format!("{} {}", c.label(), if outcome.verdicts.failed(c) { "FAIL" } else { "pass" });
    Criterion::ALL.map(verdict).join(", ")
}

fn end(outcome: &Outcome<f64>) -> String {
    match outcome.end {
        EndReason::Contact => format!(
            "{}, closing at {} m/s, the ego at {} m/s",
            outcome.contact.label(),
            value(outcome.impact_closing_speed),
            value(outcome.impact_speed)
        ),
        EndReason::Settled => "no further event is possible".to_owned(),
        EndReason::Standstill => "the ego is stationary".to_owned(),
        EndReason::Cap => "time cap".to_owned(),
        EndReason::Aborted => "aborted at a large TTC (jrc-2021)".to_owned(),
    }
}

/// What of the reference is another than in the lane arithmetic; values differ in their last digits and are not looked at.
fn differences(ours: &Outcome<f64>, reference: &Outcome<f64>, time: &dyn Fn(u32) -> String) -> Vec<String> {
    let mut list = Vec::new();
    if ours.verdicts != reference.verdicts {
        list.push(verdicts(reference));
    }
    if ours.reaction_step != reference.reaction_step {
        list.push(format!("reacted: {}", time(reference.reaction_step)));
    }
    let how = |o: &Outcome<f64>| (o.end, o.end_step, o.contact, o.contact_with, o.contact_step);
    if how(ours) != how(reference) {
        list.push(format!("end: {} ({})", time(reference.end_step), end(reference)));
    }
    list
}
