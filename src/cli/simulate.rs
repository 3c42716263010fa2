//! `lanesweep simulate`: runs one concrete case step by step, for checking by hand, and writes lanes as OpenSCENARIO files for
//! other simulators.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::case_flags::{GivenCase, from_table, from_toml, time_s};
use super::configured::Configured;
use super::console;
use super::format::FormatFlag;
use super::source::{PlausibilityFlag, check_ending, scenarios_of};
use super::{Exit, Output};
use lanesweep_engine::LaneKey;
use lanesweep_model::scenario::{Scenario, Side};
use lanesweep_report::openscenario::{
    Concrete, EgoMotion, INDEX, PlayOptions, concrete_case, concrete_lanes, export_folder,
};
use lanesweep_report::trace::TraceReport;
use lanesweep_run::reopen::{Reopened, TracedLanes};
use lanesweep_support::atomic_file::folder_of;
use lanesweep_support::files::{file_name, write_atomically};
use lanesweep_support::readable::counted;
use lanesweep_support::run_folder::{RunFolder, is_listed};
use lanesweep_support::{Error, Place, Result, option};

/// Run one concrete scenario and print or draw its time series
///
/// The case comes from flags, from a TOML file, from a row of a table (keys and columns are the flags' names with `_`,
/// speeds with their unit, `ego_speed_kmh`; flags override them), or from a finished run or a scenario file with a lane key. The series goes to stdout as CSV,
/// the outcome to stderr, the figure to --plot, OpenSCENARIO files to --xosc. Several models (--models FSM,RSS), variants
/// (--compare) or lanes follow one another in the CSV and share one figure.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep simulate --category lvd --ego-speed 30m/s --gap 30 --acceleration -6\n  \
                  lanesweep simulate --from lanesweep-out --lane 01_cut_in_97_91_957/2/1.2s/RSS --compare S\n  \
                  lanesweep simulate --scenarios scenarios.jsonl --lane 01_cut_in_97_91_957/S/1.2s/RSS --xosc played")]
pub(super) struct Simulate {
    #[command(flatten)]
    case: GivenCase,
    /// TOML file with the case
    #[arg(long, value_name = "FILE", conflicts_with = "table", help_heading = "Data")]
    case_file: Option<PathBuf>,
    /// Table (.csv, .parquet) with one case per row
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    table: Option<PathBuf>,
    /// Row of the table, from 1 after the header; needed if it has several
    #[arg(long, value_name = "N", requires = "table", help_heading = "Data")]
    row: Option<usize>,
    /// Scenario file (.jsonl, .parquet, .csv) for --lane
    ///
    /// With --from a study and --xosc: the study's scenarios, for sizes, side and lane width.
    #[arg(long, value_name = "FILE", requires = "lane", conflicts_with_all = ["case_file", "table"], help_heading = "Data")]
    scenarios: Option<PathBuf>,
    /// Folder (--out) of a study or sample, for --lane
    ///
    /// Repeats that lane with the run's profile and options, bit for bit, and reports whether f64 gives another
    /// outcome.
    #[arg(long, value_name = "DIR", requires = "lane", conflicts_with_all = ["case_file", "table", "profile", "dt"], help_heading = "Data")]
    from: Option<PathBuf>,
    /// Lane key: scenario/variant/headway/model; repeatable
    #[arg(long, value_name = "KEY", help_heading = "Data")]
    lane: Vec<String>,
    /// Also simulate other variants of the lane's scenario
    ///
    /// S (the recorded scenario; the default without a value), keys of parameterizations, or all.
    #[arg(long, value_name = "VARIANTS", requires = "lane", value_delimiter = ',', num_args = 0..=1, default_missing_value = "S", help_heading = "Scenario")]
    compare: Vec<String>,
    /// Also draw the time series
    ///
    /// Speed, acceleration, gap, TTC, BTN, PFS, CFS and lateral position, with reaction, braking and contact. `rsvg-convert`
    /// makes PNG and PDF of it.
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    plot: Option<PathBuf>,
    /// End of the figure's time axis [default: 2 s after the last decisive event]
    #[arg(long, value_name = "s", requires = "plot", value_parser = time_s, help_heading = "Output")]
    plot_end: Option<f64>,
    /// Also write ASAM OpenSCENARIO XML 1.2 with OpenDRIVE roads
    ///
    /// Every lane becomes NNN-KEY.xosc and NNN-KEY.xodr in this folder; index.csv lists them with their outcomes. The
    /// other vehicles follow their own motion, step by step.
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    xosc: Option<PathBuf>,
    /// Driver of the ego in --xosc
    ///
    /// model: the ego follows the path that the driver model drove. external: your own controller drives the ego; only its
    /// position and speed at the start are written.
    #[arg(long, value_parser = ego_motion(), default_value = "model", requires = "xosc", help_heading = "Output")]
    ego: EgoMotion,
    /// End of the scenario with --ego external [default: 10 s after the lane's last event and end]
    #[arg(long, value_name = "s", requires = "xosc", value_parser = time_s, help_heading = "Output")]
    duration: Option<f64>,
    /// Side in --xosc that the other vehicle comes from or leaves to [default: the scenario's, else left]
    #[arg(long, value_parser = side(), requires = "xosc", help_heading = "Output")]
    side: Option<Side>,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
    #[command(flatten)]
    format: FormatFlag,
}

