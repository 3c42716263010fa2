//! The program under test: runs of it, what is done to them while they are at work, and the results that they leave.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_lanesweep");

/// Longest wait for anything here; an unloaded machine needs a second or two.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Text without the drawing, which breaks long lines.
pub fn flat(text: &str) -> String {
    text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

/// The same where a name may be broken after a hyphen or a slash.
pub fn unbroken(text: &[u8]) -> String {
    flat(&String::from_utf8_lossy(text)).replace("- ", "-").replace("/ ", "/")
}

pub fn command(dir: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.env("NO_COLOR", "1").current_dir(dir).args(args);
    command
}

fn read(output: Output) -> (i32, String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// Runs the program in a folder: exit code, stdout, stderr.
pub fn lanesweep(dir: &Path, args: &[&str]) -> (i32, String, String) {
    read(command(dir, args).output().unwrap())
}

pub fn done(dir: &Path, args: &[&str]) -> String {
    let (code, out, err) = lanesweep(dir, args);
    assert_eq!(code, 0, "{args:?}: {err}");
    out
}

/// The same under limits that a shell sets, such as `ulimit -v 400000`. The environment counts as stack before the program
/// begins, and cargo's is large.
pub fn limited(dir: &Path, limits: &str, args: &[&str]) -> (i32, String, String) {
    let script = format!("{limits} && exec \"$0\" \"$@\"");
    let mut shell = Command::new("sh");
    shell.env_clear().env("PATH", std::env::var_os("PATH").unwrap_or_default()).env("NO_COLOR", "1");
    read(shell.current_dir(dir).args(["-c", &script, PROGRAM]).args(args).output().unwrap())
}

/// Starts the program in a folder; what it says is read at its end.
pub fn start(dir: &Path, args: &[&str]) -> Child {
    command(dir, args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Exit code and stderr of a run that ends within the patience of the tests.
pub fn ended(mut child: Child) -> (i32, String) {
    wait_until("the process ends", || child.try_wait().unwrap().is_some());
    let (code, _, err) = read(child.wait_with_output().unwrap());
    (code, err)
}

pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

pub fn wait_for_run(run: &mut Child, what: &str, mut is_so: impl FnMut() -> bool) {
    wait_until(what, || {
        assert!(run.try_wait().unwrap().is_none(), "{what}: the run ended before");
        is_so()
    });
}

/// Kills a run as a power cut would; tells whether it was still at work.
pub fn kill(mut run: Child) -> bool {
    let was_at_work = run.try_wait().unwrap().is_none();
    // Has no effect where it has ended already.
    run.kill().unwrap();
    run.wait().unwrap();
    was_at_work
}

pub fn send(signal: &str, pid: u32) {
    assert!(Command::new("kill").args([format!("-{signal}"), pid.to_string()]).status().unwrap().success());
}

/// Paths of all files below a folder, from it on; none where there is no folder.
pub fn names(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
    let name = |entry: std::fs::DirEntry| entry.file_name().into_string().unwrap();
    entries
        .flat_map(|entry| match entry.path().is_dir() {
            true => names(&entry.path())
                .into_iter()
                .map(|inner| format!("{}/{inner}", entry.file_name().display()))
                .collect(),
            false => vec![name(entry)],
        })
        .collect()
}

pub type Files = BTreeMap<String, Vec<u8>>;

pub fn files(dir: &Path) -> Files {
    names(dir).into_iter().map(|name| (name.clone(), std::fs::read(dir.join(name)).unwrap())).collect()
}

pub fn copy(from: &Path, to: &Path) {
    put(&files(from), to);
}

pub fn put(files: &Files, to: &Path) {
    for (name, content) in files {
        let to = to.join(name);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::write(to, content).unwrap();
    }
}

/// The page of a run but for what tells of the machine, which stands between two comments.
pub fn page_without_host(page: &str) -> String {
    let (before, rest) = page.split_once("<!-- host -->").expect("every page says what computed it");
    let (_, after) = rest.split_once("<!-- end of host -->").expect("and where that ends");
    [before, after].concat()
}

const RECORDS: [&str; 3] = ["run.json", "estimate.json", "map.json"];

fn settled(files: Files, record: &dyn Fn(&mut serde_json::Value), page: &dyn Fn(&str) -> String) -> Files {
    let settle = |(name, mut content): (String, Vec<u8>)| {
        if RECORDS.contains(&name.as_str()) {
            let mut value: serde_json::Value = serde_json::from_slice(&content).unwrap();
            record(&mut value);
            content = value.to_string().into_bytes();
        }
        if name == "lanesweep-files.json" {
            // Checksums of record and page follow their times.
            let mut list: serde_json::Value = serde_json::from_slice(&content).unwrap();
            list["files"].as_array_mut().unwrap().iter_mut().for_each(|file| file[1] = serde_json::Value::Null);
            content = list.to_string().into_bytes();
        }
        if name == "report.html" {
            content = page(&String::from_utf8(content).unwrap()).into_bytes();
        }
        (name, content)
    };
    files.into_iter().map(settle).collect()
}

/// Without the times of records and pages.
pub fn without_times(files: Files) -> Files {
    let record = |record: &mut serde_json::Value| {
        for checks in ["/sweep", "/host", "/host/sweep"] {
            for time in ["device_s", "seconds", "plan_s", "sweep_s"] {
                record.pointer_mut(checks).and_then(|checks| checks.as_object_mut()?.remove(time));
            }
        }
        for host in ["timings", "settings"] {
            record.as_object_mut().unwrap().remove(host);
        }
    };
    let page =
        |page: &str| page.lines().filter(|line| !line.contains("<dt>seconds</dt>")).collect::<Vec<_>>().join("\n");
    settled(files, &record, &page)
}

/// Without what belongs to the machine and to the way in which the run was divided.
pub fn without_host(mut files: Files) -> Files {
    let is_plan = |name: &str| ["plan.json", "run-plan.json", "lanesweep-files.json"].contains(&name);
    files.retain(|name, _| !(is_plan(name) || name.starts_with("part-") && name.ends_with(".json")));
    let record = |record: &mut serde_json::Value| {
        for host in ["timings", "backend", "device", "sweep", "host", "settings"] {
            record.as_object_mut().unwrap().remove(host);
        }
        // A run in one piece leaves its plan.
        if let Some(files) = record["files"].as_array_mut() {
            files.retain(|file| file != "run-plan.json");
        }
        if let Some(files) = record["files_sha256"].as_object_mut() {
            files.remove("run-plan.json");
        }
    };
    settled(files, &record, &page_without_host)
}

pub fn same(found: &Files, expected: &Files, what: &str) {
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{what}");
    for (name, content) in found {
        assert!(content == &expected[name], "{what}: {name} differs");
    }
}

pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Runs a command, as one line of words, to a good end; gives its stdout.
pub fn ran(dir: &Path, line: &str) -> String {
    done(dir, &words(line))
}

pub fn said(dir: &Path, line: &str) -> (i32, String) {
    let (code, _, err) = lanesweep(dir, &words(line));
    (code, unbroken(err.as_bytes()))
}

/// A command that ends with this exit code, prints no result, and says something.
pub fn refused(dir: &Path, line: &str, code: i32, hint: &str) {
    let (found, out, err) = lanesweep(dir, &words(line));
    let err = unbroken(err.as_bytes());
    assert!(found == code && out.is_empty() && err.contains(hint), "{line}: {found}, expected `{hint}`: {err}");
}

/// The rows of a CSV table by the names of its columns.
pub fn table(path: &Path) -> Vec<BTreeMap<String, String>> {
    csv::Reader::from_path(path).unwrap().deserialize().map(Result::unwrap).collect()
}

pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}
