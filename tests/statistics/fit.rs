//! `lanesweep fit` as its users run it.

use lanesweep::stats::density::read_density;

use crate::common::program::ran;

const SMALL: &str = "--synth-recordings 3 --config generator.duration_s=200";

#[test]
fn recordings_their_scenario_file_and_the_generator_give_the_same_densities() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, &format!("-q tracks --convert data {SMALL}"));
    let wanted = "--parameterizations 2,e,i";
    let printed = ran(dir, &format!("-q fit --out a {wanted} {SMALL}"));
    ran(dir, &format!("-q fit data --out b --threads 1 {wanted}"));
    ran(dir, "-q mine data --out scenarios.jsonl");
    ran(dir, &format!("-q fit --scenarios scenarios.jsonl --out c --threads 3 {wanted}"));
    for word in ["SYNTHETIC DATA", "no number above is a statement about real traffic", "lateral_speed_mps", "P_valid"]
    {
        assert!(printed.contains(word), "{word}: {printed}");
    }
    for name in ["cut-in-2.json", "cut-out-e.json", "lvd-i.json"] {
        let [a, b, c] = ["a", "b", "c"].map(|out| std::fs::read(dir.join(out).join(name)).unwrap());
        assert!(a == b, "{name}: generated against written recordings");
        assert!(b == c, "{name}: recordings against the scenario file");
        let model = read_density(&dir.join("a").join(name)).unwrap();
        assert!(model.provenance.synthetic && model.provenance.data.contains("SYNTHETIC"));
        let exposure = model.exposure.expect("recordings tell what was driven");
        assert!(exposure.per_hour.is_some() && exposure.per_kilometre.is_some());
        assert_eq!(exposure.events, model.provenance.kept);
    }
}
