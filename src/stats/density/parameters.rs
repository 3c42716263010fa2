//! The space of a density: ordered parameters of one parameterization, scenario → point, point → case.
//!
//! The numbers are those of [`Parameterization::parameters`]. An optional last dimension `thw_s` holds the observed
//! headway. Sizes are not parameters.
//!
//! **Sides.** Lateral parameters of kinematic parameterizations are absolute values. Under the reduction with
//! `svd_lateral = mirrored` the lateral series is positive on the target's side. With `signed` it is positive on the
//! left, so a point belongs to a side. Lanes evaluate |y| only, so the case keeps the series as it is. A scenario on
//! the right gives the mirror image of its case in a study.
//!
//! **Bounds.** A point has a case if it satisfies the bounds in [`Parameter`]. In addition, LVD requires v1 < v0 and T
//! = (v0 − v1)/ā in [0.1 s, 600 s]. A reconstruction by SVD requires T in the same range, and no negative ego speed
//! (LVD: initial speed of the leader) or gap D.
//!
//! **Valid region.** The density is truncated to this region (f/P_valid). A draw must also be a scenario of its
//! category: its numbers are physically possible, and a reconstructed target starts (cut-in) or ends (cut-out) in the
//! lane beside the ego's and ends or starts in the ego's lane. Recorded scenarios may violate this; their kernels
//! remain. Speeds inside reconstructed series do not make a draw invalid: negative ones are set to 0, as in a study.
//! The filters of mining (a slower cutter, a hard deceleration) are not part of the valid region: kernels extend beyond
//! them.

use lanesweep_model::scenario::parameterization::{
    Family, LateralStart, MAX_DURATION_S, MIN_DURATION_S, Parameter, Parameterization, ParameterizationOptions,
    ReducedScenario, ReducedSeries, Reduction, Sizes, Variable,
};
use lanesweep_model::scenario::{Case, Category, Scenario};
use lanesweep_support::{Error, Place, Result};

/// Ordered parameters of one parameterization.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSpace {
    id: Parameterization,
    options: ParameterizationOptions,
    reduction: Option<Reduction>,
    variables: Vec<Variable>,
    parameters: Vec<Parameter>,
    has_thw: bool,
    /// Bounded values that depend on several parameters: a column of the decomposition, or T of a deceleration.
    derived: Vec<(Option<usize>, Parameter)>,
    /// The parameters with the bounds of a draw, which are within physical limits.
    drawn: Vec<Parameter>,
    /// Bounds of a draw's reconstruction.
    columns: Vec<BoundedColumn>,
}

/// A column of a reconstruction that is bounded in draws.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundedColumn {
    /// The column.
    pub column: usize,
    /// The bounds apply to its absolute value, on either side of the lane.
    pub is_distance: bool,
    /// Name, unit and bounds.
    pub parameter: Parameter,
}

/// Why a point is outside the valid region.
#[derive(Debug, Clone, PartialEq)]
pub struct Invalid {
    /// The parameter, or the value that depends on several: `duration_s`, `v_ego_mps`, `gap_lead_m`.
    pub parameter: String,
    /// Its value.
    pub value: f64,
    /// The violated condition: `≥ 0`.
    pub bound: String,
}

