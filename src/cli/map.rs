//! `lanesweep map`: the outcome over two parameters of a category, per panel of others and model.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::configured::Configured;
use super::console::{self, Verbosity};
use super::dry_run::{BUDGET, DryRun, ForecastPart};
use super::format::FormatFlag;
use super::source::PlausibilityFlag;
use super::{Exit, lists};
use crate::engine::{Backend, CpuBackend, Executor, Forecast, Verdicts, Wanted, forecast};
use crate::interop::openscenario::{Names, Rename, read_distribution, variations};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::map::{MapHost, MapReport};
use crate::report::run_record::SweepRecord;
use crate::run::grid::{
    self, Against, CaseStyle, Grid, GridAxis, GridParts, GridPlan, MAX_PANELS, MapGrids, MapOptions, MapParameter,
    MapResult, PARAMETERS, presets::Presets,
};
use crate::scenario::Category;
use crate::support::plausibility::Doubts;
use crate::support::readable::{count, value};
use crate::support::run_dir::{MAP_RECORD, OutputDir};
use crate::{Error, Place, Result};

/// Seed of the choice of lanes of a device that the CPU computes again.
const RECHECK_SEED: u64 = 1;

/// Memory of the sheets that are being drawn, bytes: those of the presets, measured.
const BYTES_OF_SHEETS: u64 = 3 << 20;

/// Map outcomes over two parameters, and where two models or profiles differ
///
/// Every cell is one concrete case. --preset takes the grids of the JRC's evidence (jrc) or of the regulation's Annex 3
/// (r157, to 60 and to 130 km/h); --x, --y, --panel and --set make any other. Writes a sheet per grid and model (SVG), cells.csv, differences.csv and map.json; the shares go to
/// stdout.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, after_long_help = after_long_help())]
pub struct Map {
    /// Kind of scenario: cut-in, cut-out, lvd
    #[arg(value_name = "CATEGORY", help_heading = "Scenario")]
    category: String,
    /// Predefined grids with their models: jrc, r157
    #[arg(long, value_name = "NAME", conflicts_with_all = ["x", "y", "panel", "set", "closing", "native_gap"], help_heading = "Scenario")]
    preset: Option<String>,
    /// OpenSCENARIO file with deterministic distributions
    ///
    /// The first two parameters with several values are the axes, unless --x and --y name others; the others define
    /// the panels.
    #[arg(long, value_name = "FILE", conflicts_with = "preset", help_heading = "Data")]
    distribution: Option<PathBuf>,
    /// With --distribution: parameter of the file = our parameter, times a factor; repeatable
    #[arg(long, value_name = "THEIRS=OURS[*FACTOR]", requires = "distribution", help_heading = "Scenario")]
    rename: Vec<Rename>,
    /// Parameter of the x axis: NAME=FROM..TO/STEP or NAME=A,B,C
    ///
    /// With --distribution also a NAME of the file.
    #[arg(long, value_name = "NAME=RANGE", help_heading = "Scenario")]
    x: Option<String>,
    /// Parameter of the y axis
    #[arg(long, value_name = "NAME=RANGE", help_heading = "Scenario")]
    y: Option<String>,
    /// Parameter of the panels; repeatable
    ///
    /// Several make a panel of every combination.
    #[arg(long, value_name = "NAME=RANGE", help_heading = "Scenario")]
    panel: Vec<String>,
    /// Value that is the same in every cell; repeatable
    #[arg(long, value_name = "NAME=VALUE", help_heading = "Scenario")]
    set: Vec<String>,
    /// Only panels in which the ego is faster than the other vehicle
    #[arg(long, help_heading = "Scenario", hide_short_help = true)]
    closing: bool,
    /// Start each model at its following distance in the JRC's simulator, not gap_m or thw_s
    #[arg(long, help_heading = "Scenario", hide_short_help = true)]
    native_gap: bool,
    #[command(flatten)]
    models: lists::ModelsFlag,
    #[command(flatten)]
    criterion: lists::CriterionFlag,
    /// Model or profile; maps where it and the models differ
    #[arg(long, value_name = "MODEL|PROFILE", help_heading = "Models and criteria")]
    against: Option<String>,
    /// Mark cells whose outcome changes with a tenth of the time step, 1 cm, 0.1 km/h
    ///
    /// They are undecided: each cell is simulated eight times, and sheets show them in their own colour.
    #[arg(long, help_heading = "Models and criteria")]
    robust: bool,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
    #[command(flatten)]
    format: FormatFlag,
    /// Compute in binary64 on the CPU: the reference of the lane arithmetic
    #[arg(long, help_heading = "Models and criteria", hide_short_help = true)]
    reference: bool,
    /// Print lanes, memory and estimated time; write nothing
    #[arg(long, help_heading = "Run")]
    dry_run: bool,
    /// Folder of the results
    #[arg(long, value_name = "DIR", default_value = "lanesweep-map", help_heading = "Output")]
    out: PathBuf,
}

