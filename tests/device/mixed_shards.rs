//! Shards that ran on different backends, in any order, join to the run in one piece, byte for byte.

use crate::common::device::software_device;
use crate::common::mined::write_cut_in_density;
use crate::common::program::{files, ran, same, without_host};

/// Every run that can be split, in one piece and in so many shards, of which every other one is the device's.
fn whole_and_shards(counts: &[u64]) {
    let Some((_, device)) = software_device() else { return };
    let dir = &*crate::common::folder();
    write_cut_in_density(&dir.join("density.json"));
    let sample = "sample density.json --samples 9000 --thw 0.4 --models FSM,RSS";
    ran(dir, &format!("-q {sample} --estimator is --backend cpu --out pilot"));
    let weighted = format!("{sample} --estimator is --proposal pilot/proposal.json");
    let study = "study --synth-recordings 2 --config generator.duration_s=240 --models CCHDM,RSS";
    for (name, run) in [("study", study), ("crude", sample), ("weighted", &weighted)] {
        let verb = run.split(' ').next().unwrap();
        let whole = ran(dir, &format!("-q {run} --backend cpu --out {name}"));
        for &count in counts {
            let out = format!("{name}-{count}");
            ran(dir, &format!("-q {run} --backend cpu --plan-only --out {out}"));
            // 37 has no factor in common with the counts: every shard comes once, in no natural order.
            for shard in (0..count).map(|k| (k * 37 + 3) % count) {
                let gpu = format!("gpu --device {device}");
                let backend = if (shard + count).is_multiple_of(2) { &gpu } else { "cpu" };
                let part = format!("--plan {out}/plan.json --shard {shard}/{count} --out {out}");
                ran(dir, &format!("-q {verb} {part} --backend {backend}"));
            }
            assert_eq!(ran(dir, &format!("-q merge {out}")), whole, "{out}");
            let [merged, expected] = [&*out, name].map(|folder| without_host(files(&dir.join(folder))));
            same(&merged, &expected, &out);
        }
    }
}

#[test]
fn four_shards_on_two_backends_are_the_run_in_one_piece() {
    whole_and_shards(&[4]);
}

#[test]
#[ignore = "minutes; run it with --ignored"]
fn one_seven_and_a_hundred_shards_on_two_backends_are_the_run_in_one_piece() {
    whole_and_shards(&[1, 7, 100]);
}
