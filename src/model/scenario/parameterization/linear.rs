//! Linear descriptions: families of bases besides the paper's decomposition, with the number of parameters as an
//! argument. Each is fitted on scenarios and gives a [`Reduction`], whose decoding is z = (mean + Σ c_j direction_j) /
//! weights. The generator of samples therefore has the twin of every one of them. The equations are in
//! `docs/src/methods/search.md`.

use std::fmt;
use std::sync::Arc;

use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use serde::{Deserialize, Serialize};

use super::features::Feature;
use super::options::{ParameterizationOptions, SvdLateral};
use super::parameter::{Parameter, Variable};
use super::reduction::{Encoder, ReducedSeries, Reduction, layout, vector};
use super::svd::{SvdBasis, column_weights, decompose};
use crate::scenario::{Category, Scenario};
use crate::support::vector_state::clear_upper_halves;
use crate::{Error, Place, Result};

/// Maximum number of parameters of a description; the generator of samples takes no more.
const MAX_LINEAR_PARAMETERS: usize = 12;

/// What the decomposition of a series is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Signal {
    /// Positions and speeds.
    Values,
    /// Their initial values and changes from instant to instant: lateral speeds and accelerations.
    Changes,
}

/// Functions of normalized time t/T that series are combinations of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FunctionKind {
    /// The polynomial through values at k equidistant instants.
    Polynomial,
    /// cos(i·π·t/T), i = 0 … k − 1.
    Cosine,
    /// Cubic B-spline with k control points, clamped; of lower degree for fewer than four.
    BSpline,
    /// Lines between values at k equidistant instants: speeds have k − 1 constant accelerations.
    Lines,
}

/// A family with its size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LinearFamily {
    /// Singular value decomposition with this many coefficients. It is also the optimum of a linear autoencoder.
    Svd {
        /// Number of coefficients.
        coefficients: usize,
        /// What is decomposed.
        signal: Signal,
        /// Logarithms of factors of the weights: for each series at equidistant knots, then one per extra. Empty: 0.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        emphasis: Vec<f64>,
    },
    /// Fixed functions, a number of them per series; extras are kept as they are.
    Functions {
        /// Kind.
        kind: FunctionKind,
        /// Number per series: lateral position (not LVD), target, vehicle ahead (cut-out).
        sizes: Vec<usize>,
    },
    /// Physical features; everything else is predicted from them by linear regression on the fitted scenarios.
    Features(Vec<Feature>),
}

/// A linear description before its fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearSpec {
    /// Family and size.
    pub family: LinearFamily,
    /// Scenarios of one side are mirrored, so that both are fitted as one; else the lateral series is left-positive.
    pub mirrored: bool,
    /// Series are aligned in time: half of the lane change, or of the loss of speed, is at T/2. One parameter more is
    /// decomposed, the instant of that landmark.
    pub registered: bool,
}

/// Number of knots of the emphasis of a series.
pub const EMPHASIS_KNOTS: usize = 4;

impl LinearSpec {
    /// Number of parameters; the duration counts.
    pub fn parameter_count(&self, category: Category) -> usize {
        let extras = layout(category).1.len() + usize::from(self.registered);
        match &self.family {
            LinearFamily::Svd { coefficients, .. } => *coefficients,
            LinearFamily::Functions { sizes, .. } => sizes.iter().sum::<usize>() + extras,
            LinearFamily::Features(features) => features.len(),
        }
    }

    /// Length of the emphasis of a decomposition.
    pub fn emphasis_count(category: Category) -> usize {
        let (series, extras) = layout(category);
        series.len() * EMPHASIS_KNOTS + extras.len()
    }

    /// The family without its size: `SVD`, `SVD of accelerations`, `B-spline`, `features`, …
    pub fn family_name(&self) -> String {
        let name = match &self.family {
            LinearFamily::Svd { signal: Signal::Values, emphasis, .. } if emphasis.is_empty() => "SVD",
            LinearFamily::Svd { signal: Signal::Values, .. } => "outcome-aware SVD",
            LinearFamily::Svd { signal: Signal::Changes, .. } => "SVD of accelerations",
            LinearFamily::Functions { kind: FunctionKind::Polynomial, .. } => "polynomial",
            LinearFamily::Functions { kind: FunctionKind::Cosine, .. } => "cosines",
            LinearFamily::Functions { kind: FunctionKind::BSpline, .. } => "B-spline",
            LinearFamily::Functions { kind: FunctionKind::Lines, .. } => "constant accelerations",
            LinearFamily::Features(_) => "features",
        };
        let registered = if self.registered { "registered " } else { "" };
        let mirrored = matches!(self.family, LinearFamily::Svd { .. }) && self.mirrored;
        format!("{registered}{name}{}", if mirrored { ", mirrored" } else { "" })
    }

