//! Scenarios as vectors and back: cut-in 5–7 (y, v; v^e_0, T), cut-out e–g (y, v^c, v^l; v^e_0, D, T),
//! LVD iii–v (v; T).

use super::options::{ParameterizationOptions, SvdLateral};
use super::series::{TimeGrid, at, lateral_on_grid, speed_on_grid};
use super::svd::{SvdBasis, fit_svd};
use super::{Kind, ParameterizationId, Sizes, lead_size, vehicle_ahead};
use crate::scenario::{Ahead, Case, Category, Lateral, Participant, Scenario};
use crate::{Error, Result};

/// Shortest duration of a reconstruction, s.
pub const MIN_DURATION_S: f64 = 0.1;

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

    /// A decomposition that was fitted before, as a density file holds it.
    ///
    /// # Errors
    /// [`Error::Input`] where lengths do not fit the category and the number of instants, or a number is not
    /// finite or a weight not above 0.
    pub fn from_parts(category: Category, basis: SvdBasis, options: &ParameterizationOptions) -> Result<Reduction> {
        let extras = match category {
            Category::CutIn => 2,
            Category::CutOut => 3,
            Category::Lvd => 1,
        };
        let p = series_count(category) * options.svd_instants + extras;
        let wrong = |problem: String| Err(Error::input(crate::Place::item("basis"), problem, "fit it again"));
        let lengths = [basis.weights.len(), basis.mean.len()].into_iter().chain(basis.directions.iter().map(Vec::len));
        if let Some(other) = lengths.into_iter().find(|&length| length != p) {
            return wrong(format!("a row of {other} numbers, where {} has {p}", category.label()));
        }
        let mut numbers = basis.mean.iter().chain(basis.directions.iter().flatten()).chain(&basis.singular_values);
        if numbers.any(|v| !v.is_finite()) || basis.weights.iter().any(|w| !(w.is_finite() && *w > 0.0)) {
            return wrong("a number is not finite or a weight is not above 0".to_owned());
        }
        Ok(Reduction { category, basis, options: options.clone() })
    }

    /// A mined scenario as the vector z: series at n_t equidistant points over [0, T], then the extras.
    pub fn vector(&self, scenario: &Scenario) -> Result<Vec<f64>> {
        vector(scenario, &self.options)
    }

    /// The first `d` coefficients of a mined scenario.
    pub fn coefficients(&self, scenario: &Scenario, d: usize) -> Result<Vec<f64>> {
        Ok(self.basis.coefficients(&vector(scenario, &self.options)?, d))
    }

    /// The scenario rebuilt from its first `d` coefficients.
    pub fn reduce(&self, scenario: &Scenario, d: usize) -> Result<ReducedScenario> {
        Ok(self.rebuild(&self.coefficients(scenario, d)?, scenario.side.sign()))
    }

    /// The scenario that belongs to coefficients. `side` is 1 for the left and −1 for the right: with
    /// [`SvdLateral::Signed`] the lateral series is left-positive and is multiplied by it.
    pub fn rebuild(&self, coefficients: &[f64], side: f64) -> ReducedScenario {
        self.scenario_of(&self.basis.reconstruct(coefficients), side)
    }

    /// One column of the reconstruction from coefficients, in its unit and before any clamping; the same bits
    /// as [`SvdBasis::reconstruct`] gives.
    pub fn rebuilt_column(&self, coefficients: &[f64], column: usize) -> f64 {
        let mut weighted = self.basis.mean[column];
        for (c, direction) in coefficients.iter().zip(&self.basis.directions) {
            weighted += c * direction[column];
        }
        weighted / self.basis.weights[column]
    }

    /// Instants of a series.
    pub(super) fn instants(&self) -> usize {
        self.options.svd_instants
    }

    /// Whether the lateral series is left-positive instead of positive on the target's side.
    pub(super) fn is_signed(&self) -> bool {
        self.options.svd_lateral == SvdLateral::Signed
    }

    /// Column of T, the last one.
    pub fn duration_column(&self) -> usize {
        self.basis.mean.len() - 1
    }

    /// Column of the ego's initial speed; in LVD the leader's.
    pub fn ego_speed_column(&self) -> usize {
        match self.category {
            Category::CutIn | Category::CutOut => series_count(self.category) * self.options.svd_instants,
            Category::Lvd => 0,
        }
    }

    /// Column of the gap D between the cutting-out vehicle and the one ahead.
    pub fn lead_gap_column(&self) -> Option<usize> {
        (self.category == Category::CutOut).then(|| self.ego_speed_column() + 1)
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
        let duration_s = extras[extras.len() - 1].max(MIN_DURATION_S);
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
    pub fn case(&self, scenario: &Scenario, d: usize, grid: impl Into<TimeGrid>) -> Result<Case> {
        self.case_of(&self.reduce(scenario, d)?, &Sizes::of(scenario), grid)
    }

    /// The case of a rebuilt scenario on a time grid.
    ///
    /// # Errors
    /// For a cut-out without the size of the vehicle ahead.
    pub fn case_of(&self, reduced: &ReducedScenario, sizes: &Sizes, grid: impl Into<TimeGrid>) -> Result<Case> {
        let grid = grid.into();
        let duration_s = reduced.duration_s;
        let fps = (self.options.svd_instants - 1) as f64 / duration_s;
        let speed = |series: &[f64]| speed_on_grid(series, fps, duration_s, grid);
        let lateral = if self.category == Category::Lvd {
            Lateral::Centred
        } else {
            let (position_m, towards_mps) = lateral_on_grid(&reduced.y, fps, duration_s, grid);
            Lateral::Sampled { position_m, towards_mps }
        };
        let ahead = if self.category == Category::CutOut {
            let lead = lead_size(sizes)?;
            let vehicle = Participant {
                length_m: lead.length_m,
                width_m: lead.width_m,
                speed: speed(&reduced.v_lead),
                lateral: Lateral::Centred,
            };
            Some(Ahead { vehicle, gap_m: reduced.lead_gap_m })
        } else {
            None
        };
        Ok(Case {
            category: self.category,
            ego_length_m: sizes.ego.length_m,
            ego_width_m: sizes.ego.width_m,
            ego_speed_mps: reduced.v_ego,
            principal: Participant {
                length_m: sizes.target.length_m,
                width_m: sizes.target.width_m,
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
