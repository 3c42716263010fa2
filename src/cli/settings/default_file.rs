//! The commented configuration that ships with the program.

use super::keys::Key;

/// Its text: every key with its default; those that are not set unless somebody sets them stand in comments.
pub const DEFAULT_FILE: &str = include_str!("../../../configs/default.toml");

/// The name that `lanesweep config init` gives it.
pub const DEFAULT_FILE_NAME: &str = "lanesweep.toml";

/// All keys in the order of the file, which is the order in which they are read best.
pub fn keys_in_order() -> Vec<Key> {
    let names: Vec<String> = names(DEFAULT_FILE);
    let mut keys = Key::all();
    keys.sort_by_key(|key| names.iter().position(|name| *name == key.name).unwrap_or(usize::MAX));
    keys
}

/// The keys that a text mentions, also in comments (`# threads = 8`).
fn names(text: &str) -> Vec<String> {
    let (mut table, mut names) = (String::new(), Vec::new());
    for line in text.lines() {
        let line = line.strip_prefix("# ").unwrap_or(line);
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            table = name.to_owned();
        } else if let Some((name, _)) = line.split_once(" = ")
            && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
        {
            names.push(format!("{table}.{name}"));
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::super::{KeyKind, Layers, Settings, file};
    use super::*;
    use crate::Place;
    use crate::support::ranges::Range;

    #[test]
    fn the_file_that_ships_is_the_defaults_and_names_every_key_once() {
        let keys = Key::all();
        let lines = file::parse(DEFAULT_FILE, &Place::item("default"), &keys).unwrap();
        for key in &keys {
            let value = lines.iter().find(|line| line.key == key.name).map(|line| line.value.clone());
            assert_eq!(value, key.default, "{}", key.name);
        }
        let mut found = names(DEFAULT_FILE);
        found.sort();
        let mut wanted: Vec<String> = keys.into_iter().map(|key| key.name).collect();
        wanted.sort();
        assert_eq!(found, wanted);
        assert_eq!(Layers::defaults().settings().unwrap(), Settings::default());
        assert_eq!(toml::from_str::<Settings>(DEFAULT_FILE).unwrap(), Settings::default());
    }

    #[test]
    fn every_key_is_explained_and_no_two_have_the_same_variable() {
        let keys = Key::all();
        assert!(keys.iter().all(|key| key.description.len() > 8), "{keys:?}");
        let mut variables: Vec<String> = keys.iter().map(|key| super::super::variable_of(&key.name)).collect();
        variables.sort();
        variables.dedup();
        assert_eq!(variables.len(), keys.len());
    }

    #[test]
    fn what_the_schema_lets_pass_at_its_bounds_the_types_take_too() {
        for key in Key::all() {
            let KeyKind::Number(Range { least, most, .. }) = key.kind else { continue };
            let closed = [least, most].into_iter().flatten().filter(|(_, open)| !open);
            for (bound, _) in closed {
                let mut layers = Layers::defaults();
                layers.assign(&format!("{}={bound}", key.name)).unwrap();
                layers.settings().unwrap();
            }
            let beyond = [least.map(|(x, _)| x - 1.0), most.map(|(x, _)| x + 1.0)];
            for bound in beyond.into_iter().flatten() {
                let error = Layers::defaults().assign(&format!("{}={bound}", key.name)).unwrap_err();
                assert!(error.to_string().contains("expected"), "{error}");
            }
        }
    }
}
