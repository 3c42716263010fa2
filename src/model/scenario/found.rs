//! Scenarios as they are read: usable ones, errors of the others, and doubts.

use std::collections::{HashMap, HashSet};

use super::check::{Problem, admit, check, name, rates};
use super::{Category, Other, Scenario};
use crate::plausibility::{Doubts, Implausible};
use lanesweep_support::error::{Error, Place, Result};

/// At most one scenario in this many may be unusable; otherwise the file is probably not a scenario file.
const MAX_BAD_ONE_IN: u64 = 10;
/// Maximum number of errors listed individually.
const MAX_LISTED: usize = 20;
/// Maximum number of errors kept.
const MAX_KEPT: usize = 1000;

/// The content of a file of scenarios.
#[derive(Debug)]
pub struct ScenarioFile {
    /// Usable scenarios, in the order of the file.
    pub scenarios: Vec<Scenario>,
    /// Errors of the unusable scenarios, at most one in ten.
    pub problems: Vec<Error>,
    /// Doubts about the usable scenarios, as sentences.
    pub notes: Vec<String>,
}

/// Scenarios read so far, with the place of each id.
#[derive(Default)]
pub(super) struct ScenariosRead {
    scenarios: Vec<Scenario>,
    rows: HashMap<String, u64>,
    /// Ids that occurred more than once.
    doubled: HashSet<String>,
    problems: Vec<Error>,
    /// Scenarios skipped without an error of their own: those beyond the maximum number, and the first of two with the
    /// same id.
    more: u64,
    pub(super) doubts: Doubts,
    /// What to do about two scenarios with the same id.
    help: &'static str,
}

impl ScenariosRead {
    /// `help` says what to do about two scenarios with the same id.
    pub(super) fn new(implausible: Implausible, help: &'static str) -> ScenariosRead {
        ScenariosRead { doubts: Doubts::new(implausible), help, ..ScenariosRead::default() }
    }

    /// Number of scenarios so far, usable or not.
    pub(super) fn count(&self) -> u64 {
        (self.scenarios.len() - self.doubled.len()) as u64 + self.problems.len() as u64 + self.more
    }

    /// Adds a usable scenario whose id is new. `checked` has the doubts about values that it was made of; without it, its
    /// own are checked. `place` returns the place of a field, `word` is the unit of counting rows.
    pub(super) fn take(
        &mut self,
        mut scenario: Scenario,
        checked: Option<Doubts>,
        row: u64,
        word: &str,
        place: impl Fn(&str) -> Place,
    ) {
        let is_checked = checked.is_some();
        let mut doubts = checked.unwrap_or_else(|| self.doubts.another());
        let admitted = match is_checked {
            true => check(&scenario),
            false => admit(&mut scenario, &mut doubts, &|field| place(field).to_string()),
        };
        if let Err(Problem { field, problem, help }) = admitted {
            return self.refuse(Error::input(place(&field), problem, help));
        }
        if let Some(first) = self.rows.get(&scenario.id) {
            let problem = format!("this id belongs to {word} {first} too, but every scenario needs its own id");
            // It is unknown which of the two is meant, or one is a part of the other: both are skipped.
            self.more += u64::from(self.doubled.insert(scenario.id.clone()));
            return self.refuse(Error::input(place("id"), problem, self.help));
        }
        self.rows.insert(scenario.id.clone(), row);
        self.doubts.add(doubts);
        // Series grew by doubling; release the excess, because thousands are kept.
        for other in std::iter::once(&mut scenario.target).chain(&mut scenario.lead) {
            other.v.shrink_to_fit();
            other.y.shrink_to_fit();
        }
        self.scenarios.push(scenario);
    }

    /// Skips a scenario.
    pub(super) fn refuse(&mut self, error: Error) {
        if self.problems.len() < MAX_KEPT { self.problems.push(error) } else { self.more += 1 }
    }

