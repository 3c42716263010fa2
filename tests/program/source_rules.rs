//! Rules for the repository's own sources: every combination of features is checked by CI, and the places that leave the
//! compiler's guarantees say why. Licences, origins and duplicates of other crates are `cargo deny`'s (`deny.toml`).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How far above an unsafe place its `SAFETY` comment may begin, lines.
const SAFETY_WITHIN: usize = 5;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn toml_file(name: &str) -> toml::Table {
    let text = std::fs::read_to_string(root().join(name)).expect(name);
    text.parse().expect(name)
}

/// Everything is what all else in CI builds.
#[test]
fn every_combination_of_features_is_built() {
    let manifest = toml_file("Cargo.toml");
    let features: Vec<&str> = manifest["features"].as_table().expect("features").keys().map(String::as_str).collect();
    assert_eq!(
        features,
        ["arrow", "cli", "default", "gpu", "parquet"],
        "lint the combinations with each new feature in .ci/run"
    );
    let run = std::fs::read_to_string(root().join(".ci/run")).expect(".ci/run");
    assert!(run.contains("for features in gpu,parquet cli,arrow; do"), "a combination is not built");
}

/// A release is named alike wherever it is cited, packaged or archived (RELEASING.md).
#[test]
fn every_description_of_the_release_has_its_name_and_version() {
    let read = |name: &str| std::fs::read_to_string(root().join(name)).expect(name);
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
        .current_dir(root())
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

/// The Rust files below a folder.
fn rust_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            rust_files(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

/// Code of a line, without its comment, and the comment's words. A `//` inside a string counts as a comment.
fn code_and_comment(line: &str) -> (&str, &str) {
    line.split_once("//").map_or((line, ""), |(code, comment)| (code, comment.trim_start_matches(['/', '!', ' '])))
}

/// Does this code do something unsafe or promise it: a block, an implementation, a function? A function *type*
/// (`unsafe fn(…)`) does neither, and names that only contain the word do not count.
fn is_unsafe(code: &str) -> bool {
    let is_part = |char: char| char.is_alphanumeric() || char == '_';
    code.match_indices("unsafe").any(|(at, word)| {
        let rest = &code[at + word.len()..];
        let alone = !code[..at].ends_with(is_part) && !rest.starts_with(is_part);
        let rest = rest.trim_start();
        let opens = rest.is_empty() || rest.starts_with('{') || rest.starts_with("impl") || rest.starts_with("extern");
        alone && (opens || rest.strip_prefix("fn").is_some_and(|name| !name.trim_start().starts_with('(')))
    })
}

/// What is wrong with a file's leave to be unsafe: line from 1, problem.
fn unsafe_without_reason(text: &str) -> Vec<(usize, &'static str)> {
    let lines: Vec<_> = text.lines().map(code_and_comment).collect();
    let mut wrong = Vec::new();
    for (index, (code, comment)) in lines.iter().enumerate() {
        let above = &lines[index.saturating_sub(SAFETY_WITHIN)..index];
        if code.contains("allow(unsafe_code") {
            let above = above.last().is_some_and(|(code, comment)| code.trim().is_empty() && !comment.is_empty());
            if comment.is_empty() && !above && !code.contains("reason") {
                wrong.push((index + 1, "allow(unsafe_code) without a reason beside it or in the line above"));
            }
        } else if is_unsafe(code) {
            let is_said = |comment: &str| comment.starts_with("SAFETY:") || comment.starts_with("# Safety");
            if !above.iter().any(|(_, comment)| is_said(comment)) {
                wrong.push((index + 1, "unsafe without a SAFETY comment above it"));
            }
        }
    }
    wrong
}

#[test]
fn unsafe_code_is_found_where_it_has_no_reason() {
    let count = |text| unsafe_without_reason(text).len();
    for good in [
        "#![allow(unsafe_code)] // why",
        "// why\n#[allow(unsafe_code)]",
        "#[allow(unsafe_code, reason = \"why\")]",
        "// SAFETY: checked\nunsafe { go() }",
        "/// # Safety\n/// The caller has asked.\npub unsafe fn go() {}",
        "run: unsafe fn(usize) -> usize,",
        "let is_unsafe = d_unsafe { }; // unsafe { }",
    ] {
        assert_eq!(count(good), 0, "{good}");
    }
    for bad in [
        "#![allow(unsafe_code)]",
        "let a = 1; // no reason of the attribute\n#[allow(unsafe_code)]",
        "unsafe { go() }",
        "let x = unsafe {",
        "unsafe impl Pod for A {}",
        "pub unsafe fn go() {}",
        "unsafe extern \"C\" {}",
        "// SAFETY: far away\n\n\n\n\n\n\nunsafe { go() }",
    ] {
        assert_eq!(count(bad), 1, "{bad}");
    }
}

#[test]
fn unsafe_code_is_denied_and_every_exception_says_why() {
    let lint = &toml_file("Cargo.toml")["workspace"]["lints"]["rust"]["unsafe_code"];
    assert!(matches!(lint.as_str(), Some("deny" | "forbid")), "Cargo.toml: unsafe_code = \"deny\"");
    let mut files = Vec::new();
    ["src", "python/src"].iter().for_each(|folder| rust_files(&root().join(folder), &mut files));
    assert!(files.len() > 50, "only {} files were seen", files.len());
    let mut wrong = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).expect("UTF-8");
        let name = file.strip_prefix(root()).unwrap_or(&file).display();
        wrong.extend(unsafe_without_reason(&text).iter().map(|(line, problem)| format!("{name}:{line}: {problem}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_library_leaves_its_process_alone() {
    let mut files = Vec::new();
    rust_files(&root().join("src"), &mut files);
    files.retain(|file| *file != root().join("src/main.rs"));
    for file in files {
        let text = std::fs::read_to_string(&file).expect("UTF-8");
        for (at, (code, _)) in text.lines().map(code_and_comment).enumerate() {
            for global in ["set_hook(", "take_hook(", "set_var(", "remove_var(", "set_current_dir("] {
                assert!(!code.contains(global), "{}:{}: {global} is the program's", file.display(), at + 1);
            }
        }
    }
}
