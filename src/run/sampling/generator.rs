//! Makes a case generator from a parameter space and a mixture.

use lanesweep_engine::attention_rules;
use lanesweep_engine::generated::{
    CasePath, ColumnBound, Generator, LateralPath, MAX_BOUNDS, MAX_PARAMETERS, NO_SLOT, PointSource, Points, Recipe,
    ReducedColumns,
};
use lanesweep_model::profile::{CutOutEvaluated, CutOutTarget, Profile};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::Category;
use lanesweep_model::scenario::parameterization::{AfterDuration, Parameter, ReducedSeries, Sizes, Variable};
use lanesweep_random::Stream;
use lanesweep_stats::density::{Kde, ParameterSpace};
use lanesweep_support::{Error, Place, Result, option};

/// Purpose of the random stream of the samples.
pub const SAMPLE_PURPOSE: u32 = 0x5341_4d50;

/// The generator that draws from the kernels of a density over a parameter space.
///
/// # Errors
/// [`Error::Usage`] for more than [`MAX_PARAMETERS`] parameters, or a profile whose cut-outs begin at the
/// exposure; [`Error::Input`] for a cut-out without the size of the vehicle ahead.
pub fn generator_of(
    space: &ParameterSpace,
    kde: &Kde,
    sizes: &Sizes,
    profile: &Profile,
    stream: Stream,
) -> Result<Generator> {
    let dimensions = space.dimensions();
    let points = Points {
        source: PointSource::Random(stream),
        dimensions,
        means: kde.points().iter().flatten().map(|&v| f32::from_f64(v)).collect(),
        deviations: kde.spread().iter().map(|&v| v as f32).collect(),
    };
    assembled(space, points, sizes, profile)
}

/// The generator whose sample `i` is point `i`.
///
/// # Errors
/// As [`generator_of`]; [`Error::Internal`] without points or for one of the wrong length.
pub fn generator_of_points(
    space: &ParameterSpace,
    points: &[Vec<f64>],
    sizes: &Sizes,
    profile: &Profile,
) -> Result<Generator> {
    let d = space.dimensions();
    if points.is_empty() || points.iter().any(|p| p.len() != d) {
        return Err(Error::Internal(format!("points to simulate must have {d} parameters")));
    }
    let points = Points {
        source: PointSource::Given,
        dimensions: d,
        means: points.iter().flatten().map(|&v| f32::from_f64(v)).collect(),
        deviations: vec![0.0; d],
    };
    assembled(space, points, sizes, profile)
}

fn assembled(space: &ParameterSpace, points: Points, sizes: &Sizes, profile: &Profile) -> Result<Generator> {
    let d = points.dimensions;
    if d > MAX_PARAMETERS || d != space.dimensions() {
        return Err(Error::usage(
            Place::item(space.id().name()),
            format!("{d} parameters cannot be sampled, {MAX_PARAMETERS} can"),
            "use a parameterization with fewer",
        ));
    }
    let category = space.id().category;
    if category == Category::CutOut && profile.frame.cut_out_target == CutOutTarget::Exposed {
        return Err(Error::usage(
            Place::item(format!("profile {}", profile.name)),
            "its cut-outs begin at the exposure of the vehicle ahead, which sampled lanes do not follow",
            format!(
                "use a profile with cut_out_target = \"nearest-unsafe\", for instance {}",
                option("profile = paper")
            ),
        ));
    }
    let recipe = recipe(space, sizes, profile)?;
    Ok(Generator { points, recipe, basis: basis(space) })
}

fn recipe(space: &ParameterSpace, sizes: &Sizes, profile: &Profile) -> Result<Recipe> {
    let id = space.id();
    let category = id.category;
    if category == Category::CutOut && sizes.lead.is_none() {
        let problem = "a cut-out needs the size of the vehicle ahead of the cutting-out one";
        return Err(Error::input(Place::item(id.name()), problem, "fit the density again"));
    }
    let (mut lower, mut upper) = ([f32::MIN; MAX_PARAMETERS], [f32::MAX; MAX_PARAMETERS]);
    for (j, parameter) in space.drawn_parameters().iter().enumerate() {
        (lower[j], upper[j]) = ends(parameter);
    }
    // A kinematic lane change covers one lane, whatever the scenarios' lanes are.
    let lane_change_m = space.options().lane_change_m;
    let lane_width_m = if CasePath::of(id) == CasePath::Reduced { sizes.lane_width_m } else { lane_change_m };
    let unlimited = category != Category::Lvd && space.options().after_duration == AfterDuration::Unlimited;
    Ok(Recipe {
        path: CasePath::of(id) as u32,
        lateral: LateralPath::of(id) as u32,
        dimensions: space.dimensions() as u32,
        decelerates: u32::from(space.dimension_of(Variable::MeanDeceleration).is_some()),
        unlimited: u32::from(unlimited),
        slots: Variable::ALL.map(|variable| slot(space.dimension_of(variable))),
        columns: columns(space),
        lower,
        upper,
        bounded: space.bounded_columns().len() as u32,
        bounds: bounds(space)?,
        ..recipe_without_parameters(category, &Sizes { lane_width_m, ..*sizes }, lane_change_m, profile)
    })
}

