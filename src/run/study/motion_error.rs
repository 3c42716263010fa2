//! Root mean square errors of the motions of S', in standard deviations of the recorded series.

use lanesweep_engine::LaneCase;
use lanesweep_model::scenario::{Category, Tables};

/// Number of series: speed, distance from the lane's middle, speed of the vehicle ahead.
const SERIES: usize = 3;

/// Sums over scenarios.
#[derive(Debug, Clone, Default)]
pub(super) struct MotionSpread {
    count: f64,
    sums: [f64; SERIES],
    squares: [f64; SERIES],
}

/// Mean squared differences of one S' from S, summed over scenarios.
#[derive(Debug, Clone, Default)]
pub(super) struct MotionError {
    scenarios: f64,
    squares: [f64; SERIES],
}

impl MotionSpread {
    /// Adds the motions of a recorded scenario, at every step of its duration.
    pub(super) fn add(&mut self, recorded: &LaneCase<f64>, tables: &Tables<f64>) {
        for step in 0..=recorded.horizon {
            self.count += 1.0;
            for series in 0..SERIES {
                let value = value_of(recorded, tables, series, step);
                self.sums[series] += value;
                self.squares[series] += value * value;
            }
        }
    }

    fn variance(&self, series: usize) -> f64 {
        let mean = self.sums[series] / self.count;
        self.squares[series] / self.count - mean * mean
    }
}

impl MotionError {
    /// Adds the difference of a scenario.
    pub(super) fn add(&mut self, recorded: (&LaneCase<f64>, &Tables<f64>), replayed: (&LaneCase<f64>, &Tables<f64>)) {
        self.scenarios += 1.0;
        let steps = 0..=recorded.0.horizon;
        for series in 0..SERIES {
            let of = |step: u32| {
                let by =
                    value_of(replayed.0, replayed.1, series, step) - value_of(recorded.0, recorded.1, series, step);
                by * by
            };
            self.squares[series] += steps.clone().map(of).sum::<f64>() / f64::from(recorded.0.horizon + 1);
        }
    }

    /// The error, over the series of the category.
    pub(super) fn root(&self, category: Category, spread: &MotionSpread) -> f64 {
        let used: &[usize] = match category {
            Category::CutIn => &[0, 1],
            Category::CutOut => &[0, 1, 2],
            Category::Lvd => &[0],
        };
        let squares = used.iter().map(|series| self.squares[*series] / self.scenarios / spread.variance(*series));
        libm::sqrt(squares.sum::<f64>() / used.len() as f64)
    }
}

fn value_of(case: &LaneCase<f64>, tables: &Tables<f64>, series: usize, step: u32) -> f64 {
    match series {
        0 => case.others[0].motion.speed(tables, step),
        1 => case.others[0].motion.lateral(tables, step).position.abs(),
        _ => case.others[1].motion.speed(tables, step),
    }
}
