//! `lanesweep export`: scenarios for other programs.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::arguments::{Arguments, FromArguments, choices, from_arguments};
use super::case_flags::{CaseFlags, from_toml, time_s};
use super::configured::Configured;
use super::format::FormatFlag;
use super::source::{PlausibilityFlag, scenarios_of};
use super::{Exit, Output};
use crate::report::openscenario::{Concrete, EgoMotion, PlayOptions, concrete_case, concrete_lanes, export_folder};
use crate::report::records::document;
use crate::run::reopen::Reopened;
use crate::scenario::Side;
use crate::support::files::check_folder;
use crate::support::readable::counted;
use crate::{Error, Place, Result};

/// Write scenarios for other simulators
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
                  lanesweep export xosc --category cut-in --models FSM --ego-speed 30m/s --speed 20m/s --thw 1.2 \\\n      \
                  --lateral-speed 1.0 --out played")]
pub(super) struct Export {
    #[command(subcommand)]
    format: Format,
}

#[derive(Debug, Subcommand)]
enum Format {
    Xosc(Box<Xosc>),
}

impl Export {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let Format::Xosc(xosc) = &self.format;
        xosc.run(configured)
    }
}

/// Write lanes as ASAM OpenSCENARIO XML 1.2 with an OpenDRIVE road
///
/// Exports named lanes of a study, a sampling run or a scenario file, or one case from flags.
/// Every lane becomes NNN-KEY.xosc and NNN-KEY.xodr; index.csv lists them with their outcomes. The other vehicles
/// follow their own motion, step by step. The ego follows the path that the driver model drove; with --ego external
/// only its position and speed at the start are written.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:\n  \
                  lanesweep export xosc --from lanesweep-out --lane 01_cut_in_97_91_957/2/1.2s/RSS --ego external\n  \
                  lanesweep export xosc --scenarios scenarios.jsonl --lane 01_cut_in_97_91_957/S/1.2s/RSS\n  \
                  lanesweep export xosc --category cut-in --models FSM --ego-speed 30m/s --speed 20m/s --thw 1.2 \\\n      \
                  --lateral-speed 1.0 --out played")]
struct Xosc {
    #[command(flatten)]
    case: CaseFlags,
    #[command(flatten)]
    format: FormatFlag,
    /// TOML file with the case
    #[arg(long, value_name = "FILE", conflicts_with_all = ["from", "scenarios"], help_heading = "Data")]
    case_file: Option<PathBuf>,
    /// Folder (--out) of a study or sample, for --lane
    #[arg(long, value_name = "DIR", conflicts_with_all = ["profile", "dt"], help_heading = "Data")]
    from: Option<PathBuf>,
    /// Scenario file for --lane
    ///
    /// With --from a study: the study's scenarios, for sizes, side and lane width.
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    scenarios: Option<PathBuf>,
    /// Lane key: scenario/variant/headway/model; repeatable
    #[arg(long, value_name = "KEY", help_heading = "Data")]
    lane: Vec<String>,
    /// Driver of the ego
    #[arg(long, value_enum, default_value_t, help_heading = "Scenario")]
    ego: EgoFlag,
    /// End of the scenario with --ego external [default: 10 s after the lane's last event and end]
    #[arg(long, value_name = "s", value_parser = time_s, help_heading = "Scenario", hide_short_help = true)]
    duration: Option<f64>,
    /// Side that the other vehicle comes from or leaves to [default: the scenario's, else left]
    #[arg(long, value_enum, help_heading = "Scenario", hide_short_help = true)]
    side: Option<SideFlag>,
    /// Folder of the files
    #[arg(long, value_name = "DIR", default_value = "lanesweep-xosc", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
}

from_arguments!(
    Xosc { case_file, from, scenarios, lane, ego, side, out }
    parsed { duration: time_s }
    groups { case, format, plausibility }
);
choices!(EgoFlag, SideFlag);

