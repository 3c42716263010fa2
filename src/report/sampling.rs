//! A sampling run as files and as text.

use super::host::Host;
use super::html::{Page, Section};
use super::records::{PROGRAM, document, publish, record};
use super::sampling_tables::convergence_table;
use super::tables::paragraph;
use lanesweep_engine::generated::ATTEMPTS;
use lanesweep_engine::{ENGINE_VERSION, LanePlan, SampleTally};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::scenario::parameterization::Parameterization;
use lanesweep_run::sampling::{EstimateRow, RiskRate, Sample, SampleResult, proposal_text};
use lanesweep_stats::estimate::{IntervalKind, WeightFigures};
use lanesweep_support::Result;
use lanesweep_support::readable::{count, counted, significant, value};
use lanesweep_support::run_folder::{ResultFiles, Results};
use lanesweep_support::table::{Column, Digits, NumberText, Table, TableOf};

/// A sampling run with what its files state.
pub struct SampleReport<'a> {
    /// The run.
    pub sample: &'a Sample,
    /// Its result.
    pub result: &'a SampleResult,
    /// The machine.
    pub host: Host,
}

impl<'a> SampleReport<'a> {
    /// Writes every file of the run to its folder, the record last; returns the names of the others.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Io`].
    pub fn write(&self, mut results: Results) -> Result<ResultFiles> {
        let density = &self.sample.density;
        results.add_table("tables/convergence.csv", convergence_table(&self.result.convergence))?;
        if let Some(proposal) = &self.result.proposal {
            results.add("proposal.json", proposal_text(density, proposal)?.as_bytes())?;
        }
        results.add("density.json", &density.to_json()?)?;
        results.add_table("estimates.csv", self.estimate_rows())?;
        results.add("report.html", self.html()?.as_bytes())?;
        publish(results, |files| self.json(files))
    }

