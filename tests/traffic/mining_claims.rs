//! What the miner must do with traffic whose every event is known, because it was put there.

use crate::common::dice::{Dice, cases};
use crate::common::quintic;
use lanesweep::scenario::{Category, Scenario, Side};
use lanesweep::traffic::mining::lateral::{LaneChangeKind, lane_changes};
use lanesweep::traffic::mining::longitudinal::{Longitudinal, longitudinal_events};
use lanesweep::traffic::mining::{LaneChangeEnd, LateralOptions, LongitudinalOptions, MiningOptions, mine};
use lanesweep::traffic::trajectory::{Carriageway, Lane, NO_LANE, Recording, Track, VehicleClass};

const LANE_M: f64 = 3.75;
const LINES_M: [f64; 4] = [1.5 * LANE_M, 0.5 * LANE_M, -0.5 * LANE_M, -1.5 * LANE_M];
const MIDDLE: f64 = 0.0;
const LEFT: f64 = LANE_M;
const RIGHT: f64 = -LANE_M;
const LENGTH_M: f64 = 4.5;

/// A vehicle with at most one lane change and one change of speed.
#[derive(Clone, Copy)]
struct Car {
    s0_m: f64,
    v0_mps: f64,
    /// Acceleration from, until, m/s².
    accelerates: (f64, f64, f64),
    from_m: f64,
    to_m: f64,
    /// Lane change from, until, s; a quintic in between.
    changes: (f64, f64),
}

fn car(s0_m: f64, v0_mps: f64, lane_m: f64) -> Car {
    Car { s0_m, v0_mps, accelerates: (0.0, 0.0, 0.0), from_m: lane_m, to_m: lane_m, changes: (0.0, 1.0) }
}

impl Car {
    fn changing(self, to_m: f64, from_s: f64, until_s: f64) -> Car {
        Car { to_m, changes: (from_s, until_s), ..self }
    }

    fn accelerating(self, from_s: f64, until_s: f64, a_mps2: f64) -> Car {
        Car { accelerates: (from_s, until_s, a_mps2), ..self }
    }

    fn motion(&self, t: f64) -> (f64, f64, f64, f64) {
        let (from, until, a) = self.accelerates;
        let (changed, after) = ((t.min(until) - from).max(0.0), (t - until).max(0.0));
        let dv = a * changed;
        let s = self.s0_m + self.v0_mps * t + 0.5 * dv * changed + dv * after;
        let share = quintic((t - self.changes.0) / (self.changes.1 - self.changes.0));
        let d = self.from_m + share * (self.to_m - self.from_m);
        (s, d, self.v0_mps + dv, if from <= t && t < until { a } else { 0.0 })
    }
}

fn hundredths(x: f64) -> f64 {
    (x * 100.0).round() / 100.0
}

/// Twelve seconds of a three-lane road, in the two decimals of a file; vehicles numbered from 1. All of
/// it moved by `(ds, dd)`.
fn moved_traffic(cars: &[Car], rate_hz: f64, (ds, dd): (f64, f64)) -> Recording {
    let samples = (12.0 * rate_hz) as usize + 1;
    let track = |(i, car): (usize, &Car)| {
        let at: Vec<_> = (0..samples).map(|k| car.motion(k as f64 / rate_hz)).collect();
        let lane = |d: f64| LINES_M.windows(2).position(|l| l[0] >= d && d >= l[1]).map_or(NO_LANE, |l| l as u16);
        Track {
            id: i as u32 + 1,
            class: VehicleClass::Car,
            length_m: LENGTH_M,
            width_m: 1.8,
            carriageway: 0,
            first_frame: 1,
            s_m: at.iter().map(|m| hundredths(m.0) + ds).collect(),
            d_m: at.iter().map(|m| hundredths(m.1) + dd).collect(),
            v_s_mps: at.iter().map(|m| hundredths(m.2)).collect(),
            v_d_mps: vec![0.0; samples],
            a_s_mps2: at.iter().map(|m| hundredths(m.3)).collect(),
            lane: at.iter().map(|m| lane(hundredths(m.1))).collect(),
        }
    };
    let lane_lines_m = LINES_M.iter().map(|d| d + dd).collect();
    Recording {
        id: "t".into(),
        frame_rate_hz: rate_hz,
        carriageways: vec![Carriageway { name: "1".into(), lane_lines_m }],
        tracks: cars.iter().enumerate().map(track).collect(),
        synthetic: false,
    }
}