    /// The description in one line.
    pub fn describe(&self, category: Category) -> String {
        let options = ParameterizationOptions::default();
        match &self.family {
            LinearFamily::Svd { coefficients, .. } => format!("{}: {coefficients} coefficients", self.family_name()),
            LinearFamily::Functions { sizes, .. } => {
                let sizes: Vec<String> = sizes.iter().map(usize::to_string).collect();
                format!("{}: {} per series", self.family_name(), sizes.join(" + "))
            }
            LinearFamily::Features(features) => {
                let names: Vec<String> = features.iter().map(|f| f.parameter(category, &options).name).collect();
                format!("{}: {}", self.family_name(), names.join(", "))
            }
        }
    }

    /// Checks sizes and features.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub(crate) fn validate(&self, category: Category) -> Result<()> {
        let wrong = |problem: String| Err(Error::input(Place::item("spec"), problem, "search for it again"));
        let count = self.parameter_count(category);
        if count == 0 || count > MAX_LINEAR_PARAMETERS {
            return wrong(format!("{count} parameters; expected 1 to {MAX_LINEAR_PARAMETERS}"));
        }
        match &self.family {
            LinearFamily::Svd { emphasis, .. } => {
                let expected = LinearSpec::emphasis_count(category);
                let is_wrong = !emphasis.is_empty() && emphasis.len() != expected;
                if is_wrong || emphasis.iter().any(|v| v.abs() > 20.0 || v.is_nan()) {
                    return wrong(format!("the emphasis must have {expected} numbers of −20 to 20"));
                }
            }
            LinearFamily::Functions { sizes, .. } => {
                if sizes.len() != layout(category).0.len() || sizes.contains(&0) {
                    return wrong(format!("{} has {} series", category.label(), layout(category).0.len()));
                }
            }
            LinearFamily::Features(features) => {
                let known: Vec<Feature> = Feature::of_category(category).collect();
                let twice = (1..features.len()).any(|at| features[..at].contains(&features[at]));
                if twice || features.iter().any(|feature| !known.contains(feature)) {
                    return wrong(format!("a feature is given twice or is none of {}", category.label()));
                }
            }
        }
        Ok(())
    }

    /// Fits the description on scenarios of a category.
    ///
    /// # Errors
    /// [`Error::Input`] for too few scenarios, or a series or number that is equal in all of them.
    pub fn fit(
        &self,
        category: Category,
        scenarios: &[&Scenario],
        options: &ParameterizationOptions,
    ) -> Result<Reduction> {
        self.validate(category)?;
        let svd_lateral = if self.mirrored { SvdLateral::Mirrored } else { SvdLateral::Signed };
        let options = ParameterizationOptions { svd_lateral, ..options.clone() };
        let rows: Vec<Vec<f64>> =
            scenarios.iter().map(|s| vector(s, &options, self.registered)).collect::<Result<_>>()?;
        let name = format!("{} scenarios", category.label());
        let count = self.parameter_count(category);
        if rows.len() <= count {
            return Err(Error::input(
                Place::item(name),
                format!("{} scenarios are too few to fit {count} parameters", rows.len()),
                "use more data",
            ));
        }
        let (series, extras) = layout(category);
        let lateral = series.contains(&ReducedSeries::Lateral).then_some(svd_lateral);
        let shape = Shape { series: series.len(), instants: options.svd_instants };
        let weights = column_weights(&rows, (shape.series, lateral), shape.instants, options.series_scale, &name)?;
        let extra = |variable: &Variable| variable.parameter(category, &options);
        let landmark =
            Parameter { lower_excluded: true, upper: Some(1.0), ..Parameter::from("landmark", "1", Some(0.0)) };
        let landmark = self.registered.then_some(landmark);
        let (basis, encoder, parameters) = match &self.family {
            LinearFamily::Svd { coefficients, signal, emphasis } => {
                let parameters = (0..*coefficients).map(Parameter::coefficient).collect();
                let (mut basis, encoder) = match signal {
                    Signal::Values => {
                        let weights = emphasized(&weights, emphasis, shape);
                        (decompose(&rows, weights, &name)?, Encoder::Directions)
                    }
                    Signal::Changes => of_changes(&rows, &weights, shape, *coefficients, &name)?,
                };
                basis.directions.truncate(*coefficients);
                (basis, encoder, parameters)
            }
            LinearFamily::Functions { kind, sizes } => {
                let names = series.iter().zip(sizes).flat_map(|(of, size)| {
                    let (name, unit, lower) = match of {
                        ReducedSeries::Lateral => ("y", "m", None),
                        ReducedSeries::TargetSpeed => ("v_target", "m/s", Some(0.0)),
                        ReducedSeries::LeadSpeed => ("v_lead", "m/s", Some(0.0)),
                    };
                    // Amplitudes and control points may be negative where the speed is not.
                    let lower = lower.filter(|_| *kind == FunctionKind::Lines);
                    let suffix = unit.replace('/', "p");
                    (1..=*size).map(move |i| Parameter::from(format!("{name}_{i}_{suffix}"), unit, lower))
                });
                let parameters = names.chain(extras.iter().map(extra)).chain(landmark).collect();
                let (basis, encoder) = of_functions(*kind, sizes, weights, shape, rows.len());
                (basis, encoder, parameters)
            }
            LinearFamily::Features(features) => {
                let parameters = features.iter().map(|feature| feature.parameter(category, &options)).collect();
                let points = scenarios.iter().map(|scenario| {
                    features.iter().map(|feature| feature.of(scenario, &options)).collect::<Result<Vec<f64>>>()
                });
                let points = points.collect::<Result<Vec<_>>>()?;
                (regression(&rows, &points, weights, &name)?, Encoder::Features(features.clone()), parameters)
            }
        };
        Ok(Reduction { category, basis, options, linear: Some((self.clone(), encoder, parameters)) })
    }
}

