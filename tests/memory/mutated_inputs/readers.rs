//! Every reader of the library: valid inputs for it, and what a program does with what it reads.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lanesweep::Place;
use lanesweep::engine::{Backend, LanePlan, SampleTally};
use lanesweep::model::plausibility::Implausible;
use lanesweep::prelude::*;
use lanesweep::run::parts::{Counted, Journal, Ledger, read_part, read_sealed_line};
use lanesweep::run::sampling::{Estimator, SampleCounts, plan_samples, read_proposal};
use lanesweep::run::study::{StudyHead, plan_study};
use lanesweep::scenario::DataProvenance;
use lanesweep::scenario::parameterization::ParameterizationOptions;
use lanesweep::stats::density::Exposure;
use lanesweep::stats::random::Stream;
use lanesweep::traffic::mining::mine;
use lanesweep::traffic::trajectory::highd::HighdFiles;
use lanesweep::traffic::trajectory::tracks::{Preset, TrackFile};
use lanesweep::traffic::trajectory::{InputFile, Inputs, Loaded, NO_LANE};

use super::seeds::Seeds;

pub struct Reader {
    pub name: &'static str,
    pub seeds: Vec<Vec<u8>>,
    /// Reads the bytes, alone in a folder, and uses what was read; `heavy` for the steps that take longer.
    pub read: fn(&[u8], &Path, &Seeds, heavy: bool) -> Result<()>,
}

pub fn all(seeds: &Seeds) -> Vec<Reader> {
    let plain = |name, read| Reader { name, seeds: seeds.files[name].clone(), read };
    vec![
        plain("tracks", |b, d, s, _| recording(0, b, d, s)),
        plain("tracksMeta", |b, d, s, _| recording(1, b, d, s)),
        plain("recordingMeta", |b, d, s, _| recording(2, b, d, s)),
        plain("scenarios", |b, d, s, h| scenarios("s.jsonl", b, d, s, h)),
        plain("scenario table", |b, d, s, h| scenarios("s.csv", b, d, s, h)),
        plain("exposure", exposure),
        plain("profile", profile),
        plain("mining options", mining),
        plain("parameterization options", parameterization),
        plain("proposal", proposal),
        plain("track table", |b, d, _, _| tracks_named("own.csv", b, d)),
        plain("preset", preset),
        plain("density", density),
        plain("part", part),
        plain("plan", plan),
        plain("journal", journal),
    ]
}

/// Alone in a folder, detected by its content, with whatever it is doubted for.
fn tracks_named(name: &str, bytes: &[u8], dir: &Path) -> Result<()> {
    let path = file(bytes, dir, name);
    let mined = |loaded: &Loaded| drop(mine(&loaded.recording, &MiningOptions::default()));
    let read = Inputs::of(&path, None).and_then(|inputs| {
        let (files, _) = inputs.files();
        files.iter().try_for_each(|file| file.read(Implausible::Accepted).map(|all| all.iter().for_each(mined)))
    });
    removed(&[path]);
    read
}

fn removed(paths: &[PathBuf]) {
    paths.iter().for_each(|path| std::fs::remove_file(path).expect("the temporary folder can be written to"));
}

fn preset(bytes: &[u8], dir: &Path, seeds: &Seeds, _: bool) -> Result<()> {
    let path = file(bytes, dir, "own.toml");
    let table = file(&seeds.files["track table"][0], dir, "own.csv");
    let [meta, rate] = [file(b"id,l\n1,4.5\n", dir, "own_meta.csv"), file(b"fps\n10\n", dir, "own_rec.csv")];
    let preset = Preset::load(&path.to_string_lossy())?;
    let own = TrackFile { path: table.clone(), id: "own".to_owned() };
    let read = InputFile::Tracks(own, Box::new(preset)).read(Implausible::Accepted);
    removed(&[meta, rate, table]);
    read.map(drop)
}

fn file(bytes: &[u8], dir: &Path, name: &str) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, bytes).expect("the temporary folder can be written to");
    path
}

