//! Many recordings at once: read and mined in parallel, one file per thread in memory at a time and as many as memory may
//! hold, the result in the recordings' order. A recording that cannot be read is reported; the others are used.

use std::cmp::Reverse;
use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::miner::{CategoryCount, Mined, mine};
use super::options::MiningOptions;
use super::{cut_in, cut_out, lvd};
use crate::trajectory::generator::{GeneratorOptions, generate_one};
use crate::trajectory::{FileChecksum, FrameIndex, InputFile, Inputs, Loaded, Noise, Recording, VehicleAtFrame};
use lanesweep_model::plausibility::Implausible;
use lanesweep_model::scenario::{Category, Scenario, ScenarioFile, mined_id, usable};
use lanesweep_support::readable::{self, significant, value};
use lanesweep_support::{Error, Place, Result, option};

/// Results of one recording.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RecordingSummary {
    /// Its id.
    pub id: String,
    /// Vehicles in it.
    pub vehicles: u64,
    /// Samples of all vehicles.
    pub samples: u64,
    /// Ego-centric data sets.
    pub data_sets: u64,
    /// Total time of all data sets, s.
    pub driven_s: f64,
    /// Total distance of all data sets, m.
    pub driven_m: f64,
    /// Samples per second.
    pub frame_rate_hz: f64,
    /// Its files with their content's SHA-256; empty for generated recordings.
    pub files: Vec<FileChecksum>,
    /// Name and checksum of the preset that the files were read by; none for highD's format and generated recordings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// A number for each instant of a carriageway with several vehicles, equal where all positions are.
    #[serde(skip)]
    content: Vec<u64>,
}

/// Scenarios of many recordings.
#[derive(Debug, Default)]
pub struct Collection {
    /// Every scenario found, recording by recording.
    pub scenarios: Vec<Scenario>,
    /// The recordings that were used.
    pub recordings: Vec<RecordingSummary>,
    /// The errors of recordings that were not used.
    pub problems: Vec<Error>,
    /// Warnings about the data, as sentences.
    pub notes: Vec<String>,
    /// At least one recording is synthetic, so results say nothing about real traffic.
    pub synthetic: bool,
    /// Mining options of a scenario file, as `mine` recorded them.
    pub mining: Option<MiningOptions>,
}

impl Collection {
    /// The scenarios of one recording.
    fn of(recording: &Recording, mined: Mined, files: Vec<FileChecksum>, options: &MiningOptions) -> Collection {
        let [driven_s, driven_m] = driven(recording, options);
        let summary = RecordingSummary {
            id: recording.id.clone(),
            vehicles: recording.tracks.len() as u64,
            samples: recording.tracks.iter().map(|t| t.len() as u64).sum(),
            data_sets: mined.data_sets,
            driven_s,
            driven_m,
            frame_rate_hz: recording.frame_rate_hz,
            files,
            preset: None,
            content: content(recording),
        };
        let (scenarios, recordings) = (mined.scenarios, vec![summary]);
        Collection { scenarios, recordings, synthetic: recording.synthetic, ..Collection::default() }
    }

    fn add(&mut self, part: Collection) {
        self.problems.extend(part.problems);
        self.notes.extend(part.notes);
        self.synthetic |= part.synthetic;
        self.scenarios.extend(part.scenarios);
        self.recordings.extend(part.recordings);
    }
}

/// Found and kept scenarios of a category.
pub fn count(scenarios: &[Scenario], category: Category) -> CategoryCount {
    let of = || scenarios.iter().filter(|s| s.category == category);
    CategoryCount { found: of().count() as u64, kept: of().filter(|s| s.kept).count() as u64 }
}

/// Found and kept scenarios of every category, in their order.
pub fn counts(scenarios: &[Scenario]) -> [CategoryCount; 3] {
    Category::ALL.map(|category| count(scenarios, category))
}

