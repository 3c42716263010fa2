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
    pub(crate) fn frames(&self) -> impl Iterator<Item = &[VehicleAtFrame]> {
        (0..self.begin.len() - 1).map(|slot| self.slot(slot))
    }

    fn slot(&self, slot: usize) -> &[VehicleAtFrame] {
        &self.entries[self.begin[slot]..self.begin[slot + 1]]
    }
}
