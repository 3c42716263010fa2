//! Gives the program the commit that it is built from, as `LANESWEEP_COMMIT`: that of the environment's variable of this name,
//! else of a published package, else of the repository; empty if none is known. `with changes` follows the commit of a
//! repository whose sources differ from it.

use std::path::Path;
use std::process::Command;

/// What the program is built from.
const SOURCES: [&str; 5] = ["src", "shaders", "configs", "Cargo.toml", "Cargo.lock"];

/// What git prints; `None` without git or a repository.
fn git(arguments: &[&str]) -> Option<String> {
    // Without locks: other programs may use the repository at the same time.
    let output = Command::new("git").env("GIT_OPTIONAL_LOCKS", "0").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The commit that `cargo package` writes into a package.
fn of_package() -> Option<String> {
    let text = std::fs::read_to_string(".cargo_vcs_info.json").ok()?;
    Some(text.split_once("\"sha1\": \"")?.1.split_once('"')?.0.to_owned())
}

fn of_repository() -> Option<String> {
    // Another repository may hold a copy of these sources.
    git(&["rev-parse", "--show-prefix"]).filter(|prefix| prefix == "src/cli/")?;
    let commit = git(&["rev-parse", "HEAD"])?;
    for watched in ["logs/HEAD", "HEAD"] {
        let path = git(&["rev-parse", "--git-path", watched])?;
        if Path::new(&path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    SOURCES.iter().for_each(|path| println!("cargo:rerun-if-changed=../../{path}"));
    let root = SOURCES.map(|path| format!(":/{path}"));
    let status = ["status", "--porcelain", "--untracked-files=no", "--"].into_iter();
    let changes = git(&status.chain(root.iter().map(String::as_str)).collect::<Vec<_>>())?;
    Some(if changes.is_empty() { commit } else { format!("{commit} with changes") })
}

fn main() {
    println!("cargo:rerun-if-env-changed=LANESWEEP_COMMIT");
    println!("cargo:rerun-if-changed=build.rs");
    let given = std::env::var("LANESWEEP_COMMIT").ok();
    let commit = given.or_else(of_package).or_else(of_repository).unwrap_or_default();
    println!("cargo:rustc-env=LANESWEEP_COMMIT={}", commit.lines().next().unwrap_or_default());
}
