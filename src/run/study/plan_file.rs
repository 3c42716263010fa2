//! A study as a file: a line of JSON, then its scenarios as in a scenario file, one per line, in pages of 64. The first
//! line contains a checksum of every page. A process that computes some of the scenarios reads only their pages. The
//! hash of the plan is that of the first line's data and checksums.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::cases::decompositions;
use super::plan::StudyOptions;
use crate::score::CROSS_VALIDATED;
use lanesweep_engine::plan::{Headway, LanePlan};
use lanesweep_engine::version::Canonical;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::parameterization::{Parameterization, ParameterizationOptions, Reduction, SvdBasis};
use lanesweep_model::scenario::{Category, Scenario};
use lanesweep_support::plain_text::hex;
use lanesweep_support::{Error, Result};

/// Number of scenarios in a page.
pub(super) const PAGE: u64 = 64;

/// The fields of a scenario that determine its cases, and its initial gap if no headway sets it. The file and the hash
/// contain nothing else of it.
pub(crate) fn stripped(scenario: &Scenario, gap_m: Option<f64>) -> Scenario {
    let mut stripped = Scenario {
        recording: String::new(),
        ego_id: 0,
        target_id: 0,
        lead_id: None,
        frame0: 0,
        frame1: 0,
        reason: String::new(),
        thw0: None,
        gap0: gap_m,
        peak_decel: None,
        truncated_start: None,
        end_cause: None,
        frame_switch: None,
        tag_frames: None,
        // The study's provenance records this.
        synthetic: false,
        ..scenario.clone()
    };
    if scenario.category == Category::Lvd {
        stripped.target.y = Vec::new();
    }
    if scenario.category != Category::CutOut {
        (stripped.lead, stripped.lead_gap) = (None, None);
    }
    stripped.lead.iter_mut().for_each(|lead| lead.y = Vec::new());
    stripped
}

/// The lines of a page. Series that affect no lane take no memory, but a scenario file requires them: they are written
/// as 0.
pub(super) fn lines(scenarios: &[Scenario]) -> std::io::Result<Vec<u8>> {
    let mut text = Vec::new();
    for scenario in scenarios {
        let mut whole = scenario.clone();
        for other in std::iter::once(&mut whole.target).chain(&mut whole.lead) {
            other.y.resize(other.v.len(), 0.0);
        }
        serde_json::to_writer(&mut text, &whole)?;
        text.push(b'\n');
    }
    Ok(text)
}

/// The data of a study without its scenarios, and the checksums of these.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyHead {
    pub(super) plan_sha256: String,
    pub(super) profile: Profile,
    pub(super) models: Vec<ModelId>,
    pub(super) headways: Vec<Headway>,
    pub(crate) parameterization: ParameterizationOptions,
    pub(super) blocks: Vec<BlockHead>,
    /// Bytes and SHA-256 of every page of scenarios.
    pub(super) pages: Vec<(u64, String)>,
}

/// One category's part of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BlockHead {
    pub(super) category: Category,
    pub(super) units: u64,
    /// `None` if there were too few scenarios for a decomposition.
    pub(super) basis: Option<SvdBasis>,
    /// Decompositions of a cross-validation: each of all folds but its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) folds: Vec<SvdBasis>,
    /// Names of the S' that the scenarios hold as series.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) replays: Vec<String>,
}

impl BlockHead {
    /// Keeps the part of the decompositions that cases are made with.
    pub(crate) fn new(
        category: Category,
        units: u64,
        reduction: Option<&Reduction>,
        folds: &[Reduction],
        replays: Vec<String>,
    ) -> BlockHead {
        let used = Parameterization::max_coefficients(category);
        let basis = |reduction: &Reduction| {
            let SvdBasis { weights, mean, directions, rows, .. } = reduction.basis.clone();
            let directions = directions.into_iter().take(used).collect();
            SvdBasis { weights, mean, directions, rows, singular_values: Vec::new() }
        };
        BlockHead { category, units, basis: reduction.map(basis), folds: folds.iter().map(basis).collect(), replays }
    }

    /// Names of the S' that are made neither by features nor by the decomposition of all scenarios.
    pub(super) fn others(&self) -> impl Iterator<Item = String> {
        let held_out = decompositions(self.category).filter(|_| !self.folds.is_empty());
        held_out.map(|id| format!("{}{CROSS_VALIDATED}", id.key)).chain(self.replays.iter().cloned())
    }
}

/// The plan of a study of these scenarios, in the order of their categories, with given decompositions: for the test that
/// pins the bits of lanes.
///
/// # Errors
/// [`Error::Internal`] for parts that do not fit.
#[doc(hidden)]
pub fn plan_of_parts(
    profile: &Profile,
    options: &StudyOptions,
    categories: &[(Category, Reduction)],
    scenarios: &[Scenario],
) -> Result<LanePlan> {
    let units = |of: Category| scenarios.iter().filter(|scenario| scenario.category == of).count() as u64;
    let block =
        |(of, reduction): &(Category, Reduction)| BlockHead::new(*of, units(*of), Some(reduction), &[], Vec::new());
    let blocks = categories.iter().map(block).collect();
    let held: Vec<Scenario> = scenarios.iter().map(|scenario| stripped(scenario, None)).collect();
    let head = StudyHead::new(profile, options, blocks, &held)?;
    head.with_scenarios(0, held)?.window(0..scenarios.len() as u64)
}

impl StudyHead {
    /// The head for scenarios that are all held.
    pub(crate) fn new(
        profile: &Profile,
        options: &StudyOptions,
        blocks: Vec<BlockHead>,
        held: &[Scenario],
    ) -> Result<StudyHead> {
        let page = |scenarios| lines(scenarios).map(|text| (text.len() as u64, hex(&Sha256::digest(text))));
        let pages: std::io::Result<_> = held.chunks(PAGE as usize).map(page).collect();
        let pages = pages.map_err(|e| Error::Internal(format!("a scenario cannot be written: {e}")))?;
        let mut head = StudyHead {
            plan_sha256: String::new(),
            profile: profile.clone(),
            models: options.models.clone(),
            headways: options.headways.clone(),
            parameterization: options.parameterization.clone(),
            blocks,
            pages,
        };
        head.plan_sha256 = head.hash()?;
        Ok(head)
    }

    /// Hash of the plan: everything that determines the outcomes.
    fn hash(&self) -> Result<String> {
        let StudyHead { plan_sha256: _, profile, models, headways, parameterization, blocks, pages } = self;
        let mut canonical = Canonical::new("study of lines");
        canonical.value(&(profile, models, headways, parameterization, blocks))?;
        for (bytes, sha256) in pages {
            canonical.word(*bytes);
            canonical.text(sha256);
        }
        Ok(canonical.finish())
    }

    /// Number of scenarios of the study.
    pub(super) fn unit_count(&self) -> u64 {
        self.blocks.iter().map(|block| block.units).fold(0, u64::saturating_add)
    }

    /// Total size of all scenarios, bytes.
    pub(super) fn scenario_bytes(&self) -> u64 {
        self.pages.iter().map(|(bytes, _)| *bytes).fold(0, u64::saturating_add)
    }
}
