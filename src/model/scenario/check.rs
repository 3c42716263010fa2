//! Checks that types cannot express: lengths, signs, what a category needs, and what is plausible on a road.

use super::{Category, Other, Scenario};
use crate::plausibility::{Doubts, HELP, NEAR_M, Quantity};
use lanesweep_support::error::{Error, Place, Result};

/// Refuses a scenario that could not be read back: JSON writes NaN as null, for instance. A recording may hold speeds
/// and accelerations outside the range of scenarios.
pub(super) fn check_written(scenario: &Scenario) -> Result<()> {
    check(scenario).map_err(|p| {
        let place = Place::item(name(&scenario.id)).column(p.field);
        let problem = format!("{} cannot be written", p.problem);
        Error::input(place, problem, "correct the data that it was made of, or leave them out")
    })
}

/// Why readers would refuse the scenario, as a sentence; `None` if they would not.
pub fn problem_of(scenario: &Scenario) -> Option<String> {
    check(scenario).err().map(|p| format!("`{}` {}", p.field, p.problem))
}

/// Name of a scenario in messages.
pub(super) fn name(id: &str) -> String {
    format!("scenario {id}")
}

/// A problem and its field.
pub(super) struct Problem {
    pub field: String,
    pub problem: String,
    pub help: &'static str,
}

/// Checks what the types cannot express: lengths, signs and what a category needs.
pub(super) fn check(scenario: &Scenario) -> std::result::Result<(), Problem> {
    let s = scenario;
    for (field, text) in [("id", &s.id), ("recording", &s.recording)] {
        if text.len() > MAX_ID_BYTES {
            let problem = format!("has {} bytes; expected at most {MAX_ID_BYTES}", text.len());
            return Err(Problem { field: field.into(), problem, help: "give it a shorter name" });
        }
    }
    expect((MIN_RATE_HZ..=MAX_MAGNITUDE).contains(&s.fps), "fps", s.fps, "a number of at least 0.1 and at most 1e6")?;
    Bound::AboveZero.check("lane_width", s.lane_width)?;
    Bound::AtLeastZero.check("ego.v0", s.ego.v0)?;
    Bound::AboveZero.check("ego.length", s.ego.length)?;
    Bound::AboveZero.check("ego.width", s.ego.width)?;
    let samples = s.target.v.len();
    if samples < 2 {
        let problem = format!("{samples} samples, but a scenario needs at least 2");
        let help = "remove the scenario or export its whole series";
        return Err(Problem { field: "target.v".into(), problem, help });
    }
    check_other("target", &s.target, samples)?;
    if let Some(lead) = &s.lead {
        check_other("lead", lead, samples)?;
    }
    for (field, value) in [("thw0", s.thw0), ("gap0", s.gap0), ("D", s.lead_gap), ("peak_decel", s.peak_decel)] {
        value.map_or(Ok(()), |value| Bound::Finite.check(field, value))?;
        // The target of a cut-in may begin beside the ego.
        let is_ahead = field == "D" || (field != "peak_decel" && s.category != Category::CutIn);
        let (value, what) = (value.unwrap_or(0.0), "at least 0: a vehicle beside or behind is not ahead");
        expect(!is_ahead || value >= 0.0, field, value, what)?;
    }
    if s.category == Category::CutOut && s.kept && (s.lead.is_none() || s.lead_gap.is_none()) {
        let field = if s.lead.is_none() { "lead" } else { "D" }.into();
        let help = "give the vehicle ahead (`lead`) and the gap to it (`D`), or set `kept` to false";
        return Err(Problem { field, problem: "absent, but a kept cut-out needs a vehicle ahead".into(), help });
    }
    Ok(())
}

fn check_other(role: &str, other: &Other, samples: usize) -> std::result::Result<(), Problem> {
    Bound::AboveZero.check(&format!("{role}.length"), other.length)?;
    Bound::AboveZero.check(&format!("{role}.width"), other.width)?;
    for (field, series) in [("v", &other.v), ("y", &other.y)] {
        if series.len() != samples {
            let problem = format!("{} samples, but `target.v` has {samples}", series.len());
            let help = "all series of a scenario cover the same samples, frame0 to frame1";
            return Err(Problem { field: format!("{role}.{field}"), problem, help });
        }
    }
    for (k, &v) in other.v.iter().enumerate() {
        Bound::AtLeastZero.check(&format!("{role}.v[{k}]"), v)?;
    }
    for (k, &y) in other.y.iter().enumerate() {
        Bound::Finite.check(&format!("{role}.y[{k}]"), y)?;
    }
    Ok(())
}

/// Maximum length of a scenario or recording name: a file name plus some words.
const MAX_ID_BYTES: usize = 512;

/// Minimum sample rate, Hz: a lower one cannot resolve a motion.
const MIN_RATE_HZ: f64 = 0.1;

/// Maximum magnitude of a physical length, speed or rate; beyond it, squares in the lane arithmetic lose their meaning.
const MAX_MAGNITUDE: f64 = 1e6;
/// Shortest and longest duration of a case, s: the longest is the time cap of the paper's profile.
pub(super) const DURATIONS_S: (f64, f64) = (0.1, 120.0);

/// What a number of a scenario or a case can be.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Bound {
    Finite,
    AtLeastZero,
    AboveZero,
    Duration,
}

