//! One scenario of a study as bytes: what its cases follow from, and nothing else. A plan is made of such records, and
//! its hash is that of their bytes; `docs/src/reference/files.md` describes them.

use std::ops::Range;

use crate::scenario::{Category, Ego, Other, Scenario, Side};

/// Bits of the byte of flags.
const RIGHT: u8 = 1;
const HAS_LEAD: u8 = 2;
const HAS_GAP: u8 = 4;
/// Largest record: hours at 1000 samples a second fit.
pub(crate) const MAX_RECORD: usize = 256 << 20;

/// Bytes that the record of a scenario has at most.
pub(crate) fn max_bytes(scenario: &Scenario) -> usize {
    let series = if scenario.category == Category::Lvd { 1 } else { 2 + usize::from(scenario.lead.is_some()) };
    13 + scenario.id.len() + 8 * (10 + series * scenario.target.v.len())
}

/// Appends the record of a scenario; with the gap that it starts from, where no headway sets it.
pub(crate) fn write(scenario: &Scenario, gap_m: Option<f64>, bytes: &mut Vec<u8>) {
    let ahead = scenario.lead.as_ref().zip(scenario.lead_gap).filter(|_| scenario.category == Category::CutOut);
    let begin = bytes.len();
    bytes.extend([0; 4]);
    bytes.extend((scenario.id.len() as u32).to_le_bytes());
    bytes.extend(scenario.id.as_bytes());
    bytes.extend((scenario.target.v.len() as u32).to_le_bytes());
    let flag = |is_set: bool, bit: u8| if is_set { bit } else { 0 };
    bytes.push(
        flag(scenario.side == Side::Right, RIGHT) | flag(ahead.is_some(), HAS_LEAD) | flag(gap_m.is_some(), HAS_GAP),
    );
    let ego = &scenario.ego;
    let mut floats = |list: &[f64]| list.iter().for_each(|value| bytes.extend(value.to_bits().to_le_bytes()));
    floats(&[scenario.fps, ego.v0, ego.length, ego.width, scenario.target.length, scenario.target.width]);
    floats(&scenario.target.v);
    if scenario.category != Category::Lvd {
        floats(&scenario.target.y);
    }
    if let Some((lead, gap)) = ahead {
        floats(&[lead.length, lead.width, gap]);
        floats(&lead.v);
    }
    floats(gap_m.as_slice());
    let size = (bytes.len() - begin - 4) as u32;
    bytes[begin..begin + 4].copy_from_slice(&size.to_le_bytes());
}

/// Reads parts of a record one after the other.
struct Parts<'a>(&'a [u8]);

impl<'a> Parts<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    fn word(&mut self) -> Option<u32> {
        self.bytes(4)?.try_into().ok().map(u32::from_le_bytes)
    }

    fn float(&mut self) -> Option<f64> {
        self.bytes(8)?.try_into().ok().map(|bytes| f64::from_bits(u64::from_le_bytes(bytes)))
    }

    fn floats(&mut self, count: usize) -> Option<Vec<f64>> {
        let (values, _) = self.bytes(count.checked_mul(8)?)?.as_chunks();
        Some(values.iter().map(|bytes| f64::from_bits(u64::from_le_bytes(*bytes))).collect())
    }
}

/// Number of bytes of the record that these bytes begin with, if it is whole.
pub(crate) fn length(bytes: &[u8]) -> Option<usize> {
    let size = Parts(bytes).word()? as usize;
    (size <= MAX_RECORD && 4 + size <= bytes.len()).then_some(4 + size)
}

/// The id in a whole record.
pub(crate) fn id(record: &[u8]) -> Option<&str> {
    let mut parts = Parts(record.get(4..)?);
    let length = parts.word()? as usize;
    std::str::from_utf8(parts.bytes(length)?).ok()
}

