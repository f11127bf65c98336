//! OpenEXR files: one part, planar channels, scanlines.
//!
//! `R G B A` are half, data channels float, `id.I` is uint. Blocks of rows are packed here and become a file by
//! the crate `exr`. With scanlines in increasing order and at most one custom attribute (several would be
//! written in random order) a film always gives the same bytes, however many threads pack. Nothing here looks
//! at the clock.

use std::io::{self, Cursor, Seek, Write};

use exr::prelude::{AttributeValue, LayerAttributes, Text};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::render::Film;

mod blocks;
mod deflate;
mod differences;
mod layout;
mod lines;
mod pack;
pub(super) mod planes;

pub use blocks::write_blocks;
pub use layout::ExrLayout;
pub use pack::{PackBuffers, PackedBlock, pack_block};

/// Longest attribute name the format has room for.
const NAME_MAX: usize = 255;

/// How an EXR file is compressed; all of these are lossless.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Not at all.
    None,
    /// Run lengths.
    Rle,
    /// Deflate over 16 rows.
    #[default]
    Zip,
    /// Deflate row by row: larger, but a viewer gets at single rows.
    Zips,
    /// Wavelets: good for grainy images.
    Piz,
}

/// The file's one attribute that the standard does not know.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CustomAttribute {
    /// Name, at most 255 bytes.
    pub name: String,
    /// A JSON text.
    pub json: String,
}

/// What goes into an EXR file beside the film.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExrOptions {
    /// Compression of all channels.
    pub compression: Compression,
    /// `framesPerSecond` as numerator and denominator.
    pub frames_per_second: Option<(i32, u32)>,
    /// `worldToCamera`, from [`crate::scene::Camera::world_to_camera`].
    pub world_to_camera: Option<[f32; 16]>,
    /// `comments`.
    pub comments: Option<String>,
    /// One more attribute.
    pub custom: Option<CustomAttribute>,
}

/// An encoded image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedExr {
    /// The file.
    pub bytes: Vec<u8>,
    /// Values of `R G B A` that half cannot hold: beyond 65504 (written as that), or NaN (written as
    /// 0).
    pub clamped: u64,
}

/// Why an image cannot be encoded.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The custom attribute cannot be stored.
    #[error("EXR attribute {name:?} cannot be stored: {why}")]
    Attribute {
        /// Which one.
        name: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// The EXR encoder refused.
    #[error("the image cannot be encoded as EXR: {0}")]
    Exr(#[source] exr::error::Error),
    /// The PNG encoder refused.
    #[error("the preview cannot be encoded as PNG: {0}")]
    Png(#[source] image::ImageError),
}

impl OutputError {
    /// What the system said, if the file could not be written; else the error itself.
    ///
    /// # Errors
    /// The encoder is to blame.
    pub fn into_io(self) -> Result<io::Error, Self> {
        match self {
            Self::Exr(exr::error::Error::Io(error)) => Ok(error),
            other => Err(other),
        }
    }
}

/// Encodes `film` as an OpenEXR file in memory.
///
/// # Errors
/// If an attribute cannot be stored or the encoder refuses the image.
pub fn encode_exr(film: &Film, options: &ExrOptions) -> Result<EncodedExr, OutputError> {
    let mut file = Cursor::new(Vec::new());
    let (_, clamped) = write_exr(film.clone(), options, &mut file)?;
    Ok(EncodedExr {
        bytes: file.into_inner(),
        clamped,
    })
}

/// Writes `film` as an OpenEXR file, block by block: the file is never in memory as a whole. Idle threads of the
/// current pool help. Returns the film, whose planes can serve another image, and [`EncodedExr::clamped`].
///
/// # Errors
/// If an attribute cannot be stored, the encoder refuses the image, or `file` does.
pub fn write_exr(
    film: Film,
    options: &ExrOptions,
    file: &mut (impl Write + Seek),
) -> Result<(Film, u64), OutputError> {
    let layout = ExrLayout::of(&film, options)?;
    blocks::write_film(film, layout, file)
}

fn attributes(options: &ExrOptions) -> Result<LayerAttributes, OutputError> {
    let mut attributes = LayerAttributes {
        software_name: Some(Text::from(concat!("spherule ", env!("CARGO_PKG_VERSION")))),
        frames_per_second: options.frames_per_second,
        world_to_camera: options.world_to_camera,
        ..LayerAttributes::default()
    };
    attributes.comments = options.comments.as_deref().map(text);
    if let Some(CustomAttribute { name, json }) = &options.custom {
        let refuse = |why| OutputError::Attribute {
            name: name.clone(),
            why,
        };
        if name.is_empty() || name.len() > NAME_MAX {
            return Err(refuse("the name must have 1 to 255 bytes"));
        }
        if !name.is_ascii() || name.contains('\0') {
            return Err(refuse("the name must be ASCII"));
        }
        attributes
            .other
            .insert(text(name), AttributeValue::Text(text(json)));
    }
    Ok(attributes)
}

/// Texts are UTF-8 in the file; `exr` itself would write Latin-1.
fn text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}

#[cfg(test)]
mod tests;
