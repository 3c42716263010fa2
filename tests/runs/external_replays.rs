//! S' given as series: of other programs, and of decompositions fitted on other folds.

use lanesweep::model::plausibility::Implausible;
use lanesweep::scenario::{Category, read_scenario_file};

use crate::common::program::{done, ran, said, table as csv, words};

#[test]
fn s_prime_of_other_programs_and_of_bases_of_other_folds_are_scored() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name);
    ran(dir.path(), "-q tracks --convert recordings --synth-recordings 6");
    ran(dir.path(), "-q mine recordings --out scenarios.jsonl");
    // S itself as S' of another program, in a file whose name is no key.
    std::fs::copy(of("scenarios.jsonl"), of("my same.v2.jsonl")).unwrap();
    let study = "-q study --scenarios scenarios.jsonl --external";
    let external = study.replace("--external", "--categories cut-in --out study --external");
    done(dir.path(), &[&words(&external)[..], &["my same.v2.jsonl"]].concat());
    // F1 of every driver and criterion of a variant, where it is defined.
    let scores = |folder: &str, category: &str, variant: &str| -> Vec<String> {
        let rows = csv(&of(folder).join("results.csv")).into_iter();
        let own =
            rows.filter(|row| row["category"] == category && row["variant"] == variant && row["headway"] == "all");
        own.map(|row| row["f1"].clone()).filter(|f1| !f1.is_empty()).collect()
    };
    let same = scores("study", "cut_in", "my-same-v2");
    assert!(same.len() > 3 && same.iter().all(|f1| f1 == "1"), "{same:?}");
    assert!(scores("study", "cut_in", "5-cv").iter().any(|f1| f1 != "1"));
    assert_eq!(std::fs::read_to_string(of("study/tables/folds.csv")).unwrap().lines().next(), Some("id,fold"));
    #[cfg(feature = "parquet")]
    {
        ran(dir.path(), "-q mine recordings --out as-parquet.parquet");
        ran(dir.path(), &format!("{study} as-parquet.parquet --out parquet"));
        assert!(scores("parquet", "lvd", "as-parquet").iter().all(|f1| f1 == "1"));
    }
    // Rows moved by one: S' of one scenario has the id of the next.
    let lines = std::fs::read_to_string(of("scenarios.jsonl")).unwrap();
    let rows = || lines.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let cut_ins: Vec<_> = rows().filter(|row| row["category"] == "cut_in" && row["kept"] == true).collect();
    let moved = cut_ins.iter().zip(cut_ins.iter().cycle().skip(1)).map(|(own, other)| {
        let mut row = other.clone();
        row["id"] = own["id"].clone();
        format!("{row}\n")
    });
    std::fs::write(of("moved.jsonl"), moved.collect::<String>()).unwrap();
    let warned = |name: &str| {
        said(dir.path(), &format!("{} {name} --categories cut-in --out ids", &study[3..])).1.contains("check the ids")
    };
    assert!(warned("moved.jsonl") && !warned("scenarios.jsonl"));
    // Every second sample with the old rate, and the same with its own.
    let thinned = |fps: f64| {
        let every_second = |series: &mut serde_json::Value| {
            let kept: Vec<_> = series.as_array().unwrap().iter().step_by(2).cloned().collect();
            *series = kept.into();
        };
        let rows = cut_ins.iter().cloned().map(|mut row| {
            row["fps"] = fps.into();
            ["v", "y"].iter().for_each(|of| every_second(&mut row["target"][*of]));
            format!("{row}\n")
        });
        std::fs::write(of("thinned.jsonl"), rows.collect::<String>()).unwrap();
        said(dir.path(), &format!("{} thinned.jsonl --categories cut-in --out ids", &study[3..])).1
    };
    assert!(thinned(25.0).contains("thinned.jsonl: every S' (cut-in) lasts 0."), "{}", thinned(25.0));
    assert!(!thinned(12.5).contains("thinned.jsonl: "), "{}", thinned(12.5));
    // A distance in feet, and the vehicles of a cut-out exchanged.
    let changed = |change: &dyn Fn(&mut serde_json::Value)| {
        let cut_outs = rows().filter(|row| row["category"] == "cut_out" && row["kept"] == true).map(|mut row| {
            change(&mut row);
            format!("{row}\n")
        });
        std::fs::write(of("changed.jsonl"), cut_outs.collect::<String>()).unwrap();
        said(dir.path(), &format!("{} changed.jsonl --categories cut-out --out ids", &study[3..])).1
    };
    let feet = changed(&|row| row["D"] = (row["D"].as_f64().unwrap() / 0.3048).into());
    assert!(feet.contains("`D` is 3.281 times that of the scenarios on average"), "{feet}");
    let exchanged = changed(&|row| {
        let target = row["target"]["v"].take();
        row["target"]["v"] = row["lead"]["v"].take();
        row["lead"]["v"] = target;
    });
    assert!(exchanged.contains("begin as if `target` and `lead` were exchanged"), "{exchanged}");
    let same = changed(&|_| ());
    assert!(same.contains("has the series of its scenario: it is S itself"), "{same}");
    // What is S' but in lane widths, or without its first half a second.
    let scaled = changed(&|row| {
        let y: Vec<f64> = row["target"]["y"].as_array().unwrap().iter().map(|y| y.as_f64().unwrap() / 3.5).collect();
        row["target"]["y"] = y.into();
    });
    assert!(scaled.contains("S' (cut-out) move 0.2857 times as far to the side"), "{scaled}");
    let late = changed(&|row| {
        for of in ["target", "lead"] {
            for series in ["v", "y"] {
                if let Some(values) = row[of][series].as_array_mut().filter(|values| values.len() > 20) {
                    values.drain(..12);
                }
            }
        }
        ["frame0", "frame1"].iter().for_each(|frame| drop(row.as_object_mut().unwrap().remove(*frame)));
    });
    assert!(late.contains("are 0.48 s shorter than their scenarios"), "{late}");
    let slower = cut_ins.iter().cloned().map(|mut row| {
        row["ego"]["v0"] = (0.8 * row["ego"]["v0"].as_f64().unwrap()).into();
        format!("{row}\n")
    });
    std::fs::write(of("slower.jsonl"), slower.collect::<String>()).unwrap();
    let text = said(dir.path(), &format!("{} slower.jsonl --categories cut-in --out ids", &study[3..])).1;
    assert!(text.contains("begin with another speed of the ego"), "{text}");
    // S itself in lane widths, and lane changes to the marking.
    let narrow = cut_ins.iter().cloned().map(|mut row| {
        let y: Vec<f64> = row["target"]["y"].as_array().unwrap().iter().map(|y| y.as_f64().unwrap() / 3.5).collect();
        row["target"]["y"] = y.into();
        format!("{row}\n")
    });
    std::fs::write(of("narrow.jsonl"), narrow.collect::<String>()).unwrap();
    let text = said(dir.path(), "study --scenarios narrow.jsonl --out ids").1;
    assert!(text.contains("are in the ego's lane throughout, the first is"), "{text}");
    let whole = "study --scenarios scenarios.jsonl --categories cut-in --out ids";
    let text = said(dir.path(), &format!("{whole} --config parameterization.lane_change_m=1.75")).1;
    assert!(text.contains("a lane change moves from middle to middle"), "{text}");
    assert!(!said(dir.path(), whole).1.contains(" WARN"));
    // What is wrong is said.
    let scenarios = read_scenario_file(&of("scenarios.jsonl"), Implausible::Refused).unwrap().scenarios;
    let id = &scenarios.iter().find(|s| s.kept && s.category == Category::CutIn).unwrap().id;
    let lines = std::fs::read_to_string(of("scenarios.jsonl")).unwrap();
    let of_id = format!("\"id\":\"{id}\"");
    let without: Vec<&str> = lines.lines().filter(|line| !line.contains(&of_id)).collect();
    let renamed = lines.replace(&of_id, "\"id\":\"nobody\"");
    for (name, content, says) in [
        ("missing.jsonl", without.join("\n"), "is missing"),
        ("renamed.jsonl", renamed, "nobody"),
        ("5.jsonl", lines.clone(), "cannot name"),
        ("cut.jsonl", lines[..lines.len() / 2].to_owned(), "cut.jsonl"),
    ] {
        std::fs::write(of(name), content).unwrap();
        let (code, said) = said(dir.path(), &format!("{study} {name} --out bad"));
        assert!((code == 2 || code == 3) && said.contains(says), "{name}: {code} {said}");
    }
}
