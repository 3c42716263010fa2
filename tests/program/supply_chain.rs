//! What lanesweep is made of: licences, sources and duplicates of every crate it is built or tested with, the lock
//! file, and the places of its own that leave the compiler's guarantees. The lists are those of `deny.toml`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde_json::Value;

/// The spellings of crates.io: its git index and its sparse one. A mirror that replaces it does not show here.
const CRATES_IO: [&str; 3] = [
    "registry+https://github.com/rust-lang/crates.io-index",
    "registry+https://index.crates.io/",
    "sparse+https://index.crates.io/",
];

/// How far above an unsafe place its `SAFETY` comment may begin, lines.
const SAFETY_WITHIN: usize = 5;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn toml_file(name: &str) -> toml::Table {
    let text = std::fs::read_to_string(root().join(name)).expect(name);
    text.parse().expect(name)
}

fn strings(list: &toml::Value) -> BTreeSet<&str> {
    list.as_array().expect("a list").iter().map(|item| item.as_str().expect("a string")).collect()
}

/// `cargo metadata` with the lock file as it is, without the network where every crate is on disk.
///
/// It wants the crates of every platform, of which a build fetches its own only. Without a network those of this
/// platform are looked at, and the rest is said to be left out.
fn metadata() -> &'static Value {
    static METADATA: OnceLock<Value> = OnceLock::new();
    METADATA.get_or_init(|| {
        let host = format!("--filter-platform={}", host());
        let attempts: [&[&str]; 3] = [&["--offline"], &[], &["--offline", &host]];
        let mut said = String::new();
        for (attempt, arguments) in attempts.into_iter().enumerate() {
            let run = Command::new(env!("CARGO"))
                .args(["metadata", "--locked", "--format-version", "1"])
                .args(arguments)
                .env("CARGO_NET_RETRY", "0")
                .current_dir(root())
                .output()
                .expect("cargo runs");
            if run.status.success() {
                if attempt == 2 {
                    eprintln!("SKIPPED: crates of other platforms, which are not on disk (cargo fetch --locked)");
                }
                return serde_json::from_slice(&run.stdout).expect("cargo metadata writes JSON");
            }
            said = String::from_utf8_lossy(&run.stderr).into_owned();
        }
        panic!("Cargo.lock is not current, or crates are missing (cargo fetch --locked):\n{said}");
    })
}

/// The platform of this toolchain, as `rustc` names it.
fn host() -> String {
    let rustc = Path::new(env!("CARGO")).with_file_name(format!("rustc{}", std::env::consts::EXE_SUFFIX));
    let rustc = if rustc.exists() { rustc } else { PathBuf::from("rustc") };
    let said = Command::new(rustc).arg("-vV").output().expect("rustc runs").stdout;
    let said = String::from_utf8(said).expect("UTF-8");
    said.lines().find_map(|line| line.strip_prefix("host: ")).expect("rustc names its host").to_owned()
}

/// Everything that lanesweep is built or tested with, itself included.
fn packages() -> &'static [Value] {
    let packages = metadata()["packages"].as_array().expect("packages");
    assert!(packages.len() > 50, "only {} packages were seen", packages.len());
    packages
}

fn name_and_version(package: &Value) -> (&str, &str) {
    (package["name"].as_str().expect("name"), package["version"].as_str().expect("version"))
}

/// Is a licence expression satisfied by licences of a list? `OR` needs one side, `AND` both; `WITH` binds a licence
/// to an exception and both together have to be listed; `/` is an old spelling of `OR`. What was looked up and is
/// listed goes to `used`. The error says what cannot be read.
fn is_covered(expression: &str, allow: &BTreeSet<&str>, used: &mut BTreeSet<String>) -> Result<bool, String> {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut reader = Expression { words: &words, allow, used };
    let covered = reader.either()?;
    if reader.words.is_empty() {
        Ok(covered)
    } else {
        Err(format!("{expression:?}: not understood: {:?}", reader.words))
    }
}

struct Expression<'a> {
    words: &'a [&'a str],
    allow: &'a BTreeSet<&'a str>,
    used: &'a mut BTreeSet<String>,
}

