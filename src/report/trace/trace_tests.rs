//! Properties of every figure and table of a case, including unusual ones.

use super::super::plot::words;
use super::{TraceFigure, TracePanels, TraceSeries, table};
use lanesweep_engine::{Headway, LaneCase, LanePlan, LaneRunner, StepMark, Trace};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{Ahead, Case, Category, Lateral, Participant, Speed, Tables};
use lanesweep_run::study::{StudyOptions, plan_study};
use lanesweep_traffic::mining::{MiningOptions, mine_generated};
use lanesweep_traffic::trajectory::generator::GeneratorOptions;

fn vehicle(speed_mps: f64, lateral: Lateral) -> Participant {
    Participant { length_m: 4.5, width_m: 1.9, speed: Speed::constant(speed_mps), lateral }
}

fn case(category: Category, ego_mps: f64, principal: Participant) -> Case {
    let ahead = (category == Category::CutOut).then(|| Ahead { vehicle: vehicle(24.0, Lateral::Centred), gap_m: 30.0 });
    Case {
        category,
        ego_length_m: 4.5,
        ego_width_m: 1.9,
        lane_width_m: 3.5,
        ego_speed_mps: ego_mps,
        principal,
        ahead,
        horizon_s: 0.0,
    }
}

fn trace(profile: &str, case: &Case, gap_m: f64, model: ModelId) -> Trace {
    let profile = Profile::load(profile).unwrap();
    let mut tables = Tables::default();
    let lane = LaneCase::encode(case, &profile, &mut tables);
    Trace::record(&profile, case.category, &lane, &tables, Headway::GapM(gap_m), model)
}

fn figure(traces: &[Trace]) -> TraceFigure<'_> {
    let series = traces.iter().map(|trace| TraceSeries { name: trace.model.name().to_owned(), trace }).collect();
    TraceFigure {
        title: "A case".to_owned(),
        subtitle: Some("SYNTHETIC DATA".to_owned()),
        series,
        until_s: None,
        panels: TracePanels::All,
    }
}

/// Frames as (left, top, right, bottom), each with the points of its series and its marks.
type Panels = Vec<([f64; 4], Vec<(f64, f64)>, Vec<(String, f64)>)>;

