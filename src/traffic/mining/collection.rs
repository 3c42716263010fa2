//! Many recordings at once: read and mined in parallel, one file per thread in memory at a time and as many as memory may
//! hold, the result in the recordings' order. A recording that cannot be read is reported; the others are used.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::{Condvar, Mutex, PoisonError};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::miner::{CategoryCount, Mined, mine};
use super::noise::noise_notes;
use super::options::MiningOptions;
use super::{cut_in, cut_out, lvd};
use crate::trajectory::generator::{GeneratorOptions, generate_one};
use crate::trajectory::{FileChecksum, InputFile, Inputs, Loaded, Recording};
use lanesweep_model::plausibility::Implausible;
use lanesweep_model::scenario::{Category, Scenario, ScenarioFile, mined_id, usable};
use lanesweep_support::{Error, Place, Result, option, readable};

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
    /// Equal for recordings in which all vehicles have the same positions.
    #[serde(skip)]
    content: u64,
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
    let of = scenarios.iter().filter(|s| s.category == category);
    of.fold(CategoryCount::default(), |sum, s| CategoryCount {
        found: sum.found + 1,
        kept: sum.kept + u64::from(s.kept),
    })
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

/// Bytes of files that may still be read. Reading and mining a file start no work on other threads, else a thread could wait for
/// another turn within its own.
struct Turns {
    left: Mutex<u64>,
    freed: Condvar,
}

impl Default for Turns {
    fn default() -> Self {
        Turns { left: Mutex::new(MAX_BYTES_AT_A_TIME), freed: Condvar::new() }
    }
}

impl Turns {
    /// Waits until a file may be read; its turn ends with the returned value.
    fn of(&self, file: &InputFile) -> Turn<'_> {
        let size = |path: &std::path::PathBuf| {
            let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
            if path.extension().is_some_and(|ending| ending == "gz") { UNPACKED * bytes } else { bytes }
        };
        let bytes = file.paths().iter().map(size).sum();
        self.of_bytes(bytes)
    }

    fn of_bytes(&self, bytes: u64) -> Turn<'_> {
        let bytes = bytes.min(MAX_BYTES_AT_A_TIME);
        let left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        let mut left = self.freed.wait_while(left, |left| *left < bytes).unwrap_or_else(PoisonError::into_inner);
        *left -= bytes;
        Turn { turns: self, bytes }
    }
}

struct Turn<'a> {
    turns: &'a Turns,
    bytes: u64,
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        *self.turns.left.lock().unwrap_or_else(PoisonError::into_inner) += self.bytes;
        self.turns.freed.notify_all();
    }
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
    let preset = inputs.preset().map(|preset| format!("{} (sha256 {})", preset.name, preset.sha256));
    let (files, problems) = inputs.files();
    let part = |loaded: Loaded| {
        let mut mined = mine(&loaded.recording, options);
        let of_noise = noise_notes(&loaded.recording, options);
        mined.scenarios.iter_mut().for_each(|scenario| name_as_in_file(scenario, &loaded));
        let ScenarioFile { scenarios, problems, notes: doubts } = usable(mined.scenarios, implausible);
        mined.scenarios = scenarios;
        let mut part = Collection::of(&loaded.recording, mined, loaded.checksum_sha256, options);
        part.recordings[0].preset.clone_from(&preset);
        let name = |note: String| format!("recording {}: {note}", loaded.recording.id);
        let cut_m = options.ego_view.cut_m;
        let no_ego = (part.recordings[0].data_sets == 0)
            .then(|| format!("no vehicle drives {cut_m} m in view (`ego_view.cut_m`), so none is an ego: lower it"));
        part.notes = loaded.notes.into_iter().chain(doubts).chain(of_noise).chain(no_ego).map(name).collect();
        Collection { problems, ..part }
    };
    let turns = Turns::default();
    // The outer error ends the work; an inner one leaves out a file.
    let parts: Result<Vec<Result<Vec<Collection>>>> = files
        .par_iter()
        .with_max_len(1)
        .map(|file| {
            let _turn = turns.of(file);
            let parts = file.read(implausible).map(|all| all.into_iter().map(part).collect());
            done()?;
            Ok(parts)
        })
        .collect();
    let mut collection = Collection { problems, ..Collection::default() };
    let mut names = HashSet::new();
    for parts in parts? {
        match parts {
            Ok(parts) => {
                for part in parts {
                    let own = &part.recordings[0];
                    let problem = match collection.recordings.iter().find(|of| of.content == own.content) {
                        _ if names.contains(&own.id) => "another file has a recording of this name".to_owned(),
                        Some(other) => format!("it is recording {} again: all positions are equal", other.id),
                        None => {
                            names.insert(own.id.clone());
                            collection.add(part);
                            continue;
                        }
                    };
                    let place = Place::item(format!("recording {}", own.id));
                    let help = "rename one of the files, or remove it if it is a copy";
                    collection.problems.push(Error::input(place, problem, help));
                }
            }
            Err(error) => collection.problems.push(error),
        }
    }
    if collection.recordings.is_empty() && !collection.problems.is_empty() {
        return Err(collection.problems.swap_remove(0));
    }
    Ok(collection)
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

/// A checksum of all positions.
fn content(recording: &Recording) -> u64 {
    let mut hash = DefaultHasher::new();
    for value in recording.tracks.iter().flat_map(|track| track.s_m.iter().chain(&track.d_m)) {
        value.to_bits().hash(&mut hash);
    }
    hash.finish()
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
