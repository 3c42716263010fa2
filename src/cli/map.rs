//! `lanesweep map`: maps the outcome over two parameters of a category, per model and panel of other parameters.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::configured::Configured;
use super::format::FormatFlag;
use super::settings::MapSettings;
use super::source::PlausibilityFlag;
use super::{COMMIT, Exit, Output, lists};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::plausibility::Doubts;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Category;
use lanesweep_report::host::{Host, SweepRecord};
use lanesweep_report::map::MapReport;
use lanesweep_run::grid::{self, Grid, GridText, MapGrids, MapOptions, MapResult, PARAMETERS, presets::Presets};
use lanesweep_support::readable::{count, value};
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::{Error, Place, Result};

/// Seed of the random selection of device lanes that the CPU recomputes.
const RECHECK_SEED: u64 = 1;

/// Map outcomes over two parameters
///
/// Every cell is one concrete case. --preset takes the grids of the JRC's evidence (jrc) or of the regulation's Annex 3
/// (r157, to 60 and to 130 km/h); --x, --y, --panel and --set define any other grid. Writes a sheet per grid and model
/// (SVG), cells.csv and map.json. The percentages of cells with a failure go to stdout.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, after_long_help = after_long_help())]
pub(super) struct Map {
    /// Kind of scenario: cut-in, cut-out, lvd
    #[arg(value_name = "CATEGORY", help_heading = "Scenario")]
    category: String,
    /// Predefined grids with their models: jrc, r157
    #[arg(long, value_name = "NAME", conflicts_with_all = ["x", "y", "panel", "set"], help_heading = "Scenario")]
    preset: Option<String>,
    /// Parameter of the x axis: NAME=FROM..TO/STEP or NAME=A,B,C
    #[arg(long, value_name = "NAME=RANGE", help_heading = "Scenario")]
    x: Option<String>,
    /// Parameter of the y axis
    #[arg(long, value_name = "NAME=RANGE", help_heading = "Scenario")]
    y: Option<String>,
    /// Parameter of the panels; repeatable
    ///
    /// Several of them give one panel per combination.
    #[arg(long, value_name = "NAME=RANGE", help_heading = "Scenario")]
    panel: Vec<String>,
    /// Constant parameter; repeatable
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Scenario")]
    set: Vec<String>,
    #[command(flatten)]
    models: lists::ModelsFlag,
    /// Criterion to evaluate
    #[arg(long, value_name = "collision|ttc|btn", default_value = "collision", help_heading = "Models and criteria")]
    criterion: String,
    /// Mark cells whose outcome changes with a tenth of the time step, 1 cm or 0.1 km/h
    ///
    /// They are undecided. Each cell is simulated eight times; sheets show undecided cells in their own colour.
    #[arg(long, help_heading = "Models and criteria")]
    robust: bool,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
    #[command(flatten)]
    format: FormatFlag,
    /// Folder of the results
    #[arg(long, value_name = "DIR", default_value = "lanesweep-map", help_heading = "Output")]
    out: PathBuf,
}

const EXAMPLES: &str = "Examples (--help has the parameters and more):\n  \
                        lanesweep map cut-in --preset jrc --out maps\n  \
                        lanesweep map lvd --x deceleration_mps2=1..9/0.25 --y ego_speed_kmh=30..130/5 --set thw_s=1.2";

const MORE_EXAMPLES: &str = "Examples:\n  \
                             lanesweep map cut-in --preset jrc --out maps\n  \
                             lanesweep map cut-in --x gap_m=1..60/1 --y lateral_speed_mps=0.1..1.8/0.1 \\\n      \
                             --panel ego_speed_kmh=60,90,120 --panel other_speed_kmh=30,50 \\\n      \
                             --models FSM,RSS\n  \
                             lanesweep map lvd --x deceleration_mps2=1..9/0.25 --y ego_speed_kmh=30..130/5 --set thw_s=1.2";

fn after_long_help() -> String {
    let names: Vec<&str> = PARAMETERS.iter().map(|p| p.key).collect();
    format!(
        "Parameters: {}\nA relative speed is the other vehicle's minus the ego's: negative where they close in.\n\n{MORE_EXAMPLES}",
        names.join(", ")
    )
}

impl Map {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let category = Category::named(&self.category, Place::item("CATEGORY"))?;
        let (name, names) = (self.criterion.trim(), Criterion::ALL.map(Criterion::key));
        let unknown = || Error::unknown(Place::option("criterion"), "criterion", name, names, "");
        let criterion = Criterion::parse(name).ok_or_else(unknown)?;
        let profile = self.profile(configured)?;
        let options = MapOptions {
            grids: self.grids(category, &configured.settings.map, &profile)?,
            models: self.models.named()?,
            criterion,
            robust: self.robust,
        };
        let started = Instant::now();
        let map = grid::Map::plan(options, &profile)?;
        let plan_s = started.elapsed().as_secs_f64();
        let opened = configured.open_in(configured.settings.map.reference)?;
        let folder = RunFolder::open(&self.out, "map.json")?;
        let executor = opened.executor().with_recheck(RECHECK_SEED);
        let (units, started) = (map.unit_count(), Instant::now());
        let MapResult { grids, summary } =
            configured.with_progress(units, "sweeping", &executor, |executor| map.run(executor))?;
        let host = Host::of(COMMIT, &opened, summary.rechecked_lanes, started, configured.record(false));
        let sweep = SweepRecord::of(&summary, RECHECK_SEED);
        let preset = self.preset.clone();
        let report = MapReport { grids, criterion, profile, preset, host, sweep, plan_s };
        let written = report.write(folder.results()?)?;
        let output = self.format.output(Exit::Ok, || report.text(), || report.json(&written))?;
        let (simulations, seconds) = (count(report.simulations()), value(report.host.seconds));
        tracing::info!("{simulations} simulations in {seconds} s on {}", report.host.backend);
        tracing::info!("{} files written to {}", written.files.len() + 1, self.out.display());
        Ok(output.with_tables(|| written.tables))
    }

    /// The preset's profile, unless another is set.
    fn profile(&self, configured: &Configured) -> Result<Profile> {
        match self.preset.as_deref().and_then(Presets::find) {
            Some(preset) if !configured.is_set("run.profile") => configured.profile_of(preset.profile()),
            _ => configured.profile(),
        }
    }

    /// Builds the grids from flags and settings.
    fn grids(&self, category: Category, settings: &MapSettings, profile: &Profile) -> Result<MapGrids> {
        if let Some(name) = &self.preset {
            let names = Presets::ALL.map(Presets::name);
            let unknown = || Error::unknown(Place::option("preset"), "preset", name, names, "");
            return Ok(MapGrids::Preset(Presets::find(name).ok_or_else(unknown)?, category));
        }
        let (x, y, panel, set) = (self.x.clone(), self.y.clone(), self.panel.clone(), self.set.clone());
        let text = GridText { x, y, panel, set, native_gap: settings.native_gap, closing_only: settings.closing };
        let (grid, mut doubts) = (Grid::new(text.parts(category)?)?, Doubts::new(self.plausibility.policy()));
        grid.check_plausible(profile, &mut doubts)?;
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        Ok(MapGrids::Own(Box::new(grid)))
    }
}
