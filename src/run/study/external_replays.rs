//! S' of other programs, given as series.

use std::collections::BTreeMap;
use std::path::Path;

use crate::score::CROSS_VALIDATED;
use lanesweep_model::plausibility::Implausible;
use lanesweep_model::scenario::parameterization::{Parameterization, ReducedScenario};
use lanesweep_model::scenario::{Category, Scenario, ScenarioFile, read_scenario_file, usable};
use lanesweep_support::{Error, Place, Result, readable};

/// S' of the scenarios of a category, by their ids.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalReplay {
    /// Kind of scenario.
    pub category: Category,
    /// Name of the variant.
    pub key: String,
    /// The series.
    pub scenarios: BTreeMap<String, ReducedScenario>,
}

/// A parameterization keeps the ego's initial speed up to about this, m/s.
const MAX_EGO_DIFFERENCE_MPS: f64 = 1.0;

impl ExternalReplay {
    /// S' of a scenario file of another program: the ids of S, any sample rate and length. The variants have the name of
    /// the file, with - for other characters than letters, digits, - and _.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for a damaged file, an unknown or missing id, or a name that is none.
    pub fn read(
        path: &Path,
        scenarios: &[Scenario],
        categories: &[Category],
        implausible: Implausible,
    ) -> Result<Vec<ExternalReplay>> {
        let place = || Place::file(path);
        let ScenarioFile { scenarios: given, mut problems, .. } = read_scenario_file(path, implausible)?;
        if !problems.is_empty() {
            return Err(problems.swap_remove(0));
        }
        // An S' does not use these, so that they cannot contradict its series.
        let used = |s| Scenario { frame0: 0, frame1: 0, gap0: None, thw0: None, peak_decel: None, ..s };
        let ScenarioFile { scenarios: given, notes, .. } = usable(given.into_iter().map(used).collect(), implausible);
        notes.iter().for_each(|note| tracing::warn!("{}: {note}", path.display()));
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        // Keys of lanes and names of files have letters, digits, - and _.
        let key = stem.replace(|c: char| !(c.is_ascii_alphanumeric() || c == '-' || c == '_'), "-");
        let is_taken = Category::ALL.iter().any(|category| Parameterization::find(*category, &key).is_some());
        if key.is_empty() || key == "S" || key.ends_with(CROSS_VALIDATED) || is_taken {
            let problem = format!("`{key}` cannot name the S' of this file");
            let help = format!(
                "give the file another name than S or that of a parameterization, and one that does not end in {CROSS_VALIDATED}"
            );
            return Err(Error::input(place(), problem, help));
        }
        let known: BTreeMap<&str, &Scenario> = scenarios.iter().map(|s| (s.id.as_str(), s)).collect();
        let mut replays: BTreeMap<Category, ExternalReplay> = BTreeMap::new();
        for own in given {
            let at = || place().of(format!("scenario {}", own.id));
            match known.get(own.id.as_str()) {
                // What is not kept is not replayed.
                Some(recorded) if !recorded.kept => continue,
                Some(recorded) if recorded.category == own.category => (),
                Some(recorded) => {
                    let problem = format!("it is no {}, as recorded", recorded.category.label());
                    return Err(Error::input(at(), problem, "keep the category"));
                }
                None => {
                    let help = "use the ids that `mine` writes, of the same recordings";
                    return Err(Error::input(at(), "no such scenario was recorded", help));
                }
            }
            let lead = own.lead.as_ref().map_or(Vec::new(), |lead| lead.v.clone());
            let reduced = ReducedScenario {
                duration_s: own.duration_s(),
                v_ego: if own.category == Category::Lvd { own.target.v[0].max(0.0) } else { own.ego.v0 },
                lead_gap_m: own.lead_gap.unwrap_or(0.0),
                y: if own.category == Category::Lvd { Vec::new() } else { own.target.y },
                v: own.target.v,
                v_lead: lead,
            };
            if own.category == Category::CutOut && (reduced.v_lead.len() != reduced.v.len() || own.lead_gap.is_none()) {
                let problem = "a cut-out needs `lead` with as many samples as `target`, and `D`";
                return Err(Error::input(at(), problem, "add them"));
            }
            let replay = replays.entry(own.category);
            let replay = replay.or_insert_with(|| ExternalReplay {
                category: own.category,
                key: key.clone(),
                scenarios: BTreeMap::new(),
            });
            replay.scenarios.insert(own.id, reduced);
        }
        let mut studied = replays.values().filter(|replay| categories.contains(&replay.category));
        studied.try_for_each(|replay| replay.check(path, scenarios))?;
        Ok(replays.into_values().collect())
    }

