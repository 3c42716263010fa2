//! The scripts of `lanesweep cluster slurm`: valid shell whatever the paths hold, and saying what they must to Slurm.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

fn lanesweep(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lanesweep"));
    command.env("NO_COLOR", "1").current_dir(folder).args(args).output().unwrap()
}

fn said(bytes: &[u8]) -> String {
    // The drawing breaks long lines.
    String::from_utf8_lossy(bytes).split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

/// Array, merge and submit script in a folder, after the verb succeeded.
fn scripts(folder: &Path, out: &str, args: &[&str]) -> [(PathBuf, String); 3] {
    for study in ["study.toml", "s.toml"] {
        std::fs::write(folder.join(study), "").unwrap();
    }
    let written = lanesweep(folder, args);
    assert!(written.status.success(), "{}", said(&written.stderr));
    let stdout = String::from_utf8(written.stdout).unwrap();
    ["array.sbatch", "merge.sbatch", "submit.sh"].map(|name| {
        let path = folder.join(out).join("slurm").join(name);
        assert!(stdout.contains(&format!("{}: ", path.display())), "{stdout}");
        let text = std::fs::read_to_string(&path).unwrap();
        (path, text)
    })
}

/// A density of synthetic cut-ins.
fn density() -> &'static [u8] {
    static DENSITY: OnceLock<Vec<u8>> = OnceLock::new();
    DENSITY.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let fit = "-q fit --synth-recordings 3 --config generator.duration_s=300 --categories cut-in --parameterizations 2 \
                   --no-comparison --config fit.valid_draws=1000 --out d.json";
        let made = lanesweep(dir.path(), &fit.split_whitespace().collect::<Vec<_>>());
        assert!(made.status.success(), "{}", said(&made.stderr));
        std::fs::read(dir.path().join("d.json")).unwrap()
    })
}

fn has(text: &str, line: &str) {
    assert!(text.lines().any(|l| l == line), "no line `{line}` in\n{text}");
}

#[test]
fn the_scripts_ask_slurm_for_what_was_asked() {
    let dir = tempfile::tempdir().unwrap();
    let flags =
        ["--time", "1-12", "--gpus", "1", "--cpus", "4", "--mem", "8G", "--partition", "gpu", "--account", "a1"];
    let args = [
        &["cluster", "slurm", "study.toml", "--array", "20", "--out", "out", "--qos", "q", "--signal-before", "60"],
        &flags[..],
    ];
    let [array, merge, submit] = scripts(dir.path(), "out", &args.concat()).map(|(_, text)| text);
    let out = dir.path().join("out").display().to_string();
    for line in
        ["--time=1-12", "--cpus-per-task=4", "--mem=8G", "--partition=gpu", "--account=a1", "--qos=q", "--requeue"]
    {
        has(&array, &format!("#SBATCH {line}"));
        has(&merge, &format!("#SBATCH {line}"));
    }
    for line in ["--array=0-19", "--gres=gpu:1", "--signal=B:USR1@60", "--open-mode=append"] {
        has(&array, &format!("#SBATCH {line}"));
    }
    has(&array, &format!("#SBATCH --output={out}/slurm/%A_%a.log"));
    has(
        &array,
        &format!(
            "lanesweep study --plan {out}/plan.json --shard \"$SLURM_ARRAY_TASK_ID/20\" --out {out} --backend gpu \
             --threads 4 &"
        ),
    );
    assert!(array.contains("scontrol requeue \"$task\""));
    has(&merge, &format!("exec lanesweep cluster merge {out} --threads 4"));
    assert!(!merge.contains("gpu:1") && !merge.contains("--array"));
    has(&submit, &format!("lanesweep study --config study.toml --plan-only --out {out}"));
    has(&submit, &format!("array=$(sbatch --parsable {out}/slurm/array.sbatch)"));
    assert!(submit.contains("--dependency=\"afterok:$array\""));
}

#[test]
fn any_path_gives_valid_shell() {
    let dir = tempfile::tempdir().unwrap();
    for (k, out) in ["plain", "my runs", "it's", "a\"b", "$HOME", "50%", "`id`", "a;b&c", "#1"].iter().enumerate() {
        let program = format!("./{out}/lanesweep {k}");
        let run = ["--", "sample", "densities/cut in $1's.json", "--samples", "1000000000"];
        std::fs::create_dir_all(dir.path().join("densities")).unwrap();
        std::fs::write(dir.path().join(run[2]), density()).unwrap();
        let args = [&["cluster", "slurm", "--array", "3", "--program", &program, "--out", out], &run[..]].concat();
        for (path, _) in scripts(dir.path(), out, &args) {
            let parsed = Command::new("bash").arg("-n").arg(&path).output().unwrap();
            assert!(parsed.status.success(), "{}", said(&parsed.stderr));
            lint(&path);
        }
    }
}

