//! Files that runs leave and read again, changed at random: refused, or of no effect. 60 changes by default; the long form is
//! `LANESWEEP_MUTATED_INPUTS=2000 cargo test --release --test commands mutations:: -- --nocapture`.

use std::collections::BTreeMap;

use super::parts::{SAMPLE, STUDY, density, weighted};
use crate::common::plans::mixed;
use crate::common::program::{Files, files, json, lanesweep, ran, without_host, words};
use sha2::{Digest, Sha256};

/// A file that is changed, and the command that reads it; the results lie in the folder.
struct Input {
    file: &'static str,
    reader: String,
    results: &'static str,
}

/// The content with one change, and what was done.
fn changed(whole: &[u8], random: u64) -> (Vec<u8>, &'static str) {
    let (mut bytes, at) = (whole.to_vec(), (random >> 8) as usize % whole.len());
    let what = match random % 5 {
        0 => {
            bytes[at] ^= 1 << ((random >> 4) % 8);
            "a bit turned"
        }
        1 => {
            bytes.truncate(at);
            "cut off"
        }
        2 => {
            let end = whole.len().min(at + 40);
            bytes.splice(at..at, whole[at..end].to_vec());
            "a piece doubled"
        }
        3 => {
            let digit = (0..whole.len()).map(|k| (at + k) % whole.len()).find(|k| whole[*k].is_ascii_digit());
            if let Some(digit) = digit {
                bytes[digit] = b'0' + (bytes[digit] - b'0' + 1 + (random >> 40) as u8 % 9) % 10;
            }
            "another digit"
        }
        _ => {
            let mut lines: Vec<&[u8]> = whole.split_inclusive(|byte| *byte == b'\n').collect();
            let (a, b) = ((random >> 16) as usize % lines.len(), (random >> 32) as usize % lines.len());
            lines.swap(a, b);
            bytes = lines.concat();
            "two lines exchanged"
        }
    };
    (bytes, what)
}

/// The lines of a journal with their checksums.
fn journal_of(lines: &[String]) -> Vec<u8> {
    let line = |line: &String| {
        let sum: String = Sha256::digest(line).iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{sum} {line}\n")
    };
    lines.iter().map(line).collect::<String>().into_bytes()
}

#[test]
fn changed_files_of_a_run_are_refused_or_have_no_effect() {
    let count: u64 = std::env::var("LANESWEEP_MUTATED_INPUTS").map_or(60, |text| text.parse().unwrap());
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let weighted = weighted(dir);
    for (run, name) in [(STUDY, "study"), (SAMPLE, "sample"), (&weighted, "is")] {
        let _ = ["0/2", "1/2"].map(|shard| ran(dir, &format!("{run} --shard {shard} --out {name}")));
    }
    // A journal of a shard: a part's segments as its records.
    let part = json(&dir.join("sample/part-00000-of-00002.json"));
    let (content, engine) = (&part["content"], &part["engine"]);
    let head = serde_json::json!({
        "lanesweep_journal": 4, "engine": engine, "run_sha256": content["run_sha256"], "units": content["units"],
    });
    let records = content["segments"].as_array().unwrap().iter().take(2);
    let records = records.map(|segment| serde_json::json!({"counts": segment, "redone_and_rechecked": [0, 0]}));
    let lines: Vec<String> = std::iter::once(head).chain(records).map(|line| line.to_string()).collect();
    std::fs::create_dir(dir.join("journal")).unwrap();
    let journal = "journal/part-00000-of-00002.journal";
    std::fs::write(dir.join(journal), journal_of(&lines)).unwrap();

    let merge = |file, results| Input { file, reader: format!("-q merge {results}"), results };
    let inputs = [
        merge("study/plan.json", "study"),
        merge("study/part-00000-of-00002.json", "study"),
        merge("sample/plan.json", "sample"),
        merge("sample/part-00001-of-00002.json", "sample"),
        merge("is/plan.json", "is"),
        merge("is/part-00000-of-00002.json", "is"),
        Input { file: journal, reader: format!("{SAMPLE} --shard 0/2 --out journal"), results: "journal" },
    ];
    let whole: Vec<Vec<u8>> = inputs.iter().map(|input| std::fs::read(dir.join(input.file)).unwrap()).collect();
    let outcome = |input: &Input| {
        let (code, _, err) = lanesweep(dir, &words(&input.reader));
        if input.file == journal {
            // The part that comes of it.
            let part = std::fs::read_to_string(dir.join("journal/part-00000-of-00002.json")).unwrap_or_default();
            let _ = std::fs::remove_file(dir.join("journal/part-00000-of-00002.json"));
            let mut part: serde_json::Value = serde_json::from_str(&part).unwrap_or_default();
            part["content"]["lanes_redone_and_rechecked"] = 0.into();
            part["sha256"] = 0.into();
            return (code, err, Files::from([("part".to_owned(), part.to_string().into_bytes())]));
        }
        (code, err, if code == 0 { without_host(files(&dir.join(input.results))) } else { Files::new() })
    };
    let expected: Vec<_> = inputs.iter().map(outcome).collect();
    let mut codes: BTreeMap<i32, u64> = BTreeMap::new();
    for k in 0..count {
        let at = (k % inputs.len() as u64) as usize;
        let (input, random) = (&inputs[at], mixed(41, k));
        let (bytes, what) = changed(&whole[at], random);
        std::fs::write(dir.join(input.file), &bytes).unwrap();
        let (code, err, found) = outcome(input);
        let what = format!("change {k}: {what} in {}: {code} {err}", input.file);
        assert!([0, 2, 3].contains(&code), "{what}");
        assert!(code != 0 || (code, &found) == (expected[at].0, &expected[at].2), "{what}");
        *codes.entry(code).or_default() += 1;
        std::fs::write(dir.join(input.file), &whole[at]).unwrap();
    }
    println!("{count} changes, by exit status: {codes:?}");
}
