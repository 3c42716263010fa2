//! Valid inputs, made by the program itself.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use lanesweep::engine::{Backend, SampleTally};
use lanesweep::prelude::*;
use lanesweep::run::parts::{Counted, Journal, MergeableCounts, Part, seal, write_part};
use lanesweep::run::sampling::{SampleCounts, proposal_text};
use lanesweep::run::study::outline_study;
use lanesweep::scenario::parameterization::ParameterizationOptions;
use lanesweep::scenario::{DataProvenance, Driven};

use super::readers::{PART_UNITS, small_plan};
use super::small;
use crate::common::mined::{fitted, provenance};
use crate::common::{CASES, text_of};

/// Valid inputs and what the next steps need beside them.
pub struct Seeds {
    pub recording: [Vec<u8>; 3],
    pub loaded: Recording,
    /// A few of each category.
    pub scenarios: Vec<Scenario>,
    pub files: BTreeMap<&'static str, Vec<Vec<u8>>>,
    pub profile: Profile,
    /// The density that proposals and parts belong to.
    pub density: DensityModel,
}

fn first_of(scenarios: &[Scenario], category: Category, n: usize) -> Vec<Scenario> {
    scenarios.iter().filter(|s| s.category == category && s.kept).take(n).cloned().collect()
}

fn written(write: impl FnOnce(&Path)) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("file.json");
    write(&path);
    std::fs::read(path).unwrap()
}

fn part<T: MergeableCounts>(units: Range<u64>, segment: T) -> Vec<u8> {
    let (run_sha256, lanes_redone_and_rechecked) = ("00".to_owned(), [0; 2]);
    let part = Part { run_sha256, units, lanes_redone_and_rechecked, segments: vec![segment] };
    written(|path| write_part(path, &part).unwrap())
}

/// A table of a few vehicles: header, and a line for vehicle, sample, x, y.
fn track_table(header: &str, line: impl Fn(u32, u32, f64, f64) -> String) -> Vec<u8> {
    let mut text = format!("{header}\n");
    for vehicle in 0..4_u32 {
        for sample in 0..9_u32 {
            let (x, y) = (40.0 * f64::from(vehicle) + 3.0 * f64::from(sample), 3.5 * f64::from(vehicle % 2));
            text += &(line(vehicle, sample, x, y) + "\n");
        }
    }
    text.into_bytes()
}

fn track_tables() -> Vec<Vec<u8>> {
    vec![
        track_table("track_id,t,x,y,heading,speed,vx,vy,length,width,class,lane", |v, k, x, y| {
            let (t, class) = (0.1 * f64::from(k), ["car", "truck"][v as usize % 2]);
            format!("{v},{t:.1},{x:.2},{y:.2},0.0,30,30,0,4.5,1.8,{class},{}", v % 2)
        }),
        track_table(
            "timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed;vehicle_lane;vehicle_length;vehicle_width",
            |v, k, x, y| format!("{:.2};f.{v};{x:.2};{y:.2};90;passenger;30;e_{};5;1.8", 0.1 * f64::from(k), v % 2),
        ),
        track_table(
            "Vehicle_ID,Frame_ID,Local_X,Local_Y,v_length,v_Width,v_Class,v_Vel,v_Acc,Lane_ID,Location",
            |v, k, x, y| format!("{v},{k},{:.2},{:.2},15,6,2,98,0,{},us-101", 3.28 * y, 3.28 * x, v % 2),
        ),
    ]
}

fn presets() -> Vec<Vec<u8>> {
    let own = r#"name = "own"
title = "own tracks"
format = "csv"
files = "*.csv"
none = ["-1", "NA"]
resample_hz = 20.0
reference = "front"
road = "x"
traffic = "right"
max_gap_s = 0.5
smoothing_s = 0.7
[axes]
y = "left"
heading = "from-x"
[lanes]
width_m = 3.5
[classes]
truck = ["truck"]
ignored = ["bicycle"]
truck_from_m = 7.0
[columns]
vehicle = "track_id"
time = { name = "t", unit = "s", factor = 1.0 }
x = { name = ["x", "xx"], unit = "m" }
y = "y"
heading = { name = "heading", unit = "deg" }
speed = { name = "speed", unit = "m/s" }
class = "class"
width = "width"
[vehicles]
file = "*_meta.csv"
columns = { vehicle = "id", length = "l" }
[recording]
file = "*_rec.csv"
columns = { frame_rate = "fps" }
"#;
    vec![text_of("configs/presets/generic.toml").into_bytes(), own.as_bytes().to_vec()]
}

