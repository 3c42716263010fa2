//! The study's case source: a table of every scenario's S and S', made once on the host.

use rayon::prelude::*;

use super::lane_case::LaneCase;
use super::plan::{Block, CaseSource, Headway, LanePlan};
use crate::driver::ModelId;
use crate::parameterization::{Kind, ParameterizationId, ParameterizationOptions, Reduction, SvdFit, recorded_case};
use crate::profile::Profile;
use crate::scenario::{Case, Category, Scenario, Tables};
use crate::{Error, Place, Result};

/// What a study sweeps.
#[derive(Debug, Clone)]
pub struct StudyOptions {
    /// Categories, in order.
    pub categories: Vec<Category>,
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Headways, in order.
    pub headways: Vec<Headway>,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
}

impl Default for StudyOptions {
    fn default() -> Self {
        StudyOptions {
            categories: Category::ALL.to_vec(),
            models: ModelId::ALL.to_vec(),
            headways: Headway::paper(),
            parameterization: ParameterizationOptions::default(),
        }
    }
}

/// A plan with what could not be planned and why (too few scenarios for a decomposition, for instance).
pub struct StudyPlan {
    /// The plan.
    pub plan: LanePlan,
    /// The decompositions, one per category that has one.
    pub reductions: Vec<Reduction>,
    /// Parts that were left out, with the reason.
    pub left_out: Vec<Error>,
}

struct CaseTable {
    tables: Tables<f64>,
    /// Per block: unit-major, variant-minor.
    cases: Vec<Vec<LaneCase<f64>>>,
    variants: Vec<usize>,
}

impl CaseSource for CaseTable {
    fn case(&self, block: usize, unit: u64, variant: usize) -> LaneCase<f64> {
        self.cases[block][unit as usize * self.variants[block] + variant]
    }

    fn tables(&self) -> &Tables<f64> {
        &self.tables
    }
}

/// Steps of all series together: the records of lanes point into the tables with 32 bits.
const MOST_STEPS: f64 = 4e9;

/// Plans a study over mined scenarios: the kept ones are simulated, in the order given; a decomposition
/// may be fitted on more (see [`SvdFit`]).
pub fn plan_study(scenarios: &[Scenario], profile: &Profile, options: &StudyOptions) -> Result<StudyPlan> {
    let dt_s = profile.frame.dt_s;
    let parameterization = &options.parameterization;
    let mut table = CaseTable { tables: Tables::default(), cases: Vec::new(), variants: Vec::new() };
    let mut steps = 0.0;
    let (mut blocks, mut reductions, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    for &category in &options.categories {
        let of_category = || scenarios.iter().filter(move |s| s.category == category);
        let kept: Vec<&Scenario> = of_category().filter(|s| s.kept).collect();
        let fitted: Vec<&Scenario> = match parameterization.svd_fit {
            SvdFit::Kept => kept.clone(),
            SvdFit::All => of_category().filter(|s| category != Category::CutOut || s.lead.is_some()).collect(),
        };
        if kept.is_empty() {
            continue;
        }
        let reduction = match Reduction::fit(category, &fitted, parameterization) {
            Ok(reduction) => Some(reduction),
            Err(error @ Error::Input { .. }) => {
                left_out.push(error);
                None
            }
            Err(error) => return Err(error),
        };
        let ids: Vec<ParameterizationId> =
            ParameterizationId::of(category).filter(|id| id.kind == Kind::Kinematic || reduction.is_some()).collect();
        steps += kept.iter().map(|s| s.duration_s() / dt_s + 2.0).sum::<f64>() * (1 + ids.len()) as f64;
        if steps > MOST_STEPS {
            return Err(Error::usage(
                Place::item("`frame.dt_s`"),
                format!(
                    "{dt_s} s: the scenarios and their parameterizations have {steps:.1e} steps, the tables {MOST_STEPS:.1e}"
                ),
                "use a longer time step, or study fewer or shorter scenarios at once",
            ));
        }
        // Cases in parallel, records in order: the tables must not depend on the number of threads.
        let cases: Vec<Vec<Case>> = kept
            .par_iter()
            .map(|scenario| cases_of(scenario, &ids, reduction.as_ref(), dt_s, parameterization))
            .collect::<Result<_>>()?;
        let records = cases.iter().flatten().map(|case| LaneCase::encode(case, profile, &mut table.tables)).collect();
        table.cases.push(records);
        table.variants.push(1 + ids.len());
        blocks.push(Block {
            category,
            units: kept.iter().map(|s| s.id.clone()).collect(),
            variants: std::iter::once("S").chain(ids.iter().map(|id| id.key)).map(str::to_owned).collect(),
            first_unit: 0,
            first_lane: 0,
        });
        reductions.extend(reduction);
    }
    let plan =
        LanePlan::new(profile.clone(), options.models.clone(), options.headways.clone(), blocks, Box::new(table))?;
    Ok(StudyPlan { plan, reductions, left_out })
}

/// S, then every S', of one scenario.
fn cases_of(
    scenario: &Scenario,
    ids: &[ParameterizationId],
    reduction: Option<&Reduction>,
    dt_s: f64,
    options: &ParameterizationOptions,
) -> Result<Vec<Case>> {
    let mut cases = vec![recorded_case(scenario, dt_s)?];
    for id in ids {
        cases.push(match (id.kind, reduction) {
            (Kind::Svd(d), Some(reduction)) => reduction.case(scenario, d, dt_s)?,
            _ => id.kinematic_case(scenario, dt_s, options)?,
        });
    }
    Ok(cases)
}