/// The layout of a vector: series of equal length, then extras.
#[derive(Clone, Copy)]
struct Shape {
    series: usize,
    instants: usize,
}

/// Weights times the exponential of an emphasis, which is linear between the knots of a series.
fn emphasized(weights: &[f64], emphasis: &[f64], shape: Shape) -> Vec<f64> {
    if emphasis.is_empty() {
        return weights.to_vec();
    }
    let at_column = |column: usize| {
        let (series, instant) = (column / shape.instants, column % shape.instants);
        if series >= shape.series {
            // A landmark has no emphasis of its own.
            return emphasis.get(shape.series * EMPHASIS_KNOTS + column - shape.series * shape.instants).copied();
        }
        let place = instant as f64 / (shape.instants - 1) as f64 * (EMPHASIS_KNOTS - 1) as f64;
        let below = (place as usize).min(EMPHASIS_KNOTS - 2);
        let knots = &emphasis[series * EMPHASIS_KNOTS..(series + 1) * EMPHASIS_KNOTS];
        Some(knots[below] + (knots[below + 1] - knots[below]) * (place - below as f64))
    };
    weights.iter().enumerate().map(|(column, w)| w * libm::exp(at_column(column).unwrap_or(0.0))).collect()
}

/// Decomposition of initial values and changes, written as a basis of the values.
fn of_changes(
    rows: &[Vec<f64>],
    weights: &[f64],
    shape: Shape,
    count: usize,
    name: &str,
) -> Result<(SvdBasis, Encoder)> {
    let n = shape.instants;
    let changes = |z: &[f64]| -> Vec<f64> {
        let mut u = z.to_vec();
        for s in 0..shape.series {
            (1..n).for_each(|k| u[s * n + k] = z[s * n + k] - z[s * n + k - 1]);
        }
        u
    };
    let values = |u: &[f64]| -> Vec<f64> {
        let mut z = u.to_vec();
        for s in 0..shape.series {
            (1..n).for_each(|k| z[s * n + k] += z[s * n + k - 1]);
        }
        z
    };
    let changed: Vec<Vec<f64>> = rows.iter().map(|z| changes(z)).collect();
    let spread = |column: usize| {
        let mean = changed.iter().map(|u| u[column]).sum::<f64>() / changed.len() as f64;
        (changed.iter().map(|u| (u[column] - mean).powi(2)).sum::<f64>() / changed.len() as f64).sqrt()
    };
    let mut of_changes = weights.to_vec();
    for s in 0..shape.series {
        // The initial value has the weight of a number, the changes together that of another.
        let mean = (1..n).map(|k| spread(s * n + k)).sum::<f64>() / (n - 1) as f64;
        of_changes[s * n] = 1.0 / spread(s * n);
        (1..n).for_each(|k| of_changes[s * n + k] = 1.0 / (mean * libm::sqrt((n - 1) as f64)));
    }
    if of_changes.iter().any(|w| !w.is_finite()) {
        let problem = "a series never changes, or begins equal in all scenarios";
        return Err(Error::input(Place::item(name), problem, "use more data"));
    }
    let mut basis = decompose(&changed, of_changes.clone(), name)?;
    basis.directions.truncate(count);
    let unweighted = |row: &[f64]| -> Vec<f64> {
        let u: Vec<f64> = row.iter().zip(&of_changes).map(|(v, w)| v / w).collect();
        values(&u).iter().zip(weights).map(|(z, w)| z * w).collect()
    };
    // c_j = d_j · (w ∘ changes(z) − mean), as a row over z and a constant.
    let dual = |direction: &Vec<f64>| -> (Vec<f64>, f64) {
        let weighted: Vec<f64> = direction.iter().zip(&of_changes).map(|(d, w)| d * w).collect();
        let mut row = weighted.clone();
        for s in 0..shape.series {
            (0..n - 1).for_each(|k| row[s * n + k] = weighted[s * n + k] - weighted[s * n + k + 1]);
        }
        (row, -direction.iter().zip(&basis.mean).map(|(d, m)| d * m).sum::<f64>())
    };
    let encoder = Encoder::Affine(basis.directions.iter().map(dual).collect());
    let basis = SvdBasis {
        weights: weights.to_vec(),
        mean: unweighted(&basis.mean),
        directions: basis.directions.iter().map(|d| unweighted(d)).collect(),
        singular_values: basis.singular_values,
        rows: basis.rows,
    };
    Ok((basis, encoder))
}

