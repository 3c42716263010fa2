//! What only SUMO's files have: types of vehicles in files beside the tracks, persons among the vehicles, and lane changes of one
//! step.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use super::TrackFile;
use super::boxes::{begins_so, usual_size_m};
use super::preset::{FileFormat, Preset};
use super::raw::{NO_LABEL, RawRecording, RawSample, RawVehicle};
use super::road::cross;
use super::roles::{ColumnName, Role};
use super::rows::{Columns, Rows};
use crate::support::atomic_file::folder_of;
use crate::support::files::file_name;
use crate::traffic::trajectory::csv_table::FileChecksum;
use crate::{Error, Place, Result};

/// A step across the road, in at most [`LONGEST_STEP_S`], that no lane change over time has, m.
const LANE_STEP_M: f64 = 2.5;
const LONGEST_STEP_S: f64 = 1.0;

/// Adds the sizes and classes of types, leaves out persons, and finds lane changes of one step. Returns the checksums of the files
/// with types.
///
/// # Errors
/// Those of the files; [`Error::Input`] for a type with two sizes.
pub(super) fn add_facts(
    file: &TrackFile,
    patterns: &[String],
    preset: &Preset,
    recordings: &mut [RawRecording],
) -> Result<Vec<FileChecksum>> {
    let mut types = Types::default();
    let mut checksums = Vec::new();
    for (of_types, is_own) in types_files(file, patterns)? {
        checksums.push(types.read(&of_types, is_own, preset)?);
    }
    for recording in recordings {
        let mut unknown: BTreeSet<String> = BTreeSet::new();
        for vehicle in &mut recording.vehicles {
            let name = vehicle.class.clone().unwrap_or_default();
            match types.of(&name) {
                Some(of) if of.files.len() > 1 => {
                    return Err(Error::input(
                        Place::file(&file.path).of(format!("vehicle {}", vehicle.key)),
                        format!("its type `{name}` has two sizes, in {}", of.files.join(" and ")),
                        format!("name the right file like the tracks: {}", patterns[0].replace('*', &file.id)),
                    ));
                }
                Some(of) => {
                    vehicle.complete_sizes(&of.vehicle);
                    vehicle.class = of.vehicle.class.clone().or_else(|| vehicle.class.take());
                }
                None if name.is_empty() || !vehicle.lengths_m.is_empty() => {}
                None => drop(unknown.insert(name)),
            }
        }
        leave_out_persons(recording, preset);
        unknown.retain(|name| !begins_so(name, &preset.classes.ignored));
        if !unknown.is_empty() {
            let names: Vec<String> = unknown.iter().take(10).map(|name| format!("`{name}`")).collect();
            let more = if unknown.len() > 10 { ", …" } else { "" };
            recording.notes.push(format!(
                "no vType of {} beside the tracks is named {}{more}: their sizes are assumed",
                patterns.join(", "),
                names.join(", ")
            ));
        }
        find_instant_lane_changes(recording);
    }
    Ok(checksums)
}

/// A type, whether it is of a file named like the tracks, and the files with it: two if they contradict one another.
struct Type {
    vehicle: RawVehicle,
    is_own: bool,
    files: Vec<String>,
}

#[derive(Default)]
struct Types(HashMap<String, Type>);

impl Types {
    /// The type of a name; SUMO writes `type@distribution` for a type of a distribution.
    fn of(&self, name: &str) -> Option<&Type> {
        self.0.get(name).or_else(|| self.0.get(name.split('@').next().unwrap_or_default()))
    }

