//! The same lanes as plain Python, NumPy, numba and JAX compute them: leader decelerations and cut-outs of a study
//! of the paper's size, Reg157 and FSM, profile `paper`, one thread each.
//!
//! `cargo bench --bench peers` computes the lanes with the CPU backend, writes them to a temporary folder for
//! `benches/peers/run.py`, and makes the virtual environment with the pinned packages it needs. CSV rows go to
//! stdout, a table to stderr. With `-- --lanes FOLDER` the lanes stay there and no peer runs. What is compared and what is not: `benches/README.md`.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use common::{lane_steps, paper_size_scenarios};
use lanesweep::engine::{Backend, CpuBackend, Headway, Instructions, LaneCase, LanePlan, Outcome};
use lanesweep::engine::{Executor, Wanted};
use lanesweep::model::driver::{ModelId, NEVER};
use lanesweep::model::profile::Profile;
use lanesweep::run::study::{StudyOptions, plan_study};
use lanesweep::scenario::{Category, Motion, Scenario};

/// The smallest lanes, and those that most steps of a study are made for.
const CATEGORIES: [Category; 2] = [Category::Lvd, Category::CutOut];
const MODELS: [ModelId; 2] = [ModelId::Reg157, ModelId::Fsm];
const REPETITIONS: usize = 7;
/// Oldest Python that the pinned packages support.
const PYTHON: (u32, u32) = (3, 11);

fn main() {
    // `cargo test --benches` calls without `--bench`: nothing to time then.
    if !std::env::args().any(|arg| arg == "--bench") {
        return;
    }
    let scenarios = paper_size_scenarios();
    let profile = Profile::load("paper").unwrap();
    let temporary = tempfile::tempdir().unwrap();
    // Lanes for peers elsewhere, which do not run here.
    let kept = std::env::args().skip_while(|arg| arg != "--lanes").nth(1).map(PathBuf::from);
    let folder = kept.as_deref().unwrap_or(temporary.path());
    std::fs::create_dir_all(folder).unwrap();
    println!(
        "peer,category,model,lanes,lane_steps,seconds,lane_steps_per_s,ratio_to_ours,verdicts_differing,ends_differing"
    );
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for category in CATEGORIES {
        let folder = folder.join(category.key());
        std::fs::create_dir(&folder).unwrap();
        let of_category: Vec<Scenario> = scenarios.iter().filter(|s| s.category == category).cloned().collect();
        let measure = |model| one_thread.install(|| measure(&of_category, &profile, category, model, &folder));
        let ours: Vec<Measured> = MODELS.into_iter().map(measure).collect();
        write_manifest(&folder, &profile, category, &ours);
    }
    if kept.is_some() {
        return;
    }
    match python_with_packages() {
        Ok(python) => run_peers(&python, folder),
        Err(reason) => eprintln!("SKIPPED: the peers did not run, only ours did: {reason}"),
    }
}

/// One model's lanes on the CPU backend.
struct Measured {
    model: ModelId,
    lanes: usize,
    cases: usize,
    /// Length of the series.
    width: usize,
    seconds: f64,
    lane_steps_per_s: f64,
}

/// Times the sweep of one model's lanes, prints its row and writes its lanes.
fn measure(scenarios: &[Scenario], profile: &Profile, category: Category, model: ModelId, folder: &Path) -> Measured {
    let options = StudyOptions { categories: vec![category], models: vec![model], ..StudyOptions::default() };
    let plan = plan_study(scenarios, profile, &options).unwrap();
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
    let (lanes, name) = (outcomes.len(), format!("{},{}", category.key(), model.name()));
    println!("lanesweep,{name},{lanes},{steps},{seconds},{rate},1,0,0");
    eprintln!("{}, {name}: {seconds:.3} s, {:.2} M lane-steps/s", backend.describe(), rate / 1e6);
    // Beside it what it would be with every step made, as peers do, and on the instructions of smaller machines.
    let mut others = vec![("every step".to_owned(), CpuBackend::lane_arithmetic().every_step())];
    for set in Instructions::available().into_iter().filter(|set| *set != Instructions::best()) {
        others.push((set.to_string(), CpuBackend::with_instructions(set).unwrap()));
        if set != Instructions::Scalar {
            others.push((format!("{set} every step"), CpuBackend::with_instructions(set).unwrap().every_step()));
        }
    }
    for (what, backend) in others {
        let seconds = best(&backend);
        let slower = steps as f64 / seconds;
        println!("lanesweep {what},{name},{lanes},{steps},{seconds},{slower},{},0,0", rate / slower);
        eprintln!("{what}, {name}: {seconds:.3} s, {:.2} M lane-steps/s", slower / 1e6);
    }
    let (cases, width) = write_cases(folder, category, &plan);
    let verdicts: Vec<u8> = outcomes.iter().map(|o| o.verdicts.0).collect();
    std::fs::write(folder.join(format!("verdicts_{}.u8", model.name())), verdicts).unwrap();
    write_words(folder, &format!("end_step_{}.u32", model.name()), outcomes.iter().map(|o| o.end_step.to_le_bytes()));
    let keys: Vec<String> = (0..plan.lane_count()).map(|lane| plan.key_text(&plan.key(lane).unwrap())).collect();
    std::fs::write(folder.join(format!("keys_{}.txt", model.name())), keys.join("\n")).unwrap();
    Measured { model, lanes, cases, width, seconds, lane_steps_per_s: rate }
}

