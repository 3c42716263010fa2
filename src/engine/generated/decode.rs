//! Point → validity and case. Twin: `shaders/shared/decode.wgsl`, with the same names and order.

use crate::lane_case::{LaneCase, LaneOther};
use lanesweep_model::driver::{LaneGeometry, NEVER};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::parameterization::Variable;
use lanesweep_model::scenario::{LATERAL_SAMPLED, Motion, SPEED_SAMPLED, Tables};

use super::recipe::{CasePath, LateralPath, NO_SLOT, Recipe};

/// An event up to this many steps after a step counts as at that step.
const STEP_TOLERANCE: f64 = 1e-4;
/// Latest step of an event.
const MAX_STEPS: f64 = 1e6;

/// sin(πx/2) on [0, 1] as x·p(x²): the series to degree 11. With binary32's rounding its error is below 2·10⁻⁷.
pub const SINE: [f64; 6] = [
    std::f64::consts::FRAC_PI_2,
    -0.645_964_097_506_246_3,
    0.079_692_626_246_167_05,
    -0.004_681_754_135_318_688,
    0.000_160_441_184_787_359_82,
    -3.598_843_235_212_085e-6,
];

/// Is the point inside the valid region?
pub(super) fn is_valid(recipe: &Recipe, basis: &[f32], point: &[f32]) -> bool {
    for (j, &value) in point.iter().enumerate() {
        if !(value >= recipe.lower[j] && value <= recipe.upper[j]) {
            return false;
        }
    }
    for bound in &recipe.bounds[..recipe.bounded as usize] {
        let value = column::<f32>(recipe, basis, point, bound.column);
        let value = if bound.is_distance != 0 { value.abs() } else { value };
        if !(value >= bound.lower && value <= bound.upper) {
            return false;
        }
    }
    if recipe.decelerates != 0 {
        let (initial, end) = (at(recipe, point, Variable::TargetSpeed), at(recipe, point, Variable::FinalSpeed));
        if end >= initial {
            return false;
        }
        let duration = (initial - end).exact_div(at(recipe, point, Variable::MeanDeceleration));
        return duration >= recipe.min_duration && duration <= recipe.longest_duration;
    }
    true
}

/// The case of a valid point; its series are appended to `tables`.
pub(super) fn case<R: Real>(recipe: &Recipe, basis: &[f32], point: &[f32], tables: &mut Tables<R>) -> LaneCase<R> {
    let number = |value: f32| R::from_f64(value.into());
    let is_reduced = recipe.path() == CasePath::Reduced;
    let (mut principal, mut ahead) = (Motion::default(), Motion::default());
    let (ego_speed, lead_gap, horizon);
    if is_reduced {
        let columns = &recipe.columns;
        let duration: R = column(recipe, basis, point, columns.duration);
        reduced_speed(recipe, basis, point, columns.speed, duration, &mut principal, tables);
        if columns.lateral != NO_SLOT {
            reduced_lateral(recipe, basis, point, duration, &mut principal, tables);
        }
        if columns.lead_speed != NO_SLOT {
            reduced_speed(recipe, basis, point, columns.lead_speed, duration, &mut ahead, tables);
        }
        ego_speed = column(recipe, basis, point, columns.ego_speed);
        lead_gap = if columns.lead_gap == NO_SLOT { R::ZERO } else { column(recipe, basis, point, columns.lead_gap) };
        horizon = steps_up(duration * number(recipe.inverse_dt));
    } else {
        let value = |variable| number(at(recipe, point, variable));
        let initial = value(Variable::TargetSpeed);
        let mut duration = value(Variable::Duration);
        if recipe.decelerates != 0 {
            let (end, deceleration) = (value(Variable::FinalSpeed), value(Variable::MeanDeceleration));
            duration = (initial - end).exact_div(deceleration);
            if recipe.path() == CasePath::Sinusoid {
                sinusoidal_speed(recipe, initial, end, duration, &mut principal, tables);
            } else {
                kinematic_speed(recipe, initial, -deceleration, duration, &mut principal);
                principal.speed_end = end;
            }
        } else {
            kinematic_speed(recipe, initial, value(Variable::TargetAcceleration), duration, &mut principal);
        }
        let lead_speed = value(Variable::LeadSpeed);
        kinematic_speed(recipe, lead_speed, value(Variable::LeadAcceleration), duration, &mut ahead);
        let change = kinematic_lateral(recipe, value(Variable::LateralSpeed), &mut principal);
        let has_ego_speed = recipe.slots[Variable::EgoSpeed as usize] != NO_SLOT;
        ego_speed = if has_ego_speed { value(Variable::EgoSpeed) } else { initial };
        lead_gap = value(Variable::LeadGap);
        horizon = steps_up(duration.larger(change) * number(recipe.inverse_dt));
    }
    let headway_gap = number(at(recipe, point, Variable::TimeHeadway)) * ego_speed;
    let other = |motion, which: usize, gap_offset, judged| LaneOther {
        motion,
        half_lengths: number(recipe.half_lengths[which]),
        half_widths: number(recipe.half_widths[which]),
        gap_offset,
        present_until: NEVER,
        used: 1,
        judged,
        ..LaneOther::default()
    };
    let mut first = other(principal, 0, headway_gap, recipe.judged);
    let mut second = LaneOther { used: 0, present_until: 0, ..first };
    if recipe.pair != 0 {
        second = other(ahead, 1, headway_gap + (number(recipe.principal_length) + lead_gap), 1);
    }
    let (ego_width, lane_width) = (number(recipe.ego_width), number(recipe.lane_width));
    let marking_gap = (lane_width - ego_width) * R::HALF;
    let geometry = LaneGeometry { half_widths: first.half_widths, lane_width, marking_gap };
    for (model, rule) in recipe.attention.iter().enumerate() {
        let [of_principal, of_ahead] = rule.cast::<R>().attend_from(
            steps_seen(recipe, &first.motion),
            geometry,
            |step| first.motion.lateral(tables, step).position,
            |step| first.motion.speed(tables, step),
        );
        first.attend_from[model] = of_principal;
        second.attend_from[model] = of_ahead;
    }
    LaneCase { others: [first, second], ego_speed, ego_width, lane_width, horizon, pair: recipe.pair }
}