/// The scenario of a whole record. Fields that no case follows from are empty.
pub(crate) fn read(record: &[u8], category: Category) -> Option<Scenario> {
    let id = id(record)?.to_owned();
    let mut parts = Parts(record.get(8 + id.len()..)?);
    let samples = parts.word()? as usize;
    let flags = *parts.bytes(1)?.first()?;
    let has_lead = flags & HAS_LEAD != 0;
    if flags > RIGHT | HAS_LEAD | HAS_GAP || has_lead != (category == Category::CutOut) {
        return None;
    }
    let [fps, v0, length, width] = [parts.float()?, parts.float()?, parts.float()?, parts.float()?];
    let ego = Ego { v0, length, width };
    let (length, width, v) = (parts.float()?, parts.float()?, parts.floats(samples)?);
    let y = if category == Category::Lvd { vec![0.0; samples] } else { parts.floats(samples)? };
    let target = Other { length, width, v, y };
    let (mut lead, mut lead_gap) = (None, None);
    if has_lead {
        let (length, width) = (parts.float()?, parts.float()?);
        lead_gap = Some(parts.float()?);
        lead = Some(Other { length, width, v: parts.floats(samples)?, y: vec![0.0; samples] });
    }
    let gap0 = if flags & HAS_GAP != 0 { Some(parts.float()?) } else { None };
    let is_whole = parts.0.is_empty();
    is_whole.then(|| Scenario {
        id,
        category,
        recording: String::new(),
        ego_id: 0,
        target_id: 0,
        lead_id: None,
        frame0: 0,
        frame1: 0,
        fps,
        kept: true,
        // The study's facts tell it.
        synthetic: false,
        reason: String::new(),
        ego,
        // No case follows from it.
        lane_width: 3.5,
        side: if flags & RIGHT != 0 { Side::Right } else { Side::Left },
        target,
        lead,
        thw0: None,
        gap0,
        lead_gap,
        peak_decel: None,
        truncated_start: None,
        end_cause: None,
        frame_switch: None,
        tag_frames: None,
    })
}

/// UnitRecords of consecutive units.
#[derive(Default)]
pub(crate) struct UnitRecords {
    /// Unit of the first one.
    pub first: u64,
    pub bytes: Vec<u8>,
    /// Where each one ends.
    pub ends: Vec<usize>,
}

impl UnitRecords {
    /// Appends the record of the next unit.
    pub fn push(&mut self, record: &[u8]) {
        self.bytes.extend_from_slice(record);
        self.ends.push(self.bytes.len());
    }

    pub fn get(&self, unit: u64) -> Option<&[u8]> {
        let at = usize::try_from(unit.checked_sub(self.first)?).ok()?;
        let end = *self.ends.get(at)?;
        Some(&self.bytes[at.checked_sub(1).map_or(0, |before| self.ends[before])..end])
    }

    /// The units.
    pub fn units(&self) -> Range<u64> {
        self.first..self.first + self.ends.len() as u64
    }
}

