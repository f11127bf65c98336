//! Why an input is not a sequence, with the remedy.

use std::fmt::Write as _;
use std::io;
use std::path::PathBuf;

use crate::{FrameError, escape_controls};

/// Why no sequence could be made of an input. None of these is about the content of a frame:
/// damaged files are reported when they are loaded, except lists of files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SequenceError {
    /// A file or directory that is not there.
    #[error("{}: no such file or directory{hint}", path.display())]
    Missing {
        /// The requested name.
        path: PathBuf,
        /// Empty, or `; ` and names that come close.
        hint: String,
    },
    /// Neither a file, a directory nor a pattern was given.
    #[error("no input was given; give a directory, a pattern such as dump.#.vtk, or files")]
    NoInput,
    /// A directory without files of particles.
    #[error("{}: no particle files here; {found}", path.display())]
    NoFrames {
        /// The directory.
        path: PathBuf,
        /// What is there instead and what to do.
        found: String,
    },
    /// A pattern that no file name fits.
    #[error("{pattern}: no file name fits this pattern; {found}")]
    NoMatch {
        /// The pattern.
        pattern: String,
        /// What is in the directory.
        found: String,
    },
    /// A pattern that cannot be used.
    #[error("{pattern}: {what}")]
    BadPattern {
        /// The pattern.
        pattern: String,
        /// What is wrong and the remedy.
        what: String,
    },
    /// Several sequences in one directory.
    #[error("{}: {} sequences are here; give the pattern of one:{}", path.display(), groups.len(), listed(groups))]
    Ambiguous {
        /// The directory.
        path: PathBuf,
        /// The candidates, the largest first.
        groups: Vec<GroupSummary>,
    },
    /// Two files with the same frame number.
    #[error(
        "frame {number} is in two files, {} and {}; remove one, or give a pattern that fits only one",
        first.display(), second.display()
    )]
    Duplicate {
        /// The frame number.
        number: i64,
        /// One file.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// A requested part does not exist.
    #[error("no part is called `{name}`; the parts are {}", if known.len() > 1 { known.join(", ") } else { "not named: there is one file a step; --where 'part == 1' selects a part inside of a file".to_owned() })]
    NoSuchPart {
        /// The requested name.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// A list of files, such as a `.pvd`, that cannot be used.
    #[error(transparent)]
    List(FrameError),
    /// A topology that cannot be used.
    #[error(transparent)]
    Topology(FrameError),
    /// A list names a file outside its directory.
    #[error(
        "{}: line {line}: `{}` is outside the directory of the list; allow such files, or copy the \
         file there",
        list.display(), escape_controls(file)
    )]
    Outside {
        /// The list.
        list: PathBuf,
        /// Line in the list, from 1.
        line: u32,
        /// The name in the list.
        file: String,
    },
    /// One of several lists has several time steps.
    #[error(
        "{}: {steps} time steps in one of several lists of files; give one such list at a time, or one list that names \
         all parts",
        path.display()
    )]
    SeveralLists {
        /// The list.
        path: PathBuf,
        /// How many steps it has.
        steps: usize,
    },
    /// The operating system refused to list a directory.
    #[error("{}: {source}", path.display())]
    Io {
        /// The directory.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}

/// One of several sequences in a directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GroupSummary {
    /// A pattern that fits its files.
    pub pattern: String,
    /// How many time steps it has, by the file names.
    pub frames: usize,
    /// How many files it has.
    pub files: usize,
}

fn listed(groups: &[GroupSummary]) -> String {
    const SHOWN: usize = 6;
    let mut text = String::new();
    for (index, group) in groups.iter().take(SHOWN).enumerate() {
        let separator = if index == 0 { "" } else { "," };
        // Writing to a string cannot fail.
        let _ = write!(text, "{separator} `{}` ({}", group.pattern, counted(group));
        text.push(')');
    }
    if groups.len() > SHOWN {
        let _ = write!(text, " and {} more", groups.len() - SHOWN);
    }
    text
}

pub(super) fn counted(group: &GroupSummary) -> String {
    let plural = |n: usize| if n == 1 { "" } else { "s" };
    // A file by itself may have any number of frames
    if group.files == 1 {
        return "1 file".to_owned();
    }
    let frames = format!("{} frame{}", group.frames, plural(group.frames));
    if group.frames == group.files {
        return frames;
    }
    format!("{frames}, {} file{}", group.files, plural(group.files))
}
