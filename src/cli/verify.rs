//! `lanesweep verify`: checks that a device computes the same as the CPU.

use clap::Args;

use super::configured::Configured;
use super::console::{self, Total};
use super::format::FormatFlag;
use super::source::SourceFlags;
use super::{Exit, Output};
use crate::engine::verify::{RandomOptions, ThresholdOptions, compare, random_plan, threshold_plan};
use crate::engine::{Backend, LanePlan, LaneRunner, Wanted};
use crate::model::profile::Profile;
use crate::report::lanes::outcome_json;
use crate::report::{records, verification};
use crate::run::study::{StudyOptions, plan_study};
use crate::scenario::Category;
use crate::support::readable::count;
use crate::traffic::mining::{counts, counts_text};
use crate::{Error, Place, Result};

/// Check that a device computes every lane as the CPU does
///
/// Runs the same lanes on the f64 reference, the CPU and the device: random lanes, lanes on the thresholds of every
/// rule, and a study. Every output word of the device must equal the CPU's; otherwise the exit code is 5. Without a
/// GPU, use a software device (--device llvmpipe), or verify the CPU backend itself (--backend cpu).
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  lanesweep verify\n  lanesweep verify --device llvmpipe --random-lanes 20000\n  lanesweep \
                        verify --device 0 --lane random-cut-in-seed157-0000123/S/1.2s/FSM"
)]
pub(super) struct Verify {
    #[command(flatten)]
    data: SourceFlags,
    /// Random lanes per model and category
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = super::arguments::whole::<u64>, help_heading = "Models and criteria")]
    random_lanes: u64,
    /// Seed of the random lanes and of those on thresholds
    #[arg(long, value_name = "N", default_value_t = 157, help_heading = "Run")]
    seed: u64,
    /// Run one lane again and print its words on each backend
    #[arg(long, value_name = "KEY", help_heading = "Data")]
    lane: Option<String>,
    #[command(flatten)]
    format: FormatFlag,
}

/// Maximum number of random lanes per model and category: their units have individual names.
const MAX_LANES: u64 = 100_000_000;

impl Verify {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        if self.random_lanes == 0 || self.random_lanes > MAX_LANES {
            let problem = format!("{} is not usable; expected 1 to {MAX_LANES}", self.random_lanes);
            return Err(Error::usage(Place::item("--random-lanes"), problem, "choose a number in this range"));
        }
        let profile = configured.profile()?;
        let opened = configured.open_to_verify()?;
        let tested = opened.backend();
        if let Some(key) = &self.lane {
            return self.one_lane(key, configured, &profile, tested);
        }
        let head = format!("Under test: {}\nProfile {}, seed {}\n", tested.describe(), profile.name, self.seed);
        let is_text = !self.format.is_json();
        if is_text {
            console::print(&head)?;
        }
        let mut sets = Vec::new();
        let (mut equal, mut lanes, mut differing) = (true, 0, 0);
        for (name, plan) in [
            ("Random lanes", self.random(&profile)?),
            ("Lanes on thresholds", self.thresholds(configured, &profile)?),
            ("Study", self.study(configured, &profile)?),
        ] {
            let comparison = configured.with_bar(Total::Exact(plan.lane_count()), name, |bar| {
                compare(name, &plan, tested, |lanes| bar.inc(lanes))
            })?;
            // Print set by set, so that a later failure of the device keeps earlier results.
            if is_text {
                console::print(&format!("\n{}", verification::comparison(&comparison)))?;
            }
            sets.push(verification::record(&comparison));
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

    fn random(&self, profile: &Profile) -> Result<LanePlan> {
        let lanes_per_model_and_category = self.random_lanes;
        random_plan(profile, &RandomOptions { seed: self.seed, lanes_per_model_and_category, ..Default::default() })
    }

    fn thresholds(&self, configured: &Configured, profile: &Profile) -> Result<LanePlan> {
        let units_per_threshold = configured.settings.verify.threshold_units;
        threshold_plan(profile, &ThresholdOptions { seed: self.seed, units_per_threshold, ..Default::default() })
    }

    fn study(&self, configured: &Configured, profile: &Profile) -> Result<LanePlan> {
        let collection = self.data.load(configured)?;
        let options = StudyOptions { categories: Category::ALL.to_vec(), ..StudyOptions::default() };
        let plan = plan_study(&collection.scenarios, profile, &options)?;
        if plan.unit_count() == 0 {
            let problem = format!("no scenario to simulate ({})", counts_text(&counts(&collection.scenarios)));
            let help = "use more recordings or scenarios that pass the paper's filters";
            return Err(Error::input(
                Place::item(self.data.source(configured).describe(collection.synthetic)),
                problem,
                help,
            ));
        }
        Ok(plan)
    }

    /// One lane on the three backends.
    fn one_lane(&self, text: &str, configured: &Configured, profile: &Profile, tested: &dyn Backend) -> Result<Output> {
        // The keys of the generated sets contain their seed; a user's scenario may start with the same prefix.
        let own = |prefix: &str| text.starts_with(prefix) && text.contains(&format!("-seed{}-", self.seed));
        let plan = match () {
            () if own("random-") => self.random(profile)?,
            () if own("threshold-") => self.thresholds(configured, profile)?,
            () => self.study(configured, profile)?,
        };
        let key = plan.parse_key(text).ok_or_else(|| {
            Error::usage(
                Place::item("--lane"),
                format!("there is no lane `{text}` in this set"),
                "copy the key from the list of differing lanes, and give the same --seed, --random-lanes and data",
            )
        })?;
        let unit = plan.blocks[key.block].first_unit + key.unit;
        let at = (plan.lane(&key) - plan.first_lane_of(unit)) as usize;
        let chunk = tested.prepare(&plan)?.run(unit..unit + 1, Wanted::Outcomes)?;
        chunk.check(&plan)?;
        let reference = LaneRunner::<f64>::new(&plan).run(&key);
        let cpu = LaneRunner::<f32>::new(&plan).run(&key).widen();
        let theirs = chunk.outcomes[at];
        let names = ["f64 reference", "CPU, f32", "under test"];
        let is_equal = crate::engine::same_words(&cpu, &theirs);
        let outcomes = [reference, cpu, theirs];
        let output = self.format.output(
            Exit::Ok,
            || format!("Under test: {}\n{}", tested.describe(), verification::lane(text, names, &outcomes)),
            || {
                let [reference, cpu, theirs] = outcomes.map(|o| outcome_json(&o, plan.profile.frame.dt_s));
                records::document(&serde_json::json!({
                    "under_test": tested.describe(),
                    "lane": text,
                    "equal": is_equal,
                    "outcomes": {"reference": reference, "cpu": cpu, "under_test": theirs},
                }))
            },
        )?;
        if is_equal { Ok(output) } else { Err(Error::Verification(format!("lane {text} differs from the CPU's"))) }
    }
}
