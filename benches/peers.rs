//! The same lanes as plain Python, NumPy, numba and JAX compute them: leader decelerations of a study of the
//! paper's size, Reg157 and FSM, profile `paper`, one thread each.
//!
//! `cargo bench --bench peers` computes the lanes with the CPU backend, writes them to a temporary folder for
//! `benches/peers/run.py`, and makes the virtual environment with the pinned packages it needs. CSV rows go to
//! stdout, a table to stderr. What is compared and what is not: `benches/README.md`.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use common::{lane_steps, paper_size_scenarios};
use lanesweep::driver::ModelId;
use lanesweep::profile::Profile;
use lanesweep::scenario::{Category, Scenario};
use lanesweep::sweep::{Backend, CpuBackend, Headway, Instructions, LaneCase, LanePlan, Outcome, StudyOptions};
use lanesweep::sweep::{SweepOptions, Wanted, plan_study, sweep};

const MODELS: [ModelId; 2] = [ModelId::Reg157, ModelId::Fsm];
const REPETITIONS: usize = 7;
/// Oldest Python that the pinned packages support.
const PYTHON: (u32, u32) = (3, 11);

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    let mut scenarios = paper_size_scenarios();
    scenarios.retain(|s| s.category == Category::Lvd);
    let profile = Profile::load("paper").unwrap();
    let folder = tempfile::tempdir().unwrap();
    println!("peer,model,lanes,lane_steps,seconds,lane_steps_per_s,ratio_to_ours,verdicts_differing,ends_differing");
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let ours: Vec<Measured> = MODELS
        .into_iter()
        .map(|model| one_thread.install(|| measure(&scenarios, &profile, model, folder.path())))
        .collect();
    write_manifest(folder.path(), &profile, &ours);
    match python_with_packages() {
        Ok(python) => run_peers(&python, folder.path()),
        Err(reason) => eprintln!("SKIPPED: the peers did not run, only ours did: {reason}"),
    }
}

/// One model's lanes on the CPU backend.
struct Measured {
    model: ModelId,
    lanes: usize,
    cases: usize,
    /// Length of the leaders' speed series.
    width: usize,
    seconds: f64,
    lane_steps_per_s: f64,
}

/// Times the sweep of one model's lanes, prints its row and writes its lanes.
fn measure(scenarios: &[Scenario], profile: &Profile, model: ModelId, folder: &Path) -> Measured {
    let options = StudyOptions { categories: vec![Category::Lvd], models: vec![model], ..StudyOptions::default() };
    let plan = plan_study(scenarios, profile, &options).unwrap().plan;
    let backend = CpuBackend::lane_arithmetic();
    let best = |backend: &dyn Backend| {
        let once = || {
            let start = Instant::now();
            std::hint::black_box(run(&plan, backend, Wanted::Verdicts));
            start.elapsed().as_secs_f64()
        };
        (0..REPETITIONS).map(|_| once()).fold(f64::INFINITY, f64::min)
    };
    let seconds = best(&backend);
    let outcomes = run(&plan, &backend, Wanted::Outcomes);
    let steps = lane_steps(&plan, &backend);
    let rate = steps as f64 / seconds;
    println!("lanesweep,{},{},{steps},{seconds},{rate},1,0,0", model.name(), outcomes.len());
    eprintln!("{}, {}: {seconds:.3} s, {:.2} M lane-steps/s", backend.describe(), model.name(), rate / 1e6);
    // Beside the best instructions those of smaller machines.
    for set in Instructions::available().into_iter().filter(|set| *set != Instructions::best()) {
        let seconds = best(&CpuBackend::with_instructions(set).unwrap());
        let (lanes, slower) = (outcomes.len(), steps as f64 / seconds);
        println!("lanesweep {set},{},{lanes},{steps},{seconds},{slower},{},0,0", model.name(), rate / slower);
        eprintln!("{set}, {}: {seconds:.3} s, {:.2} M lane-steps/s", model.name(), slower / 1e6);
    }
    let (cases, width) = write_cases(folder, &plan);
    let verdicts: Vec<u8> = outcomes.iter().map(|o| o.verdicts.0).collect();
    std::fs::write(folder.join(format!("verdicts_{}.u8", model.name())), verdicts).unwrap();
    write_words(folder, &format!("end_step_{}.u32", model.name()), outcomes.iter().map(|o| o.end_step.to_le_bytes()));
    let keys: Vec<String> = (0..plan.lane_count()).map(|lane| plan.key_text(&plan.key(lane).unwrap())).collect();
    std::fs::write(folder.join(format!("keys_{}.txt", model.name())), keys.join("\n")).unwrap();
    Measured { model, lanes: outcomes.len(), cases, width, seconds, lane_steps_per_s: rate }
}

fn run(plan: &LanePlan, backend: &dyn Backend, wanted: Wanted) -> Vec<Outcome<f64>> {
    let mut outcomes = Vec::new();
    sweep(plan, 0..plan.unit_count(), backend, &SweepOptions::plain(wanted), |chunk| {
        outcomes.extend(std::hint::black_box(chunk).outcomes);
        Ok(())
    })
    .unwrap();
    outcomes
}

