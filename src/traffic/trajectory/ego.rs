//! The extent of the ego-centric view of a recording: every vehicle is ego once and sees the vehicles around it on its
//! carriageway, up to a fixed distance before its final position.

use super::Track;

/// Tolerance of geometric limits, m: data have two decimals, and without a tolerance a recording rotated by 180°
/// would give other scenarios.
pub const LIMIT_TOLERANCE_M: f64 = 1e-6;

/// Extent of an ego-centric view.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EgoViewOptions {
    /// Farthest along-road distance, centre to centre, at which another vehicle is in view, m. Paper: 100.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1e6))]
    pub range_m: f64,
    /// Distance before the ego's final position at which the view ends, m; vehicles that travel less have
    /// no view. Paper: 100.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub cut_m: f64,
}

impl Default for EgoViewOptions {
    fn default() -> Self {
        EgoViewOptions { range_m: 100.0, cut_m: 100.0 }
    }
}

impl EgoViewOptions {
    /// Last sample of a vehicle's view, itself in view: the first one that is no more than the cut before the final
    /// position. `None` if the vehicle travels less than `cut_m` from its first to its last sample.
    pub fn last_sample(&self, ego: &Track) -> Option<usize> {
        let (first, last) = (*ego.s_m.first()?, *ego.s_m.last()?);
        if last - first < self.cut_m - LIMIT_TOLERANCE_M {
            return None;
        }
        ego.s_m.iter().position(|s| last - s <= self.cut_m + LIMIT_TOLERANCE_M)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::traffic::trajectory::VehicleClass;

    /// A vehicle at 20 m/s, 10 samples per second.
    fn track(from_m: f64, samples: usize) -> Track {
        Track {
            id: 1,
            class: VehicleClass::Car,
            length_m: 4.5,
            width_m: 1.8,
            carriageway: 0,
            first_frame: 1,
            s_m: (0..samples).map(|k| from_m + 2.0 * k as f64).collect(),
            d_m: vec![-1.75; samples],
            v_s_mps: vec![20.0; samples],
            v_d_mps: vec![0.0; samples],
            a_s_mps2: vec![0.0; samples],
            lane: vec![0; samples],
        }
    }

    #[test]
    fn a_view_ends_at_the_first_sample_no_more_than_100_m_before_the_final_position() {
        // 2 m per sample, final position 400 m: 300 m is reached at sample 150.
        assert_eq!(EgoViewOptions::default().last_sample(&track(0.0, 201)), Some(150));
    }

    #[test]
    fn a_vehicle_that_travels_less_than_100_m_has_no_view_and_one_that_travels_100_m_has_one_sample() {
        let options = EgoViewOptions::default();
        assert_eq!(options.last_sample(&track(0.0, 50)), None);
        // 0.1 + 100 − 0.1 is not exactly 100 in f64: the tolerance decides.
        assert_eq!(options.last_sample(&track(0.1, 51)), Some(0));
        assert_eq!(options.last_sample(&track(0.0, 0)), None);
    }
}
