//! `lanesweep study`: scores parameterizations by F1 on trajectories.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use super::configured::Configured;
use super::console;
use super::format::FormatFlag;
use super::settings::KeepPlan;
use super::source::{SourceFlags, check_lane_table};
use super::{COMMIT, Exit, Output, lists};
use lanesweep_engine::{Chunk, Headway, LanePlan, OpenBackend};
use lanesweep_report::host::{Host, Timings};
use lanesweep_report::lanes::{study_table, write_study_chunk};
use lanesweep_report::study::StudyReport;
use lanesweep_run::parts::{EachChunk, Job, PLAN_FILE, RUN_PLAN_FILE};
use lanesweep_run::study::{self, ExternalReplay, ReferenceComparison, StudyOptions, StudyResult};
use lanesweep_support::input_file;
use lanesweep_support::readable;
use lanesweep_support::run_folder::Results;
use lanesweep_support::{Error, Place, Result};
use lanesweep_traffic::Source;

/// What the SVG files of a study hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Figures {
    /// Title, plots, legend and caption
    Titled,
    /// Plots and legend
    Plain,
}

/// How far do parameterized scenarios agree with recorded ones?
///
/// Mines cut-ins, cut-outs and leader decelerations. Replays each as recorded (S) and parameterized (S') from ten time
/// headways with every driver model, evaluates collision, TTC and BTN, and scores S' against S. Without data it uses
/// generated recordings. The answer goes to stdout, tables and figures to --out.
#[derive(Debug, Args)]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "recordings" | "scenarios" | "accept_implausible" | "categories" | "models" | "thw" | "published" | "external" => {
        arg.conflicts_with("plan")
    }
    "rows" => arg.conflicts_with_all(["shard", "plan_only"]),
    _ => arg,
}))]
#[command(after_help = "Examples:\n  lanesweep study\n  lanesweep study recordings --out result\n  lanesweep study \
                        --scenarios scenarios.jsonl --rows lanes.csv")]
pub(super) struct Study {
    #[command(flatten)]
    data: SourceFlags,
    /// Folder for tables, figures and run.json
    #[arg(long, value_name = "DIR", default_value = "lanesweep-out", help_heading = "Output")]
    out: PathBuf,
    /// Also write one row per lane: .csv, .jsonl or .parquet
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    rows: Option<PathBuf>,
    /// Figures with their texts, or plain ones for a paper: 88 or 180 mm wide, the texts in NAME.txt
    #[arg(long, value_name = "STYLE", value_enum, default_value = "titled", help_heading = "Output")]
    figures: Figures,
    /// Set the paper's published numbers (of highD) beside ours on the page; run.json has the differences
    #[arg(long, help_heading = "Models and criteria")]
    published: bool,
    #[command(flatten)]
    categories: lists::CategoriesFlag,
    #[command(flatten)]
    models: lists::ModelsFlag,
    /// Time headways, s: numbers, paper, r157, observed
    ///
    /// paper: 2.0, 1.8, … 0.2. The paper's claims need all of its headways. r157: the minimum following distance of UN R157, 5.2.3.3, for the
    /// ego's speed; a list may contain it. observed: each scenario starts from its recorded gap, and a density draws
    /// the headway as one more parameter; it cannot be combined with other headways.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "paper", help_heading = "Scenario")]
    #[arg(allow_negative_numbers = true)]
    thw: Vec<String>,
    /// S' of another program, a scenario file
    ///
    /// It has the ids of S; its series may have any sample rate and length. Repeatable.
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    external: Vec<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
    #[command(flatten)]
    shards: lists::ShardFlags,
}

