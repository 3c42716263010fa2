//! Scenarios that stand twice in the data: a copy of a file, a simulation without a seed, a table that was joined twice. Each copy
//! would narrow every interval, and a density that is fitted to them.

use lanesweep_model::scenario::{Other, Scenario};

/// Scenarios whose numbers differ by less are near copies: m, m/s, s.
const NEAR: f64 = 0.06;

/// What happens in a scenario, as numbers, whatever it is called.
fn numbers(of: &Scenario) -> impl Iterator<Item = f64> {
    let series = |other: &Other| {
        let sizes = [other.length, other.width, other.v.len() as f64];
        sizes.into_iter().chain(other.v.clone()).chain(other.y.clone()).collect::<Vec<f64>>()
    };
    let known = |value: Option<f64>| value.unwrap_or(-1e9);
    let category = f64::from(of.category as u8);
    let [v, length, width] = [of.ego.v0, of.ego.length, of.ego.width];
    let plain = [v, category, of.side.sign(), of.fps, length, width, of.lane_width, known(of.start_gap_m().ok())];
    let others = std::iter::once(&of.target).chain(&of.lead).flat_map(series);
    plain.into_iter().chain([known(of.lead_gap)]).chain(others)
}

/// Leaves out scenarios that are equal to an earlier one but for their names. Returns sentences about them, and about near copies.
pub(crate) fn leave_out_copies(scenarios: &mut Vec<Scenario>) -> Vec<String> {
    // Numbers that are close have close sums.
    let start = |of: &Scenario| [of.ego.v0, of.start_gap_m().unwrap_or(0.0), of.target.v[0]];
    let sum = |[ego, gap, target]: [f64; 3]| ego + 1.732_050_8 * gap + 2.236_068 * target;
    let mut order: Vec<([f64; 3], usize)> = scenarios.iter().map(start).zip(0..).collect();
    order.sort_by(|a, b| sum(a.0).total_cmp(&sum(b.0)).then(a.1.cmp(&b.1)));
    let differ = |a, b| numbers(a).zip(numbers(b)).any(|(a, b)| (a - b).abs() > NEAR);
    let mut is_copy = vec![false; scenarios.len()];
    let (mut copies, mut near) = (Vec::new(), Vec::new());
    for (at, &(start, first)) in order.iter().enumerate() {
        let is_near = |(other, _): &&([f64; 3], usize)| sum(*other) - sum(start) <= 5.0 * NEAR;
        for &(other, second) in order[at + 1..].iter().take_while(is_near) {
            let is_far = start.iter().zip(other).any(|(a, b)| (a - b).abs() > NEAR);
            let (a, b) = (&scenarios[first], &scenarios[second]);
            if is_far || is_copy[first] || is_copy[second] || differ(a, b) {
                continue;
            }
            let (earlier, later) = (first.min(second), first.max(second));
            is_copy[later] = numbers(a).eq(numbers(b));
            let list = if is_copy[later] { &mut copies } else { &mut near };
            let [earlier, again] = [earlier, later].map(|at| &scenarios[at]);
            let hours = if earlier.recording == again.recording { "" } else { "; the hours of both recordings count" };
            list.push((later, format!("{} is {}{hours}", again.id, earlier.id)));
        }
    }
    let mut place = 0..;
    scenarios.retain(|_| place.next().is_some_and(|at| !is_copy[at]));
    let say = |mut list: Vec<(usize, String)>, what: &str| {
        list.sort();
        list.dedup_by_key(|(later, _)| *later);
        let number = list.len();
        list.into_iter().next().map(|(_, first)| format!("{number} scenario(s) {what}, the first: {first}"))
    };
    let copies = say(copies, "are equal to another one but for their names and count once");
    let near = say(near, "differ from another one by less than 6 cm and 0.06 m/s: is a recording there twice?");
    copies.into_iter().chain(near).collect()
}