/// By shellcheck, where it is installed.
fn lint(path: &Path) {
    match Command::new("shellcheck").arg("--severity=warning").arg(path).output() {
        Ok(lint) => assert!(lint.status.success(), "{}", String::from_utf8_lossy(&lint.stdout)),
        Err(_) => eprintln!("SKIPPED: shellcheck is not installed"),
    }
}

#[test]
fn submit_gives_the_program_the_arguments_as_typed() {
    let dir = tempfile::tempdir().unwrap();
    let echo = dir.path().join("echo args");
    std::fs::write(&echo, "#!/bin/sh\nfor a in \"$@\"; do echo \"<$a>\"; done\nexit 1\n").unwrap();
    std::fs::set_permissions(&echo, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let run = ["--", "sample", "it's $HOME \"x\".json", "--samples=5", "--thw", "1.2,0.4"];
    std::fs::write(dir.path().join(run[2]), density()).unwrap();
    let args = [&["cluster", "slurm", "--array", "3", "--program", "./echo args", "--out", "o"], &run[..]].concat();
    let [_, _, (submit, _)] = scripts(dir.path(), "o", &args);
    let ended = Command::new("bash").arg(submit).current_dir("/").output().unwrap();
    // The plan failed: nothing is submitted, and the status is the program's.
    assert_eq!(ended.status.code(), Some(1));
    let out = dir.path().join("o");
    let expected = format!(
        "<sample>\n<it's $HOME \"x\".json>\n<--samples=5>\n<--thw>\n<1.2,0.4>\n<--plan-only>\n<--out>\n<{}>\n",
        out.display()
    );
    assert_eq!(String::from_utf8(ended.stdout).unwrap(), expected);
}

/// The array script with a program in lanesweep's place: its exit status, and what it asked of `scontrol`.
fn task(program: &str, restarts: u32, signal: Option<&str>) -> (Option<i32>, String) {
    let dir = tempfile::tempdir().unwrap();
    let bin = dir.path().join("bin");
    std::fs::create_dir(&bin).unwrap();
    let requested = dir.path().join("asked");
    let ready = dir.path().join("ready");
    for (name, text) in [
        ("lanesweep", format!("#!/usr/bin/env bash\nready() {{ : >'{}'; }}\n{program}\n", ready.display())),
        ("scontrol", format!("#!/bin/sh\necho \"$@\" >>'{}'\n", requested.display())),
    ] {
        std::fs::write(bin.join(name), text).unwrap();
        std::fs::set_permissions(bin.join(name), std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    }
    let [(array, _), ..] = scripts(dir.path(), "o", &["cluster", "slurm", "s.toml", "--array", "3", "--out", "o"]);
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let mut shell = Command::new("bash");
    shell.arg(array).env("PATH", path).env("SLURM_ARRAY_JOB_ID", "7").env("SLURM_ARRAY_TASK_ID", "2");
    let mut child = shell.env("SLURM_RESTART_COUNT", restarts.to_string()).spawn().unwrap();
    if let Some(signal) = signal {
        while !ready.exists() {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    }
    let status = child.wait().unwrap().code();
    (status, std::fs::read_to_string(requested).unwrap_or_default())
}

/// As lanesweep: told to stop, it needs a moment, then ends with 75.
const STOPS_WHEN_TOLD: &str = "trap 'sleep 0.2; exit 75' TERM\nready\nwhile :; do sleep 0.05; done";

#[test]
fn a_task_goes_back_to_the_queue_when_it_can_continue_and_only_then() {
    let requeued = "requeue 7_2\n".to_owned();
    let nothing = String::new();
    assert_eq!(task("exit 0", 0, None), (Some(0), nothing.clone()));
    // Before the time limit.
    assert_eq!(task(STOPS_WHEN_TOLD, 0, Some("-USR1")), (Some(75), requeued.clone()));
    assert_eq!(task("exit 75", 50, None), (Some(75), requeued.clone()));
    // scancel must not bring it back.
    assert_eq!(task(STOPS_WHEN_TOLD, 0, Some("-TERM")), (Some(75), nothing.clone()));
    // A crash.
    assert_eq!(task("kill -KILL $$", 9, None), (Some(137), requeued));
    assert_eq!(task("kill -KILL $$", 10, None), (Some(137), nothing.clone()));
    // An error comes again however often it is tried.
    assert_eq!(task("exit 3", 0, None), (Some(3), nothing));
}

#[test]
fn what_cannot_work_is_refused_and_nothing_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let start = ["cluster", "slurm", "--array", "3", "--out", "o"];
    for (flags, message) in [
        (&["--", "sample", "a.json", "--shard", "0/3"][..], "--shard cannot be given after the `--`"),
        (&["--", "study", "--out=x"], "--out cannot be given"),
        (&["--", "study", "--plan", "p.json"], "--plan cannot be given"),
        (&["--", "study", "--plan-only"], "--plan-only cannot be given"),
        (&["--", "study", "--stop-after", "9"], "--stop-after cannot be given"),
        (&["--", "study", "--threads", "9"], "--cpus N"),
        (&["--", "study", "--backend", "cpu"], "--gpus 1"),
        (&["--", "fit"], "`fit` cannot be split over tasks"),
        (&["--", "sample", "a.json", "--sampels", "3"], "--sampels"),
        (&["--", "sample", "a\nb.json"], "line break"),
        (&["--time", "2h", "--", "study"], "--time: `2h` is no time limit"),
        (&["--mem", "lots", "--", "study"], "--mem: `lots`"),
        (&["--partition", "a b", "--", "study"], "--partition: `a b`"),
        (&["--account", "x\n#SBATCH --uid=0", "--", "study"], "--account"),
        (&["--gpus", "2", "--", "study"], "--gpus"),
        (&["--cpus", "0", "--", "study"], "--cpus: a task needs a processor"),
        (&["--signal-before", "0", "--", "study"], "--signal-before"),
        (&["s.toml", "--", "study"], "cannot be used with"),
        (&[], "required arguments"),
    ] {
        let refused = lanesweep(dir.path(), &[&start[..], flags].concat());
        assert_eq!(refused.status.code(), Some(2), "{flags:?}");
        let stderr = said(&refused.stderr);
        assert!(stderr.contains(message), "{flags:?}: {stderr}");
    }
    // A study file that is not there would be found missing by the cluster, after the queue.
    let missing = lanesweep(dir.path(), &[&start[..], &["s.toml"]].concat());
    assert!(missing.status.code() == Some(6) && said(&missing.stderr).contains("s.toml: cannot read"));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    std::fs::write(dir.path().join("s.toml"), "").unwrap();
    for tasks in ["0", "100000"] {
        assert_eq!(
            lanesweep(dir.path(), &["cluster", "slurm", "s.toml", "--array", tasks, "--out", "o"]).status.code(),
            Some(2)
        );
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn a_command_that_its_verb_refuses_is_refused_before_anything_is_written() {
    let dir = tempfile::tempdir().unwrap();
    for (name, content) in [
        ("broken.toml", &b"[score\n"[..]),
        ("wrong.toml", b"[score]\nleast_failurez = 5\n"),
        ("profile.toml", b"[run]\nprofile = \"papr\"\n"),
        ("scenarios.csv", b"category,ego_speed_kmh\nlvd,108\n"),
        ("d.json", density()),
    ] {
        std::fs::write(dir.path().join(name), content).unwrap();
    }
    let before = std::fs::read_dir(dir.path()).unwrap().count();
    let start = ["cluster", "slurm", "--array", "3", "--out", "o"];
    for (run, message) in [
        ("-- study --profile papr", "did you mean `paper`"),
        ("-- study --models XYZ", "--models: there is no driver model `XYZ`"),
        ("-- study --thw nonsense", "--thw: `nonsense` is not a time headway"),
        ("-- study --thw 1,1.0", "`1.0` repeats `1`"),
        ("-- study --categories cutin", "there is no category `cutin`"),
        ("-- study --dt 0", "--dt"),
        ("-- study --config score.seed=x", "`x` cannot be used"),
        ("-- study --rows lanes.csv", "--plan-only"),
        ("-- study --synth-recordings 0", "from 1 to 99"),
        ("-- study --scenarios scenarios.csv", "column `acceleration`: it is missing"),
        ("-- study --scenarios nothing.jsonl", "nothing.jsonl: cannot read"),
        ("-- study nothing", "nothing"),
        ("broken.toml", "broken.toml"),
        ("wrong.toml", "least_failurez"),
        ("profile.toml", "papr"),
        ("-- sample d.json --models XYZ", "--models: there is no driver model `XYZ`"),
        ("-- sample d.json --thw 0.6,0.6", "`0.6` is given twice"),
        ("-- sample d.json --given nothing=3", "nothing"),
        ("-- sample d.json --level 2", "--level"),
        ("-- sample nothing.json", "nothing.json: cannot read"),
        ("-- sample scenarios.csv", "scenarios.csv"),
    ] {
        let refused = lanesweep(dir.path(), &start.into_iter().chain(run.split(' ')).collect::<Vec<_>>());
        let stderr = said(&refused.stderr);
        assert!(refused.status.code().is_some_and(|code| [2, 3, 6].contains(&code)), "{run}: {stderr}");
        assert!(stderr.contains(message), "{run}: {stderr}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), before, "{run} wrote something");
    }
    let good = lanesweep(dir.path(), &start.into_iter().chain("-- sample d.json".split(' ')).collect::<Vec<_>>());
    assert!(good.status.success(), "{}", said(&good.stderr));
}
