//! LVD i and ii: the leader's speed falls linearly or along half a cosine from v0 to v1, then holds.

use super::Sizes;
use super::options::ParameterizationOptions;
use super::series::{TimeGrid, at, steps_of};
use crate::scenario::{Case, Category, Lateral, Participant, Scenario, Speed};
use crate::{Error, Result};

/// What describes a kinematic leader deceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LvdParameters {
    /// Speed before, m/s, ≥ 0; the ego's too.
    pub v0_mps: f64,
    /// Speed after, m/s, ≥ 0.
    pub v1_mps: f64,
    /// T, s, ≥ 0; the mean deceleration is (v0 − v1)/T.
    pub duration_s: f64,
}

impl LvdParameters {
    /// Those of a mined scenario.
    pub fn of(scenario: &Scenario) -> Self {
        let v = &scenario.target.v;
        LvdParameters { v0_mps: v[0].max(0.0), v1_mps: v[v.len() - 1].max(0.0), duration_s: scenario.duration_s() }
    }

    /// The case under the parameterization `key`.
    pub fn case(
        &self,
        key: &str,
        sizes: &Sizes,
        grid: impl Into<TimeGrid>,
        options: &ParameterizationOptions,
    ) -> Result<Case> {
        let grid = grid.into();
        let LvdParameters { v0_mps: v0, v1_mps: v1, duration_s } = *self;
        let speed = match key {
            "i" => Speed::Kinematic {
                initial_mps: v0,
                acceleration_mps2: if duration_s > 0.0 { (v1 - v0) / duration_s } else { 0.0 },
                until_s: duration_s,
            },
            "ii" => {
                let n = options.sinusoid_intervals;
                let points: Vec<f64> =
                    (0..=n).map(|k| sinusoidal_speed(v0, v1, duration_s, duration_s * k as f64 / n as f64)).collect();
                let value = |i: usize| match n {
                    0 => sinusoidal_speed(v0, v1, duration_s, i as f64 * grid.dt_s),
                    _ => at(&points, n as f64 / duration_s, (i as f64 * grid.dt_s).min(duration_s)),
                };
                Speed::Sampled((0..steps_of(duration_s, grid)).map(value).collect())
            }
            _ => return Err(Error::Internal(format!("LVD parameterization {key} is not kinematic"))),
        };
        let Sizes { ego, target, .. } = sizes;
        Ok(Case {
            category: Category::Lvd,
            ego_length_m: ego.length_m,
            ego_width_m: ego.width_m,
            ego_speed_mps: v0,
            principal: Participant {
                length_m: target.length_m,
                width_m: target.width_m,
                speed,
                lateral: Lateral::Centred,
            },
            ahead: None,
            horizon_s: duration_s,
        })
    }
}

/// v(t) = v0 − (Δ/2)(1 − cos(πt/T)) up to T, then v1, with Δ = v0 − v1 (paper, LVD ii).
pub(crate) fn sinusoidal_speed(v0: f64, v1: f64, duration_s: f64, t_s: f64) -> f64 {
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
            serde_json::from_str(include_str!("../../../tests/golden/lvd_sinusoidal.json")).unwrap();
        let mut compared = 0;
        for profile in golden["profiles"].as_array().unwrap() {
            let number = |key: &str| profile[key].as_f64().unwrap();
            let (v0, v1, duration_s) = (number("v0"), number("v0") - number("dv"), number("T"));
            assert!((duration_s - number("dv") / number("amean")).abs() < 1e-9, "T = Δ/ā");
            for row in profile["rows"].as_array().unwrap() {
                let (t, v) = (row[0].as_f64().unwrap(), row[2].as_f64().unwrap());
                let elapsed = (t - number("t_const")).max(0.0);
                // The golden's times and values are rounded to six and ten decimals.
                let ours = sinusoidal_speed(v0, v1, duration_s, elapsed);
                assert!((ours - v).abs() < 1e-5, "v0 {v0}, t {t}: {ours} instead of {v}");
                compared += 1;
            }
        }
        assert_eq!(compared, 123);
    }
}
