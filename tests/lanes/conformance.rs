//! Our lanes against the outputs of other people's simulators.

use crate::common;

use std::path::Path;

use lanesweep::interop::conformance::{Table, TableKind, Tally, compare_functions, compare_jrc, compare_lanes};
use lanesweep::model::profile::Profile;
use lanesweep::scenario::read_scenarios;

fn tallies(path: &Path) -> Vec<Tally> {
    let table = Table::read(path).unwrap();
    let profile = Profile::load("jrc-2021").unwrap();
    match table.kind().unwrap() {
        TableKind::JrcCases => compare_jrc(&table, &profile).unwrap(),
        TableKind::Functions => compare_functions(&table, &profile).unwrap(),
    }
}

fn agrees(tallies: &[Tally]) {
    for tally in tallies {
        assert!(tally.passes(), "{} {:?}: {:#?}", tally.label, tally.model, tally.complaints);
    }
}

#[test]
fn surrogates_distances_and_thresholds_equal_the_jrc_functions() {
    let tallies = tallies(&common::golden("functions.csv"));
    assert_eq!(tallies.iter().map(|t| t.rows).sum::<u64>(), 1165);
    agrees(&tallies);
}

#[test]
fn every_leader_deceleration_of_the_jrc_ends_as_in_its_simulator() {
    let tallies = tallies(&common::golden("lvd.csv"));
    assert_eq!(tallies.iter().map(|t| t.rows).sum::<u64>(), 718);
    assert!(tallies.iter().all(|t| t.reacted > 0 && t.collided > 0), "every model must have reacted and collided");
    agrees(&tallies);
}

#[test]
fn every_cut_in_and_cut_out_of_the_jrc_ends_as_in_its_simulator() {
    for (name, rows) in [("golden/jrc/cutin.csv", 2158), ("golden/jrc/cutout.csv", 1726)] {
        let Some(path) = common::shared(name) else { continue };
        let tallies = tallies(&path);
        assert_eq!(tallies.iter().map(|t| t.rows).sum::<u64>(), rows);
        agrees(&tallies);
    }
}

#[test]
fn every_lane_of_the_paper_profile_equals_an_independent_implementation_in_f64_and_f32() {
    let scenarios = read_scenarios(&common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    let lanes = Table::read(&common::golden("paper_sumo_01_02_lanes.csv")).unwrap();
    let compared = compare_lanes(&scenarios, &lanes, &Profile::load("paper").unwrap()).unwrap();
    assert_eq!(compared.lanes, 3400);
    agrees(&compared.tallies);
    assert!(compared.f32_different.is_empty(), "{:?}", compared.f32_different);
    // Six lanes chatter around |TTC| = 2 s exactly; exact rational arithmetic gives the table's values.
    assert!(compared.ties.len() <= 6, "{:?}", compared.ties);
}

#[test]
fn a_wrong_value_in_a_table_is_found_and_named_with_its_line() {
    let text = std::fs::read_to_string(common::golden("lvd.csv")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("wrong.csv");
    // The first row collides; say that it does not.
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = lines[0].split(',').position(|c| c == "collision").unwrap();
    let mut fields: Vec<&str> = lines[1].split(',').collect();
    assert_eq!(fields[at], "1");
    fields[at] = "0";
    lines[1] = fields.join(",");
    std::fs::write(&path, lines.join("\n")).unwrap();
    let failed: Vec<Tally> = tallies(&path).into_iter().filter(|t| !t.passes()).collect();
    assert_eq!(failed.len(), 1);
    assert!(failed[0].complaints[0].contains("line 2, column `collision`"), "{:?}", failed[0].complaints);
}