    pub(super) fn estimates(&self) -> &'a [EstimateRow] {
        &self.result.rows
    }

    /// The sampled parameterization.
    pub(super) fn id(&self) -> &'a Parameterization {
        self.sample.density.space.id()
    }

    /// Headways, by name.
    pub(super) fn headways(&self) -> Vec<String> {
        (0..self.sample.options.headways().len().max(1)).map(|at| self.sample.options.headway_name(at)).collect()
    }

    /// Draws of crude Monte Carlo and their plan.
    pub(super) fn drawn(&self) -> Option<(&'a SampleTally, &'a LanePlan)> {
        self.result.crude.as_ref().zip(self.sample.lane_plan())
    }

    /// `estimate.json`; `files` are in the same folder.
    ///
    /// # Errors
    /// None for a record of this program.
    pub fn json(&self, files: &ResultFiles) -> Result<String> {
        let (sample, density, options) = (self.sample, &self.sample.density, &self.sample.options);
        let draws = self.drawn().map(|(tally, plan)| {
            record! {
                // Ranges of drawn sample indices: [first, one past the last].
                ranges: tally.covered().iter().map(|range| [range.start, range.end]).collect::<Vec<_>>(),
                samples: tally.samples(),
                // Samples without a valid point; no estimate counts them.
                voids: tally.voids,
                tries: tally.tries,
                rejected_share: rejected(tally),
                lanes: lanes(tally, plan),
                capped_lanes: tally.capped.iter().sum::<u64>(),
            }
        });
        document(&record! {
            lanesweep_estimate: 1,
            program: PROGRAM,
            // Identifies the bits of the program's lanes.
            engine: ENGINE_VERSION,
            commit: self.host.commit(),
            // With `mc`, rows of rare failures may be of importance sampling.
            estimator: options.estimator.key(),
            density: record! {
                sha256: density.content_sha256()?,
                category: self.id().category,
                parameterization: self.id().key,
                parameters: density.space.parameters().iter().map(|of| &of.name).collect::<Vec<_>>(),
                kernels: density.kde.points().len(),
                provenance: &density.provenance,
            },
            profile: &sample.profile,
            models: &options.models,
            headways: self.headways(),
            plan_headways: options.headways(),
            samples: options.stop.samples,
            seed: options.seed,
            // Only for crude Monte Carlo.
            plan_sha256: self.drawn().map(|(_, plan)| plan.hash()),
            draws: draws,
            options: options,
            settings: &self.host.settings,
            stopped: EstimateRow::stopped(self.estimates()),
            reproducible: self.is_reproducible(),
            estimates: self.estimates(),
            search: &self.result.search,
            #[serde(flatten)]
            files: files,
            host: &self.host,
        })
    }

    /// Whether the same flags give the same numbers on every machine.
    pub(super) fn is_reproducible(&self) -> bool {
        self.estimates().iter().all(|r| r.estimate.stopped.is_reproducible())
    }

    /// The text for the terminal.
    pub fn text(&self) -> String {
        let density = &self.sample.density;
        let (scenarios, data) = (count(density.kde.points().len()), &density.provenance.data);
        let mut text = format!("{}: density over {scenarios} scenarios ({data})\n", self.name());
        if let Some((tally, plan)) = self.drawn() {
            let some = |count: u64, text: String| if count > 0 { text } else { String::new() };
            let (voids, capped) = (tally.voids, tally.capped.iter().sum());
            let void = some(voids, format!(", {} samples void (none of {ATTEMPTS} draws valid)", count(voids)));
            let capped = some(capped, format!("; {} lanes ended at the time cap", count(capped)));
            let ([samples, lanes], percent) =
                ([tally.samples(), lanes(tally, plan)].map(count), 100.0 * rejected(tally));
            text += &format!(
                "{samples} samples, {lanes} lanes; {percent:.2} % of the draws invalid and drawn again{void}{capped}\n"
            );
        }
        text.push_str(&self.table(|row| row.is_overall(self.estimates())).text());
        if self.has_rare() {
            text.push_str("Rare failures, by importance sampling:\n");
            text.push_str(&self.table(|row| row.is_rare_beside(self.estimates())).text());
        }
        let notes = self.notes();
        for note in notes.iter().take(MAX_NOTES) {
            text += &paragraph(note);
        }
        let is_compared = self.estimates().iter().any(|row| row.recorded.is_some_and(|of| of.sampled.is_some()));
        let marks = "P/S, beside the recorded scenarios: = agrees, > too high, < too low, ? undecided. ";
        let more = match notes.len().saturating_sub(MAX_NOTES) {
            0 => "More".to_owned(),
            more => format!("{} and more", counted(more, "further note")),
        };
        let (level, rule, marks) =
            (value(100.0 * self.level()), self.interval_rule(), if is_compared { marks } else { "" });
        text += &paragraph(&format!("Intervals at {level} %: of the draws, and{rule}. {marks}{more} on the page."));
        if density.provenance.synthetic {
            text.push_str("SYNTHETIC DATA: no number above is a statement about real traffic\n");
        }
        text
    }

    /// What is said of the run, the general first, then of its rows.
    fn notes(&self) -> Vec<String> {
        let of_rows = self.remarks().into_iter().map(|(of, remark)| format!("{of}: {remark}"));
        self.cautions().chain(of_rows).collect()
    }

    /// The table of some estimates. P of possible traffic, rates and P/S are there where a row has them.
    pub(super) fn table(&self, is_in: impl Fn(&EstimateRow) -> bool) -> Table {
        let has = |of: &dyn Fn(&EstimateRow) -> bool| self.estimates().iter().any(of);
        let sampled = |row: &EstimateRow| row.recorded.and_then(|recorded| recorded.sampled);
        let ratio = |row| sampled(row).and_then(|r| Some(format!("{} {}", short(r.ratio?), r.verdict.mark())));
        let possible = |row: &EstimateRow| row.no_traffic.map(|of| of.possible_probability);
        let kind = |row: &EstimateRow| row.estimate.interval.kind;
        let of_draws = |row: &EstimateRow| NumberText(interval_text(row.draws[0], row.draws[1], kind(row)));
        let of_scenarios = |row: &EstimateRow| {
            let interval = &row.estimate.interval;
            row.failing_scenarios.map(|scenarios| match scenarios < DETERMINING && row.estimate.failures > 0 {
                true => "not determined".to_owned(),
                false => interval_text(interval.low, interval.high, interval.kind),
            })
        };
        self.named(self.estimates().iter().filter(|row| is_in(row)))
            .column(three_digits("P"), |row| row.estimate.probability)
            .column("of the draws", of_draws)
            .column(Column::from("of scenarios").null("–"), |row| of_scenarios(row).map(NumberText))
            .columns(has(&|row| possible(row).is_some()).then_some("P possible"), three_digits, |row, _| possible(row))
            .columns(has(&|row| row.risk.per_hour.is_some()).then_some("per hour"), Column::from, |row, _| {
                rate_text(row.risk.per_hour)
            })
            .columns(has(&|row| row.risk.per_1000_km.is_some()).then_some("per 1000 km"), Column::from, |row, _| {
                rate_text(row.risk.per_1000_km)
            })
            .columns(
                has(&|row| sampled(row).is_some()).then_some("P/S"),
                |name| Column::from(name).null("–"),
                |row, _| ratio(row),
            )
            .column(USABLE, |row| row.estimate.trust.usable())
            .build()
    }

    /// A row per estimate, with what it is of.
    fn named<'r>(&self, rows: impl IntoIterator<Item = &'r EstimateRow>) -> TableOf<&'r EstimateRow> {
        Table::of(rows)
            .column("model", |row| row.model.name())
            .column("criterion", |row| row.criterion.label())
            .column("THW", |row| row.headway.as_str())
    }

    /// P at both ends of the bandwidth's interval, for the told rows that have it.
    pub(super) fn bandwidths(&self) -> Table {
        let told =
            self.estimates().iter().filter(|row| row.is_told(self.estimates()) && row.at_bandwidths[0].is_some());
        let ends = [("narrow", 0), ("wide", 1)];
        self.named(told)
            .columns(
                ends,
                |(name, _)| three_digits(name),
                |row, (_, end)| row.at_bandwidths[end].map(|of| of.probability),
            )
            .build()
    }

    /// What the importance weights indicate, for those estimates that have them.
    pub(super) fn weights(&self) -> Table {
        let percent = |name| Column::from(name).digits(Digits::Fixed(2));
        self.named(self.estimates().iter().filter(|row| row.estimate.weights.is_some()))
            .column(three_digits("variance reduction"), |row| row.estimate.variance_reduction)
            .column("effective failures", weight(|w| w.effective_failures))
            .column(percent("largest weight, %"), weight(|w| 100.0 * w.largest_fraction))
            .column(percent("from the density, %"), weight(|w| 100.0 * w.crude_fraction))
            .build()
    }

    /// Confidence level of the intervals.
    pub(super) fn level(&self) -> f64 {
        self.estimates().first().map_or(0.95, |row| row.estimate.interval.level)
    }

    /// Whether rare failures have an estimate by importance sampling, too.
    fn has_rare(&self) -> bool {
        self.estimates().iter().any(|row| row.is_rare_beside(self.estimates()))
    }

    /// `report.html`.
    ///
    /// # Errors
    /// As `DensityModel::content_sha256`.
    fn html(&self) -> Result<String> {
        let density = &self.sample.density;
        let mut warnings = Vec::new();
        if !self.is_reproducible() {
            warnings.push("Ended by the clock: another machine ends elsewhere.".to_owned());
        }
        let clock = (self.host.seconds > 0.0)
            .then(|| ("seconds", format!("{:.2} on {} threads", self.host.seconds, self.host.threads)));
        let reproduction =
            self.host.section(&self.sample.profile).fact("SHA-256 of the density", density.content_sha256()?);
        let sections = vec![self.estimates_section(), reproduction.host(clock).folded()];
        // Importance sampling seldom needs the maximum that it may draw; its runs include the search.
        let runs = self.estimates().iter().map(|row| row.estimate.runs).max();
        let drawn = self.drawn().map(|(tally, _)| tally.samples()).or(runs).unwrap_or(self.sample.options.stop.samples);
        let (highest, drawn, scenarios) = (self.sentence(), count(drawn), count(density.kde.points().len()));
        let (profile, data) = (&self.sample.profile.name, &density.provenance.data);
        let rare = if self.has_rare() { ", rare failures by is" } else { "" };
        let estimator = self.sample.options.estimator.key();
        let page = Page {
            title: format!("Probability of failure: {}", self.name()),
            lead: format!(
                "{highest}{drawn} samples of a density over {scenarios} mined scenarios, estimator {estimator}{rare}, profile \
                 {profile}. {data}"
            ),
            synthetic: density.provenance.synthetic,
            warnings,
            app: None,
            sections,
        };
        Ok(page.html())
    }

    /// `cut-in 2`.
    fn name(&self) -> String {
        format!("{} {}", self.id().category.label(), self.id().key)
    }

    /// The largest probability of a collision, or of another criterion.
    fn sentence(&self) -> String {
        let rows = || self.estimates().iter().filter(|row| row.is_told(self.estimates()));
        let by = |a: &&EstimateRow, b: &&EstimateRow| a.estimate.probability.total_cmp(&b.estimate.probability);
        let collisions = rows().filter(|row| row.criterion == Criterion::Collision).max_by(by);
        let Some(row) = collisions.or_else(|| rows().max_by(by)) else { return String::new() };
        let [p, low, high] = [row.estimate.probability, row.estimate.interval.low, row.estimate.interval.high];
        let [p, low, high] = [p, low, high].map(|share| significant(100.0 * share, 2));
        let (model, criterion) = (row.model.name(), row.criterion.label());
        format!("Highest: {model} fails {criterion} in {p} % [{low} {high}] of the runs (THW {}). ", row.headway)
    }

    fn estimates_section(&self) -> Section {
        let estimates = self.table(|row| row.is_told(self.estimates()));
        let mut tables = vec![estimates.captioned(format!(
            "Probability of failure, and risk where the exposure is known. Intervals at {} %: of the draws, and{}",
            value(100.0 * self.level()),
            self.interval_rule()
        ))];
        let bandwidths = self.bandwidths();
        if !bandwidths.rows.is_empty() {
            tables.push(bandwidths.captioned("P at the ends of the 95 % interval of the bandwidth"));
        }
        let weights = self.weights();
        if !weights.rows.is_empty() {
            tables.push(weights.captioned("Weights: how much of the sample counts"));
        }
        Section::new("estimates", "Estimates")
            .intro(format!(
                "A rate is the recordings' where the density agrees with the recorded scenarios. It is carried by the \
                 scenarios that fail where these are effectively fewer than ten. ≤ bounds from above where nothing failed. \
                 {}",
                self.rules().map(|rule| rule + ". ").collect::<String>()
            ))
            .tables(tables)
            .facts(self.remarks())
    }
}

