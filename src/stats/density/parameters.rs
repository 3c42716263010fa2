//! The space a density lives in: ordered parameters of one parameterization, scenario → point, point → case.
//!
//! Kinematic parameterizations take the physical parameters of the paper. 2, 4, b and d have T besides, because
//! their accelerations last over [0, T]. The reduction takes c_j = σ_j u_j. A last dimension `thw_s` can hold the
//! observed headway. Sizes are no parameters.
//!
//! **Sides.** Lateral parameters of kinematic parameterizations are sizes. Under the reduction with
//! `svd_lateral = signed` the lateral series of a point is left-positive, so a point belongs to a side; lanes judge
//! |y| alone, so the case keeps the series as it is, and a scenario on the right gives the mirror image of the
//! case that a study makes of it.
//!
//! **Validity.** Outside the valid region the density is cut off (f/P_valid). Bounds of single parameters are in
//! [`Parameter`]; besides, LVD needs v1 < v0 and T = (v0 − v1)/ā in [0.1 s, 600 s], and a reconstruction by SVD
//! needs T in the same range and no negative ego speed (LVD: first speed of the leader) or gap D. Speeds inside
//! reconstructed series are no reason to refuse a point: below 0 they are set to 0, as in a study. The filters of
//! mining (a slower cutter, a hard deceleration) are no part of the valid region: kernels spill over them.

use super::quantity::{MAX_DURATION_S, Parameter, Quantity};
use crate::scenario::parameterization::{
    CutInParameters, CutOutParameters, Kind, LateralStart, LvdParameters, MIN_DURATION_S, ParameterizationId,
    ParameterizationOptions, ReducedScenario, Reduction, Sizes,
};
use crate::scenario::{Case, Category, Scenario};
use crate::support::near_name::nearest;
use crate::{Error, Place, Result};

/// Ordered parameters of one parameterization.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSpace {
    id: ParameterizationId,
    options: ParameterizationOptions,
    reduction: Option<Reduction>,
    quantities: Vec<Quantity>,
    parameters: Vec<Parameter>,
}

/// Why a point is outside the valid region.
#[derive(Debug, Clone, PartialEq)]
pub struct Invalid {
    /// Which parameter, or which value that follows from several: `duration_s`, `v_ego_mps`, `gap_lead_m`.
    pub parameter: String,
    /// Its value.
    pub value: f64,
    /// What it must be: `≥ 0`.
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

fn in_range(parameter: &str, value: f64, lower: f64, upper: f64) -> std::result::Result<(), Invalid> {
    // Written so that NaN is refused.
    if value >= lower && value <= upper {
        return Ok(());
    }
    let bound = if upper.is_finite() { format!("{lower} … {upper}") } else { format!("≥ {lower}") };
    Err(Invalid { parameter: parameter.to_owned(), value, bound })
}

impl ParameterSpace {
    /// Range of a valid T, s.
    pub const DURATION_RANGE_S: [f64; 2] = [MIN_DURATION_S, MAX_DURATION_S];