fn scenarios(cars: &[Car], rate_hz: f64) -> Vec<Scenario> {
    mine(&moved_traffic(cars, rate_hz, (0.0, 0.0)), &MiningOptions::default()).scenarios
}

/// The one scenario that vehicle 1 has as ego with vehicle 2.
fn only(cars: &[Car], category: Category) -> Scenario {
    let mut found = scenarios(cars, 25.0);
    found.retain(|s| s.ego_id == 1 && s.category == category);
    assert_eq!(found.len(), 1, "{:?}", found.iter().map(|s| &s.id).collect::<Vec<_>>());
    assert_eq!(found[0].target_id, 2);
    found.remove(0)
}

const EGO: f64 = 30.0;

fn cut_in_from(lane_m: f64) -> [Car; 2] {
    [car(0.0, EGO, MIDDLE), car(45.0, 27.0, lane_m).changing(MIDDLE, 3.0, 7.0)]
}

fn cut_out_before(lead: Car) -> [Car; 3] {
    [car(0.0, EGO, MIDDLE), car(45.0, 30.0, MIDDLE).changing(LEFT, 3.0, 7.0), lead]
}

#[test]
fn a_slower_vehicle_that_cuts_in_closely_is_found_and_kept_from_either_side() {
    let s = only(&cut_in_from(LEFT), Category::CutIn);
    assert!(s.kept, "{}", s.reason);
    assert_eq!((s.side, s.truncated_start, s.end_cause.as_deref()), (Side::Left, Some(false), Some("lc_end")));
    assert_eq!((s.ego.v0, s.target.v[0], s.lane_width), (30.0, 27.0, LANE_M));
    // The motion lasts from 3 to 7 s; its slow beginning is not seen, its end when the last second is calm.
    let (start_s, end_s) = ((s.frame0 - 1) as f64 / s.fps, (s.frame1 - 1) as f64 / s.fps);
    assert!((3.0..4.5).contains(&start_s) && (6.0..7.5).contains(&end_s), "{start_s} to {end_s}");
    assert!(s.target.y[0] > 3.0 && s.target.y.last().unwrap().abs() < 0.1);
    assert!(s.target.y.windows(2).all(|w| w[1] <= w[0]));
    assert_eq!(s.target.v.len() as i64, s.frame1 - s.frame0 + 1);
    let gap = 45.0 - 3.0 * start_s - LENGTH_M;
    assert!((s.gap0.unwrap() - gap).abs() < 0.011 && (s.thw0.unwrap() - s.gap0.unwrap() / 30.0).abs() < 1e-12);
    // From the other side it is its mirror image.
    let right = only(&cut_in_from(RIGHT), Category::CutIn);
    assert_eq!(right.side, Side::Right);
    assert_eq!(Scenario { side: Side::Left, ..right }, s);
}

#[test]
fn cut_ins_that_are_fast_or_far_are_found_but_not_kept() {
    let with = |s0: f64, v: f64| {
        let cars = [car(0.0, EGO, MIDDLE), car(s0, v, LEFT).changing(MIDDLE, 3.0, 7.0)];
        let s = only(&cars, Category::CutIn);
        (s.kept, s.reason)
    };
    // 28.5 m/s is exactly 0.95 of the ego's speed: at the limit is not below it.
    assert_eq!(with(45.0, 28.5), (false, "v_c >= 0.95 v_e".to_owned()));
    assert_eq!(with(45.0, 28.49), (true, "slower and close".to_owned()));
    assert_eq!(with(78.0, 27.0), (false, "thw >= 2 s".to_owned()));
}

#[test]
fn who_changes_lane_is_cut_in_by_nobody_and_who_only_touches_the_line_cuts_in_nobody() {
    let [ego, cutter] = cut_in_from(LEFT);
    let both_change = [ego.changing(RIGHT, 3.0, 7.0), cutter];
    assert!(scenarios(&both_change, 25.0).iter().all(|s| s.category != Category::CutIn));
    // Its centre stays left of the line by half a metre.
    assert!(scenarios(&[ego, cutter.changing(0.5 * LANE_M + 0.5, 3.0, 7.0)], 25.0).is_empty());
}