    /// Returns the scenarios; `help` says what a file without scenarios should hold.
    ///
    /// # Errors
    /// [`Error::Input`] for a file without scenarios, and if more than one scenario in ten is unusable; it lists the
    /// problems up to a maximum number.
    pub(super) fn finish(mut self, file: Place, help: &str) -> Result<ScenarioFile> {
        let (total, bad) = (self.count(), self.problems.len() as u64 + self.more);
        if total == 0 {
            return Err(Error::input(file, "holds no scenario", help));
        }
        if bad * MAX_BAD_ONE_IN > total {
            let first_help = self.problems[0].help().unwrap_or_default();
            if bad == 1 {
                return Err(self.problems.swap_remove(0));
            }
            let more = bad.saturating_sub(MAX_LISTED as u64);
            let more = (more > 0).then(|| format!("\n- and {more} more"));
            let list: String =
                self.problems.iter().take(MAX_LISTED).map(|error| format!("\n- {error}")).chain(more).collect();
            let problem =
                format!("{bad} of {total} scenarios cannot be used, more than one in {MAX_BAD_ONE_IN}:{list}");
            return Err(Error::input(file, problem, first_help));
        }
        if self.more > 0 {
            let problem = format!("{} more scenarios cannot be used", self.more);
            self.problems.push(Error::input(file, problem, "correct the others first"));
        }
        Ok(self.file())
    }

    fn file(mut self) -> ScenarioFile {
        self.scenarios.retain(|scenario| !self.doubled.contains(&scenario.id));
        let mut notes = self.doubts.sentences();
        notes.extend(contradictions(&self.scenarios));
        ScenarioFile { scenarios: self.scenarios, problems: self.problems, notes }
    }
}

/// Mined scenarios by the rules for those of files: usable ones, errors of the others, and doubts.
pub fn usable(scenarios: Vec<Scenario>, implausible: Implausible) -> ScenarioFile {
    let mut read = ScenariosRead::new(implausible, "give every recording a name of its own");
    for (row, scenario) in (1..).zip(scenarios) {
        let of = Place::item(name(&scenario.id));
        read.take(scenario, None, row, "scenario", |field| of.clone().column(field));
    }
    read.file()
}

/// Maximum lateral motion that is not counted as a contradiction, m.
const LATERAL_NOISE_M: f64 = 0.5;
/// Maximum distance from the middle of the lane where a lane change is in it, in widths of the lane.
const IN_LANE_SHARE: f64 = 0.4;
/// Distance from the middle of the lane from which a vehicle is in another one, in widths of the lane.
const OTHER_LANE_SHARE: f64 = 0.75;
/// Changes that no vehicle makes between samples that are otherwise equal, m/s of a position and m/s² of a speed.
const STEPS: [f64; 2] = [1.5, 5.0];
/// Minimum number of such steps.
const MIN_STEPS: usize = 4;

