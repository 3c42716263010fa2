//! `--xosc` of `simulate`: lanes as OpenSCENARIO files for other simulators.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::case_flags::time_s;
use lanesweep_engine::LaneKey;
use lanesweep_model::scenario::{Scenario, Side};
use lanesweep_report::openscenario::{Concrete, EgoMotion, INDEX, PlayOptions, concrete_lanes, export_folder};
use lanesweep_run::reopen::Reopened;
use lanesweep_support::readable::counted;
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::{Error, Place, Result, option};

/// OpenSCENARIO files of the lanes.
#[derive(Debug, Args)]
pub(super) struct XoscFlags {
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
}

fn ego_motion() -> impl TypedValueParser<Value = EgoMotion> {
    let of = |word: String| if word == "external" { EgoMotion::External } else { EgoMotion::Model };
    PossibleValuesParser::new(["model", "external"]).map(of)
}

fn side() -> impl TypedValueParser<Value = Side> {
    PossibleValuesParser::new(["left", "right"]).map(|word| if word == "right" { Side::Right } else { Side::Left })
}

impl XoscFlags {
    /// The options of the files, if they are asked for; checks their folder.
    pub(super) fn options(&self, lane_width_m: Option<f64>) -> Result<Option<PlayOptions>> {
        let Some(dir) = &self.xosc else { return Ok(None) };
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
    pub(super) fn write(&self, played: &[Concrete]) -> Result<()> {
        let Some(dir) = &self.xosc else { return Ok(()) };
        export_folder(dir, played)?;
        tracing::info!("{} written to {}; index.csv lists them", counted(played.len(), "scenario"), dir.display());
        Ok(())
    }
}

/// The scenarios of lanes; `mined` have sizes, side and lane width.
pub(super) fn played(
    reopened: &Reopened,
    keys: &[LaneKey],
    mined: &[Scenario],
    options: &PlayOptions,
) -> Result<Vec<Concrete>> {
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