    /// The space of a parameterization; `reduction` is needed for one by SVD and ignored else.
    ///
    /// # Errors
    /// [`Error::Usage`] for `lateral_start = recorded` with 1 or 2 (the start would be one more parameter), or
    /// without the decomposition that the parameterization needs.
    pub fn new(
        id: ParameterizationId,
        options: &ParameterizationOptions,
        reduction: Option<&Reduction>,
        with_thw: bool,
    ) -> Result<ParameterSpace> {
        use Quantity as Q;
        options.validate()?;
        let place = || Place::item(format!("{} {}", id.category.label(), id.key));
        let mut quantities = match (id.kind, id.category, id.key) {
            (Kind::Svd(d), ..) => (0..d).map(Q::Coefficient).collect(),
            (_, _, "1") => vec![Q::TargetSpeed, Q::LateralSpeed, Q::EgoSpeed],
            (_, _, "2") => vec![Q::TargetSpeed, Q::LateralSpeed, Q::EgoSpeed, Q::TargetAcceleration, Q::Duration],
            (_, _, "3") => vec![Q::TargetSpeed, Q::EgoSpeed],
            (_, _, "4") => vec![Q::TargetSpeed, Q::EgoSpeed, Q::TargetAcceleration, Q::Duration],
            (_, Category::CutOut, key @ ("a" | "b" | "c" | "d")) => {
                let mut list = vec![Q::TargetSpeed];
                if matches!(key, "a" | "b") {
                    list.push(Q::LateralSpeed);
                }
                list.extend([Q::EgoSpeed, Q::LeadSpeed, Q::LeadGap]);
                if matches!(key, "b" | "d") {
                    list.extend([Q::TargetAcceleration, Q::LeadAcceleration, Q::Duration]);
                }
                list
            }
            (_, Category::Lvd, _) => vec![Q::InitialSpeed, Q::FinalSpeed, Q::MeanDeceleration],
            _ => return Err(Error::Internal(format!("no parameters are known of {} {}", id.category.label(), id.key))),
        };
        if with_thw {
            quantities.push(Q::TimeHeadway);
        }
        if id.category == Category::CutIn
            && quantities.contains(&Q::LateralSpeed)
            && options.lateral_start == LateralStart::Recorded
        {
            return Err(Error::usage(
                place(),
                "with lateral_start = recorded a case needs its recorded start, which is no parameter",
                "use lateral_start = lane-width",
            ));
        }
        let reduction = match (id.kind, reduction) {
            (Kind::Kinematic, _) => None,
            (Kind::Svd(d), Some(r)) if r.category == id.category && r.basis.directions.len() >= d => Some(r.clone()),
            (Kind::Svd(d), _) => {
                let problem = format!("needs a decomposition of its category with {d} directions");
                return Err(Error::usage(place(), problem, "fit one on at least as many scenarios and one more"));
            }
        };
        let parameters = quantities.iter().map(|q| q.parameter(options)).collect();
        Ok(ParameterSpace { id, options: options.clone(), reduction, quantities, parameters })
    }

    /// Category and parameterization.
    pub fn id(&self) -> ParameterizationId {
        self.id
    }

    /// Options of the parameterization.
    pub fn options(&self) -> &ParameterizationOptions {
        &self.options
    }

    /// The decomposition, of a parameterization by SVD.
    pub fn reduction(&self) -> Option<&Reduction> {
        self.reduction.as_ref()
    }

    /// Names, units and bounds, in the order of a point's numbers.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// What each dimension means, in the same order.
    pub fn quantities(&self) -> &[Quantity] {
        &self.quantities
    }

    /// Number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.parameters.len()
    }

    /// The last dimension is the headway.
    pub fn has_thw(&self) -> bool {
        self.quantities.last() == Some(&Quantity::TimeHeadway)
    }

    /// The headway of a point, s, where it has one.
    pub fn thw_s(&self, point: &[f64]) -> Option<f64> {
        self.has_thw().then(|| point[point.len() - 1])
    }

    /// Index of the parameter with this name.
    ///
    /// # Errors
    /// [`Error::Usage`] that lists the names and the one that was probably meant.
    pub fn index_of(&self, name: &str) -> Result<usize> {
        if let Some(index) = self.parameters.iter().position(|p| p.name == name) {
            return Ok(index);
        }
        let names: Vec<&str> = self.parameters.iter().map(|p| p.name.as_str()).collect();
        let near =
            nearest(name, names.iter().copied(), 0.0).map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        Err(Error::usage(
            Place::item(format!("{} {}", self.id.category.label(), self.id.key)),
            format!("there is no parameter `{name}`{near}"),
            format!("use one of {}", names.join(", ")),
        ))
    }

