//! Checks that types cannot express: lengths, signs, what a category needs, and what is plausible on a road.

use super::{Category, Other, Scenario};
use lanesweep_support::error::{Error, Place, Result};
use lanesweep_support::plausibility::{Doubts, HELP, Quantity};

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
            return Err(Problem {
                field: field.into(),
                problem: format!("has {} bytes; expected at most {MAX_ID_BYTES}", text.len()),
                help: "give it a shorter name",
            });
        }
    }
    expect((MIN_RATE_HZ..=MAX_MAGNITUDE).contains(&s.fps), "fps", s.fps, "a number of at least 0.1 and at most 1e6")?;
    above_zero("lane_width", s.lane_width)?;
    at_least_zero("ego.v0", s.ego.v0)?;
    above_zero("ego.length", s.ego.length)?;
    above_zero("ego.width", s.ego.width)?;
    let samples = s.target.v.len();
    if samples < 2 {
        return Err(Problem {
            field: "target.v".into(),
            problem: format!("{samples} samples, but a scenario needs at least 2"),
            help: "remove the scenario or export its whole series",
        });
    }
    check_other("target", &s.target, samples)?;
    if let Some(lead) = &s.lead {
        check_other("lead", lead, samples)?;
    }
    for (field, value) in [("thw0", s.thw0), ("gap0", s.gap0), ("D", s.lead_gap), ("peak_decel", s.peak_decel)] {
        value.map_or(Ok(()), |value| finite(field, value))?;
        // The target of a cut-in may begin beside the ego.
        let is_ahead = field == "D" || (field != "peak_decel" && s.category != Category::CutIn);
        let (value, what) = (value.unwrap_or(0.0), "at least 0: a vehicle beside or behind is not ahead");
        expect(!is_ahead || value >= 0.0, field, value, what)?;
    }
    if s.category == Category::CutOut && s.kept && (s.lead.is_none() || s.lead_gap.is_none()) {
        return Err(Problem {
            field: if s.lead.is_none() { "lead" } else { "D" }.into(),
            problem: "absent, but a kept cut-out needs a vehicle ahead".into(),
            help: "give the vehicle ahead (`lead`) and the gap to it (`D`), or set `kept` to false",
        });
    }
    Ok(())
}

fn check_other(role: &str, other: &Other, samples: usize) -> std::result::Result<(), Problem> {
    above_zero(&format!("{role}.length"), other.length)?;
    above_zero(&format!("{role}.width"), other.width)?;
    for (field, series) in [("v", &other.v), ("y", &other.y)] {
        if series.len() != samples {
            return Err(Problem {
                field: format!("{role}.{field}"),
                problem: format!("{} samples, but `target.v` has {samples}", series.len()),
                help: "all series of a scenario cover the same samples, frame0 to frame1",
            });
        }
    }
    for (k, &v) in other.v.iter().enumerate() {
        at_least_zero(&format!("{role}.v[{k}]"), v)?;
    }
    for (k, &y) in other.y.iter().enumerate() {
        finite(&format!("{role}.y[{k}]"), y)?;
    }
    Ok(())
}

/// Maximum length of a scenario or recording name: a file name plus some words.
const MAX_ID_BYTES: usize = 512;

/// Minimum sample rate, Hz: a lower one cannot resolve a motion.
const MIN_RATE_HZ: f64 = 0.1;

/// Maximum magnitude of a physical length, speed or rate; beyond it, squares in the lane arithmetic lose their meaning.
const MAX_MAGNITUDE: f64 = 1e6;

fn finite(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(value.abs() <= MAX_MAGNITUDE, field, value, "a number between -1e6 and 1e6")
}

fn at_least_zero(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(
        (0.0..=MAX_MAGNITUDE).contains(&value),
        field,
        value,
        "a number of at least 0 and at most 1e6 (a speed above -0.5 counts as 0)",
    )
}

fn above_zero(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(value > 0.0 && value <= MAX_MAGNITUDE, field, value, "a number above 0 and at most 1e6")
}

fn expect(holds: bool, field: &str, value: f64, what: &str) -> std::result::Result<(), Problem> {
    if holds {
        return Ok(());
    }
    Err(Problem {
        field: field.into(),
        problem: format!("is {value}; expected {what}"),
        help: "correct the value or remove the scenario",
    })
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
    let mut check_plausible = |quantity, field: &str, value, words: &dyn Fn(String) -> String| {
        let judged = doubts.check(quantity, value, || place(field));
        judged.map_err(|text| Problem { field: field.to_owned(), problem: words(text), help: HELP.as_str() })
    };
    let is = |text: String| text;
    check_plausible(Quantity::Rate, "fps", s.fps, &is)?;
    check_plausible(Quantity::LaneWidth, "lane_width", s.lane_width, &is)?;
    check_plausible(Quantity::Speed, "ego.v0", s.ego.v0, &is)?;
    check_plausible(Quantity::Length, "ego.length", s.ego.length, &is)?;
    check_plausible(Quantity::Width, "ego.width", s.ego.width, &is)?;
    for (field, quantity, value) in
        [("gap0", Quantity::Gap, s.gap0), ("D", Quantity::Gap, s.lead_gap), ("thw0", Quantity::Headway, s.thw0)]
    {
        value.map_or(Ok(()), |value| check_plausible(quantity, field, value, &is))?;
    }
    for (role, other) in [("target", Some(&s.target)), ("lead", s.lead.as_ref())] {
        let Some(other) = other else { continue };
        check_plausible(Quantity::Length, &format!("{role}.length"), other.length, &is)?;
        check_plausible(Quantity::Width, &format!("{role}.width"), other.width, &is)?;
        let mut worst =
            |quantity, series: &str, values: &mut dyn Iterator<Item = f64>, words: &dyn Fn(String) -> String| {
                let Some((k, value)) = farthest(quantity, values) else { return Ok(()) };
                check_plausible(quantity, &format!("{role}.{series}[{k}]"), value, words)
            };
        worst(Quantity::Speed, "v", &mut other.v.iter().copied(), &is)?;
        worst(Quantity::LateralPosition, "y", &mut other.y.iter().copied(), &is)?;
        let jump = |text: String| format!("lateral jump: {text}");
        worst(Quantity::LateralSpeed, "y", &mut rates(&other.y, 1, s.fps), &jump)?;
        // Changes are taken over one second, because single samples of recorded speeds are noisy.
        let second = (s.fps.round() as usize).max(1);
        let mean = |text: String| format!("mean of a second: {text}");
        worst(Quantity::Acceleration, "v", &mut rates(&other.v, second, s.fps), &mean)?;
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
