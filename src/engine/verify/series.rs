//! The motions of the threshold set: their first step is exactly a given f32, from a table or by arithmetic.

use super::{CaseRandom, Purpose};
use lanesweep_model::scenario::{Category, LATERAL_SAMPLED, Lateral, Motion, SPEED_SAMPLED, Speed, Tables};

/// Neighbour of 0: far below the change of one step, and large enough that neither its third power (a form of the
/// BTN) nor a quotient of its squares is subnormal, which devices may flush.
pub(super) const TINY: f32 = 1.0 / (1_u64 << 32) as f32;

/// Series per kind.
const PER_KIND: usize = 32;

/// Lateral position and motion of a vehicle at the first step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LateralStart {
    /// In the ego's lane.
    Ahead,
    /// In the next lane, coming in.
    Coming,
    /// In the next lane, with lateral speed 0.
    Beside,
}

/// The series of the set and the tables of its motions.
pub(super) struct ThresholdSeries {
    dt_s: f64,
    /// All series.
    pub tables: Tables<f64>,
    /// The tables for lanes.
    pub lane_tables: Tables<f32>,
    /// Begin and length of each speed series.
    speeds: Vec<[u32; 2]>,
    /// Begin and length of each lateral series, in the order of [`LateralStart`]. Those of `Beside` are in groups of three:
    /// lateral speed 0, −2⁻³², 2⁻³².
    across: [Vec<[u32; 2]>; 3],
}

/// The f32 nearest to a number.
pub(super) fn rounded(x: f64) -> f32 {
    x as f32
}

impl ThresholdSeries {
    pub(super) fn new(seed: u64, dt_s: f64) -> ThresholdSeries {
        let (mut tables, mut speeds, mut across) = (Tables::default(), Vec::new(), [const { Vec::new() }; 3]);
        let draw = |kind, k| CaseRandom::new(Purpose::ThresholdPool, seed, Category::CutIn, k as u64, kind);
        for k in 0..PER_KIND {
            let mut draw = draw(0, k);
            let (start, acceleration) = (f64::from(rounded(draw.between(2.0, 30.0))), draw.between(-6.0, 2.0));
            let len = 1 + draw.below(120);
            speeds.push([tables.speed.len() as u32, len as u32]);
            tables.speed.extend((0..len).map(|i| (start + acceleration * dt_s * i as f64).max(0.0)));
        }
        for kind in [LateralStart::Ahead, LateralStart::Coming, LateralStart::Beside] {
            for k in 0..PER_KIND {
                let mut draw = draw(1 + kind as usize, k);
                let (y, w) = place(&mut draw, kind);
                let len = 1 + draw.below(90);
                let every = if kind == LateralStart::Beside { vec![0.0, -TINY, TINY] } else { vec![w] };
                for w in every.into_iter().map(f64::from) {
                    across[kind as usize].push([tables.lateral.len() as u32, len as u32]);
                    let y = f64::from(y);
                    tables.lateral.extend((0..len).map(|i| [y - y.signum() * w * dt_s * i as f64, w]));
                }
            }
        }
        ThresholdSeries { dt_s, lane_tables: tables.cast(), tables, speeds, across }
    }

    /// A motion of a kind ([`Motion::kind`]).
    pub(super) fn motion(&self, draw: &mut CaseRandom, kind: u32, across: LateralStart) -> Motion<f64> {
        let (y, w) = place(draw, across);
        let lateral = if across == LateralStart::Ahead && draw.chance(0.5) {
            Lateral::Centred
        } else {
            let (start_m, rate_mps) = (f64::from(y), -f64::from(y.signum() * w));
            let end_m = if w > 0.0 { 0.0 } else { start_m };
            Lateral::Kinematic { start_m, rate_mps, end_m }
        };
        let speed = Speed::Kinematic {
            initial_mps: f64::from(rounded(draw.between(2.0, 30.0))),
            acceleration_mps2: [0.0, -4.0, 1.0][draw.below(3)],
            until_s: draw.between(0.0, 4.0),
        };
        let mut motion = Motion::encode(&speed, &lateral, self.dt_s, &mut Tables::default());
        motion.kind = kind;
        if kind & SPEED_SAMPLED != 0 {
            [motion.speed_offset, motion.speed_len] = self.speeds[draw.below(self.speeds.len())];
        }
        if kind & LATERAL_SAMPLED != 0 {
            let every = &self.across[across as usize];
            let step = if across == LateralStart::Beside { 3 } else { 1 };
            [motion.lateral_offset, motion.lateral_len] = every[step * draw.below(every.len() / step)];
        }
        motion
    }

    /// The same motion beside the ego with lateral speed 0, −2⁻³² or 2⁻³².
    pub(super) fn still(&self, mut motion: Motion<f64>, side: usize) -> Motion<f64> {
        motion.lateral_offset += motion.lateral_len * side as u32;
        motion.lateral_towards = f64::from([0.0, -TINY, TINY][side]);
        motion
    }

    /// The same motion with another kinematic speed along the road.
    pub(super) fn with_speed(
        &self,
        mut motion: Motion<f64>,
        initial_mps: f32,
        acceleration_mps2: f64,
        until_s: f64,
    ) -> Motion<f64> {
        let speed = Speed::Kinematic { initial_mps: f64::from(initial_mps), acceleration_mps2, until_s };
        motion.set_speed(&speed, self.dt_s, &mut Tables::default());
        motion
    }

    /// The same motion with another kinematic motion across the road.
    pub(super) fn with_lateral(&self, mut motion: Motion<f64>, lateral: &Lateral) -> Motion<f64> {
        motion.set_lateral(lateral, self.dt_s, &mut Tables::default());
        motion
    }
}

/// Position and speed towards the ego, each a number of the lane arithmetic.
fn place(draw: &mut CaseRandom, across: LateralStart) -> (f32, f32) {
    let side = draw.sign();
    let (y, w) = match across {
        LateralStart::Ahead => (draw.between(0.05, 0.4), 0.0),
        LateralStart::Coming => (draw.between(1.8, 4.8), draw.between(0.3, 2.0)),
        LateralStart::Beside => (draw.between(1.8, 4.8), 0.0),
    };
    (rounded(side * y), rounded(w))
}