#[test]
fn a_cut_out_is_kept_if_it_uncovers_a_slower_vehicle_that_stays() {
    let s = only(&cut_out_before(car(100.0, 25.0, MIDDLE)), Category::CutOut);
    assert!(s.kept && s.reason == "lead slower than ego", "{}", s.reason);
    assert_eq!((s.side, s.lead_id), (Side::Left, Some(3)));
    let start_s = (s.frame0 - 1) as f64 / s.fps;
    assert!((s.lead_gap.unwrap() - (55.0 - 5.0 * start_s - LENGTH_M)).abs() < 0.011, "{:?}", s.lead_gap);
    assert!(s.target.y[0] < 0.6 && *s.target.y.last().unwrap() > 3.6);
    let lead = s.lead.unwrap();
    assert!(lead.v.len() == s.target.v.len() && lead.y.iter().all(|&y| y == 0.0));
}

#[test]
fn a_cut_out_that_uncovers_nothing_to_run_into_is_found_but_not_kept() {
    let reason = |cars: &[Car]| {
        let s = only(cars, Category::CutOut);
        assert!(!s.kept);
        s.reason
    };
    assert!(reason(&cut_out_before(car(100.0, 30.0, MIDDLE))).contains("not slower"));
    assert!(reason(&cut_out_before(car(100.0, 25.0, RIGHT))).contains("no vehicle ahead"));
    assert!(reason(&cut_out_before(car(150.0, 25.0, MIDDLE))).contains("no vehicle ahead"), "out of range");
    let leaves = car(100.0, 25.0, MIDDLE).changing(RIGHT, 3.0, 6.0);
    assert!(reason(&cut_out_before(leaves)).contains("does not stay"));
}

#[test]
fn a_braking_leader_is_kept_above_two_metres_per_second_squared() {
    let braking = |a: f64| [car(0.0, 25.0, MIDDLE), car(35.0, 25.0, MIDDLE).accelerating(3.0, 5.0, -a)];
    let hard = only(&braking(3.0), Category::Lvd);
    assert!(hard.kept, "{}", hard.reason);
    // The activity ends at the first sample with the final speed, which so is the first without the tag.
    assert_eq!((hard.peak_decel, hard.target.v.last().copied()), (Some(3.0), Some(19.12)));
    assert!(hard.target.v[0] <= 25.0 && hard.target.v.windows(2).all(|w| w[1] <= w[0]));
    for gentle in [1.5, 2.0] {
        let s = only(&braking(gentle), Category::Lvd);
        assert_eq!((s.kept, s.reason.as_str()), (false, "peak deceleration <= 2"));
    }
    // A loss of 0.8 m/s is no deceleration at all.
    assert!(scenarios(&braking(0.4), 25.0).is_empty());
}

#[test]
fn a_leader_beyond_two_seconds_is_none() {
    let behind = |gap: f64| {
        let cars = [car(0.0, 25.0, MIDDLE), car(gap + LENGTH_M, 25.0, MIDDLE).accelerating(3.0, 5.0, -3.0)];
        scenarios(&cars, 25.0)
    };
    // 52 m are more than 2 s. While the vehicle ahead brakes, the gap falls to 50 m: it leads from then on.
    let late = behind(52.0);
    assert!(late.len() == 1 && (late[0].gap0.unwrap() - 50.0).abs() < 0.3, "{late:?}");
    assert!(behind(85.0).is_empty());
    assert_eq!(behind(49.0).len(), 1);
}

#[test]
fn a_vehicle_that_travels_less_than_100_m_has_no_data_set_and_an_empty_recording_none_at_all() {
    for (cars, data_sets) in [(&[car(0.0, 8.0, MIDDLE), car(50.0, 9.0, MIDDLE)][..], 1), (&[], 0)] {
        let mined = mine(&moved_traffic(cars, 25.0, (0.0, 0.0)), &MiningOptions::default());
        assert!(mined.scenarios.is_empty() && mined.data_sets == data_sets, "{}", mined.data_sets);
    }
}

/// All three categories at once, to compare runs with each other.
fn busy_road() -> Vec<Car> {
    vec![
        car(0.0, EGO, MIDDLE),
        car(45.0, 30.0, MIDDLE).changing(LEFT, 3.0, 7.0),
        car(80.0, 25.0, MIDDLE).accelerating(5.0, 7.0, -3.0),
        car(0.0, 31.0, LEFT),
        car(-200.0, EGO, MIDDLE),
        car(-155.0, 27.0, RIGHT).changing(MIDDLE, 3.0, 7.0),
    ]
}

/// The origin of a file's coordinates lies anywhere; adding it costs the last bits.
#[test]
fn a_road_moved_in_space_gives_the_same_scenarios_to_the_last_bit() {
    let here = scenarios(&busy_road(), 25.0);
    for category in Category::ALL {
        assert!(here.iter().any(|s| s.category == category), "{category:?}");
    }
    for offset in [(-1234.56, 0.1), (1e5 + 0.3, -77.77), (0.7, 1.0 / 3.0)] {
        let there = mine(&moved_traffic(&busy_road(), 25.0, offset), &MiningOptions::default());
        assert_eq!(there.scenarios, here);
    }
}