/// Found and kept, per category, in one line.
pub fn counts_text(counts: &[CategoryCount]) -> String {
    let part = |(category, count): (Category, &CategoryCount)| {
        format!("{} of {} {}s", readable::count(count.kept), readable::count(count.found), category.label())
    };
    format!("kept: {}", Category::ALL.into_iter().zip(counts).map(part).collect::<Vec<_>>().join(", "))
}

/// Applies the filters of mining to scenarios of a file or table, which are kept as given; or says what they would keep.
pub(crate) fn filter_given(scenarios: &mut [Scenario], options: &MiningOptions, applies: bool) -> Option<String> {
    let verdict = |of: &Scenario| match of.category {
        Category::CutIn => cut_in::verdict(of, &options.cut_in),
        Category::CutOut => cut_out::verdict(of, &options.cut_out),
        Category::Lvd => lvd::verdict(of, &options.lvd),
    };
    let verdicts: Vec<(bool, String)> = scenarios.iter().map(verdict).collect();
    let given: Vec<bool> = scenarios.iter().map(|of| of.kept).collect();
    scenarios.iter_mut().zip(&verdicts).for_each(|(of, (kept, _))| of.kept = *kept);
    let text = counts_text(&counts(scenarios));
    if applies {
        scenarios.iter_mut().zip(verdicts).for_each(|(of, (_, reason))| of.reason = reason);
        return None;
    }
    scenarios.iter_mut().zip(&given).for_each(|(of, kept)| of.kept = *kept);
    let is_other = given.iter().zip(&verdicts).any(|(given, (kept, _))| given != kept);
    is_other.then(|| format!("scenarios are kept as given; by the filters ({}) {text}", option("filter")))
}

/// Names of vehicles that are longer have their number in ids.
const MAX_NAME_BYTES: usize = 64;

/// Maximum size of the files that are read at a time, bytes, unless one is larger: a recording takes about as much memory as
/// its file has bytes.
const MAX_BYTES_AT_A_TIME: u64 = 4 << 30;
/// A file that gzip compressed has about this many times its size.
const UNPACKED: u64 = 8;

/// Size of the files of a recording when they are unpacked, bytes.
fn bytes(file: &InputFile) -> u64 {
    let size = |path: &PathBuf| {
        let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
        if path.extension().is_some_and(|ending| ending == "gz") { UNPACKED * bytes } else { bytes }
    };
    file.paths().into_iter().map(size).sum()
}

/// Reads and mines every recording of a folder, or of a file. `done` is called after each file, from any thread; its error
/// ends the work.
///
/// # Errors
/// If there is no recording, or none of them can be read: the first recording's error. That of `done`.
pub fn mine_folder(
    path: &Path,
    options: &MiningOptions,
    implausible: Implausible,
    done: impl Fn() -> Result<()> + Sync,
) -> Result<Collection> {
    mine_inputs(Inputs::of(path, None)?, options, implausible, done)
}

/// The same for inputs whose format is known.
///
/// # Errors
/// As [`mine_folder`].
pub fn mine_inputs(
    inputs: Inputs,
    options: &MiningOptions,
    implausible: Implausible,
    done: impl Fn() -> Result<()> + Sync,
) -> Result<Collection> {
    options.validate()?;
    let preset = inputs.preset.as_ref().map(|preset| format!("{} (sha256 {})", preset.name, preset.sha256));
    let (files, problems) = inputs.files();
    let part = |loaded: Loaded| {
        let (data_sets, ScenarioFile { scenarios, problems, notes }) = mine_loaded(&loaded, options, implausible);
        let mined = Mined { scenarios, data_sets };
        let mut part = Collection::of(&loaded.recording, mined, loaded.checksum_sha256, options);
        part.recordings[0].preset.clone_from(&preset);
        let name = |note: String| format!("recording {}: {note}", loaded.recording.id);
        part.notes = loaded.notes.into_iter().chain(notes).map(name).collect();
        Collection { problems, ..part }
    };
    let mut sum = 0;
    // A batch of files that memory holds at once; the first file of another begins it.
    let batches = files.chunk_by(|before, next| {
        sum += bytes(before);
        let is_same = sum + bytes(next) <= MAX_BYTES_AT_A_TIME;
        sum = if is_same { sum } else { 0 };
        is_same
    });
    let mut all = Vec::new();
    for batch in batches {
        // The outer error ends the work; an inner one leaves out a file.
        let parts: Result<Vec<Result<Vec<Collection>>>> = batch
            .par_iter()
            .with_max_len(1)
            .map(|file| {
                let parts = file.read(implausible).map(|all| all.into_iter().map(part).collect());
                done()?;
                Ok(parts)
            })
            .collect();
        all.extend(parts?);
    }
    let mut collection = Collection { problems, ..Collection::default() };
    let mut usable = Vec::new();
    for parts in all {
        parts.map_or_else(|error| collection.problems.push(error), |parts| usable.extend(parts));
    }
    add_once(usable, &mut collection);
    if collection.recordings.is_empty() && !collection.problems.is_empty() {
        return Err(collection.problems.swap_remove(0));
    }
    Ok(collection)
}

