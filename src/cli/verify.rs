//! `lanesweep verify`: checks that a device computes the same as the CPU.

use clap::{Args, value_parser};

use super::configured::Configured;
use super::console;
use super::format::FormatFlag;
use super::source::SourceFlags;
use super::{Exit, Output};
use lanesweep_engine::LanePlan;
use lanesweep_engine::verify::{SetOptions, compare, random_plan, threshold_plan};
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Category;
use lanesweep_report::{records, verification};
use lanesweep_run::study::{StudyOptions, plan_study};
use lanesweep_support::readable::count;
use lanesweep_support::{Error, Place, Result};
use lanesweep_traffic::mining::{counts, counts_text};

/// Check that a device computes every lane as the CPU does
///
/// Runs the same lanes on the f64 reference, the CPU and the device: random lanes, lanes on the thresholds of every
/// rule, and a study. Every output word of the device must equal the CPU's; otherwise the words of the worst lane are
/// printed and the exit code is 5. Without a GPU, use a software device (--device llvmpipe), or verify the CPU backend itself (--backend cpu).
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  lanesweep verify\n  lanesweep verify --device llvmpipe --random-lanes 20000")]
pub(super) struct Verify {
    #[command(flatten)]
    data: SourceFlags,
    /// Random lanes per model and category
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = value_parser!(u64).range(1..=MAX_LANES), help_heading = "Models and criteria")]
    random_lanes: u64,
    /// Seed of the random lanes and of those on thresholds
    #[arg(long, value_name = "N", default_value_t = 157, help_heading = "Run")]
    seed: u64,
    #[command(flatten)]
    format: FormatFlag,
}

/// Maximum number of random lanes per model and category: their units have individual names.
const MAX_LANES: u64 = 100_000_000;

impl Verify {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let profile = configured.profile()?;
        let opened = configured.open_to_verify()?;
        let tested = opened.backend();
        let head = format!("Under test: {}\nProfile {}, seed {}\n", tested.describe(), profile.name, self.seed);
        let is_text = !self.format.is_json();
        if is_text {
            console::print(&head)?;
        }
        let set = |size| SetOptions { seed: self.seed, size, ..SetOptions::default() };
        let mut sets = Vec::new();
        let (mut equal, mut lanes, mut differing) = (true, 0, 0);
        for (name, plan) in [
            ("Random lanes", random_plan(&profile, &set(self.random_lanes))?),
            ("Lanes on thresholds", threshold_plan(&profile, &set(configured.settings.verify.threshold_units))?),
            ("Study", self.study(configured, &profile)?),
        ] {
            let comparison = configured
                .with_bar(plan.lane_count(), name, |bar| compare(name, &plan, tested, |lanes| bar.inc(lanes)))?;
            // Print set by set, so that a later failure of the device keeps earlier results.
            if is_text {
                console::print(&format!("\n{}", verification::comparison(&comparison, profile.frame.dt_s)))?;
            }
            sets.push(verification::record(&comparison, profile.frame.dt_s));
            equal &= comparison.is_equal();
            lanes += comparison.lanes();
            differing += comparison.differing();
        }
        let found = if equal {
            "every word equals the CPU's".to_owned()
        } else {
            format!("{} DIFFER from the CPU's", count(differing))
        };
        let text = format!("\n{} lanes, all computed by the backend under test: {found}.\n", count(lanes));
        let json = || {
            records::document(&serde_json::json!({
                "under_test": tested.describe(),
                "profile": profile.name,
                "seed": self.seed,
                "equal": equal,
                "lanes": lanes,
                "differing": differing,
                "sets": sets,
            }))
        };
        let output = self.format.output(Exit::Ok, || text, json)?;
        if equal {
            Ok(output)
        } else {
            Err(Error::Verification(format!("results of {} differ from the CPU's", tested.describe())))
        }
    }

    fn study(&self, configured: &Configured, profile: &Profile) -> Result<LanePlan> {
        let collection = self.data.load(configured)?;
        let options = StudyOptions { categories: Category::ALL.to_vec(), ..StudyOptions::default() };
        let plan = plan_study(&collection.scenarios, profile, &options)?;
        if plan.unit_count() == 0 {
            let problem = format!("no scenario to simulate ({})", counts_text(&counts(&collection.scenarios)));
            let help = "use more recordings or scenarios that pass the paper's filters";
            let data = self.data.source(configured).describe(collection.synthetic);
            return Err(Error::input(Place::item(data), problem, help));
        }
        Ok(plan)
    }
}
