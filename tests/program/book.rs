//! The book does what it says: its commands run and print what stands there, its links lead somewhere, every chapter is
//! in the table of contents, every verb is in the book, every flag exists.
//!
//! A chapter's ```` ```console ```` blocks run in an empty folder of the chapter's own, in order; what stands in a block
//! `toml file=NAME` (any language) is a file there. `LANESWEEP_RENEW=1 cargo test --release --test commands book::commands --
//! --ignored` writes what the commands print into the chapters.
#![cfg(unix)]

mod markdown;
mod shell;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use rayon::prelude::*;

use crate::common::program::{names, ran};
use crate::program::command_line::verbs;
use crate::program::console;
use markdown::{Document, Link};
use shell::commands;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Markdown files below a folder of the crate, by their path from its root, in order.
fn markdown_below(folder: &str) -> Vec<String> {
    let all = names(&root().join(folder)).into_iter().map(|name| format!("{folder}/{name}"));
    let mut found: Vec<String> = all.filter(|name| name.ends_with(".md")).collect();
    found.sort();
    found
}

fn chapters() -> Vec<Document> {
    markdown_below("docs/src").into_iter().map(|path| Document::read(root(), &path)).collect()
}

/// The chapters and what stands beside them for readers of the repository.
fn documents() -> Vec<Document> {
    let beside = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "RELEASING.md", "docs/README.md"];
    let folders = ["deploy", "configs", "examples", "paper", "shaders"].map(markdown_below).concat();
    let paths = beside.map(str::to_owned).into_iter().chain(folders).chain(["benches/README.md".to_owned()]);
    paths.map(|path| Document::read(root(), &path)).chain(chapters()).collect()
}

#[test]
#[ignore = "half a minute and more: .ci/run long-tests"]
fn commands_print_what_the_book_says() {
    let chapters: Vec<Document> =
        chapters().into_iter().filter(|chapter| chapter.blocks().any(|block| block.language == "console")).collect();
    assert!(!chapters.is_empty(), "no chapter has a console block");
    let differences = chapters.par_iter().filter_map(|chapter| {
        let dir = tempfile::tempdir().unwrap();
        chapter.files().iter().for_each(|(file, content)| fs::write(dir.path().join(file), content).unwrap());
        console::difference(&root().join(&chapter.path), dir.path())
    });
    let differences: Vec<String> = differences.collect();
    assert!(differences.is_empty(), "{}", differences.join("\n\n"));
}

