//! Predicts the duration of a sweep from a fixed fraction of the plan's own lanes.

use std::time::{Duration, Instant};

use super::backend::{Backend, Chunk, Wanted};
use super::plan::{Block, LanePlan};
use crate::Result;

/// Lanes of the first piece: enough for every thread of a typical machine.
const FIRST_PIECE: u64 = 4096;

/// Predicted size and duration of a sweep.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Forecast {
    /// Number of lanes.
    pub lanes: u64,
    /// Predicted time, s, on this machine at its present load.
    pub seconds: f64,
    /// Lanes that were run for the measurement.
    pub measured_lanes: u64,
    /// Maximum number of lanes whose results are held at once.
    pub lanes_at_once: u64,
}

impl Forecast {
    /// Adds the forecast of a subsequent sweep.
    pub fn add(&mut self, other: &Forecast) {
        self.lanes += other.lanes;
        self.seconds += other.seconds;
        self.measured_lanes += other.measured_lanes;
        self.lanes_at_once = self.lanes_at_once.max(other.lanes_at_once);
    }
}

/// Runs lanes of every block for about `budget` in total and extrapolates. Pieces are spread over a block, because its
/// scenarios differ. They grow until one takes long enough to be timed; the first pieces do not count, because a
/// backend is slower there. `each` processes a chunk as the run itself does, because that takes time too.
///
/// # Errors
/// Those of the backend and of `each`.
pub fn forecast(
    plan: &LanePlan,
    backend: &dyn Backend,
    wanted: Wanted,
    budget: Duration,
    mut each: impl FnMut(Chunk) -> Result<()>,
) -> Result<Forecast> {
    let all = plan.lane_count().max(1) as f64;
    let mut session = backend.prepare(plan)?;
    let mut whole = Forecast::default();
    for block in plan.blocks.iter().filter(|block| !block.units.is_empty()) {
        let lanes = plan.lanes_per_unit(block) * block.units.len();
        let budget = budget.as_secs_f64() * lanes as f64 / all;
        let largest = (session.chunk_lanes(wanted) / plan.lanes_per_unit(block).max(1)).clamp(1, block.units.len());
        let mut piece = (FIRST_PIECE / plan.lanes_per_unit(block).max(1)).clamp(1, largest);
        let (mut units, mut seconds, mut count, mut ran) = (0, 0.0, 0_u64, 0);
        loop {
            let from = position(block, count, piece);
            let started = Instant::now();
            each(session.run(from..from + piece, wanted)?)?;
            let took = started.elapsed().as_secs_f64();
            count += 1;
            ran += piece;
            if took < budget / 8.0 && piece < largest {
                piece = (2 * piece).min(largest);
                (units, seconds) = (0, 0.0);
                continue;
            }
            units += piece;
            seconds += took;
            if seconds >= budget || ran >= 2 * block.units.len() {
                break;
            }
        }
        let per_unit = seconds / units as f64;
        let measured_lanes = units * plan.lanes_per_unit(block);
        let lanes_at_once = largest * plan.lanes_per_unit(block);
        whole.add(&Forecast { lanes, seconds: per_unit * block.units.len() as f64, measured_lanes, lanes_at_once });
    }
    Ok(whole)
}

/// First units of the pieces, by the golden section, so that they are spread evenly.
fn position(block: &Block, count: u64, piece: u64) -> u64 {
    let share = (count as f64 * 0.618_033_988_749_895).fract();
    block.first_unit + (share * (block.units.len() - piece) as f64) as u64
}
