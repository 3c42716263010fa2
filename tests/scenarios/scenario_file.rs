//! The scenario file: what is written is read to the last bit.

use lanesweep::model::plausibility::Implausible;
use lanesweep::scenario::{
    Category, Ego, Other, Scenario, Side, read_scenario_file, read_scenarios, write_scenarios, write_scenarios_to,
};

use crate::common;

fn cut_out() -> Scenario {
    let series = |from: f64| (0..4).map(|k| from + f64::from(k) / 3.0).collect::<Vec<_>>();
    let other = |y: f64| Other { length: 4.53, width: 1.9, v: series(22.0), y: series(y) };
    Scenario {
        id: "01_cut_out_5_4_77".into(),
        category: Category::CutOut,
        recording: "01".into(),
        ego_id: 5,
        target_id: 4,
        lead_id: Some(3),
        frame0: 77,
        frame1: 80,
        fps: 25.0,
        kept: true,
        reason: "lead slower than ego".into(),
        ego: Ego { v0: 0.1 + 0.2, length: 4.8, width: 1.93 },
        lane_width: 3.75,
        side: Side::Right,
        target: other(0.0),
        lead: Some(other(-0.1)),
        thw0: Some(1.0 / 3.0),
        gap0: Some(31.2),
        lead_gap: Some(35.68),
        peak_decel: Some(-0.96),
        truncated_start: Some(false),
        end_cause: Some("lc_end".into()),
        frame_switch: Some(79),
        tag_frames: Some([77, 81]),
        synthetic: false,
        replays: Vec::new(),
        fold: None,
    }
}

#[test]
fn what_a_scenario_says_twice_and_differently_is_named() {
    let mined = common::mined::scenarios_of(2);
    let notes = |list: &[Scenario], category, change: &dyn Fn(&mut Scenario)| {
        let mut list = list.to_vec();
        list.iter_mut().filter(|s| s.category == category).for_each(change);
        let written = tempfile::NamedTempFile::new().unwrap();
        write_scenarios(written.path(), &list).unwrap();
        read_scenario_file(written.path(), Implausible::Refused).unwrap().notes.join("\n")
    };
    assert_eq!(notes(mined, Category::CutIn, &|_| ()), "");
    let slower = |s: &mut Scenario| s.target.v.iter_mut().for_each(|v| *v /= 3.6 * 3.6);
    let thinner = |s: &mut Scenario| {
        s.target.v = s.target.v.iter().copied().step_by(2).collect();
        s.target.y = s.target.y.iter().copied().step_by(2).collect();
    };
    type Change<'a> = &'a dyn Fn(&mut Scenario);
    // A digit of 0.1 m at 25 Hz is 2.5 m/s.
    let rounded = |s: &mut Scenario| s.target.y.iter_mut().for_each(|y| *y = (*y * 10.0).round() / 10.0);
    let lane_off = |s: &mut Scenario| s.target.y.iter_mut().for_each(|y| *y += s.lane_width);
    let standing = |s: &mut Scenario| s.target.v.fill(0.0);
    const AWAY: &str = "are never in the ego's lane";
    let cases: [(Category, Change, &str); 11] = [
        (Category::CutIn, &lane_off, AWAY),
        (Category::CutOut, &lane_off, AWAY),
        (Category::Lvd, &lane_off, AWAY),
        (Category::CutIn, &rounded, "have a position or a speed that stands still between steps"),
        (Category::CutOut, &standing, "have a vehicle that moves farther to the side than along the road"),
        (Category::Lvd, &slower, "have a `peak_decel` that the changes of `target.v` contradict"),
        (Category::Lvd, &|s| s.fps = 10.0, "have a `peak_decel` that the changes of `target.v` contradict"),
        (Category::Lvd, &thinner, "have not one sample per frame from `frame0` to `frame1`"),
        (Category::CutIn, &|s| s.ego.v0 /= 3.6, "have a `gap0` that is not `thw0` times `ego.v0`"),
        (Category::CutIn, &|s| s.gap0 = s.gap0.map(|gap| gap / 2.0), "have a `gap0` that is not `thw0` times `ego.v0`"),
        (Category::CutIn, &|s| s.target.y.iter_mut().for_each(|y| *y += 1.75), "are never in the ego's lane"),
    ];
    for (category, change, expected) in cases {
        let said = notes(mined, category, change);
        assert!(said.contains(expected), "{expected}: {said}");
    }
    // One scenario is enough where no other reading is possible.
    for category in Category::ALL {
        let one = common::mined::kept(mined, category)[0].clone();
        let said = notes(&[one], category, &lane_off);
        assert!(said.contains(AWAY), "{said}");
    }
}

#[test]
fn a_scenario_survives_the_file_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.jsonl");
    let mut lvd = cut_out();
    (lvd.id, lvd.category, lvd.kept) = ("2".into(), Category::Lvd, false);
    (lvd.lead, lvd.lead_id, lvd.lead_gap, lvd.thw0, lvd.end_cause) = (None, None, None, None, None);
    lvd.target.y[1] = -0.0;
    let all = [cut_out(), lvd];
    write_scenarios(&path, &all).unwrap();
    let read = read_scenarios(&path).unwrap();
    assert_eq!(read, all);
    assert!(read[1].target.y[1].is_sign_negative());
    let mut bytes = Vec::new();
    write_scenarios_to(&mut bytes, &read).unwrap();
    assert_eq!(bytes, std::fs::read(&path).unwrap());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
}

#[test]
fn nan_is_never_written_and_a_failed_write_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.jsonl");
    std::fs::write(&path, "old").unwrap();
    let mut broken = cut_out();
    broken.target.y[2] = f64::NAN;
    let error = write_scenarios(&path, &[cut_out(), broken]).unwrap_err().to_string();
    assert!(error.contains("target.y[2]") && error.contains("01_cut_out_5_4_77"), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
}
