//! Disks that are full or read-only, made in a mount namespace of the test's own: they vanish with its processes.

use std::path::Path;
use std::process::{Command, Output};

use super::{RUNS, SAMPLE, STUDY, bench, same, shared};
use crate::common::program::{PROGRAM, ran, unbroken, words};
use crate::common::skipped;

/// Runs a shell script with an empty disk of its own at `$DISK`; `None` where this machine allows no mounts.
fn on_a_disk(bench: &Path, size: &str, script: &str, line: &str) -> Option<Output> {
    let disk = bench.join("disk");
    std::fs::create_dir_all(&disk).unwrap();
    let mount = format!("mount -t tmpfs -o size={size} none \"$DISK\" || exit 99\n");
    let run = |namespace: &str, script: &str| {
        let mut command = Command::new("unshare");
        command.args([namespace, "sh", "-c", script, PROGRAM]).args(words(line)).current_dir(bench);
        command.env("DISK", &disk).env("NO_COLOR", "1").output().ok()
    };
    // As root, or as whoever may be root of a namespace of their own.
    for namespace in ["-m", "-rm"] {
        if run(namespace, &mount).is_some_and(|output| output.status.success()) {
            return run(namespace, &format!("{mount}{script}"));
        }
    }
    skipped("needs `unshare -m` and `mount -t tmpfs` (root, or user namespaces)");
    None
}

fn lines(output: &Output) -> Vec<String> {
    String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect()
}

#[test]
fn a_disk_that_fills_up_is_told_and_the_same_command_ends_well_once_there_is_space() {
    let bench = bench();
    // The lock takes a page of 4 KiB: room for nothing else, for a bit of journal, for some results.
    let script = "\
        \"$0\" \"$@\" --out \"$DISK/out\" >/dev/null; echo full $?\n\
        ls -A \"$DISK/out\" | grep -c '^\\.lanesweep'\n\
        mount -o remount,size=64m \"$DISK\"\n\
        \"$0\" \"$@\" --out \"$DISK/out\" >/dev/null; echo freed $?\n\
        cp -r \"$DISK/out\" copy";
    let mut of_journals = 0;
    for (name, run) in RUNS {
        let whole = shared().join(name);
        for size in ["4k", "8k", "40k"] {
            let Some(output) = on_a_disk(&bench, size, script, run) else { return };
            let said = unbroken(&output.stderr);
            assert_eq!(lines(&output), ["full 6", "0", "freed 0"], "{name}, {size}: {said}");
            assert!(said.contains("No space left") && said.contains("the disk is full"), "{name}, {size}: {said}");
            of_journals += u32::from(said.contains(".journal") && said.contains("goes on from them"));
            same(&bench.join("copy"), &whole);
            std::fs::remove_dir_all(bench.join("copy")).unwrap();
        }
    }
    assert!(of_journals > 0, "no journal met the full disk");
}

#[test]
fn a_disk_that_becomes_read_only_keeps_what_is_done() {
    let bench = bench();
    let script = "\
        \"$0\" \"$@\" --out \"$DISK/out\" --config run.stop_after_s=0.3 >/dev/null; echo stopped $?\n\
        mount -o remount,ro \"$DISK\"\n\
        \"$0\" \"$@\" --out \"$DISK/out\" >/dev/null; echo kept $?\n\
        \"$0\" \"$@\" --out \"$DISK/new\" >/dev/null; echo new $?\n\
        mount -o remount,rw \"$DISK\"\n\
        \"$0\" \"$@\" --out \"$DISK/out\" >/dev/null; echo writable $?\n\
        cp -r \"$DISK/out\" copy";
    let Some(output) = on_a_disk(&bench, "64m", script, SAMPLE) else { return };
    let said = unbroken(&output.stderr);
    assert_eq!(lines(&output), ["stopped 75", "kept 6", "new 6", "writable 0"], "{said}");
    assert_eq!(said.matches("mounted read-only").count(), 2, "{said}");
    same(&bench.join("copy"), &shared().join("sample"));
}

#[test]
fn a_folder_without_permission_is_told_and_left_as_it_is() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let bench = bench();
    let out = bench.join("out");
    std::fs::create_dir(&out).unwrap();
    let mode = |path: &Path, mode| std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    mode(&bench, 0o755);
    mode(&out, 0o555);
    let is_root = std::fs::metadata(&*bench).unwrap().uid() == 0;
    let line = format!("{STUDY} --out out");
    let mut command = Command::new(if is_root { "setpriv" } else { PROGRAM });
    if is_root {
        // Permissions do not bind root.
        command.args(["--reuid=65534", "--regid=65534", "--clear-groups", PROGRAM]);
    }
    let Ok(output) = command.args(words(&line)).current_dir(&*bench).env("NO_COLOR", "1").output() else {
        return skipped("needs setpriv to be somebody else than root");
    };
    let said = unbroken(&output.stderr);
    if said.contains("setpriv:") {
        return skipped("setpriv cannot change the user here, or that user cannot reach the program");
    }
    assert_eq!(output.status.code(), Some(6), "{said}");
    assert!(said.contains("you have no permission") && said.contains("out"), "{said}");
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0);
    mode(&out, 0o755);
    ran(&bench, &line);
    same(&out, &shared().join("study"));
}
