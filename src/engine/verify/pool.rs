//! The series that all cases of a set share: some hundred random speeds and lateral motions of at most [`LONGEST`]
//! steps. A case refers to them, so a set of any size has the same tables.

use super::{CaseRandom, Purpose};
use lanesweep_model::scenario::{Category, Lateral, Speed, Tables};

/// Entries of the longest series.
pub(super) const LONGEST: usize = 400;
/// Series per kind.
const PER_KIND: u64 = 48;

/// A part of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slice {
    /// First entry.
    pub offset: u32,
    /// Number of entries, at least 1.
    pub len: u32,
}

/// Lateral motion of a vehicle by its role in the scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LateralRole {
    /// From the next lane into the ego's.
    In,
    /// From the ego's lane into the next.
    Out,
    /// Within the ego's lane.
    Within,
}

impl LateralRole {
    /// Magnitudes of the first and the last position, m.
    pub(super) fn ends(self, draw: &mut CaseRandom) -> (f64, f64) {
        match self {
            LateralRole::In => (draw.between(1.8, 4.2), draw.between(-0.4, 0.6)),
            LateralRole::Out => (draw.between(-0.3, 0.4), draw.between(2.2, 4.4)),
            LateralRole::Within => (draw.between(-0.8, 0.8), draw.between(-0.8, 0.8)),
        }
    }
}

/// The shared series.
pub(super) struct Pool {
    /// All series in sequence.
    pub tables: Tables<f64>,
    /// Random speeds.
    varied: Vec<Slice>,
    /// Speeds that are constant, then decrease.
    braked: Vec<Slice>,
    /// Lateral motions, in the order of [`LateralRole`].
    across: [Vec<Slice>; 3],
}

impl Pool {
    /// The pool of a seed at a time step.
    pub(super) fn new(seed: u64, dt_s: f64) -> Pool {
        let mut tables = Tables::default();
        // Here the category only separates the streams of the kinds.
        let draw = |kind: usize, k: u64| CaseRandom::new(Purpose::Pool, seed, Category::CutIn, k, kind);
        let varied = appended(&mut tables.speed, |k| varied_speed(&mut draw(0, k), dt_s));
        let braked = appended(&mut tables.speed, |k| braked_speed(&mut draw(1, k), dt_s));
        let across = [LateralRole::In, LateralRole::Out, LateralRole::Within]
            .map(|across| appended(&mut tables.lateral, |k| lateral(&mut draw(2 + across as usize, k), across, dt_s)));
        Pool { tables, varied, braked, across }
    }

    /// A part of a random speed series.
    pub(super) fn speed(&self, draw: &mut CaseRandom, braked: bool) -> (Speed, Slice) {
        let series = if braked { &self.braked } else { &self.varied };
        let slice = part(draw, series);
        (Speed::Sampled(slice.of(&self.tables.speed).to_vec()), slice)
    }

    /// A part of a random lateral series.
    pub(super) fn lateral(&self, draw: &mut CaseRandom, across: LateralRole) -> (Lateral, Slice) {
        let series = &self.across[across as usize];
        let slice = part(draw, series);
        let (position_m, towards_mps) = slice.of(&self.tables.lateral).iter().map(|&[y, w]| (y, w)).unzip();
        (Lateral::Sampled { position_m, towards_mps }, slice)
    }
}

/// Appends the series of a kind to a table.
fn appended<T>(table: &mut Vec<T>, make: impl Fn(u64) -> Vec<T>) -> Vec<Slice> {
    let append = |k| {
        let series = make(k);
        let slice = Slice { offset: table.len() as u32, len: series.len() as u32 };
        table.extend(series);
        slice
    };
    (0..PER_KIND).map(append).collect()
}

impl Slice {
    fn of<T>(self, table: &[T]) -> &[T] {
        &table[self.offset as usize..(self.offset + self.len) as usize]
    }
}

/// One of the series or, one time in three, a part of it: a case's series may begin and end anywhere.
fn part(draw: &mut CaseRandom, series: &[Slice]) -> Slice {
    let whole = series[draw.below(series.len())];
    if draw.chance(2.0 / 3.0) {
        return whole;
    }
    let from = draw.below(1 + whole.len as usize / 2) as u32;
    let len = 1 + draw.below((whole.len - from) as usize) as u32;
    Slice { offset: whole.offset + from, len }
}

/// Mostly long; one in eight has a few steps, down to a single one.
fn length(draw: &mut CaseRandom) -> usize {
    if draw.chance(0.125) { 1 + draw.below(8) } else { 40 + draw.below(LONGEST - 39) }
}

/// 3t² − 2t³: smooth from 0 to 1, without a transcendental function that platforms round differently.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Between 0 and 38 m/s: smooth between random points, or a random walk with jerks.
fn varied_speed(draw: &mut CaseRandom, dt_s: f64) -> Vec<f64> {
    let len = length(draw);
    let mut speed = draw.between(2.0, 34.0);
    let jerky = draw.chance(0.4);
    let mut series = Vec::with_capacity(len);
    while series.len() < len {
        if jerky {
            series.push(speed);
            let kick = if draw.chance(0.03) { 6.0 } else { 1.0 };
            speed = (speed + kick * draw.between(-6.0, 5.6) * dt_s).clamp(0.0, 38.0);
        } else {
            let steps = 20 + draw.below(100);
            let next = (speed + draw.between(-4.0, 3.5) * dt_s * steps as f64).clamp(0.0, 38.0);
            series.extend((0..steps).map(|k| speed + (next - speed) * smooth(k as f64 / steps as f64)));
            speed = next;
        }
    }
    series.truncate(len);
    series
}

/// Constant, then braking at up to 9 m/s², often to standstill.
fn braked_speed(draw: &mut CaseRandom, dt_s: f64) -> Vec<f64> {
    let len = length(draw);
    let start = draw.between(6.0, 36.0);
    let end = if draw.chance(0.4) { 0.0 } else { draw.between(0.0, start) };
    let (from, deceleration) = (draw.below(1 + len / 3), draw.between(1.0, 9.0));
    let braked = |k: usize| start - deceleration * dt_s * k.saturating_sub(from) as f64;
    (0..len).map(|k| braked(k).max(end)).collect()
}

/// Positions and speeds towards the ego's lane; the side is random.
fn lateral(draw: &mut CaseRandom, across: LateralRole, dt_s: f64) -> Vec<[f64; 2]> {
    let len = length(draw).max(2);
    let side = draw.sign();
    let (start, end) = across.ends(draw);
    let (from, seconds) = (draw.below(1 + len / 6) as f64, draw.between(1.5, 7.0));
    let noise = if draw.chance(0.4) { draw.between(0.0, 0.03) } else { 0.0 };
    let position: Vec<f64> = (0..len)
        .map(|k| {
            side * (start + (end - start) * smooth((k as f64 - from) * dt_s / seconds))
                + noise * draw.between(-1.0, 1.0)
        })
        .collect();
    // Towards the ego means towards y = 0; the first speed equals the second one, as in recorded scenarios.
    let towards = |k: usize| -(position[k].abs() - position[k - 1].abs()) / dt_s;
    (0..len).map(|k| [position[k], towards(k.max(1))]).collect()
}
