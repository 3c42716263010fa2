//! Traffic as public reports describe it: what stands, overlaps, is there twice or was rounded gives the scenarios of plain traffic.

use std::fmt::Write as _;

use lanesweep::scenario::{Category, Scenario, problem_of, write_scenarios};
use lanesweep::traffic::mining::Collection;

use crate::common::mined;
use crate::common::quintic;
use crate::traffic::tracks::load_collection as load;

/// Length, width, and where the middle of the box is at a time.
type Vehicle = ([f64; 2], Box<dyn Fn(f64) -> [f64; 2]>);

fn vehicle(size_m: [f64; 2], at: impl Fn(f64) -> [f64; 2] + 'static) -> Vehicle {
    (size_m, Box::new(at))
}

fn steady(x: f64, v: f64, y: f64) -> Vehicle {
    vehicle([4.5, 1.8], move |t| [x + v * t, y])
}

fn across(from: f64, to: f64, begin: f64, end: f64) -> impl Fn(f64) -> f64 {
    move |t| from + (to - from) * quintic((t - begin) / (end - begin))
}

/// Twelve seconds as a table; `time` writes a time, `y` changes the lateral positions, `lane` names the lane of a position.
fn table(
    vehicles: &[Vehicle],
    rate: f64,
    time: &dyn Fn(usize) -> String,
    lane: &dyn Fn([f64; 2]) -> &'static str,
) -> String {
    let mut text = "id,time,frame,x,y,length,width,lane\n".to_owned();
    for k in 0..(12.0 * rate) as usize {
        for (id, ([length, width], at)) in vehicles.iter().enumerate() {
            let [x, y] = at(k as f64 / rate);
            let (time, lane) = (time(k), lane([x, y]));
            writeln!(text, "{},{time},{x:.6},{y:.6},{length},{width},{lane}", id + 1).unwrap();
        }
    }
    text
}

fn plain(vehicles: &[Vehicle]) -> String {
    table(vehicles, 10.0, &|k| format!("{},", k as f64 / 10.0), &|_| "")
}

fn mine(text: &str) -> Collection {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("own.csv");
    std::fs::write(&path, text).unwrap();
    load(&path)
}

fn kept(found: &Collection, category: Category) -> Vec<&Scenario> {
    mined::kept(&found.scenarios, category)
}

fn says(found: &Collection, words: &str) -> bool {
    found.notes.iter().any(|note| note.contains(words))
}

/// A leader that leaves the lane before a vehicle that moves by `v` m/s, with or without a carriageway beside.
fn cut_out(v: f64, is_divided: bool) -> Vec<Vehicle> {
    let y = across(5.25, 1.75, 4.0, 7.0);
    let mut all = vec![
        steady(60.0, 25.0, 5.25),
        vehicle([4.2, 1.8], move |t| [110.0 + 25.0 * t, y(t)]),
        steady(-40.0, 27.0, 8.75),
        steady(-10.0, 23.0, 1.75),
        steady(262.0, v, 5.25),
    ];
    let beside = [(500.0, 14.75), (560.0, 18.25), (620.0, 21.75), (660.0, 14.75)];
    all.extend(beside.into_iter().filter(|_| is_divided).map(|(x, y)| steady(x, -25.0, y)));
    all
}

#[test]
fn what_stands_or_reverses_belongs_to_the_lanes_that_it_is_in() {
    let plus = mine(&plain(&cut_out(1e-4, false)));
    let [expected] = kept(&plus, Category::CutOut)[..] else { panic!("{:?}", plus.scenarios) };
    assert!((20.0..45.0).contains(&expected.lead_gap.unwrap()) && expected.lane_width == 3.5);
    for (v, is_divided) in [(-1e-4, false), (0.0, true), (-1e-4, true)] {
        let found = mine(&plain(&cut_out(v, is_divided)));
        let [one] = kept(&found, Category::CutOut)[..] else { panic!("{v}, {is_divided}: {:?}", found.scenarios) };
        assert!((one.lead_gap.unwrap() - expected.lead_gap.unwrap()).abs() < 2e-3 && one.lane_width == 3.5);
        assert!(!says(&found, "lane width"), "{:?}", found.notes);
    }
    let reversing = mine(&plain(&cut_out(-2.0, false)));
    assert!(kept(&reversing, Category::CutOut).is_empty());
    assert!(says(&reversing, "1 vehicles drive backwards"), "{:?}", reversing.notes);
    assert_eq!(reversing.recordings[0].vehicles, 4);
}

