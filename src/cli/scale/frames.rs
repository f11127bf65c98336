//! Native frames for cells that trace in place: one frame for all cells of a particle count and an encoding. There is
//! one frame at a time, in a temporary directory next to the results. The next run removes what a killed run left.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use spherule_jobs::Interrupt;

use super::measure::run_child;
use crate::job::ChildResult;
use crate::scale::report::Conversion;
use crate::scale::{CellRequest, Representation, Task};

/// Name of the directory.
const DIR: &str = ".scale-frames";
/// Name of the frame in it.
const FILE: &str = "particles.spf";

/// A native frame and the measurements of its conversion, or the error message of its process.
pub(super) type Made = Result<(PathBuf, Conversion), String>;

/// The current frame.
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
    /// Removes the temporary directory of an earlier run in `output`.
    pub(super) fn in_dir(output: &Path) -> Self {
        let dir = output.join(DIR);
        remove(&dir);
        Self { dir, now: None }
    }

    /// The frame for `request`, whose representation must have one.
    pub(super) fn of(
        &mut self,
        request: &CellRequest,
        interrupt: &Interrupt,
    ) -> ChildResult<&Made> {
        let key = (request.particles, request.representation);
        let now = match self.now.take() {
            Some(now) if now.key == key => now,
            _ => {
                // Remove the previous frame first, so that there is never more than one on the disk.
                remove(&self.dir);
                match self.make(request, interrupt) {
                    ChildResult::Completed(made) => Now { key, made },
                    ChildResult::Crashed(crash) => Now { key, made: Err(crash.to_string()) },
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
        let task = Task::Convert { request: request.clone(), path: path.clone() };
        let ended: ChildResult<Result<_, String>> = run_child(&task, || interrupt.is_raised());
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

/// Removes `dir` and its content, if it exists.
fn remove(dir: &Path) {
    match fs::remove_dir_all(dir) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => {
            note!("{}: cannot be removed: {e}", dir.display());
        }
        _ => {}
    }
}
