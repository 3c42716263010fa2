//! Reruns lanes one by one: of a finished study or sampling run in a folder, or of a scenario file.
//!
//! Every kind becomes a [`Reopened`] with its own arithmetic and data provenance. Its lanes equal those of the run, bit
//! for bit.

mod record;
mod traced;

use std::collections::HashSet;
use std::path::Path;

pub use traced::{TracedCase, TracedLane, TracedLanes};

use crate::parts::{PLAN_FILE, kind_of};
use crate::sampling::{ESTIMATE_RECORD, SAMPLING_PLAN, Sample, SampleKind};
use crate::study::{STUDY_RECORD, Study, StudyOptions, plan_study};
use lanesweep_engine::{Headway, LaneKey, LanePlan};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Scenario;
use lanesweep_stats::density::DensityModel;
use lanesweep_support::files::check_run_folder;
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result, option};

/// Lanes that can be rerun.
pub struct Reopened {
    lanes: Lanes,
    /// Provenance of the lanes' data.
    pub data: String,
    /// The program generated the data, in whole or in part.
    pub is_synthetic: bool,
    /// The lanes are run in f64.
    pub is_reference: bool,
}

/// Source of the lanes. The cases of a study are made on demand.
enum Lanes {
    Study(Box<Study>),
    Sample(Box<LanePlan>, Box<DensityModel>),
    Scenarios(Box<LanePlan>),
}

impl Reopened {
    /// Reopens the run in a folder. If the folder has the results of a study and of a sampling run, the key decides:
    /// samples are numbered.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for a folder without a run's plan, or with that of another run.
    pub fn run(dir: &Path, key: &str) -> Result<Reopened> {
        check_run_folder(dir)?;
        let has = |name: &str| dir.join(name).exists();
        if has(STUDY_RECORD) && !(has(ESTIMATE_RECORD) && key.starts_with('#')) {
            return Ok(Reopened::study(record::study_of(dir)?));
        }
        if has(ESTIMATE_RECORD) {
            let (plan, density) = record::sample_of(dir)?;
            return Ok(Reopened::sample(plan, density));
        }
        let plan = dir.join(PLAN_FILE);
        if !plan.exists() {
            let help = format!("give the folder ({}) of a `lanesweep study` or `lanesweep sample`", option("out"));
            return Err(Error::input(Place::file(dir), "there is no run here", help));
        }
        match kind_of(&plan)?.as_str() {
            SAMPLING_PLAN => match Sample::read(&plan)? {
                Sample { kind: SampleKind::Crude(plan), density, .. } => Ok(Reopened::sample(*plan, density)),
                _ => {
                    let help = "give the folder of a run of crude Monte Carlo";
                    Err(Error::input(Place::file(&plan), "importance sampling has no numbered lanes", help))
                }
            },
            // The reader refuses every other kind.
            _ => Ok(Reopened::study(Study::read(&plan, None)?)),
        }
    }

    fn study(study: Study) -> Reopened {
        let facts = study.facts();
        let (data, is_synthetic, is_reference) = (facts.data.clone(), facts.synthetic, facts.reference);
        Reopened { lanes: Lanes::Study(Box::new(study)), data, is_synthetic, is_reference }
    }

    fn sample(plan: LanePlan, density: DensityModel) -> Reopened {
        let (data, is_synthetic) = (density.provenance.data.clone(), density.provenance.synthetic);
        Reopened { lanes: Lanes::Sample(Box::new(plan), Box::new(density)), data, is_synthetic, is_reference: false }
    }

    /// The lanes of these keys of scenarios, in f64; also for scenarios dropped by the filters, and any headway.
    ///
    /// # Errors
    /// As [`plan_study`].
    pub fn scenarios(scenarios: &mut [Scenario], keys: &[String], profile: &Profile, data: String) -> Result<Reopened> {
        let (mut options, mut headways) = (StudyOptions::default(), Vec::new());
        for key in keys {
            let id = key.rsplitn(4, '/').last().unwrap_or(key);
            if let Some(wanted) = scenarios.iter_mut().find(|s| s.id == id) {
                wanted.kept = true;
            }
            if let Some(headway) = key.rsplit('/').nth(1).and_then(Headway::parse)
                && !headways.contains(&headway)
            {
                headways.push(headway);
            }
        }
        if !headways.is_empty() {
            options.headways = headways;
        }
        let lanes = Lanes::Scenarios(Box::new(plan_study(scenarios, profile, &options)?));
        let is_synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
        Ok(Reopened { lanes, data, is_synthetic, is_reference: true })
    }

    /// The plan; for a study it has no cases.
    pub(crate) fn plan(&self) -> &LanePlan {
        match &self.lanes {
            Lanes::Study(study) => study.plan(),
            Lanes::Sample(plan, _) | Lanes::Scenarios(plan) => plan,
        }
    }

    /// The density of a sampling run.
    pub fn density(&self) -> Option<&DensityModel> {
        match &self.lanes {
            Lanes::Sample(_, density) => Some(density),
            _ => None,
        }
    }