fn recording(which: usize, bytes: &[u8], dir: &Path, seeds: &Seeds) -> Result<()> {
    let names = ["01_tracks.csv", "01_tracksMeta.csv", "01_recordingMeta.csv"];
    for (k, name) in names.into_iter().enumerate() {
        file(if k == which { bytes } else { &seeds.recording[k] }, dir, name);
    }
    match InputFile::Highd(HighdFiles::named(dir, "01")).read(Implausible::Accepted) {
        Ok(read) => read.iter().for_each(|loaded| assert_whole(&loaded.recording)),
        Err(error) => assert!(error.to_string().contains("01_") && error.to_string().len() < 1000, "{error}"),
    }
    mine_folder(dir, &MiningOptions::default(), Default::default(), || Ok(())).map(drop)
}

fn assert_whole(recording: &Recording) {
    assert!(recording.frame_rate_hz > 0.0 && recording.frame_rate_hz.is_finite());
    assert!(!recording.tracks.is_empty() && recording.tracks.is_sorted_by(|a, b| a.id < b.id));
    for carriageway in &recording.carriageways {
        assert!(carriageway.lane_count() > 0 && carriageway.lane_lines_m.is_sorted_by(|a, b| a > b));
    }
    for track in &recording.tracks {
        assert!(track.length_m > 0.0 && track.width_m > 0.0 && !track.is_empty() && track.lane.len() == track.len());
        let lanes = recording.carriageways[track.carriageway].lane_count();
        assert!(track.lane.iter().all(|&lane| lane == NO_LANE || usize::from(lane) < lanes));
        for series in [&track.s_m, &track.d_m, &track.v_s_mps, &track.v_d_mps, &track.a_s_mps2] {
            assert!(series.len() == track.len() && series.iter().all(|value| value.is_finite()));
        }
    }
}

/// The first lanes of a plan, with one headway.
fn run_some(plan: &LanePlan, units: u64) -> Result<()> {
    let mut session = CpuBackend::reference().prepare(plan)?;
    session.run(0..plan.unit_count().min(units), Wanted::Outcomes).map(drop)
}

fn study(scenarios: &[Scenario], profile: &Profile, options: &ParameterizationOptions, heavy: bool) -> Result<()> {
    let options = StudyOptions {
        headways: vec![Headway::ThwS(1.0)],
        parameterization: options.clone(),
        ..StudyOptions::default()
    };
    let plan = plan_study(scenarios, profile, &options)?;
    if heavy { run_some(&plan, 1) } else { Ok(()) }
}

fn scenarios(name: &str, bytes: &[u8], dir: &Path, seeds: &Seeds, heavy: bool) -> Result<()> {
    let scenarios = read_scenarios(&file(bytes, dir, name))?;
    study(&scenarios, &seeds.profile, &ParameterizationOptions::default(), heavy)
}

fn exposure(bytes: &[u8], dir: &Path, _: &Seeds, _: bool) -> Result<()> {
    file(bytes, dir, "s.exposure.json");
    if let Some((read, _)) = DataProvenance::read_beside(&dir.join("s.jsonl"), "00")? {
        Exposure::new(3, read.driven.unwrap());
    }
    Ok(())
}

fn profile(bytes: &[u8], dir: &Path, seeds: &Seeds, heavy: bool) -> Result<()> {
    let profile = Profile::load(&file(bytes, dir, "p.toml").to_string_lossy())?;
    if heavy { study(&seeds.scenarios[..1], &profile, &ParameterizationOptions::default(), true) } else { Ok(()) }
}

fn options<T: serde::de::DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    let place = || Place::item("options");
    let text = std::str::from_utf8(bytes).map_err(|e| Error::input(place(), e.to_string(), "use UTF-8"))?;
    toml::from_str(text).map_err(|e| Error::input(place(), e.message().to_owned(), "correct it"))
}

fn mining(bytes: &[u8], _: &Path, seeds: &Seeds, _: bool) -> Result<()> {
    let options: MiningOptions = options(bytes)?;
    options.validate()?;
    mine(&seeds.loaded, &options);
    Ok(())
}

