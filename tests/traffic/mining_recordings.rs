//! Mining of whole recordings against an independent implementation of the same definitions.

use crate::common;

use std::collections::BTreeMap;
use std::path::Path;

use lanesweep::scenario::{Category, Scenario, read_scenarios};
use lanesweep::traffic::mining::{Mined, MiningOptions, count, mine};
use lanesweep::traffic::trajectory::highd::{HighdFiles, read};

fn mined(dir: &Path, id: &str) -> Mined {
    mine(&read(&HighdFiles::named(dir, id)).unwrap().recording, &MiningOptions::default())
}

/// `found` rounds to the golden value, to as many decimals as that has but at most four.
fn same_rounded(found: Option<f64>, golden: &str) -> bool {
    match found {
        None => golden.is_empty(),
        Some(found) => golden.parse::<f64>().is_ok_and(|golden| (found - golden).abs() <= 0.5e-4 + 1e-9),
    }
}

#[test]
fn sumo_recordings_hold_the_scenarios_that_a_second_implementation_finds() {
    let Some(dir) = common::sumo_recordings() else { return };
    let all: Vec<Mined> = ["01", "02", "03", "04"].iter().map(|id| mined(&dir, id)).collect();
    assert_counts(&all);
    let mut ours: BTreeMap<String, &Scenario> =
        all[..2].iter().flat_map(|of| &of.scenarios).map(|s| (s.id.clone(), s)).collect();
    let with_series = common::shared("golden/paper_sumo_01_02_scenarios.jsonl");
    with_series.iter().for_each(|golden| assert_every_field(&ours, golden));
    let mut golden = csv::Reader::from_path(common::golden("mining_sumo_01_02.csv")).unwrap();
    let mut compared = 0;
    for row in golden.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let id = ["recording", "category", "ego_id", "target_id", "frame0"].map(|name| row[name].as_str()).join("_");
        let s = ours.remove(&id).unwrap_or_else(|| panic!("{id} not found"));
        assert_eq!(s.frame1.to_string(), row["frame1"], "{id}");
        assert_eq!(s.lead_id.map_or(String::new(), |l| l.to_string()), row["lead_id"], "{id}");
        assert_eq!(format!("{:?}", s.side).to_lowercase(), row["side"], "{id}");
        assert_eq!(u8::from(s.truncated_start == Some(true)).to_string(), row["truncated_start"], "{id}");
        assert_eq!(u8::from(s.kept).to_string(), row["kept"], "{id}");
        for (name, found) in [("thw0", s.thw0), ("gap0", s.gap0), ("D", s.lead_gap), ("peak_decel", s.peak_decel)] {
            assert!(same_rounded(found, &row[name]), "{id}: {name} {found:?}, golden {}", row[name]);
        }
        compared += 1;
    }
    assert_eq!(compared, 72);
    assert!(ours.is_empty(), "found besides: {:?}", ours.keys());
}

/// The series too, and everything else that the golden file says of a scenario.
fn assert_every_field(ours: &BTreeMap<String, &Scenario>, golden: &Path) {
    let golden = read_scenarios(golden).unwrap();
    assert_eq!(golden.len(), 19);
    for expected in golden {
        let mut found = Scenario::clone(ours[&expected.id]);
        let thw = found.thw0.unwrap();
        assert!((thw - expected.thw0.unwrap()).abs() <= 0.5e-4 + 1e-9, "{}", found.id);
        found.thw0 = expected.thw0; // the golden one is rounded to four decimals
        if expected.category == Category::Lvd {
            assert!(found.end_cause.is_none() && found.frame_switch.is_none());
        }
        assert_eq!(found, expected);
    }
}

/// Counts that the second implementation gives for all four recordings.
fn assert_counts(all: &[Mined]) {
    let found_and_kept = |category| {
        let counts = all.iter().map(|m| count(&m.scenarios, category));
        counts.fold((0, 0), |sum, c| (sum.0 + c.found, sum.1 + c.kept))
    };
    // Theirs are 26 and 249, because there the vehicle whose middle is ahead leads. In 04, vehicle 81 comes into the lane beside
    // vehicle 45 and stays beside it (gap -4.4 m) from frame 1014 to 1105. So it cuts in ahead of nobody, leads 45 from frame 1106
    // on (the same deceleration, found later), and 45, whose middle is ahead from 1281 on, does not lead 81. None of these is kept.
    assert_eq!(found_and_kept(Category::CutIn), (25, 3));
    assert_eq!(found_and_kept(Category::CutOut), (34, 9));
    assert_eq!(found_and_kept(Category::Lvd), (248, 43));
}
