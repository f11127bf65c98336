//! What one file lists.

use std::path::Path;

use super::entry::{List, ListKind};
use super::{series, xml};
use crate::read::vtk_xml::root_type;
use crate::{FrameError, MemoryBudget, ParseError};
use spherule_readers::HEAD_LEN;
use spherule_readers::read_whole;

/// Bytes in memory for a byte of a list: its text, its entries, and the steps made of them.
const EXPANSION: u64 = 16;

impl ListKind {
    /// The kind of a file that begins with `head`; `None` for other files.
    pub(super) fn of(head: &[u8]) -> Option<Self> {
        if series::is_series(head) {
            return Some(Self::Series);
        }
        match root_type(head)?.as_str() {
            "Collection" => Some(Self::Collection),
            "PUnstructuredGrid" | "PPolyData" => Some(Self::Pieces),
            "vtkMultiBlockDataSet"
            | "vtkPartitionedDataSet"
            | "vtkPartitionedDataSetCollection" => Some(Self::Blocks),
            _ => None,
        }
    }
}

impl List {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be read, is damaged, lists nothing, or needs more memory than `budget`.
    pub(super) fn open(path: &Path, budget: MemoryBudget) -> Result<Self, FrameError> {
        let bytes = read_whole(path, budget)?;
        Self::parse(&bytes, budget).map_err(|e| e.in_file(path))
    }

    /// Parses `bytes`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(super) fn parse(bytes: &[u8], budget: MemoryBudget) -> Result<Self, ParseError> {
        // Check the size before anything is parsed
        let need = (bytes.len() as u64).saturating_mul(EXPANSION);
        budget.check(need, "the list of its files is")?;
        if bytes.is_empty() {
            let what = "the file is empty; perhaps it is still being written";
            return Err(ParseError::malformed(0, what));
        }
        // Choose the parser by the first bytes
        let head = bytes.get(..HEAD_LEN).unwrap_or(bytes);
        let kind = ListKind::of(head).ok_or_else(|| {
            let what = "named like a list of files, but neither a <VTKFile> of type Collection, PUnstructuredGrid, \
                        PPolyData, vtkMultiBlockDataSet, vtkPartitionedDataSet or vtkPartitionedDataSetCollection, nor \
                        a file series in JSON";
            ParseError::malformed(0, what)
        })?;
        let list = match kind {
            ListKind::Series => Self { kind, entries: series::entries(bytes)?, ghost_level: 0 },
            ListKind::Collection | ListKind::Pieces | ListKind::Blocks => xml::list(bytes, kind)?,
        };
        if list.entries.is_empty() {
            let what = "it lists no files; perhaps it is still being written";
            return Err(ParseError::malformed(bytes.len(), what));
        }
        Ok(list)
    }
}

/// How many files the list in `bytes` has, for fuzzing: nothing is opened.
///
/// # Errors
/// [`ParseError`] for anything but a list of files.
#[doc(hidden)]
pub fn lists_of(bytes: &[u8]) -> Result<usize, ParseError> {
    List::parse(bytes, MemoryBudget::UNLIMITED).map(|list| list.entries.len())
}