impl Expression<'_> {
    fn takes(&mut self, word: &str) -> bool {
        let is_next = self.words.first() == Some(&word);
        if is_next {
            self.words = &self.words[1..];
        }
        is_next
    }

    fn either(&mut self) -> Result<bool, String> {
        let mut covered = self.all()?;
        while self.takes("OR") {
            covered |= self.all()?;
        }
        Ok(covered)
    }

    fn all(&mut self) -> Result<bool, String> {
        let mut covered = self.one()?;
        while self.takes("AND") {
            covered &= self.one()?;
        }
        Ok(covered)
    }

    fn one(&mut self) -> Result<bool, String> {
        if self.takes("(") {
            let covered = self.either()?;
            return if self.takes(")") { Ok(covered) } else { Err("a parenthesis is not closed".to_owned()) };
        }
        let mut licence = self.identifier()?;
        if self.takes("WITH") {
            licence = format!("{licence} WITH {}", self.identifier()?);
        }
        let covered = self.allow.contains(licence.as_str());
        if covered {
            self.used.insert(licence);
        }
        Ok(covered)
    }

    fn identifier(&mut self) -> Result<String, String> {
        match self.words.split_first() {
            Some((&word, rest)) if !["AND", "OR", "WITH", "(", ")"].contains(&word) => {
                self.words = rest;
                Ok(word.to_owned())
            }
            other => Err(format!("a licence is expected, not {:?}", other.map(|(word, _)| word))),
        }
    }
}

#[test]
fn licence_expressions_mean_what_spdx_says() {
    let allow = BTreeSet::from(["MIT", "Apache-2.0", "Unicode-3.0", "GPL-2.0 WITH Classpath-exception-2.0"]);
    let covered = |expression| is_covered(expression, &allow, &mut BTreeSet::new());
    for expression in [
        "MIT",
        "MIT OR GPL-3.0",
        "GPL-3.0/MIT",
        "(MIT OR GPL-3.0) AND Unicode-3.0",
        // AND binds closer than OR.
        "MIT OR GPL-3.0 AND GPL-2.0",
        "GPL-2.0 WITH Classpath-exception-2.0",
    ] {
        assert_eq!(covered(expression), Ok(true), "{expression}");
    }
    for expression in [
        "GPL-3.0",
        "MIT AND GPL-3.0",
        "GPL-3.0 AND (MIT OR Apache-2.0)",
        "(MIT OR GPL-3.0) AND GPL-2.0",
        "GPL-2.0",
        // An exception is not covered by its licence alone.
        "Apache-2.0 WITH LLVM-exception",
        "mit",
    ] {
        assert_eq!(covered(expression), Ok(false), "{expression}");
    }
    for expression in ["", "MIT OR", "(MIT", "MIT)", "MIT Apache-2.0", "AND MIT", "MIT WITH"] {
        assert!(covered(expression).is_err(), "{expression}");
    }
}

#[test]
fn every_licence_is_allowed_and_every_allowed_licence_is_needed() {
    let deny = toml_file("deny.toml");
    let allow = strings(&deny["licenses"]["allow"]);
    let mut used = BTreeSet::new();
    let mut wrong = Vec::new();
    for package in packages() {
        let (name, version) = name_and_version(package);
        match package["license"].as_str().map(|expression| (expression, is_covered(expression, &allow, &mut used))) {
            Some((_, Ok(true))) => {}
            Some((expression, Ok(false))) => wrong.push(format!("{name} {version}: {expression} is not allowed")),
            Some((_, Err(problem))) => wrong.push(format!("{name} {version}: {problem}")),
            None => wrong.push(format!("{name} {version}: names no licence")),
        }
    }
    assert!(wrong.is_empty(), "deny.toml, licenses.allow:\n{}", wrong.join("\n"));
    let unused: Vec<_> = allow.iter().filter(|licence| !used.contains(**licence)).collect();
    assert!(unused.is_empty(), "deny.toml allows what nothing has: {unused:?}");
}

#[test]
fn every_crate_comes_from_crates_io() {
    let deny = toml_file("deny.toml");
    let sources = &deny["sources"];
    assert_eq!(strings(&sources["allow-registry"]), BTreeSet::from(["https://github.com/rust-lang/crates.io-index"]));
    assert_eq!(strings(&sources["allow-git"]), BTreeSet::new());
    for kind in ["unknown-registry", "unknown-git"] {
        assert_eq!(sources[kind].as_str(), Some("deny"), "deny.toml, sources.{kind}");
    }
    for package in packages() {
        let (name, version) = name_and_version(package);
        match package["source"].as_str() {
            Some(source) => assert!(CRATES_IO.contains(&source), "{name} {version} comes from {source}"),
            None => assert_eq!(name, "lanesweep", "{name} {version} is a folder beside the repository"),
        }
    }
}

