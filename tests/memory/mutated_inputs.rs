//! Every reader of the library is given spoilt copies of valid inputs, and what it reads goes on to the next step: no panic,
//! at most 1 GiB and 5 s; a plan, part or journal is refused, or read as it was written. The full run:
//! `LANESWEEP_MUTATED_INPUTS=1000000 cargo test --release --test library mutated_inputs:: -- --nocapture`;
//! `LANESWEEP_MUTATED_FIRST=n LANESWEEP_MUTATED_INPUTS=1` repeats input `n` alone.

use crate::memory;
mod mutate;
mod readers;
mod seeds;
use crate::common::small;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex};
use std::time::{Duration, Instant};

use crate::common::dice::Dice;
use mutate::mutated;
use readers::Reader;
use seeds::Seeds;

static SEEDS: LazyLock<Seeds> = LazyLock::new(Seeds::make);

const QUICK: u64 = 1600;
const LONGEST: Duration = Duration::from_secs(5);
/// An input that takes this long hangs: the process ends.
const HANGS: Duration = Duration::from_secs(60);
/// One input in this many goes through the slow steps too.
const HEAVY_ONE_IN: usize = 16;

/// The bytes of an input, and whether it goes through the slow steps.
fn input(n: u64, reader: &Reader, others: &[Vec<u8>]) -> (Vec<u8>, bool) {
    let mut dice = Dice(n);
    let bytes = mutated(&mut dice, &reader.seeds, others);
    (bytes, dice.below(HEAVY_ONE_IN) == 0)
}

/// Runs input `n`; whether it was accepted, and what is wrong, if anything.
fn run_one(n: u64, reader: &Reader, others: &[Vec<u8>], seeds: &Seeds, dir: &Path) -> (bool, Option<String>) {
    memory::begin(n);
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| {
        let (bytes, heavy) = input(n, reader, others);
        (reader.read)(&bytes, dir, seeds, heavy)
    }));
    let took = start.elapsed();
    memory::end();
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
    let bad = bad.map(|what| {
        let (bytes, _) = input(n, reader, others);
        let kept = std::env::temp_dir().join(format!("lanesweep-mutated-{n}"));
        let _ = std::fs::write(&kept, bytes);
        format!("input {n}, {}: {what}; its bytes: {}", reader.name, kept.display())
    });
    (matches!(result, Ok(Ok(()))), bad)
}

thread_local! {
    /// Where the last panic of this thread was.
    static PANIC_AT: std::cell::RefCell<String> = const { std::cell::RefCell::new(String::new()) };
}

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).map_or(default, |text| text.parse().expect("a whole number"))
}

/// Every input from the first on, on all threads; how many each reader refused and accepted, and what went wrong.
fn run_all(first: u64, inputs: u64, readers: &[Reader], seeds: &Seeds) -> (Vec<[u64; 2]>, Vec<String>) {
    let others: Vec<Vec<u8>> = readers.iter().flat_map(|r| r.seeds.clone()).collect();
    let next = AtomicU64::new(first);
    let (counts, failures) = (Mutex::new(vec![[0; 2]; readers.len()]), Mutex::new(Vec::new()));
    // What each thread works on, and since when, for the one that looks for hangs.
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let working: Vec<Mutex<Option<(u64, Instant)>>> = (0..threads).map(|_| Mutex::new(None)).collect();
    let work = |now: &Mutex<Option<(u64, Instant)>>| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap();
        let dir = tempfile::tempdir().unwrap();
        loop {
            let n = next.fetch_add(1, Ordering::Relaxed);
            if n - first >= inputs || failures.lock().unwrap().len() > 200 {
                break;
            }
            *now.lock().unwrap() = Some((n, Instant::now()));
            let which = (n % readers.len() as u64) as usize;
            let (is_accepted, bad) = run_one(n, &readers[which], &others, seeds, dir.path());
            counts.lock().unwrap()[which][usize::from(is_accepted)] += 1;
            failures.lock().unwrap().extend(bad);
            *now.lock().unwrap() = None;
        }
        drop(pool);
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = working.iter().map(|now| scope.spawn(|| work(now))).collect();
        while threads.iter().any(|thread| !thread.is_finished()) {
            std::thread::sleep(Duration::from_millis(20));
            let hanging =
                |now: &Mutex<Option<(u64, Instant)>>| now.lock().unwrap().filter(|(_, since)| since.elapsed() > HANGS);
            if let Some((n, _)) = working.iter().find_map(hanging) {
                eprintln!("input {n} hangs");
                std::process::exit(101);
            }
        }
    });
    (counts.into_inner().unwrap(), failures.into_inner().unwrap())
}

#[test]
fn no_input_panics_or_takes_the_memory_or_hangs() {
    let seeds = &*SEEDS;
    let mut readers = readers::all(seeds);
    // Words in the names of the readers, separated by commas.
    if let Ok(words) = std::env::var("LANESWEEP_MUTATED_READERS") {
        readers.retain(|reader| words.split(',').any(|word| reader.name.contains(word)));
    }
    let dir = tempfile::tempdir().unwrap();
    for reader in &readers {
        for (k, seed) in reader.seeds.iter().enumerate() {
            let read = (reader.read)(seed, dir.path(), seeds, true);
            assert!(read.is_ok(), "seed {k} of {} is not valid: {}", reader.name, read.unwrap_err());
        }
    }
    let (first, inputs) = (number("LANESWEEP_MUTATED_FIRST", 0), number("LANESWEEP_MUTATED_INPUTS", QUICK));
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if !memory::is_counting() {
            return usual(info);
        }
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        PANIC_AT.with_borrow_mut(|at| *at = place);
    }));
    let (counts, failures) = run_all(first, inputs, &readers, seeds);
    let _ = std::panic::take_hook();
    for (reader, [refused, accepted]) in readers.iter().zip(&counts) {
        println!("{:<24} {accepted:>9} accepted {refused:>9} refused", reader.name);
    }
    assert!(failures.is_empty(), "{} inputs:\n{}", failures.len(), failures.join("\n"));
}

/// What was found once and stays refused: the text of a refusal must name the field or say what is expected.
#[test]
fn inputs_that_once_took_the_memory_or_panicked_are_refused_by_name() {
    let seeds = &*SEEDS;
    let dir = tempfile::tempdir().unwrap();
    let readers = readers::all(seeds);
    let refused = |name: &str, old: &str, new: &str, says: &str| {
        let reader = readers.iter().find(|r| r.name == name).unwrap();
        let seed = reader.seeds.iter().find(|s| String::from_utf8_lossy(s).contains(old)).expect(old);
        let bytes = String::from_utf8_lossy(seed).replacen(old, new, 1).into_bytes();
        let error = (reader.read)(&bytes, dir.path(), seeds, true).expect_err(new);
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
