//! Compares the labels of S' with those of S, lane by lane: the replay that produces them, then recall, precision and
//! F1 with intervals over scenarios, in total and by groups.

use std::collections::HashMap;

use super::JustifyOptions;
use crate::engine::{Confusion, Executor, LanePlan, Partial, SweepSummary, Verdicts};
use crate::model::criterion::Criterion;
use crate::model::profile::Profile;
use crate::run::compare::Compare;
use crate::run::score::{
    CROSS_VALIDATED, ScoreInterval, ScoreOptions, f1, f1_interval, precision, recall, share_interval,
};
use crate::scenario::DataProvenance;
use crate::scenario::Scenario;
use crate::scenario::parameterization::Parameterization;
use crate::{Error, Place, Result};

/// A fraction with its interval. The value is `None` for 0/0; the interval is `None` with too few failing scenarios.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Share {
    /// The fraction.
    pub value: Option<f64>,
    /// Its interval over scenarios.
    pub interval: Option<(f64, f64)>,
}

/// Scores of a parameterization.
#[derive(Debug, Clone, PartialEq)]
pub struct Scored {
    /// Counts over lanes.
    pub counts: Confusion,
    /// Number of scenarios in which S fails from some headway.
    pub failing_scenarios: u64,
    /// Fraction of failures of S that S' has too.
    pub recall: Share,
    /// Fraction of failures of S' that S has too.
    pub precision: Share,
    /// Harmonic mean of recall and precision.
    pub f1: Share,
}

/// Scores of a part of the lanes.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// What the lanes are grouped by.
    pub by: &'static str,
    /// Name of the group.
    pub name: String,
    /// Its scores.
    pub scored: Scored,
}

/// The lanes of one model with all verdicts kept, because hidden failures are identified lane by lane.
pub(super) struct Replay<'a> {
    pub compare: Compare<'a>,
    pub counts: Partial,
    verdicts: Vec<Verdicts>,
    criterion: Criterion,
    data: &'a str,
}