#[test]
fn an_advisory_that_is_let_be_has_a_reason_and_its_crate_and_ci_asks_for_the_others() {
    let deny = toml_file("deny.toml");
    let lock = toml_file("Cargo.lock");
    let is_here =
        |name: &str| lock["package"].as_array().expect("packages").iter().any(|p| p["name"].as_str() == Some(name));
    for entry in deny["advisories"]["ignore"].as_array().expect("advisories.ignore") {
        let id = entry["id"].as_str().expect("advisories.ignore: id");
        let reason = entry.get("reason").and_then(toml::Value::as_str).unwrap_or_default();
        assert!(id.starts_with("RUSTSEC-") && reason.len() > 40, "deny.toml, advisories.ignore: {id} has no reason");
        let name = reason.split_whitespace().next().expect("words");
        assert!(is_here(name), "deny.toml lets {id} be for {name}, which is not here");
    }
    let run = std::fs::read_to_string(root().join(".ci/run")).expect(".ci/run");
    assert!(run.lines().any(|line| line == ".ci/deny"), "cargo deny is not run");
    let check = std::fs::read_to_string(root().join(".ci/deny")).expect(".ci/deny");
    for what in ["check bans licenses sources", "check advisories"] {
        assert!(check.contains(what), ".ci/deny leaves out {what}");
    }
}

#[test]
fn duplicates_are_those_that_have_a_reason() {
    let deny = toml_file("deny.toml");
    let mut skipped = BTreeSet::new();
    for entry in deny["bans"]["skip"].as_array().expect("bans.skip") {
        let krate = entry["crate"].as_str().expect("bans.skip: crate");
        let reason = entry.get("reason").and_then(toml::Value::as_str).unwrap_or_default();
        assert!(reason.len() > 10, "deny.toml, bans.skip: {krate} has no reason");
        assert!(skipped.insert(krate.split_once('@').expect("name@version")), "{krate} is skipped twice");
    }
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (name, version) in packages().iter().map(name_and_version) {
        versions.entry(name).or_default().insert(version);
    }
    for (name, versions) in &versions {
        let without_reason: Vec<_> = versions.iter().filter(|version| !skipped.contains(&(name, version))).collect();
        assert!(without_reason.len() <= 1, "{name} is here as {without_reason:?}: deny.toml, bans.skip, with a reason");
    }
    // The lock file, not the metadata: it holds the crates of all platforms also where they are not on disk.
    let lock = toml_file("Cargo.lock");
    let locked = lock["package"].as_array().expect("packages").iter();
    let locked: Vec<_> = locked.map(|package| (package["name"].as_str(), package["version"].as_str())).collect();
    for (name, version) in &skipped {
        assert!(locked.contains(&(Some(name), Some(version))), "deny.toml skips {name}@{version}, which is not here");
        let others = locked.iter().filter(|(other, _)| *other == Some(name)).count();
        assert!(others > 1, "deny.toml skips {name}@{version}, the only version of it");
    }
}

#[test]
fn the_lock_file_is_in_the_repository_and_current() {
    metadata(); // fails where Cargo.lock would have to change
    let git = |arguments: &[&str]| Command::new("git").args(arguments).current_dir(root()).output();
    match git(&["rev-parse", "--is-inside-work-tree"]) {
        Ok(inside) if inside.status.success() => {
            let tracked = git(&["ls-files", "--error-unmatch", "Cargo.lock"]).expect("git runs");
            assert!(tracked.status.success(), "Cargo.lock is not in git: builds are not repeatable without it");
        }
        _ => eprintln!("SKIPPED: not a git work tree; whether Cargo.lock is tracked cannot be asked"),
    }
}

/// The default is what all else builds; CI checks none and each feature alone.
#[test]
fn every_combination_of_features_is_built() {
    let manifest = toml_file("Cargo.toml");
    let features: Vec<&str> = manifest["features"].as_table().expect("features").keys().map(String::as_str).collect();
    assert_eq!(features, ["default", "gpu", "parquet"], "build each new combination in .ci/run (none, each one, all)");
    let run = std::fs::read_to_string(root().join(".ci/run")).expect(".ci/run");
    assert!(run.contains("for features in \"\" gpu parquet; do"), "none and each one are not built");
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
    let lint = &toml_file("Cargo.toml")["lints"]["rust"]["unsafe_code"];
    assert!(matches!(lint.as_str(), Some("deny" | "forbid")), "Cargo.toml: unsafe_code = \"deny\"");
    let mut files = Vec::new();
    rust_files(&root().join("src"), &mut files);
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
