//! A sampling run as one page.

use super::html::{Page, PageFigure, Section};
use super::plot::{AxisScale, Figure, Mark, Plot, PlotAxis, Series, Value, is_few};
use super::sampling::SampleReport;
use lanesweep_engine::Headway;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_run::sampling::EstimateRow;
use lanesweep_support::readable::{count, count_of, significant, value};

impl SampleReport {
    /// `report.html`, with the figures of the run.
    pub(super) fn html(&self, figures: Vec<PageFigure>) -> String {
        let density = &self.density;
        let mut warnings = Vec::new();
        if !self.is_reproducible() {
            warnings.push("Ended by the clock: another machine ends elsewhere.".to_owned());
        }
        let mut sections = vec![self.estimates_section()];
        sections.extend((!figures.is_empty()).then(|| Section::new("figures", "Figures").figures(figures)));
        let clock = (self.host.seconds > 0.0).then(|| self.host.wall_clock());
        let reproduction = self.host.section(&self.profile).fact("SHA-256 of the density", &self.density.sha256);
        sections.push(reproduction.host(clock).folded());
        // Importance sampling seldom needs the maximum that it may draw; its runs include the search.
        let runs = self.estimates.iter().map(|row| row.estimate.runs).max();
        let drawn = self.draws.as_ref().map(|draws| draws.samples).or(runs).unwrap_or(self.options.stop.samples);
        Page {
            title: format!("Probability of failure: {}", self.name()),
            lead: format!(
                "{}{} samples of a density over {} mined scenarios, estimator {}, profile {}. {}",
                self.sentence(),
                count(drawn),
                count_of(density.kernels),
                match self.has_rare() {
                    true => format!("{}, rare failures by is", self.options.estimator.key()),
                    false => self.options.estimator.key().to_owned(),
                },
                self.profile.name,
                density.provenance.data
            ),
            synthetic: density.provenance.synthetic,
            warnings,
            app: None,
            sections,
        }
        .html()
    }

    /// `cut-in 2`.
    fn name(&self) -> String {
        format!("{} {}", self.density.category.label(), self.density.parameterization)
    }

    /// The largest probability of a collision, or of another criterion.
    fn sentence(&self) -> String {
        let rows = || self.estimates.iter().filter(|row| row.is_told(&self.estimates));
        let by = |a: &&EstimateRow, b: &&EstimateRow| a.estimate.probability.total_cmp(&b.estimate.probability);
        let collisions = rows().filter(|row| row.criterion == Criterion::Collision).max_by(by);
        let Some(row) = collisions.or_else(|| rows().max_by(by)) else { return String::new() };
        let [p, low, high] = [row.estimate.probability, row.estimate.interval.low, row.estimate.interval.high];
        let [p, low, high] = [p, low, high].map(|share| significant(100.0 * share, 2));
        let (model, criterion) = (row.model.name(), row.criterion.label());
        format!("Highest: {model} fails {criterion} in {p} % [{low} {high}] of the runs (THW {}). ", row.headway)
    }

    fn estimates_section(&self) -> Section {
        let estimates = self.table(|row| row.is_told(&self.estimates));
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

    /// Probability over the headway, a panel per model; `None` for a single headway.
    pub(super) fn headways_figure(&self) -> Option<Figure> {
        let thw_s = |row: &EstimateRow| {
            let of = self.plan_headways.iter().find(|headway| headway.to_string() == row.headway);
            of.filter(|headway| matches!(headway, Headway::ThwS(_)))?.value()
        };
        let all = self.estimates.iter().filter_map(|row| Some((thw_s(row)?, 100.0 * row.estimate.probability)));
        let all: Vec<(f64, f64)> = all.chain([(0.0, 0.0)]).collect();
        let panel = |&model: &ModelId| {
            let series = |criterion: Criterion| {
                let own = self.estimates.iter().filter(|row| row.model == model && row.criterion == criterion);
                let point = |row: &EstimateRow| {
                    let few = row.failing_scenarios.filter(|n| is_few(*n));
                    let label = few.filter(|n| *n > 0.0).map_or(String::new(), |n| format!("{:.0}", n.floor()));
                    let place = (thw_s(row)?, 100.0 * row.estimate.probability);
                    let interval = &row.estimate.interval;
                    let interval = Some((100.0 * interval.low, 100.0 * interval.high.min(1.0)));
                    Some(Value { label, interval, is_few: few.is_some(), ..Value::from(place) })
                };
                let mut values: Vec<Value> = own.filter_map(point).collect();
                values.sort_by(|a, b| a.x.total_cmp(&b.x));
                Series::new(criterion.label(), &[Mark::Band, Mark::Line, Mark::Points], values)
            };
            let series = Criterion::ALL.map(series).into_iter().filter(|series| !series.values.is_empty());
            Plot {
                heading: model.name().to_owned(),
                x: PlotAxis::around("initial time headway in s", AxisScale::Linear, all.iter().map(|v| v.0).collect()),
                y: PlotAxis::around(
                    "probability of failure in %",
                    AxisScale::SquareRoot,
                    all.iter().map(|v| v.1).collect(),
                ),
                series: series.collect(),
                ..Plot::default()
            }
        };
        let headways = self.plan_headways.iter().filter(|headway| matches!(headway, Headway::ThwS(_))).count();
        (headways > 1).then(|| Figure {
            title: format!("{}: probability of failure against the headway", self.name()),
            subtitle: Some(self.density.provenance.data.clone()),
            caption:
                "Marker: estimate at one headway; area: its interval over draws and scenarios. Vertical axis by the \
                      square root. n: effective number of recorded scenarios that fail, where there is room."
                    .to_owned(),
            plots: self.options.models.iter().map(panel).collect(),
            ..Figure::default()
        })
    }
}
