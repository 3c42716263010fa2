//! `lanesweep vary`: concrete cases around a case, for a simulator of one's own.

use std::path::PathBuf;

use clap::Args;

use super::arguments::from_arguments;
use super::case_flags::{CaseFlags, GivenCase, all_cases, from_toml};
use super::configured::Configured;
use super::format::FormatFlag;
use super::lists;
use super::source::PlausibilityFlag;
use super::{Exit, Output};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::report::openscenario::{EgoMotion, PlayOptions, concrete_case, export_folder};
use crate::report::records::document;
use crate::report::varied_cases::case_table;
use crate::run::check::{VariationCounts, VariedCase, VariedRange, vary};
use crate::run::grid::GridAxis;
use crate::scenario::Category;
use crate::support::files::check_folder;
use crate::support::plausibility::Doubts;
use crate::support::readable::counted;
use crate::support::run_folder::RunFolder;
use crate::{Error, Place, Result};

/// Make concrete cases around a case: inside, at and outside ranges, and where the answer changes
///
/// Writes cases.csv, which `check` and `simulate --table` read, and with --xosc each case as OpenSCENARIO for an own
/// controller of the ego. Run the cases in your simulator, and compare: `check cases.csv --results yours.csv --models
/// CCHDM`. Of a table, every row is varied. The same seed gives the same cases.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Example:\n  \
                  lanesweep vary --category cut-in --ego-speed 60km/h --speed 40km/h --gap 15 --lateral-speed 1.0 \\\n      \
                  --range gap_m=5..40 --range lateral_speed_mps=0.5..2 --boundary 8 --out variations")]
pub(super) struct Vary {
    /// TOML file, or table (.csv, .parquet), with the case or cases
    #[arg(value_name = "FILE", help_heading = "Data")]
    file: Option<PathBuf>,
    #[command(flatten)]
    case: CaseFlags,
    /// Quantity, a name of `map --help`, and its range; repeatable
    #[arg(long, value_name = "NAME=FROM..TO", help_heading = "Scenario")]
    range: Vec<String>,
    /// Cases inside all ranges, by a Sobol sequence
    #[arg(long, value_name = "N", default_value_t = 64, help_heading = "Scenario")]
    inside: u32,
    /// Cases with one quantity at an end of its range
    #[arg(long, value_name = "N", default_value_t = 16, help_heading = "Scenario")]
    edge: u32,
    /// Cases with one quantity up to a quarter outside
    #[arg(long, value_name = "N", default_value_t = 16, help_heading = "Scenario")]
    outside: u32,
    /// Pairs on both sides of a change of the answer
    ///
    /// By bisection between neighbouring cases inside.
    #[arg(long, value_name = "N", default_value_t = 8, help_heading = "Scenario")]
    boundary: u32,
    /// Seed of the cases
    #[arg(long, value_name = "N", default_value_t = 157, help_heading = "Run")]
    seed: u64,
    /// Profile that answers [default: un-r157]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Models and criteria")]
    profile: Option<String>,
    /// Also write OpenSCENARIO, for an own controller of the ego
    ///
    /// In the folder xosc of --out.
    #[arg(long, help_heading = "Output")]
    xosc: bool,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
    #[command(flatten)]
    format: FormatFlag,
    /// Folder of the results
    #[arg(long, value_name = "DIR", default_value = "lanesweep-vary", help_heading = "Output")]
    out: PathBuf,
}

from_arguments!(
    Vary { file, range, inside, edge, outside, boundary, seed, profile, xosc, out }
    groups { case, plausibility, format }
);

/// Maximum number of cases of one case.
const MAX_CASES: u32 = 100_000;

impl Vary {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        configured.refuse_assigned("has no effect on variations", "leave it out; --profile names the profile")?;
        let profile = Profile::load(self.profile.as_deref().unwrap_or("un-r157"))?;
        let counts =
            VariationCounts { inside: self.inside, edge: self.edge, outside: self.outside, boundary: self.boundary };
        if [counts.inside, counts.edge, counts.outside, counts.boundary].iter().any(|count| *count > MAX_CASES) {
            let help = format!("give at most {MAX_CASES} of each");
            return Err(Error::usage(Place::item("--inside, --edge, --outside, --boundary"), "too many cases", help));
        }
        check_folder(&self.out)?;
        let mut doubts = Doubts::new(self.plausibility.policy());
        let (mut cases, mut left_out, mut missing) = (Vec::new(), 0, 0);
        for given in self.given()? {
            let given = self.case.over(given);
            let subject = given.located(given.subject(&profile, &mut doubts))?;
            let found = vary(&subject, &self.ranges(subject.category())?, counts, self.seed, &profile)?;
            let named = |case: VariedCase| match &given.id {
                Some(id) => VariedCase { id: format!("{id}-{}", case.id), ..case },
                None => case,
            };
            cases.extend(found.cases.into_iter().map(named));
            left_out += found.left_out;
            missing += found.missing_pairs;
        }
        doubts.sentences().iter().for_each(|doubt| tracing::warn!("{doubt}"));
        if left_out > 0 {
            tracing::warn!("{} left out: numbers out of range, or no case", counted(left_out as usize, "point"));
        }
        if missing > 0 {
            tracing::warn!(
                "{} of --boundary not found: fewer neighbouring cases inside differ in their answer; \
                 give more cases by --inside, or wider ranges",
                counted(missing as usize, "pair")
            );
        }
        if cases.is_empty() {
            let help = "give wider ranges, or ranges within what a vehicle can do";
            return Err(Error::usage(Place::item("--range"), "no point of these ranges is a case", help));
        }
        let folder = RunFolder::open_without_record(&self.out)?;
        let mut results = folder.results()?;
        results.add("cases.csv", case_table(&cases).csv().as_bytes())?;
        results.publish_each()?;
        drop(folder);
        if self.xosc {
            self.export(&cases, &profile)?;
        }
        let path = self.out.join("cases.csv");
        let text = || format!("{} in {}\n", counted(cases.len(), "case"), path.display());
        let json = || {
            document(
                &serde_json::json!({"cases": case_table(&cases).records(), "left_out": left_out, "missing_pairs": missing}),
            )
        };
        self.format.output(Exit::Ok, text, json)
    }

    /// The cases to be varied.
    fn given(&self) -> Result<Vec<GivenCase>> {
        let Some(path) = &self.file else { return Ok(vec![GivenCase::default()]) };
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
            return Ok(vec![from_toml(path)?]);
        }
        all_cases(path)
    }

    fn ranges(&self, category: Category) -> Result<Vec<VariedRange>> {
        let range = |text: &String| {
            let (name, [from, to]) = lists::range(text)?;
            let axis = GridAxis::parse(category, &format!("{name}={from},{to}"), "--range")?;
            Ok(VariedRange { parameter: axis.parameter, from, to })
        };
        self.range.iter().map(range).collect()
    }

    fn export(&self, cases: &[VariedCase], profile: &Profile) -> Result<()> {
        let options = PlayOptions { ego: EgoMotion::External, duration_s: None, side: None, lane_width_m: None };
        let mut scenarios = Vec::new();
        for case in cases {
            // The driver only says how long the scenario lasts.
            let traced = case.subject.traced(profile, &[ModelId::Cchdm])?;
            let of_case = concrete_case(&traced, profile, &options)?;
            scenarios.extend(of_case.into_iter().map(|mut concrete| {
                concrete.key.clone_from(&case.id);
                concrete
            }));
        }
        export_folder(&self.out.join("xosc"), &scenarios).map(drop)
    }
}