/// The ids of the scenarios held.
pub(super) fn unit_ids(held: &UnitRecords) -> Vec<String> {
    let ids = held.units().map(|unit| held.get(unit).and_then(id).unwrap_or_default().to_owned());
    ids.collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::traffic::mining::{MiningOptions, mine_generated};
    use crate::traffic::trajectory::generator::GeneratorOptions;

    fn records() -> Vec<(Scenario, Vec<u8>)> {
        let options = GeneratorOptions { recordings: 2, ..GeneratorOptions::default() };
        let mined = mine_generated(&options, &MiningOptions::default(), || ()).unwrap().scenarios;
        let of = |scenario: Scenario| {
            let mut bytes = Vec::new();
            // Every second with a gap.
            write(&scenario, scenario.gap0.filter(|_| scenario.frame0 % 2 == 0), &mut bytes);
            (scenario, bytes)
        };
        mined.into_iter().filter(|scenario| scenario.kept).map(of).collect()
    }

    #[test]
    fn a_record_is_the_same_record_once_read_and_small() {
        let records = records();
        assert!(Category::ALL.iter().all(|category| records.iter().any(|(s, _)| s.category == *category)));
        for (scenario, bytes) in &records {
            assert_eq!(length(bytes), Some(bytes.len()));
            assert!(bytes.len() <= max_bytes(scenario));
            let read = read(bytes, scenario.category).unwrap();
            let mut again = Vec::new();
            write(&read, read.gap0, &mut again);
            assert!(&again == bytes && read.id == scenario.id, "{}", scenario.id);
        }
        let mean = records.iter().map(|(_, bytes)| bytes.len()).sum::<usize>() / records.len();
        assert!(mean < 3000, "{mean} bytes per scenario");
    }

    #[test]
    fn a_cut_or_lengthened_record_and_one_of_another_category_is_none() {
        for (scenario, bytes) in records().iter().take(60) {
            for cut in 0..bytes.len() {
                assert!(length(&bytes[..cut]).is_none() && read(&bytes[..cut], scenario.category).is_none());
            }
            let longer = [&bytes[..], &[0]].concat();
            assert!(read(&longer, scenario.category).is_none());
            for other in Category::ALL.into_iter().filter(|other| *other != scenario.category) {
                assert!(read(bytes, other).is_none(), "{} as {}", scenario.id, other.key());
            }
        }
    }

    /// Any bits: normal and subnormal numbers, both zeros, infinities, NaN with any payload.
    fn float() -> impl Strategy<Value = f64> {
        let special = [0.0, -0.0, 5e-324, -5e-324, f64::MIN_POSITIVE, f64::MAX, f64::INFINITY, f64::NEG_INFINITY];
        let payload = (1_u64..1 << 52).prop_map(|payload| f64::from_bits(0x7ff << 52 | payload));
        prop_oneof![
            2 => any::<u64>().prop_map(f64::from_bits),
            1 => prop::sample::select(special.to_vec()),
            1 => payload,
        ]
    }

    proptest! {
        #[test]
        fn every_bit_of_every_number_comes_back(
            id in "\\PC{0,40}",
            category in prop::sample::select(Category::ALL.to_vec()),
            is_right in any::<bool>(),
            sizes in prop::array::uniform9(float()),
            gap_m in prop::option::of(float()),
            series in prop::collection::vec([float(), float(), float()], 0..80),
        ) {
            let [fps, v0, ego_length, ego_width, target_length, target_width, lead_length, lead_width, gap] = sizes;
            let of = |at: usize| series.iter().map(|values| values[at]).collect::<Vec<f64>>();
            let mut scenario = empty();
            (scenario.id, scenario.category, scenario.fps) = (id, category, fps);
            scenario.side = if is_right { Side::Right } else { Side::Left };
            scenario.ego = Ego { v0, length: ego_length, width: ego_width };
            scenario.target = Other { length: target_length, width: target_width, v: of(0), y: of(1) };
            let lead = Other { length: lead_length, width: lead_width, v: of(2), y: Vec::new() };
            (scenario.lead, scenario.lead_gap) = (Some(lead), Some(gap));
            let mut bytes = Vec::new();
            write(&scenario, gap_m, &mut bytes);
            prop_assert!(bytes.len() <= max_bytes(&scenario));
            prop_assert_eq!(length(&bytes), Some(bytes.len()));
            let back = read(&bytes, category).unwrap();
            prop_assert_eq!((&back.id, back.side), (&scenario.id, scenario.side));
            prop_assert_eq!(back.gap0.map(f64::to_bits), gap_m.map(f64::to_bits));
            prop_assert_eq!(bits(&back, category), bits(&scenario, category));
        }
    }

    /// A leader without samples, whose numbers are all 0.
    fn empty() -> Scenario {
        let record = [&57_u32.to_le_bytes()[..], &[0; 57]].concat();
        read(&record, Category::Lvd).unwrap()
    }

    /// The bits of every number that a case of this category follows from.
    fn bits(scenario: &Scenario, category: Category) -> Vec<u64> {
        let (ego, target) = (&scenario.ego, &scenario.target);
        let mut floats = vec![scenario.fps, ego.v0, ego.length, ego.width, target.length, target.width];
        floats.extend(&target.v);
        if category != Category::Lvd {
            floats.extend(&target.y);
        }
        if category == Category::CutOut {
            let lead = scenario.lead.as_ref().unwrap();
            floats.extend([lead.length, lead.width, scenario.lead_gap.unwrap()]);
            floats.extend(&lead.v);
        }
        floats.into_iter().map(f64::to_bits).collect()
    }
}