#[test]
fn every_link_leads_somewhere() {
    let mut wrong = Vec::new();
    let mut anchors: BTreeMap<PathBuf, BTreeSet<String>> = BTreeMap::new();
    let mut followed = 0;
    for document in documents() {
        for Link { line, target } in document.links() {
            let place = format!("{}:{line}: `{target}`", document.path);
            if target.contains("://") {
                let host = target.strip_prefix("https://").unwrap_or_default().split('/').next().unwrap_or_default();
                if !host.contains('.') || target.contains(char::is_whitespace) {
                    wrong.push(format!("{place} is not the https address of a host"));
                }
                continue;
            }
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            if file.starts_with('/') {
                wrong.push(format!("{place} is an absolute path"));
                continue;
            }
            let path = if file.is_empty() { document.path.clone() } else { beside(&document.path, file) };
            followed += 1;
            if document.path.starts_with("docs/src/") && !path.starts_with("docs/src/") {
                // mdBook makes pages of the chapters only: as HTML such a link would lead nowhere.
                wrong.push(format!("{place} leaves the book: write the path as code"));
            }
            let at = root().join(&path);
            if !at.exists() {
                wrong.push(format!("{place} leads to no file"));
            } else if !anchor.is_empty() {
                let known = anchors.entry(at).or_insert_with(|| Document::read(root(), &path).anchors());
                if !known.contains(anchor) {
                    wrong.push(format!("{place} leads to no heading; there are {known:?}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(followed > 100, "only {followed} links: are they found?");
}

/// A path relative to a file, from the crate's root: `docs/src/a/b.md` and `../c.md` give `docs/src/c.md`.
fn beside(file: &str, relative: &str) -> String {
    let mut parts: Vec<&str> = file.split('/').collect();
    parts.pop();
    for part in relative.split('/').filter(|part| *part != ".") {
        match part {
            ".." => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/").trim_end_matches('/').to_owned()
}

#[test]
fn the_table_of_contents_holds_every_chapter_once() {
    let summary = Document::read(root(), "docs/src/SUMMARY.md");
    let listed: Vec<String> = summary.links().into_iter().map(|link| beside(&summary.path, &link.target)).collect();
    let once: BTreeSet<&String> = listed.iter().collect();
    assert_eq!(once.len(), listed.len(), "a chapter is listed twice: {listed:?}");
    let mut present = markdown_below("docs/src");
    present.retain(|path| path != "docs/src/SUMMARY.md");
    for path in &present {
        assert!(once.contains(path), "{path} is not in SUMMARY.md");
    }
    for path in &listed {
        assert!(present.contains(path), "SUMMARY.md names {path}, which is not there");
    }
}

#[test]
fn every_verb_is_in_the_book_and_every_printed_command_has_a_verb_and_flags_that_exist() {
    let book: String = chapters().into_iter().map(|chapter| chapter.text).collect();
    let helps: BTreeMap<String, String> =
        verbs().into_iter().map(|verb| (verb.clone(), ran(root(), &format!("{verb} --help")))).collect();
    for verb in helps.keys() {
        assert!(book.contains(&format!("lanesweep {verb}")), "no chapter has `lanesweep {verb}`");
    }
    let (mut wrong, mut checked) = (Vec::new(), 0);
    for document in documents() {
        // What a changelog says of an earlier version need not be true of this one.
        if document.path == "CHANGELOG.md" {
            continue;
        }
        for (line, command) in commands(&document) {
            checked += 1;
            // Of a verb with verbs of its own, the inner one has the flags.
            let inner = command.inner.as_ref().map(|inner| ran(root(), &format!("{} {inner} --help", command.verb)));
            let Some(help) = inner.as_ref().or_else(|| helps.get(&command.verb)) else {
                wrong.push(format!("{}:{line}: there is no verb `{}`", document.path, command.verb));
                continue;
            };
            for flag in &command.flags {
                let known = help.lines().filter(|text| text.trim_start().starts_with('-')).any(|text| {
                    text.split([' ', ',', '=', '[']).any(|word| word == flag) || (flag == "-V" || flag == "--version")
                });
                if !known {
                    wrong.push(format!("{}:{line}: `lanesweep {}` has no {flag}", document.path, command.verb));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(checked > 60, "only {checked} commands: are they found?");
}

/// The figure that `benches/rare-failures/compare.py` draws from rows of hours of runs.
const OF_ROWS: &str = "rare-failures.svg";

/// Figures of the book: file, the command that draws it, and where; `LANESWEEP_RENEW_FIGURES=1` draws them anew.
const FIGURES: [(&str, &str, &str); 4] = [
    ("f1-one-driver.svg", "study --categories cut-in --models CCHDM --out OUT", "figures/f1-cut-in.svg"),
    ("f1-cut-in.svg", "study --out OUT", "figures/f1-cut-in.svg"),
    ("case.svg", CASE, "case.svg"),
    (
        "cut_in_to_60_cchdm.svg",
        "map cut-in --preset r157 --models CCHDM,FSM --robust --out OUT",
        "figures/cut_in_to_60_cchdm.svg",
    ),
];
const CASE: &str = "simulate --category cut-in --models all --ego-speed 30m/s --speed 20m/s --thw 1.2 --lateral-speed 1.0 \
                    --plot OUT/case.svg";

#[test]
#[ignore = "half a minute and more: .ci/run long-tests"]
fn figures_are_what_their_commands_draw() {
    assert_drawn_alike(false);
}

#[test]
#[ignore = "a minute: .ci/long"]
fn robust_figures_are_what_their_commands_draw() {
    assert_drawn_alike(true);
}

/// Every figure of the book has its command. Those with `--robust`, or those without, are what their commands draw now.
fn assert_drawn_alike(is_robust: bool) {
    let mut listed: Vec<&str> = FIGURES.iter().map(|(figure, ..)| *figure).collect();
    listed.sort_unstable();
    let folder = root().join("docs/src/figures");
    let mut present: Vec<String> =
        names(&folder).into_iter().filter(|name| name.ends_with(".svg") && name != OF_ROWS).collect();
    present.sort_unstable();
    assert_eq!(present, listed, "every figure has its command");
    let mut meant = FIGURES.into_iter().filter(|(_, command, _)| command.contains("--robust") == is_robust).peekable();
    assert!(meant.peek().is_some(), "no figure is drawn");
    for (figure, command, drawn) in meant {
        let dir = tempfile::tempdir().unwrap();
        ran(dir.path(), &format!("-q {}", command.replace("OUT", dir.path().to_str().unwrap())));
        let now = fs::read(dir.path().join(drawn)).unwrap();
        if std::env::var_os("LANESWEEP_RENEW_FIGURES").is_some() {
            fs::write(folder.join(figure), now).unwrap();
        } else {
            assert!(fs::read(folder.join(figure)).unwrap() == now, "{figure} is not what `{command}` draws");
        }
    }
}

#[test]
fn files_that_chapters_include_exist_and_bash_can_read_the_slurm_script() {
    let mut included = 0;
    for chapter in chapters() {
        for part in chapter.text.split("{{#include ").skip(1) {
            let file = root().join(&chapter.path).parent().unwrap().join(part.split("}}").next().unwrap());
            assert!(file.is_file(), "{}: {}", chapter.path, file.display());
            included += 1;
        }
    }
    assert!(included >= 3, "{included}");
    assert!(Command::new("bash").arg("-n").arg(root().join("deploy/slurm-array.sh")).status().unwrap().success());
}
