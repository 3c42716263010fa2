//! Sizes at which kernels break: more than 65,535 workgroups in one dispatch, more than 2²⁷ lanes in one run.

use std::sync::Arc;

use crate::common::device::open;
use crate::common::plans;
use lanesweep::engine::gpu::GpuOptions;
use lanesweep::engine::{CaseSource, LaneCase, LanePlan, Verdicts};
use lanesweep::prelude::*;
use lanesweep::scenario::Tables;

/// Cases whose vehicle stands in the ego's lane or far beside it.
struct Beside {
    inside: LaneCase<f64>,
    outside: LaneCase<f64>,
    tables: Tables<f64>,
}

/// Pseudo-random, and not in step with any power of two.
fn is_inside(unit: u64, variant: usize) -> bool {
    (unit * 2_654_435_761 + variant as u64 * 40_503) % 97 < 41
}

/// Likewise: does this headway start in contact?
fn touches(headway: usize) -> bool {
    headway * 31 % 13 < 5
}

impl CaseSource for Beside {
    fn case(&self, _: usize, unit: u64, variant: usize) -> LaneCase<f64> {
        if is_inside(unit, variant) { self.inside } else { self.outside }
    }
    fn tables(&self) -> &Tables<f64> {
        &self.tables
    }
}

/// A plan of so many units, of eight variants, from a thousand headways.
fn plan(units: usize) -> LanePlan {
    let profile = Profile::load("paper").unwrap();
    let mut tables = Tables::default();
    let [inside, outside] = [0.0, 9.0].map(|y_m| LaneCase::encode(&plans::beside(y_m), &profile, &mut tables));
    let source = Beside { inside, outside, tables };
    let blocks = vec![plans::block(Category::Lvd, units, &["1", "2", "3", "4", "5", "6", "7"])];
    // Each once: 1 m of overlap or 5 m of gap, and a tenth of a millimetre more for each.
    let gap_m = |h: usize| if touches(h) { -1.0 } else { 5.0 } + 1e-4 * h as f64;
    let headways = (0..1000).map(|h| Headway::GapM(gap_m(h))).collect();
    LanePlan::new(profile, ModelId::ALL.to_vec(), headways, blocks, Arc::new(source)).unwrap()
}

fn expected(plan: &LanePlan, lane: u64) -> Verdicts {
    let key = plan.key(lane).unwrap();
    let collides = is_inside(key.unit, key.variant) && touches(key.headway);
    // A contact fails BTN too; nobody closes in, so TTC never fails.
    Verdicts(if collides { 1 << Criterion::Collision.index() | 1 << Criterion::Btn.index() } else { 0 })
}

fn assert_every_lane(plan: &LanePlan, first_lanes: u64) {
    let Some(gpu) = open(GpuOptions { first_lanes, ..Default::default() }) else { return };
    let mut lane = 0;
    let all = 0..plan.unit_count();
    let summary = Executor::new(&gpu).sweep(plan, all.clone(), Wanted::Verdicts, |chunk| {
        assert_eq!(chunk.first_lane, lane);
        for verdicts in chunk.verdicts {
            assert_eq!(verdicts, expected(plan, lane), "lane {lane}");
            lane += 1;
        }
        Ok(())
    });
    assert_eq!((lane, summary.unwrap().lanes), (plan.lane_count(), plan.lane_count()));
}

#[test]
fn one_dispatch_reaches_beyond_65535_workgroups() {
    // 4.8 million lanes of each model: 75,000 workgroups of 64 in one job.
    let plan = plan(600);
    assert!(plan.lane_count() / 4 / 64 > 65_535);
    assert_every_lane(&plan, 1 << 23);
}

/// `cargo test --release --test commands device_size:: -- --ignored`
#[test]
#[ignore = "135 million lanes take about a minute on a software device"]
fn one_run_reaches_beyond_two_to_the_27_lanes() {
    let plan = plan(4_200);
    assert!(plan.lane_count() > 1 << 27);
    assert_every_lane(&plan, 1 << 14);
}