const EXAMPLES: &str = "Examples (--help has the parameters and more):\n  \
                        lanesweep map cut-in --preset jrc --out maps\n  \
                        lanesweep map lvd --x deceleration_mps2=1..9/0.25 --y ego_speed_kmh=30..130/5 --set thw_s=1.2";

const MORE_EXAMPLES: &str = "Examples (the repository has the .xosc file in docs/examples):\n  \
                             lanesweep map cut-in --preset jrc --out maps\n  \
                             lanesweep map cut-in --x gap_m=1..60/1 --y lateral_speed_mps=0.1..1.8/0.1 \\\n      \
                             --panel ego_speed_kmh=60,90,120 --panel other_speed_kmh=30,50 \\\n      \
                             --models FSM,RSS --against un-r157\n  \
                             lanesweep map lvd --x deceleration_mps2=1..9/0.25 --y ego_speed_kmh=30..130/5 --set thw_s=1.2 \\\n      \
                             --against FSM\n  \
                             lanesweep map cut-in --distribution cut-in-deterministic.xosc \\\n      \
                             --rename Ego_Speed_kph=ego_speed_kmh --rename Other_Speed_kph=other_speed_kmh";

fn after_long_help() -> String {
    let names: Vec<&str> = PARAMETERS.iter().map(|p| p.key).collect();
    format!("Parameters: {}\n\n{MORE_EXAMPLES}", names.join(", "))
}

impl Map {
    pub fn run(&self, configured: &Configured, verbosity: Verbosity) -> Result<Exit> {
        let category = Category::parse(&self.category).ok_or_else(|| {
            let problem = format!("there is no category `{}`", self.category);
            Error::usage(Place::item("CATEGORY"), problem, "use cut-in, cut-out or lvd")
        })?;
        let criterion = self.criterion.get()?;
        let profile = self.profile(configured)?;
        let options = MapOptions {
            grids: self.grids(category)?,
            models: self.models.named()?,
            criterion,
            against: self.against.as_deref().map(|text| against(text, configured)).transpose()?,
            robust: self.robust,
        };
        let started = Instant::now();
        let against = options.against.clone();
        let map = grid::Map::plan(options, &profile)?;
        let plan_s = started.elapsed().as_secs_f64();
        let opened = if self.reference { configured.open_cpu("--reference")? } else { configured.open()? };
        let wide = self.reference.then(CpuBackend::reference);
        let backend: &dyn Backend = match &wide {
            Some(wide) => wide,
            None => opened.backend(),
        };
        if self.dry_run {
            return forecast_map(&map, backend, self.format);
        }
        let folder = OutputDir::open(&self.out, MAP_RECORD)?;
        let executor = Executor::new(backend).with_fallback(opened.fallback()).with_recheck(RECHECK_SEED);
        let bar = console::progress(verbosity, map.cell_count(), "sweeping");
        let started = Instant::now();
        let MapResult { grids, summary } = map.run(&executor, |cells| bar.inc(cells))?;
        bar.finish_and_clear();
        let host = MapHost {
            backend: backend.describe(),
            device: opened.device(),
            sweep: SweepRecord {
                rechecked_lanes: summary.rechecked_lanes,
                recheck_seed: RECHECK_SEED,
                redone_lanes: summary.redone_lanes,
                device_s: summary.device_s,
            },
            threads: rayon::current_num_threads(),
            plan_s,
            sweep_s: started.elapsed().as_secs_f64(),
        };
        let report = MapReport { grids, criterion, against, profile, preset: self.preset.clone(), host };
        let written = report.write(folder.results()?)?;
        self.format.print(|| report.text(), || report.json(written.clone()))?;
        let (simulations, seconds) = (count(report.simulations()), value(report.host.sweep_s));
        tracing::info!("{simulations} simulations in {seconds} s on {}", report.host.backend);
        tracing::info!("{} files written to {}", written.len() + 1, self.out.display());
        Ok(Exit::Ok)
    }

