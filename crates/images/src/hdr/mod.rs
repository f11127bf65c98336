//! Images as input, decoded to linear RGB: equirectangular ones for environments from OpenEXR and Radiance (`.hdr`)
//! files, and pictures on the ground from these and PNG files.
//!
//! Sizes are checked before memory for pixels is allocated. The content decides on the format, not the name.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use glam::Vec3;
use thiserror::Error;

use crate::scene::environment::MapError;
use crate::scene::texture::TextureError;
use crate::scene::{RadianceMap, Texture};
use spherule_jobs::{Panic, catch_panic};

mod openexr;
mod png;
mod radiance;
#[cfg(test)]
mod tests;

/// First bytes of OpenEXR files.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// First bytes of Radiance files.
const RADIANCE_MAGIC: [u8; 2] = *b"#?";

/// First bytes of PNG files.
const PNG_MAGIC: [u8; 4] = *b"\x89PNG";

/// Reasons why a file is not an image that can be used.
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
    #[error(transparent)]
    Texture(#[from] TextureError),
    #[error("{0}")]
    Other(String),
}

/// Decoded pixels, row by row from the top, linear RGB.
struct Pixels {
    width: usize,
    height: usize,
    pixels: Vec<Vec3>,
}

/// Checks a width and a height before memory for pixels is allocated.
type Check = fn(usize, usize) -> Result<(), Fault>;

/// Reads the equirectangular image at `path`.
///
/// # Errors
/// See [`HdrError`]; messages begin with the path.
pub fn read_radiance_map(path: &Path) -> Result<RadianceMap, HdrError> {
    read(path, |file| {
        let image =
            decode_radiance(file, |width, height| Ok(RadianceMap::check_size(width, height)?))?;
        Ok(RadianceMap::new(image.width, image.height, image.pixels)?)
    })
}

/// Reads the picture at `path`, for base colours. Transparent pixels of a PNG file show the colour `behind`.
///
/// # Errors
/// See [`HdrError`]; messages begin with the path.
pub fn read_texture(path: &Path, behind: Vec3) -> Result<Texture, HdrError> {
    read(path, |mut file| {
        let check = |width, height| Ok(Texture::check_size(width, height)?);
        let image = if first_bytes(&mut file)?[..] == PNG_MAGIC {
            png::decode(file, check, behind)?
        } else {
            decode_radiance(file, check)?
        };
        Ok(Texture::new(image.width, image.height, &image.pixels)?)
    })
}

/// Reads the image at `path` by `decode`.
fn read<T>(
    path: &Path,
    decode: impl FnOnce(BufReader<File>) -> Result<T, Fault> + std::panic::UnwindSafe,
) -> Result<T, HdrError> {
    let unusable = |what: String| HdrError::Unusable { path: path.to_owned(), what };
    let file = spherule_jobs::open_regular(path)
        .map_err(|source| HdrError::Io { path: path.to_owned(), source })?;
    // Decoders of files from elsewhere may panic
    match catch_panic(|| Ok::<_, Panic>(decode(BufReader::new(file.0)))) {
        Ok(Ok(image)) => Ok(image),
        Ok(Err(Fault::Io(source))) => Err(HdrError::Io { path: path.to_owned(), source }),
        Ok(Err(fault)) => Err(unusable(fault.to_string())),
        Err(_) => Err(unusable("the image is damaged".to_owned())),
    }
}

/// The first four bytes, or fewer.
fn first_bytes(file: &mut BufReader<File>) -> Result<Vec<u8>, Fault> {
    let mut start = Vec::new();
    file.by_ref().take(4).read_to_end(&mut start)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(start)
}

fn decode_radiance(mut file: BufReader<File>, check: Check) -> Result<Pixels, Fault> {
    let start = first_bytes(&mut file)?;
    if start == EXR_MAGIC {
        openexr::decode(file, check)
    } else if start.starts_with(&RADIANCE_MAGIC) {
        radiance::decode(file, check)
    } else {
        Err(Fault::Other(
            "is neither an OpenEXR nor a Radiance HDR image; convert it to one of them".to_owned(),
        ))
    }
}
