//! What identifies a case sheet, and what no sheet considers. Nothing is taken from the clock or the machine.

use super::html::Section;
use super::records::PROGRAM;
use lanesweep_engine::ENGINE_VERSION;
use lanesweep_engine::version::Canonical;
use lanesweep_model::profile::Profile;
use lanesweep_support::Result;

/// What no simulation of the program considers. The chapter for assessors has the same list.
pub(super) const NOT_CONSIDERED: [(&str, &str); 9] = [
    ("The system under assessment", "only reference drivers are simulated; nothing is said of what the system does"),
    (
        "Steering",
        "no vehicle evades; the ego stays in the middle of its lane, the others keep to the motion of the case",
    ),
    ("Road", "straight and level, with lanes of one width; no curve, slope, bank or missing marking"),
    ("Surface and weather", "every deceleration of the profile is reached: no wet, icy or uneven surface, no wind"),
    (
        "Perception",
        "positions and speeds are known without error, loss or occlusion, in every light and weather; delays are those of the profile",
    ),
    (
        "Vehicle dynamics",
        "braking is a deceleration, with a limited jerk where the model has one: no tyres, load, trailer, brake temperature or \
         control system",
    ),
    ("0.85 g after full overlap (Annex 3, table 1)", "the profile's maximum deceleration applies throughout"),
    ("Other traffic", "only the vehicles of the case exist: nothing follows the ego, and no vehicle reacts to it"),
    ("Consequences", "vehicles are rectangles along the road; no yaw, no second collision, no injuries"),
];

/// What the user and the build say of a sheet.
#[derive(Debug, Clone, Default)]
pub struct CaseIdentity {
    /// Commit of the program's sources; empty if unknown.
    pub commit: &'static str,
    /// SHA-256 of the file with the case, if there is one.
    pub file_sha256: Option<String>,
    /// Date of the run, as the user gives it.
    pub date: Option<String>,
    /// Author, as the user gives it.
    pub author: Option<String>,
}

impl CaseIdentity {
    /// Lines to sign on, and what the drivers do not stand for.
    pub(super) fn signatures(&self) -> Section {
        let given = |text: &Option<String>| text.clone().unwrap_or_default();
        Section::new("signature", "Signatures")
            .intro("The system under assessment was not simulated: the drivers are those of the profile.")
            .fact("system under assessment, version", "")
            .fact("technical service", "")
            .fact("date of the run", given(&self.date))
            .fact("author", given(&self.author))
            .fact("signature", "")
            .fact("checked by, date", "")
    }

    /// What is not considered.
    pub(super) fn not_considered() -> Section {
        Section::new("not-considered", "Not considered").facts(NOT_CONSIDERED)
    }
}

/// Program, version, commit by its first digits, and version of the lanes.
pub(super) fn program(commit: &str, digits: usize) -> String {
    let (commit, changes) = commit.split_at(commit.find(' ').unwrap_or(commit.len()));
    let commit = match commit {
        "" => "commit unknown".to_owned(),
        commit => format!("commit {}{changes}", commit.get(..digits).unwrap_or(commit)),
    };
    format!("{PROGRAM}, {commit}, engine {ENGINE_VERSION}")
}

/// SHA-256 of a profile's values in canonical form: white space and comments of its file do not change it.
///
/// # Errors
/// None for a profile of this program.
pub(super) fn profile_sha256(profile: &Profile) -> Result<String> {
    let mut canonical = Canonical::new("profile");
    canonical.value(profile)?;
    Ok(canonical.finish())
}