/// The value of a variable; 0 if no parameter gives it.
#[inline]
fn at(recipe: &Recipe, point: &[f32], variable: Variable) -> f32 {
    let slot = recipe.slots[variable as usize];
    if slot == NO_SLOT { 0.0 } else { point[slot as usize] }
}

/// A column of the vector that the coefficients of a point give.
#[inline]
fn column<R: Real>(recipe: &Recipe, basis: &[f32], point: &[f32], column: u32) -> R {
    let width = recipe.columns.width as usize;
    let mut value = R::from_f64(basis[column as usize].into());
    for k in 0..recipe.columns.coefficients as usize {
        let direction = R::from_f64(basis[(k + 1) * width + column as usize].into());
        value = value + R::from_f64(point[k].into()) * direction;
    }
    value
}

/// Number of whole steps that cover a time given in steps.
#[inline]
fn steps_up<R: Real>(time: R) -> u32 {
    let late = (time.smaller(R::from_f64(MAX_STEPS)) - R::from_f64(STEP_TOLERANCE)).larger(R::ZERO);
    let below = late.floor_to_step();
    if late > R::from_step(below) { below + 1 } else { below }
}

/// Number of steps that contain all events of a motion, and a few more.
fn steps_seen<R: Real>(recipe: &Recipe, motion: &Motion<R>) -> u32 {
    let events = [motion.speed_len, motion.lateral_len, motion.speed_until, motion.lateral_until];
    recipe.step_cap.min(events.into_iter().fold(0, u32::max) + 2)
}

/// Speed that changes by `acceleration` until `duration`, then holds.
fn kinematic_speed<R: Real>(recipe: &Recipe, initial: R, acceleration: R, duration: R, motion: &mut Motion<R>) {
    let until = steps_up(duration * R::from_f64(recipe.inverse_dt.into())).saturating_sub(1);
    motion.speed_initial = initial;
    motion.speed_per_step = acceleration * R::from_f64(recipe.dt.into());
    motion.speed_until = if recipe.unlimited != 0 { recipe.step_cap } else { until };
    motion.speed_end = (initial + acceleration * duration).larger(R::ZERO);
}

/// Lateral motion at constant speed; returns the time of the lane change, s.
fn kinematic_lateral<R: Real>(recipe: &Recipe, lateral_speed: R, motion: &mut Motion<R>) -> R {
    let (dt, way) = (R::from_f64(recipe.dt.into()), R::from_f64(recipe.lane_change.into()));
    if recipe.lateral == LateralPath::Gone as u32 {
        motion.lateral_initial = way;
        motion.lateral_end = way;
    }
    if recipe.lateral == LateralPath::Gone as u32 || recipe.lateral == LateralPath::Centred as u32 {
        return R::ZERO;
    }
    let change = way.exact_div(lateral_speed);
    let enters = recipe.lateral == LateralPath::Entering as u32;
    let per_step = lateral_speed * dt;
    motion.lateral_until = steps_up(change * R::from_f64(recipe.inverse_dt.into())).saturating_sub(1);
    motion.lateral_initial = if enters { way } else { R::ZERO };
    motion.lateral_per_step = if enters { -per_step } else { per_step };
    motion.lateral_end = if enters { R::ZERO } else { way };
    motion.lateral_towards = if enters { lateral_speed } else { -lateral_speed };
    change
}

/// Number of entries of a series of this duration.
fn entries<R: Real>(recipe: &Recipe, duration: R) -> u32 {
    steps_up(duration * R::from_f64(recipe.inverse_dt.into())).min(recipe.step_cap) + 1
}

