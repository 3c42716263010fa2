//! Rules for the repository's own sources. Licences, origins and duplicates of other crates are `cargo deny`'s (`deny.toml`);
//! unsafe code and what changes the process are clippy's.

use std::collections::BTreeMap;
use std::process::Command;

use crate::common::{in_crate, text_of as read};

/// A release is named alike wherever it is cited, packaged or archived (RELEASING.md).
#[test]
fn every_description_of_the_release_has_its_name_and_version() {
    let version = env!("CARGO_PKG_VERSION");
    let zenodo: serde_json::Value = serde_json::from_str(&read(".zenodo.json")).expect(".zenodo.json");
    assert_eq!((zenodo["title"].as_str(), zenodo["version"].as_str()), (Some("lanesweep"), Some(version)));
    for (file, title, versioned) in [
        ("CITATION.cff", "title: lanesweep", format!("version: {version}")),
        // The crate of the module has the workspace's version.
        ("python/pyproject.toml", "name = \"lanesweep\"", "dynamic = [\"version\"]".to_owned()),
        ("recipe/recipe.yaml", "  name: lanesweep", format!("  version: \"{version}\"")),
        ("CHANGELOG.md", "# Changelog", format!("## {version},")),
    ] {
        let text = read(file);
        for expected in [title, &versioned] {
            assert!(text.lines().any(|line| line.starts_with(expected)), "{file} has no line `{expected}`");
        }
    }
}

/// Packages with their features in the dependency tree of these edges and features of the crate.
fn features_of(edges: &str, features: &[&str]) -> BTreeMap<String, String> {
    let cargo = Command::new(env!("CARGO"))
        .current_dir(in_crate(""))
        .args(["tree", "--locked", "--offline", "--prefix", "none", "--format", "{p}|{f}", "--edges", edges])
        .args(features)
        .output()
        .expect("cargo");
    assert!(cargo.status.success(), "{}", String::from_utf8_lossy(&cargo.stderr));
    let text = String::from_utf8(cargo.stdout).expect("text");
    let package = |line: &str| {
        let (name, features) = line.trim_end_matches(" (*)").split_once('|')?;
        (!name.starts_with("lanesweep")).then(|| (name.to_owned(), features.to_owned()))
    };
    text.lines().filter_map(package).collect()
}

/// A crate with other features is compiled again, and all that stands on it: the README's second and third command took as
/// long as its first.
#[test]
fn tests_and_the_python_module_reuse_the_crates_that_the_program_was_built_with() {
    let program = features_of("normal,build", &[]);
    let others = [
        features_of("normal,build,dev", &["--all-features"]),
        features_of("normal,build", &["--package", "lanesweep-python"]),
    ];
    for of in others {
        let other: Vec<String> = program
            .iter()
            .filter(|(package, features)| of.get(*package) != Some(*features))
            .map(|(package, features)| format!("{package}: {features}; there {:?}", of.get(package)))
            .collect();
        assert!(program.len() > 100 && other.is_empty(), "ask for these features in tests/workspace-hack: {other:#?}");
    }
}