/// The values of k functions at n equidistant instants, n rows.
fn functions(kind: FunctionKind, k: usize, n: usize) -> Mat<f64> {
    let node = |i: usize| if k == 1 { 0.0 } else { i as f64 / (k - 1) as f64 };
    Mat::from_fn(n, k, |row, i| {
        let u = row as f64 / (n - 1) as f64;
        match kind {
            FunctionKind::Polynomial => {
                (0..k).filter(|j| *j != i).map(|j| (u - node(j)) / (node(i) - node(j))).product()
            }
            FunctionKind::Cosine => libm::cos(std::f64::consts::PI * i as f64 * u),
            FunctionKind::BSpline => b_spline(i, k, 3.min(k - 1), u),
            FunctionKind::Lines => {
                if k == 1 {
                    1.0
                } else {
                    (1.0 - (u * (k - 1) as f64 - i as f64).abs()).max(0.0)
                }
            }
        }
    })
}

/// Basis function i of a clamped B-spline with k control points (Cox–de Boor).
fn b_spline(i: usize, k: usize, degree: usize, u: f64) -> f64 {
    let inner = k - degree;
    let knot = |j: usize| (j as f64 - degree as f64).clamp(0.0, inner as f64) / inner as f64;
    // The last interval is closed.
    let u = u.min(1.0 - 1e-12);
    let mut values: Vec<f64> = (0..k + degree).map(|j| f64::from(u8::from(knot(j) <= u && u < knot(j + 1)))).collect();
    for d in 1..=degree {
        for j in 0..k + degree - d {
            let part = |from: usize, to: usize, of: f64, value: f64| {
                let width = knot(to) - knot(from);
                if width > 0.0 { of / width * value } else { 0.0 }
            };
            values[j] =
                part(j, j + d, u - knot(j), values[j]) + part(j + 1, j + d + 1, knot(j + d + 1) - u, values[j + 1]);
        }
    }
    values[i]
}

