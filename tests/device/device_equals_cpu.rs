//! Every output word of a device (here the software Vulkan) equals the CPU's, bit for bit; and a wrong shader is found.

use crate::common::device::{open, patched, tampered};
use crate::common::lane_sets::{
    assert_equal, assert_same_in_calls, forms, of_model, random, small_study, small_study_of, swept_on_cpu, thresholds,
};
use lanesweep::engine::gpu::{GpuOptions, Tampering};
use lanesweep::engine::verify::{Comparison, SetOptions, compare, random_plan, self_check};
use lanesweep::engine::{Backend, LanePlan};
use lanesweep::prelude::*;
use lanesweep::run::grid::{Grid, GridAxis, GridParts, GridPlan, MapParameter};

/// The regulation's distance between vehicles, at speeds of every part of its table.
fn at_the_minimum_following_distance() -> LanePlan {
    let axis = |text| GridAxis::parse(Category::CutIn, text, "axis").unwrap();
    let (x, y) = (axis("ego_speed_kmh=1..130/3"), axis("lateral_speed_mps=0.3..1.8/0.5"));
    let grid = Grid::new(GridParts {
        panel_axes: vec![axis("other_speed_kmh=0..40/20")],
        fixed: vec![(MapParameter::find(Category::CutIn, "gap_m", "test").unwrap(), 0.0)],
        ..GridParts::new("following", Category::CutIn, x, y)
    });
    let profile = Profile::load("un-r157").unwrap();
    let mut plan = GridPlan::new(grid.unwrap(), &profile, &ModelId::ALL).unwrap().parts.remove(0).plan;
    plan.headways = vec![Headway::MinFollowing];
    plan
}

#[test]
fn every_word_of_small_studies_of_every_kind_of_start_and_of_the_self_check_equals_the_cpus() {
    let Some(gpu) = open(GpuOptions::default()) else { return };
    assert!(gpu.is_exact());
    let observed = small_study_of(StudyOptions { headways: vec![Headway::Observed], ..StudyOptions::default() });
    for (what, plan) in
        [("study", small_study()), ("observed", observed), ("following", at_the_minimum_following_distance())]
    {
        assert_equal(what, &plan, &gpu);
    }
    let good = self_check(&gpu).unwrap();
    assert!(good.lanes > 8000 && good.differing == 0, "{good:?}");
}

#[test]
#[ignore = "minutes on a software device"]
fn lanes_are_equal_under_every_profile_and_form_of_every_option_and_at_other_time_steps() {
    let Some(gpu) = open(GpuOptions::default()) else { return };
    let shipped = Profile::names().map(|name| (Profile::load(name).unwrap(), 1000, 3));
    for (profile, lanes, units) in shipped.chain(forms().into_iter().map(|form| (form, 200, 1))) {
        let what = format!("{} {:?} {:?}", profile.name, profile.criteria, profile.frame);
        [random(&profile, lanes), thresholds(&profile, units)].iter().for_each(|plan| assert_equal(&what, plan, &gpu));
    }
}

/// Every pipeline takes its time to compile, and how lanes are divided is the same for all models.
fn of_two_models(size: u64) -> LanePlan {
    let options = SetOptions { size, models: vec![ModelId::Reg157, ModelId::Fsm], ..Default::default() };
    random_plan(&Profile::load("paper").unwrap(), &options).unwrap()
}

#[test]
fn the_cut_into_jobs_and_into_calls_changes_no_word() {
    let plan = of_two_models(600);
    let expected = swept_on_cpu(&plan, Wanted::Outcomes).outcomes;
    for first_lanes in [1, 77, 1 << 22] {
        let Some(gpu) = open(GpuOptions { first_lanes, ..Default::default() }) else { return };
        // Sizes that fit no word: 7 units are 280 lanes of each model.
        assert_same_in_calls(&plan, &gpu, 7, &expected, &format!("first job of {first_lanes} lanes"));
    }
}

#[test]
fn an_invocation_that_computes_many_lanes_writes_the_same_words() {
    // With more, llvmpipe ends the loop: there the first invocations take all lanes of a workgroup.
    for (lanes, size) in [(2, 7), (3, 3000)] {
        let lanes_per_invocation = Some(lanes);
        let options = GpuOptions { lanes_per_invocation, split_scenes: Some(true), ..Default::default() };
        let Some(gpu) = open(options) else { return };
        assert_equal(&format!("{lanes} lanes"), &of_two_models(size), &gpu);
    }
}

/// What `verify` says of the first of these sets for which it says this, on a device whose shaders have one text replaced.
fn found(from: &str, to: &str, sets: &[LanePlan], says: fn(&Comparison) -> bool) -> Option<Comparison> {
    let gpu = patched(from, to)?;
    let found = sets.iter().map(|plan| compare("set", plan, &gpu, |_| ()).unwrap()).find(says);
    Some(found.unwrap_or_else(|| panic!("{to} was not found")))
}

