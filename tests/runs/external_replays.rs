//! S' given as series: of other programs, and of decompositions fitted on other folds.

use lanesweep::scenario::{Category, read_scenario_file};
use lanesweep::support::plausibility::Implausible;

use crate::common::program::lanesweep;

#[test]
fn s_prime_of_other_programs_and_of_bases_of_other_folds_are_scored() {
    let dir = tempfile::tempdir().unwrap();
    let of = |name: &str| dir.path().join(name);
    let run = |args: &[&str]| {
        let (code, out, error) = lanesweep(dir.path(), args);
        assert_eq!(code, 0, "{args:?}: {error}");
        out
    };
    run(&["-q", "synth", "recordings", "--synth-recordings", "6"]);
    run(&["-q", "mine", "recordings", "--out", "scenarios.jsonl"]);
    let data = ["--scenarios", "scenarios.jsonl"];
    // S itself as S' of another program, in a file whose name is no key.
    std::fs::copy(of("scenarios.jsonl"), of("my same.v2.jsonl")).unwrap();
    let external = ["--cross-validate", "--external", "my same.v2.jsonl"];
    run(&[&["-q", "study", "--categories", "cut-in", "--out", "study"], &data[..], &external[..]].concat());
    let variants = std::fs::read_to_string(of("study/variants.csv")).unwrap();
    let row = |name: &str| variants.lines().find(|line| line.starts_with(&format!("cut-in,{name},"))).unwrap();
    assert_eq!(row("my-same-v2"), "cut-in,my-same-v2,0,1,1,1", "{variants}");
    row("5-cv");
    assert_eq!(std::fs::read_to_string(of("study/folds.csv")).unwrap().lines().next(), Some("scenario,fold"));
    #[cfg(feature = "parquet")]
    {
        run(&["-q", "mine", "recordings", "--out", "as-parquet.parquet"]);
        run(&[&["-q", "study", "--external", "as-parquet.parquet", "--out", "parquet"], &data[..]].concat());
        let variants = std::fs::read_to_string(of("parquet/variants.csv")).unwrap();
        assert!(variants.contains("LVD,as-parquet,0,1,1,1"), "{variants}");
    }
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
        let args = [&["-q", "study", "--external", name, "--out", "bad"], &data[..]].concat();
        let (code, _, error) = lanesweep(dir.path(), &args);
        assert!(code == 2 || code == 3, "{name}: {code} {error}");
        assert!(error.split_whitespace().collect::<Vec<_>>().join(" ").contains(says), "{name}: {error}");
    }
}