/// Fraction of invalid draws.
fn rejected(tally: &SampleTally) -> f64 {
    (tally.tries - tally.valid().min(tally.tries)) as f64 / tally.tries.max(1) as f64
}

fn lanes(tally: &SampleTally, plan: &LanePlan) -> u64 {
    tally.samples() * plan.lanes_per_unit(&plan.blocks[0])
}

/// A number of the weights of a row that has them.
fn weight<V>(of: impl Fn(&WeightFigures) -> V) -> impl Fn(&EstimateRow) -> Option<V> {
    move |row| row.estimate.weights.as_ref().map(&of)
}

/// A column of numbers with three digits.
fn three_digits(name: &'static str) -> Column {
    Column::from(name).digits(Digits::Significant(3))
}

/// Effective number of failing scenarios below which data do not determine P.
const DETERMINING: f64 = 3.0;

/// Number of notes on the terminal.
const MAX_NOTES: usize = 5;

/// Heading of what a row may be used for.
const USABLE: &str = "usable";

/// Three digits.
pub(super) fn short(value: f64) -> String {
    significant(value, 3)
}

fn interval_text(low: f64, high: f64, kind: IntervalKind) -> String {
    match kind {
        IntervalKind::RuleOfThree => format!("≤ {}", short(high)),
        _ => format!("{}…{}", short(low), short(high)),
    }
}

fn rate_text(rate: Option<RiskRate>) -> String {
    rate.map_or("unknown".to_owned(), |r| {
        if r.estimate > 0.0 {
            format!("{} ({}…{})", short(r.estimate), short(r.low), short(r.high))
        } else {
            format!("≤ {}", short(r.high))
        }
    })
}
