//! A sampling run as one page.

use super::html::{Page, Section};
use super::sampling::SampleReport;
use lanesweep_model::criterion::Criterion;
use lanesweep_run::sampling::EstimateRow;
use lanesweep_support::Result;
use lanesweep_support::readable::{count, significant, value};

impl SampleReport<'_> {
    /// `report.html`.
    ///
    /// # Errors
    /// As `DensityModel::content_sha256`.
    pub(super) fn html(&self) -> Result<String> {
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
    pub(super) fn name(&self) -> String {
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
