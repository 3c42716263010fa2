//! Kinematic parameterizations: features as data, and the variables, names and cases derived from them.

use super::options::{AfterDuration, LateralStart, ParameterizationOptions};
use super::parameter::Variable;
use super::series::{TimeGrid, accelerated, at, steps_of};
use super::sizes::Sizes;
use crate::scenario::{Case, Category, Lateral, Scenario, Speed};
use lanesweep_support::Result;

/// How the speeds of the vehicles other than the ego change over [0, T].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SpeedProfile {
    /// Constant.
    Constant,
    /// With constant acceleration; LVD: from v0 to v1, then constant.
    ConstantAcceleration,
    /// LVD: along half a cosine from v0 to v1, then constant.
    Sinusoidal,
}

/// How the target changes its lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LaneChange {
    /// LVD: it stays in the ego's lane.
    None,
    /// At constant lateral speed.
    Gradual,
    /// At t = 0.
    Instantaneous,
}

/// Features of a kinematic parameterization.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Kinematic {
    /// Speeds of target and vehicle ahead.
    pub speed: SpeedProfile,
    /// Lateral motion of the target.
    pub lane_change: LaneChange,
}

/// One value per [`Variable`], indexed by its code; 0 for those that a parameterization lacks.
#[derive(Default)]
pub(super) struct Values([f64; Variable::ALL.len()]);

impl Values {
    /// The values of a point. T is derived where speeds and a mean deceleration are given.
    fn of_point(variables: &[Variable], point: &[f64]) -> Values {
        let mut values = Values::default();
        for (variable, value) in variables.iter().zip(point) {
            values.0[*variable as usize] = *value;
        }
        if variables.contains(&Variable::MeanDeceleration) {
            let dropped = values.at(Variable::TargetSpeed) - values.at(Variable::FinalSpeed);
            values.0[Variable::Duration as usize] = dropped / values.at(Variable::MeanDeceleration);
        }
        values
    }

    fn at(&self, variable: Variable) -> f64 {
        self.0[variable as usize]
    }
}

impl Kinematic {
    /// The variables in the order of a point's numbers.
    pub(super) fn variables(self, category: Category) -> Vec<Variable> {
        let decelerates = category == Category::Lvd;
        let has_lead = category == Category::CutOut;
        let accelerates = self.speed != SpeedProfile::Constant && !decelerates;
        let all = [
            (Variable::TargetSpeed, true),
            (Variable::LateralSpeed, self.lane_change == LaneChange::Gradual),
            (Variable::EgoSpeed, !decelerates),
            (Variable::LeadSpeed, has_lead),
            (Variable::LeadGap, has_lead),
            (Variable::TargetAcceleration, accelerates),
            (Variable::LeadAcceleration, accelerates && has_lead),
            (Variable::Duration, accelerates),
            (Variable::FinalSpeed, decelerates),
            (Variable::MeanDeceleration, decelerates),
        ];
        all.into_iter().filter_map(|(variable, is_given)| is_given.then_some(variable)).collect()
    }

    /// Describes the kept features in words.
    pub(super) fn description(self, category: Category) -> String {
        let speed = match (self.speed, category) {
            (SpeedProfile::Constant, _) => "constant speed",
            (SpeedProfile::ConstantAcceleration, Category::Lvd) => "constant deceleration",
            (SpeedProfile::ConstantAcceleration, _) => "constant acceleration",
            (SpeedProfile::Sinusoidal, _) => "sinusoidal deceleration",
        };
        let plural = if category == Category::CutOut { "s" } else { "" };
        let lane_change = match self.lane_change {
            LaneChange::None => "",
            LaneChange::Gradual => ", constant lateral speed",
            LaneChange::Instantaneous => ", instantaneous lane change",
        };
        format!("{speed}{plural}{lane_change}")
    }

    /// The case of a mined scenario. T stays as recorded, and with the option also the lateral start.
    pub(super) fn replay(self, scenario: &Scenario, grid: TimeGrid, options: &ParameterizationOptions) -> Result<Case> {
        let variables = self.variables(scenario.category);
        let point = variables.iter().map(|v| v.of(scenario, options)).collect::<Result<Vec<f64>>>()?;
        let mut values = Values::of_point(&variables, &point);
        values.0[Variable::Duration as usize] = scenario.duration_s();
        let start_m = match (options.lateral_start, self.lane_change) {
            (LateralStart::Recorded, LaneChange::Gradual) => scenario.target.y[0].abs(),
            _ => options.lane_change_m,
        };
        self.case(scenario.category, &values, start_m, &Sizes::of(scenario), grid, options)
    }

    /// The case of a valid point, one number per variable.
    pub(super) fn decode(
        self,
        category: Category,
        point: &[f64],
        sizes: &Sizes,
        grid: TimeGrid,
        options: &ParameterizationOptions,
    ) -> Result<Case> {
        let values = Values::of_point(&self.variables(category), point);
        self.case(category, &values, options.lane_change_m, sizes, grid, options)
    }