/// Writes what the lanes of a plan share per case: ego speed, horizon, the leader's speed at every step, in the
/// lane arithmetic. Gives the number of cases and of steps. Lane = case × headways + headway.
fn write_cases(folder: &Path, plan: &LanePlan) -> (usize, usize) {
    let variants = plan.blocks[0].variants.len();
    let cases: Vec<LaneCase<f32>> = (0..plan.unit_count())
        .flat_map(|unit| (0..variants).map(move |variant| (unit, variant)))
        .map(|(unit, variant)| plan.case(0, unit, variant).cast())
        .collect();
    let tables = plan.tables().cast::<f32>();
    let events = |case: &LaneCase<f32>| case.others[0].motion.speed_len.max(case.others[0].motion.speed_until + 2);
    let width = cases.iter().map(events).max().unwrap_or(1);
    // What peers leave out: a leader that is always ahead in the ego's lane, and seen from the start.
    for case in &cases {
        let other = &case.others[0];
        assert!(case.pair == 0 && other.judged == 1 && other.gap_offset == 0.0 && other.half_widths > 0.0);
        assert!(other.present_from == 0 && MODELS.iter().all(|m| other.attend_from[m.index()] == 0));
        assert!((0..width).all(|i| other.motion.lateral(&tables, i).position == 0.0));
    }
    write_words(folder, "ego_speed.f32", cases.iter().map(|c| c.ego_speed.to_le_bytes()));
    write_words(folder, "horizon.u32", cases.iter().map(|c| c.horizon.to_le_bytes()));
    let speeds = cases.iter().flat_map(|c| (0..width).map(|i| c.others[0].motion.speed(&tables, i).to_le_bytes()));
    write_words(folder, "leader_speed.f32", speeds);
    (cases.len(), width as usize)
}

fn write_words(folder: &Path, name: &str, words: impl Iterator<Item = [u8; 4]>) {
    std::fs::write(folder.join(name), words.flatten().collect::<Vec<u8>>()).unwrap();
}

fn write_manifest(folder: &Path, profile: &Profile, ours: &[Measured]) {
    let headways: Vec<f64> = Headway::paper()
        .iter()
        .map(|headway| match headway {
            Headway::ThwS(s) => *s,
            Headway::GapM(_) => unreachable!("the paper's headways are times"),
        })
        .collect();
    let models: Vec<_> = ours
        .iter()
        .map(|m| {
            assert_eq!(m.lanes, m.cases * headways.len());
            assert_eq!((m.cases, m.width), (ours[0].cases, ours[0].width), "all models have the same cases");
            serde_json::json!({
                "name": m.model.name(), "seconds": m.seconds, "lane_steps_per_s": m.lane_steps_per_s,
            })
        })
        .collect();
    let manifest = serde_json::json!({
        "cases": ours[0].cases,
        "width": ours[0].width,
        "headways_s": headways,
        "dt_s": profile.frame.dt_s,
        "step_cap": profile.frame.step_cap(),
        "models": models,
    });
    std::fs::write(folder.join("lanes.json"), manifest.to_string()).unwrap();
}

fn run_peers(python: &Path, folder: &Path) {
    let mut command = Command::new(python);
    // No compiled copies of the sources beside them.
    command.env("PYTHONDONTWRITEBYTECODE", "1").arg(benches().join("peers/run.py")).arg(folder);
    let status = command.status();
    match status {
        Ok(status) if status.success() => {}
        Ok(status) => {
            eprintln!("FAILED: benches/peers/run.py ended with {status}");
            std::process::exit(1);
        }
        Err(error) => eprintln!("SKIPPED: benches/peers/run.py could not be started: {error}"),
    }
}

fn benches() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches")
}

/// The Python of `target/peers-venv`, which holds exactly what `requirements.txt` pins; made where it is missing.
fn python_with_packages() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/peers-venv");
    let python = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    let requirements = benches().join("peers/requirements.txt");
    let wanted = std::fs::read(&requirements).map_err(|e| format!("{}: {e}", requirements.display()))?;
    // Copied there last: an interrupted installation has no copy and is made anew.
    let installed = folder.join("requirements.txt");
    if std::fs::read(&installed).is_ok_and(|have| have == wanted) && quiet(&python, &["--version"]).is_ok() {
        return Ok(python);
    }
    let system = if cfg!(windows) { "python" } else { "python3" };
    let (major, minor) = PYTHON;
    let recent = format!("import sys; sys.exit(sys.version_info < ({major}, {minor}))");
    quiet(Path::new(system), &["-c", &recent])
        .map_err(|e| format!("they need Python {major}.{minor} or later as `{system}`: {e}"))?;
    eprintln!("installing the pinned packages into target/peers-venv (once)");
    let path = |p: &Path| p.to_string_lossy().into_owned();
    quiet(Path::new(system), &["-m", "venv", "--clear", &path(&folder)])
        .map_err(|e| format!("no virtual environment (Debian: the package python3-venv): {e}"))?;
    quiet(&python, &["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r", &path(&requirements)])
        .map_err(|e| format!("the packages could not be installed (is PyPI reachable?): {e}"))?;
    std::fs::write(&installed, wanted).map_err(|e| format!("{}: {e}", installed.display()))?;
    Ok(python)
}

/// Runs a program without its standard output; what it says on standard error is shown.
fn quiet(program: &Path, arguments: &[&str]) -> Result<(), String> {
    let status = Command::new(program).args(arguments).stdout(Stdio::null()).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{} {}` ended with {status}", program.display(), arguments.join(" "))),
        Err(error) => Err(format!("`{}` could not be started: {error}", program.display())),
    }
}
