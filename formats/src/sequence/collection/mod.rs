//! Files that list other files: ParaView collections, file series, indices of pieces and of blocks.
//!
//! `list` reads one such file, `expand` follows the files that it lists and makes time steps of them. What the
//! particle files hold is looked at when a frame is loaded, like everywhere in a sequence.

mod entry;
mod expand;
mod list;
mod parts;
mod paths;
mod series;
#[cfg(test)]
mod tests;
mod xml;

use std::ffi::OsStr;
use std::path::Path;

use crate::read::vtk_xml;
use spherule_readers::compression::strip_extension;

pub(super) use expand::{Expansion, ListedFiles, expand};
#[doc(hidden)]
pub use list::lists_of;

use entry::ListKind;

/// Extensions of lists with times, in lower case.
const TIMED_EXTENSIONS: [&str; 2] = ["pvd", "series"];

/// Extensions of lists of one time step, in lower case.
const STEP_EXTENSIONS: [&str; 6] = ["pvtu", "pvtp", "vtm", "vtmb", "vtpd", "vtpc"];

/// What a sequence that is made of lists consists of.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ListSummary {
    /// Kind of list, for example `ParaView collection`.
    pub kind: &'static str,
    /// Number of lists that were given; lists in lists do not count.
    pub list_count: usize,
    /// Number of time steps.
    pub step_count: usize,
    /// Number of files of particles over all steps.
    pub file_count: usize,
    /// First and last simulation time, if the lists have times.
    pub times: Option<(f64, f64)>,
}

impl std::fmt::Display for ListSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let counted = |count: usize, what: &str| match count {
            1 => format!("1 {what}"),
            _ => format!("{count} {what}s"),
        };
        match self.list_count {
            1 => f.write_str(self.kind)?,
            count => write!(f, "{count} files of kind {}", self.kind)?,
        }
        let steps = counted(self.step_count, "time step");
        write!(f, ", {steps}, {}", counted(self.file_count, "file"))?;
        match self.times {
            Some((first, last)) => write!(f, ", times {first} to {last}"),
            None => Ok(()),
        }
    }
}

/// Whether the name of `path` is that of a list with times.
pub(super) fn has_timed_name(path: &Path) -> bool {
    has_extension(path, &TIMED_EXTENSIONS)
}

/// Whether the name of `path` is that of a file that lists others.
pub(super) fn has_list_name(path: &Path) -> bool {
    has_timed_name(path) || has_extension(path, &STEP_EXTENSIONS)
}

fn has_extension(path: &Path, known: &[&str]) -> bool {
    let name =
        path.file_name().map(OsStr::to_string_lossy).unwrap_or_default().to_ascii_lowercase();
    let extension = strip_extension(&name).rsplit_once('.');
    extension.is_some_and(|(_, extension)| known.contains(&extension))
}

/// Whether the file at `path` lists others: its name says so, or its content if the name says nothing.
pub(super) fn is_list(path: &Path) -> bool {
    has_list_name(path) || crate::registry::by_name(path).is_none() && has_list_content(path)
}

/// Whether one of the files of a sequence lists others. Some programs call lists of blocks `.vtp`. To open each of
/// thousands of such files would take long, so the first one stands for all.
pub(super) fn has_list<'a>(mut paths: impl Iterator<Item = &'a Path> + Clone) -> bool {
    let first = paths.clone().next();
    first.is_some_and(stands_for_blocks) || paths.any(is_list)
}

/// Whether the file at `path` is a list although its name is that of particles in XML.
pub(super) fn stands_for_blocks(path: &Path) -> bool {
    crate::registry::by_name(path) == Some(vtk_xml::FORMAT) && has_list_content(path)
}

fn has_list_content(path: &Path) -> bool {
    let head = crate::open::head(path);
    head.is_ok_and(|head| ListKind::of(&head).is_some())
}
