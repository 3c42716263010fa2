//! The ego-centric view of a recording: every vehicle is ego once and sees the vehicles around it on its carriageway,
//! up to a fixed distance before its final position.

use super::{Recording, Track};

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

/// One vehicle's view: its samples from 0 to [`EgoView::last_sample`] and the vehicles around it.
#[derive(Debug, Clone, Copy)]
pub struct EgoView<'a> {
    recording: &'a Recording,
    ego: usize,
    last_sample: usize,
    range_m: f64,
}

impl<'a> EgoView<'a> {
    /// The view of the track with this index; `None` if there is no such track or it travels less than
    /// `cut_m` from its first to its last sample.
    pub fn of(recording: &'a Recording, ego: usize, options: &EgoViewOptions) -> Option<Self> {
        let s_m = &recording.tracks.get(ego)?.s_m;
        let (first, last) = (*s_m.first()?, *s_m.last()?);
        if last - first < options.cut_m - LIMIT_TOLERANCE_M {
            return None;
        }
        let last_sample = s_m.iter().position(|s| last - s <= options.cut_m + LIMIT_TOLERANCE_M)?;
        Some(EgoView { recording, ego, last_sample, range_m: options.range_m })
    }

    /// The ego.
    pub fn track(&self) -> &'a Track {
        &self.recording.tracks[self.ego]
    }

    /// Index of the ego in [`Recording::tracks`].
    pub fn ego(&self) -> usize {
        self.ego
    }

    /// Last ego sample of the view, itself in view: the first one that is no more than the cut before
    /// the final position.
    pub fn last_sample(&self) -> usize {
        self.last_sample
    }

    /// Every other vehicle of the carriageway that shares at least one sample with the view, in range or
    /// not, in the order of the recording.
    pub fn others(&self) -> impl Iterator<Item = Encounter<'a>> + use<'a> {
        let view = *self;
        let ego = view.track();
        view.recording.tracks.iter().enumerate().filter_map(move |(index, other)| {
            if index == view.ego || other.carriageway != ego.carriageway {
                return None;
            }
            let from = ego.first_frame.max(other.first_frame);
            let to = (ego.first_frame + view.last_sample as i64).min(other.last_frame());
            (from <= to).then(|| Encounter {
                ego,
                other,
                index,
                ego_start: (from - ego.first_frame) as usize,
                other_start: (from - other.first_frame) as usize,
                samples: (to - from + 1) as usize,
                range_m: view.range_m,
            })
        })
    }
}

/// The samples that the view of an ego shares with one other vehicle.
#[derive(Debug, Clone, Copy)]
pub struct Encounter<'a> {
    ego: &'a Track,
    /// The other vehicle.
    pub other: &'a Track,
    /// Its index in [`Recording::tracks`].
    pub index: usize,
    /// Ego sample at which they begin.
    pub ego_start: usize,
    /// The same instant as a sample of the other vehicle.
    pub other_start: usize,
    /// Number of samples, at least 1.
    pub samples: usize,
    range_m: f64,
}

/// One instant at which another vehicle is in view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Sample of the ego.
    pub ego_sample: usize,
    /// Sample of the other vehicle.
    pub other_sample: usize,
    /// How far ahead of the ego's centre the other's centre is, m.
    pub dx_m: f64,
}