impl std::fmt::Display for Invalid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}` is {}; valid is {}", self.parameter, self.value, self.bound)
    }
}

impl From<Invalid> for Error {
    fn from(invalid: Invalid) -> Error {
        Error::usage(
            Place::item(invalid.parameter.clone()),
            invalid.to_string(),
            "give a point inside the valid region; draws outside of it are rejected",
        )
    }
}

/// Checks bounds; refuses NaN as well.
fn in_bounds(parameter: &Parameter, value: f64) -> std::result::Result<(), Invalid> {
    if parameter.holds(value) {
        return Ok(());
    }
    Err(Invalid { parameter: parameter.name.clone(), value, bound: parameter.bounds_text() })
}

impl ParameterSpace {
    /// Range of a valid T, s.
    pub const DURATION_RANGE_S: [f64; 2] = [MIN_DURATION_S, MAX_DURATION_S];

    /// The space of a parameterization; `reduction` is needed for one by SVD and otherwise ignored.
    ///
    /// # Errors
    /// [`Error::Usage`] for `lateral_start = recorded` with 1 or 2 (the start would be an additional parameter), or if
    /// the required decomposition is missing.
    pub fn new(
        id: Parameterization,
        options: &ParameterizationOptions,
        reduction: Option<&Reduction>,
        with_thw: bool,
    ) -> Result<ParameterSpace> {
        options.validate()?;
        let place = || Place::item(id.name());
        let variables = id.variables();
        if id.category == Category::CutIn
            && variables.contains(&Variable::LateralSpeed)
            && options.lateral_start == LateralStart::Recorded
        {
            return Err(Error::usage(
                place(),
                "lateral_start = recorded needs the recorded start of every case, and a density has no such parameter",
                "use lateral_start = lane-width",
            ));
        }
        let reduction = match (id.family, reduction) {
            (Family::Kinematic(_), _) => None,
            (Family::Svd(d), Some(r)) if r.category == id.category && r.basis.directions.len() >= d => Some(r.clone()),
            (Family::Svd(d), _) => {
                let problem = format!("needs a decomposition of its category with {d} directions");
                return Err(Error::usage(place(), problem, "fit one on at least as many scenarios and one more"));
            }
        };
        let parameter = |variable: Variable| variable.parameter(id.category, options);
        let mut parameters = id.parameters(options);
        parameters.extend(with_thw.then(|| parameter(Variable::TimeHeadway)));
        let derived = match &reduction {
            Some(reduction) => {
                let bounded = [Variable::Duration, Variable::EgoSpeed, Variable::LeadGap];
                let column = |variable| Some((Some(reduction.column(variable)?), parameter(variable)));
                bounded.into_iter().filter_map(column).collect()
            }
            None if variables.contains(&Variable::MeanDeceleration) => vec![(None, parameter(Variable::Duration))],
            None => Vec::new(),
        };
        let drawn = parameters.iter().map(Parameter::within_physics).collect();
        let columns = reduction.as_ref().map_or(Vec::new(), |reduction| bounded_columns(reduction, options));
        let options = options.clone();
        Ok(ParameterSpace { id, options, reduction, variables, parameters, has_thw: with_thw, derived, drawn, columns })
    }

    /// Category and parameterization.
    pub fn id(&self) -> &Parameterization {
        &self.id
    }

    /// Options of the parameterization.
    pub fn options(&self) -> &ParameterizationOptions {
        &self.options
    }

    /// The decomposition of a parameterization by SVD; else `None`.
    pub fn reduction(&self) -> Option<&Reduction> {
        self.reduction.as_ref()
    }

    /// Names, units and bounds, in the order of a point's numbers.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Index of the dimension that gives a variable.
    pub fn dimension_of(&self, variable: Variable) -> Option<usize> {
        if variable == Variable::TimeHeadway {
            return self.has_thw.then(|| self.dimensions() - 1);
        }
        self.variables.iter().position(|v| *v == variable)
    }

    /// Number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.parameters.len()
    }

    /// Whether the last dimension is the headway.
    pub fn has_thw(&self) -> bool {
        self.has_thw
    }

    /// The headway of a point, s; `None` without a headway dimension.
    pub fn thw_s(&self, point: &[f64]) -> Option<f64> {
        self.has_thw.then(|| point[point.len() - 1])
    }

    /// The parameters with the bounds of a draw.
    pub fn drawn_parameters(&self) -> &[Parameter] {
        &self.drawn
    }

    /// Bounds of a draw's reconstruction; empty for kinematic parameterizations.
    pub fn bounded_columns(&self) -> &[BoundedColumn] {
        &self.columns
    }

    /// A mined scenario as a point. It may be out of range: see [`ParameterSpace::check`].
    ///
    /// # Errors
    /// [`Error::Input`] for a scenario that lacks the data of a dimension: the vehicle ahead, the observed headway;
    /// [`Error::Internal`] for one of another category.
    pub fn point(&self, scenario: &Scenario) -> Result<Vec<f64>> {
        let mut point = self.id.encode(scenario, &self.options, self.reduction())?;
        if self.has_thw {
            point.push(Variable::TimeHeadway.of(scenario, &self.options)?);
        }
        Ok(point)
    }

    /// Whether a draw of this point is inside the valid region.
    pub fn is_valid(&self, point: &[f64]) -> bool {
        self.check_draw(point).is_ok()
    }

    /// Returns the first bound of the valid region that a draw violates.
    pub(super) fn check_draw(&self, point: &[f64]) -> std::result::Result<(), Invalid> {
        self.check(point)?;
        self.drawn.iter().zip(point).try_for_each(|(parameter, value)| in_bounds(parameter, *value))?;
        let Some(reduction) = &self.reduction else { return Ok(()) };
        self.columns.iter().try_for_each(|bounded| {
            let value = reduction.rebuilt_column(self.without_thw(point), bounded.column);
            in_bounds(&bounded.parameter, if bounded.is_distance { value.abs() } else { value })
        })
    }

    /// Returns the first bound that a point violates; a point without violation has a case.
    pub fn check(&self, point: &[f64]) -> std::result::Result<(), Invalid> {
        if point.len() != self.dimensions() {
            return Err(Invalid {
                parameter: "number of parameters".to_owned(),
                value: point.len() as f64,
                bound: self.dimensions().to_string(),
            });
        }
        self.parameters.iter().zip(point).try_for_each(|(parameter, value)| in_bounds(parameter, *value))?;
        for (column, parameter) in &self.derived {
            let value = match (&self.reduction, column) {
                (Some(reduction), Some(column)) => reduction.rebuilt_column(self.without_thw(point), *column),
                _ => self.deceleration_time(point)?,
            };
            in_bounds(parameter, value)?;
        }
        Ok(())
    }

    /// T = (v0 − v1)/ā of a leader that decelerates.
    fn deceleration_time(&self, point: &[f64]) -> std::result::Result<f64, Invalid> {
        let value = |variable| self.dimension_of(variable).map_or(f64::NAN, |at| point[at]);
        let (v0, v1) = (value(Variable::TargetSpeed), value(Variable::FinalSpeed));
        if v1 >= v0 {
            let bound = format!("< v0_mps = {v0}");
            return Err(Invalid { parameter: "v1_mps".to_owned(), value: v1, bound });
        }
        Ok((v0 - v1) / value(Variable::MeanDeceleration))
    }

    /// The part of a point that the parameterization decodes.
    fn without_thw<'a>(&self, point: &'a [f64]) -> &'a [f64] {
        &point[..point.len() - usize::from(self.has_thw)]
    }

    /// The reconstructed scenario of a point under the reduction, left-positive; `None` for kinematic
    /// parameterizations.
    pub fn reduced(&self, point: &[f64]) -> Option<ReducedScenario> {
        Some(self.reduction()?.rebuild(self.without_thw(point), 1.0))
    }

    /// The case of a point with sizes of the caller, on a time grid of step `dt_s`. It does not include the headway
    /// dimension: see [`ParameterSpace::thw_s`].
    ///
    /// # Errors
    /// [`Error::Usage`] for a point that [`ParameterSpace::check`] refuses; [`Error::Input`] for a cut-out without the
    /// size of the vehicle ahead.
    pub fn case(&self, point: &[f64], sizes: &Sizes, dt_s: f64) -> Result<Case> {
        self.check(point)?;
        self.id.decode(self.without_thw(point), sizes, dt_s, &self.options, self.reduction())
    }
}

/// Bounds that make a reconstruction a scenario of its category. The parameterization's lane change spans one lane, so
/// lane markings are half of it away from the lane's centre.
fn bounded_columns(reduction: &Reduction, options: &ParameterizationOptions) -> Vec<BoundedColumn> {
    let category = reduction.category;
    let number = |variable: Variable, column: Option<usize>| {
        let parameter = variable.parameter(category, options).within_physics();
        Some(BoundedColumn { column: column?, is_distance: false, parameter })
    };
    let numbers = [Variable::Duration, Variable::EgoSpeed, Variable::LeadGap];
    let speeds = [(Variable::TargetSpeed, ReducedSeries::TargetSpeed), (Variable::LeadSpeed, ReducedSeries::LeadSpeed)];
    let numbers = numbers.into_iter().filter_map(|variable| number(variable, reduction.column(variable)));
    let speeds = speeds.into_iter().filter_map(|(variable, of)| number(variable, reduction.series_column(of)));
    let marking_m = options.lane_change_m / 2.0;
    let place = |name: &str, column: usize, is_inside: bool| {
        let (lower, upper) = if is_inside { (0.0, marking_m) } else { (marking_m, 3.0 * marking_m) };
        let parameter = Parameter {
            name: name.to_owned(),
            unit: "m".to_owned(),
            lower: Some(lower),
            lower_excluded: false,
            upper: Some(upper),
        };
        BoundedColumn { column, is_distance: true, parameter }
    };
    let lateral = reduction.series_column(ReducedSeries::Lateral).into_iter().flat_map(|first| {
        let enters = category == Category::CutIn;
        let last = first + options.svd_instants - 1;
        [place("lateral_start_m", first, !enters), place("lateral_end_m", last, enters)]
    });
    numbers.chain(speeds).chain(lateral).collect()
}
