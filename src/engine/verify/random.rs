//! The random set: cases of every kind with plausible numbers, at headways from far ahead to behind. The fraction of
//! failing lanes stays away from 0 and 1, so that a wrong verdict is detected.

use std::sync::Arc;

use super::pool::{LateralRole, Pool, Slice};
use super::{CaseRandom, Purpose, SetOptions};
use crate::{Block, CaseSource, Headway, LaneCase, LanePlan, NO_STEP};
use lanesweep_model::driver::MODELS;
use lanesweep_model::profile::{CutOutTarget, Profile};
use lanesweep_model::scenario::{
    Ahead, Case, Category, LATERAL_SAMPLED, Lateral, Participant, SPEED_SAMPLED, Speed, Tables,
};
use lanesweep_support::Result;

/// Variants of every unit: all motions sampled (`S`), all kinematic, one of each, and corner cases.
pub const VARIANTS: [&str; 4] = ["S", "kinematic", "mixed", "degenerate"];

/// Ten starts by time and by distance: far, near, touching, overlapping along the road, and behind.
fn headways() -> Vec<Headway> {
    let by_time = [2.0, 1.2, 0.7, 0.3].map(Headway::ThwS);
    let by_distance = [45.0, 12.0, 3.0, 0.0, -2.0, -14.0].map(Headway::GapM);
    by_time.into_iter().chain(by_distance).collect()
}

/// Plans the random set of a seed. Keys are `random-cut-in-seed157-0000123`; the number is that of the unit.
///
/// # Errors
/// [`Error::Usage`](lanesweep_support::Error::Usage) without a size, categories or models, or if a category is named twice.
pub fn random_plan(profile: &Profile, options: &SetOptions) -> Result<LanePlan> {
    options.check()?;
    let headways = headways();
    let units = options.size.div_ceil((headways.len() * VARIANTS.len()) as u64);
    let block = |&category: &Category| {
        let name = |unit| format!("random-{}-seed{}-{unit:07}", category.key().replace('_', "-"), options.seed);
        Block::new(category, (0..units).map(name).collect(), VARIANTS.map(str::to_owned).to_vec())
    };
    let blocks = options.categories.iter().map(block).collect();
    let source = RandomCases::new(profile, options);
    LanePlan::new(profile.clone(), options.models.clone(), headways, blocks, Arc::new(source))
}

struct RandomCases {
    seed: u64,
    profile: Profile,
    categories: Vec<Category>,
    pool: Pool,
    frozen: Vec<Frozen>,
}

/// A cut-out whose cutting-out vehicle hits the one ahead (only in profiles with this event). The freezing needs an
/// additional series, so such pairs are drawn once, with their series, and shared.
struct Frozen {
    lane: LaneCase<f64>,
    case: Case,
}

/// A case with the ranges of its series in the pool.
struct CaseInPool {
    case: Case,
    slices: [Slices; 2],
}

/// Ranges of a vehicle's series in the pool; ignored if it has none.
#[derive(Clone, Copy)]
struct Slices {
    speed: Slice,
    lateral: Slice,
}

const NO_SLICES: Slices = Slices { speed: Slice { offset: 0, len: 0 }, lateral: Slice { offset: 0, len: 0 } };
/// Number of shared frozen pairs, and of cut-outs tried for them.
const FROZEN: usize = 32;
const FROZEN_TRIES: u64 = 2048;

impl RandomCases {
    fn new(profile: &Profile, options: &SetOptions) -> RandomCases {
        let mut cases = RandomCases {
            seed: options.seed,
            profile: profile.clone(),
            categories: options.categories.clone(),
            pool: Pool::new(options.seed, profile.frame.dt_s),
            frozen: Vec::new(),
        };
        if profile.frame.cut_out_target == CutOutTarget::Exposed && options.categories.contains(&Category::CutOut) {
            cases.freeze_some();
        }
        cases
    }

    fn freeze_some(&mut self) {
        for unit in 0..FROZEN_TRIES {
            let mut draw = CaseRandom::new(Purpose::Freeze, self.seed, Category::CutOut, unit, 0);
            let case = self.draw(&mut draw, Category::CutOut, unit as usize % 3).case;
            let mut own = Tables::default();
            let mut lane = LaneCase::encode(&case, &self.profile, &mut own);
            if !froze(&lane) {
                continue;
            }
            let tables = &mut self.pool.tables;
            for other in &mut lane.others {
                other.motion.speed_offset += tables.speed.len() as u32;
                other.motion.lateral_offset += tables.lateral.len() as u32;
            }
            tables.speed.extend(own.speed);
            tables.lateral.extend(own.lateral);
            self.frozen.push(Frozen { lane, case });
            if self.frozen.len() == FROZEN {
                break;
            }
        }
    }

