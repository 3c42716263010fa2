//! Importance sampling as a plan file, over one given proposal or over those of a pilot: density, proposals and everything that was asked for, so that every
//! shard and the merge know the same run.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::plan::{SampleHeadways, plan_points};
use super::proposal_file::{proposal_from_text, proposal_text};
use super::weighted_tally::WeightedTally;
use crate::engine::Headway;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::parts::{kind_of, read_sealed, seal};
use crate::stats::density::{DensityModel, Mixture};
use crate::stats::estimate::{Pilot, PilotCheck};
use crate::support::atomic_file::refuse_link;
use crate::support::files::{make_folder, write_inside};
use crate::{Error, Place, Result};

/// What a run with a pilot of its own keeps until it ends.
pub(crate) const PILOT_FILE: &str = "pilot.json";
/// Kind of the sealed file.
pub(crate) const KIND: &str = "weighted sampling plan";
/// Largest plan that is read: a density and a mixture.
const MAX_PLAN_BYTES: u64 = 1 << 30;
const AGAIN: &str =
    "make it by `sample` of this version, with option `estimator = is`, option `proposal` and option `plan_only`";

/// Importance sampling of one given proposal, or of one per driver model that a pilot found; a fixed number of samples.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct WeightedFacts {
    /// The density file's text.
    pub density: String,
    /// The proposal file's text: one for all driver models, or one for each.
    pub proposals: Vec<String>,
    /// How the proposals were looked for; `None` for a given one.
    pub pilot: Option<Pilot>,
    /// What the pilot of each driver model counted; empty for a given proposal.
    pub pilots: Vec<PilotCheck>,
    /// Share of the density in the proposal.
    pub defence: f64,
    pub profile: Profile,
    pub models: Vec<ModelId>,
    /// None where the density draws it.
    pub headway: Option<Headway>,
    pub criterion: Criterion,
    pub samples: u64,
    pub seed: u64,
    pub level: f64,
}

/// A run ready to be sampled.
#[derive(Clone)]
pub(crate) struct WeightedPlan {
    pub facts: WeightedFacts,
    pub density: DensityModel,
    /// One for all driver models, or one for each.
    pub proposals: Vec<Mixture>,
}

impl WeightedPlan {
    /// Plans; the texts in `facts` are set here.
    ///
    /// # Errors
    /// [`Error::Usage`] where density, headway and models give no lanes.
    pub fn new(density: DensityModel, proposals: Vec<Mixture>, mut facts: WeightedFacts) -> Result<WeightedPlan> {
        let unreadable = |e: std::string::FromUtf8Error| Error::Internal(format!("a density is no text: {e}"));
        facts.density = String::from_utf8(density.to_json()?).map_err(unreadable)?;
        facts.proposals = proposals.iter().map(|proposal| proposal_text(&density, proposal)).collect::<Result<_>>()?;
        let planned = WeightedPlan { facts, density, proposals };
        planned.check_lanes()?;
        Ok(planned)
    }

    /// As the text of a plan file, with the hash of the run.
    ///
    /// # Errors
    /// None for what this program makes.
    pub fn seal(&self) -> Result<(Vec<u8>, String)> {
        seal(KIND, &self.facts)
    }

    /// From a plan file, with the hash of the run.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for anything but a whole plan of this version.
    pub fn read(path: &Path) -> Result<(WeightedPlan, String)> {
        let (facts, run_sha256): (WeightedFacts, _) = read_sealed(KIND, path, MAX_PLAN_BYTES, AGAIN)?;
        let place = Place::file(path);
        let wrong = |problem: &str| Error::input(place.clone(), problem, AGAIN);
        facts.profile.check(&place)?;
        if !(facts.level > 0.0 && facts.level < 1.0) {
            return Err(wrong("its confidence level must lie between 0 and 1"));
        }
        if !(0.0..1.0).contains(&facts.defence) {
            return Err(wrong("its defensive mixture weight must be at least 0 and below 1"));
        }
        if facts.samples == 0 || facts.samples >= 1 << 63 {
            return Err(wrong("its number of samples is out of range"));
        }
        let density = DensityModel::from_json(facts.density.as_bytes(), &place)?;
        let proposal = |text: &String| proposal_from_text(text.as_bytes(), &density, &place);
        let proposals: Vec<Mixture> = facts.proposals.iter().map(proposal).collect::<Result<_>>()?;
        let (models, pilots) = (facts.models.len(), facts.pilots.len());
        if proposals.len() != if pilots > 0 { models } else { 1 } || (pilots > 0 && pilots != models) {
            return Err(wrong("its proposals are not one for all driver models or one for each"));
        }
        let planned = WeightedPlan { facts, density, proposals };
        planned.check_lanes()?;
        Ok((planned, run_sha256))
    }

    /// The same run with the proposals of a pilot: those that an interrupted run left in the folder, or new ones, which
    /// are left there. Both have the same bits; a pilot takes its time.
    ///
    /// # Errors
    /// Of `search` and [`WeightedPlan::new`]; [`Error::Io`].
    pub fn after_pilot(
        mut self,
        out: Option<&Path>,
        search: impl FnOnce(&WeightedPlan) -> Result<(Vec<Mixture>, Vec<PilotCheck>)>,
    ) -> Result<WeightedPlan> {
        let path = out.map(|out| out.join(PILOT_FILE));
        if let Some(path) = path.as_deref().filter(|path| path.symlink_metadata().is_ok()) {
            refuse_link(path)?;
            if !kind_of(path).is_ok_and(|kind| kind == KIND) {
                let problem = "it would be overwritten, and it is not the pilot of an interrupted run";
                return Err(Error::usage(Place::file(path), problem, "move it away, or give another option `out`"));
            }
            if let Ok((kept, _)) = WeightedPlan::read(path) {
                let asked = WeightedFacts { proposals: Vec::new(), pilots: Vec::new(), ..kept.facts.clone() };
                if seal(KIND, &asked)?.1 == self.seal()?.1 {
                    tracing::info!("the pilot is done already");
                    return Ok(kept);
                }
            }
        }
        let (proposals, pilots) = search(&self)?;
        self.facts.pilots = pilots;
        let planned = WeightedPlan::new(self.density, proposals, self.facts)?;
        if let (Some(out), Some(path)) = (out, path) {
            make_folder(out)?;
            let text = planned.seal()?.0;
            write_inside(&path, |file| file.write_all(&text))?;
        }
        Ok(planned)
    }

    /// Whether sums that were read from a file can be those of this run.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, tally: &WeightedTally) -> std::result::Result<(), String> {
        if tally.sums.iter().map(|(model, _)| model).eq(&self.facts.models) {
            Ok(())
        } else {
            Err("they are of other driver models".to_owned())
        }
    }

    /// The headway of every lane, or the density's own.
    pub fn headways(&self) -> SampleHeadways {
        self.facts.headway.map_or(SampleHeadways::Sampled, |headway| SampleHeadways::Each(vec![headway]))
    }

    /// The headway's name in tables.
    pub fn headway_name(&self) -> String {
        self.facts.headway.map_or_else(|| "sampled".to_owned(), |headway| headway.to_string())
    }

    /// One point as lanes: complains before any work about what every point would.
    fn check_lanes(&self) -> Result<()> {
        let first = self.density.kde.points()[0].clone();
        plan_points(&self.density, &[first], &self.facts.profile, &self.facts.models, &self.headways()).map(drop)
    }
}