/// The recipe of kinematic cases without parameters: what follows from sizes and profile. The vehicle ahead has the size of
/// the other one if it has none of its own.
pub(crate) fn recipe_without_parameters(
    category: Category,
    sizes: &Sizes,
    lane_change_m: f64,
    profile: &Profile,
) -> Recipe {
    let (frame, pair) = (&profile.frame, category == Category::CutOut);
    let half = |a: f64, b: f64| ((a + b) / 2.0) as f32;
    let lead = sizes.lead.unwrap_or(sizes.target);
    let [min_duration, longest_duration] = ParameterSpace::DURATION_RANGE_S;
    Recipe {
        path: CasePath::Kinematic as u32,
        lateral: LateralPath::Centred as u32,
        dimensions: 0,
        pair: u32::from(pair),
        decelerates: 0,
        unlimited: 0,
        judged: u32::from(!(pair && frame.cut_out_evaluated == CutOutEvaluated::Ahead)),
        step_cap: profile.step_cap(),
        slots: [NO_SLOT; Variable::ALL.len()],
        columns: no_columns(),
        lower: [f32::MIN; MAX_PARAMETERS],
        upper: [f32::MAX; MAX_PARAMETERS],
        bounded: 0,
        bounds: [ColumnBound::default(); MAX_BOUNDS],
        min_duration: at_least(min_duration, false),
        longest_duration: at_most(longest_duration),
        dt: frame.dt_s as f32,
        inverse_dt: (1.0 / frame.dt_s) as f32,
        lane_change: lane_change_m as f32,
        half_lengths: [half(sizes.ego.length_m, sizes.target.length_m), half(sizes.ego.length_m, lead.length_m)],
        half_widths: [half(sizes.ego.width_m, sizes.target.width_m), half(sizes.ego.width_m, lead.width_m)],
        principal_length: sizes.target.length_m as f32,
        ego_width: sizes.ego.width_m as f32,
        lane_width: sizes.lane_width_m as f32,
        attention: attention_rules(profile, category).map(|rule| rule.cast()),
    }
}

/// An index in a record of the device.
fn slot(place: Option<usize>) -> u32 {
    place.map_or(NO_SLOT, |place| place as u32)
}

/// The smallest number of the lane arithmetic that satisfies a lower bound; never subnormal.
fn at_least(bound: f64, excluded: bool) -> f32 {
    let rounded = bound as f32;
    let kept = |v: f32| if excluded { f64::from(v) > bound } else { f64::from(v) >= bound };
    let min = if kept(rounded) { rounded } else { rounded.next_up() };
    if min.is_subnormal() { f32::MIN_POSITIVE } else { min }
}

/// The largest number of the lane arithmetic that satisfies an upper bound.
fn at_most(bound: f64) -> f32 {
    let rounded = bound as f32;
    if f64::from(rounded) <= bound { rounded } else { rounded.next_down() }
}

/// Both ends of a parameter's range in the lane arithmetic.
fn ends(parameter: &Parameter) -> (f32, f32) {
    let lower = parameter.lower.map_or(f32::MIN, |lower| at_least(lower, parameter.lower_excluded));
    (lower, parameter.upper.map_or(f32::MAX, at_most))
}

/// Bounds of a draw's reconstruction.
fn bounds(space: &ParameterSpace) -> Result<[ColumnBound; MAX_BOUNDS]> {
    let mut bounds = [ColumnBound::default(); MAX_BOUNDS];
    if space.bounded_columns().len() > MAX_BOUNDS {
        return Err(Error::Internal(format!("{} has more than {MAX_BOUNDS} bounded columns", space.id().name())));
    }
    for (bound, bounded) in bounds.iter_mut().zip(space.bounded_columns()) {
        let (lower, upper) = ends(&bounded.parameter);
        *bound =
            ColumnBound { column: bounded.column as u32, is_distance: u32::from(bounded.is_distance), lower, upper };
    }
    Ok(bounds)
}

/// The columns of a case that is not reduced.
fn no_columns() -> ReducedColumns {
    ReducedColumns { lateral: NO_SLOT, lead_speed: NO_SLOT, lead_gap: NO_SLOT, ..ReducedColumns::default() }
}

fn columns(space: &ParameterSpace) -> ReducedColumns {
    let (Some(reduction), Some(d)) = (space.reduction(), space.id().coefficients()) else { return no_columns() };
    let series = |series| slot(reduction.series_column(series));
    let number = |variable| slot(reduction.column(variable));
    ReducedColumns {
        width: reduction.basis.mean.len() as u32,
        instants: space.options().svd_instants as u32,
        coefficients: d as u32,
        lateral: series(ReducedSeries::Lateral),
        speed: series(ReducedSeries::TargetSpeed),
        lead_speed: series(ReducedSeries::LeadSpeed),
        ego_speed: number(Variable::EgoSpeed),
        lead_gap: number(Variable::LeadGap),
        duration: number(Variable::Duration),
    }
}

/// Mean and directions divided by the weights, so that a lane only multiplies and adds.
fn basis(space: &ParameterSpace) -> Vec<f32> {
    let (Some(reduction), Some(d)) = (space.reduction(), space.id().coefficients()) else { return Vec::new() };
    let basis = &reduction.basis;
    let divided =
        |row: &Vec<f64>| row.iter().zip(&basis.weights).map(|(v, w)| f32::from_f64(v / w)).collect::<Vec<_>>();
    std::iter::once(&basis.mean).chain(&basis.directions[..d]).flat_map(divided).collect()
}
