//! Any lane of a finished run, run again from the run's folder and the lane's key, is the run's lane: the same words.

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::lane_sets::swept_on_cpu;
use crate::common::mined::scenarios_of;
use crate::common::plans::mixed as drawn;
use crate::common::program::{json, ran};
use lanesweep::Place;
use lanesweep::engine::{LanePlan, LaneRunner, Wanted, words as bits};
use lanesweep::model::profile::Profile;
use lanesweep::run::parts::read_sealed_line;
use lanesweep::run::study::{StudyHead, StudyOptions, plan_study};

/// The plan that a study left in its folder, read as a process does that recomputes nothing.
fn left_plan(path: &Path) -> LanePlan {
    #[derive(serde::Deserialize)]
    struct File {
        plan: StudyHead,
    }
    let (file, _, mut records) = read_sealed_line::<File>("study plan", path, 1 << 26, "").unwrap();
    let study = file.plan.read(&mut records, &Place::file(path), |units| 0..units).unwrap();
    study.window(0..study.outline().unit_count()).unwrap()
}

#[test]
fn random_lanes_of_a_study_are_the_studys_lanes() {
    let dir = &*crate::common::folder();
    ran(dir, "-q study --synth-recordings 4 --backend cpu --out result");
    // The study itself, as it sweeps: in batches, on the widest instructions.
    let options = StudyOptions { folds: Some(5), ..StudyOptions::default() };
    let study = plan_study(scenarios_of(4), &Profile::load("paper").unwrap(), &options).unwrap();
    let outcomes = swept_on_cpu(&study, Wanted::Outcomes).outcomes;
    assert_eq!(outcomes.len() as u64, study.lane_count());
    // The reruns: from the folder.
    let plan = left_plan(&dir.join("result/run-plan.json"));
    assert_eq!(plan.hash(), study.hash());
    assert_eq!(json(&dir.join("result/run.json"))["plan_sha256"], plan.hash());
    let runner = LaneRunner::<f32>::new(&plan);
    let mut seen = BTreeSet::new();
    for index in 0..500 {
        let lane = drawn(157, index) % study.lane_count();
        let text = study.key_text(&study.key(lane).unwrap());
        let key = plan.parse_key(&text).unwrap();
        let trace = runner.trace(&key);
        assert_eq!(bits(&trace.outcome), bits(&outcomes[lane as usize]), "{text}");
        assert_eq!(trace.steps.len() as u64, u64::from(trace.outcome.end_step) + 1, "{text}");
        seen.insert(format!("category {}", key.block));
        seen.insert(format!("variant {} {}", key.block, key.variant));
        seen.insert(format!("headway {}", key.headway));
        seen.insert(format!("model {}", key.model));
    }
    let variants: usize = plan.blocks.iter().map(|block| block.variants.len()).sum();
    assert_eq!(seen.len(), plan.blocks.len() + variants + plan.headways.len() + plan.models.len(), "{seen:?}");
}
