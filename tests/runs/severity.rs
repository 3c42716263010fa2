//! Injuries of sampling runs against the rows of the same lanes, and rates against a target.

use crate::common::program::{done, flat, lanesweep};

use std::collections::BTreeMap;
use std::path::Path;

const CURVES: &str = "nhtsa-2022-frontal-mais3,joksch-1993-fatal";
const SAMPLE: [&str; 11] = [
    "-q",
    "sample",
    "densities/cut-in-2.json",
    "--samples",
    "3000",
    "--thw",
    "0.6,0.2",
    "--models",
    "RSS,FSM",
    "--backend",
    "cpu",
];

fn density(dir: &Path) {
    let fit = ["-q", "fit", "--synth-recordings", "3", "--categories", "cut-in", "--parameterizations", "2"];
    done(dir, &[&fit[..], &["--no-comparison", "--out", "densities"]].concat());
}

/// The rows of a table by column.
fn rows(dir: &Path, file: &str) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(dir.join(file)).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().unwrap();
    lines.map(|line| header.iter().cloned().zip(line).collect()).collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

#[test]
fn injuries_are_those_of_the_rows_and_shards_give_the_same_bits() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let asked = ["--injury", CURVES, "--target", "injury=1e-4", "--target", "collision=1e-3"];
    let whole = [&SAMPLE[..], &asked].concat();
    done(dir, &[&whole[..], &["--rows", "rows.csv", "--out", "whole"]].concat());
    let lanes = rows(dir, "rows.csv");
    let contact = |row: &&BTreeMap<String, String>| row["collision"] == "1";
    for injuries in rows(dir, "whole/injuries.csv") {
        let column = format!("injury_{}", injuries["curve"].replace('-', "_"));
        let is_of = |row: &&BTreeMap<String, String>| {
            row["model"] == injuries["model"]
                && ["all", row["headway"].as_str()].contains(&injuries["headway"].as_str())
        };
        let of: Vec<_> = lanes.iter().filter(contact).filter(is_of).collect();
        let risks: Vec<f64> = of.iter().filter_map(|row| row[&column].parse().ok()).collect();
        assert_eq!(number(&injuries, "contacts") as usize, of.len());
        assert_eq!(number(&injuries, "uncovered") as usize, of.len() - risks.len());
        assert!(of.len() > 20 && !risks.is_empty(), "{injuries:?}");
        let mean = risks.iter().sum::<f64>() / of.len() as f64;
        assert!((number(&injuries, "risk") - mean).abs() < 1e-6, "{injuries:?}: {mean}");
        assert!(number(&injuries, "risk_low") <= mean && mean <= number(&injuries, "risk_high"));
        let covered = risks.len() as f64 / of.len() as f64;
        assert!(
            number(&injuries, "risk_high") >= mean + 1.0 - covered,
            "uncovered contacts are injuries in the upper end"
        );
        let collisions = rows(dir, "whole/estimates.csv").into_iter().find(|row| {
            ["model", "headway"].iter().all(|key| row[*key] == injuries[*key]) && row["criterion"] == "collision"
        });
        let per_hour = number(&collisions.unwrap(), "risk_per_hour");
        assert!((number(&injuries, "per_hour") / (per_hour * mean) - 1.0).abs() < 1e-3, "{injuries:?}");
    }
    // A plastic contact shares the closing speed; a side contact has no change of speed.
    for row in lanes.iter().filter(contact) {
        let is_frontal = row["contact_type"] == "2" && number(row, "impact_closing_speed_mps") > 0.0;
        assert_eq!(!row["delta_v_ego_mps"].is_empty(), is_frontal, "{row:?}");
        if is_frontal {
            let both = number(row, "delta_v_ego_mps") + number(row, "delta_v_other_mps");
            assert!((both - number(row, "impact_closing_speed_mps")).abs() < 1e-5, "{row:?}");
        }
    }
    for shard in ["2/3", "0/3", "1/3"] {
        done(dir, &[&whole[..], &["--threads", "1", "--out", "three", "--shard", shard]].concat());
    }
    done(dir, &["-q", "merge", "three"]);
    for file in ["injuries.csv", "targets.csv", "estimates.csv"] {
        let read = |folder: &str| std::fs::read(dir.join(folder).join(file)).unwrap();
        assert!(read("whole") == read("three"), "{file}");
    }
    // Without the option nothing is added.
    done(dir, &[&SAMPLE[..], &["--rows", "plain.csv", "--out", "plain"]].concat());
    assert!(!dir.join("plain/injuries.csv").exists());
    assert!(!std::fs::read_to_string(dir.join("plain.csv")).unwrap().contains("delta_v"));
}

#[test]
fn a_target_is_undercut_exceeded_or_undecided_and_the_run_says_what_would_decide() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let run = |target: &str, more: &[&str]| {
        let text = done(dir, &[&SAMPLE[..], &["--target", target, "--out", "out"], more].concat());
        (flat(&text), rows(dir, "out/targets.csv"), rows(dir, "out/estimates.csv"))
    };
    let (text, far, estimates) = run("collision=1e6", &[]);
    assert!(far.len() == 2 && far.iter().all(|row| row["verdict"] == "below"), "{far:?}");
    assert!(text.contains("lies below the target of 1,000,000"), "{text}");
    let (_, near, _) = run("collision=1e-9", &[]);
    assert!(near.iter().all(|row| row["verdict"] == "above" && row["samples_to_decide"].is_empty()), "{near:?}");
    // Between the estimate and the upper end: undecided, whatever is needed is more than there is.
    let rss = estimates
        .iter()
        .find(|row| row["model"] == "RSS" && row["headway"] == "all" && row["criterion"] == "collision");
    let [estimate, high] = ["risk_per_hour", "risk_per_hour_high"].map(|column| number(rss.unwrap(), column));
    let target = format!("collision={}", estimate + 0.9 * (high - estimate));
    let (text, open, _) = run(&target, &[]);
    let row = open.iter().find(|row| row["model"] == "RSS").unwrap();
    assert_eq!(row["verdict"], "undecided");
    assert!(
        number(row, "hours_to_decide") > 0.5 && text.contains("in all would decide if the rate is as estimated"),
        "{text}"
    );
    assert!(row["samples_to_decide"].is_empty(), "the recordings alone are too few: {row:?}");
    // Importance sampling has rates too, and no injuries.
    let is = ["--estimator", "is", "--thw", "0.2"];
    let weighted: Vec<&str> =
        SAMPLE.iter().copied().filter(|word| !["--thw", "0.6,0.2"].contains(word)).chain(is).collect();
    done(dir, &[&weighted[..], &["--target", "collision=1e6", "--out", "is"]].concat());
    assert!(rows(dir, "is/targets.csv").iter().all(|row| row["verdict"] == "below"));
    for (args, said) in [
        (&["--target", "speed=1"][..], "there is no rate `speed`"),
        (&["--target", "collision=0"], "0 is no rate"),
        (&["--target", "injury=1"], "injuries need a curve"),
        (&["--target", "collision=1", "--given", "v_ego_mps=30"], "no rate per hour is known"),
        (&["--injury", "mine"], "there is no curve `mine`"),
    ] {
        let (code, _, error) = lanesweep(dir, &[&SAMPLE[..], args, &["--out", "refused"]].concat());
        assert!(code == 2 && flat(&error).contains(said), "{args:?}: {error}");
    }
    let (code, _, error) = lanesweep(dir, &[&weighted[..], &["--injury", CURVES, "--out", "refused"]].concat());
    assert!(code == 2 && flat(&error).contains("belongs to crude Monte Carlo"), "{error}");
}
