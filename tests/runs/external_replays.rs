//! S' given as series: of other programs, and of decompositions fitted on other folds.

use crate::common::mined::scenarios_of;
use crate::common::program::said;

use lanesweep::scenario::write_scenarios;
use serde_json::Value;
use std::path::Path;

/// The scenarios of some generated recordings as `scenarios.jsonl`, and the kept ones.
fn mined(dir: &Path) -> Vec<Value> {
    write_scenarios(&dir.join("scenarios.jsonl"), scenarios_of(3)).unwrap();
    let lines = std::fs::read_to_string(dir.join("scenarios.jsonl")).unwrap();
    lines.lines().map(|line| line.parse::<Value>().unwrap()).filter(|row| row["kept"] == true).collect()
}

const STUDY: &str = "study --scenarios scenarios.jsonl --models FSM --thw 1 --out out";

fn scale(value: &mut Value, factor: f64) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(|value| scale(value, factor)),
        number => *number = (factor * number.as_f64().unwrap()).into(),
    }
}

fn thin(row: &mut Value) {
    for of in ["v", "y"] {
        let values = row["target"][of].as_array_mut().unwrap();
        *values = values.iter().step_by(2).cloned().collect();
    }
}

fn shorten(row: &mut Value) {
    for of in ["target", "lead"] {
        for series in ["v", "y"] {
            if let Some(values) = row[of][series].as_array_mut().filter(|values| values.len() > 20) {
                values.drain(..12);
            }
        }
    }
    ["frame0", "frame1"].iter().for_each(|frame| drop(row.as_object_mut().unwrap().remove(*frame)));
}

fn exchange(row: &mut Value) {
    let target = row["target"]["v"].take();
    row["target"]["v"] = row["lead"]["v"].take();
    row["lead"]["v"] = target;
}

#[test]
fn what_is_strange_about_s_prime_is_said_and_what_cannot_be_one_is_refused() {
    let dir = &*crate::common::folder();
    let all = mined(dir);
    let [cut_ins, cut_outs] =
        ["cut_in", "cut_out"].map(|of| all.iter().filter(|row| row["category"] == of).cloned().collect::<Vec<_>>());
    let told = |rows: &[Value], change: &dyn Fn(&mut Value)| {
        let changed = rows.iter().cloned().map(|mut row| {
            change(&mut row);
            format!("{row}\n")
        });
        std::fs::write(dir.join("own.jsonl"), changed.collect::<String>()).unwrap();
        let category = rows[0]["category"].as_str().unwrap().replace('_', "-");
        said(dir, &format!("{STUDY} --categories {category} --external own.jsonl")).1
    };
    type Change<'a> = &'a dyn Fn(&mut Value);
    let cases: [(&[Value], Change, &str); 8] = [
        (&cut_ins, &thin, "own.jsonl: every S' (cut-in) lasts 0."),
        (&cut_ins, &|row| scale(&mut row["ego"]["v0"], 0.8), "begin with another speed of the ego"),
        (&cut_ins, &|_| (), "has the series of its scenario: it is S itself"),
        (&cut_outs, &|row| scale(&mut row["D"], 1.0 / 0.3048), "`D` is 3.281 times that of the scenarios on average"),
        (&cut_outs, &exchange, "begin as if `target` and `lead` were exchanged"),
        (&cut_outs, &|_| (), "has the series of its scenario: it is S itself"),
        (&cut_outs, &|row| scale(&mut row["target"]["y"], 1.0 / 3.5), "(cut-out) move 0.2857 times as far to the side"),
        (&cut_outs, &shorten, "are 0.48 s shorter than their scenarios"),
    ];
    for (rows, change, expected) in cases {
        let text = told(rows, change);
        assert!(text.contains(expected), "{expected}: {text}");
    }
    // With its own rate every second sample is no fault. Rows moved by one: S' of one scenario has the id of the next.
    let with_rate = |row: &mut Value| {
        thin(row);
        scale(&mut row["fps"], 0.5);
    };
    assert!(!told(&cut_ins, &with_rate).contains("own.jsonl: "));
    let ids: Vec<Value> = cut_ins.iter().map(|row| row["id"].clone()).collect();
    let next = |row: &mut Value| {
        let at = ids.iter().position(|id| *id == row["id"]).unwrap();
        row["id"] = ids[(at + 1) % ids.len()].clone();
    };
    assert!(told(&cut_ins, &next).contains("check the ids") && !told(&cut_ins, &|_| ()).contains("check the ids"));
    // S itself in lane widths, and lane changes to the marking.
    told(&cut_ins, &|row| scale(&mut row["target"]["y"], 1.0 / 3.5));
    let text = said(dir, &STUDY.replace("scenarios.jsonl", "own.jsonl")).1;
    assert!(text.contains("are in the ego's lane throughout, the first is"), "{text}");
    let text = said(dir, &format!("{STUDY} --categories cut-in --config parameterization.lane_change_m=1.75")).1;
    assert!(text.contains("a lane change moves from middle to middle"), "{text}");
    assert!(!said(dir, &format!("{STUDY} --categories cut-in")).1.contains(" WARN"));
    // What is wrong is said.
    let lines = std::fs::read_to_string(dir.join("scenarios.jsonl")).unwrap();
    let of_id = format!("\"id\":{}", ids[0]);
    let without: Vec<&str> = lines.lines().filter(|line| !line.contains(&of_id)).collect();
    for (name, content, says) in [
        ("missing.jsonl", without.join("\n"), "is missing"),
        ("renamed.jsonl", lines.replace(&of_id, "\"id\":\"nobody\""), "nobody"),
        ("5.jsonl", lines.clone(), "cannot name"),
        ("cut.jsonl", lines[..lines.len() / 2].to_owned(), "cut.jsonl"),
    ] {
        std::fs::write(dir.join(name), content).unwrap();
        let (code, said) = said(dir, &format!("{STUDY} --external {name}"));
        assert!((code == 2 || code == 3) && said.contains(says), "{name}: {code} {said}");
    }
}