    /// That of a preset unless one is set.
    fn profile(&self, configured: &Configured) -> Result<Profile> {
        match self.preset.as_deref().and_then(Presets::find) {
            Some(preset) if !configured.is_set("run.profile") => configured.profile_of(preset.profile()),
            _ => configured.profile(),
        }
    }

    /// The grids that the flags name.
    fn grids(&self, category: Category) -> Result<MapGrids> {
        match self.preset.as_deref() {
            Some(name) => match Presets::find(name) {
                Some(presets) => Ok(MapGrids::Preset(presets, category)),
                None => {
                    let problem = format!("there is no preset `{name}`");
                    let help = format!("presets: {}", Presets::ALL.map(Presets::name).join(", "));
                    Err(Error::usage(Place::item("--preset"), problem, help))
                }
            },
            None => {
                let parts = match &self.distribution {
                    Some(path) => self.of_distribution(path, category)?,
                    None => self.own_grid(category)?,
                };
                self.judge(&parts)?;
                Grid::new(parts).map(MapGrids::Own)
            }
        }
    }

    /// Looks at every value, and tells what is doubtful.
    fn judge(&self, parts: &GridParts) -> Result<()> {
        let mut doubts = Doubts::new(self.plausibility.policy());
        for axis in [&parts.x, &parts.y].into_iter().chain(&parts.panel_axes) {
            axis.values.iter().try_for_each(|value| axis.parameter.judge(*value, &mut doubts))?;
        }
        parts.fixed.iter().try_for_each(|(parameter, value)| parameter.judge(*value, &mut doubts))?;
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        Ok(())
    }

    fn own_grid(&self, category: Category) -> Result<GridParts> {
        let axis = |text: &Option<String>, flag: &str| {
            let text = text.as_deref().ok_or_else(|| {
                let problem = "it is missing".to_owned();
                Error::usage(Place::item(flag), problem, "give both --x and --y, or --preset")
            })?;
            GridAxis::parse(category, text, flag)
        };
        Ok(GridParts {
            name: category.key().to_owned(),
            category,
            x: axis(&self.x, "--x")?,
            y: axis(&self.y, "--y")?,
            panel_axes: self
                .panel
                .iter()
                .map(|text| GridAxis::parse(category, text, "--panel"))
                .collect::<Result<_>>()?,
            fixed: self.fixed(category)?,
            style: CaseStyle::Plain,
            native_gap: self.native_gap,
            closing_only: self.closing,
            panel_rows: None,
        })
    }

    fn fixed(&self, category: Category) -> Result<Vec<(&'static MapParameter, f64)>> {
        let fixed = |text: &String| -> Result<(&'static MapParameter, f64)> {
            let axis = GridAxis::parse(category, text, "--set")?;
            match axis.values[..] {
                [value] => Ok((axis.parameter, value)),
                _ => {
                    let problem = format!("`{text}` has {} values", axis.len());
                    Err(Error::usage(Place::item("--set"), problem, "give one, or make it an axis with --panel"))
                }
            }
        };
        self.set.iter().map(fixed).collect()
    }