/// v0 − Δ·sin²(πt/2T) up to T, then v1 (paper, LVD ii).
fn sinusoidal_speed<R: Real>(
    recipe: &Recipe,
    initial: R,
    end: R,
    duration: R,
    motion: &mut Motion<R>,
    tables: &mut Tables<R>,
) {
    let count = entries(recipe, duration);
    let phase_per_step = R::from_f64(recipe.dt.into()).exact_div(duration);
    motion.kind |= SPEED_SAMPLED;
    motion.speed_offset = tables.speed.len() as u32;
    motion.speed_len = count;
    for step in 0..count {
        let phase = R::from_step(step) * phase_per_step;
        let sine = quarter_sine(phase.smaller(R::ONE));
        let speed = (initial - (initial - end) * (sine * sine)).larger(R::ZERO);
        tables.speed.push(if phase < R::ONE { speed } else { end });
    }
}

/// sin(πx/2) for x in [0, 1].
fn quarter_sine<R: Real>(x: R) -> R {
    let square = x * x;
    let mut sum = R::from_f64(SINE[5]);
    for k in [4, 3, 2, 1, 0] {
        sum = sum * square + R::from_f64(SINE[k]);
    }
    x * sum
}

/// Position of a step between two instants of a reduced series.
struct Between<R> {
    below: u32,
    above: u32,
    share: R,
}

/// Instants per step of a series of this duration.
fn instants_per_step<R: Real>(recipe: &Recipe, duration: R) -> R {
    let intervals = R::from_step(recipe.columns.instants - 1);
    (intervals * R::from_f64(recipe.dt.into())).exact_div(duration)
}

fn between<R: Real>(recipe: &Recipe, step: u32, per_step: R) -> Between<R> {
    let last = recipe.columns.instants - 1;
    let position = (R::from_step(step) * per_step).smaller(R::from_step(last));
    let below = position.floor_to_step();
    Between { below, above: (below + 1).min(last), share: position - R::from_step(below) }
}

/// A speed series of the reduction: linear between its instants, never below 0.
fn reduced_speed<R: Real>(
    recipe: &Recipe,
    basis: &[f32],
    point: &[f32],
    first: u32,
    duration: R,
    motion: &mut Motion<R>,
    tables: &mut Tables<R>,
) {
    let instants: Vec<R> =
        (0..recipe.columns.instants).map(|k| column::<R>(recipe, basis, point, first + k).larger(R::ZERO)).collect();
    let count = entries(recipe, duration);
    let per_step = instants_per_step(recipe, duration);
    motion.kind |= SPEED_SAMPLED;
    motion.speed_offset = tables.speed.len() as u32;
    motion.speed_len = count;
    for step in 0..count {
        let place = between(recipe, step, per_step);
        let (below, above) = (instants[place.below as usize], instants[place.above as usize]);
        tables.speed.push(below + (above - below) * place.share);
    }
}

/// The lateral series of the reduction with its speed towards the ego, w[i] = (|y[i−1]| − |y[i]|)/dt, w[0] = w[1],
/// 0 after T.
fn reduced_lateral<R: Real>(
    recipe: &Recipe,
    basis: &[f32],
    point: &[f32],
    duration: R,
    motion: &mut Motion<R>,
    tables: &mut Tables<R>,
) {
    let instants: Vec<R> =
        (0..recipe.columns.instants).map(|k| column::<R>(recipe, basis, point, recipe.columns.lateral + k)).collect();
    let count = entries(recipe, duration);
    let per_step = instants_per_step(recipe, duration);
    let (dt, inverse_dt) = (R::from_f64(recipe.dt.into()), R::from_f64(recipe.inverse_dt.into()));
    let offset = tables.lateral.len();
    motion.kind |= LATERAL_SAMPLED;
    motion.lateral_offset = offset as u32;
    motion.lateral_len = count;
    let mut before = R::ZERO;
    for step in 0..count {
        let place = between(recipe, step, per_step);
        let (below, above) = (instants[place.below as usize], instants[place.above as usize]);
        let position = below + (above - below) * place.share;
        let inside = step > 0 && R::from_step(step) * dt <= duration;
        let towards = if inside { (before.abs() - position.abs()) * inverse_dt } else { R::ZERO };
        tables.lateral.push([position, towards]);
        if step == 1 {
            tables.lateral[offset][1] = towards;
        }
        before = position;
    }
}

#[cfg(test)]
mod tests {
    use super::quarter_sine;

    #[test]
    fn the_polynomial_is_the_sine_of_the_specification() {
        let worst = |value: &dyn Fn(f64) -> f64| {
            (0..=100_000)
                .map(|k| f64::from(k) / 1e5)
                .fold(0.0, |worst: f64, x| worst.max((value(x) - libm::sin(std::f64::consts::FRAC_PI_2 * x)).abs()))
        };
        let narrow = worst(&|x| f64::from(quarter_sine(x as f32)));
        let wide = worst(&quarter_sine::<f64>);
        assert!(narrow < 2e-7 && wide < 1e-7, "errors {narrow:e} and {wide:e}");
    }
}
