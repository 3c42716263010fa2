//! The plan file of a sampling run: the density, the proposal and all options, so that every shard and the merge use
//! the same run.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::plan::plan_samples;
use super::proposal_file::{proposal_from_text, proposal_text};
use super::sample_options::{Estimator, SampleOptions};
use super::{Sample, SampleKind, Weighted};
use crate::parts::{kind_of, read_sealed, seal};
use lanesweep_model::profile::Profile;
use lanesweep_stats::density::DensityModel;
use lanesweep_stats::estimate::{Importance, SearchRun};
use lanesweep_support::atomic_file::refuse_link;
use lanesweep_support::files::{make_folder, write_inside};
use lanesweep_support::{Error, Place, Result, option};

/// File of a run with its own search; kept until the run ends.
pub(super) const SEARCH_FILE: &str = "search.json";
/// Kind of the sealed file.
pub(crate) const KIND: &str = "sampling plan";
/// Maximum size of a plan that is read, bytes: mostly the density.
const MAX_PLAN_BYTES: u64 = 1 << 30;
const HOW_TO_REMAKE: &str = "make it by `sample --plan-only` of this version";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    /// The density file's text.
    density: String,
    profile: Profile,
    options: SampleOptions,
    /// The proposal file's text, for importance sampling.
    proposal: Option<String>,
    /// Draws of importance sampling.
    draws: Option<Importance>,
    /// The search that found the proposal, unless it was given.
    search: Option<SearchRun>,
    /// Hash of the lanes of crude Monte Carlo.
    plan_sha256: Option<String>,
}

impl Sample {
    /// The run as the text of a file, with its hash.
    pub(crate) fn plan_file(&self) -> Result<(Vec<u8>, String)> {
        match &self.kind {
            SampleKind::Weighted(weighted) => self.plan_file_over(Some(weighted)),
            _ => self.plan_file_over(None),
        }
    }

    fn plan_file_over(&self, weighted: Option<&Weighted>) -> Result<(Vec<u8>, String)> {
        let unreadable = |e: std::string::FromUtf8Error| Error::Internal(format!("a density is no text: {e}"));
        let file = PlanFile {
            density: String::from_utf8(self.density.to_json()?).map_err(unreadable)?,
            profile: self.profile.clone(),
            options: self.options.clone(),
            proposal: weighted.map(|weighted| proposal_text(&self.density, &weighted.proposal)).transpose()?,
            draws: weighted.map(|weighted| weighted.draws),
            search: weighted.and_then(|weighted| weighted.search.clone()),
            plan_sha256: self.lane_plan().map(|plan| plan.hash().to_owned()),
        };
        seal(KIND, &file)
    }

    /// Reads a plan file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for any other or incomplete file, or another version.
    pub fn read(path: &Path) -> Result<Sample> {
        let file: PlanFile = read_sealed(KIND, path, MAX_PLAN_BYTES, HOW_TO_REMAKE)?.0;
        let PlanFile { profile, options, mut search, draws, .. } = file;
        let place = Place::file(path);
        let wrong = |problem: &str| Error::input(place.clone(), problem, HOW_TO_REMAKE);
        let density = DensityModel::from_json(file.density.as_bytes(), &place)?;
        let proposal = file.proposal.as_ref().map(|text| proposal_from_text(text.as_bytes(), &density, &place));
        let proposal = proposal.transpose()?;
        if let Some(search) = search.as_mut().filter(|search| search.has_found()) {
            search.proposal.clone_from(&proposal);
        }
        let fits = search.as_ref().is_none_or(|search| search.questions.len() == options.asked().len());
        let kind = match &options.estimator {
            Estimator::Crude => {
                let plan = plan_samples(&density, &profile, &options).map_err(|error| match error {
                    Error::Usage { problem, .. } => wrong(&problem),
                    other => other,
                })?;
                if file.plan_sha256.as_deref() != Some(plan.hash()) {
                    return Err(wrong("its content is not that of its hash: another version of lanesweep made it"));
                }
                SampleKind::Crude(Box::new(plan))
            }
            _ => match proposal.zip(draws) {
                Some((proposal, draws))
                    if fits
                        && (1..1 << 63).contains(&draws.draws)
                        && search.is_some() == matches!(options.estimator, Estimator::Search(_)) =>
                {
                    SampleKind::Weighted(Box::new(Weighted { proposal, draws, search }))
                }
                _ => return Err(wrong("its proposal, draws and search do not fit its estimator")),
            },
        };
        let sample = Sample { density, profile, options, kind };
        sample.check_lanes()?;
        Ok(sample)
    }

    /// The same run after its search, if an interrupted run or another shard saved it in this file.
    pub(super) fn kept_search(&self, path: &Path, is_plan: bool) -> Result<Option<Sample>> {
        if path.symlink_metadata().is_err() {
            return Ok(None);
        }
        refuse_link(path)?;
        // Whoever writes a plan checks what it replaces.
        if !is_plan && !kind_of(path).is_ok_and(|kind| kind == KIND) {
            let problem = "it would be overwritten, and it is not the search of an interrupted run";
            return Err(Error::usage(
                Place::file(path),
                problem,
                format!("move it away, or give another {}", option("out")),
            ));
        }
        let Ok(kept) = Sample::read(path) else { return Ok(None) };
        let SampleKind::Weighted(weighted) = &kept.kind else { return Ok(None) };
        // The accuracy that is asked for is in the number of draws alone.
        let Estimator::Search(options) = &self.options.estimator else { return Ok(None) };
        let draws = weighted.search.as_ref().map(|search| self.draws_after(&search.questions, options));
        let is_same = kept.plan_file_over(None)?.1 == self.plan_file()?.1 && draws == Some(weighted.draws);
        Ok(is_same.then_some(kept))
    }

    /// Saves the run after its search in the folder.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn keep_search(&self, out: &Path) -> Result<()> {
        make_folder(out)?;
        let text = self.plan_file()?.0;
        write_inside(&out.join(SEARCH_FILE), |file| file.write_all(&text))
    }
}
