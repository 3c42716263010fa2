//! The assumptions of a profile: every constant and option with its meaning and the source of its value, from
//! `configs/constants.toml`. A source belongs to a value: a changed one has none.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::profile::Profile;
use lanesweep_support::{Place, input_file};

const CONSTANTS: &str = include_str!("../../configs/constants.toml");

/// A constant as the file describes it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constant {
    /// Key: `cchdm.delay_s`.
    pub key: String,
    /// What it is, in a few words.
    pub meaning: String,
    /// Values with the source of each.
    pub sources: Vec<(Value, String)>,
}

/// A constant or option of a profile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Assumption {
    /// Key: `cchdm.delay_s`.
    pub key: String,
    /// Value.
    pub value: Value,
    /// Unit; empty for options and ratios.
    pub unit: &'static str,
    /// What it is; `None` if this is not recorded.
    pub meaning: Option<String>,
    /// Where the value comes from; `None` if this is not recorded, as of a value of a user's own profile.
    pub source: Option<String>,
}

/// The file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Constants {
    constant: Vec<Constant>,
}

impl Constant {
    /// All, in the order of the profiles' keys; a test reads the file.
    pub fn all() -> Vec<Constant> {
        let file = input_file::parse_toml::<Constants>(CONSTANTS, &Place::item("constants.toml"), "");
        file.unwrap_or_default().constant
    }
}

/// Adds the values of a table with their keys.
fn flatten(value: Value, key: String, all: &mut Vec<(String, Value)>) {
    match value {
        Value::Object(fields) => fields.into_iter().for_each(|(name, inner)| {
            flatten(inner, if key.is_empty() { name } else { format!("{key}.{name}") }, all);
        }),
        value => all.push((key, value)),
    }
}

impl Profile {
    /// Every constant and option, in the order of the file; then those that the file does not have.
    pub fn assumptions(&self) -> Vec<Assumption> {
        let (constants, bounds) = (Constant::all(), self.bounds());
        let mut values = Vec::new();
        // Texts and numbers, which JSON always has.
        flatten(serde_json::to_value(self).unwrap_or_default(), String::new(), &mut values);
        values.retain(|(key, _)| !["name", "description"].contains(&key.as_str()));
        let at = |key: &str| constants.iter().position(|constant| constant.key == key);
        values.sort_by_key(|(key, _)| at(key).unwrap_or(usize::MAX));
        let of = |(key, value): (String, Value)| {
            let constant = at(&key).map(|at| &constants[at]);
            let source = constant.and_then(|constant| constant.sources.iter().find(|(known, _)| *known == value));
            Assumption {
                unit: bounds.iter().find(|bound| bound.0 == key).map_or("", |bound| bound.2.unit),
                meaning: constant.map(|constant| constant.meaning.clone()),
                source: source.map(|(_, source)| source.clone()),
                key,
                value,
            }
        };
        values.into_iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_of_every_shipped_profile_has_a_meaning_and_a_source_and_none_is_left_over() {
        let file: Constants = toml::from_str(CONSTANTS).unwrap();
        let values = |of: Constant| of.sources.into_iter().map(move |(value, _)| (of.key.clone(), value));
        let mut left: Vec<(String, Value)> = file.constant.into_iter().flat_map(values).collect();
        for name in Profile::names() {
            for of in Profile::load(name).unwrap().assumptions() {
                assert!(of.meaning.is_some() && of.source.is_some(), "{name}: {} = {}", of.key, of.value);
                left.retain(|(key, value)| (key, value) != (&of.key, &of.value));
            }
        }
        assert_eq!(left, Vec::new());
    }

    #[test]
    fn a_changed_constant_keeps_its_meaning_and_loses_its_source() {
        let mut profile = Profile::load("un-r157").unwrap();
        profile.cchdm.delay_s = 0.7;
        let changed: Vec<Assumption> = profile.assumptions().into_iter().filter(|of| of.source.is_none()).collect();
        let [delay] = &changed[..] else { panic!("{changed:?}") };
        assert_eq!((delay.key.as_str(), delay.value.as_f64(), delay.unit), ("cchdm.delay_s", Some(0.7), "s"));
        assert!(delay.meaning.is_some());
    }
}