impl<'a> Encounter<'a> {
    /// The instants at which the other vehicle is in range, ascending.
    pub fn sightings(&self) -> impl Iterator<Item = Sighting> + use<'a> {
        let Encounter { ego_start, other_start, samples, .. } = *self;
        let reach_m = self.range_m + LIMIT_TOLERANCE_M;
        let ego_s = &self.ego.s_m[ego_start..ego_start + samples];
        let other_s = &self.other.s_m[other_start..other_start + samples];
        ego_s.iter().zip(other_s).enumerate().filter_map(move |(k, (ego, other))| {
            let dx_m = other - ego;
            (dx_m.abs() <= reach_m).then_some(Sighting {
                ego_sample: ego_start + k,
                other_sample: other_start + k,
                dx_m,
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::traffic::trajectory::{Carriageway, VehicleClass};

    /// A vehicle at constant speed, 10 samples per second.
    fn track(id: u32, carriageway: usize, first_frame: i64, from_m: f64, speed_mps: f64, samples: usize) -> Track {
        Track {
            id,
            class: VehicleClass::Car,
            length_m: 4.5,
            width_m: 1.8,
            carriageway,
            first_frame,
            s_m: (0..samples).map(|k| from_m + speed_mps * k as f64 / 10.0).collect(),
            d_m: vec![-1.75; samples],
            v_s_mps: vec![speed_mps; samples],
            v_d_mps: vec![0.0; samples],
            a_s_mps2: vec![0.0; samples],
            lane: vec![0; samples],
        }
    }

    fn recording(tracks: Vec<Track>) -> Recording {
        let carriageway = |name: &str| Carriageway { name: name.to_owned(), lane_lines_m: vec![0.0, -3.5] };
        Recording {
            id: "01".to_owned(),
            frame_rate_hz: 10.0,
            carriageways: vec![carriageway("1"), carriageway("2")],
            tracks,
            synthetic: false,
        }
    }

    #[test]
    fn a_view_ends_at_the_first_sample_no_more_than_100_m_before_the_final_position() {
        // 2 m per sample, final position 400 m: 300 m is reached at sample 150.
        let recording = recording(vec![track(1, 0, 1, 0.0, 20.0, 201)]);
        let view = EgoView::of(&recording, 0, &EgoViewOptions::default()).unwrap();
        assert_eq!(view.last_sample(), 150);
    }

    #[test]
    fn a_vehicle_that_travels_less_than_100_m_has_no_view_and_one_that_travels_100_m_has_one_sample() {
        let recording = recording(vec![track(1, 0, 1, 0.0, 20.0, 50), track(2, 0, 1, 0.1, 20.0, 51)]);
        let options = EgoViewOptions::default();
        assert!(EgoView::of(&recording, 0, &options).is_none());
        // 0.1 + 100 − 0.1 is not exactly 100 in f64: the tolerance decides.
        assert_eq!(EgoView::of(&recording, 1, &options).unwrap().last_sample(), 0);
        assert!(EgoView::of(&recording, 2, &options).is_none());
    }

    #[test]
    fn a_view_holds_the_same_carriageway_within_100_m_while_both_are_there() {
        let recording = recording(vec![
            track(1, 0, 1, 0.0, 20.0, 201),
            // 80 m ahead and 2 m/s faster: 100 m ahead after 10 s.
            track(2, 0, 1, 80.0, 22.0, 201),
            track(3, 1, 1, 10.0, 20.0, 201),
            track(4, 0, 500, 10.0, 20.0, 201),
            // Appears 15 s after the ego, at sample 150, 50 m behind it.
            track(5, 0, 151, 250.0, 20.0, 50),
        ]);
        let view = EgoView::of(&recording, 0, &EgoViewOptions::default()).unwrap();
        let others: Vec<_> = view.others().collect();
        assert_eq!(others.iter().map(|other| other.other.id).collect::<Vec<_>>(), [2, 5]);
        assert_eq!((others[0].index, others[0].samples), (1, 151));
        let ahead: Vec<_> = others[0].sightings().collect();
        assert_eq!(ahead.last().unwrap().ego_sample, 100);
        assert!((ahead[50].dx_m - 90.0).abs() < 1e-9);
        let behind: Vec<_> = others[1].sightings().collect();
        assert_eq!(behind, [Sighting { ego_sample: 150, other_sample: 0, dx_m: -50.0 }]);
    }

    #[test]
    fn the_range_includes_its_limit_up_to_rounding() {
        let recording = recording(vec![
            track(1, 0, 1, 0.1, 20.0, 201),
            track(2, 0, 1, 100.1 + 5e-7, 20.0, 201),
            track(3, 0, 1, 100.1 + 5e-6, 20.0, 201),
        ]);
        let view = EgoView::of(&recording, 0, &EgoViewOptions::default()).unwrap();
        let seen: Vec<usize> = view.others().map(|other| other.sightings().count()).collect();
        assert_eq!(seen, [view.last_sample() + 1, 0]);
    }
}
