//! A second process of a benchmark: it does a piece of work whenever it is asked, and says what CPU time that took.
//! Threads of one process cannot be expected to lose less than two such processes do.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// The argument by which a benchmark knows that it is the second process.
pub const WORKER: &str = "worker";

/// Another process of this benchmark.
pub struct Worker {
    child: Child,
    /// Closed, it ends.
    questions: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Worker {
    /// Starts it, and waits until it is ready.
    pub fn start() -> Worker {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--bench", WORKER]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let (questions, answers) = (child.stdin.take(), BufReader::new(child.stdout.take().unwrap()));
        let mut worker = Worker { child, questions, answers };
        worker.answer();
        worker
    }

    /// Has it begin its work.
    pub fn ask(&mut self) {
        self.questions.as_mut().unwrap().write_all(b"\n").unwrap();
    }

    /// Waits for its end; CPU time that the work took, s.
    pub fn answer(&mut self) -> f64 {
        let mut line = String::new();
        self.answers.read_line(&mut line).unwrap();
        line.trim().parse().unwrap_or(f64::NAN)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.questions = None;
        let _ = self.child.wait();
    }
}

/// What the second process does: the work once, to be ready, then whenever it is asked.
pub fn serve(mut work: impl FnMut()) {
    let mut timed = || {
        let before = cpu_seconds().unwrap_or(f64::NAN);
        work();
        println!("{}", cpu_seconds().unwrap_or(f64::NAN) - before);
    };
    timed();
    for _ in std::io::stdin().lock().lines() {
        timed();
    }
}

/// Linux: CPU time of all threads of the process so far, s.
pub fn cpu_seconds() -> Option<f64> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?.flatten();
    let nanoseconds = |thread: std::fs::DirEntry| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    };
    Some(threads.filter_map(nanoseconds).sum::<f64>() * 1e-9)
}
