//! Images as input, decoded to linear RGB: equirectangular ones for environments from OpenEXR and Radiance (`.hdr`)
//! files, and pictures on the ground from these and PNG files.
//!
//! Sizes are checked before memory for pixels is allocated. The content decides on the format, not the name.

use std::io::{BufRead, Seek};
use std::path::Path;

use glam::Vec3;

use crate::file::{Fault, ImageFormat, ImageReadError, read};
use crate::scene::environment::MapError;
use crate::scene::texture::TextureError;
use crate::scene::{RadianceMap, Texture};

mod openexr;
mod png;
mod radiance;
#[cfg(test)]
mod tests;

impl From<MapError> for Fault {
    fn from(error: MapError) -> Self {
        Self::Other(error.to_string())
    }
}

impl From<TextureError> for Fault {
    fn from(error: TextureError) -> Self {
        Self::Other(error.to_string())
    }
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
/// See [`ImageReadError`]; messages begin with the path.
pub fn read_radiance_map(path: &Path) -> Result<RadianceMap, ImageReadError> {
    read(path, |file| {
        let image =
            decode_radiance(file, |width, height| Ok(RadianceMap::check_size(width, height)?))?;
        Ok(RadianceMap::new(image.width, image.height, image.pixels)?)
    })
}

/// Reads the picture at `path`, for base colours. Transparent pixels of a PNG file show the colour `behind`.
///
/// # Errors
/// See [`ImageReadError`]; messages begin with the path.
pub fn read_texture(path: &Path, behind: Vec3) -> Result<Texture, ImageReadError> {
    read(path, |mut file| {
        let check = |width, height| Ok(Texture::check_size(width, height)?);
        let image = match ImageFormat::of(&mut file)? {
            ImageFormat::Png => png::decode(file, check, behind)?,
            _ => decode_radiance(file, check)?,
        };
        Ok(Texture::new(image.width, image.height, &image.pixels)?)
    })
}

fn decode_radiance(mut file: impl BufRead + Seek, check: Check) -> Result<Pixels, Fault> {
    match ImageFormat::of(&mut file)? {
        ImageFormat::OpenExr => openexr::decode(file, check),
        ImageFormat::Radiance => radiance::decode(file, check),
        ImageFormat::Png | ImageFormat::Other => Err(Fault::Other(
            "is neither an OpenEXR nor a Radiance HDR image; convert it to one of them".to_owned(),
        )),
    }
}
