//! A study as a file: a line of JSON, then its scenarios as in a scenario file, one per line, in pages of 64. The first
//! line contains a checksum of every page. A process that computes some of the scenarios reads only their pages. The
//! hash of the plan is that of the first line's data and checksums.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::engine::plan::Headway;
use crate::engine::version::Canonical;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::scenario::parameterization::{
    Parameterization, ParameterizationOptions, ReducedScenario, Reduction, SvdBasis,
};
use crate::scenario::{Category, Scenario, problem_of};
use crate::support::plain_text::hex;
use crate::support::ranges::repeated;
use crate::{Error, Place, Result};

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
    /// Names of the S' that the scenarios hold as series.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) replays: Vec<String>,
}

impl BlockHead {
    /// Keeps the part of the decomposition that cases are made with.
    pub fn new(category: Category, units: u64, reduction: Option<&Reduction>, replays: Vec<String>) -> BlockHead {
        let used = Parameterization::max_coefficients(category);
        let basis = reduction.map(|reduction| {
            let SvdBasis { weights, mean, directions, rows, .. } = reduction.basis.clone();
            let directions = directions.into_iter().take(used).collect();
            SvdBasis { weights, mean, directions, rows, singular_values: Vec::new() }
        });
        BlockHead { category, units, basis, replays }
    }
}

impl StudyHead {
    /// The head for scenarios that are all held.
    pub(crate) fn new(
        profile: Profile,
        models: Vec<ModelId>,
        headways: Vec<Headway>,
        parameterization: ParameterizationOptions,
        blocks: Vec<BlockHead>,
        held: &[Scenario],
    ) -> Result<StudyHead> {
        let page = |scenarios| lines(scenarios).map(|text| (text.len() as u64, hex(&Sha256::digest(text))));
        let pages: std::io::Result<_> = held.chunks(PAGE as usize).map(page).collect();
        let pages = pages.map_err(|e| Error::Internal(format!("a scenario cannot be written: {e}")))?;
        let plan_sha256 = String::new();
        let mut head = StudyHead { plan_sha256, profile, models, headways, parameterization, blocks, pages };
        head.plan_sha256 = head.hash()?;
        Ok(head)
    }

    /// The head with matching checksums and hash for these lines of one page, valid or not.
    #[cfg(test)]
    pub(crate) fn with_changed_lines(&self, lines: &[u8]) -> Result<StudyHead> {
        assert!(self.unit_count() <= PAGE, "the scenarios of one page");
        let mut head = self.clone();
        head.pages = vec![(lines.len() as u64, hex(&Sha256::digest(lines)))];
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

    /// Checks whether this can be the head of a study.
    pub(super) fn check(&self, place: &Place) -> Result<()> {
        let wrong =
            |problem: &str| Err(Error::input(place.clone(), problem, "make the plan again with option `plan_only`"));
        self.profile.check(place)?;
        self.parameterization.validate()?;
        if self.blocks.is_empty() || self.blocks.iter().any(|block| block.units == 0) {
            return wrong("a category has no scenario");
        }
        let is_twice = |at: usize| self.blocks[..at].iter().any(|block| block.category == self.blocks[at].category);
        if (0..self.blocks.len()).any(is_twice) {
            return wrong("a category is there twice");
        }
        if (0..self.models.len()).any(|at| self.models[..at].contains(&self.models[at])) {
            return wrong("a driver model is there twice");
        }
        Headway::refuse_mixture(&self.headways)?;
        let headways = self.headways.iter().map(|headway| (headway.identity(), headway));
        if let Some(problem) = repeated(headways) {
            return wrong(&format!("a headway is there twice: {problem}"));
        }
        if !self.headways.iter().filter_map(Headway::value).all(|number| (0.0..1e6).contains(&number)) {
            return wrong("a headway is out of range (0 to 1e6)");
        }
        for block in &self.blocks {
            let used = Parameterization::max_coefficients(block.category);
            if block.basis.as_ref().is_some_and(|basis| basis.directions.len() != used) {
                return wrong("a decomposition does not have the directions of its parameterizations");
            }
        }
        if self.pages.len() as u64 != self.unit_count().div_ceil(PAGE) {
            return wrong("it does not have the checksums of all scenarios");
        }
        if self.hash()? != self.plan_sha256 {
            return wrong(
                "its content is not that of its hash: it was changed, or another version of lanesweep made it",
            );
        }
        Ok(())
    }

    /// Total size of all scenarios, bytes.
    pub(super) fn scenario_bytes(&self) -> u64 {
        self.pages.iter().map(|(bytes, _)| *bytes).fold(0, u64::saturating_add)
    }

    /// Parses the scenario of a line and checks that it can be simulated.
    pub(super) fn scenario(&self, unit: u64, line: &[u8]) -> std::result::Result<Scenario, String> {
        let mut first = 0;
        let block = self.blocks.iter().find(|block| {
            first += block.units;
            unit < first
        });
        let scenario: Scenario =
            serde_json::from_slice(line).map_err(|e| format!("scenario {unit} cannot be read: {e}"))?;
        let wrong = |problem: &str| Err(format!("scenario {}: {problem}", scenario.id));
        if !scenario.kept || block.is_none_or(|block| block.category != scenario.category) {
            return wrong("it is none of its category that is simulated");
        }
        let is_whole = |replay: &ReducedScenario| {
            let n = replay.v.len();
            let lengths = [
                (replay.y.len(), scenario.category != Category::Lvd),
                (replay.v_lead.len(), scenario.category == Category::CutOut),
            ];
            let numbers = replay.y.iter().chain(&replay.v).chain(&replay.v_lead);
            let is_finite = numbers.chain([&replay.v_ego, &replay.lead_gap_m]).all(|number| number.is_finite());
            n > 1 && lengths.iter().all(|(length, used)| !used || *length == n) && is_finite && replay.duration_s > 0.0
        };
        if block.is_none_or(|block| block.replays.len() != scenario.replays.len())
            || !scenario.replays.iter().all(is_whole)
        {
            return wrong("its S' given as series do not fit the plan");
        }
        if Headway::is_observed(&self.headways) && scenario.gap0.is_none() {
            return wrong("it has no recorded gap");
        }
        // Copies the scenario without excess memory.
        problem_of(&scenario).map_or_else(|| Ok(stripped(&scenario, scenario.gap0)), |problem| wrong(&problem))
    }
}
