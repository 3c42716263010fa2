//! Hostile and broken input: every reader of the library is given spoilt copies of valid inputs, and whatever it
//! reads goes through the next step. No input may cause a panic, hold more than 1 GiB, or take longer than 5 s.
//!
//! The default is a quick look. The full run:
//!
//! ```text
//! LANESWEEP_MUTATED_INPUTS=1000000 cargo test --release --test memory mutated_inputs:: -- --nocapture
//! ```
//!
//! Input `n` is the same in every run; `LANESWEEP_MUTATED_FIRST=n LANESWEEP_MUTATED_INPUTS=1` repeats it alone.
//! Inputs run side by side; each one's parallel loops stay on its thread, so that memory is counted per input.

use crate::memory;
mod mutate;
use crate::common::plans;
mod readers;
mod seeds;
use crate::common::small;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use mutate::{Dice, mutated};
use readers::Reader;
use seeds::Seeds;

/// Inputs of a quick run.
const QUICK: u64 = 600;
/// Longest time of one input.
const LONGEST: Duration = Duration::from_secs(5);
/// An input that takes this long hangs: the process ends.
const HANGS: Duration = Duration::from_secs(60);
/// One input in this many goes through the slow steps too.
const HEAVY_ONE_IN: usize = 16;

/// What happened to the inputs of one reader.
#[derive(Default, Clone)]
struct Count {
    accepted: u64,
    refused: u64,
    slowest: (Duration, u64),
    largest: (u64, u64),
}

/// What one thread works on, for the one that looks for hangs.
struct Watch {
    since_ms: AtomicU64,
    input: AtomicU64,
}

/// The bytes of an input, and whether it goes through the slow steps.
fn input(n: u64, reader: &Reader, others: &[Vec<u8>], dir: &Path, seeds: &Seeds) -> (Vec<u8>, bool) {
    let mut dice = Dice(n);
    let bytes = mutated(&mut dice, &reader.seeds, others);
    let reseal = reader.reseal.filter(|_| dice.below(4) != 0);
    let sealed = reseal.and_then(|reseal| reseal(&bytes, dir, seeds));
    (sealed.unwrap_or(bytes), dice.below(HEAVY_ONE_IN) == 0)
}

/// Runs input `n`; what is wrong, if anything.
fn run_one(
    n: u64,
    readers: &[Reader],
    others: &[Vec<u8>],
    seeds: &Seeds,
    dir: &Path,
    counts: &mut [Count],
) -> Option<String> {
    let which = (n % readers.len() as u64) as usize;
    let (reader, count) = (&readers[which], &mut counts[which]);
    memory::begin(n);
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| {
        let (bytes, heavy) = input(n, reader, others, dir, seeds);
        (reader.read)(&bytes, dir, seeds, heavy)
    }));
    let took = start.elapsed();
    let peak = memory::end();
    let bad = match &result {
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("?");
            Some(format!("panics: {text} ({})", PANIC_AT.with_borrow(String::clone)))
        }
        Ok(Err(error @ lanesweep::Error::Internal(_))) => Some(format!("is called a defect: {error}")),
        Ok(Err(error)) if error.help().is_none_or(|h| h.is_empty()) => Some(format!("has no help: {error}")),
        _ if took > LONGEST => Some(format!("takes {took:?}")),
        _ => None,
    };
    match result {
        Ok(Ok(())) => count.accepted += 1,
        _ => count.refused += 1,
    }
    count.slowest = count.slowest.max((took, n));
    count.largest = count.largest.max((peak, n));
    bad.map(|what| {
        let (bytes, _) = input(n, reader, others, dir, seeds);
        let kept = std::env::temp_dir().join(format!("lanesweep-mutated-{n}"));
        let _ = std::fs::write(&kept, bytes);
        format!("input {n}, {}: {what}; its bytes: {}", reader.name, kept.display())
    })
}

thread_local! {
    /// Where the last panic of this thread was.
    static PANIC_AT: std::cell::RefCell<String> = const { std::cell::RefCell::new(String::new()) };
}

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).map_or(default, |text| text.parse().expect("a whole number"))
}

/// Every input from the first on, on all threads; the counts per reader and what went wrong.
fn run_all(first: u64, inputs: u64, readers: &[Reader], seeds: &Seeds) -> (Vec<Count>, Vec<String>) {
    let others: Vec<Vec<u8>> = readers.iter().flat_map(|r| r.seeds.clone()).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let watches: Vec<Watch> =
        (0..threads).map(|_| Watch { since_ms: AtomicU64::new(u64::MAX), input: AtomicU64::new(0) }).collect();
    let (next, done) = (AtomicU64::new(first), AtomicU64::new(0));
    let (total, failures) = (Mutex::new(vec![Count::default(); readers.len()]), Mutex::new(Vec::new()));
    let start = Instant::now();
    let ms = || start.elapsed().as_millis() as u64;
    std::thread::scope(|scope| {
        for watch in &watches {
            let (others, next, done, total, failures) = (&others, &next, &done, &total, &failures);
            scope.spawn(move || {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
                let dir = tempfile::tempdir().unwrap();
                let mut counts = vec![Count::default(); readers.len()];
                loop {
                    let n = next.fetch_add(1, Ordering::Relaxed);
                    if n - first >= inputs || failures.lock().unwrap().len() > 200 {
                        break;
                    }
                    watch.input.store(n, Ordering::Relaxed);
                    watch.since_ms.store(ms(), Ordering::Relaxed);
                    let failure = run_one(n, readers, others, seeds, dir.path(), &mut counts);
                    failures.lock().unwrap().extend(failure);
                }
                watch.since_ms.store(u64::MAX, Ordering::Relaxed);
                for (sum, count) in total.lock().unwrap().iter_mut().zip(counts) {
                    sum.accepted += count.accepted;
                    sum.refused += count.refused;
                    sum.slowest = sum.slowest.max(count.slowest);
                    sum.largest = sum.largest.max(count.largest);
                }
                done.fetch_add(1, Ordering::Relaxed);
                drop(pool);
            });
        }
        while done.load(Ordering::Relaxed) < threads as u64 {
            std::thread::sleep(Duration::from_millis(20));
            for watch in &watches {
                let since = watch.since_ms.load(Ordering::Relaxed);
                if since != u64::MAX && ms().saturating_sub(since) > HANGS.as_millis() as u64 {
                    eprintln!("input {} hangs", watch.input.load(Ordering::Relaxed));
                    std::process::exit(101);
                }
            }
        }
    });
    (total.into_inner().unwrap(), failures.into_inner().unwrap())
}

