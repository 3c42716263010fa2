//! Cases generated where their lanes run: sample index → point → case, a pure function of seed and index. The CPU
//! generates them here, a device in `shaders/generate.wgsl`, with the same bits.
//!
//! Points are binary32 everywhere, in every lane arithmetic. Only exact division, no root, no transcendental function:
//! the sinusoid is a polynomial, the normal deviates come from a table.

mod decode;
mod points;
mod recipe;

pub use decode::SINE;
pub use points::{ATTEMPTS, DrawnPoint, MAX_PARAMETERS, PointSource, Points};
pub use recipe::{CasePath, ColumnBound, LateralPath, MAX_BOUNDS, NO_SLOT, Recipe, ReducedColumns};

use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::Tables;
use lanesweep_model::scenario::parameterization::Variable;

use super::lane_case::LaneCase;
use super::scene::{DeviceScene, MotionKind, stays_behind};

/// A case generator: where points come from and what they mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Generator {
    /// Sample index → point.
    pub points: Points,
    /// Point → case.
    pub recipe: Recipe,
    /// The basis of a reduction: mean, then every direction, each column divided by its weight; else empty.
    pub basis: Vec<f32>,
}

impl Generator {
    /// The point of a sample index.
    #[inline]
    pub fn draw(&self, index: u64) -> DrawnPoint {
        self.points.draw(index, |point| decode::is_valid(&self.recipe, &self.basis, point))
    }

    /// The point of a sample index as the estimators take it; `None` if it is void.
    pub fn point(&self, index: u64) -> Option<Vec<f64>> {
        let drawn = self.draw(index);
        (!drawn.is_void()).then(|| drawn.values[..self.points.dimensions].iter().map(|v| f64::from(*v)).collect())
    }

    /// The case of a sample index; its series are appended to `tables`.
    pub fn case<R: Real>(&self, index: u64, tables: &mut Tables<R>) -> LaneCase<R> {
        let drawn = self.draw(index);
        if drawn.is_void() { self.recipe.void() } else { self.decode(&drawn.values, tables) }
    }

    /// The case of a valid point; its series are appended to `tables`.
    fn decode<R: Real>(&self, point: &[f32], tables: &mut Tables<R>) -> LaneCase<R> {
        decode::case(&self.recipe, &self.basis, point, tables)
    }

    /// What all lanes of verdict-only sweeps over the samples share. A void sample counts as every other: its ego stands,
    /// and its lanes end at once without a failure in any scene.
    pub fn scene(&self) -> DeviceScene {
        let recipe = &self.recipe;
        let is_paired = recipe.pair != 0;
        let (speed, lead_speed) = match recipe.path() {
            CasePath::Kinematic => (MotionKind::Analytic, MotionKind::Analytic),
            CasePath::Sinusoid => (MotionKind::Sinusoid, MotionKind::Analytic),
            CasePath::Reduced => (MotionKind::Instants, MotionKind::Instants),
        };
        let is_reduced = recipe.path() == CasePath::Reduced;
        let is_wide = |which: usize| recipe.half_widths[which] > 0.0 && recipe.ego_width > 0.0;
        let lateral = match is_reduced {
            true if recipe.columns.lateral != NO_SLOT => MotionKind::Instants,
            false if recipe.lateral != LateralPath::Centred as u32 => MotionKind::Analytic,
            _ if is_wide(0) => MotionKind::Centred,
            _ => MotionKind::Analytic,
        };
        // A target that is in the lane from the start has cut in.
        let is_in = !is_reduced && lateral == MotionKind::Centred;
        DeviceScene {
            is_paired,
            is_all_paired: is_paired,
            always_there: recipe.judged != 0,
            attends: recipe.attention.map(|rule| rule.attends_at_once(is_in)),
            may_cross: self.may_cross(),
            speeds: [speed, lead_speed],
            laterals: [lateral, if is_wide(1) { MotionKind::Centred } else { MotionKind::Analytic }],
        }
    }

