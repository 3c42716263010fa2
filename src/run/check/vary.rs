//! Variations of a case: seeded concrete cases inside ranges, at their ends, outside of them, and on the boundary between
//! two answers.

use super::subject::Subject;
use super::{CaseVerdicts, MAX_STEPS, StepBudget, Verdict};
use crate::model::profile::Profile;
use crate::random::Sobol;
use crate::run::grid::{MapParameter, Point};
use crate::scenario::{CaseQuantity, Category};
use crate::{Error, Place, Result};

/// A varied quantity with its range, in the unit of its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VariedRange {
    /// The quantity.
    pub parameter: &'static MapParameter,
    /// Minimum.
    pub from: f64,
    /// Maximum, above it.
    pub to: f64,
}

/// Numbers of cases by their place.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct VariationCounts {
    /// Inside all ranges.
    pub inside: u32,
    /// One quantity at an end of its range, the ends in turn.
    pub edge: u32,
    /// One quantity beyond an end, by up to a quarter of its range.
    pub outside: u32,
    /// Pairs on both sides of a boundary between two answers.
    pub boundary: u32,
}

/// A varied case.
#[derive(Debug, Clone, PartialEq)]
pub struct VariedCase {
    /// `inside-1`, `edge-1`, `outside-1`, `boundary-1a`, `boundary-1b`, …
    pub id: String,
    /// The case.
    pub subject: Subject,
}

/// What a variation found.
#[derive(Debug, Clone, PartialEq)]
pub struct Variations {
    /// The cases, those inside first.
    pub cases: Vec<VariedCase>,
    /// Points that are no case, such as a relative speed that makes a vehicle drive backwards.
    pub left_out: u32,
    /// Pairs that were asked for and not found: fewer neighbouring cases inside differ in their answer.
    pub missing_pairs: u32,
}

/// How far outside a case lies at most, in parts of the range.
const BEYOND: f64 = 0.25;
/// Distance of the two cases of a pair, in parts of every range.
const APART: f64 = 1e-3;

/// Varies a case of plain numbers. The same seed gives the same cases.
///
/// # Errors
/// [`Error::Usage`] without a range, for two ranges of one quantity, and for a recorded case, whose motions are series.
pub fn vary(
    subject: &Subject,
    ranges: &[VariedRange],
    counts: VariationCounts,
    seed: u64,
    profile: &Profile,
) -> Result<Variations> {
    if ranges.is_empty() {
        return Err(Error::usage(Place::option("range"), "nothing is to vary", "name a quantity: gap_m=10..40"));
    }
    MapParameter::refuse_repeats(&ranges.iter().map(|range| range.parameter).collect::<Vec<_>>())?;
    let has = |quantity| ranges.iter().any(|range| range.parameter.quantity == quantity);
    if has(CaseQuantity::Gap) && has(CaseQuantity::Thw) {
        let problem = "a gap and a time headway say the same twice";
        return Err(Error::usage(Place::option("range"), problem, "keep one of them"));
    }
    let sobol = Sobol::new(seed, ranges.len() as u32 + 1)?;
    let dimensions = ranges.len();
    let unit = |index: u64, dimension: usize| {
        let word = sobol.word(index, dimension as u32).unwrap_or_default();
        (f64::from(word) + 0.5) / 2_f64.powi(32)
    };
    let inside = |index: u64| -> Vec<f64> { (0..dimensions).map(|dimension| unit(index, dimension)).collect() };
    let moved = |index: u64, at: u32, beyond: f64| {
        let mut place = inside(index);
        place[at as usize % dimensions] =
            if (at as usize / dimensions).is_multiple_of(2) { -beyond } else { 1.0 + beyond };
        place
    };
    let (first_edge, first_outside) = (u64::from(counts.inside), u64::from(counts.inside) + u64::from(counts.edge));
    let places = (0..counts.inside).map(|k| (format!("inside-{}", k + 1), inside(u64::from(k))));
    let edges = (0..counts.edge).map(|k| (format!("edge-{}", k + 1), moved(first_edge + u64::from(k), k, 0.0)));
    let outside = (0..counts.outside).map(|k| {
        let index = first_outside + u64::from(k);
        // From a tenth of the way, so that rounding does not lead back.
        let beyond = BEYOND * (0.1 + 0.9 * unit(index, dimensions));
        (format!("outside-{}", k + 1), moved(index, k, beyond))
    });
    let mut found = Variations { cases: Vec::new(), left_out: 0, missing_pairs: 0 };
    let mut answered: Vec<(Vec<f64>, Verdict)> = Vec::new();
    for (id, place) in places.chain(edges).chain(outside) {
        match varied(subject, ranges, &place, profile) {
            Some((subject, verdict)) => {
                if id.starts_with("inside") {
                    answered.push((place, verdict));
                }
                found.cases.push(VariedCase { id, subject });
            }
            None => found.left_out += 1,
        }
    }
    for (number, pair) in pairs(&answered, counts.boundary as usize).into_iter().enumerate() {
        let Some((same, other)) = bisect(subject, ranges, pair, profile) else { continue };
        for (side, subject) in [("a", same), ("b", other)] {
            found.cases.push(VariedCase { id: format!("boundary-{}{side}", number + 1), subject });
        }
    }
    let of_boundary = found.cases.iter().filter(|case| case.id.starts_with("boundary")).count() as u32 / 2;
    found.missing_pairs = counts.boundary - of_boundary;
    Ok(found)
}

