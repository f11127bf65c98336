//! Image files from elsewhere: which format they have, what is wrong with them, and the decoder of PNG files.
//!
//! The content decides on the format, not the name. Callers check sizes before memory for pixels is allocated.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use spherule_files::{Panic, catch_panic, open_regular};
use thiserror::Error;

pub(crate) mod png;

/// Reasons why a file is not an image that can be used.
#[derive(Debug, Error)]
pub enum ImageReadError {
    /// It cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
    /// It is damaged, or of a kind that cannot be used.
    #[error("{}: {what}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// The reason, with the remedy if there is one.
        what: String,
    },
}

/// Reasons without the name of the file.
#[derive(Debug, Error)]
pub(crate) enum Fault {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("{0}")]
    Other(String),
}

impl From<exr::error::Error> for Fault {
    fn from(error: exr::error::Error) -> Self {
        match error {
            exr::error::Error::Io(error) => Self::Io(error),
            other => Self::Other(format!("cannot be decoded: {other}")),
        }
    }
}

/// The format of a file by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ImageFormat {
    OpenExr,
    Radiance,
    Png,
    Other,
}

impl ImageFormat {
    /// The format of `file`, which is at its start, before and after.
    pub(crate) fn of(file: &mut (impl Read + Seek)) -> Result<Self, Fault> {
        let mut start = Vec::new();
        file.by_ref().take(4).read_to_end(&mut start)?;
        file.seek(SeekFrom::Start(0))?;
        Ok(match start.as_slice() {
            [0x76, 0x2f, 0x31, 0x01] => Self::OpenExr,
            [b'#', b'?', ..] => Self::Radiance,
            b"\x89PNG" => Self::Png,
            _ => Self::Other,
        })
    }
}

/// Reads the image at `path` by `decode`.
pub(crate) fn read<T>(
    path: &Path,
    decode: impl FnOnce(BufReader<File>) -> Result<T, Fault> + std::panic::UnwindSafe,
) -> Result<T, ImageReadError> {
    let io = |source| ImageReadError::Io { path: path.to_owned(), source };
    let unusable = |what: String| ImageReadError::Unusable { path: path.to_owned(), what };
    let (file, _) = open_regular(path).map_err(io)?;
    // Decoders of files from elsewhere may panic
    match catch_panic(|| Ok::<_, Panic>(decode(BufReader::new(file)))) {
        Ok(Ok(image)) => Ok(image),
        Ok(Err(Fault::Io(source))) => Err(io(source)),
        Ok(Err(Fault::Other(what))) => Err(unusable(what)),
        Err(_) => Err(unusable("the image is damaged".to_owned())),
    }
}