#[test]
fn a_vehicle_beside_the_ego_does_not_lead_it() {
    let braking = |x: f64, y: f64| {
        move |t: f64| {
            let s = (t - 4.0).clamp(0.0, 3.0);
            [x + 25.0 * t - 1.5 * s * s - 9.0 * (t - 7.0).max(0.0), y]
        }
    };
    let pair = |gap: f64| {
        let two = [vehicle([4.5, 1.6], braking(60.0, 4.4)), vehicle([2.2, 0.6], braking(63.35 + gap, 6.2))];
        // Those behind show where the lane is.
        two.into_iter().chain((2..7).map(|n| steady(-100.0 * f64::from(n), 25.0, 5.25))).collect::<Vec<_>>()
    };
    for (gap, expected) in [(0.5, 1), (-1.0, 0)] {
        let found = mine(&plain(&pair(gap)));
        assert_eq!(kept(&found, Category::Lvd).len(), expected, "{gap}: {:?}", found.scenarios);
    }
    let found = mine(&plain(&pair(0.5)));
    let mut scenario = found.scenarios[0].clone();
    assert_eq!(problem_of(&scenario), None);
    scenario.gap0 = Some(-0.5);
    assert!(problem_of(&scenario).is_some_and(|problem| problem.contains("beside or behind")));
    scenario.category = Category::CutIn;
    assert_eq!(problem_of(&scenario), None);
}

#[test]
fn what_is_there_twice_counts_once_and_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let text = plain(&cut_out(0.0, true));
    ["run1.csv", "run2.csv"].iter().for_each(|name| std::fs::write(dir.path().join(name), &text).unwrap());
    let found = load(dir.path());
    assert_eq!((found.recordings.len(), kept(&found, Category::CutOut).len(), found.problems.len()), (1, 1, 1));
    assert!(found.problems[0].to_string().contains("run2: it is recording run1 again"), "{}", found.problems[0]);
    let [one] = kept(&found, Category::CutOut)[..] else { panic!() };
    for (by, number, words) in [(0.0, 1, "count once"), (0.05, 2, "less than 6 cm"), (0.1, 2, "")] {
        let mut other = Scenario { id: "again".to_owned(), recording: "x".to_owned(), ..one.clone() };
        other.lead_gap = other.lead_gap.map(|gap| gap + by);
        let path = dir.path().join("twice.jsonl");
        write_scenarios(&path, &[one.clone(), other]).unwrap();
        let twice = load(&path);
        assert_eq!(twice.scenarios.len(), number);
        assert!(says(&twice, words) != words.is_empty(), "{by}: {:?}", twice.notes);
    }
}

#[test]
fn times_within_half_a_digit_of_a_raster_are_on_it() {
    // A leader brakes with 1.9 m/s².
    let lead = |t: f64| {
        let s = (t - 3.0).clamp(0.0, 4.0);
        [100.0 + 34.0 * t - 0.95 * s * s - 7.6 * (t - 7.0).max(0.0), 5.25]
    };
    let all = [vehicle([4.8, 1.9], lead), steady(58.0, 34.0, 5.25)];
    let ntsc = 30.0 / 1.001;
    type Writes = Box<dyn Fn(usize, f64) -> String>;
    let decimals = |n: usize, frames: bool| -> Writes {
        Box::new(move |k, rate| {
            format!("{:.n$},{}", k as f64 / rate, if frames { k.to_string() } else { String::new() })
        })
    };
    let float: Writes = Box::new(|k, rate| format!("{:.9},", f64::from((40_000.0 + k as f64 / rate) as f32)));
    let jitter: Writes = Box::new(|k, rate| format!("{:.6},{k}", (k as f64 + 0.2 * libm::sin(k as f64)) / rate));
    let cases = [
        (30.0, decimals(2, false)),
        (ntsc, decimals(2, false)),
        (60.0, decimals(2, false)),
        (16.0, decimals(2, false)),
        (60.0, decimals(3, false)),
        (30.0, decimals(2, true)),
        (25.0, float),
        (30.0, jitter),
    ];
    for (at, (rate, time)) in cases.iter().enumerate() {
        let found = mine(&table(&all, *rate, &|k| time(k, *rate), &|_| ""));
        let [one] = &found.scenarios[..] else { panic!("{at}: {:?}", found.notes) };
        let peak = one.peak_decel.unwrap();
        assert!((peak - 1.9).abs() < 0.05 && (one.ego.v0 - 34.0).abs() < 0.01 && !one.kept, "{at}: {one:?}");
        assert!((one.fps / rate - 1.0).abs() < 1e-3 && !says(&found, "interpolated"), "{at}: {:?}", found.notes);
    }
}

#[test]
fn a_road_with_a_ramp_has_the_same_lanes() {
    // Edges as a simulator names them: a ramp that comes nearer joins an acceleration lane.
    let ramp = |t: f64| {
        let x = 27.0 * t;
        [x, if x < 100.0 { -1.75 - 5.0 * (1.0 - x / 100.0) } else { across(-1.75, 1.75, 5.0, 8.0)(t) }]
    };
    let all = [steady(-40.0, 27.0, 1.75), steady(-100.0, 30.0, 5.25), vehicle([4.5, 1.8], ramp)];
    let lane = |[x, y]: [f64; 2]| match (x < 100.0, y) {
        (true, ..0.0) => "ramp_0",
        (false, ..0.0) => "e2_0",
        (true, ..3.5) => "e1_0",
        (false, ..3.5) => "e2_1",
        (true, _) => "e1_1",
        (false, _) => "e2_2",
    };
    let found = mine(&table(&all, 10.0, &|k| format!("{},", k as f64 / 10.0), &lane));
    let [one] = &found.scenarios[..] else { panic!("{:?}", found.scenarios) };
    assert!((one.lane_width - 3.5).abs() < 0.02, "{}", one.lane_width);
}
