//! Profiles: every constant and every named option of models, criteria and frame as data (TOML).
//!
//! A profile is resolved at a time step into plain constants; the code that uses them knows no strings.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::criterion::CriteriaProfile;
use crate::driver::{self, Bound, DriverProfile, ModelId};
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result, input_file, option};

/// Maximum number of steps of a run.
pub const MAX_STEPS: f64 = 4e6;

/// Which vehicles the ego's driver reacts to in a cut-out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CutOutTarget {
    /// Both vehicles are checked at each step; the driver reacts to the nearest unsafe one.
    NearestUnsafe,
    /// The same; of two unsafe vehicles the driver reacts to the one that demands the larger deceleration.
    LargestDemand,
    /// No vehicle until the centre of the cutting-out vehicle is more than 0.375 m from the lane centre, then only the
    /// vehicle ahead. A cutting-out vehicle that hits it stops there and becomes the target (the JRC's simulator).
    Exposed,
}

/// Which vehicles the criteria evaluate in a cut-out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CutOutEvaluated {
    /// Every other vehicle; the worst value counts (the paper's definition).
    Every,
    /// Only the vehicle ahead: contacts, TTC and BTN of the cutting-out vehicle are ignored.
    Ahead,
}

/// The frame around the models.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameProfile {
    /// Time step, s.
    pub dt_s: f64,
    /// Maximum duration of a run, s.
    pub time_cap_s: f64,
    /// Positions are cumulative sums: index 0 is one step after the nominal start.
    pub start_shift: bool,
    /// Whether a run ends once it has settled; otherwise it lasts to the cap.
    pub end_when_settled: bool,
    /// Which vehicles the driver reacts to in a cut-out.
    pub cut_out_target: CutOutTarget,
    /// Which vehicles the criteria evaluate in a cut-out.
    #[serde(rename = "cut_out_judged")]
    pub cut_out_evaluated: CutOutEvaluated,
    /// Exposure threshold of `exposed`, m.
    pub exposure_m: f64,
    /// Length of vehicles whose size is unknown, m.
    pub default_length_m: f64,
    /// Width of vehicles whose size is unknown, m.
    pub default_width_m: f64,
}

impl FrameProfile {
    /// Maximum number of steps that a run evaluates: indices 0 … cap/dt − 1.
    pub fn step_cap(&self) -> u32 {
        (self.time_cap_s / self.dt_s - 1e-9).ceil() as u32
    }
}