    /// Adds the types of a file. A type without a size has that of its class in `sizes`.
    fn read(&mut self, file: &Path, is_own: bool, preset: &Preset) -> Result<FileChecksum> {
        let rows = Rows::open(file, FileFormat::Xml, Some("vType"), None)?;
        let named = [(Role::Vehicle, "id"), (Role::Length, "length"), (Role::Width, "width"), (Role::Class, "vClass")];
        let named = named.map(|(role, name)| (role, ColumnName::Name(name.to_owned())));
        let columns = Columns::of(&named.into_iter().collect(), rows.header(), &[]);
        let name = file_name(file);
        let (checksum, _) = rows.each(&columns, &mut |row| {
            let Some(key) = row.text(Role::Vehicle)? else { return Ok(()) };
            let class = row.text(Role::Class)?.map(|class| class.into_owned());
            let usual = usual_size_m(class.as_deref().unwrap_or_default(), preset);
            let vehicle = RawVehicle {
                key: key.to_string(),
                lengths_m: row.number(Role::Length)?.or(usual.map(|size| size[0])).into_iter().collect(),
                widths_m: row.number(Role::Width)?.or(usual.map(|size| size[1])).into_iter().collect(),
                class,
                ..RawVehicle::default()
            };
            match self.0.get_mut(&vehicle.key) {
                None => {
                    let files = vec![name.clone()];
                    self.0.insert(vehicle.key.clone(), Type { vehicle, is_own, files });
                }
                Some(known) => {
                    let size = |of: &RawVehicle| [of.lengths_m.first().copied(), of.widths_m.first().copied()];
                    if known.is_own == is_own && size(&known.vehicle) != size(&vehicle) {
                        known.files.push(name.clone());
                    }
                }
            }
            Ok(())
        })?;
        Ok(checksum)
    }
}

/// The files with types beside a track file, and whether they are named like it: `fcd.rou.xml` for `fcd.xml` or `fcd.2.xml`. Where none
/// is, all that fit the pattern.
fn types_files(file: &TrackFile, patterns: &[String]) -> Result<Vec<(PathBuf, bool)>> {
    let folder = folder_of(&file.path);
    let names = [file.id.as_str(), file.id.split('.').next().unwrap_or_default()];
    let (mut own, mut others) = (Vec::new(), Vec::new());
    for pattern in patterns {
        let like_tracks = names.map(|name| folder.join(pattern.replace('*', name)));
        if let Some(file) = like_tracks.into_iter().find(|file| file.exists()) {
            own.push((file, true));
            continue;
        }
        let ending = pattern.rsplit('*').next().unwrap_or(pattern);
        let listed = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
        let fits = |file: &PathBuf| file.to_string_lossy().ends_with(ending);
        others.extend(listed.flatten().map(|entry| entry.path()).filter(fits).map(|file| (file, false)));
    }
    others.sort();
    own.extend(others);
    Ok(own)
}

/// SUMO writes persons as vehicles into CSV and Parquet; they are in no lane.
fn leave_out_persons(recording: &mut RawRecording, preset: &Preset) {
    let is_in_lane = |vehicle: &RawVehicle| (0..vehicle.samples.len()).any(|k| vehicle.samples.lane(k) != NO_LABEL);
    let is_ignored =
        |vehicle: &RawVehicle| vehicle.class.as_ref().is_some_and(|c| begins_so(c, &preset.classes.ignored));
    if recording.lanes.is_empty() {
        return;
    }
    let before = recording.vehicles.len();
    recording.vehicles.retain(|vehicle| is_in_lane(vehicle) || is_ignored(vehicle));
    let persons = before - recording.vehicles.len();
    if persons > 0 {
        recording.notes.push(format!("{persons} are left out as persons: no row of theirs names a lane"));
    }
}

/// SUMO's default model moves a vehicle to the other lane in one step, which no lateral speed describes.
fn find_instant_lane_changes(recording: &mut RawRecording) {
    let is_instant = |a: &RawSample, b: &RawSample| {
        let way = [b.xy_m[0] - a.xy_m[0], b.xy_m[1] - a.xy_m[1]];
        // The chord of a curve has the mean heading of its ends.
        let ahead = [a.heading[0] + b.heading[0], a.heading[1] + b.heading[1]];
        let across_m = cross(ahead, way) / libm::hypot(ahead[0], ahead[1]);
        b.at - a.at <= LONGEST_STEP_S && across_m.abs() > LANE_STEP_M
    };
    let changes = |vehicle: &RawVehicle| {
        let samples = &vehicle.samples;
        let changes = (1..samples.len()).filter(|k| samples.lane(k - 1) != samples.lane(*k));
        changes.filter(|k| is_instant(&samples.get(k - 1), &samples.get(*k))).count()
    };
    let instant: usize = recording.vehicles.iter().map(changes).sum();
    if instant > 0 {
        recording.notes.push(format!(
            "{instant} lane changes take one step, as SUMO's default lane-change model makes them: simulate with SUMO's `lanechange.duration`, or with the sublane model"
        ));
    }
}
