//! Files that runs leave and read again, changed at random: refused, or of no effect. With a checksum made anew counts may
//! be other counts, but never a defect of the program. 60 changes by default; the long form is
//! `LANESWEEP_MUTATED_INPUTS=2000 cargo test --release --test runs mutations:: -- --nocapture`.

use std::collections::BTreeMap;
use std::path::Path;

use super::parts::{SAMPLE, STUDY, density, weighted};
use crate::common::plans::mixed;
use crate::common::program::{Files, done, files, flat, lanesweep, without_host};
use lanesweep::run::parts::seal;
use sha2::{Digest, Sha256};

/// A file that is changed, and the command that reads it; the results lie in the folder.
struct Input {
    file: &'static str,
    reader: Vec<&'static str>,
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
            let lines: Vec<&[u8]> = whole.split_inclusive(|byte| *byte == b'\n').collect();
            let (a, b) = ((random >> 16) as usize % lines.len(), (random >> 32) as usize % lines.len());
            let mut lines = lines;
            lines.swap(a, b);
            bytes = lines.concat();
            "two lines exchanged"
        }
    };
    (bytes, what)
}

/// A sealed part, or every line of a journal, with its checksum made anew; `None` where it is no JSON any more.
fn resealed(file: &str, bytes: &[u8]) -> Option<Vec<u8>> {
    if file.ends_with(".journal") {
        let line = |line: &[u8]| {
            let body = line.get(65..)?.strip_suffix(b"\n")?;
            let sum: String = Sha256::digest(body).iter().map(|byte| format!("{byte:02x}")).collect();
            Some([sum.as_bytes(), b" ", body, b"\n"].concat())
        };
        return bytes.split_inclusive(|byte| *byte == b'\n').map(line).collect::<Option<Vec<_>>>().map(|l| l.concat());
    }
    let sealed: serde_json::Value = serde_json::from_slice(bytes).ok()?;
    Some(seal(sealed["lanesweep"].as_str()?, &sealed["content"]).ok()?.0)
}

#[test]
fn changed_files_of_a_run_are_refused_or_have_no_effect() {
    let count: u64 = std::env::var("LANESWEEP_MUTATED_INPUTS").map_or(60, |text| text.parse().unwrap());
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let weighted = weighted(dir);
    for (run, name) in [(&STUDY[..], "study"), (&SAMPLE, "sample"), (&weighted, "is")] {
        for shard in ["0/2", "1/2"] {
            done(dir, &[run, &["--shard", shard, "--out", name]].concat());
        }
    }
    done(dir, &[&SAMPLE[..], &["--worst", "3", "--out", "worst"]].concat());
    // A journal of a shard: a part's segments as its records.
    let part: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("sample/part-00000-of-00002.json")).unwrap()).unwrap();
    let (content, engine) = (&part["content"], &part["engine"]);
    let head = serde_json::json!({
        "lanesweep_journal": 3, "engine": engine, "run_sha256": content["run_sha256"], "units": content["units"],
    });
    let records = content["segments"].as_array().unwrap().iter().take(2);
    let records = records.map(|segment| serde_json::json!({"counts": segment, "redone_and_rechecked": [0, 0]}));
    let lines: Vec<u8> =
        std::iter::once(head).chain(records).flat_map(|line| format!("{:64} {line}\n", "").into_bytes()).collect();
    std::fs::create_dir(dir.join("journal")).unwrap();
    let journal = "journal/part-00000-of-00002.journal";
    std::fs::write(dir.join(journal), resealed(journal, &lines).unwrap()).unwrap();

    let merge = |results| vec!["-q", "cluster", "merge", results];
    let sample = ["-q", "sample", "densities/cut-in-2.json", "--samples", "200", "--thw", "0.6", "--backend", "cpu"];
    let inputs = [
        Input { file: "study/plan.json", reader: merge("study"), results: "study" },
        Input { file: "study/part-00000-of-00002.json", reader: merge("study"), results: "study" },
        Input { file: "sample/plan.json", reader: merge("sample"), results: "sample" },
        Input { file: "sample/part-00001-of-00002.json", reader: merge("sample"), results: "sample" },
        Input { file: "is/plan.json", reader: merge("is"), results: "is" },
        Input { file: "is/part-00000-of-00002.json", reader: merge("is"), results: "is" },
        Input { file: "densities/cut-in-2.json", reader: [&sample[..], &["--out", "few"]].concat(), results: "few" },
        Input {
            file: "worst/worst.csv",
            reader: vec!["-q", "export", "xosc", "--from", "worst", "--worst", "2", "--models", "FSM", "--out", "xosc"],
            results: "xosc",
        },
        Input {
            file: journal,
            reader: [&SAMPLE[..], &["--shard", "0/2", "--out", "journal"]].concat(),
            results: "journal",
        },
    ];
    let whole: Vec<Vec<u8>> = inputs.iter().map(|input| std::fs::read(dir.join(input.file)).unwrap()).collect();
    let outcome = |input: &Input| {
        let (code, _, err) = lanesweep(dir, &input.reader);
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
    let mut codes: BTreeMap<(bool, i32), u64> = BTreeMap::new();
    for k in 0..count {
        let at = (k % inputs.len() as u64) as usize;
        let (input, random) = (&inputs[at], mixed(41, k));
        let (bytes, what) = changed(&whole[at], random);
        let can_seal = input.file.contains("part-");
        let sealed = (can_seal && random >> 63 == 1).then(|| resealed(input.file, &bytes)).flatten();
        let is_sealed = sealed.is_some();
        write(&dir.join(input.file), &sealed.unwrap_or(bytes));
        let (code, err, found) = outcome(input);
        let what = format!("change {k}: {what} in {}, sealed anew: {is_sealed}: {code} {err}", input.file);
        assert!([0, 2, 3].contains(&code), "{what}");
        assert!(code != 0 || is_sealed || (code, &found) == (expected[at].0, &expected[at].2), "{what}");
        *codes.entry((is_sealed, code)).or_default() += 1;
        write(&dir.join(input.file), &whole[at]);
    }
    println!("{count} changes, by (sealed anew, exit status): {codes:?}");
}

