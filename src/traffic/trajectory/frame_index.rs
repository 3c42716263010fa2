//! The vehicles of one carriageway per frame, from rear to front, so that a search visits only a vehicle's neighbours.

use super::recording::Recording;

/// One vehicle at one frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VehicleAtFrame {
    /// Centre along the road, m.
    pub s_m: f64,
    /// Index into [`Recording::tracks`].
    pub track: u32,
    /// Sample of that track.
    pub sample: u32,
}

/// The vehicles of one carriageway at every frame, ascending by position along the road.
pub(crate) struct FrameIndex {
    /// First slot of each track of the recording (unused for tracks of other carriageways). A track has
    /// no gaps, so its sample `k` is in slot `base + k`.
    base: Vec<usize>,
    /// Begin of each slot's entries; one more than the number of slots.
    begin: Vec<usize>,
    entries: Vec<VehicleAtFrame>,
}

impl FrameIndex {
    /// Sorts the tracks of a carriageway by frame and position. Memory is proportional to the samples, for any
    /// distance of the frame numbers.
    pub(crate) fn new(recording: &Recording, carriageway: usize) -> Self {
        let tracks = &recording.tracks;
        let mut order: Vec<usize> =
            (0..tracks.len()).filter(|&i| tracks[i].carriageway == carriageway && !tracks[i].is_empty()).collect();
        order.sort_by_key(|&i| (tracks[i].first_frame, i));

        // Frames without vehicles get no slot: consecutive tracks either overlap or start a new block.
        let mut base = vec![0; tracks.len()];
        let (mut slots, mut block_slot, mut block_frame, mut block_last) = (0, 0, 0, i64::MIN);
        for &i in &order {
            if tracks[i].first_frame > block_last {
                (block_slot, block_frame) = (slots, tracks[i].first_frame);
            }
            block_last = block_last.max(tracks[i].last_frame());
            base[i] = block_slot + (tracks[i].first_frame - block_frame) as usize;
            slots = slots.max(base[i] + tracks[i].len());
        }

        let mut begin = vec![0; slots + 1];
        for &i in &order {
            for count in &mut begin[base[i] + 1..=base[i] + tracks[i].len()] {
                *count += 1;
            }
        }
        for slot in 0..slots {
            begin[slot + 1] += begin[slot];
        }
        let mut fill = begin.clone();
        let mut entries = vec![VehicleAtFrame { s_m: 0.0, track: 0, sample: 0 }; begin[slots]];
        for &i in &order {
            for (k, &s_m) in tracks[i].s_m.iter().enumerate() {
                let slot = base[i] + k;
                entries[fill[slot]] = VehicleAtFrame { s_m, track: i as u32, sample: k as u32 };
                fill[slot] += 1;
            }
        }
        for slot in 0..slots {
            entries[begin[slot]..begin[slot + 1]].sort_by(|a, b| a.s_m.total_cmp(&b.s_m).then(a.track.cmp(&b.track)));
        }
        FrameIndex { base, begin, entries }
    }

    /// All vehicles on the carriageway at sample `k` of the track with index `track`, that vehicle included, whose
    /// centre is ahead of `s_m` and at most at `s_max_m`; nearest first.
    pub(crate) fn ahead(
        &self,
        track: usize,
        k: usize,
        s_m: f64,
        s_max_m: f64,
    ) -> impl Iterator<Item = &VehicleAtFrame> {
        let entries = self.slot(self.base[track] + k);
        let from = entries.partition_point(|n| n.s_m <= s_m);
        entries[from..].iter().take_while(move |n| n.s_m <= s_max_m)
    }

    /// The vehicles of each frame that has some, in the order of the frames.
    pub(super) fn frames(&self) -> impl Iterator<Item = &[VehicleAtFrame]> {
        (0..self.begin.len() - 1).map(|slot| self.slot(slot))
    }

    fn slot(&self, slot: usize) -> &[VehicleAtFrame] {
        &self.entries[self.begin[slot]..self.begin[slot + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::recording::{Carriageway, Track, VehicleClass};

    fn track(id: u32, first_frame: i64, s_m: Vec<f64>) -> Track {
        let n = s_m.len();
        Track {
            id,
            class: VehicleClass::Car,
            length_m: 4.0,
            width_m: 2.0,
            carriageway: 0,
            first_frame,
            s_m,
            d_m: vec![0.0; n],
            v_s_mps: vec![0.0; n],
            v_d_mps: vec![0.0; n],
            a_s_mps2: vec![0.0; n],
            lane: vec![0; n],
        }
    }

    #[test]
    fn vehicles_ahead_come_nearest_first_and_only_from_the_same_frame() {
        let recording = Recording {
            id: "t".into(),
            synthetic: false,
            frame_rate_hz: 25.0,
            carriageways: vec![Carriageway { name: "1".into(), lane_lines_m: vec![2.0, -2.0] }],
            tracks: vec![
                track(1, 10, vec![0.0, 1.0, 2.0]),
                track(2, 11, vec![50.0, 51.0]),
                track(3, 12, vec![20.0]),
                // A second block, so far off that no table over all frames could hold it.
                track(4, 1 << 60, vec![5.0, 6.0]),
                track(5, (1 << 60) + 1, vec![7.0]),
            ],
        };
        let neighbours = FrameIndex::new(&recording, 0);
        let ids = |track: usize, k: usize, s: f64, max: f64| -> Vec<u32> {
            neighbours.ahead(track, k, s, max).map(|n| recording.tracks[n.track as usize].id).collect()
        };
        assert_eq!(ids(0, 0, 0.0, 100.0), Vec::<u32>::new());
        assert_eq!(ids(0, 1, 1.0, 100.0), [2]);
        assert_eq!(ids(0, 2, 2.0, 100.0), [3, 2]);
        assert_eq!(ids(0, 2, 2.0, 40.0), [3]);
        assert_eq!(ids(3, 1, 6.0, 100.0), [5]);
    }
}