type Answered = (Vec<f64>, Verdict);

/// Neighbours with different answers, the nearest first; every case is in one pair at most.
fn pairs(answered: &[Answered], max: usize) -> Vec<[&Answered; 2]> {
    let distance = |a: &Answered, b: &Answered| a.0.iter().zip(&b.0).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let mut all = Vec::new();
    for (i, a) in answered.iter().enumerate() {
        let others = answered.iter().enumerate().skip(i + 1).filter(|(_, b)| a.1 != b.1);
        all.extend(others.map(|(j, b)| (distance(a, b), i, j)));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut used = vec![false; answered.len()];
    let mut found = Vec::new();
    for (_, i, j) in all {
        if found.len() < max && !used[i] && !used[j] {
            (used[i], used[j]) = (true, true);
            found.push([&answered[i], &answered[j]]);
        }
    }
    found
}

/// Two cases between those of a pair, on both sides of the nearest change of the answer that bisection finds.
fn bisect(
    subject: &Subject,
    ranges: &[VariedRange],
    [from, to]: [&Answered; 2],
    profile: &Profile,
) -> Option<(Subject, Subject)> {
    let at = |share: f64| -> Vec<f64> { from.0.iter().zip(&to.0).map(|(a, b)| a + share * (b - a)).collect() };
    let longest = from.0.iter().zip(&to.0).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (mut same, mut other) = (0.0, 1.0);
    while (other - same) * longest > APART {
        let middle = f64::midpoint(same, other);
        let (_, verdict) = varied(subject, ranges, &at(middle), profile)?;
        if verdict == from.1 { same = middle } else { other = middle }
    }
    let of = |share| varied(subject, ranges, &at(share), profile);
    let ((same, a), (other, b)) = (of(same)?, of(other)?);
    (a != b).then_some((same, other))
}

/// The case at a place in the ranges, and its answer; `None` if these numbers are no case.
fn varied(subject: &Subject, ranges: &[VariedRange], place: &[f64], profile: &Profile) -> Option<(Subject, Verdict)> {
    let Subject::Plain(case, from) = subject else { return None };
    let mut point: Point = *from;
    for (VariedRange { parameter, from, to }, share) in ranges.iter().zip(place) {
        // Micrometres and the like, so that a table has the numbers that ran.
        let value = ((from + share * (to - from)) * 1e6).round() / 1e6;
        if !(parameter.min..=parameter.max).contains(&value) {
            return None;
        }
        point.replace(parameter, value);
    }
    let mut point = point.resolved();
    // A leader deceleration begins at equal speeds, unless the leader's own speed varies or differs.
    let follows = from.get(CaseQuantity::EgoSpeed).filter(|_| case.category == Category::Lvd);
    if follows.is_some_and(|ego_mps| from.get(CaseQuantity::OtherSpeed) == Some(ego_mps))
        && ranges.iter().all(|range| range.parameter.quantity != CaseQuantity::OtherSpeed)
        && let Some(ego_mps) = point.get(CaseQuantity::EgoSpeed)
    {
        point = point.with(CaseQuantity::OtherSpeed, ego_mps);
    }
    let varied = Subject::Plain(*case, point);
    let lane = varied.lane(profile, varied.point()).ok()?;
    let budget = StepBudget { profile, left: std::cell::Cell::new(MAX_STEPS) };
    let verdicts: CaseVerdicts = super::verdicts(&lane, varied.point(), profile, case.category, &budget);
    Some((varied, verdicts.verdict()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Headway;
    use crate::scenario::CaseParameters;

    fn base() -> (Subject, Profile) {
        let profile = Profile::load("un-r157").unwrap();
        let mut case = CaseParameters {
            category: Some("cut-in".to_owned()),
            ego_speed: Some(20.0),
            speed: Some(12.0),
            gap: Some(20.0),
            lateral_speed: Some(1.0),
            ..CaseParameters::default()
        };
        let plain = case.checked_case(&profile.frame, &mut Default::default()).unwrap();
        (Subject::plain(&plain, Headway::GapM(20.0)), profile)
    }

    fn range(key: &str, from: f64, to: f64) -> VariedRange {
        VariedRange { parameter: MapParameter::find(Category::CutIn, key, "range").unwrap(), from, to }
    }

    #[test]
    fn variations_lie_where_their_names_say_and_a_seed_repeats_them() {
        let (subject, profile) = base();
        let ranges = [range("gap_m", 5.0, 45.0), range("lateral_speed_mps", 0.5, 2.0)];
        let counts = VariationCounts { inside: 32, edge: 8, outside: 8, boundary: 4 };
        let found = vary(&subject, &ranges, counts, 7, &profile).unwrap();
        assert_eq!(found, vary(&subject, &ranges, counts, 7, &profile).unwrap());
        assert_ne!(found.cases[0], vary(&subject, &ranges, counts, 8, &profile).unwrap().cases[0]);
        let places = |case: &VariedCase| {
            let [gap_m, lateral_mps] = [CaseQuantity::Gap, CaseQuantity::LateralSpeed]
                .map(|quantity| case.subject.point().get(quantity).unwrap());
            [(gap_m - 5.0) / 40.0, (lateral_mps - 0.5) / 1.5]
        };
        let within = |place: f64| (-1e-7..=1.0 + 1e-7).contains(&place);
        let of = |name: &str| {
            let cases = found.cases.iter().filter(|case| case.id.starts_with(name));
            cases.map(places).collect::<Vec<_>>()
        };
        assert!(of("inside").len() == 32 && of("inside").iter().flatten().all(|place| within(*place)));
        let at_end = |place: &f64| place.abs() < 1e-6 || (place - 1.0).abs() < 1e-6;
        assert!(
            of("edge").len() == 8 && of("edge").iter().all(|place| place.iter().filter(|p| at_end(p)).count() == 1)
        );
        assert_eq!(of("outside").len() as u32 + found.left_out, 8);
        assert!(of("outside").iter().all(|place| place.iter().filter(|p| !within(**p)).count() == 1));
    }

    /// Annex 3 has leaders that decelerate from the ego's speed.
    #[test]
    fn a_leader_that_starts_at_the_speed_of_the_ego_keeps_to_it() {
        let profile = Profile::load("un-r157").unwrap();
        let mut case = CaseParameters {
            category: Some("lvd".to_owned()),
            ego_speed: Some(20.0),
            gap: Some(30.0),
            acceleration: Some(-6.0),
            ..CaseParameters::default()
        };
        let plain = case.checked_case(&profile.frame, &mut Default::default()).unwrap();
        let subject = Subject::plain(&plain, Headway::GapM(30.0));
        let parameter = MapParameter::find(Category::Lvd, "ego_speed_kmh", "range").unwrap();
        let ranges = [VariedRange { parameter, from: 50.0, to: 110.0 }];
        let counts = VariationCounts { inside: 8, ..VariationCounts::default() };
        for case in vary(&subject, &ranges, counts, 1, &profile).unwrap().cases {
            let speed = |of| case.subject.point().get(of).unwrap();
            assert_eq!(speed(CaseQuantity::EgoSpeed), speed(CaseQuantity::OtherSpeed), "{}", case.id);
        }
    }

    #[test]
    fn the_cases_of_a_boundary_have_two_answers_and_lie_a_thousandth_of_the_range_apart() {
        let (subject, profile) = base();
        let ranges = [range("gap_m", 5.0, 45.0), range("lateral_speed_mps", 0.5, 2.0)];
        let counts = VariationCounts { inside: 64, boundary: 6, ..VariationCounts::default() };
        let found = vary(&subject, &ranges, counts, 1, &profile).unwrap();
        assert_eq!(found.missing_pairs, 0);
        let boundary: Vec<&VariedCase> = found.cases.iter().filter(|case| case.id.starts_with("boundary")).collect();
        let answer = |subject: &Subject| {
            let check = super::super::Check {
                subject: subject.clone(),
                profiles: vec![profile.clone()],
                models: crate::model::driver::ModelId::ALL.to_vec(),
            };
            check.run_without_boundaries().unwrap()[0].verdicts.verdict()
        };
        for pair in boundary.chunks(2) {
            let [a, b] = [0, 1].map(|at| &pair[at].subject);
            assert_ne!(answer(a), answer(b));
            let gap = |of: &Subject| of.point().get(CaseQuantity::Gap).unwrap();
            assert!((gap(a) - gap(b)).abs() <= 40.0 * APART + 1e-5);
        }
    }
}