/// Finds scenarios that say one thing twice and differently; one sentence per kind.
fn contradictions(scenarios: &[Scenario]) -> Vec<String> {
    type Rule<'a> = (&'a str, &'a dyn Fn(&Scenario) -> bool);
    let ends = |s: &Scenario| outside_and_inside(s).filter(|_| s.kept);
    let is_off = |s: &Scenario| ends(s).is_some_and(|(_, inside)| inside.abs() > IN_LANE_SHARE * s.lane_width);
    let is_inside = |s: &Scenario| ends(s).is_some_and(|(outside, _)| outside.abs() < IN_LANE_SHARE * s.lane_width);
    // Two lane changes may end beyond their lanes, or begin late; most of a category do not.
    let most = |is: &dyn Fn(&Scenario) -> bool| {
        Category::ALL.map(|category| {
            let of = || scenarios.iter().filter(|s| s.kept && s.category == category);
            (of().count() / 2).max(2) < of().filter(|s| is(s)).count()
        })
    };
    let (are_off, are_inside) = (most(&is_off), most(&is_inside));
    let others = |s: &Scenario, is: fn(&Other, &Scenario) -> bool| is(&s.target, s) || s.lead.iter().any(|o| is(o, s));
    let rules: [Rule; 9] = [
        (
            "lane change(s) move away from the ego's lane where they should enter it, or the reverse: y is the distance from its middle",
            &|s| ends(s).is_some_and(|(outside, inside)| inside.abs() > outside.abs() + LATERAL_NOISE_M),
        ),
        (
            "lane change(s) have a lateral position against their `side`: y is positive where the vehicle comes from or leaves to",
            &|s| ends(s).is_some_and(|(outside, _)| outside < -LATERAL_NOISE_M),
        ),
        ("kept scenario(s) are never in the ego's lane: y is the distance from its middle", &|s| {
            s.kept && others(s, |o, s| o.y.iter().all(|y| y.abs() > OTHER_LANE_SHARE * s.lane_width))
                || are_off[s.category as usize] && is_off(s)
        }),
        ("lane change(s) are in the ego's lane throughout: y is in m, from its middle", &|s| {
            are_inside[s.category as usize] && is_inside(s)
        }),
        (
            "scenario(s) have a vehicle that moves farther to the side than along the road: a speed is missing or another vehicle's",
            &|s| others(s, |o, s| across_m(o) > o.v.iter().sum::<f64>() / s.fps + LATERAL_NOISE_M),
        ),
        (
            "scenario(s) have a position or a speed that stands still between steps: give more digits, or `fps` as measured",
            &|s| others(s, |o, s| is_stepped(&o.y, s.fps, STEPS[0]) || is_stepped(&o.v, s.fps, STEPS[1])),
        ),
        (
            "scenario(s) have a `gap0` that is not `thw0` times `ego.v0`: one of them has another unit or scenario",
            &|s| {
                let both = s.gap0.zip(s.thw0).filter(|_| s.ego.v0 > 0.0);
                both.is_some_and(|(gap, thw)| (gap - thw * s.ego.v0).abs() > (0.05 * gap.abs()).max(0.5))
            },
        ),
        (
            "scenario(s) have not one sample per frame from `frame0` to `frame1`: if samples were left out, correct `fps` and both frames",
            &|s| s.frame1 > s.frame0 && s.frame1.abs_diff(s.frame0).abs_diff(s.target.v.len() as u64 - 1) > 1,
        ),
        (
            "scenario(s) have a `peak_decel` that the changes of `target.v` contradict: check its unit, and `fps`",
            &contradicts_its_peak,
        ),
    ];
    let sentence = |(text, applies): &Rule| {
        let (words, help) = text.split_once(':')?;
        let mut such = scenarios.iter().filter(|s| applies(s));
        let first = such.next()?;
        Some(format!("{} {words}, the first is scenario {}:{help}", such.count() + 1, first.id))
    };
    rules.iter().filter_map(sentence).collect()
}

/// Distance that a vehicle moves to the side, m.
fn across_m(other: &Other) -> f64 {
    (other.y[other.y.len() - 1] - other.y[0]).abs()
}

/// Lateral position of a lane change where it is out of the ego's lane, and where it is in it, m.
fn outside_and_inside(scenario: &Scenario) -> Option<(f64, f64)> {
    let y = &scenario.target.y;
    let (first, last) = (*y.first()?, *y.last()?);
    match scenario.category {
        Category::CutIn => Some((first, last)),
        Category::CutOut => Some((last, first)),
        Category::Lvd => None,
    }
}

/// Whether a series has equal values between changes that are all above a rate: values that were rounded or repeated.
fn is_stepped(series: &[f64], fps: f64, min_rate: f64) -> bool {
    let changes: Vec<f64> = rates(series, 1, fps).map(f64::abs).skip_while(|change| *change == 0.0).collect();
    let end = changes.iter().rposition(|change| *change > 0.0).map_or(0, |last| last + 1);
    let steps = || changes[..end].iter().filter(|change| **change > 0.0);
    (MIN_STEPS..=end / 2).contains(&steps().count()) && steps().all(|change| *change > min_rate)
}

/// Whether the recorded peak exceeds every change of a sample, or changes of half a second exceed it, by half and 1 m/s².
fn contradicts_its_peak(scenario: &Scenario) -> bool {
    let Some(peak) = scenario.peak_decel else { return false };
    let half_second = (scenario.fps / 2.0).round().max(1.0) as usize;
    let largest = |n| rates(&scenario.target.v, n, scenario.fps).fold(0.0, |a: f64, b| a.max(-b));
    peak > 1.5 * largest(1) + 1.0 || largest(half_second) > 1.5 * peak.max(0.0) + 1.0
}