    /// A mined scenario as a point. It may lie outside the valid region: see [`ParameterSpace::check`].
    ///
    /// # Errors
    /// [`Error::Input`] for a scenario without what a dimension needs: the vehicle ahead, the observed headway;
    /// [`Error::Internal`] for one of another category.
    pub fn point(&self, scenario: &Scenario) -> Result<Vec<f64>> {
        use Quantity as Q;
        if scenario.category != self.id.category {
            return Err(Error::Internal(format!("{} is no {}", scenario.id, self.id.category.label())));
        }
        let mut point = match (&self.reduction, self.id.kind) {
            (Some(reduction), Kind::Svd(d)) => reduction.coefficients(scenario, d)?,
            _ => self.kinematic_point(scenario)?,
        };
        if self.quantities.last() == Some(&Q::TimeHeadway) {
            let thw_s = scenario.thw0.ok_or_else(|| {
                Error::input(
                    Place::item(format!("scenario {}", scenario.id)).column("thw0"),
                    "no observed headway, which the dimension `thw_s` needs (the ego may have stood)",
                    "leave the scenario out or fit without option `with_thw`",
                )
            })?;
            point.push(thw_s);
        }
        Ok(point)
    }

    fn kinematic_point(&self, scenario: &Scenario) -> Result<Vec<f64>> {
        use Quantity as Q;
        let of_none = |q: Q| Error::Internal(format!("{q:?} is no parameter of a {}", self.id.category.label()));
        let quantities = self.quantities.iter().filter(|q| **q != Q::TimeHeadway);
        match self.id.category {
            Category::CutIn => {
                let p = CutInParameters::of(scenario, &self.options);
                let value = |q: &Q| match q {
                    Q::TargetSpeed => Ok(p.v_target_mps),
                    Q::LateralSpeed => p.lateral_speed_mps.ok_or_else(|| of_none(*q)),
                    Q::EgoSpeed => Ok(p.v_ego_mps),
                    Q::TargetAcceleration => Ok(p.acceleration_target_mps2),
                    Q::Duration => Ok(p.duration_s),
                    other => Err(of_none(*other)),
                };
                quantities.map(value).collect()
            }
            Category::CutOut => {
                let p = CutOutParameters::of(scenario, &self.options)?;
                let value = |q: &Q| match q {
                    Q::TargetSpeed => Ok(p.v_target_mps),
                    Q::LateralSpeed => p.lateral_speed_mps.ok_or_else(|| of_none(*q)),
                    Q::EgoSpeed => Ok(p.v_ego_mps),
                    Q::LeadSpeed => Ok(p.v_lead_mps),
                    Q::LeadGap => Ok(p.gap_lead_m),
                    Q::TargetAcceleration => Ok(p.acceleration_target_mps2),
                    Q::LeadAcceleration => Ok(p.acceleration_lead_mps2),
                    Q::Duration => Ok(p.duration_s),
                    other => Err(of_none(*other)),
                };
                quantities.map(value).collect()
            }
            Category::Lvd => {
                let p = LvdParameters::of(scenario);
                let value = |q: &Q| match q {
                    Q::InitialSpeed => Ok(p.v0_mps),
                    Q::FinalSpeed => Ok(p.v1_mps),
                    Q::MeanDeceleration => Ok((p.v0_mps - p.v1_mps) / p.duration_s),
                    other => Err(of_none(*other)),
                };
                quantities.map(value).collect()
            }
        }
    }

    /// The point is inside the valid region.
    pub fn is_valid(&self, point: &[f64]) -> bool {
        self.check(point).is_ok()
    }

    /// Tells which bound a point breaks first.
    pub fn check(&self, point: &[f64]) -> std::result::Result<(), Invalid> {
        if point.len() != self.dimensions() {
            return Err(Invalid {
                parameter: "number of parameters".to_owned(),
                value: point.len() as f64,
                bound: self.dimensions().to_string(),
            });
        }
        if let Some((parameter, value)) = self.parameters.iter().zip(point).find(|(p, v)| !p.holds(**v)) {
            let bound = parameter.bounds_text();
            return Err(Invalid { parameter: parameter.name.clone(), value: *value, bound });
        }
        match (&self.reduction, self.id.kind) {
            (Some(reduction), Kind::Svd(d)) => check_rebuilt(reduction, &point[..d]),
            _ if self.id.category == Category::Lvd => {
                let (v0, v1) = (point[0], point[1]);
                if v1 >= v0 {
                    let bound = format!("< v0_mps = {v0}");
                    return Err(Invalid { parameter: "v1_mps".to_owned(), value: v1, bound });
                }
                in_range("duration_s", (v0 - v1) / point[2], MIN_DURATION_S, MAX_DURATION_S)
            }
            _ => Ok(()),
        }
    }