impl Bound {
    pub(super) fn holds(self, value: f64) -> bool {
        let is_in = match self {
            Bound::Finite => true,
            Bound::AtLeastZero => value >= 0.0,
            Bound::AboveZero => value > 0.0,
            Bound::Duration => (DURATIONS_S.0..=DURATIONS_S.1).contains(&value),
        };
        is_in && value.abs() <= MAX_MAGNITUDE
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Bound::Finite => "a number between -1e6 and 1e6",
            Bound::AtLeastZero => "a number of at least 0 and at most 1e6",
            Bound::AboveZero => "a number above 0 and at most 1e6",
            Bound::Duration => "seconds of at least 0.1 and at most 120",
        }
    }

    fn check(self, field: &str, value: f64) -> std::result::Result<(), Problem> {
        let still = if self == Bound::AtLeastZero { " (a speed above -0.5 counts as 0)" } else { "" };
        expect(self.holds(value), field, value, &format!("{}{still}", self.words()))
    }
}

fn expect(holds: bool, field: &str, value: f64, what: &str) -> std::result::Result<(), Problem> {
    if holds {
        return Ok(());
    }
    let problem = format!("is {value}; expected {what}");
    Err(Problem { field: field.into(), problem, help: "correct the value or remove the scenario" })
}

/// Admits a scenario that was read: sets noise of standing vehicles to 0, refuses errors, and counts implausible
/// values. `place` returns the place of a field.
pub(super) fn admit(
    scenario: &mut Scenario,
    doubts: &mut Doubts,
    place: &dyn Fn(&str) -> String,
) -> std::result::Result<(), Problem> {
    scenario.ego.v0 = doubts.speed(scenario.ego.v0, || place("ego.v0"));
    for (role, other) in [("target", Some(&mut scenario.target)), ("lead", scenario.lead.as_mut())] {
        for (k, v) in other.into_iter().flat_map(|other| other.v.iter_mut().enumerate()) {
            *v = doubts.speed(*v, || place(&format!("{role}.v[{k}]")));
        }
    }
    check(scenario)?;
    let s = &*scenario;
    let check_plausible = |doubts: &mut Doubts, quantity, field: &str, value, prefix: &str| {
        let checked = doubts.check(quantity, value, || place(field));
        checked.map_err(|text| Problem {
            field: field.to_owned(),
            problem: format!("{prefix}{text}"),
            help: HELP.as_str(),
        })
    };
    let numbers = [
        (Quantity::Rate, "fps", Some(s.fps)),
        (Quantity::LaneWidth, "lane_width", Some(s.lane_width)),
        (Quantity::Speed, "ego.v0", Some(s.ego.v0)),
        (Quantity::Gap, "gap0", s.gap0),
        (Quantity::Gap, "D", s.lead_gap),
        (Quantity::Headway, "thw0", s.thw0.filter(|thw_s| (thw_s * s.ego.v0).abs() > NEAR_M)),
    ];
    for (quantity, field, value) in numbers {
        value.map_or(Ok(()), |value| check_plausible(doubts, quantity, field, value, ""))?;
    }
    let others = [("target", Some(&s.target)), ("lead", s.lead.as_ref())];
    let others = others.into_iter().filter_map(|(role, other)| Some((role, other?)));
    let sizes = others.clone().map(|(role, other)| (role, other.length, other.width));
    for (role, length_m, width_m) in sizes.chain([("ego", s.ego.length, s.ego.width)]) {
        let [length, width] = ["length", "width"].map(|of| format!("{role}.{of}"));
        check_plausible(doubts, Quantity::Length, &length, length_m, "")?;
        check_plausible(doubts, Quantity::Width, &width, width_m, "")?;
        doubts.check_shape(length_m, width_m, || place(&length));
    }
    for (role, other) in others {
        let mut worst = |quantity, series: &str, values: &mut dyn Iterator<Item = f64>, prefix: &str| {
            let Some((k, value)) = farthest(quantity, values) else { return Ok(()) };
            check_plausible(doubts, quantity, &format!("{role}.{series}[{k}]"), value, prefix)
        };
        worst(Quantity::Speed, "v", &mut other.v.iter().copied(), "")?;
        worst(Quantity::LateralPosition, "y", &mut other.y.iter().copied(), "")?;
        worst(Quantity::LateralSpeed, "y", &mut rates(&other.y, 1, s.fps), "lateral jump: ")?;
        // Changes are taken over one second, because single samples of recorded speeds are noisy.
        let second = (s.fps.round() as usize).max(1);
        worst(Quantity::Acceleration, "v", &mut rates(&other.v, second, s.fps), "mean of a second: ")?;
    }
    Ok(())
}

/// Changes over `n` samples, per second.
pub(super) fn rates(series: &[f64], n: usize, fps: f64) -> impl Iterator<Item = f64> {
    series.iter().zip(series.iter().skip(n)).map(move |(before, after)| (after - before) * fps / n as f64)
}

/// The value farthest outside the plausible range, and its index.
fn farthest(quantity: Quantity, values: &mut dyn Iterator<Item = f64>) -> Option<(usize, f64)> {
    let (min, max) = quantity.limits().plausible;
    let beyond = |value: f64| (min - value).max(value - max);
    values.enumerate().max_by(|(_, a), (_, b)| beyond(*a).total_cmp(&beyond(*b)))
}
