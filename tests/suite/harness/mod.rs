//! Running the program in a directory of its own and looking at what it left.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

mod frames;
mod outputs;
mod running;

pub(crate) use frames::{dam_break, npy};
pub(crate) use outputs::{
    files, images, ledger, ledger_path, ledger_paths, natives, no_leftovers, stamps,
};
pub(crate) use running::Running;

/// Images that take a few milliseconds.
pub(crate) const SMALL: [&str; 6] = ["--width", "64", "--height", "36", "--samples", "1"];

/// The same for jobs in whose tests light does not matter: that of a studio takes longer than such an image.
pub(crate) const JOB: [&str; 8] =
    [SMALL[0], SMALL[1], SMALL[2], SMALL[3], SMALL[4], SMALL[5], "--integrator", "whitted"];

/// A directory for one test, and the program to run in it.
pub(crate) struct Workshop {
    dir: TempDir,
}

impl Workshop {
    /// An empty directory.
    pub(crate) fn new() -> Self {
        Self { dir: tempfile::tempdir().expect("a temporary directory") }
    }

    /// Its path.
    pub(crate) fn path(&self) -> &Path {
        self.dir.path()
    }

    /// A path in it.
    pub(crate) fn join(&self, name: impl AsRef<Path>) -> PathBuf {
        self.dir.path().join(name)
    }

    /// The program, not yet started, in the directory.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_spherule"));
        command.current_dir(self.path()).args(arguments);
        command
    }

    /// Runs the program to its end.
    pub(crate) fn run(&self, arguments: &[&str]) -> Ran {
        Ran(self.command(arguments).output().expect("the program starts"))
    }

    /// Renders `in` to small images in `out`, with these options.
    pub(crate) fn render(&self, options: &[&str]) -> Ran {
        self.render_to("out", options)
    }

    /// Renders `in` to small images in another directory.
    pub(crate) fn render_to(&self, out: &str, options: &[&str]) -> Ran {
        let pattern = format!("{out}/f.####.exr");
        // Who chooses what renders gets just that
        let choices = ["--integrator", "--look", "--device", "--gpu"];
        let is_choice = |option: &&str| choices.iter().any(|choice| option.starts_with(choice));
        let images = if options.iter().any(is_choice) { &SMALL[..] } else { &JOB };
        let arguments = [&["render", "in", "-o", &pattern][..], images, options].concat();
        self.run(&arguments)
    }

    /// What the job in the directory `out` wrote of itself: `report.json`.
    #[track_caller]
    pub(crate) fn report(&self, out: &str) -> Value {
        let bytes = fs::read(self.join(out).join("report.json")).expect("a report");
        serde_json::from_slice(&bytes).expect("JSON")
    }

    /// Starts the program and leaves it running.
    pub(crate) fn start(&self, arguments: &[&str]) -> Running {
        Running::new(self.command(arguments))
    }
}

/// What a run left.
pub(crate) struct Ran(pub(crate) Output);

impl Ran {
    /// The exit code; None if a signal ended it.
    pub(crate) fn code(&self) -> Option<i32> {
        self.0.status.code()
    }

    /// Standard error as text.
    pub(crate) fn errors(&self) -> String {
        String::from_utf8_lossy(&self.0.stderr).into_owned()
    }

    /// Standard output as text.
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.0.stdout).into_owned()
    }

    /// Fails the test unless standard error has `text`.
    #[track_caller]
    pub(crate) fn prints(self, text: &str) -> Self {
        assert!(self.errors().contains(text), "nothing of `{text}` in:\n{}", self.errors());
        self
    }

    /// The frames that this run made, by its lines on standard error.
    pub(crate) fn rendered(&self) -> Vec<i64> {
        let frame = |line: &str| line.split_once("] frame ")?.1.split_once(':')?.0.parse().ok();
        self.errors().lines().filter_map(frame).collect()
    }

    /// Fails the test with what was printed unless the exit code is `code`.
    #[track_caller]
    pub(crate) fn expect(self, code: i32) -> Self {
        assert_eq!(self.code(), Some(code), "{}\n{}", self.text(), self.errors());
        self
    }
}

/// A file among the samples of the repository.
pub(crate) fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}
