//! Scenarios as they are read: usable ones, errors of the others, and doubts.

use std::collections::{HashMap, HashSet};

use super::check::{Problem, admit, name};
use super::{Category, Scenario};
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
pub(super) struct ScenariosRead {
    scenarios: Vec<Scenario>,
    rows: HashMap<String, u64>,
    /// Ids that occurred more than once.
    doubled: HashSet<String>,
    problems: Vec<Error>,
    /// Scenarios skipped without an error of their own: those beyond the maximum number, and the first of two with the
    /// same id.
    more: u64,
    doubts: Doubts,
    /// What to do about two scenarios with the same id.
    help: &'static str,
}

impl ScenariosRead {
    /// `help` says what to do about two scenarios with the same id.
    pub(super) fn new(implausible: Implausible, help: &'static str) -> ScenariosRead {
        let doubts = Doubts::new(implausible);
        ScenariosRead {
            scenarios: Vec::new(),
            rows: HashMap::new(),
            doubled: HashSet::new(),
            problems: Vec::new(),
            more: 0,
            doubts,
            help,
        }
    }

    /// Number of scenarios so far, usable or not.
    pub(super) fn count(&self) -> u64 {
        (self.scenarios.len() - self.doubled.len()) as u64 + self.problems.len() as u64 + self.more
    }

    /// Starts the doubts about the next scenario.
    pub(super) fn doubts(&self) -> Doubts {
        self.doubts.another()
    }

    /// Adds doubts found before the scenario was built.
    pub(super) fn add_doubts(&mut self, doubts: Doubts) {
        self.doubts.add(doubts);
    }

    /// Adds a usable scenario whose id is new. `place` returns the place of a field, `word` is the unit of counting
    /// rows.
    pub(super) fn take(&mut self, mut scenario: Scenario, row: u64, word: &str, place: impl Fn(&str) -> Place) {
        let mut doubts = self.doubts();
        let admitted = admit(&mut scenario, &mut doubts, &|field| place(field).to_string());
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
        self.scenarios.retain(|scenario| !self.doubled.contains(&scenario.id));
        self.doubled.clear();
        let (total, bad) = (self.count(), self.problems.len() as u64 + self.more);
        if total == 0 {
            return Err(Error::input(file, "holds no scenario", help));
        }
        if bad * MAX_BAD_ONE_IN > total {
            let first_help = self.problems[0].help().unwrap_or_default();
            if bad == 1 {
                return Err(self.problems.swap_remove(0));
            }
            let mut problem = format!("{bad} of {total} scenarios cannot be used, more than one in {MAX_BAD_ONE_IN}:");
            for error in self.problems.iter().take(MAX_LISTED) {
                problem.push_str(&format!("\n- {error}"));
            }
            if bad > MAX_LISTED as u64 {
                problem.push_str(&format!("\n- and {} more", bad - MAX_LISTED as u64));
            }
            return Err(Error::input(file, problem, first_help));
        }
        if self.more > 0 {
            let problem = format!("{} more scenarios cannot be used", self.more);
            self.problems.push(Error::input(file, problem, "correct the others first"));
        }
        let mut notes = self.doubts.sentences();
        notes.extend(contradictions(&self.scenarios));
        Ok(ScenarioFile { scenarios: self.scenarios, problems: self.problems, notes })
    }
}

/// Mined scenarios by the rules for those of files: usable ones, errors of the others, and doubts.
pub fn usable(scenarios: Vec<Scenario>, implausible: Implausible) -> ScenarioFile {
    let mut read = ScenariosRead::new(implausible, "give every recording a name of its own");
    for (row, scenario) in scenarios.into_iter().enumerate() {
        let of = Place::item(name(&scenario.id));
        read.take(scenario, row as u64 + 1, "scenario", |field| of.clone().column(field));
    }
    read.scenarios.retain(|scenario| !read.doubled.contains(&scenario.id));
    let mut notes = read.doubts.sentences();
    notes.extend(contradictions(&read.scenarios));
    ScenarioFile { scenarios: read.scenarios, problems: read.problems, notes }
}

/// Maximum lateral motion that is not counted as a contradiction, m.
const LATERAL_NOISE_M: f64 = 0.5;
/// Maximum distance from the middle of the lane where a lane change is in it, in widths of the lane.
const IN_LANE_SHARE: f64 = 0.4;

/// Finds scenarios that say one thing twice and differently; one sentence per kind.
fn contradictions(scenarios: &[Scenario]) -> Vec<String> {
    type Rule<'a> = (&'a str, &'a str, &'a dyn Fn(&Scenario) -> bool);
    let ends = |s: &Scenario| outside_and_inside(s).filter(|_| s.kept);
    let is_off = |s: &Scenario| ends(s).is_some_and(|(_, inside)| inside.abs() > IN_LANE_SHARE * s.lane_width);
    // Two lane changes may end beyond their lanes; most of a category do not.
    let are_off = Category::ALL.map(|category| {
        let of = || scenarios.iter().filter(|s| s.kept && s.category == category);
        (of().count() / 2).max(2) < of().filter(|s| is_off(s)).count()
    });
    const MIDDLE: &str = "y is the distance from the middle of the ego's lane";
    let rules: [Rule; 6] = [
        ("lane change(s) move away from the ego's lane where they should enter it, or the reverse", MIDDLE, &|s| {
            ends(s).is_some_and(|(outside, inside)| inside.abs() > outside.abs() + LATERAL_NOISE_M)
        }),
        (
            "lane change(s) have a lateral position against their `side`",
            "y is positive on the side that the vehicle comes from or leaves to",
            &|s| ends(s).is_some_and(|(outside, _)| outside < -LATERAL_NOISE_M),
        ),
        ("kept lane change(s) are never in the ego's lane", MIDDLE, &|s| are_off[s.category as usize] && is_off(s)),
        (
            "scenario(s) have a `gap0` that is not `thw0` times `ego.v0`",
            "one of the three has another unit or belongs to another scenario",
            &|s| {
                let both = s.gap0.zip(s.thw0).filter(|_| s.ego.v0 > 0.0);
                both.is_some_and(|(gap, thw)| (gap - thw * s.ego.v0).abs() > (0.05 * gap.abs()).max(0.5))
            },
        ),
        (
            "scenario(s) have not one sample per frame from `frame0` to `frame1`",
            "samples were left out or added; then `fps` and both frames change too",
            &|s| s.frame1 > s.frame0 && s.frame1.abs_diff(s.frame0).abs_diff(s.target.v.len() as u64 - 1) > 1,
        ),
        (
            "scenario(s) have a `peak_decel` that the changes of `target.v` contradict",
            "the series has another unit, or `fps` is not its rate",
            &contradicts_its_peak,
        ),
    ];
    let sentence = |(words, help, applies): &Rule| {
        let mut such = scenarios.iter().filter(|s| applies(s));
        let first = such.next()?;
        Some(format!("{} {words}, the first is scenario {}: {help}", such.count() + 1, first.id))
    };
    rules.iter().filter_map(sentence).collect()
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

/// Whether the recorded peak exceeds every change of a sample, or changes of half a second exceed it, by half and 1 m/s².
fn contradicts_its_peak(scenario: &Scenario) -> bool {
    let Some(peak) = scenario.peak_decel else { return false };
    let half_second = (scenario.fps / 2.0).round().max(1.0) as usize;
    let largest = |n| super::check::rates(&scenario.target.v, n, scenario.fps).fold(0.0, |a: f64, b| a.max(-b));
    peak > 1.5 * largest(1) + 1.0 || largest(half_second) > 1.5 * peak.max(0.0) + 1.0
}
