//! The library without the command line: mine, plan a study, run it on two threads of our own with progress and a time
//! limit, and take its lanes as columns. `cargo run --release --no-default-features --example library`

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use lanesweep::prelude::*;

/// One vector per column, a row per lane.
#[derive(Default)]
struct Columns {
    key: Vec<String>,
    collision: Vec<bool>,
    min_ttc_s: Vec<f64>,
    max_btn: Vec<f64>,
}

fn main() -> Result<()> {
    let recordings = GeneratorOptions { recordings: 1, duration_s: 120.0, ..GeneratorOptions::default() };
    let mined = mine_generated(&recordings, &MiningOptions::default(), || Ok(()))?;
    let study = Study::builder(&mined, Profile::load("paper")?).plan()?;

    let done = Arc::new(AtomicU64::new(0));
    let cancel = Cancel::default();
    cancel.stop_after(60.0);
    let executor = Executor::new(CpuBackend::lane_arithmetic()).with_cancel(cancel).with_progress({
        let done = done.clone();
        move |scenarios| _ = done.fetch_add(scenarios, Ordering::Relaxed)
    });
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");

    let columns = Mutex::new(Columns::default());
    let units = 0..study.plan().unit_count();
    let swept = pool.install(|| {
        study.cases().sweep(units, Wanted::Outcomes, &executor, |plan, chunk| {
            let mut columns = columns.lock().expect("one thread at a time");
            for (lane, outcome) in (chunk.first_lane..).zip(&chunk.outcomes) {
                columns.key.extend(plan.key(lane).map(|key| plan.key_text(&key)));
                columns.collision.push(outcome.verdicts.failed(Criterion::Collision));
                columns.min_ttc_s.push(outcome.min_ttc);
                columns.max_btn.push(outcome.max_btn);
            }
            Ok(())
        })
    })?;
    let columns = columns.into_inner().expect("nobody else holds it");
    assert_eq!(columns.key.len() as u64, swept.lanes);
    let collisions = columns.collision.iter().filter(|hit| **hit).count();
    let min_ttc_s = columns.min_ttc_s.iter().copied().fold(f64::INFINITY, f64::min);
    let largest_btn = columns.max_btn.iter().copied().filter(|btn| btn.is_finite()).fold(0.0, f64::max);
    println!("{} scenarios, {} lanes, {collisions} collisions", done.load(Ordering::Relaxed), swept.lanes);
    println!("smallest TTC {min_ttc_s:.2} s, largest finite BTN {largest_btn:.2}");

    let scores = study.score(&study.run(&executor)?.counts)?;
    for category in &scores.categories {
        let best = category.cells.iter().filter(|cell| cell.variant > 0).filter_map(|cell| f1(&cell.counts));
        println!("{}: best F1 {:.2}", category.category.label(), best.fold(0.0, f64::max));
    }
    Ok(())
}