/// Windows are lengths of time, not numbers of samples.
#[test]
fn the_same_traffic_at_another_rate_gives_the_same_scenarios_up_to_two_samples() {
    let reference = scenarios(&busy_road(), 100.0);
    assert!(reference.len() >= 3);
    for rate_hz in [10.0, 25.0, 30.0, 50.0] {
        let found = scenarios(&busy_road(), rate_hz);
        assert_eq!(found.len(), reference.len(), "{rate_hz} Hz");
        for (a, b) in found.iter().zip(&reference) {
            assert_eq!((a.ego_id, a.target_id, a.lead_id), (b.ego_id, b.target_id, b.lead_id));
            assert_eq!((a.category, a.side, a.kept, &a.reason), (b.category, b.side, b.kept, &b.reason));
            let time = |s: &Scenario, frame: i64| (frame - 1) as f64 / s.fps;
            for (x, y) in [(time(a, a.frame0), time(b, b.frame0)), (time(a, a.frame1), time(b, b.frame1))] {
                assert!((x - y).abs() <= 2.0 / rate_hz + 1e-9, "{}: {x} s at {rate_hz} Hz, {y} s at 100 Hz", a.id);
            }
        }
    }
}

/// A walk in sixty-fourths, which f64 adds and mirrors exactly.
fn walk(dice: &mut Dice, largest: usize) -> Vec<f64> {
    let stretch = 1 + dice.below(29);
    let mut level = 0;
    let mut walk = Vec::new();
    for step in dice.list([1, 39], |dice| dice.below(2 * largest + 1) as i32 - largest as i32) {
        for _ in 0..stretch {
            level += step;
            walk.push(f64::from(level) / 64.0);
        }
    }
    walk
}

#[test]
fn deceleration_is_acceleration_mirrored() {
    cases(256, |dice| {
        let v = walk(dice, 6);
        let mirrored: Vec<f64> = v.iter().map(|v| 50.0 - v).collect();
        let events = |v: &[f64]| longitudinal_events(v, 25.0, &LongitudinalOptions::default()).into_iter();
        let swapped = |activity| match activity {
            Longitudinal::Accelerating => Longitudinal::Decelerating,
            Longitudinal::Decelerating => Longitudinal::Accelerating,
            Longitudinal::Cruising => Longitudinal::Cruising,
        };
        let here: Vec<_> = events(&v).map(|of| (of.start, of.activity)).collect();
        let there: Vec<_> = events(&mirrored).map(|of| (of.start, swapped(of.activity))).collect();
        assert_eq!(here, there);
    });
}

#[test]
fn lane_changes_hold_their_crossing_and_do_not_overlap() {
    cases(256, |dice| {
        let d = walk(dice, 8);
        let lane = Lane { left_m: 1.75, right_m: -1.75 };
        let changes = lane_changes(&d, lane, 25.0, &LateralOptions::default());
        for c in &changes {
            assert!(c.start < c.crossing && c.crossing < c.end && c.end < d.len());
            let inside = |k: usize| d[k] <= 1.75 && d[k] >= -1.75;
            match c.kind {
                LaneChangeKind::LeftIn => assert!(d[c.crossing - 1] <= -1.75 && d[c.crossing] > -1.75),
                LaneChangeKind::RightIn => assert!(d[c.crossing - 1] >= 1.75 && d[c.crossing] < 1.75),
                LaneChangeKind::LeftOut | LaneChangeKind::RightOut => assert!(!inside(c.crossing)),
            }
        }
        assert!(changes.windows(2).all(|c| c[0].end <= c[1].start));
        let mirrored: Vec<f64> = d.iter().map(|d| -d).collect();
        for lc_end in [LaneChangeEnd::Published, LaneChangeEnd::Observed] {
            let of = |d: &[f64]| lane_changes(d, lane, 25.0, &LateralOptions { lc_end, ..LateralOptions::default() });
            let (here, there) = (of(&d), of(&mirrored));
            assert_eq!(here.len(), there.len());
            for (a, b) in here.iter().zip(&there) {
                assert_eq!((a.start, a.crossing, a.end), (b.start, b.crossing, b.end));
                assert!(a.kind.is_in() == b.kind.is_in() && a.kind != b.kind);
            }
        }
    });
}