/// Declares [`Profile`] with one table per driver model of the registry.
macro_rules! declare_profile {
    ($($(#[$attribute:meta])* $file:ident, $model:ident, $profile:ident, $name:literal;)+) => {
        /// A profile: all parameters of the lanes' physics that are not part of a case.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct Profile {
            /// Name.
            pub name: String,
            /// Description in one sentence.
            pub description: String,
            /// The drivers that determine what is preventable: a collision that one of them avoids. Empty: the profile
            /// does not say.
            pub reference_drivers: Vec<ModelId>,
            /// Time and geometry.
            pub frame: FrameProfile,
            /// Criteria.
            pub criteria: CriteriaProfile,
            $(
                #[doc = $name]
                $(#[$attribute])*
                pub $file: driver::$profile,
            )+
        }

        impl Profile {
            /// The numeric constants of every driver model: key, value, range.
            fn driver_bounds(&self) -> Vec<(String, f64, Bound)> {
                let mut all = Vec::new();
                $(
                    let table = stringify!($file);
                    all.extend(self.$file.bounds().into_iter().map(|(k, v, b)| (format!("{table}.{k}"), v, b)));
                )+
                all
            }

            /// Bounds of the time step for these driver models: key, maximum step, s.
            fn driver_time_step_bounds(&self, models: &[ModelId]) -> Vec<(String, f64)> {
                let mut all = Vec::new();
                $(
                    if models.contains(&ModelId::$model) {
                        let table = stringify!($file);
                        let bounds = self.$file.time_step_bounds(self.frame.dt_s);
                        all.extend(bounds.into_iter().map(|(k, s)| (format!("{table}.{k}"), s)));
                    }
                )+
                all
            }
        }
    };
}
for_every_driver_model!(declare_profile);

const BUILT_IN: [(&str, &str); 6] = [
    ("paper", include_str!("../../configs/profiles/paper.toml")),
    ("paper-fit", include_str!("../../configs/profiles/paper-fit.toml")),
    ("jrc-2021", include_str!("../../configs/profiles/jrc-2021.toml")),
    ("un-r157", include_str!("../../configs/profiles/un-r157.toml")),
    ("eu-2022-1426", include_str!("../../configs/profiles/eu-2022-1426.toml")),
    ("eu-2022-1426-standing", include_str!("../../configs/profiles/eu-2022-1426-standing.toml")),
];

/// A constant by more than this factor from every shipped one is unusual: a decimal point slipped, or it is in g.
const FAR: f64 = 8.0;

/// Constants of which the first is at most the second.
const ORDERED: [(&str, &str); 3] = [
    ("fsm.comfortable_deceleration_mps2", "fsm.max_surrogate_deceleration_mps2"),
    ("cchdm.coasting_mps2", "cchdm.max_deceleration_mps2"),
    ("frame.default_width_m", "frame.default_length_m"),
];

impl Profile {
    /// Names of the profiles that ship with the program.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// The files of the shipped profiles, in the same order.
    pub fn files() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(_, text)| *text)
    }

    /// Loads a profile by name, or from a TOML file if the text is a path.
    pub fn load(name_or_path: &str) -> Result<Profile> {
        if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
            return Profile::parse(text, &Place::item(format!("built-in profile {name}")));
        }
        let path = Path::new(name_or_path);
        if !path.exists() && !name_or_path.ends_with(".toml") {
            let (place, or) = (Place::option("profile"), "; or give the path of a TOML file");
            return Err(Error::unknown(place, "profile", name_or_path, Profile::names(), or));
        }
        let text = input_file::read_text(path, input_file::MAX_SETTINGS_BYTES)?;
        let mut profile = Profile::parse(&text, &Place::file(path))?;
        // A profile with changed numbers must not keep the name of a shipped profile.
        if Profile::names().any(|name| name == profile.name) && Profile::load(&profile.name)? != profile {
            profile.name.push_str(" (changed)");
        }
        Ok(profile)
    }

    fn parse(text: &str, place: &Place) -> Result<Profile> {
        let help = "`lanesweep config init paper.toml` writes a profile with every key and its unit";
        let profile: Profile = input_file::parse_toml(text, place, help)?;
        profile.check(place)?;
        Ok(profile)
    }

    /// Every numeric constant: key, value, range.
    pub fn bounds(&self) -> Vec<(String, f64, Bound)> {
        let (frame, criteria) = (&self.frame, &self.criteria);
        let own = [
            ("frame.dt_s", frame.dt_s, Bound::TIME_STEP),
            ("frame.time_cap_s", frame.time_cap_s, Bound::TIME_CAP),
            ("frame.default_length_m", frame.default_length_m, Bound::SIZE),
            ("frame.default_width_m", frame.default_width_m, Bound::SIZE),
            ("frame.exposure_m", frame.exposure_m, Bound::DISTANCE),
            ("criteria.ttc_threshold_s", criteria.ttc_threshold_s, Bound::TIME),
            ("criteria.btn_threshold", criteria.btn_threshold, Bound::RATIO),
            ("criteria.max_deceleration_mps2", criteria.max_deceleration_mps2, Bound::DECELERATION),
            ("criteria.jerk_mps3", criteria.jerk_mps3, Bound::JERK),
            ("criteria.tet_threshold_s", criteria.tet_threshold_s, Bound::TIME),
        ];
        let own = own.into_iter().map(|(key, value, bound)| (key.to_owned(), value, bound));
        own.chain(self.driver_bounds()).collect()
    }

    /// Constants that are far from those of every shipped profile, as sentences.
    pub fn unusual(&self) -> Vec<String> {
        let shipped: Vec<_> = Profile::names().filter_map(|name| Profile::load(name).ok()).collect();
        let shipped: Vec<_> = shipped.iter().flat_map(Profile::bounds).collect();
        let sentence = |(key, value, Bound { unit, .. }): (String, f64, Bound)| {
            let known = shipped.iter().filter(|(of, shipped, _)| *of == key && *shipped != 0.0);
            let known = known.map(|(_, shipped, _)| shipped.abs());
            let (min, max) = known.fold((f64::INFINITY, 0.0), |(min, max): (f64, f64), of| (min.min(of), max.max(of)));
            // 0 means that there is none. How long a run and its steps are is no matter of units.
            let is_usual = value == 0.0 || (min / FAR..=max * FAR).contains(&value.abs());
            (max > 0.0 && !is_usual && !["frame.dt_s", "frame.time_cap_s"].contains(&key.as_str())).then(|| {
                let range = if min == max { min.to_string() } else { format!("{min} to {max}") };
                format!(
                    "profile {}, `{key}`: {value} {unit} is used as it is, shipped profiles have {range}: check its unit",
                    self.name
                )
            })
        };
        self.bounds().into_iter().filter_map(sentence).collect()
    }

    /// Checks that every constant is finite, in its range and in its order; `place` names the profile in the error.
    pub fn check(&self, place: &Place) -> Result<()> {
        let bounds = self.bounds();
        let wrong = |key: &str, problem: String, help: &str| {
            Err(Error::usage(place.clone().of(format!("`{key}`")), problem, help))
        };
        if let Some((key, value, expected)) = bounds.iter().find(|(_, value, bound)| !bound.holds(*value)) {
            let help = "`lanesweep config schema profile` prints the range of every key";
            return wrong(key, format!("{value} is not usable; expected {expected}"), help);
        }
        let value = |key: &str| bounds.iter().find(|(known, ..)| known == key).map_or(f64::NAN, |(_, value, _)| *value);
        if let Some((lower, upper)) = ORDERED.iter().find(|(lower, upper)| value(lower) > value(upper)) {
            let problem = format!("{} is above `{upper}`, {}", value(lower), value(upper));
            return wrong(lower, problem, "correct one of the two");
        }
        for (key, list) in [("reg157", &self.reg157.always_unsafe), ("cchdm", &self.cchdm.always_unsafe)] {
            let place = || place.clone().of(format!("`{key}.always_unsafe`"));
            refuse_repeats(place, list.iter().map(|category| (*category, category.key())))?;
        }
        if self.reg157.visible_lateral_movement_s > 0.0 && self.reg157.lane_intrusion_m == 0.0 {
            let problem = "movement is visible before a lane intrusion, and `reg157.lane_intrusion_m` is 0".to_owned();
            let help = "set lane_intrusion_m (0.3 in un-r157), or 0 for the time of visible movement";
            return wrong("reg157.visible_lateral_movement_s", problem, help);
        }
        let (dt_s, cap_s) = (self.frame.dt_s, self.frame.time_cap_s);
        if cap_s / dt_s > MAX_STEPS {
            let help = format!("use a time step above {} s: a run has at most 4 million steps", cap_s / MAX_STEPS);
            return wrong("frame.dt_s", format!("{dt_s} s with a cap of {cap_s} s is not usable"), &help);
        }
        Ok(())
    }

    /// Checks that the time step is short enough for these drivers and the TTC threshold. Derivation:
    /// docs/src/methods/lane.md, time step.
    ///
    /// # Errors
    /// [`Error::Usage`] with the maximum time step and the key that bounds it.
    pub fn check_time_step(&self, models: &[ModelId]) -> Result<()> {
        let threshold_s = self.criteria.ttc_threshold_s.max(driver::SHORT_STEP_S);
        let mut bounds = self.driver_time_step_bounds(models);
        bounds.push(("criteria.ttc_threshold_s".to_owned(), threshold_s));
        let Some((key, longest_s)) = bounds.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { return Ok(()) };
        if self.frame.dt_s <= longest_s {
            return Ok(());
        }
        let problem = format!("a time step of {} s is too long: `{key}` allows {longest_s} s", self.frame.dt_s);
        let dt = option("dt");
        let help =
            format!("use a time step ({dt}) of at most {longest_s} s, or leave out the driver model that needs it");
        Err(Error::usage(Place::item("`frame.dt_s`"), problem, help))
    }

    /// The same profile at another time step.
    pub fn with_dt(mut self, dt_s: f64) -> Result<Profile> {
        self.frame.dt_s = dt_s;
        self.check(&Place::option("dt"))?;
        Ok(self)
    }

    /// Maximum number of steps that a run evaluates.
    pub fn step_cap(&self) -> u32 {
        self.frame.step_cap()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::driver::ModelId;
    use lanesweep_support::plain_text::cut;
    use std::collections::BTreeSet;

    #[test]
    fn every_built_in_profile_is_complete_and_named_as_it_is_called() {
        for name in Profile::names() {
            assert_eq!(Profile::load(name).unwrap().name, name);
        }
    }

    #[test]
    fn a_changed_copy_of_a_profile_does_not_bear_its_name() {
        let (dir, text) = (tempfile::tempdir().unwrap(), Profile::files().nth(3).unwrap());
        let load = |text: &str| {
            std::fs::write(dir.path().join("edit.toml"), text).unwrap();
            Profile::load(dir.path().join("edit.toml").to_str().unwrap()).unwrap().name
        };
        assert_eq!(load(text), "un-r157");
        assert_eq!(load(&text.replace("delay_s = 0.75", "delay_s = 0.1")), "un-r157 (changed)");
        assert_eq!(load(&text.replace("\"un-r157\"", "\"mine\"").replace("delay_s = 0.75", "delay_s = 0.1")), "mine");
    }

    #[test]
    fn a_misspelt_profile_is_answered_with_the_nearest_name() {
        let error = Profile::load("papr").unwrap_err();
        assert!(error.help().unwrap().contains("did you mean `paper`"), "{error:?}");
    }

    #[test]
    fn every_number_of_a_profile_has_a_range() {
        let profile = Profile::load("paper").unwrap();
        let numbers = profile.assumptions().into_iter().filter(|of| of.value.is_number()).map(|of| of.key);
        let bounds = profile.bounds().into_iter().map(|(key, ..)| key);
        assert_eq!(numbers.collect::<BTreeSet<_>>(), bounds.collect());
    }

    /// Values whose results are not normal numbers in binary32, and one in another unit.
    #[test]
    fn constants_outside_their_range_are_refused_by_key() {
        for (key, value) in [
            ("fsm.comfortable_deceleration_mps2", 1e-300),
            ("fsm.comfortable_deceleration_mps2", 1e300),
            ("rss.lateral_margin_m", 1e-40),
            ("cchdm.lateral_gate_m", -1e-42),
            ("criteria.jerk_mps3", 1e-30),
            ("frame.default_length_m", f64::INFINITY),
            // In g.
            ("fsm.max_deceleration_mps2", 0.774),
        ] {
            let mut table = toml::Value::try_from(Profile::load("paper").unwrap()).unwrap();
            let (of, name) = key.split_once('.').unwrap();
            table[of][name] = toml::Value::Float(value);
            let text = toml::to_string(&table).unwrap();
            let error = Profile::parse(&text, &Place::file(Path::new("own.toml"))).unwrap_err().to_string();
            let bound =
                Profile::load("paper").unwrap().bounds().into_iter().find(|(known, ..)| known == key).unwrap().2;
            for part in ["own.toml", key, &cut(&value.to_string()), &bound.to_string()] {
                assert!(error.contains(part), "{part}: {error}");
            }
        }
    }

    #[test]
    fn an_unusable_constant_is_named_with_its_key() {
        let error = Profile::load("paper").unwrap().with_dt(1e9).unwrap_err();
        assert!(error.to_string().contains("frame.dt_s"), "{error}");
        for dt_s in [0.0, -0.1, f64::NAN, f64::INFINITY] {
            let error = Profile::load("paper").unwrap().with_dt(dt_s).unwrap_err();
            assert!(error.to_string().contains("option `dt`"), "{error}");
        }
    }

    /// Time steps up to that of the reference simulators are allowed for every delay. Beyond it the error names the
    /// model that bounds the step and the maximum step.
    #[test]
    fn a_time_step_too_long_for_a_driver_is_refused_with_the_longest_that_is_allowed() {
        let check = |name: &str, dt_s: f64, models: &[ModelId]| {
            Profile::load(name).unwrap().with_dt(dt_s).unwrap().check_time_step(models)
        };
        for name in Profile::names() {
            assert!(check(name, 0.1, &ModelId::ALL).is_ok(), "{name}");
            let error = check(name, 0.101, &ModelId::ALL).unwrap_err();
            let says = format!("{error} {}", error.help().unwrap());
            // The short reaction times of EU 2022/1426 bound the step themselves.
            let key = if name.starts_with("eu-") { "reg157.reaction_time_s" } else { "reg157.margin_s" };
            assert!(says.contains(key) && says.contains("at most 0.1 s"), "{name}: {says}");
            assert!(check(name, 0.25, &[ModelId::Rss, ModelId::Fsm]).is_ok(), "{name}");
            assert!(check(name, 0.251, &[ModelId::Fsm]).is_err(), "{name}");
        }
        assert!(check("paper", 0.2, &[ModelId::Cchdm]).is_ok());
        // Reg157's 0.35 s are rounded up to 0.425 s; with half a step more this exceeds its margin of 0.1 s.
        let error = check("paper", 0.085, &[ModelId::Reg157]).unwrap_err().to_string();
        assert!(error.contains("reg157.margin_s") && error.contains("0.07 s"), "{error}");
        for dt_s in [0.001, 0.01, 0.02, 0.033, 0.04, 0.05, 0.066, 0.07, 0.08, 0.0875, 0.09, 0.1] {
            assert!(check("paper", dt_s, &ModelId::ALL).is_ok(), "{dt_s}");
            assert!(check("un-r157", dt_s, &ModelId::ALL).is_ok(), "{dt_s}");
        }
        let error = check("un-r157", 0.2, &[ModelId::Cchdm]).unwrap_err().to_string();
        assert!(error.contains("cchdm.perception_time_s") && error.contains("0.1333 s"), "{error}");
        // Without a delay the threshold bounds the step.
        let mut profile = Profile::load("paper").unwrap().with_dt(0.5).unwrap();
        profile.fsm.reaction_time_s = 0.0;
        assert!(profile.check_time_step(&[ModelId::Fsm]).is_ok());
        profile.criteria.ttc_threshold_s = 0.4;
        assert!(profile.check_time_step(&[ModelId::Fsm]).is_err());
    }
}
