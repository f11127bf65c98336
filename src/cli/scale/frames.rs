//! Native frames for cells that trace in place: made once for all cells of a particle count and an
//! encoding, one at a time, in a directory of ours beside the results, which is gone in the end. What a run
//! that was killed has left of it goes with the next run.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use spherule_jobs::Interrupt;

use super::measure::COMMAND;
use crate::cli::child::{self, ChildResult};
use crate::scale::report::Conversion;
use crate::scale::{CellRequest, Representation, Task};

/// Name of the directory.
const DIR: &str = ".scale-frames";
/// Name of the frame in it.
const FILE: &str = "particles.spf";

/// A native frame, and how it was made; or why there is none.
pub(super) type Made = Result<(PathBuf, Conversion), String>;

/// The frame that is there now.
pub(super) struct Frames {
    dir: PathBuf,
    now: Option<Now>,
}

struct Now {
    /// Particle count and representation.
    key: (usize, Representation),
    made: Made,
}

impl Frames {
    /// Clears away what an earlier run has left in `output`.
    pub(super) fn in_dir(output: &Path) -> Self {
        let dir = output.join(DIR);
        remove(&dir);
        Self { dir, now: None }
    }

    /// That of the cell of `request`, whose representation has one.
    pub(super) fn of(
        &mut self,
        request: &CellRequest,
        interrupt: &Interrupt,
    ) -> ChildResult<&Made> {
        let key = (request.particles, request.representation);
        let now = match self.now.take() {
            Some(now) if now.key == key => now,
            _ => {
                // First, so that there is never room for two needed.
                remove(&self.dir);
                match self.make(request, interrupt) {
                    ChildResult::Completed(made) => Now { key, made },
                    ChildResult::Crashed(crash) => Now {
                        key,
                        made: Err(crash.to_string()),
                    },
                    ChildResult::Interrupted => return ChildResult::Interrupted,
                }
            }
        };
        ChildResult::Completed(&self.now.insert(now).made)
    }

    fn make(&self, request: &CellRequest, interrupt: &Interrupt) -> ChildResult<Made> {
        if let Err(e) = fs::create_dir(&self.dir) {
            let dir = self.dir.display();
            return ChildResult::Completed(Err(format!("{dir}: {e}")));
        }
        let path = self.dir.join(FILE);
        let task = Task::Convert {
            request: request.clone(),
            path: path.clone(),
        };
        let ended: ChildResult<Result<_, String>> =
            child::run(COMMAND, &task, || interrupt.is_raised());
        match ended {
            ChildResult::Completed(made) => {
                ChildResult::Completed(made.map(|conversion| (path, conversion)))
            }
            ChildResult::Crashed(crash) => ChildResult::Completed(Err(crash.to_string())),
            ChildResult::Interrupted => ChildResult::Interrupted,
        }
    }
}

impl Drop for Frames {
    fn drop(&mut self) {
        remove(&self.dir);
    }
}

/// Removes `dir` with all that is in it, if it is there.
fn remove(dir: &Path) {
    match fs::remove_dir_all(dir) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => {
            note!("{}: cannot be removed: {e}", dir.display());
        }
        _ => {}
    }
}