fn parameterization(bytes: &[u8], _: &Path, seeds: &Seeds, _: bool) -> Result<()> {
    let options: ParameterizationOptions = options(bytes)?;
    options.validate()?;
    study(&seeds.scenarios[..3], &seeds.profile, &options, false)
}

pub fn small_plan(density: &DensityModel, profile: &Profile) -> Result<LanePlan> {
    let options = SampleOptions {
        seed: 5,
        ..SampleOptions::new(Estimator::Crude, 20, SampleHeadways::Each(vec![Headway::ThwS(1.0)]))
    };
    plan_samples(density, profile, &options)
}

fn density(bytes: &[u8], dir: &Path, seeds: &Seeds, heavy: bool) -> Result<()> {
    let density = read_density(&file(bytes, dir, "d.json"))?;
    let plan = small_plan(&density, &seeds.profile)?;
    if heavy { run_some(&plan, 2) } else { Ok(()) }
}

fn proposal(bytes: &[u8], dir: &Path, seeds: &Seeds, _: bool) -> Result<()> {
    let proposal = read_proposal(&file(bytes, dir, "g.json"), &seeds.density)?;
    let stream = Stream { seed: 5, purpose: 1 };
    (0..20).for_each(|index| drop(proposal.draw(&stream, index, 0)));
    Ok(())
}

/// What is read of a changed file of a run: all of the whole one, which is the first that is read.
fn is_that_of_the_seed(whole: &OnceLock<String>, read: String) {
    assert!(*whole.get_or_init(|| read.clone()) == read, "a change is taken for what the run wrote");
}

fn part(bytes: &[u8], dir: &Path, seeds: &Seeds, _: bool) -> Result<()> {
    let path = file(bytes, dir, "part.json");
    let read = read_part::<SampleCounts>(&path, "00", &PART_UNITS, "make it again")?;
    static WHOLE: OnceLock<String> = OnceLock::new();
    is_that_of_the_seed(&WHOLE, format!("{read:?}"));
    for counts in read.segments {
        let SampleCounts::Crude(tally) = counts else { continue };
        tally.samples();
        tally.valid();
        let plan = small_plan(&seeds.density, &seeds.profile)?;
        let joined = SampleTally::empty(&plan).merge(tally.clone())?;
        let back = tally.clone().merge(SampleTally::empty(&plan))?;
        joined.samples();
        // The same part twice has to be refused.
        assert!(back.samples() == 0 || back.merge(tally).is_err());
    }
    Ok(())
}

fn plan(bytes: &[u8], dir: &Path, _: &Seeds, heavy: bool) -> Result<()> {
    let path = file(bytes, dir, "plan.json");
    let (head, _, mut records) = read_sealed_line::<StudyHead>("plan", &path, 1 << 26, "make it again")?;
    let study = head.clone().read(&mut records, &Place::file(&path), |units| 0..units)?;
    let some = study.window(0..study.outline().unit_count().min(2))?;
    static WHOLE: OnceLock<String> = OnceLock::new();
    is_that_of_the_seed(&WHOLE, format!("{head:?} {}", study.window(0..study.outline().unit_count())?.hash()));
    if heavy { run_some(&some, 2) } else { Ok(()) }
}

fn journal(bytes: &[u8], dir: &Path, _: &Seeds, _: bool) -> Result<()> {
    let path = file(bytes, dir, "part.journal");
    let (journal, found) = Journal::<Counted<SampleCounts>>::open(&path, "00", PART_UNITS)?;
    let mut ledger = Ledger::new(PART_UNITS, &[]);
    ledger.resume(journal, found)?;
    if ledger.missing(PART_UNITS)?.is_empty() {
        static WHOLE: OnceLock<String> = OnceLock::new();
        is_that_of_the_seed(&WHOLE, format!("{:?}", ledger.counts(PART_UNITS)?));
    }
    Ok(())
}

/// The units of the part that is made as a seed.
pub const PART_UNITS: std::ops::Range<u64> = 3..17;
