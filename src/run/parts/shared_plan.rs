//! The plan that all parts of a run share.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, Write};
use std::path::Path;

use lanesweep_support::files::write_inside;
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::{Error, Place, Result, input_file, option};

/// File name of the plan in a run's folder.
pub const PLAN_FILE: &str = "plan.json";

/// File name of the plan that a run in one piece leaves in its folder, so that its lanes can be rerun. It differs from
/// that of a run in parts, whose processes share their plan and hold no common lock.
pub const RUN_PLAN_FILE: &str = "run-plan.json";

/// Writes a plan into a run's folder, or checks that the same one exists; many shards may do so at once. The first line
/// of a plan identifies it and holds the checksums of the rest. A plan with the same first line and a different rest is
/// damaged and is rewritten. `write` writes the whole plan.
///
/// # Errors
/// [`Error::Input`] if the folder holds the plan of another run; [`Error::Io`].
pub(crate) fn leave_plan(out: &Path, line: &[u8], write: impl Fn(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let (_folder, path) = (RunFolder::share(out)?, out.join(PLAN_FILE));
    let io = |e| Error::io(&path, "read", e);
    match input_file::open(&path) {
        Ok(mut there) => {
            let mut begin = vec![0; line.len()];
            if there.read_exact(&mut begin).is_err() || begin != line {
                let help = format!(
                    "give another {}, or the flags that the plan was made with; or move the plan and \
                            its parts away",
                    option("out")
                );
                return Err(Error::input(Place::file(&path), "this folder holds the plan of another run", help));
            }
            there.rewind().map_err(io)?;
            let mut same = SameAs { file: BufReader::new(there), is_same: true };
            write(&mut same).map_err(io)?;
            if same.is_same && same.file.fill_buf().map_err(io)?.is_empty() {
                return Ok(());
            }
            tracing::warn!("{} was damaged: it is written again", path.display());
        }
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {}
        Err(e) => return Err(e),
    }
    write_inside(&path, write)
}

/// A writer that compares its input with a file.
struct SameAs {
    file: BufReader<File>,
    is_same: bool,
}

impl Write for SameAs {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut there = vec![0; bytes.len()];
        self.is_same &= self.file.read_exact(&mut there).is_ok() && there == bytes;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