impl<'a> Replay<'a> {
    /// Runs the lanes.
    ///
    /// # Errors
    /// As [`Compare::plan`] and [`Compare::replay`].
    pub(super) fn run(
        scenarios: &'a [Scenario],
        facts: &'a DataProvenance,
        profile: &Profile,
        options: &JustifyOptions,
        executor: &Executor,
        summary: &mut SweepSummary,
    ) -> Result<Replay<'a>> {
        let compare = Compare::plan(scenarios, facts, profile.clone(), options.compare.clone())?;
        let mut verdicts = Vec::new();
        let (counts, swept) = compare.replay_each(executor, |chunk| verdicts.extend_from_slice(&chunk.verdicts))?;
        summary.add(&swept);
        Ok(Replay { compare, counts, verdicts, criterion: options.criterion, data: &facts.data })
    }

    pub(super) fn plan(&self) -> &LanePlan {
        self.compare.lane_plan()
    }

    /// Number of scenarios.
    pub(super) fn units(&self) -> usize {
        self.plan().blocks[0].units.len() as usize
    }

    /// Index of a parameterization among the variants: the cross-validated one, if there is one.
    ///
    /// # Errors
    /// [`Error::Input`] for one that is impossible with this data.
    pub(super) fn variant(&self, id: &Parameterization) -> Result<usize> {
        let variants = &self.plan().blocks[0].variants;
        let held_out = format!("{}{CROSS_VALIDATED}", id.key);
        // A basis that has seen the scenario flatters itself.
        let found = variants.iter().position(|name| *name == held_out);
        let found = found.or_else(|| variants.iter().position(|name| *name == id.key));
        found.ok_or_else(|| {
            let problem = format!("the data has no {}", id.name());
            let help = "its decomposition needs more scenarios: use more recordings, or another parameterization";
            Error::input(Place::item(self.data), problem, help)
        })
    }

    /// Whether a lane failed.
    pub(super) fn failed(&self, unit: usize, variant: usize, headway: usize) -> bool {
        let plan = self.plan();
        let lane = (unit * plan.blocks[0].variants.len() + variant) * plan.headways.len() + headway;
        self.verdicts[lane].failed(self.criterion)
    }

    pub(super) fn score(&self, variant: usize, options: &ScoreOptions) -> Scored {
        self.score_of(variant, options, &|_, _| true)
    }

    /// Scores of the lanes (unit, headway) for which `holds` is true.
    fn score_of(&self, variant: usize, options: &ScoreOptions, holds: &dyn Fn(usize, usize) -> bool) -> Scored {
        let of_unit = |unit: usize| {
            let mut counts = Confusion::<u32>::default();
            for headway in (0..self.plan().headways.len()).filter(|&headway| holds(unit, headway)) {
                counts.count(self.failed(unit, 0, headway), self.failed(unit, variant, headway));
            }
            counts
        };
        let units: Vec<Confusion<u32>> = (0..self.units()).map(of_unit).collect();
        let mut counts = Confusion::default();
        units.iter().for_each(|unit| counts.add(unit));
        let ends = |interval: Option<ScoreInterval>| interval.map(|interval| (interval.low, interval.high));
        let f1_interval = ends(f1_interval(units.iter(), options));
        // A share in one scenario has no interval.
        let options = &ScoreOptions { min_failures: options.min_failures.max(2), ..options.clone() };
        let share = |value, missed| Share { value, interval: ends(share_interval(units.iter(), missed, options)) };
        Scored {
            counts,
            failing_scenarios: units.iter().filter(|c| c.tp + c.fn_ > 0).count() as u64,
            recall: share(recall(&counts), |c| c.fn_),
            precision: share(precision(&counts), |c| c.fp),
            f1: Share { value: f1(&counts), interval: f1_interval },
        }
    }

    /// Scores by headway, by thirds of the ego's speed, and by thirds of the severity of the failures of S.
    pub(super) fn groups(
        &self,
        variant: usize,
        severity: &dyn Fn(usize, usize) -> f64,
        options: &ScoreOptions,
    ) -> Vec<Group> {
        let (plan, mut groups) = (self.plan(), Vec::new());
        for (at, headway) in plan.headways.iter().enumerate() {
            let scored = self.score_of(variant, options, &|_, headway| headway == at);
            groups.push(Group { by: "headway", name: headway.to_string(), scored });
        }
        let speeds: Vec<f64> = (0..self.units()).map(|unit| plan.case(0, unit as u64, 0).ego_speed).collect();
        let limits = thirds(speeds.clone());
        for third in 0..3 {
            let scored = self.score_of(variant, options, &|unit, _| third_of(speeds[unit], limits) == third);
            let name = interval_name(third, limits.map(|mps| mps * 3.6), "km/h");
            groups.push(Group { by: "ego speed", name, scored });
        }
        let lanes = (0..self.units()).flat_map(|unit| (0..plan.headways.len()).map(move |headway| (unit, headway)));
        let failing = lanes.filter(|&(unit, headway)| self.failed(unit, 0, headway));
        let severities: HashMap<(usize, usize), f64> =
            failing.map(|(unit, headway)| ((unit, headway), severity(unit, headway))).collect();
        let limits = thirds(severities.values().copied().collect());
        for (third, name) in ["least severe third", "middle third", "most severe third"].into_iter().enumerate() {
            let holds = |unit, headway| {
                severities.get(&(unit, headway)).is_some_and(|severity| third_of(*severity, limits) == third)
            };
            let scored = self.score_of(variant, options, &holds);
            groups.push(Group { by: "severity of S", name: name.to_owned(), scored });
        }
        groups
    }
}

/// Boundaries between the lower, middle and upper third of the values.
fn thirds(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let at = |share: usize| values.get(values.len() * share / 3).copied().unwrap_or(0.0);
    [at(1), at(2)]
}

fn third_of(value: f64, [low, high]: [f64; 2]) -> usize {
    usize::from(value >= low) + usize::from(value >= high && high > low)
}

fn interval_name(third: usize, [low, high]: [f64; 2], unit: &str) -> String {
    match third {
        0 => format!("below {low:.0} {unit}"),
        1 => format!("{low:.0} to {high:.0} {unit}"),
        _ => format!("from {high:.0} {unit} on"),
    }
}