#[test]
fn no_input_panics_or_takes_the_memory_or_hangs() {
    let seeds = Seeds::make();
    let mut readers = readers::all(&seeds);
    // Words in the names of the readers, separated by commas.
    if let Ok(words) = std::env::var("LANESWEEP_MUTATED_READERS") {
        readers.retain(|reader| words.split(',').any(|word| reader.name.contains(word)));
    }
    let dir = tempfile::tempdir().unwrap();
    for reader in &readers {
        for (k, seed) in reader.seeds.iter().enumerate() {
            let read = (reader.read)(seed, dir.path(), &seeds, true);
            assert!(read.is_ok(), "seed {k} of {} is not valid: {}", reader.name, read.unwrap_err());
        }
    }
    let (first, inputs) = (number("LANESWEEP_MUTATED_FIRST", 0), number("LANESWEEP_MUTATED_INPUTS", QUICK));
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        PANIC_AT.with_borrow_mut(|at| *at = place);
    }));
    let start = Instant::now();
    let (counts, failures) = run_all(first, inputs, &readers, &seeds);
    let _ = std::panic::take_hook();
    println!("reader                    accepted   refused   slowest ms (input)   largest KiB (input)");
    for (reader, c) in readers.iter().zip(&counts) {
        let (ms, kib) = (c.slowest.0.as_secs_f64() * 1e3, c.largest.0 >> 10);
        let (slow, large) = (c.slowest.1, c.largest.1);
        println!("{:<24} {:>9} {:>9} {ms:>10.1} ({slow}) {kib:>12} ({large})", reader.name, c.accepted, c.refused);
    }
    let total: u64 = counts.iter().map(|c| c.accepted + c.refused).sum();
    println!("{total} inputs in {:.1} s", start.elapsed().as_secs_f64());
    assert!(failures.is_empty(), "{} inputs:\n{}", failures.len(), failures.join("\n"));
}

/// What was found once and stays refused: the text of a refusal must name the field or say what is expected.
#[test]
fn inputs_that_once_took_the_memory_or_panicked_are_refused_by_name() {
    let seeds = Seeds::make();
    let dir = tempfile::tempdir().unwrap();
    let readers = readers::all(&seeds);
    let refused = |name: &str, old: &str, new: &str, says: &str| {
        let reader = readers.iter().find(|r| r.name == name).unwrap();
        let seed = reader.seeds.iter().find(|s| String::from_utf8_lossy(s).contains(old)).expect(old);
        let bytes = String::from_utf8_lossy(seed).replacen(old, new, 1).into_bytes();
        let bytes = reader.reseal.and_then(|reseal| reseal(&bytes, dir.path(), &seeds)).unwrap_or(bytes);
        let error = (reader.read)(&bytes, dir.path(), &seeds, true).expect_err(new);
        assert!(error.to_string().contains(says), "{name}, {new}: {error}");
        assert!(error.help().is_some_and(|h| !h.is_empty()), "{error}");
    };
    // A duration of 10^300 s; windows of 10^300 samples.
    refused("scenarios", "\"fps\":25.0", "\"fps\":1e-300", "fps");
    refused("mining options", "window_s = 1.0", "window_s = 1e300", "window_s");
    // Lengths of a density follow from its options.
    refused("density", "\"svd_instants\": 50", "\"svd_instants\": 9223372036854775808", "svd_instants");
    refused("density", "\"sinusoid_intervals\": 0", "\"sinusoid_intervals\": 4000000000", "sinusoid_intervals");
}

/// To open a pipe without a writer is to wait for ever.
#[cfg(unix)]
#[test]
fn a_pipe_in_place_of_a_recording_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let texts = small::Texts::small();
    std::fs::write(dir.path().join("01_tracksMeta.csv"), texts.tracks_meta).unwrap();
    std::fs::write(dir.path().join("01_recordingMeta.csv"), texts.recording_meta).unwrap();
    let pipe = dir.path().join("01_tracks.csv");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let error = lanesweep::traffic::mining::mine_folder(dir.path(), &Default::default(), Default::default(), || Ok(()))
        .unwrap_err();
    assert!(error.to_string().contains("expected a regular file"), "{error}");
    assert!(
        lanesweep::scenario::read_scenarios(&pipe).is_err() && lanesweep::stats::density::read_density(&pipe).is_err()
    );
}