impl Study {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        self.guard_inputs(configured)?;
        self.shards.check_folder(&self.out, study::STUDY_RECORD)?;
        let is_binary64 = configured.settings.study.reference;
        if let Some(path) = &self.shards.plan {
            configured.refuse_with_plan()?;
            let study = study::Study::read(path, self.shards.shard)?;
            let opened = configured.open_in(study.facts().reference)?;
            return self.sweep(&study, &opened, configured, Timings::default());
        }
        if self.shards.plan_only {
            if is_binary64 {
                configured.open_in(true)?;
            }
            let (study, _) = self.prepare(configured)?;
            study.write_plan(&self.out)?;
            let exit = if study.facts().incomplete { Exit::Incomplete } else { Exit::Ok };
            return self.format.planned(exit, study.plan().lane_count(), &self.out.join(PLAN_FILE));
        }
        // Open before the work, so that a missing device is reported at once.
        let opened = configured.open_in(is_binary64)?;
        let (study, timings) = self.prepare(configured)?;
        self.sweep(&study, &opened, configured, timings)
    }

    /// Makes a plan from the data.
    fn prepare(&self, configured: &Configured) -> Result<(study::Study, Timings)> {
        let config = configured.settings.clone();
        let profile = configured.profile()?;
        let mut options = StudyOptions {
            categories: self.categories.list()?,
            models: self.models.list()?,
            headways: match &self.thw[..] {
                [one] if Headway::parse(one.trim()) == Some(Headway::Observed) => vec![Headway::Observed],
                list => lists::headways(list)?,
            },
            parameterization: config.parameterization.clone(),
            folds: Some(config.study.folds).filter(|folds| *folds > 1),
            external: Vec::new(),
        };
        let source = self.data.source(configured);
        let has_paper_headways = options.headways == Headway::paper();
        // Generated data are described with the answer.
        if !matches!(source, Source::Generated(_)) {
            tracing::info!("{}", source.describe(false));
        }
        let mut timings = Timings::default();
        let collection = timed(&mut timings.mine_s, || self.data.load(configured))?;
        for path in &self.external {
            options.external.extend(ExternalReplay::read(
                path,
                &collection.scenarios,
                &options.categories,
                self.data.plausibility.policy(),
            )?);
        }
        let data = source.describe(collection.synthetic);
        let mut builder = study::Study::builder(&collection, profile);
        (builder.options, builder.mining, builder.score, builder.data) = (options, config.mining, config.score, data);
        builder.scenario_file_sha256 = self.data.scenarios.as_deref().map(input_file::sha256).transpose()?;
        // Synthetic recordings are calibrated to the published numbers, so both are shown if the headways are the same.
        builder.published = self.published || (collection.synthetic && has_paper_headways);
        builder.reference = config.study.reference;
        let study = timed(&mut timings.plan_s, || builder.plan())?;
        console::warn(study.cases().left_out());
        Ok((study, timings))
    }

    /// Runs a plan; returns a report, or a part of a run.
    fn sweep(
        &self,
        study: &study::Study,
        opened: &OpenBackend,
        configured: &Configured,
        mut timings: Timings,
    ) -> Result<Output> {
        let (plan, backend, started) = (study.plan(), opened.backend(), Instant::now());
        let executor = opened.executor().with_recheck(study.facts().score.seed);
        if self.shards.shard.is_some() {
            study.write_plan(&self.out)?;
        }
        // Open before the work, so that an unwritable folder is reported at once.
        let Some(mut run) = study.open(&self.out, self.shards.shard, true)? else { return Ok(Exit::Ok.into()) };
        let units = run.units();
        let lanes = plan.first_lane_of(units.end) - plan.first_lane_of(units.start);
        tracing::info!("{} runs on {}", readable::count(lanes), backend.describe());
        let missing = run.missing()?;
        let mut rows = self.rows.as_deref().map(|path| study_table(path, study)).transpose()?;
        let mut write = rows.as_mut().map(|rows| |plan: &LanePlan, chunk: &Chunk| write_study_chunk(rows, plan, chunk));
        timed(&mut timings.sweep_s, || {
            let each = write.as_mut().map(|write| write as &mut EachChunk);
            configured.with_progress(missing, "sweeping", &executor, |executor| run.compute(executor, each))
        })?;
        if self.shards.shard.is_some() {
            run.write_part()?;
            return Ok(Exit::Ok.into());
        }
        let StudyResult { counts, summary: swept, .. } = run.take_result()?;
        let mut results = run.results()?;
        if let Some(rows) = rows {
            results.join(rows.stage()?);
        }
        let comparison = configured.settings.study.compare_reference;
        let comparison = comparison.then(|| ReferenceComparison::of_study(study.cases())).transpose()?;
        let settings = configured.record(self.shards.plan.is_some());
        let mut host = Host::of(COMMIT, opened, swept.rechecked_lanes, started, settings);
        if let (Some(stand_in), 1..) = (executor.fallback, swept.redone_lanes) {
            host.backend += &format!("; after its failure {}", stand_in.describe());
        }
        self.leave_plan(study, configured.settings.study.keep_plan, &mut results)?;
        let report = StudyReport::of(study, &counts, comparison, host, &swept, timings)?;
        let of = (study.facts().incomplete, self.figures == Figures::Plain);
        let output = self.format.study(&report, results, of)?;
        run.close()?;
        Ok(output)
    }

    /// Keeps the plan for `simulate --from`.
    fn leave_plan(&self, study: &study::Study, keep: KeepPlan, results: &mut Results) -> Result<()> {
        let max_bytes = match keep {
            KeepPlan::Auto => 256 << 20,
            KeepPlan::Always => u64::MAX,
            KeepPlan::Never => return Ok(()),
        };
        if !study.keep(results, RUN_PLAN_FILE, max_bytes)? {
            tracing::info!(
                "the plan is not kept in {}: it has more than {} MiB; \
                 `--config study.keep_plan=always` keeps it for `simulate --from`",
                self.out.display(),
                max_bytes >> 20
            );
        }
        Ok(())
    }

    /// Checks that every flag has an effect, and that the lane table replaces no other result.
    fn guard_inputs(&self, configured: &Configured) -> Result<()> {
        if configured.settings.study.compare_reference && self.shards.is_split() {
            let problem = "a part of a run cannot compare the arithmetics of the whole run";
            return Err(Error::usage(Place::item("study.compare_reference"), problem, "leave it out"));
        }
        let Some(lanes) = &self.rows else { return Ok(()) };
        let results = ["results.csv", "run.json", PLAN_FILE, RUN_PLAN_FILE].map(|name| self.out.join(name));
        check_lane_table(lanes, "rows", &results)
    }
}

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds = start.elapsed().as_secs_f64();
    result
}
