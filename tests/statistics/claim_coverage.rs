//! How often intervals of differences hold the truth and verdicts about claims are wrong, over 1,000 simulated studies
//! (minutes): `cargo test --release --test library claim_coverage:: -- --ignored --nocapture`

use lanesweep::engine::Confusion;
use lanesweep::run::score::{ClaimVerdict, Contrast, ScenarioRate, ScoreInterval, f1, min_contrast};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

const REPEATS: u64 = 1000;
/// As the claims and the answer of a study have it.
const MIN_FAILING: usize = 10;

#[derive(Clone)]
struct Population {
    /// Share of scenarios in which S fails from some headway.
    failing: f64,
    /// Share of these in which each parameterization is wrong.
    wrong: Vec<f64>,
    /// Parameterizations that the claim calls better; the others follow.
    better: usize,
    /// Share of scenarios in which all parameterizations err together.
    common: f64,
}

pub struct Uniform(pub ChaCha8Rng);

impl Uniform {
    pub fn new(seed: u64) -> Uniform {
        Uniform(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn next(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Headways at which S fails, of a scenario in which it does.
    pub fn failing(&mut self) -> i32 {
        1 + (10.0 * self.next() * self.next()) as i32
    }

    /// One or two headways more or fewer.
    pub fn shift(&mut self) -> i32 {
        let size = 1 + (2.0 * self.next()) as i32;
        if self.next() < 0.5 { size } else { -size }
    }
}

/// S and S' fail at the first of ten headways, each at so many.
pub fn confusion(s: i32, s_prime: i32) -> Confusion<u32> {
    let count = |n: i32| n.max(0) as u32;
    let (tp, fn_, fp) = (count(s.min(s_prime)), count(s - s_prime), count(s_prime - s));
    Confusion { tp, fn_, fp, tn: 10 - count(s.max(s_prime)) }
}

impl Population {
    fn scenario(&self, random: &mut Uniform) -> Vec<Confusion<u32>> {
        let s = if random.next() < self.failing { random.failing() } else { 0 };
        let (shared, is_shared) = ((random.next(), random.shift()), random.next() < self.common);
        let counts = |wrong: &f64| {
            let own = (random.next(), random.shift());
            let (chance, shift) = if is_shared { shared } else { own };
            let limit = if s > 0 { *wrong } else { 0.2 * wrong * self.failing };
            confusion(s, if chance < limit { (s + shift).clamp(0, 10) } else { s })
        };
        self.wrong.iter().map(counts).collect()
    }

    fn scenarios(&self, n: usize, random: &mut Uniform) -> Vec<Vec<Confusion<u32>>> {
        (0..n).map(|_| self.scenario(random)).collect()
    }

    /// Least F1 of the better less the largest of the others.
    fn difference<'a>(&self, scenarios: impl Iterator<Item = &'a Vec<Confusion<u32>>>) -> Option<f64> {
        let mut sums = vec![Confusion::<u64>::default(); self.wrong.len()];
        scenarios.for_each(|scenario| sums.iter_mut().zip(scenario).for_each(|(sum, counts)| sum.add(counts)));
        let scores = sums.iter().map(f1).collect::<Option<Vec<f64>>>()?;
        let (better, others) = scores.split_at(self.better);
        Some(better.iter().fold(f64::INFINITY, |a, b| a.min(*b)) - others.iter().fold(0.0, |a: f64, b| a.max(*b)))
    }

    fn truth(&self) -> f64 {
        // Equals do not differ; of a finite sample they would.
        let is_one = self.wrong.iter().all(|wrong| *wrong == self.wrong[0]);
        if is_one {
            0.0
        } else {
            self.difference(self.scenarios(400_000, &mut Uniform::new(1)).iter()).expect("failures")
        }
    }

    fn ours(&self, scenarios: &[Vec<Confusion<u32>>]) -> ScoreInterval {
        let rates: Vec<_> =
            (0..self.wrong.len()).map(|at| ScenarioRate::f1(scenarios.iter().map(|s| &s[at]))).collect();
        let pairs = (0..self.better).flat_map(|a| (self.better..rates.len()).map(move |b| Contrast::difference(a, b)));
        min_contrast(&rates, &pairs.collect::<Vec<_>>(), 0.95).expect("failures").1
    }
}

fn fails(scenario: &[Confusion<u32>]) -> bool {
    scenario[0].tp + scenario[0].fn_ > 0
}

/// Shares of repeats, per cent: intervals that hold the truth, false "holds", false "contradicted".
fn rates(truth: f64, intervals: &[ScoreInterval]) -> [f64; 3] {
    let share = |is: &dyn Fn(&ScoreInterval) -> bool| {
        100.0 * intervals.iter().filter(|interval| is(interval)).count() as f64 / intervals.len() as f64
    };
    let verdict = |interval: &ScoreInterval| ClaimVerdict::of_sign(*interval);
    [
        share(&|i| i.low <= truth + 1e-12 && truth - 1e-12 <= i.high),
        share(&|i| truth <= 0.0 && verdict(i) == ClaimVerdict::Holds),
        share(&|i| truth >= 0.0 && verdict(i) == ClaimVerdict::Contradicted),
    ]
}

#[test]
#[ignore = "long: cargo test --release --test library claim_coverage:: -- --ignored --nocapture"]
fn intervals_of_differences_hold() {
    let pairs =
        [[0.02, 0.02], [0.1, 0.1], [0.3, 0.3], [0.0, 0.02], [0.02, 0.1], [0.1, 0.3]].map(|wrong| (1, wrong.to_vec()));
    let several = [(2, vec![0.1; 5]), (1, vec![0.1; 5]), (2, vec![0.05, 0.05, 0.2, 0.2, 0.3, 0.3, 0.2])];
    println!(
        "better of, wrong | scenarios, failing, common, truth | held, false holds, false contradicted; mean width"
    );
    let mut missed = Vec::new();
    for (better, wrong) in pairs.into_iter().chain(several) {
        for (n, failing) in [(30, 0.3), (100, 0.3), (400, 0.05), (400, 0.3)] {
            for common in [0.0, 0.8] {
                let population = Population { failing, wrong: wrong.clone(), better, common };
                let truth = population.truth();
                let of = |repeat: u64| {
                    let scenarios = population.scenarios(n, &mut Uniform::new(1000 + repeat));
                    let failing = scenarios.iter().filter(|scenario| fails(scenario)).count();
                    (failing >= MIN_FAILING).then(|| population.ours(&scenarios))
                };
                let all: Vec<ScoreInterval> = (0..REPEATS).into_par_iter().filter_map(of).collect();
                let ours = rates(truth, &all);
                let width = all.iter().map(|i| i.high - i.low).sum::<f64>() / all.len() as f64;
                println!("{better} of {wrong:?} | {n} {failing} {common} {truth:.4} | {ours:5.1?} {width:.3}");
                if ours[0] < 94.0 || ours[1] > 3.5 || ours[2] > 3.5 {
                    missed.push((wrong.clone(), n, failing, common, ours));
                }
            }
        }
    }
    assert!(missed.is_empty(), "below 94 %, or more than 3.5 % of verdicts are wrong: {missed:?}");
}

/// A claim about twelve cells of one study: four drivers that fail the more often the more careless, three criteria of which
/// one failure often brings the next. The cells share their scenarios.
fn claim(population: &Population, n: usize, seed: u64) -> ClaimVerdict {
    let mut random = Uniform::new(seed);
    let scenarios = population.scenarios(n, &mut random);
    // A harder criterion and a more careful driver fail in fewer of the same scenarios.
    let mut cell = |at: u32| {
        let kept = 1.0 - 0.07 * f64::from(at);
        let mut cell = scenarios.clone();
        for scenario in cell.iter_mut().filter(|_| random.next() > kept) {
            scenario.iter_mut().for_each(|counts| *counts = Confusion { tn: 10, ..Confusion::default() });
        }
        cell
    };
    let cells: Vec<_> = (0..12).map(&mut cell).collect();
    let verdict = |cell: Vec<Vec<Confusion<u32>>>| match cell.iter().filter(|s| fails(s)).count() >= MIN_FAILING {
        true => ClaimVerdict::of_sign(population.ours(&cell)),
        false => ClaimVerdict::TooFew,
    };
    ClaimVerdict::of_cells(&cells.into_iter().map(verdict).collect::<Vec<_>>())
}

#[test]
#[ignore = "long: cargo test --release --test library claim_coverage:: -- --ignored --nocapture"]
fn verdicts_about_claims_are_seldom_wrong() {
    println!("better of, wrong | scenarios, truth | holds, contradicted, undecided, too few, per cent");
    let mut missed = Vec::new();
    for (better, wrong) in [
        (1, vec![0.1; 2]),
        (1, vec![0.1; 5]),
        (2, vec![0.1; 5]),
        (1, vec![0.02, 0.1, 0.1]),
        (1, vec![0.1, 0.02]),
        (1, vec![0.02, 0.5]),
    ] {
        for n in [40, 100, 400] {
            let population = Population { failing: 0.3, wrong: wrong.clone(), better, common: 0.4 };
            let truth = population.truth();
            let all: Vec<ClaimVerdict> =
                (0..REPEATS).into_par_iter().map(|repeat| claim(&population, n, 1000 + repeat)).collect();
            let share = |verdict| 100.0 * all.iter().filter(|one| **one == verdict).count() as f64 / all.len() as f64;
            let verdicts =
                [ClaimVerdict::Holds, ClaimVerdict::Contradicted, ClaimVerdict::Undecided, ClaimVerdict::TooFew];
            let ours = verdicts.map(share);
            println!("{better} of {wrong:?} | {n} {truth:.4} | {ours:5.1?}");
            let is_wrong = [truth <= 0.0 && ours[0] > 5.0, truth >= 0.0 && ours[1] > 5.0];
            if is_wrong.contains(&true) {
                missed.push((wrong.clone(), n, ours));
            }
        }
    }
    assert!(missed.is_empty(), "more than 5 % of verdicts are wrong: {missed:?}");
}