    /// `start_m`: lateral distance at which a cut-in starts.
    fn case(
        self,
        category: Category,
        values: &Values,
        start_m: f64,
        sizes: &Sizes,
        grid: TimeGrid,
        options: &ParameterizationOptions,
    ) -> Result<Case> {
        let end_m = options.lane_change_m;
        let rate_mps = values.at(Variable::LateralSpeed);
        let (lateral, change_s) = match (category, self.lane_change) {
            (Category::CutIn, LaneChange::Gradual) => {
                (Lateral::Kinematic { start_m, rate_mps: -rate_mps, end_m: 0.0 }, start_m / rate_mps)
            }
            (Category::CutOut, LaneChange::Gradual) => {
                (Lateral::Kinematic { start_m: 0.0, rate_mps, end_m }, end_m / rate_mps)
            }
            (Category::CutOut, _) => (Lateral::Kinematic { start_m: end_m, rate_mps: 0.0, end_m }, 0.0),
            (Category::CutIn | Category::Lvd, _) => (Lateral::Centred, 0.0),
        };
        let is_constant = self.speed == SpeedProfile::Constant;
        let duration_s = if is_constant { 0.0 } else { values.at(Variable::Duration) };
        let initial = values.at(Variable::TargetSpeed);
        let speed = |initial, acceleration| match self.speed {
            SpeedProfile::Constant => Speed::constant(initial),
            _ => accelerated(initial, acceleration, duration_s, options.after_duration),
        };
        let (target, ego_speed) = if category == Category::Lvd {
            let end = values.at(Variable::FinalSpeed);
            let acceleration = if duration_s > 0.0 { (end - initial) / duration_s } else { 0.0 };
            let target = match self.speed {
                SpeedProfile::Sinusoidal => {
                    sinusoidal_series(initial, end, duration_s, grid, options.sinusoid_intervals)
                }
                _ => accelerated(initial, acceleration, duration_s, AfterDuration::Hold),
            };
            (target, initial)
        } else {
            (speed(initial, values.at(Variable::TargetAcceleration)), values.at(Variable::EgoSpeed))
        };
        let lead = (category == Category::CutOut).then(|| {
            let speed = speed(values.at(Variable::LeadSpeed), values.at(Variable::LeadAcceleration));
            (speed, values.at(Variable::LeadGap))
        });
        // A kinematic lane change covers one lane, whatever the scenario's lanes are.
        let sizes = Sizes { lane_width_m: options.lane_change_m, ..*sizes };
        sizes.case(category, ego_speed, (target, lateral), lead, change_s.max(duration_s))
    }
}

/// The sinusoid at every step; if `intervals` is above 0, that many line segments between points of it.
fn sinusoidal_series(v0: f64, v1: f64, duration_s: f64, grid: TimeGrid, intervals: usize) -> Speed {
    let n = intervals;
    let points: Vec<f64> =
        (0..=n).map(|k| sinusoidal_speed(v0, v1, duration_s, duration_s * k as f64 / n as f64)).collect();
    let value = |i: usize| match n {
        0 => sinusoidal_speed(v0, v1, duration_s, i as f64 * grid.dt_s),
        _ => at(&points, n as f64 / duration_s, (i as f64 * grid.dt_s).min(duration_s)),
    };
    Speed::Sampled((0..steps_of(duration_s, grid)).map(value).collect())
}

/// v(t) = v0 − (Δ/2)(1 − cos(πt/T)) up to T, then v1, with Δ = v0 − v1 (paper, LVD ii).
fn sinusoidal_speed(v0: f64, v1: f64, duration_s: f64, t_s: f64) -> f64 {
    if t_s >= duration_s || duration_s <= 0.0 {
        v1
    } else {
        let phase = std::f64::consts::PI * t_s / duration_s;
        v0 - (v0 - v1) / 2.0 * (1.0 - libm::cos(phase))
    }
}

#[cfg(test)]
mod tests {
    use super::sinusoidal_speed;

    #[test]
    fn the_sinusoidal_leader_equals_the_golden_one() {
        let golden: serde_json::Value =
            serde_json::from_str(include_str!("../../../../tests/golden/lvd_sinusoidal.json")).unwrap();
        let mut compared = 0;
        for profile in golden["profiles"].as_array().unwrap() {
            let number = |key: &str| profile[key].as_f64().unwrap();
            let (v0, v1, duration_s) = (number("v0"), number("v0") - number("dv"), number("T"));
            assert!((duration_s - number("dv") / number("amean")).abs() < 1e-9, "T = Δ/ā");
            for row in profile["rows"].as_array().unwrap() {
                let (t, v) = (row[0].as_f64().unwrap(), row[2].as_f64().unwrap());
                let elapsed = (t - number("t_const")).max(0.0);
                // The times and values of the golden file are rounded to six and ten decimals.
                let ours = sinusoidal_speed(v0, v1, duration_s, elapsed);
                assert!((ours - v).abs() < 1e-5, "v0 {v0}, t {t}: {ours} instead of {v}");
                compared += 1;
            }
        }
        assert_eq!(compared, 123);
    }
}
