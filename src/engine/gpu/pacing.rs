//! Sizes that follow the device's speed: lanes of a job, and how invocations share the lanes of a dispatch.

use super::shader::{BURST, LONGEST_BURST};

/// Target time of the longest dispatch of a job, s.
const TARGET_S: f64 = 0.1;
/// Maximum factor of one change, so that one outlier has little effect.
const MAX_CHANGE: f64 = 4.0;

/// The size of the next job, from the time of the last: a dispatch of about a tenth of a second. Longer ones can exceed
/// the time-outs of desktop drivers; shorter ones wait for the host. Results do not depend on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pacer {
    lanes: u64,
}

impl Pacer {
    /// Starts with `lanes` per model.
    pub(super) fn new(lanes: u64) -> Pacer {
        Pacer { lanes: lanes.max(1) }
    }

    /// Takes a job into account: lanes per model and the time of its slowest dispatch, s.
    pub(super) fn observe(&mut self, lanes: u64, slowest_s: f64) {
        if lanes == 0 || !slowest_s.is_finite() || slowest_s <= 0.0 {
            return;
        }
        // A small last piece is not representative, because its start takes as long as that of a large one.
        let change = (TARGET_S / slowest_s).clamp(1.0 / MAX_CHANGE, MAX_CHANGE);
        let wanted = lanes as f64 * change;
        if change < 1.0 || wanted > self.lanes as f64 {
            self.lanes = (wanted as u64).max(1);
        }
    }

    /// Units of a job with `lanes_per_unit` lanes per model each: at least one, within `max_lanes`.
    pub(super) fn units(&self, lanes_per_unit: u64, max_lanes: u64) -> u64 {
        (self.lanes.min(max_lanes) / lanes_per_unit.max(1)).max(1)
    }

    /// Lanes per model of the next job.
    pub(super) fn lanes(&self) -> u64 {
        self.lanes
    }
}

/// How the invocations of a dispatch share its lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sharing {
    /// Average number of lanes per invocation.
    pub lanes: u32,
    /// Steps between two looks for lanes that have ended.
    pub burst: u32,
}

/// Which sharing is fastest for a pipeline: some numbers of lanes per invocation are timed, then some bursts with the fastest of
/// them, once each and on dispatches that are long enough to tell. Results do not depend on it.
#[derive(Debug, Clone, Default)]
pub(super) struct Tuner {
    /// Lanes per second of each trial.
    trials: Vec<(Sharing, f64)>,
    /// A long dispatch was seen: the trials begin.
    is_warm: bool,
}

impl Tuner {
    /// A warp of lanes that differ much likes many, one of neighbours that are alike one, a long step fewer.
    const LANES: [u32; 4] = [16, 8, 1, 32];
    const BURSTS: [u32; 2] = [8, LONGEST_BURST];
    /// A shorter dispatch tells nothing, s.
    const LONG_S: f64 = 0.004;

    /// The next trial, or the fastest; `None` before the first long dispatch.
    pub(super) fn choice(&self) -> Option<Sharing> {
        if !self.is_warm {
            return None;
        }
        let tried = self.trials.len();
        if let Some(&lanes) = Self::LANES.get(tried) {
            return Some(Sharing { lanes, burst: BURST });
        }
        let (fastest, _) = self.trials.iter().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let next = Self::BURSTS.get(tried - Self::LANES.len());
        Some(next.map_or(*fastest, |&burst| Sharing { burst, ..self.fastest_lanes() }))
    }

    /// The fastest of the trials of lanes, which are the first.
    fn fastest_lanes(&self) -> Sharing {
        let first = self.trials.iter().take(Self::LANES.len());
        let fastest = first.max_by(|(_, a), (_, b)| a.total_cmp(b));
        fastest.map_or(Sharing { lanes: Self::LANES[0], burst: BURST }, |(sharing, _)| *sharing)
    }

    /// Takes a dispatch into account. Returns its choice once, when the last trial has ended.
    pub(super) fn observe(&mut self, lanes: u32, sharing: Sharing, seconds: f64) -> Option<Sharing> {
        if seconds < Self::LONG_S || !seconds.is_finite() {
            return None;
        }
        let is_trial = self.trials.len() < Self::LANES.len() + Self::BURSTS.len() && self.choice() == Some(sharing);
        self.is_warm = true;
        if !is_trial {
            return None;
        }
        self.trials.push((sharing, f64::from(lanes) / seconds));
        (self.trials.len() == Self::LANES.len() + Self::BURSTS.len()).then(|| self.choice())?
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

    /// Dispatches of a device on which one sharing is faster than all others.
    #[test]
    fn the_fastest_sharing_is_found_and_kept() {
        for best in Tuner::LANES.into_iter().flat_map(|lanes| [8, 16, 32].map(|burst| Sharing { lanes, burst })) {
            let mut tuner = Tuner::default();
            let mut sharing = Sharing { lanes: 4, burst: BURST };
            assert!(tuner.observe(1 << 22, sharing, 0.001).is_none() && tuner.choice().is_none(), "too short");
            let mut found = Vec::new();
            for _ in 0..12 {
                let slower = 0.1 * f64::from(u8::from(sharing.lanes != best.lanes));
                let seconds = 0.05 + slower + 0.02 * f64::from(u8::from(sharing.burst != best.burst));
                found.extend(tuner.observe(1 << 22, sharing, seconds));
                sharing = tuner.choice().unwrap();
            }
            assert_eq!((sharing, found), (best, vec![best]));
        }
    }
}