fn ego_motion() -> impl TypedValueParser<Value = EgoMotion> {
    let of = |word: String| if word == "external" { EgoMotion::External } else { EgoMotion::Model };
    PossibleValuesParser::new(["model", "external"]).map(of)
}

fn side() -> impl TypedValueParser<Value = Side> {
    PossibleValuesParser::new(["left", "right"]).map(|word| if word == "right" { Side::Right } else { Side::Left })
}

impl Simulate {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        self.guard_plot()?;
        let options = self.xosc_options()?;
        let (lanes, played, incomplete) = self.lanes(configured, options.as_ref())?;
        let report = TraceReport(&lanes);
        if let Some(path) = &self.plot {
            // Write the figure before the table: a closed stdout must not prevent it.
            write_atomically(path, report.figure(self.plot_end).svg().as_bytes())?;
        }
        self.write_xosc(&played)?;
        let exit = if incomplete { Exit::Incomplete } else { Exit::Ok };
        let output = self.format.output(exit, || report.csv(), || report.json())?;
        if configured.level != tracing::Level::ERROR {
            console::say(&report.text());
        }
        Ok(output.with_tables(|| report.tables()))
    }

    /// The lanes, their OpenSCENARIO scenarios, and whether others of the file were skipped.
    fn lanes(
        &self,
        configured: &Configured,
        options: Option<&PlayOptions>,
    ) -> Result<(TracedLanes, Vec<Concrete>, bool)> {
        let wrong = |flag, problem: String, help: String| Err(Error::usage(Place::option(flag), problem, help));
        let [lane, scenarios, from] = ["lane", "scenarios", "from"].map(option);
        let [key, ..] = &self.lane[..] else {
            let profile = configured.profile()?;
            let traced = self.flags()?.traced(&profile, self.plausibility.policy())?;
            let played = options.map(|options| concrete_case(&traced, &profile, options)).transpose()?;
            return Ok((traced.into_lanes(&profile), played.unwrap_or_default(), false));
        };
        // The road of --xosc may have lanes of another width.
        if self.case.gives_more_than(if options.is_some() { &["lane_width"] } else { &[] }) {
            let help = format!("leave out the case's options, or {lane} with its {scenarios} or {from}");
            return wrong("lane", "the lane is a complete case: the others would be ignored".to_owned(), help);
        }
        let (mut mined, incomplete) = match &self.scenarios {
            Some(_) if self.from.is_some() && options.is_none() => {
                let help = format!("leave one out, or add {}", option("xosc"));
                return wrong("scenarios", format!("the run ({from}) has the scenario"), help);
            }
            Some(path) => scenarios_of(path, self.plausibility.policy())?,
            None => Default::default(),
        };
        let reopened = match (&self.from, &self.scenarios) {
            (Some(dir), scenarios) => {
                configured.refuse_lane_keys(false, &format!("is decided by the run ({from})"), "leave it out")?;
                let reopened = Reopened::run(dir, key)?;
                if scenarios.is_some() && reopened.as_study().is_none() {
                    let problem = "sampled lanes have the mean sizes of their density".to_owned();
                    return wrong("scenarios", problem, "leave it out".to_owned());
                }
                reopened
            }
            (None, Some(path)) => {
                let data = format!("scenarios of {}", file_name(path));
                Reopened::scenarios(&mut mined, &self.lane, &configured.profile()?, data)?
            }
            (None, None) => {
                let help = format!("add {from} for a lane of a study or a sampling run, or {scenarios}");
                return wrong("lane", "a key alone does not identify a lane".to_owned(), help);
            }
        };
        let keys = reopened.named(&self.lane, self.case.named_models()?.as_deref(), &self.compare)?;
        let played = options.map(|options| played(&reopened, &keys, &mined, options)).transpose()?;
        Ok((reopened.traced(&keys)?, played.unwrap_or_default(), incomplete))
    }

    fn flags(&self) -> Result<GivenCase> {
        let file = match (&self.case_file, &self.table) {
            (Some(path), _) => from_toml(path)?,
            (None, Some(path)) => from_table(path, self.row)?,
            (None, None) => GivenCase::default(),
        };
        let given = self.case.over(file);
        if given.is_empty() {
            let [category, speed, file, table, lane, from, scenarios] =
                ["category", "ego_speed", "case_file", "table", "lane", "from", "scenarios"].map(option);
            let help = format!(
                "give a case ({category}, {speed}, …), {file}, {table}, or a {lane} with {from} or {scenarios}"
            );
            return Err(Error::usage(Place::item("lanesweep simulate"), "there is nothing to simulate", help));
        }
        Ok(given)
    }

    /// The options of the files, if they are asked for; checks their folder.
    fn xosc_options(&self) -> Result<Option<PlayOptions>> {
        let (Some(dir), lane_width_m) = (&self.xosc, self.case.lane_width_m()) else { return Ok(None) };
        let refused = |flag, problem: String, help: &str| Err(Error::usage(Place::option(flag), problem, help));
        if self.duration.is_some() && self.ego == EgoMotion::Model {
            let problem = "the ego follows the driver model, and its path ends with the lane".to_owned();
            return refused("duration", problem, &format!("add {}, or leave it out", option("ego = external")));
        }
        if let Some(duration) = self.duration.filter(|d| !(*d > 0.0 && *d <= 3600.0)) {
            let problem = format!("{duration} s is out of range");
            return refused("duration", problem, "give seconds above 0 and at most 3600");
        }
        if let Some(width) = lane_width_m.filter(|w| !(1.0..=20.0).contains(w)) {
            let problem = format!("{width} m is not a lane width");
            return refused("lane_width", problem, "give 1 to 20 m, such as 3.5");
        }
        drop(RunFolder::open(dir, INDEX)?);
        Ok(Some(PlayOptions { ego: self.ego, duration_s: self.duration, side: self.side, lane_width_m }))
    }

    /// Writes the files, if they are asked for.
    fn write_xosc(&self, played: &[Concrete]) -> Result<()> {
        let Some(dir) = &self.xosc else { return Ok(()) };
        export_folder(dir, played)?;
        tracing::info!("{} written to {}; index.csv lists them", counted(played.len(), "scenario"), dir.display());
        Ok(())
    }

    /// Checks that the figure is an SVG file and replaces no result.
    fn guard_plot(&self) -> Result<()> {
        let Some(plot) = &self.plot else { return Ok(()) };
        if let Some(until) = self.plot_end.filter(|until| !(*until > 0.0 && *until < 1e9)) {
            let problem = format!("{until} s is out of range for a time axis");
            return Err(Error::usage(Place::option("plot_end"), problem, "give seconds above 0 and below 10^9"));
        }
        let is_of_run = |dir: &Path| folder_of(plot) == dir && is_listed(dir, &file_name(plot));
        if self.from.as_deref().is_some_and(is_of_run) {
            let problem = format!("{} is a result of the run", plot.display());
            return Err(Error::usage(Place::option("plot"), problem, "choose another name"));
        }
        check_ending(plot, "svg", "plot")
    }
}

/// The scenarios of lanes; `mined` have sizes, side and lane width.
fn played(reopened: &Reopened, keys: &[LaneKey], mined: &[Scenario], options: &PlayOptions) -> Result<Vec<Concrete>> {
    let (scenarios, are_lengths_known) = concrete_lanes(reopened, keys, mined, options)?;
    if !are_lengths_known {
        tracing::warn!(
            "a study's plan has only the sum of two lengths: the ego gets the profile's length, the others the \
             remainder; gaps and contacts do not change ({} has the lengths)",
            option("scenarios = FILE")
        );
    }
    Ok(scenarios)
}