    /// Whether a step of a sample may move a vehicle's centre past the ego's.
    fn may_cross(&self) -> bool {
        let recipe = &self.recipe;
        let within = |value: f64, slot: usize| value.min(f64::from(recipe.upper[slot])).max(0.0);
        let highest = |which: Variable| match recipe.slots[which as usize] {
            NO_SLOT => 0.0,
            slot => within(self.points.range(slot as usize)[1], slot as usize),
        };
        let longest_s = if recipe.unlimited != 0 {
            f64::from(recipe.step_cap) * f64::from(recipe.dt)
        } else {
            f64::from(recipe.longest_duration).min(highest(Variable::Duration).max(f64::from(recipe.min_duration)))
        };
        let kinematic = |speed, acceleration| highest(speed) + highest(acceleration) * longest_s;
        let fastest = match recipe.path() {
            CasePath::Kinematic | CasePath::Sinusoid => [
                kinematic(Variable::TargetSpeed, Variable::TargetAcceleration),
                kinematic(Variable::LeadSpeed, Variable::LeadAcceleration),
            ]
            .map(|speed| speed.max(highest(Variable::EgoSpeed))),
            CasePath::Reduced => {
                let columns = &recipe.columns;
                let series = |first: u32| match first {
                    NO_SLOT => 0.0,
                    first => (first..first + columns.instants).map(|c| self.highest_of(c)).fold(0.0, f64::max),
                };
                [columns.speed, columns.lead_speed].map(|first| series(first).max(self.highest_of(columns.ego_speed)))
            }
        };
        let dt = f64::from(recipe.dt);
        let stays = |which: usize| stays_behind(fastest[which], f64::from(recipe.half_lengths[which]), dt);
        !(stays(0) && (recipe.pair == 0 || stays(1)))
    }

    /// The highest value of a column of a reduction over all draws.
    fn highest_of(&self, column: u32) -> f64 {
        let columns = &self.recipe.columns;
        let basis = |row: u32| f64::from(self.basis[(row * columns.width + column) as usize]);
        let largest = |k: u32| {
            let [low, high] = self.points.range(k as usize);
            (low * basis(k + 1)).max(high * basis(k + 1))
        };
        basis(0) + (0..columns.coefficients).map(largest).sum::<f64>()
    }

    /// Entries of one case in a device's table of instants: the last instant of a series is there twice.
    pub fn case_instants(&self) -> u32 {
        let columns = &self.recipe.columns;
        let others = [columns.lateral, columns.lead_speed].into_iter().filter(|first| *first != NO_SLOT);
        let series = 1 + others.count() as u32;
        if self.recipe.path() == CasePath::Reduced { series * (self.recipe.columns.instants + 1) } else { 0 }
    }

    /// What is the same for all samples and decides what a device's generator does: constants of its pipeline, by their
    /// names in the shaders.
    pub fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        let (recipe, points) = (&self.recipe, &self.points);
        let flag = |is_set: bool| f64::from(u8::from(is_set));
        let source = match points.source {
            PointSource::Random(_) => 0.0,
            PointSource::Given => 1.0,
        };
        let mut all = vec![
            ("points_source", source),
            ("recipe_path", f64::from(recipe.path)),
            ("recipe_lateral", f64::from(recipe.lateral)),
            ("recipe_dimensions", f64::from(recipe.dimensions)),
            ("recipe_coefficients", f64::from(recipe.columns.coefficients)),
            ("recipe_bounded", f64::from(recipe.bounded)),
            ("recipe_pair", flag(recipe.pair != 0)),
            ("recipe_changes_lane", flag(recipe.columns.lateral != NO_SLOT)),
            ("recipe_decelerates", flag(recipe.decelerates != 0)),
            ("recipe_unlimited", flag(recipe.unlimited != 0)),
            ("recipe_instants", f64::from(recipe.columns.instants.max(2))),
            ("motion_inverse_dt", f64::from(recipe.inverse_dt)),
        ];
        let names = [
            "slot_target_speed",
            "slot_lateral_speed",
            "slot_ego_speed",
            "slot_target_acceleration",
            "slot_lead_speed",
            "slot_lead_acceleration",
            "slot_lead_gap",
            "slot_duration",
            "slot_final_speed",
            "slot_mean_deceleration",
            "slot_time_headway",
        ];
        all.extend(names.into_iter().zip(recipe.slots.map(f64::from)));
        all
    }
}
