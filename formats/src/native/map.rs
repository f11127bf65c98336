//! Native frames in memory without reading them: the only place of the crate with a memory map.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use memmap2::Mmap;
use rkyv::util::AlignedVec;

use super::NativeFrame;
use super::layout::{FrameIndex, parse};
use crate::{FrameError, ParseError};

/// How the bytes of a native frame come into memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Access {
    /// Mapped: opening is O(1), pages come as they are touched.
    #[default]
    Map,
    /// Read as a whole: for file systems where a file may be cut short while it is used.
    Read,
}

/// An opened native frame; [`Self::frame`] gives the view of its particles.
#[derive(Debug)]
pub struct NativeFile {
    path: PathBuf,
    file: File,
    bytes: Bytes,
    index: FrameIndex,
}

#[derive(Debug)]
enum Bytes {
    Mapped(Mmap),
    /// Aligned as sections are, see [`super::layout::ALIGN`].
    Read(AlignedVec<64>),
}

impl NativeFile {
    /// Opens the native frame at `path` and checks its header and index, not its sections.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be read, or is damaged, cut off, or of a newer version.
    pub fn open(path: &Path, access: Access) -> Result<Self, FrameError> {
        let io = |e| FrameError::io(path, e);
        let mut file = File::open(path).map_err(io)?;
        if !file.metadata().map_err(io)?.is_file() {
            return Err(ParseError::unsupported("no regular file").in_file(path));
        }
        let bytes = match access {
            Access::Map => Bytes::Mapped(map(&file).map_err(io)?),
            Access::Read => {
                let len = file.metadata().map_err(io)?.len();
                let too_large = |_| FrameError::io(path, std::io::ErrorKind::OutOfMemory.into());
                let len = usize::try_from(len).map_err(too_large)?;
                let mut bytes = AlignedVec::with_capacity(len);
                bytes.resize(len, 0);
                file.read_exact(&mut bytes).map_err(io)?;
                Bytes::Read(bytes)
            }
        };
        let index = parse(bytes.as_slice()).map_err(|e| e.in_file(path))?;
        Ok(Self {
            path: path.to_owned(),
            file,
            bytes,
            index,
        })
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the file holds.
    pub const fn index(&self) -> &FrameIndex {
        &self.index
    }

    /// The particles in place. Take it anew for every use: it looks again whether a mapped file
    /// still has its length, since touching pages that are gone would end the process.
    ///
    /// # Errors
    /// [`FrameError::Malformed`] if the file was cut short or grew since it was opened.
    pub fn frame(&self) -> Result<NativeFrame<'_>, FrameError> {
        let bytes = self.bytes.as_slice();
        if matches!(self.bytes, Bytes::Mapped(_)) {
            let meta = self.file.metadata();
            let len = meta.map_err(|e| FrameError::io(&self.path, e))?.len();
            if len != bytes.len() as u64 {
                let what = format!(
                    "the file had {} bytes when it was mapped and has {len} now; \
                     leave it alone, or read it instead of mapping",
                    bytes.len()
                );
                return Err(ParseError::malformed(0, what).in_file(&self.path));
            }
        }
        Ok(NativeFrame::with_index(bytes, &self.index))
    }
}

impl Bytes {
    fn as_slice(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Read(bytes) => bytes,
        }
    }
}

/// Maps `file`, which nobody may change or cut while the map lives.
///
/// Native frames are published by rename and never written in place, so only somebody outside can do
/// that. `NativeFile::frame` compares the length whenever a view is taken; what remains is a user who
/// rewrites the file in place while a view is held, which `Access::Read` is there for. Contents are
/// plain numbers, of which any bit pattern is valid, and are never used as indices unchecked.
#[expect(
    unsafe_code,
    reason = "mapping has no safe form: other processes may change the file"
)]
fn map(file: &File) -> std::io::Result<Mmap> {
    // SAFETY: `Mmap::map` needs the file neither changed nor cut while mapped; what is done for
    // that, and what is left to the user, stands above.
    unsafe { Mmap::map(file) }
}