/// The number of data sets of a recording, its usable scenarios with the frames and names of the file, and what to know of them.
pub fn mine_loaded(loaded: &Loaded, options: &MiningOptions, implausible: Implausible) -> (u64, ScenarioFile) {
    let mut mined = mine(&loaded.recording, options);
    mined.scenarios.iter_mut().for_each(|scenario| name_as_in_file(scenario, loaded));
    let mut found = usable(mined.scenarios, implausible);
    found.notes.extend(noise_notes(&loaded.recording, options));
    if mined.data_sets == 0 {
        let cut_m = options.ego_view.cut_m;
        let note = format!("no vehicle drives {cut_m} m in view (`ego_view.cut_m`), so none is an ego: lower it");
        found.notes.push(note);
    }
    (mined.data_sets, found)
}

/// Gives a scenario the frames of its file, and an id with the names of its vehicles there.
fn name_as_in_file(scenario: &mut Scenario, loaded: &Loaded) {
    if let Some([zero, step]) = loaded.file_frames {
        let frames = [&mut scenario.frame0, &mut scenario.frame1].into_iter().chain(&mut scenario.frame_switch);
        frames.chain(scenario.tag_frames.iter_mut().flatten()).for_each(|frame| *frame = zero + step * *frame);
    }
    let name = |id: u32| match loaded.vehicle_names.get(&id) {
        // A slash separates the parts of a lane's key.
        Some(name) if name.len() <= MAX_NAME_BYTES => {
            name.replace(|c: char| c == '/' || c == '\\' || c.is_whitespace() || c.is_control(), "-")
        }
        _ => id.to_string(),
    };
    let (ego, target) = (name(scenario.ego_id), name(scenario.target_id));
    scenario.id = mined_id(&scenario.recording, scenario.category, &ego, &target, scenario.frame0);
}

/// Generates and mines synthetic recordings. `done` is called after each one, from any thread; its error ends the work.
///
/// # Errors
/// [`Error::Usage`] for options out of range; that of `done`.
pub fn mine_generated(
    generator: &GeneratorOptions,
    options: &MiningOptions,
    done: impl Fn() -> Result<()> + Sync,
) -> Result<Collection> {
    options.validate()?;
    let parts: Vec<Collection> = (0..generator.recordings)
        .into_par_iter()
        .with_max_len(1)
        .map(|index| {
            let recording = generate_one(generator, index)?;
            let mined = mine(&recording, options);
            done()?;
            Ok(Collection::of(&recording, mined, Vec::new(), options))
        })
        .collect::<Result<_>>()?;
    let mut collection = Collection::default();
    parts.into_iter().for_each(|part| collection.add(part));
    Ok(collection)
}

/// Noise of accelerations above this fraction of the threshold of the peak can decide. Drivers who dawdle, as those of SUMO, make 0.22.
const MAX_NOISE_FRACTION: f64 = 0.3;
/// Lateral motion over the window of mining is so many standard deviations of noise at most by chance.
const MIN_LATERAL_DEVIATIONS: f64 = 4.0;

