//! What the crates of `src` promise beside their order, which Cargo enforces.

use std::fs;
use std::path::{Path, PathBuf};

/// All but the command line.
const LIBRARY: [&str; 8] = ["support", "model", "random", "traffic", "stats", "engine", "run", "report"];

fn files(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Code without comments and without the test module at a file's end, which may use any room.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let end = text.find("#[cfg(test)]\nmod ").unwrap_or(text.len());
    let is_code = |line: &&str| !line.trim_start().starts_with("//");
    text[..end].lines().filter(is_code).collect::<Vec<_>>().join("\n")
}

/// Messages, reports and pages of the library name options; the command line makes flags of them.
#[test]
fn the_library_names_no_flag() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut texts = 0;
    for room in LIBRARY {
        let mut found = Vec::new();
        files(&src.join(room), &mut found);
        for path in &found {
            let code = code(path);
            for text in code.split('"').skip(1).step_by(2) {
                texts += 1;
                let mut words = text.split([' ', '(', '`', '=', ',']);
                let flag = words.find(|word| word.len() > 3 && word.starts_with("--"));
                assert!(flag.is_none(), "{}: `{text}` names a flag", path.display());
            }
        }
    }
    assert!(texts > 1000, "only {texts} texts were found");
}