fn write(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).unwrap();
}

/// A checksum can be made anew: what a part counts must still be of its run.
#[test]
fn a_resealed_part_with_counts_of_another_run_is_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    density(dir);
    let is = weighted(dir);
    type Change = fn(&mut serde_json::Value);
    type Changes<'c> = &'c [(&'c str, Change)];
    let of_study: [(&str, Change); 2] = [
        ("belong to plan", |part| part["segments"][0]["plan_hash"] = "00".into()),
        ("do not fit", |part| part["segments"][0]["units"][0]["capped"] = serde_json::json!([0])),
    ];
    let of_sample: [(&str, Change); 3] = [
        ("worst lane", |part| part["segments"][0]["worst"][0][0]["lane"] = 123_456_789_012_u64.into()),
        ("other models or headways", |part| {
            for (key, count) in [("failures", 3), ("squares", 3), ("capped", 1), ("worst", 1)] {
                part["segments"][0][key].as_array_mut().unwrap().truncate(count);
            }
            part["segments"][0]["close_failures"] = serde_json::json!([0, 0, 0]);
            part["segments"][0]["by_kernel"] = serde_json::Value::Null;
            part["segments"][0]["worst"] = serde_json::json!([[]]);
            part["segments"][0]["map"] = serde_json::Value::Null;
        }),
        ("belongs to plan", |part| part["segments"][0]["plan_sha256"] = "00".into()),
    ];
    let of_is: [(&str, Change); 1] = [("other questions", |part| {
        part["segments"][0]["sums"].as_array_mut().unwrap().truncate(1);
    })];
    let runs: [(&[&str], &str, Changes); 3] =
        [(&STUDY, "study", &of_study), (&SAMPLE, "sample", &of_sample), (&is, "is", &of_is)];
    for (run, name, changes) in runs {
        for shard in ["0/2", "1/2"] {
            done(dir, &[run, &["--shard", shard, "--out", name]].concat());
        }
        let path = dir.join(name).join("part-00000-of-00002.json");
        let whole = std::fs::read(&path).unwrap();
        for (said, change) in changes {
            let mut sealed: serde_json::Value = serde_json::from_slice(&whole).unwrap();
            change(&mut sealed["content"]);
            std::fs::write(&path, seal("part", &sealed["content"]).unwrap().0).unwrap();
            let (code, _, err) = lanesweep(dir, &["-q", "cluster", "merge", name]);
            let err = flat(&err);
            assert!(
                code == 3 && err.contains("part-00000-of-00002.json") && err.contains(said),
                "{said}: {code} {err}"
            );
        }
        std::fs::write(&path, &whole).unwrap();
        done(dir, &["-q", "cluster", "merge", name]);
    }
}