impl FromArguments for Export {
    fn from_arguments(arguments: &mut Arguments) -> Result<Export> {
        Ok(Export { format: Format::Xosc(Box::new(Xosc::from_arguments(arguments)?)) })
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum EgoFlag {
    /// The ego follows the path that the driver model drove
    #[default]
    Model,
    /// Your own controller drives the ego: only its position and speed at the start are written
    External,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SideFlag {
    Left,
    Right,
}

impl Xosc {
    fn run(&self, configured: &Configured) -> Result<Output> {
        let options = self.play_options()?;
        check_folder(&self.out)?;
        let (scenarios, incomplete) = self.scenarios(configured, &options)?;
        let rows = export_folder(&self.out, &scenarios)?;
        let lines: String = rows.iter().map(|row| format!("{}  {}\n", row.file, row.lane)).collect();
        let list = || {
            let rows = rows.iter().map(|row| serde_json::json!({"file": row.file, "lane": row.lane}));
            document(&rows.collect::<Vec<_>>())
        };
        let exit = if incomplete { Exit::Incomplete } else { Exit::Ok };
        let output = self.format.output(exit, || lines, list)?;
        tracing::info!("{} written to {}", counted(rows.len(), "scenario"), self.out.display());
        Ok(output)
    }

    /// The scenarios, and whether others of the file were skipped.
    fn scenarios(&self, configured: &Configured, options: &PlayOptions) -> Result<(Vec<Concrete>, bool)> {
        let wrong = |flag: &str, problem: &str, help: &str| Err(Error::usage(Place::item(flag), problem, help));
        let is_lane = self.from.is_some() || self.scenarios.is_some();
        if is_lane && self.case.says_more_than_lanes() {
            let help = "leave out the case's flags, or --from and --scenarios";
            return wrong("--lane", "a lane is a complete case: the other flags would be ignored", help);
        }
        let models = self.case.named_models()?;
        let (implausible, models) = (self.plausibility.policy(), models.as_deref());
        let read = |path: &PathBuf| scenarios_of(path, implausible);
        let (reopened, keys, mined, incomplete) = match (&self.from, &self.scenarios) {
            (Some(_), _) if self.lane.is_empty() => return wrong("--from", "a run has many lanes", "add --lane KEY"),
            (Some(dir), scenarios) => {
                configured.refuse_assigned("is decided by the run (--from)", "leave it out")?;
                let reopened = Reopened::run(dir, self.lane.first().map_or("", String::as_str))?;
                self.refuse_for(&reopened)?;
                let (mined, incomplete) = scenarios.as_ref().map(read).transpose()?.unwrap_or_default();
                let keys = reopened.named(&self.lane, models)?;
                (reopened, keys, mined, incomplete)
            }
            (None, Some(path)) if self.lane.is_empty() => {
                let problem = format!("{} has many lanes", path.display());
                return wrong("--scenarios", &problem, "add --lane SCENARIO/VARIANT/HEADWAY/MODEL");
            }
            (None, Some(path)) => {
                let profile = configured.profile()?;
                let (mut mined, incomplete) = read(path)?;
                let data = format!("scenarios of {}", path.file_name().unwrap_or_default().to_string_lossy());
                let reopened = Reopened::scenarios(&mut mined, &self.lane, &profile, data)?;
                let keys = reopened.named(&self.lane, models)?;
                (reopened, keys, mined, incomplete)
            }
            (None, None) if !self.lane.is_empty() => {
                let help = "add --from DIR for a lane of a study or a sampling run, or --scenarios FILE";
                return wrong("--lane", "a key alone does not identify a lane", help);
            }
            (None, None) => {
                let file = self.case_file.as_deref().map(from_toml).transpose()?.unwrap_or_default();
                let profile = configured.profile()?;
                let traced = self.case.over(file).traced(&profile, implausible)?;
                return Ok((concrete_case(&traced, &profile, options)?, false));
            }
        };
        let (scenarios, are_lengths_known) = concrete_lanes(&reopened, &keys, &mined, options)?;
        if !are_lengths_known {
            tracing::warn!(
                "a study's plan has only the sum of two lengths: the ego gets the profile's length, the others the \
                 remainder; gaps and contacts do not change (--scenarios FILE has the lengths)"
            );
        }
        Ok((scenarios, incomplete))
    }

    /// Refuses a flag that only applies to a study.
    fn refuse_for(&self, reopened: &Reopened) -> Result<()> {
        if reopened.as_study().is_some() || self.scenarios.is_none() {
            return Ok(());
        }
        let problem = "sampled lanes have the mean sizes of their density";
        Err(Error::usage(Place::item("--scenarios"), problem, "leave it out"))
    }

    fn play_options(&self) -> Result<PlayOptions> {
        let ego = match self.ego {
            EgoFlag::Model => EgoMotion::Model,
            EgoFlag::External => EgoMotion::External,
        };
        if self.duration.is_some() && ego == EgoMotion::Model {
            let problem = "the ego follows the driver model, and its path ends with the lane";
            return Err(Error::usage(
                Place::item("--duration"),
                problem,
                "add --ego external, or leave out --duration",
            ));
        }
        if let Some(duration) = self.duration.filter(|d| !(*d > 0.0 && *d <= 3600.0)) {
            let problem = format!("{duration} s is out of range");
            return Err(Error::usage(Place::item("--duration"), problem, "give seconds above 0 and at most 3600"));
        }
        if let Some(width) = self.case.lane_width_m().filter(|w| !(1.0..=20.0).contains(w)) {
            let problem = format!("{width} m is not a lane width");
            return Err(Error::usage(Place::item("--lane-width"), problem, "give 1 to 20 m, such as 3.5"));
        }
        let side = self.side.map(|side| match side {
            SideFlag::Left => Side::Left,
            SideFlag::Right => Side::Right,
        });
        Ok(PlayOptions { ego, duration_s: self.duration, side, lane_width_m: self.case.lane_width_m() })
    }
}
