//! How long a sweep will take: a fixed share of the plan's own lanes is run, and the rest follows.

use std::time::{Duration, Instant};

use super::backend::{Backend, Chunk, Wanted};
use super::plan::{Block, LanePlan};
use crate::Result;

/// Lanes of the first piece: enough for every thread of a common machine.
const FIRST_PIECE: u64 = 4096;

/// What a measurement of some lanes says of all.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Forecast {
    /// All lanes.
    pub lanes: u64,
    /// Time that they will take, s, on this machine as it is loaded now.
    pub seconds: f64,
    /// Lanes that were run to know.
    pub measured_lanes: u64,
    /// Most lanes whose results are held at once.
    pub lanes_at_once: u64,
}

impl Forecast {
    /// Of a sweep after another.
    pub fn add(&mut self, other: &Forecast) {
        self.lanes += other.lanes;
        self.seconds += other.seconds;
        self.measured_lanes += other.measured_lanes;
        self.lanes_at_once = self.lanes_at_once.max(other.lanes_at_once);
    }
}

/// Runs lanes of every block for about `budget` in all and concludes on the whole. Pieces are spread over a block, as
/// its scenarios differ; they grow until one is long enough to be timed, and the first ones do not count: a backend is
/// slower there. `each` does with a chunk what the run itself will do, as that takes time too.
///
/// # Errors
/// Of the backend and of `each`.
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

/// Where the pieces begin: golden sections never come near one another.
fn position(block: &Block, count: u64, piece: u64) -> u64 {
    let share = (count as f64 * 0.618_033_988_749_895).fract();
    block.first_unit + (share * (block.units.len() - piece) as f64) as u64
}
