//! Scenarios as vectors and back: cut-in 5–7 (y, v; v^e_0, T), cut-out e–g (y, v^c, v^l; v^e_0, D, T),
//! LVD iii–v (v; T).

use super::options::{ParameterizationOptions, SvdLateral};
use super::series::{at, lateral_on_grid, speed_on_grid};
use super::svd::{SvdBasis, fit_svd};
use super::{Kind, ParameterizationId, vehicle_ahead};
use crate::scenario::{Ahead, Case, Category, Lateral, Participant, Scenario};
use crate::{Error, Result};

/// Shortest duration of a reconstruction, s.
const LEAST_DURATION_S: f64 = 0.1;

/// A decomposition of one category's scenarios.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduction {
    /// Kind of scenario.
    pub category: Category,
    /// Weights, mean, directions.
    pub basis: SvdBasis,
    options: ParameterizationOptions,
}

/// A scenario rebuilt from few coefficients; within its physical range.
#[derive(Debug, Clone, PartialEq)]
pub struct ReducedScenario {
    /// Lateral position of the target, m, > 0 on its side; empty in LVD.
    pub y: Vec<f64>,
    /// Speed of the target, m/s.
    pub v: Vec<f64>,
    /// Cut-out: speed of the vehicle ahead, m/s.
    pub v_lead: Vec<f64>,
    /// Initial speed of the ego, m/s.
    pub v_ego: f64,
    /// Cut-out: gap to the vehicle ahead, m.
    pub lead_gap_m: f64,
    /// Duration T, s.
    pub duration_s: f64,
}

impl Reduction {
    /// Fits on scenarios of one category. Needs more scenarios than the largest number of coefficients.
    pub fn fit(category: Category, scenarios: &[&Scenario], options: &ParameterizationOptions) -> Result<Reduction> {
        let rows = scenarios.iter().map(|s| vector(s, options)).collect::<Result<Vec<_>>>()?;
        let needed = ParameterizationId::of(category)
            .filter_map(|p| match p.kind {
                Kind::Svd(d) => Some(d),
                Kind::Kinematic => None,
            })
            .max()
            .unwrap_or(0);
        let name = format!("{} scenarios", category.label());
        let basis = fit_svd(&rows, series_count(category), options.svd_instants, needed, options.series_scale, &name)?;
        Ok(Reduction { category, basis, options: options.clone() })
    }

    /// The scenario rebuilt from its first `d` coefficients.
    pub fn reduce(&self, scenario: &Scenario, d: usize) -> Result<ReducedScenario> {
        let z = vector(scenario, &self.options)?;
        let rebuilt = self.basis.reconstruct(&self.basis.coefficients(&z, d));
        Ok(self.scenario_of(&rebuilt, scenario.side.sign()))
    }

    /// Vector → scenario: mirrored back and brought into the physical range.
    fn scenario_of(&self, z: &[f64], side: f64) -> ReducedScenario {
        let n = self.options.svd_instants;
        let speeds = |part: &[f64]| part.iter().map(|v| v.max(0.0)).collect::<Vec<_>>();
        let mirror = match self.options.svd_lateral {
            SvdLateral::Signed => side,
            SvdLateral::Mirrored => 1.0,
        };
        let lateral = |part: &[f64]| part.iter().map(|y| y * mirror).collect::<Vec<_>>();
        let extras = &z[series_count(self.category) * n..];
        let duration_s = extras[extras.len() - 1].max(LEAST_DURATION_S);
        match self.category {
            Category::CutIn => ReducedScenario {
                y: lateral(&z[..n]),
                v: speeds(&z[n..2 * n]),
                v_lead: Vec::new(),
                v_ego: extras[0].max(0.0),
                lead_gap_m: 0.0,
                duration_s,
            },
            Category::CutOut => ReducedScenario {
                y: lateral(&z[..n]),
                v: speeds(&z[n..2 * n]),
                v_lead: speeds(&z[2 * n..3 * n]),
                v_ego: extras[0].max(0.0),
                lead_gap_m: extras[1].max(0.0),
                duration_s,
            },
            Category::Lvd => {
                let v = speeds(&z[..n]);
                ReducedScenario { v_ego: v[0], y: Vec::new(), v, v_lead: Vec::new(), lead_gap_m: 0.0, duration_s }
            }
        }
    }

    /// The case of a scenario under `d` coefficients. Sizes stay those of the scenario.
    pub fn case(&self, scenario: &Scenario, d: usize, dt_s: f64) -> Result<Case> {
        let reduced = self.reduce(scenario, d)?;
        let duration_s = reduced.duration_s;
        let fps = (self.options.svd_instants - 1) as f64 / duration_s;
        let speed = |series: &[f64]| speed_on_grid(series, fps, duration_s, dt_s);
        let lateral = if self.category == Category::Lvd {
            Lateral::Centred
        } else {
            let (position_m, towards_mps) = lateral_on_grid(&reduced.y, fps, duration_s, dt_s);
            Lateral::Sampled { position_m, towards_mps }
        };
        let ahead = if self.category == Category::CutOut {
            let (lead, _) = vehicle_ahead(scenario)?;
            let vehicle = Participant {
                length_m: lead.length,
                width_m: lead.width,
                speed: speed(&reduced.v_lead),
                lateral: Lateral::Centred,
            };
            Some(Ahead { vehicle, gap_m: reduced.lead_gap_m })
        } else {
            None
        };
        let target = &scenario.target;
        Ok(Case {
            category: self.category,
            ego_length_m: scenario.ego.length,
            ego_width_m: scenario.ego.width,
            ego_speed_mps: reduced.v_ego,
            principal: Participant {
                length_m: target.length,
                width_m: target.width,
                speed: speed(&reduced.v),
                lateral,
            },
            ahead,
            horizon_s: duration_s,
        })
    }
}

fn series_count(category: Category) -> usize {
    match category {
        Category::CutIn => 2,
        Category::CutOut => 3,
        Category::Lvd => 1,
    }
}

/// Scenario → vector: series at n_t equidistant points over [0, T], then the extras.
fn vector(scenario: &Scenario, options: &ParameterizationOptions) -> Result<Vec<f64>> {
    let n = options.svd_instants;
    if n < 2 {
        return Err(Error::usage(
            crate::Place::item("svd_instants"),
            format!("{n} instants cannot describe a series"),
            "use 50, as published",
        ));
    }
    let duration_s = scenario.duration_s();
    let sample = |series: &[f64], sign: f64| -> Vec<f64> {
        (0..n).map(|k| sign * at(series, scenario.fps, duration_s * k as f64 / (n - 1) as f64)).collect()
    };
    let sign = match options.svd_lateral {
        SvdLateral::Signed => scenario.side.sign(),
        SvdLateral::Mirrored => 1.0,
    };
    let target = &scenario.target;
    let mut z = Vec::with_capacity(3 * n + 3);
    match scenario.category {
        Category::CutIn => {
            z.extend(sample(&target.y, sign));
            z.extend(sample(&target.v, 1.0));
            z.extend([scenario.ego.v0, duration_s]);
        }
        Category::CutOut => {
            let (lead, gap) = vehicle_ahead(scenario)?;
            z.extend(sample(&target.y, sign));
            z.extend(sample(&target.v, 1.0));
            z.extend(sample(&lead.v, 1.0));
            z.extend([scenario.ego.v0, gap, duration_s]);
        }
        Category::Lvd => {
            z.extend(sample(&target.v, 1.0));
            z.push(duration_s);
        }
    }
    Ok(z)
}