    /// The study, if it is one.
    pub fn as_study(&self) -> Option<&Study> {
        match &self.lanes {
            Lanes::Study(study) => Some(study),
            _ => None,
        }
    }

    /// Passes the plan with the cases of these lanes to `work`.
    ///
    /// # Errors
    /// Those of `work`, and as [`StudyCases::window`](crate::study::StudyCases::window).
    pub fn with_cases<T>(&self, keys: &[LaneKey], work: impl FnOnce(&LanePlan) -> Result<T>) -> Result<T> {
        let Some(study) = self.as_study() else { return work(self.plan()) };
        let units = keys.iter().map(|key| study.plan().blocks[key.block].first_unit + key.unit);
        let span = units.clone().min().unwrap_or(0)..units.max().map_or(0, |last| last + 1);
        work(&study.cases().window(span)?)
    }

    /// The lanes of these keys, each after the lanes to compare it with: the variants `compare` (S, keys of
    /// parameterizations, or `all`) of its scenario. Each has the given models, or the key's own model if none is given.
    ///
    /// # Errors
    /// [`Error::Usage`] for a lane, variant or model that does not exist, and for a lane that is void or named twice.
    pub fn named(&self, keys: &[String], models: Option<&[ModelId]>, compare: &[String]) -> Result<Vec<LaneKey>> {
        let (mut found, mut named) = (Vec::new(), Vec::new());
        for text in keys {
            let key = self.find(text)?;
            let models = match models {
                None => vec![key.model],
                Some(list) => list.iter().map(|id| self.model(*id)).collect::<Result<_>>()?,
            };
            for variant in traced::variants(self.plan(), &key, compare)? {
                let lanes = models.iter().map(|&model| LaneKey { variant, model, ..key });
                named.extend(lanes.clone().filter(|lane| lane.variant == key.variant));
                found.extend(lanes);
            }
        }
        refuse_repeats(|| Place::option("lane"), named.iter().map(|key| (*key, self.plan().key_text(key))))?;
        // Lanes of one scenario are compared with the same lanes.
        let mut seen = HashSet::new();
        found.retain(|key| seen.insert(*key));
        Ok(found)
    }

    /// The lane of a key.
    ///
    /// # Errors
    /// [`Error::Usage`] for a lane that does not exist, and for a void sample, which has no case.
    pub(crate) fn find(&self, text: &str) -> Result<LaneKey> {
        let plan = self.plan();
        // Rows of a density that draws the headway have this word in place of it.
        let written = if self.density().is_some() { text.replace("/sampled/", "/0m/") } else { text.to_owned() };
        let key = plan.parse_key(&written).ok_or_else(|| {
            let why = wrong_part(plan, text);
            let example = plan.key(0).map_or(String::new(), |key| format!(", for instance {}", plan.key_text(&key)));
            Error::usage(
                Place::option("lane"),
                format!("there is no lane `{text}`: {why}"),
                format!("a key is scenario/variant/headway/model, as errors and tables print it{example}"),
            )
        })?;
        if plan.generator().is_some_and(|generator| generator.draw(key.unit).is_void()) {
            let help = "none of its draws was valid: use another sample";
            return Err(Error::usage(Place::option("lane"), "this sample is void", help));
        }
        Ok(key)
    }

    /// Index of a model.
    ///
    /// # Errors
    /// [`Error::Usage`] for a model that is not in the plan.
    fn model(&self, id: ModelId) -> Result<usize> {
        let models = &self.plan().models;
        models.iter().position(|m| *m == id).ok_or_else(|| {
            let names: Vec<&str> = models.iter().map(|m| m.name()).collect();
            let problem = format!("{} is not a model of this run", id.name());
            Error::usage(Place::option("models"), problem, format!("use {}", names.join(", ")))
        })
    }
}

/// The part of a key that matches no lane of the plan.
fn wrong_part(plan: &LanePlan, key: &str) -> String {
    let parts: Vec<&str> = key.rsplitn(4, '/').collect();
    let [model, headway, variant, scenario] = parts[..] else {
        return format!("it has {} of four parts", parts.len());
    };
    let models: Vec<&str> = plan.models.iter().map(|model| model.name()).collect();
    if !ModelId::parse(model).is_some_and(|model| plan.models.contains(&model)) {
        return format!("no model `{model}` in this run ({})", models.join(", "));
    }
    let headways: Vec<String> = plan.headways.iter().map(ToString::to_string).collect();
    let is_there = headways.iter().any(|h| h == headway)
        || Headway::parse(headway).is_some_and(|headway| plan.headways.contains(&headway));
    if !is_there {
        return format!("no headway `{headway}` in this run ({})", headways.join(", "));
    }
    match plan.blocks.iter().find(|block| block.units.find(scenario).is_some()) {
        None => format!("no scenario `{scenario}` in this run"),
        Some(block) => format!("no variant `{variant}` of this scenario ({})", block.variants.join(", ")),
    }
}