    /// The grid of a file of distributions, with what the flags add.
    fn of_distribution(&self, path: &Path, category: Category) -> Result<GridParts> {
        let file = read_distribution(path)?;
        let found = variations(&file, &Names { category, renames: &self.rename, path })?;
        let mut left = found.axes;
        let mut axis = |flag: &Option<String>, name: &str| -> Result<GridAxis> {
            let named = |left: &mut Vec<GridAxis>, at: Option<usize>| at.map(|at| left.remove(at));
            match flag.as_deref().map(str::trim) {
                Some(text) if text.contains('=') => GridAxis::parse(category, text, name),
                Some(key) => {
                    let parameter = MapParameter::find(category, key, name)?;
                    let at = left.iter().position(|axis| axis.parameter == parameter);
                    named(&mut left, at).ok_or_else(|| {
                        let problem = format!("the file has no separate distribution of `{key}`");
                        Error::usage(Place::item(name), problem, format!("give its values: {name} {key}=FROM..TO/STEP"))
                    })
                }
                None => {
                    let several = left.iter().position(|axis| axis.len() > 1);
                    let at = several.or(if left.is_empty() { None } else { Some(0) });
                    named(&mut left, at).ok_or_else(|| {
                        let problem = "the file has fewer than two parameters with separate distributions";
                        let help = format!("a map has two axes: give one by {name} NAME=FROM..TO/STEP");
                        Error::usage(Place::item(name), problem, help)
                    })
                }
            }
        };
        // What --y names must not be taken for --x.
        let (x, y) = if self.x.is_none() && self.y.is_some() {
            let y = axis(&self.y, "--y")?;
            (axis(&self.x, "--x")?, y)
        } else {
            let x = axis(&self.x, "--x")?;
            (x, axis(&self.y, "--y")?)
        };
        let mut fixed = self.fixed(category)?;
        fixed.extend(left.iter().filter(|axis| axis.len() == 1).map(|axis| (axis.parameter, axis.values[0])));
        left.retain(|axis| axis.len() > 1);
        left.extend(
            self.panel.iter().map(|text| GridAxis::parse(category, text, "--panel")).collect::<Result<Vec<_>>>()?,
        );
        let mut rows = found.set_rows;
        for axis in &left {
            if rows.len().saturating_mul(axis.len()) > MAX_PANELS {
                let help = format!("give fewer values: a sheet has at most {MAX_PANELS} panels");
                return Err(Error::usage(Place::item("--distribution"), "too many panels", help));
            }
            let with = |row: &Vec<f64>, value: f64| [&row[..], &[value]].concat();
            rows = rows.iter().flat_map(|row| axis.values.iter().map(move |v| with(row, *v))).collect();
        }
        Ok(GridParts {
            name: category.key().to_owned(),
            category,
            x,
            y,
            panel_axes: found.set_axes.into_iter().chain(left).collect(),
            fixed,
            style: CaseStyle::Plain,
            native_gap: self.native_gap,
            closing_only: self.closing,
            panel_rows: Some(rows),
        })
    }
}

/// What the maps would be.
fn forecast_map(map: &grid::Map, backend: &dyn Backend, format: FormatFlag) -> Result<Exit> {
    let all = map.lane_count();
    let mut whole = Forecast::default();
    for plan in map.lane_plans() {
        let budget = BUDGET.mul_f64(plan.lane_count() as f64 / all.max(1) as f64);
        whole.add(&forecast(plan, backend, Wanted::Verdicts, budget, |_| Ok(()))?);
    }
    let part = |(other, plan): (Option<&str>, &GridPlan)| ForecastPart {
        of: plan.grid.name().to_owned(),
        what: other.map_or(String::new(), |name| format!("under {name}")),
        units: plan.grid.cell_count() as u64,
        lanes: plan.lane_count(),
    };
    let parts = map.plans().map(part).collect();
    DryRun {
        data: "the grids' own cases".to_owned(),
        parts,
        units: "cells",
        is_at_most: false,
        // A verdict per cell and model, and the sheets drawn of them.
        more_bytes: all * (size_of::<Verdicts>() as u64 + 1) + BYTES_OF_SHEETS,
        more: "verdicts and sheets",
        forecast: Some(whole),
        backend: backend.describe(),
        before: None,
        besides: "drawing and writing the sheets",
    }
    .print(format)?;
    Ok(Exit::Ok)
}

/// A model's name, or else a profile.
fn against(text: &str, configured: &Configured) -> Result<Against> {
    if let Some(model) = ModelId::parse(text) {
        return Ok(Against::Model(model));
    }
    let profile = configured.profile_of(text).map_err(|error| match error {
        Error::Usage { place, problem: _, help } if *place == Place::option("profile") => {
            let problem = format!("there is neither a driver model nor a profile `{text}`");
            Error::usage(Place::item("--against"), problem, format!("{help}. Models: {}", ModelId::names()))
        }
        other => other,
    })?;
    Ok(Against::Profile(Box::new(profile)))
}