const INSTANTS: &str = "id,category,time_s,ego_speed_kmh,ego_length_m,ego_width_m,side,target_length_m,\
target_width_m,target_speed_kmh,target_lateral_m,kept,tag_frames
a,cut-in,10.00,108,4.5,1.8,left,4.2,1.9,72,3.5,yes,1 2
a,cut-in,10.04,107,4.5,1.8,left,4.2,1.9,72,3.4,,
a,cut-in,10.08,106,4.5,1.8,left,4.2,1.9,90,3.3,,
b,lvd,0,90,4.5,1.8,Right,4.2,1.9,90,0,1,
b,,0.1,,,,,,,36,0.1,,
";

impl Seeds {
    pub fn make() -> Seeds {
        let generator = GeneratorOptions { recordings: 10, duration_s: 120.0, ..GeneratorOptions::default() };
        let mined = mine_generated(&generator, &MiningOptions::default(), || Ok(())).unwrap().scenarios;
        let few: Vec<Scenario> = Category::ALL.into_iter().flat_map(|c| first_of(&mined, c, 2)).collect();
        let profile = Profile::load("paper").unwrap();
        let fit = |category, key, n| fitted(&first_of(&mined, category, n), category, key, false);
        let density = fit(Category::CutIn, "2", 8);
        let file_of = |density: &DensityModel| written(|path| write_density(path, density).unwrap());
        let others = [fit(Category::Lvd, "ii", 6), fit(Category::Lvd, "iii", 8), fit(Category::CutOut, "b", 10)];
        let plan = small_plan(&density, &profile).unwrap();
        let chunk = CpuBackend::reference().prepare(&plan).unwrap().run(PART_UNITS, Wanted::Outcomes).unwrap();
        let tally = SampleTally::of_chunk(&plan, &chunk).unwrap();
        let journal = written(|path| {
            let (mut journal, _) = Journal::open(path, "00", PART_UNITS).unwrap();
            journal
                .append(&[Counted { counts: SampleCounts::Crude(tally.clone()), redone_and_rechecked: [0; 2] }])
                .unwrap();
        });
        let driven = Some(Driven { hours: Some(1.5), kilometres: Some(90.0) });
        let exposure = DataProvenance { scenarios_sha256: "00".to_owned(), driven, ..provenance() };
        let texts = small::Texts::small();
        let recording = [texts.tracks, texts.tracks_meta, texts.recording_meta].map(String::into_bytes);
        let profile_text = |name: &str| toml::to_string(&Profile::load(name).unwrap()).unwrap().into_bytes();
        let scenario_files =
            [&few[..], &few[..1], &few[4..5]].map(|s| written(|path| write_scenarios(path, s).unwrap()));
        let exposure_file = {
            let dir = tempfile::tempdir().unwrap();
            exposure
                .write_beside(&dir.path().join("s.jsonl"), serde_json::Value::Null, serde_json::Value::Null)
                .unwrap();
            std::fs::read(dir.path().join("s.exposure.json")).unwrap()
        };
        let plan_file = {
            let outlined = outline_study(&few, &profile, &StudyOptions::default()).unwrap();
            let (head, mut plan) = (seal("plan", outlined.head()).unwrap().0, Vec::new());
            outlined.write_file(&head, &mut plan).unwrap();
            plan
        };
        let toml = |text: String| vec![text.into_bytes()];
        let files = BTreeMap::from([
            ("tracks", vec![recording[0].clone()]),
            ("tracksMeta", vec![recording[1].clone()]),
            ("recordingMeta", vec![recording[2].clone()]),
            ("scenarios", scenario_files.into()),
            // A row per instant, and one per concrete case.
            ("scenario table", vec![INSTANTS.into(), CASES.into()]),
            ("exposure", vec![exposure_file]),
            ("profile", ["paper", "jrc-2021"].map(profile_text).into()),
            ("mining options", toml(toml::to_string(&MiningOptions::default()).unwrap())),
            ("parameterization options", toml(toml::to_string(&ParameterizationOptions::default()).unwrap())),
            ("density", std::iter::once(&density).chain(&others).map(file_of).collect()),
            ("track table", track_tables()),
            ("preset", presets()),
            ("proposal", toml(proposal_text(&density, &density.kde.mixture().unwrap()).unwrap())),
            ("part", vec![part(PART_UNITS, SampleCounts::Crude(tally))]),
            ("plan", vec![plan_file]),
            ("journal", vec![journal]),
        ]);
        Seeds { recording, loaded: small::recording(), scenarios: few, files, profile, density }
    }
}
