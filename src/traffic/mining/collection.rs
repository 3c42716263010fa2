//! Many recordings at once: read and mined in parallel, one recording per thread in memory at a time, the
//! result in the recordings' order. A recording that cannot be read is reported; the others are used.

use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::miner::{CategoryCount, Mined, mine};
use super::noise::noise_notes;
use super::options::MiningOptions;
use crate::scenario::{Category, Scenario};
use crate::support::plausibility::Implausible;
use crate::support::readable;
use crate::traffic::trajectory::generator::{GeneratorOptions, generate_one};
use crate::traffic::trajectory::{FileChecksum, Inputs, Loaded, Recording};
use crate::{Error, Result};

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
}

impl Collection {
    fn add(&mut self, part: MinedPart) {
        self.notes.extend(part.notes);
        self.synthetic |= part.synthetic;
        self.scenarios.extend(part.mined.scenarios);
        self.recordings.push(part.summary);
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

struct MinedPart {
    mined: Mined,
    summary: RecordingSummary,
    notes: Vec<String>,
    synthetic: bool,
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
        let mined = mine(&loaded.recording, options);
        let mut summary = summary(&loaded.recording, &mined, options, loaded.checksum_sha256);
        summary.preset.clone_from(&preset);
        let name = |note: String| format!("recording {}: {note}", loaded.recording.id);
        let of_noise = noise_notes(&loaded.recording, &mined.scenarios, options);
        let notes = loaded.notes.into_iter().chain(of_noise).map(name).collect();
        MinedPart { mined, summary, notes, synthetic: loaded.recording.synthetic }
    };
    // The outer error ends the work; an inner one leaves out a file.
    let parts: Result<Vec<Result<Vec<MinedPart>>>> = files
        .par_iter()
        .with_max_len(1)
        .map(|file| {
            let parts = file.read(implausible).map(|all| all.into_iter().map(part).collect());
            done()?;
            Ok(parts)
        })
        .collect();
    let mut collection = Collection { problems, ..Collection::default() };
    for parts in parts? {
        match parts {
            Ok(parts) => parts.into_iter().for_each(|part| collection.add(part)),
            Err(error) => collection.problems.push(error),
        }
    }
    if collection.recordings.is_empty() && !collection.problems.is_empty() {
        return Err(collection.problems.swap_remove(0));
    }
    Ok(collection)
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
    let parts: Vec<MinedPart> = (0..generator.recordings)
        .into_par_iter()
        .with_max_len(1)
        .map(|index| {
            let recording = generate_one(generator, index)?;
            let mined = mine(&recording, options);
            let summary = summary(&recording, &mined, options, Vec::new());
            done()?;
            Ok(MinedPart { mined, summary, notes: Vec::new(), synthetic: recording.synthetic })
        })
        .collect::<Result<_>>()?;
    let mut collection = Collection::default();
    for part in parts {
        collection.add(part);
    }
    Ok(collection)
}

fn summary(
    recording: &Recording,
    mined: &Mined,
    options: &MiningOptions,
    files: Vec<FileChecksum>,
) -> RecordingSummary {
    let [driven_s, driven_m] = driven(recording, options);
    RecordingSummary {
        id: recording.id.clone(),
        vehicles: recording.tracks.len() as u64,
        samples: recording.tracks.iter().map(|t| t.len() as u64).sum(),
        data_sets: mined.data_sets,
        driven_s,
        driven_m,
        frame_rate_hz: recording.frame_rate_hz,
        files,
        preset: None,
    }
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