fn run(plan: &LanePlan, backend: &dyn Backend, wanted: Wanted) -> Vec<Outcome<f64>> {
    let mut outcomes = Vec::new();
    Executor::new(backend)
        .sweep(plan, 0..plan.unit_count(), wanted, |chunk| {
            outcomes.extend(std::hint::black_box(chunk).outcomes);
            Ok(())
        })
        .unwrap();
    outcomes
}

/// Writes what the lanes of a plan share per case, in the lane arithmetic: ego, horizon, the other vehicles at every
/// step. Gives the number of cases and of steps. Lane = case × headways + headway.
fn write_cases(folder: &Path, category: Category, plan: &LanePlan) -> (usize, usize) {
    let variants = plan.blocks[0].variants.len();
    let cases: Vec<LaneCase<f32>> = (0..plan.unit_count())
        .flat_map(|unit| (0..variants).map(move |variant| (unit, variant)))
        .map(|(unit, variant)| plan.case(0, unit, variant).cast())
        .collect();
    let tables = plan.tables().cast::<f32>();
    let width = cases.iter().map(|case| events(case, category)).max().unwrap_or(1).min(plan.profile.step_cap());
    write_words(folder, "horizon.u32", cases.iter().map(|c| c.horizon.to_le_bytes()));
    let per_case = |name: &str, number: fn(&LaneCase<f32>) -> f32| {
        write_words(folder, &format!("{name}.f32"), cases.iter().map(|c| number(c).to_le_bytes()));
    };
    let per_step = |name: &str, number: &dyn Fn(&Motion<f32>, u32) -> f32, vehicle: usize| {
        let of = |case: &LaneCase<f32>| (0..width).map(|i| number(&case.others[vehicle].motion, i)).collect::<Vec<_>>();
        write_words(folder, &format!("{name}.f32"), cases.iter().flat_map(of).map(f32::to_le_bytes));
    };
    // The vehicle that stays in the lane.
    let leader = usize::from(category == Category::CutOut);
    per_case("ego_speed", |c| c.ego_speed);
    per_case("leader_gap_offset", if leader == 1 { |c| c.others[1].gap_offset } else { |c| c.others[0].gap_offset });
    per_step("leader_speed", &|motion, i| motion.speed(&tables, i), leader);
    if category == Category::CutOut {
        per_case("ego_width", |c| c.ego_width);
        per_case("cutter_half_lengths", |c| c.others[0].half_lengths);
        per_case("cutter_half_widths", |c| c.others[0].half_widths);
        per_step("cutter_speed", &|motion, i| motion.speed(&tables, i), 0);
        per_step("cutter_lateral", &|motion, i| motion.lateral(&tables, i).position, 0);
        per_step("cutter_towards", &|motion, i| motion.lateral(&tables, i).towards, 0);
    }
    // What peers leave out: vehicles that come, go, are not judged or not seen from the start; a leader beside the lane.
    for case in &cases {
        assert_eq!(case.pair as usize, leader);
        for other in &case.others[..=leader] {
            assert!(other.judged == 1 && other.used == 1 && other.present_from == 0 && other.present_until == NEVER);
            assert!(MODELS.iter().all(|m| other.attend_from[m.index()] == 0));
        }
        let stays = &case.others[leader];
        assert!(stays.half_widths > 0.0 && (0..width).all(|i| stays.motion.lateral(&tables, i).position == 0.0));
        assert!(case.others[0].gap_offset == 0.0);
    }
    (cases.len(), width as usize)
}

/// Steps after which nothing changes any more.
fn events(case: &LaneCase<f32>, category: Category) -> u32 {
    let of = |motion: &Motion<f32>| {
        let until = motion.speed_until.max(motion.lateral_until).saturating_add(2);
        until.max(motion.speed_len).max(motion.lateral_len)
    };
    let ahead = if category == Category::CutOut { of(&case.others[1].motion) } else { 0 };
    of(&case.others[0].motion).max(ahead)
}

fn write_words(folder: &Path, name: &str, words: impl Iterator<Item = [u8; 4]>) {
    std::fs::write(folder.join(name), words.flatten().collect::<Vec<u8>>()).unwrap();
}

fn write_manifest(folder: &Path, profile: &Profile, category: Category, ours: &[Measured]) {
    let headways: Vec<f64> = Headway::paper()
        .iter()
        .map(|headway| match headway {
            Headway::ThwS(s) => *s,
            Headway::GapM(_) | Headway::MinFollowing | Headway::Observed => {
                unreachable!("the paper's headways are times")
            }
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
        "category": category.key(),
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
