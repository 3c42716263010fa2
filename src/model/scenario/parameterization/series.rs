//! Resampling of series on other time grids, cases that consist of series, and the numbers that kinematic
//! parameterizations derive from them.

use super::options::{AfterDuration, LateralSpeed, ParameterizationOptions};
use super::sizes::{Sizes, vehicle_ahead};
use crate::profile::Profile;
use crate::scenario::{Case, Category, Lateral, Other, Scenario, Speed};
use lanesweep_support::Result;

/// Value of a series of rate `fps`, Hz, at time `t_s`, s: linear between samples; the last sample is held.
pub(super) fn at(series: &[f64], fps: f64, t_s: f64) -> f64 {
    let last = series.len() - 1;
    let position = t_s * fps;
    let nearest = position.round();
    // At a grid point return the sample itself: t·fps may differ from it by a rounding error.
    if (position - nearest).abs() < 1e-9 {
        return series[(nearest.max(0.0) as usize).min(last)];
    }
    let below = (position.max(0.0) as usize).min(last);
    let above = (below + 1).min(last);
    let share = (position - below as f64).clamp(0.0, 1.0);
    series[below] + (series[above] - series[below]) * share
}

/// Instants at which motions are sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeGrid {
    /// Interval between instants, s.
    pub dt_s: f64,
    /// Maximum number of instants; no lane reads more.
    pub max_steps: usize,
}

impl TimeGrid {
    /// The grid of a profile's lanes, which end at its time cap.
    pub fn of(profile: &Profile) -> TimeGrid {
        TimeGrid { dt_s: profile.frame.dt_s, max_steps: profile.step_cap() as usize + 2 }
    }
}

/// A grid without an end.
impl From<f64> for TimeGrid {
    fn from(dt_s: f64) -> TimeGrid {
        TimeGrid { dt_s, max_steps: usize::MAX }
    }
}

/// Number of steps of the grid that cover [0, T], the end included.
pub fn steps_of(duration_s: f64, grid: TimeGrid) -> usize {
    ((duration_s / grid.dt_s - 1e-9).ceil().max(0.0) as usize).saturating_add(1).min(grid.max_steps)
}

/// A speed series on the grid, never below 0.
fn speed_on_grid(series: &[f64], fps: f64, duration_s: f64, grid: TimeGrid) -> Speed {
    let value = |i: usize| at(series, fps, (i as f64 * grid.dt_s).min(duration_s)).max(0.0);
    Speed::Sampled((0..steps_of(duration_s, grid)).map(value).collect())
}

/// A lateral series on the grid with its speed towards the ego, w[i] = −(|y[i]| − |y[i−1]|)/dt, w[0] = w[1],
/// 0 after T.
fn lateral_on_grid(series: &[f64], fps: f64, duration_s: f64, grid: TimeGrid) -> (Vec<f64>, Vec<f64>) {
    let dt_s = grid.dt_s;
    let time = |i: usize| i as f64 * dt_s;
    let position: Vec<f64> =
        (0..steps_of(duration_s, grid)).map(|i| at(series, fps, time(i).min(duration_s))).collect();
    let mut towards = vec![0.0; position.len()];
    for i in 1..position.len() {
        let inside = time(i) <= duration_s + 1e-9 * dt_s;
        towards[i] = if inside { (position[i - 1].abs() - position[i].abs()) / dt_s } else { 0.0 };
    }
    if towards.len() > 1 {
        towards[0] = towards[1];
    }
    (position, towards)
}

/// A scenario whose vehicles follow series; after T the last values are held.
pub(super) struct SeriesCase<'a> {
    pub category: Category,
    /// Lateral position of the target, m; unused in LVD.
    pub y: &'a [f64],
    /// Speed of the target, m/s.
    pub v: &'a [f64],
    /// Cut-out: speed of the vehicle ahead, m/s, and the gap to it, m.
    pub lead: Option<(&'a [f64], f64)>,
    pub ego_speed_mps: f64,
    /// Samples per second.
    pub fps: f64,
    pub duration_s: f64,
}

