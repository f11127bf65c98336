//! Equirectangular images for environments: OpenEXR and Radiance (`.hdr`) files, decoded to linear RGB.
//!
//! Sizes are checked before memory for pixels is allocated. The content decides on the format, not the name.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::scene::RadianceMap;
use crate::scene::environment::MapError;
use spherule_jobs::{Panic, catch_panic};

mod openexr;
mod radiance;
#[cfg(test)]
mod tests;

/// First bytes of OpenEXR files.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// First bytes of Radiance files.
const RADIANCE_MAGIC: [u8; 2] = *b"#?";

/// Reasons why a file is not an environment.
#[derive(Debug, Error)]
pub enum HdrError {
    /// It cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
    /// It is no image that can be used.
    #[error("{}: {what}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// The reason, and the remedy.
        what: String,
    },
}

/// Reasons without the name of the file.
#[derive(Debug, Error)]
enum Fault {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Map(#[from] MapError),
    #[error("{0}")]
    Other(String),
}

/// Reads the image at `path`.
///
/// # Errors
/// See [`HdrError`]; messages begin with the path.
pub fn read_radiance_map(path: &Path) -> Result<RadianceMap, HdrError> {
    let unusable = |what: String| HdrError::Unusable {
        path: path.to_owned(),
        what,
    };
    let file = spherule_jobs::open_regular(path).map_err(|source| HdrError::Io {
        path: path.to_owned(),
        source,
    })?;
    // Decoders of files from elsewhere may panic
    match catch_panic(|| Ok::<_, Panic>(decode(BufReader::new(file.0)))) {
        Ok(Ok(map)) => Ok(map),
        Ok(Err(Fault::Io(source))) => Err(HdrError::Io {
            path: path.to_owned(),
            source,
        }),
        Ok(Err(fault)) => Err(unusable(fault.to_string())),
        Err(_) => Err(unusable("the image is damaged".to_owned())),
    }
}

fn decode(mut file: BufReader<File>) -> Result<RadianceMap, Fault> {
    let mut start = Vec::new();
    file.by_ref().take(4).read_to_end(&mut start)?;
    file.seek(SeekFrom::Start(0))?;
    if start == EXR_MAGIC {
        openexr::decode(file)
    } else if start.starts_with(&RADIANCE_MAGIC) {
        radiance::decode(file)
    } else {
        Err(Fault::Other(
            "is neither an OpenEXR nor a Radiance HDR image; convert it to one of them".to_owned(),
        ))
    }
}