    /// The rebuilt scenario of a point under the reduction, left-positive; `None` for kinematic ones.
    pub fn reduced(&self, point: &[f64]) -> Option<ReducedScenario> {
        match (&self.reduction, self.id.kind) {
            (Some(reduction), Kind::Svd(d)) => Some(reduction.rebuild(point.get(..d)?, 1.0)),
            _ => None,
        }
    }

    /// The case of a point, with sizes that the caller chooses, on a time grid of step `dt_s`. The headway
    /// dimension is not part of it: see [`ParameterSpace::thw_s`].
    ///
    /// # Errors
    /// [`Error::Usage`] for a point outside the valid region; [`Error::Input`] for a cut-out without the size
    /// of the vehicle ahead.
    pub fn case(&self, point: &[f64], sizes: &Sizes, dt_s: f64) -> Result<Case> {
        self.check(point)?;
        if let (Some(reduction), Some(reduced)) = (&self.reduction, self.reduced(point)) {
            return reduction.case_of(&reduced, sizes, dt_s);
        }
        let value = |quantity| {
            let index = self.quantities.iter().position(|q| *q == quantity);
            index.map(|i| point[i])
        };
        // What a parameterization does not have, its case does not use.
        let of = |quantity| value(quantity).unwrap_or(0.0);
        let lateral_speed_mps = value(Quantity::LateralSpeed);
        match self.id.category {
            Category::CutIn => CutInParameters {
                v_target_mps: of(Quantity::TargetSpeed),
                acceleration_target_mps2: of(Quantity::TargetAcceleration),
                lateral_speed_mps,
                start_m: self.options.lane_change_m,
                v_ego_mps: of(Quantity::EgoSpeed),
                duration_s: of(Quantity::Duration),
            }
            .case(self.id.key, sizes, &self.options),
            Category::CutOut => CutOutParameters {
                v_target_mps: of(Quantity::TargetSpeed),
                acceleration_target_mps2: of(Quantity::TargetAcceleration),
                lateral_speed_mps,
                v_ego_mps: of(Quantity::EgoSpeed),
                v_lead_mps: of(Quantity::LeadSpeed),
                acceleration_lead_mps2: of(Quantity::LeadAcceleration),
                gap_lead_m: of(Quantity::LeadGap),
                duration_s: of(Quantity::Duration),
            }
            .case(self.id.key, sizes, &self.options),
            Category::Lvd => {
                let (v0_mps, v1_mps) = (of(Quantity::InitialSpeed), of(Quantity::FinalSpeed));
                let duration_s = (v0_mps - v1_mps) / of(Quantity::MeanDeceleration);
                LvdParameters { v0_mps, v1_mps, duration_s }.case(self.id.key, sizes, dt_s, &self.options)
            }
        }
    }
}

fn check_rebuilt(reduction: &Reduction, coefficients: &[f64]) -> std::result::Result<(), Invalid> {
    let column = |c| reduction.rebuilt_column(coefficients, c);
    in_range("duration_s", column(reduction.duration_column()), MIN_DURATION_S, MAX_DURATION_S)?;
    in_range("v_ego_mps", column(reduction.ego_speed_column()), 0.0, f64::INFINITY)?;
    match reduction.lead_gap_column() {
        Some(gap) => in_range("gap_lead_m", column(gap), 0.0, f64::INFINITY),
        None => Ok(()),
    }
}