impl SeriesCase<'_> {
    /// The case on a time grid.
    ///
    /// # Errors
    /// [`Error::Input`](lanesweep_support::Error::Input) for a cut-out without the size of the vehicle ahead.
    pub(super) fn on(&self, grid: TimeGrid, sizes: &Sizes) -> Result<Case> {
        let SeriesCase { category, fps, duration_s, .. } = *self;
        let speed = |series: &[f64]| speed_on_grid(series, fps, duration_s, grid);
        let lateral = if category == Category::Lvd {
            Lateral::Centred
        } else {
            let (position_m, towards_mps) = lateral_on_grid(self.y, fps, duration_s, grid);
            Lateral::Sampled { position_m, towards_mps }
        };
        let lead = self.lead.map(|(series, gap_m)| (speed(series), gap_m));
        sizes.case(category, self.ego_speed_mps, (speed(self.v), lateral), lead, duration_s)
    }
}

/// S: the case of the recorded scenario on a time grid. Fails for a cut-out without the vehicle ahead.
pub fn recorded_case(scenario: &Scenario, grid: impl Into<TimeGrid>) -> Result<Case> {
    let target = &scenario.target;
    let lead = match scenario.category {
        Category::CutOut => Some(vehicle_ahead(scenario)?).map(|(lead, gap_m)| (lead.v.as_slice(), gap_m)),
        Category::CutIn | Category::Lvd => None,
    };
    SeriesCase {
        category: scenario.category,
        y: &target.y,
        v: &target.v,
        lead,
        // In LVD the ego starts at the leader's speed, in S as well.
        ego_speed_mps: if scenario.category == Category::Lvd { target.v[0].max(0.0) } else { scenario.ego.v0 },
        fps: scenario.fps,
        duration_s: scenario.duration_s(),
    }
    .on(grid.into(), &Sizes::of(scenario))
}

/// Magnitude of the constant lateral speed, m/s: displacement over time. The alternative reading of the specification,
/// (|y(0)| − |y(T)|)/T, would shorten the path of a target that ends beyond the lane's middle.
pub(super) fn lateral_speed(scenario: &Scenario, options: &ParameterizationOptions) -> f64 {
    let y = &scenario.target.y;
    let duration = scenario.duration_s();
    let over = match options.lateral_speed {
        LateralSpeed::Mean => duration,
        LateralSpeed::Initial => duration.min(0.4),
    };
    let change = y[0] - at(y, scenario.fps, over);
    let speed = if over > 0.0 { (change / over).abs() } else { 0.0 };
    speed.max(options.min_lateral_speed_mps)
}

/// (v(T) − v(0))/T of a vehicle, m/s²; 0 where T is 0.
pub(super) fn mean_acceleration(other: &Other, duration_s: f64) -> f64 {
    let (first, last) = (other.v[0], other.v[other.v.len() - 1]);
    if duration_s > 0.0 { (last - first) / duration_s } else { 0.0 }
}

/// A speed with constant acceleration from t = 0.
pub(super) fn accelerated(initial_mps: f64, acceleration_mps2: f64, duration_s: f64, after: AfterDuration) -> Speed {
    let until_s = match after {
        AfterDuration::Hold => duration_s,
        // A time beyond every run, s.
        AfterDuration::Unlimited => 1e6,
    };
    Speed::Kinematic { initial_mps, acceleration_mps2, until_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_at_its_own_rate_is_itself() {
        let series: Vec<f64> = (0..300).map(|k| 20.0 - 0.013 * f64::from(k)).collect();
        let Speed::Sampled(grid) = speed_on_grid(&series, 25.0, 299.0 / 25.0, 0.04.into()) else { panic!("sampled") };
        assert_eq!(grid, series);
    }

    #[test]
    fn the_last_value_holds_between_the_end_and_the_next_step() {
        let Speed::Sampled(grid) = speed_on_grid(&[10.0, 8.0], 25.0, 0.04, 0.03.into()) else { panic!("sampled") };
        assert_eq!(grid.len(), 3);
        assert!((grid[1] - 8.5).abs() < 1e-12);
        assert_eq!(grid[2], 8.0);
        let (_, towards) = lateral_on_grid(&[1.0, 0.9], 25.0, 0.04, 0.03.into());
        assert_eq!(towards[2], 0.0);
    }
}