    fn encode(&self, draw: &mut CaseRandom, mut drawn: CaseInPool) -> LaneCase<f64> {
        let mut scratch = Tables::default();
        let mut lane = LaneCase::encode(&drawn.case, &self.profile, &mut scratch);
        if !self.frozen.is_empty() && drawn.case.category == Category::CutOut && froze(&lane) {
            let frozen = &self.frozen[draw.below(self.frozen.len())];
            return frozen.before(&drawn.case);
        }
        if drawn.case.ahead.is_none() {
            // The unused slot repeats the principal's motion.
            drawn.slices[1] = drawn.slices[0];
        }
        for (other, slices) in lane.others.iter_mut().zip(&drawn.slices) {
            if other.motion.kind & SPEED_SAMPLED != 0 {
                other.motion.speed_offset = slices.speed.offset;
            }
            if other.motion.kind & LATERAL_SAMPLED != 0 {
                other.motion.lateral_offset = slices.lateral.offset;
            }
        }
        lane
    }

    fn draw(&self, draw: &mut CaseRandom, category: Category, variant: usize) -> CaseInPool {
        let across = match category {
            Category::CutIn => LateralRole::In,
            Category::CutOut => LateralRole::Out,
            Category::Lvd => LateralRole::Within,
        };
        let (principal, slices) = self.vehicle(draw, across, variant, category == Category::Lvd);
        let v = initial_speed(&principal.speed);
        let closing = match category {
            _ if draw.chance(0.06) => 0.0,
            Category::CutIn => draw.between(-3.0, 13.0),
            Category::CutOut => draw.between(-2.0, 6.0),
            Category::Lvd => draw.between(-2.0, 7.0),
        };
        let mut case = Case {
            category,
            ego_length_m: draw.between(3.6, 5.2),
            ego_width_m: draw.between(1.6, 2.1),
            lane_width_m: draw.between(2.7, 4.2),
            ego_speed_mps: (v + closing).max(0.0),
            principal,
            ahead: None,
            horizon_s: horizon_steps(draw) * self.profile.frame.dt_s,
        };
        let mut all = [slices, NO_SLICES];
        let paired = if category == Category::CutOut { 0.9 } else { 0.15 };
        if draw.chance(paired) {
            let across = if draw.chance(0.85) { LateralRole::Within } else { LateralRole::Out };
            let (mut vehicle, slices) = self.vehicle(draw, across, variant, true);
            if variant > 0 && draw.chance(0.35) {
                vehicle.speed = Speed::constant(if draw.chance(0.5) { 0.0 } else { v * draw.uniform() });
            }
            if category == Category::CutOut && draw.chance(0.5) {
                vehicle.lateral = Lateral::Centred;
            }
            all[1] = slices;
            case.ahead = Some(Ahead { vehicle, gap_m: draw.between(1.0, 70.0) });
        }
        CaseInPool { case, slices: all }
    }

    /// A vehicle whose motions are sampled (variant 0), kinematic (1) or one of each (others).
    fn vehicle(
        &self,
        draw: &mut CaseRandom,
        across: LateralRole,
        variant: usize,
        brakes: bool,
    ) -> (Participant, Slices) {
        let (length_m, width_m) = match draw.uniform() {
            x if x < 0.75 => (draw.between(3.6, 5.2), draw.between(1.6, 2.0)),
            x if x < 0.95 => (draw.between(8.0, 18.75), draw.between(2.3, 2.6)),
            _ => (draw.between(2.0, 2.4), draw.between(0.7, 0.9)),
        };
        let sampled_speed = variant == 0 || (variant > 1 && draw.chance(0.5));
        let sampled_lateral = variant == 0 || (variant > 1 && !sampled_speed);
        let braked = draw.chance(if brakes { 0.7 } else { 0.25 });
        let (speed, speed_slice) = match sampled_speed {
            true => self.pool.speed(draw, braked),
            false => (kinematic_speed(draw, braked), NO_SLICES.speed),
        };
        let (lateral, lateral_slice) = match sampled_lateral {
            true => self.pool.lateral(draw, across),
            false => (kinematic_lateral(draw, across), NO_SLICES.lateral),
        };
        let slices = Slices { speed: speed_slice, lateral: lateral_slice };
        (Participant { length_m, width_m, speed, lateral }, slices)
    }
}

impl CaseSource for RandomCases {
    fn case(&self, block: usize, unit: u64, variant: usize) -> LaneCase<f64> {
        let category = self.categories[block];
        let mut draw = CaseRandom::new(Purpose::Random, self.seed, category, unit, variant);
        let mut drawn = self.draw(&mut draw, category, variant);
        if variant < 3 {
            return self.encode(&mut draw, drawn);
        }
        let corner = draw.below(8);
        degenerate(&mut draw, corner, &mut drawn.case);
        let mut lane = self.encode(&mut draw, drawn);
        if corner == 7 {
            late(&mut draw, &mut lane);
        }
        lane
    }

