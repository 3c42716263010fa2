//! The scenario file: what is written is read to the last bit.

use lanesweep::model::plausibility::Implausible;
use lanesweep::prelude::*;
use lanesweep::scenario::{Ego, Other, Side, read_scenario_file, write_scenarios_to};

use crate::common;
use crate::common::dice::{Dice, cases};

/// The scenarios as text, which has every bit of theirs.
fn text_of(scenarios: &[Scenario]) -> String {
    let mut text = Vec::new();
    write_scenarios_to(&mut text, scenarios).unwrap();
    String::from_utf8(text).unwrap()
}

fn number(dice: &mut Dice) -> f64 {
    let any = dice.between(-1e6, 1e6);
    dice.one_of(&[any, any, -0.0, 0.1 + 0.2, 5e-324, -1e6, 1.0 / 3.0])
}

fn positive(dice: &mut Dice) -> f64 {
    let any = dice.between(1e-3, 100.0);
    dice.one_of(&[any, any, f64::MIN_POSITIVE, 1e6])
}

fn other(dice: &mut Dice, samples: usize) -> Other {
    let speed = |dice: &mut Dice| {
        let any = dice.between(0.0, 80.0);
        dice.one_of(&[any, any, 0.0, 5e-324])
    };
    let (v, y) = (dice.list([samples; 2], speed), dice.list([samples; 2], number));
    Other { length: positive(dice), width: positive(dice), v, y }
}

/// Up to so many characters, some of them special to the formats.
fn text(dice: &mut Dice, max: usize) -> String {
    const CHARACTERS: [char; 14] =
        ['a', 'Z', '7', ' ', ',', '"', '\n', '\r', '\\', ';', '\u{1}', 'ü', '\u{202e}', '😀'];
    dice.list([0, max], |dice| dice.one_of(&CHARACTERS)).into_iter().collect()
}

fn maybe<T>(dice: &mut Dice, value: impl Fn(&mut Dice) -> T) -> Option<T> {
    (dice.below(2) == 0).then(|| value(dice))
}

fn scenario(dice: &mut Dice, id: usize) -> Scenario {
    let (category, samples) = (dice.one_of(&Category::ALL), 2 + dice.below(38));
    let has_lead = category == Category::CutOut;
    // Who is beside the ego or behind it does not lead it.
    let ahead = |of: Option<f64>| if category == Category::CutIn { of } else { of.map(f64::abs) };
    let (thw0, kept) = (maybe(dice, number), dice.below(2) == 0);
    Scenario {
        id: format!("s/{id}"),
        category,
        recording: text(dice, 8),
        ego_id: dice.next() as u32,
        target_id: 7,
        lead_id: maybe(dice, |dice| dice.next() as u32),
        frame0: dice.next() as i64,
        frame1: -1,
        fps: dice.between(0.1, 1e3),
        kept,
        reason: text(dice, 12),
        ego: Ego { v0: dice.between(0.0, 80.0), length: positive(dice), width: positive(dice) },
        lane_width: positive(dice),
        side: dice.one_of(&[Side::Left, Side::Right]),
        target: other(dice, samples),
        lead: has_lead.then(|| other(dice, samples)),
        thw0: ahead(thw0),
        gap0: ahead(maybe(dice, number)),
        lead_gap: has_lead.then(|| number(dice).abs()),
        peak_decel: thw0,
        truncated_start: maybe(dice, |dice| dice.below(2) == 0),
        end_cause: maybe(dice, |dice| text(dice, 6)),
        frame_switch: maybe(dice, |dice| dice.next() as i64),
        tag_frames: maybe(dice, |dice| [dice.next() as i64, dice.next() as i64]),
        synthetic: kept,
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
fn a_scenario_survives_every_kind_of_file_to_the_last_bit() {
    let endings: &[&str] = if cfg!(feature = "parquet") { &["jsonl", "parquet"] } else { &["jsonl"] };
    cases(60, |dice| {
        let scenarios: Vec<Scenario> = (0..1 + dice.below(89)).map(|id| scenario(dice, id)).collect();
        for ending in endings {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(format!("s.{ending}"));
            write_scenarios(&path, &scenarios).unwrap();
            let read = read_scenarios(&path).unwrap();
            assert_eq!(read, scenarios, "{ending}");
            // Also −0.
            assert_eq!(text_of(&read), text_of(&scenarios), "{ending}");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
        }
    });
}

#[test]
fn nan_is_never_written_and_a_failed_write_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.jsonl");
    std::fs::write(&path, "old").unwrap();
    let mut all = common::mined::scenarios_of(1)[..2].to_vec();
    all[1].target.y[2] = f64::NAN;
    let error = write_scenarios(&path, &all).unwrap_err().to_string();
    assert!(error.contains("target.y[2]") && error.contains(&all[1].id), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
}