/// Notes on a recording whose noise can decide what is mined; none for good data.
fn noise_notes(recording: &Recording, options: &MiningOptions) -> impl Iterator<Item = String> {
    let (noise, window_s) = (Noise::of(recording), options.lateral.window_s);
    let (threshold, calm_m) = (options.lvd.min_peak_deceleration_mps2, options.lateral.quiescent_speed_mps * window_s);
    let [peak, acceleration] = [value(threshold), significant(noise.acceleration_mps2, 2)];
    let of_peaks = (threshold > 0.0 && noise.acceleration_mps2 > MAX_NOISE_FRACTION * threshold).then(|| format!(
        "noise can decide which leader decelerations are found and kept: that of accelerations is {acceleration} m/s², the threshold of \
         the peak {peak} m/s²; smooth the positions by `smoothing_s` in a preset, 1 s and longer"
    ));
    let [lateral, calm, window] = [significant(noise.lateral_m, 2), significant(calm_m, 2), value(window_s)];
    let of_changes = (MIN_LATERAL_DEVIATIONS * noise.lateral_m > calm_m).then(|| format!(
        "noise can decide when lane changes begin and end: that of positions across the road is {lateral} m, and less than {calm} m in \
         {window} s count as no lateral motion"
    ));
    of_peaks.into_iter().chain(of_changes)
}

/// Recordings with more of their instants in others count them twice.
const MAX_REPEATED: f64 = 0.05;

/// Adds recordings but those whose name a larger one has, and those that are a larger one again, all or in part: problems.
fn add_once(parts: Vec<Collection>, to: &mut Collection) {
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by_key(|at| Reverse(parts[*at].recordings[0].samples));
    let (mut names, mut first_of, mut wrong) = (HashSet::new(), HashMap::new(), HashMap::new());
    for at in order {
        let own = &parts[at].recordings[0];
        let others: Vec<usize> = own.content.iter().filter_map(|instant| first_of.get(instant).copied()).collect();
        if !names.insert(&own.id) {
            let problem = "another file has a recording of this name".to_owned();
            wrong.insert(at, (problem, "rename one of the files, or remove it if it is a copy"));
        } else if others.len() as f64 > MAX_REPEATED * own.content.len() as f64 {
            let (percent, other) = (100 * others.len() / own.content.len(), &parts[others[0]].recordings[0].id);
            let problem = format!(
                "it is recording {other} again: at {percent} % of its instants all positions are equal, and their hours would count twice"
            );
            wrong.insert(at, (problem, "remove it, or the part that is in both; the longer recording is used"));
        } else {
            first_of.extend(own.content.iter().map(|instant| (*instant, at)));
        }
    }
    for (at, part) in parts.into_iter().enumerate() {
        match wrong.remove(&at) {
            Some((problem, help)) => {
                let place = Place::item(format!("recording {}", part.recordings[0].id));
                to.problems.push(Error::input(place, problem, help));
            }
            None => to.add(part),
        }
    }
}

/// A checksum of all positions at each instant of a carriageway: those of one vehicle alone may occur twice in simulations.
fn content(recording: &Recording) -> Vec<u64> {
    let of_instant = |present: &[VehicleAtFrame]| {
        let mut hash = DefaultHasher::new();
        for at in present {
            let d_m = recording.tracks[at.track as usize].d_m[at.sample as usize];
            (at.s_m.to_bits(), d_m.to_bits()).hash(&mut hash);
        }
        hash.finish()
    };
    let of = |carriageway: usize| {
        let index = FrameIndex::new(recording, carriageway);
        index.frames().filter(|present| present.len() > 1).map(of_instant).collect::<Vec<u64>>()
    };
    (0..recording.carriageways.len()).flat_map(of).collect()
}

/// Time and distance of all ego data sets, from each ego's first sample to its last with tags: the exposure.
fn driven(recording: &Recording, options: &MiningOptions) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for ego in &recording.tracks {
        let Some(last) = options.ego_view.last_sample(ego) else { continue };
        sum[0] += last as f64 / recording.frame_rate_hz;
        sum[1] += ego.s_m[last] - ego.s_m[0];
    }
    sum
}