/// Fixed functions of the series, and the extras, as a basis; coefficients by least squares.
fn of_functions(
    kind: FunctionKind,
    sizes: &[usize],
    weights: Vec<f64>,
    shape: Shape,
    rows: usize,
) -> (SvdBasis, Encoder) {
    let (n, p) = (shape.instants, weights.len());
    let (mut directions, mut duals) = (Vec::new(), Vec::new());
    for (s, &k) in sizes.iter().enumerate() {
        let columns = functions(kind, k, n);
        // Least squares of every unit vector: the pseudo-inverse.
        let inverse = columns.qr().solve_lstsq(Mat::<f64>::identity(n, n));
        clear_upper_halves();
        for i in 0..k {
            let (mut direction, mut dual) = (vec![0.0; p], vec![0.0; p]);
            for instant in 0..n {
                direction[s * n + instant] = weights[s * n + instant] * columns[(instant, i)];
                dual[s * n + instant] = inverse[(i, instant)];
            }
            directions.push(direction);
            duals.push((dual, 0.0));
        }
    }
    for (column, weight) in weights.iter().enumerate().skip(sizes.len() * n) {
        let unit = |value: f64| (0..p).map(|at| if at == column { value } else { 0.0 }).collect::<Vec<f64>>();
        directions.push(unit(*weight));
        duals.push((unit(1.0), 0.0));
    }
    let basis = SvdBasis { mean: vec![0.0; p], weights, singular_values: Vec::new(), directions, rows };
    (basis, Encoder::Affine(duals))
}

/// The vectors as linear functions of points, by least squares.
fn regression(rows: &[Vec<f64>], points: &[Vec<f64>], weights: Vec<f64>, name: &str) -> Result<SvdBasis> {
    let (count, m, p) = (rows.len(), points[0].len(), weights.len());
    let mean_of = |j: usize| points.iter().map(|point| point[j]).sum::<f64>() / count as f64;
    let centre: Vec<f64> = (0..m).map(mean_of).collect();
    let scale =
        |j: usize| (points.iter().map(|point| (point[j] - centre[j]).powi(2)).sum::<f64>() / count as f64).sqrt();
    let scales: Vec<f64> = (0..m).map(scale).collect();
    if let Some(j) =
        scales.iter().zip(&centre).position(|(scale, c)| *scale <= 1e-9 * c.abs().max(1.0) || scale.is_nan())
    {
        let problem = format!("feature {} is equal in all scenarios", j + 1);
        return Err(Error::input(Place::item(name), problem, "leave it out"));
    }
    let means: Vec<f64> = (0..p).map(|c| rows.iter().map(|z| z[c] * weights[c]).sum::<f64>() / count as f64).collect();
    // A ridge of 1e-6 of a feature's variance keeps features that follow from others from exploding.
    let ridge = libm::sqrt(1e-6 * count as f64);
    let x = Mat::from_fn(count + m, m, |r, j| match r.checked_sub(count) {
        None => (points[r][j] - centre[j]) / scales[j],
        Some(of) => {
            if of == j {
                ridge
            } else {
                0.0
            }
        }
    });
    let y = Mat::from_fn(count + m, p, |r, c| if r < count { rows[r][c] * weights[c] - means[c] } else { 0.0 });
    let slopes = x.qr().solve_lstsq(y);
    clear_upper_halves();
    let directions: Vec<Vec<f64>> = (0..m).map(|j| (0..p).map(|c| slopes[(j, c)] / scales[j]).collect()).collect();
    let mean = (0..p).map(|c| means[c] - (0..m).map(|j| centre[j] * directions[j][c]).sum::<f64>()).collect();
    Ok(SvdBasis { weights, mean, singular_values: Vec::new(), directions, rows: count })
}

/// A fitted description, shared by the parameterizations that use it.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear(pub Arc<Reduction>);

impl Eq for Linear {}

impl std::hash::Hash for Linear {
    // Equal descriptions have equal lengths.
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        self.0.basis.directions.len().hash(state);
    }
}

impl fmt::Display for LinearSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.family_name())
    }
}