fn number(tag: &str, key: &str) -> f64 {
    tag.split(&format!("{key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
}

fn panels(svg: &str) -> Panels {
    let mut panels: Panels = Vec::new();
    let mut points = Vec::new();
    for group in svg.split("<g ").skip(1) {
        let body = group.split("</g>").next().unwrap();
        if body.starts_with("class=\"series\"") {
            for d in body.split(" d=\"").skip(1) {
                let d = d.split('"').next().unwrap();
                points.extend(d.split(['M', 'L']).map(str::trim).filter(|p| !p.is_empty()).map(|p| {
                    let (x, y) = p.split_once(',').unwrap();
                    (x.parse::<f64>().unwrap(), y.parse::<f64>().unwrap())
                }));
            }
            if body.contains("<circle") {
                points.push((number(body, "cx"), number(body, "cy")));
            }
        } else if body.starts_with("class=\"frame\"") {
            let [x, y] = ["x", "y"].map(|key| number(body, &format!(" {key}")));
            let frame = [x, y, x + number(body, "width"), y + number(body, "height")];
            panels.push((frame, std::mem::take(&mut points), Vec::new()));
        } else if let Some(mark) = body.strip_prefix("class=\"mark ") {
            let place = if body.contains("<circle") {
                number(body, "cx")
            } else {
                // The middle of the shape's corners along x.
                let d = body.split(" d=\"").nth(1).unwrap().split('"').next().unwrap();
                let xs = d.trim_end_matches('Z').split(['M', 'L']).map(str::trim).filter(|p| !p.is_empty());
                let xs: Vec<f64> = xs.map(|p| p.split_once(',').unwrap().0.parse().unwrap()).collect();
                (xs.iter().copied().fold(f64::MAX, f64::min) + xs.iter().copied().fold(f64::MIN, f64::max)) / 2.0
            };
            panels.last_mut().unwrap().2.push((mark.split('"').next().unwrap().to_owned(), place));
        }
    }
    panels
}

/// Checks the properties of every figure; returns its panels.
fn check(traces: &[Trace]) -> Panels {
    let svg = figure(traces).svg();
    assert_eq!(svg, figure(traces).svg(), "the same figure gives the same bytes");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "only numbers are drawn");
    let words = words(&svg);
    let titles = ["Speed (m/s)", "Acceleration (m/s²)", "Gap (m)", "TTC (s)", "BTN (–)", "PFS (–)", "CFS (–)"];
    let more = ["Lateral position (m)", "Time (s)", "A case", "SYNTHETIC DATA", "reaction", "braking", "contact"];
    for text in titles.into_iter().chain(more).chain(traces.iter().map(|t| t.model.name())) {
        assert!(words.contains(text), "{text} is missing: {words}");
    }
    let vehicles = traces[0].vehicles;
    let panels = panels(&svg);
    assert_eq!(panels.len(), 2 + 6 * vehicles);
    let document_px = number(&svg, "width");
    for (frame, points, _) in &panels {
        let [left, top, right, bottom] = *frame;
        assert!(left > 40.0 && right < document_px, "room for numbers beside {frame:?}");
        for (x, y) in points {
            let inside = (left - 0.01..=right + 0.01).contains(x) && (top - 0.01..=bottom + 0.01).contains(y);
            assert!(inside, "({x}, {y}) is outside of {frame:?}");
        }
    }
    // The marks of the speed panel are at the times of the traces.
    let end_s = traces.iter().map(|t| t.steps.last().unwrap().time_s).fold(0.0, f64::max);
    let until_s = super::panels::Shown::of(&figure(traces).series, None).until_s;
    assert!(until_s <= end_s);
    let ([left, _, right, _], points, marks) = &panels[0];
    assert!(!points.is_empty());
    let mut expected = Vec::new();
    for trace in traces {
        for mark in StepMark::ALL {
            if let Some(step) = trace.step_of(mark) {
                let share = if until_s > 0.0 { trace.time_s(step) / until_s } else { 0.0 };
                expected.push((mark.label(), left + share * (right - left)));
            }
        }
    }
    assert_eq!(marks.len(), expected.len());
    for ((found, x), (mark, at)) in marks.iter().zip(expected) {
        assert!(found == mark && (x - at).abs() < 0.02, "{found} at {x}, {mark} expected at {at}");
    }
    panels
}

fn small_study() -> LanePlan {
    let generator = GeneratorOptions { recordings: 3, ..GeneratorOptions::default() };
    let scenarios = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios;
    plan_study(&scenarios, &Profile::load("paper").unwrap(), &StudyOptions::default()).unwrap()
}

#[test]
fn every_series_of_a_studys_lanes_is_inside_its_frame_and_every_mark_at_its_step() {
    let plan = small_study();
    let runner = LaneRunner::<f32>::new(&plan);
    let (mut drawn, mut contacts) = (0, 0);
    for lane in (0..plan.lane_count()).step_by(307) {
        let key = plan.key(lane).unwrap();
        let models = (0..plan.models.len()).map(|model| runner.trace(&lanesweep_engine::LaneKey { model, ..key }));
        let traces: Vec<Trace> = models.collect();
        contacts += traces.iter().filter(|t| t.step_of(StepMark::Contact).is_some()).count();
        check(&traces);
        check(&traces[..1]);
        drawn += 2;
    }
    assert!(drawn > 30 && contacts > 0, "{drawn} figures, {contacts} contacts");
}

#[test]
fn a_lane_of_one_step_is_a_picture_of_dots() {
    let one = trace("paper", &case(Category::Lvd, 20.0, vehicle(20.0, Lateral::Centred)), 30.0, ModelId::Rss);
    assert_eq!(one.steps.len(), 1);
    let panels = check(std::slice::from_ref(&one));
    assert_eq!(panels[0].1.len(), 2, "the ego and the leader, one dot each");
}

#[test]
fn a_contact_at_once_a_gap_of_nothing_and_a_ttc_that_is_never_finite_are_drawn() {
    let closing = case(Category::Lvd, 30.0, vehicle(10.0, Lateral::Centred));
    let at_once = trace("jrc-2021", &closing, 0.0, ModelId::Fsm);
    assert_eq!(at_once.step_of(StepMark::Contact), Some(0));
    check(&[at_once]);
    let gap_0 = trace("paper", &closing, 0.0, ModelId::Fsm);
    assert_eq!(gap_0.step_of(StepMark::Contact), Some(1));
    let panels = check(&[gap_0]);
    assert!(panels[2].2.iter().any(|(mark, _)| mark == "contact"), "also in the gap's panel");
    let opening = case(Category::Lvd, 10.0, vehicle(30.0, Lateral::Centred));
    let open = trace("paper", &Case { horizon_s: 5.0, ..opening }, 10.0, ModelId::Fsm);
    assert!(open.steps.iter().all(|step| step.others[0].ttc_s.is_infinite()));
    let panels = check(&[open]);
    assert!(panels[3].1.is_empty(), "an infinite TTC has no curve");
}

#[test]
fn a_vehicle_that_is_not_in_view_has_no_curves() {
    let leaving = Lateral::Kinematic { start_m: 0.0, rate_mps: 0.7, end_m: 3.5 };
    let out = case(Category::CutOut, 25.0, vehicle(25.0, leaving));
    // In this profile the ego sees the vehicle ahead from the exposure on, and never the cutting-out one.
    let traces = ModelId::ALL.map(|model| trace("jrc-2021", &out, 40.0, model));
    assert!(traces.iter().all(|t| t.steps.iter().all(|step| !step.others[0].is_present)));
    let panels = check(&traces);
    // After speed and acceleration, gap, TTC, BTN, PFS, CFS and place of the one beside those of the other.
    assert!(panels[2..].iter().step_by(2).all(|(_, points, _)| points.is_empty()), "none of the one that cuts out");
    assert!(panels[3..].iter().step_by(2).any(|(_, points, _)| !points.is_empty()), "the one ahead has some");
}

#[test]
fn the_largest_numbers_that_flags_allow_and_hostile_names_do_no_harm() {
    let far = trace("paper", &case(Category::Lvd, 1e6, vehicle(0.0, Lateral::Centred)), 1e6, ModelId::Cchdm);
    check(std::slice::from_ref(&far));
    let name = "<b> & \"x\" $y$ \u{1}".repeat(12);
    let hostile = TraceFigure {
        title: name.clone(),
        subtitle: None,
        series: vec![TraceSeries { name, trace: &far }],
        until_s: Some(0.5),
        panels: TracePanels::All,
    };
    words(&hostile.svg());
    let none = TraceFigure {
        title: String::new(),
        subtitle: None,
        series: Vec::new(),
        until_s: None,
        panels: TracePanels::All,
    };
    assert!(words(&none.svg()).contains("There is no lane to draw."));
}

/// Rectangles of a figure from above: vehicles by their tips.
fn vehicles(svg: &str) -> Vec<(String, f64, f64)> {
    let cells = svg.split("class=\"cell\"").skip(1).map(|cell| cell.split("</g>").next().unwrap().to_owned());
    cells
        .map(|cell| {
            let name = cell.split("<title>").nth(1).unwrap().split('<').next().unwrap().to_owned();
            (name, number(&cell, " x"), number(&cell, "width"))
        })
        .collect()
}

#[test]
fn from_above_the_vehicles_are_as_far_apart_as_their_gap() {
    let closing = case(Category::Lvd, 30.0, vehicle(25.0, Lateral::Centred));
    let traces = ModelId::ALL.map(|model| trace("paper", &closing, 20.0, model));
    let svg = figure(&traces).positions().svg();
    words(&svg);
    let drawn = vehicles(&svg);
    assert_eq!(drawn.len(), 2 * (1 + traces.len()), "ego and leader at the start and for every model");
    for pair in drawn.chunks(2) {
        assert_eq!((pair[0].0.as_str(), pair[1].0.as_str()), ("ego", "other vehicle"));
    }
    let metre_px = drawn[0].2 / 4.5;
    let gap_m = |pair: &[(String, f64, f64)]| (pair[1].1 - pair[0].1 - pair[0].2) / metre_px;
    assert!((gap_m(&drawn[..2]) - traces[0].steps[0].others[0].gap_m).abs() < 0.01);
    for (pair, trace) in drawn[2..].chunks(2).zip(&traces) {
        assert!((gap_m(pair) - trace.outcome.min_gap).abs() < 0.01, "{}", trace.model.name());
    }
}

#[test]
fn series_differ_without_colour() {
    let traces = ModelId::ALL
        .map(|model| trace("paper", &case(Category::Lvd, 30.0, vehicle(20.0, Lateral::Centred)), 40.0, model));
    let svg = figure(&traces).svg();
    let samples: Vec<&str> = svg.split("class=\"legend\"").skip(1).map(|s| s.split("</g>").next().unwrap()).collect();
    let dash =
        |sample: &str| sample.split("stroke-dasharray=\"").nth(1).map(|d| d.split('"').next().unwrap().to_owned());
    let looks: std::collections::BTreeSet<_> = samples.iter().map(|sample| dash(sample)).collect();
    assert_eq!((samples.len(), looks.len()), (traces.len(), traces.len()));
}

#[test]
fn type_is_readable_at_the_width_of_a_papers_column() {
    let one = trace("paper", &case(Category::Lvd, 30.0, vehicle(20.0, Lateral::Centred)), 40.0, ModelId::Fsm);
    let svg = figure(&[one]).svg();
    let smallest = svg.split("font-size=\"").skip(1).map(|s| number(&format!("font-size=\"{s}"), "font-size"));
    let points = smallest.fold(f64::MAX, f64::min) / number(&svg, "width") * 252.0;
    assert!(points >= 6.0, "{points} pt in a column of 3.5 inches");
}

#[test]
fn the_table_has_every_number_of_the_figure() {
    let leaving = Lateral::Kinematic { start_m: 0.0, rate_mps: 1.5, end_m: 3.5 };
    let out = case(Category::CutOut, 30.0, vehicle(28.0, leaving));
    let traces = ModelId::ALL.map(|model| trace("paper", &out, 25.0, model));
    let named: Vec<(String, &Trace)> = traces.iter().map(|t| (format!("a,b/S/1s/{}", t.model.name()), t)).collect();
    let text = table(&named).csv();
    let mut reader = ::csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    let of = |row: &::csv::StringRecord, name: &str| {
        let at = header.iter().position(|column| column == name).unwrap_or_else(|| panic!("no column {name}"));
        row[at].to_owned()
    };
    assert_eq!(rows.len(), traces.iter().map(|t| t.steps.len()).sum::<usize>());
    let mut at = 0;
    for (name, trace) in &named {
        for step in &trace.steps {
            let row = &rows[at];
            at += 1;
            assert_eq!(&of(row, "lane"), name);
            let value = |column: &str| of(row, column).parse::<f64>().unwrap();
            assert_eq!(value("t_s"), step.time_s);
            assert_eq!(value("v_ego_mps"), step.v_ego_mps);
            assert_eq!(value("a_ego_mps2"), step.a_ego_mps2);
            for (prefix, other) in ["other", "ahead"].into_iter().zip(&step.others) {
                let value = |column: &str| value(&format!("{prefix}_{column}"));
                let found = ["v_mps", "y_m", "gap_m", "ttc_s", "btn", "pfs", "cfs"].map(value);
                assert_eq!(found, [other.v_mps, other.y_m, other.gap_m, other.ttc_s, other.btn, other.pfs, other.cfs]);
                let flags = [value("present"), value("judged")];
                assert_eq!(flags, [other.is_present, other.is_judged].map(|is| f64::from(u8::from(is))));
            }
            let marks: Vec<_> = StepMark::ALL.into_iter().filter(|m| trace.step_of(*m) == Some(step.step)).collect();
            assert_eq!(of(row, "mark"), marks.iter().map(|m| m.label()).collect::<Vec<_>>().join("+"));
        }
        let judged = |value: &dyn Fn(&lanesweep_engine::TracedVehicle) -> f64| {
            let all = trace.steps.iter().flat_map(|s| &s.others).filter(|o| o.is_judged);
            all.map(value).fold(f64::INFINITY, f64::min)
        };
        let min_ttc = judged(&|other| other.ttc_s);
        assert!((min_ttc - trace.outcome.min_ttc).abs() < 1e-12 || min_ttc == trace.outcome.min_ttc);
    }
    let single = table(&named[..1]).csv();
    assert!(single.starts_with("t_s,x_ego_m,v_ego_mps,a_ego_mps2,unsafe,demand_mps2,other_x_m,"), "no name for one");
}