/// One step more delay, one unit in the last place of a constant, and steps that are skipped down to no gap at all.
#[test]
fn a_small_defect_of_a_shader_is_found_with_its_model() {
    let paper = Profile::load("paper").unwrap();
    let delay = "DriverState(driver_coasting, driver_delay_steps)";
    let sets = [random(&paper, 1000)];
    let longer = delay.replace("_steps", "_steps + 1u");
    let Some(of_delay) = found(delay, &longer, &sets, |of| !of.worst.is_empty()) else { return };
    assert!(of_delay.tallies.iter().all(|t| (t.words_differing > 0) == (t.model.name() == "CCHDM")), "{of_delay:?}");
    assert!(of_delay.tallies.iter().any(|t| t.verdicts_differing > 0));
    for (model, from, constant) in [
        // 1/12 in the Reg157 threshold.
        (ModelId::Reg157, "dv * driver_half_inverse_deceleration", "driver_half_inverse_deceleration"),
        (ModelId::Cchdm, "driver_ttc * closes", "driver_ttc"),
        (ModelId::Fsm, "v_ego * driver_tau", "driver_tau"),
        (ModelId::Rss, "v_ego * driver_response_time", "driver_response_time"),
        (ModelId::Reg157, "limit = criteria_ttc_threshold", "criteria_ttc_threshold"),
        (ModelId::Rss, "closing * btn_ramp_delay", "btn_ramp_delay"),
    ] {
        let to = from.replace(constant, &format!("bitcast<f32>(bitcast<u32>({constant}) + 1u)"));
        let [random, thresholds] = of_model(&paper, model, 4000);
        found(from, &to, &[thresholds, random], |of| !of.is_equal()).unwrap();
    }
    let is_told =
        |of: &Comparison| of.modes_differing + of.tallies.iter().map(|t| t.verdicts_differing).sum::<u64>() > 0;
    let sets = [thresholds(&paper, 8), random(&paper, 4000)];
    found("(next < lowest) | (next <= 0.0)", "(next <= 0.0)", &sets, is_told).unwrap();
}

/// A wrong value without a verdict is found in its own word, and in no other.
#[test]
fn one_wrong_value_without_a_verdict_is_found_under_its_name() {
    let plants = [
        ("measures.thw_gap = room;", "measures.thw_gap = room + room;", "min_thw"),
        ("let denominator = room + room;", "let denominator = room;", "max_drac"),
        ("before.tet_steps + 1u", "before.tet_steps + 2u", "tet_steps"),
        ("(criteria_tet_threshold - ttc)", "criteria_tet_threshold", "tit"),
        ("measures.pet_distance = gap;", "measures.pet_distance = gap + 1.0;", "pet"),
    ];
    for (from, to, name) in plants {
        let Some(gpu) = patched(from, to) else { return };
        let [plan, _] = of_model(&Profile::load("paper").unwrap(), ModelId::Fsm, 400);
        let found = compare("random", &plan, &gpu, |_| ()).unwrap();
        let is_named = found.worst.iter().all(|lane| lane.names() == [name]);
        assert!(found.worst.len() > 5 && is_named, "{to}: {:?}", found.worst);
        assert!(found.tallies.iter().all(|t| t.words_differing == t.lanes_differing && t.verdicts_differing == 0));
    }
}

#[test]
fn the_quick_self_check_finds_a_wrong_shader() {
    let Some(gpu) = patched("(v_ego - state.v_before)", "(state.v_before - v_ego)") else { return };
    assert!(self_check(&gpu).unwrap().differing > 0);
}

#[test]
fn a_device_that_leaves_lanes_out_is_an_error_and_no_result() {
    let Some(gpu) = patched("select(launch.lanes, ", "select(launch.lanes - 1u, ") else { return };
    let plan = random(&Profile::load("paper").unwrap(), 400);
    let error = gpu.prepare(&plan).unwrap().run(0..plan.unit_count(), Wanted::Verdicts).unwrap_err();
    assert!(error.to_string().contains("of 400 lanes") || error.to_string().contains("lanes of"), "{error}");
}

/// The plain path (naga's own module, as on Metal and DX12) may contract and reassociate: equality is not
/// promised there, and what the drivers at hand do is printed.
#[test]
fn the_self_check_finds_what_the_plain_path_changes() {
    let plain = Tampering { plain: true, ..Default::default() };
    let Some(gpu) = tampered(GpuOptions::default(), plain) else { return };
    assert!(!gpu.is_exact());
    let profile = Profile::load("paper").unwrap();
    let found = compare("random", &random(&profile, 2_000), &gpu, |_| ()).unwrap();
    let differing: u64 = found.tallies.iter().map(|t| t.lanes_differing).sum();
    let verdicts: u64 = found.tallies.iter().map(|t| t.verdicts_differing).sum();
    println!("{}: {differing} of {} lanes, {verdicts} verdict bits differ", gpu.describe(), found.lanes());
    // One lane in a thousand is enough for the self-check, which decides there.
    assert!(differing < found.lanes() / 1000 || self_check(&gpu).unwrap().differing > 0);
}
