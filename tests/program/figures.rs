//! The numbers of a study's figures are the ones that were looked at; how they are drawn, `book.rs` compares.
//! `LANESWEEP_RENEW_FIGURES=1 cargo test --release --test commands figures::` writes the tables again.

use std::fs;

use crate::common::in_crate;
use crate::common::mined::scenarios_of;
use crate::common::program::ran;
use lanesweep::scenario::write_scenarios;

/// The figures of cut-ins whose tables are kept.
const KEPT: [&str; 2] = ["f1", "radar"];

#[test]
fn the_tables_of_the_figures_are_those_that_were_looked_at() {
    let dir = tempfile::tempdir().unwrap();
    write_scenarios(&dir.path().join("s.jsonl"), scenarios_of(12)).unwrap();
    ran(dir.path(), "-q study --scenarios s.jsonl --categories cut-in --thw 0.4,1.2 --backend cpu --out out");
    let kept = in_crate("tests/figures");
    for figure in KEPT {
        let name = format!("{figure}-cut-in.csv");
        let now = fs::read_to_string(dir.path().join("out/tables").join(&name)).unwrap();
        if std::env::var_os("LANESWEEP_RENEW_FIGURES").is_some() {
            fs::write(kept.join(&name), &now).unwrap();
        }
        let known = fs::read_to_string(kept.join(&name)).unwrap();
        let line = known.lines().zip(now.lines()).position(|(a, b)| a != b);
        assert!(known == now, "{name} differs first in line {:?}", line.map(|line| line + 1));
    }
}