    /// Checks that every kept scenario has its S', and warns where ids seem to be those of other scenarios.
    fn check(&self, path: &Path, scenarios: &[Scenario]) -> Result<()> {
        let missing =
            scenarios.iter().find(|s| s.kept && s.category == self.category && !self.scenarios.contains_key(&s.id));
        if let Some(missing) = missing {
            let problem = format!("scenario {} is missing; others of its category are there", missing.id);
            return Err(Error::input(Place::file(path), problem, "give all kept scenarios of a category, or none"));
        }
        let pairs: Vec<_> = scenarios.iter().filter_map(|s| Some((s, self.scenarios.get(&s.id)?))).collect();
        let category = self.category.label();
        let warn = |problem: String| tracing::warn!("{}: {problem}", path.display());
        // Left-out samples shorten every S' by one factor.
        let mut times: Vec<f64> = pairs.iter().map(|(s, own)| own.duration_s / s.duration_s()).collect();
        times.sort_by(f64::total_cmp);
        if let [least, .., most] = times[..]
            && !(0.8..=1.25).contains(&least)
            && most < 1.1 * least
        {
            let times = readable::value(least);
            warn(format!("every S' ({category}) lasts {times} times as long as its scenario: check `fps`"));
        }
        let mut shorter_s: Vec<f64> = pairs.iter().map(|(s, own)| s.duration_s() - own.duration_s).collect();
        shorter_s.sort_by(f64::total_cmp);
        let by_s = shorter_s.get(shorter_s.len() / 2).copied().unwrap_or(0.0);
        let as_much = shorter_s.iter().filter(|s| (*s - by_s).abs() < 0.01).count();
        if by_s > 0.1 && as_much > 2 && 4 * as_much > 3 * pairs.len() {
            let by_s = readable::value(by_s);
            warn(format!(
                "{as_much} S' ({category}) are {by_s} s shorter than their scenarios: their first or last samples are missing"
            ));
        }
        let is_same =
            |(s, own): &(&Scenario, &ReducedScenario)| s.target.v == own.v && (own.y.is_empty() || s.target.y == own.y);
        if pairs.iter().all(is_same) {
            warn(format!("every S' ({category}) has the series of its scenario: it is S itself"));
        }
        type Of<'a> = &'a dyn Fn(&Scenario, &ReducedScenario) -> f64;
        let sum = |of: Of| pairs.iter().map(|(s, own)| of(s, own)).sum::<f64>();
        let widest = |y: &[f64]| y.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        let times = sum(&|_, own| widest(&own.y)) / sum(&|s, _| widest(&s.target.y));
        if self.category != Category::Lvd && !(0.7..=1.4).contains(&times) {
            let times = readable::value(times);
            warn(format!(
                "S' ({category}) move {times} times as far to the side as their scenarios: check the unit of y"
            ));
        }
        let times = sum(&|_, own| own.lead_gap_m) / sum(&|s, _| s.lead_gap.unwrap_or(0.0));
        if self.category == Category::CutOut && !(0.8..=1.25).contains(&times) {
            let times = readable::value(times);
            warn(format!("`D` is {times} times that of the scenarios on average: check its unit and meaning"));
        }
        let first = |of: &[f64]| of.first().copied().unwrap_or(0.0);
        // What no parameterization changes.
        type Differs<'a> = &'a dyn Fn(&Scenario, &ReducedScenario) -> bool;
        let differences: [(&str, Differs); 2] = [
            ("begin with another speed of the ego than their scenario", &|s, own| {
                self.category != Category::Lvd && (s.ego.v0 - own.v_ego).abs() > MAX_EGO_DIFFERENCE_MPS
            }),
            ("begin as if `target` and `lead` were exchanged", &|s, own| {
                let Some(lead) = &s.lead else { return false };
                let [target_mps, lead_mps] = [first(&s.target.v), first(&lead.v)];
                let off = |a: f64, b: f64| (first(&own.v) - a).abs() + (first(&own.v_lead) - b).abs();
                off(lead_mps, target_mps) < off(target_mps, lead_mps)
            }),
        ];
        for (what, differs) in differences {
            let others = pairs.iter().filter(|(s, own)| differs(s, own)).count();
            if 2 * others > pairs.len() {
                warn(format!("{others} of {} S' ({category}) {what}", pairs.len()));
            }
        }
        // Rows that were shifted or sorted have the ids of other scenarios.
        let difference = |(s, own): (&Scenario, &ReducedScenario)| {
            let ends = [(s.target.v.first(), own.v.first()), (s.target.v.last(), own.v.last())];
            ends.iter().map(|(a, b)| (a.unwrap_or(&0.0) - b.unwrap_or(&0.0)).abs()).sum::<f64>()
        };
        let is_nearer = |(pair, next): &(_, &(&Scenario, _))| difference(*pair) <= difference((next.0, pair.1));
        let next = pairs.iter().cycle().skip(1);
        let near = pairs.iter().copied().zip(next).filter(is_nearer).count();
        if pairs.len() >= 4 && 4 * near < 3 * pairs.len() {
            warn(format!(
                "the first and last speeds of only {near} of {} S' ({category}) are nearer to their own scenario than \
                 to the next one: check the ids",
                pairs.len()
            ));
        }
        Ok(())
    }
}