    fn tables(&self) -> &Tables<f64> {
        &self.pool.tables
    }
}

impl Frozen {
    /// The frozen pair ahead of the ego of another case; the freezing does not depend on the ego.
    fn before(&self, ego: &Case) -> LaneCase<f64> {
        let mut lane = self.lane;
        let closing = ego.ego_speed_mps - initial_speed(&ego.principal.speed);
        lane.ego_speed = (initial_speed(&self.case.principal.speed) + closing).max(0.0);
        lane.ego_width = ego.ego_width_m;
        lane.lane_width = ego.lane_width_m;
        let ahead = self.case.ahead.as_ref().map_or(&self.case.principal, |a| &a.vehicle);
        for (other, vehicle) in lane.others.iter_mut().zip([&self.case.principal, ahead]) {
            other.half_lengths = (ego.ego_length_m + vehicle.length_m) / 2.0;
            other.half_widths = (ego.ego_width_m + vehicle.width_m) / 2.0;
        }
        lane
    }
}

/// The vehicle ahead is present until the freezing.
fn froze(lane: &LaneCase<f64>) -> bool {
    lane.pair != 0 && lane.others[1].present_until != NO_STEP
}

fn initial_speed(speed: &Speed) -> f64 {
    match speed {
        Speed::Kinematic { initial_mps, .. } => initial_mps.max(0.0),
        Speed::Sampled(series) => series.first().copied().unwrap_or(0.0),
    }
}

fn kinematic_speed(draw: &mut CaseRandom, braked: bool) -> Speed {
    let initial_mps = if draw.chance(0.06) { 0.0 } else { draw.between(2.0, 34.0) };
    let acceleration_mps2 = match draw.uniform() {
        _ if braked => draw.between(-9.0, -1.0),
        x if x < 0.4 => 0.0,
        _ => draw.between(-3.0, 2.0),
    };
    Speed::Kinematic { initial_mps, acceleration_mps2, until_s: draw.between(0.0, 6.0) }
}

fn kinematic_lateral(draw: &mut CaseRandom, across: LateralRole) -> Lateral {
    let side = draw.sign();
    if across == LateralRole::Within && draw.chance(0.6) {
        return Lateral::Centred;
    }
    let (start, end) = across.ends(draw);
    let rate = draw.between(0.3, 2.5) * if end > start { 1.0 } else { -1.0 };
    Lateral::Kinematic { start_m: side * start, rate_mps: side * rate, end_m: side * end }
}

/// A horizon: none, short or long.
fn horizon_steps(draw: &mut CaseRandom) -> f64 {
    let max = match draw.uniform() {
        x if x < 0.15 => 0,
        x if x < 0.80 => 150,
        x if x < 0.98 => 400,
        _ => 1500,
    };
    draw.below(max + 1) as f64
}

/// Cases with numbers at the ends of their ranges.
fn degenerate(draw: &mut CaseRandom, corner: usize, case: &mut Case) {
    let v = initial_speed(&case.principal.speed);
    match corner {
        0 => case.ego_speed_mps = 0.0,
        1 => case.ego_speed_mps = draw.between(0.0, 0.5),
        2 => case.ego_speed_mps = v,
        // Constant distance during the whole lane, or all vehicles stationary.
        3 => {
            let speed = if draw.chance(0.3) { 0.0 } else { v };
            case.principal.speed = Speed::constant(speed);
            case.ego_speed_mps = speed;
        }
        // Stationary in front of a fast ego.
        4 => {
            case.principal.speed = Speed::constant(0.0);
            case.ego_speed_mps = draw.between(3.0, 30.0);
        }
        5 => {
            case.principal.lateral = Lateral::Centred;
            case.horizon_s = 0.0;
        }
        // Always beside the ego, or just inside its lane.
        6 => {
            let at = draw.sign() * draw.between(0.0, 4.0);
            case.principal.lateral = Lateral::Kinematic { start_m: at, rate_mps: 0.0, end_m: at };
        }
        _ => {}
    }
}

/// Vehicles that appear late, leave early, or are noticed late.
fn late(draw: &mut CaseRandom, lane: &mut LaneCase<f64>) {
    for other in &mut lane.others[..1 + lane.pair as usize] {
        other.present_from = draw.below(60) as u32;
        if draw.chance(0.5) {
            other.present_until = other.present_from + draw.below(150) as u32;
        }
        other.attend_from = [0; MODELS].map(|_: u32| draw.below(80) as u32);
        other.judged = u32::from(draw.chance(0.8));
    }
}
