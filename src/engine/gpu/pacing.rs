//! Size of a dispatch: about a tenth of a second. Longer ones can exceed the time-outs of desktop drivers and freeze
//! a screen; shorter ones wait for the host. Results do not depend on it.

/// Target time of the longest dispatch of a job, s.
const TARGET_S: f64 = 0.1;
/// Maximum factor of one change, so that one outlier has little effect.
const MAX_CHANGE: f64 = 4.0;

/// The size of the next job, from the time of the last.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pacer {
    lanes: u64,
}

impl Pacer {
    /// Starts with `lanes` per model.
    pub fn new(lanes: u64) -> Pacer {
        Pacer { lanes: lanes.max(1) }
    }

    /// Takes a job into account: lanes per model and the time of its slowest dispatch, s.
    pub fn observe(&mut self, lanes: u64, slowest_s: f64) {
        if lanes == 0 || !slowest_s.is_finite() || slowest_s <= 0.0 {
            return;
        }
        // A small last piece is not representative, because its start takes as long.
        let change = (TARGET_S / slowest_s).clamp(1.0 / MAX_CHANGE, MAX_CHANGE);
        let wanted = lanes as f64 * change;
        if change < 1.0 || wanted > self.lanes as f64 {
            self.lanes = (wanted as u64).max(1);
        }
    }

    /// Units of a job with `lanes_per_unit` lanes per model each: at least one, within `max_lanes`.
    pub fn units(&self, lanes_per_unit: u64, max_lanes: u64) -> u64 {
        (self.lanes.min(max_lanes) / lanes_per_unit.max(1)).max(1)
    }

    /// Lanes per model of the next job.
    pub fn lanes(&self) -> u64 {
        self.lanes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_grow_to_the_target_and_no_further() {
        let mut pacer = Pacer::new(1 << 14);
        for _ in 0..20 {
            let lanes = pacer.lanes();
            // A device of a hundred million lanes per second.
            pacer.observe(lanes, lanes as f64 / 1e8);
        }
        assert!((pacer.lanes() as f64 / 1e8 - TARGET_S).abs() < 0.01 * TARGET_S, "{}", pacer.lanes());
    }

    #[test]
    fn a_slow_job_makes_the_next_one_smaller_and_a_small_last_piece_does_not() {
        let mut pacer = Pacer::new(1 << 20);
        pacer.observe(1 << 20, 10.0);
        assert_eq!(pacer.lanes(), 1 << 18);
        pacer.observe(100, 0.05);
        assert_eq!(pacer.lanes(), 1 << 18);
    }

    #[test]
    fn a_job_holds_at_least_one_unit_and_never_more_than_the_device_can() {
        let pacer = Pacer::new(1000);
        assert_eq!(pacer.units(5000, u64::MAX), 1);
        assert_eq!(pacer.units(10, u64::MAX), 100);
        assert_eq!(pacer.units(10, 50), 5);
    }
}
