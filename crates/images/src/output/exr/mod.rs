//! OpenEXR files: planar channels, scanlines; one part, or two parts if colours and data have different compressions.
//!
//! Colours are half-floats, the data channels are floats, `id.I` is uint. This module packs blocks of rows (see
//! [`pack_block`]), and writes the file with attributes from the crate `exr`. A film always gives the same bytes,
//! whatever the number of threads: scanlines are in increasing order, the crate writes at most one custom attribute (it
//! would write several in random order; [`file`] writes the others), and nothing depends on the clock.

use std::io::{self, Cursor, Seek, Write};

use exr::meta::attribute::EnvironmentMap;
use exr::prelude::{AttributeValue, LayerAttributes, Text};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::render::{DataWindow, Film, FilmPlane};

mod blocks;
mod deflate;
mod differences;
mod file;
mod layout;
mod lines;
mod pack;
pub(super) mod planes;

pub use blocks::{encoder_bytes, write_blocks};
pub use layout::{ExrBlock, ExrLayout};
pub use pack::{PackBuffers, PackedBlock, pack_block};
pub use planes::{
    DEFAULT_LIGHT_GROUP, PlaneNames, ambiguous_name, attribute_planes, plane_channels,
};

/// Maximum length of an attribute name in the format, bytes.
const NAME_MAX: usize = 255;

/// Compression of an EXR file. All methods are lossless.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// No compression.
    None,
    /// Run-length encoding.
    Rle,
    /// Deflate, in blocks of 16 rows.
    #[default]
    Zip,
    /// Deflate, row by row: larger files, but viewers can read single rows.
    Zips,
    /// Wavelets: good for grainy images.
    Piz,
}

/// An attribute of the file that is not in the OpenEXR standard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CustomAttribute {
    /// Name, at most 255 bytes.
    pub name: String,
    /// A JSON text.
    pub json: String,
}

/// An attribute of type `string`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextAttribute {
    /// Name, 1 to 31 bytes of ASCII.
    pub name: String,
    /// The value.
    pub text: String,
}

/// Settings of an EXR file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExrOptions {
    /// Compression of all channels, or of colours.
    pub compression: Compression,
    /// Compression of data channels. If it is another one, they are in a part of their own.
    pub data_compression: Option<Compression>,
    /// Data window and display window; by default both are the size of the film.
    pub window: Option<DataWindow>,
    /// Attribute `framesPerSecond`, as numerator and denominator.
    pub frames_per_second: Option<(i32, u32)>,
    /// Pixels per inch on paper, for the attribute `xDensity`.
    pub dpi: Option<u32>,
    /// Whether the image shows all directions by longitude and latitude, for the attribute `envmap`.
    pub is_panorama: bool,
    /// Attribute `worldToCamera`, from [`crate::scene::Camera::world_to_camera`].
    pub world_to_camera: Option<[f32; 16]>,
    /// Attribute `worldToNDC`, from [`crate::scene::Camera::world_to_ndc`].
    pub world_to_ndc: Option<[f32; 16]>,
    /// Attribute `screenWindowWidth`, from [`crate::scene::Camera::screen_window_width`].
    pub screen_window_width: Option<f32>,
    /// Attributes `fieldOfViewHorizontal` and `fieldOfViewVertical`, degrees.
    pub field_of_view: Option<[f32; 2]>,
    /// Value of `Z` where nothing is hit; infinite if not given.
    pub far_depth: Option<f32>,
    /// Attribute `comments`.
    pub comments: Option<String>,
    /// A custom attribute.
    pub custom: Option<CustomAttribute>,
    /// Further attributes, in the order of the file; in the part of data, if there is one.
    pub texts: Vec<TextAttribute>,
    /// Names of planes that depend on the job.
    pub names: PlaneNames,
}

impl ExrOptions {
    /// Whether data channels are in a part of their own.
    pub(super) fn has_data_part(&self) -> bool {
        self.data_compression.is_some_and(|data| data != self.compression)
    }
}

/// An encoded image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedExr {
    /// The file.
    pub bytes: Vec<u8>,
    /// Number of values of `R G B A` that half-floats cannot represent: beyond 65504 (written as 65504), or NaN
    /// (written as 0).
    pub clamped: u64,
}

/// Reasons why an image cannot be encoded.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The custom attribute cannot be stored.
    #[error("EXR attribute {name:?} cannot be stored: {why}")]
    Attribute {
        /// Name of the attribute.
        name: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// The EXR encoder failed.
    #[error("the image cannot be encoded as EXR: {0}")]
    Exr(#[source] exr::error::Error),
    /// The PNG encoder failed.
    #[error("the preview cannot be encoded as PNG: {0}")]
    Png(#[source] image::ImageError),
    /// The JPEG encoder failed.
    #[error("the picture cannot be encoded as JPEG: {0}")]
    Jpeg(#[source] image::ImageError),
    /// The TIFF encoder failed.
    #[error("the picture cannot be encoded as TIFF: {0}")]
    Tiff(#[source] tiff::TiffError),
    /// A figure cannot be encoded.
    #[error("the figure cannot be encoded: {0}")]
    Figure(#[source] io::Error),
    /// A picture without background needs alpha.
    #[error("JPEG files have no alpha for a transparent background; choose .png, .tif or .pdf")]
    NoAlpha,
}

impl OutputError {
    /// The error of the operating system, if the file could not be written.
    ///
    /// # Errors
    /// The error itself, if it has another cause.
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
/// If an attribute cannot be stored or the encoder fails.
pub fn encode_exr(film: &Film, options: &ExrOptions) -> Result<EncodedExr, OutputError> {
    let mut file = Cursor::new(Vec::new());
    let (_, clamped) = write_exr(film.clone(), options, &mut file)?;
    Ok(EncodedExr { bytes: file.into_inner(), clamped })
}

/// Writes `film` as an OpenEXR file, block by block, so that the file is never in memory as a whole. Idle threads of
/// the current pool help. Returns the film, so that its planes can be reused for another image, and
/// [`EncodedExr::clamped`]. Infinite depths become [`ExrOptions::far_depth`] in the film, too.
///
/// # Errors
/// If an attribute cannot be stored, the encoder fails, or `file` cannot be written.
pub fn write_exr(
    mut film: Film,
    options: &ExrOptions,
    file: &mut (impl Write + Seek),
) -> Result<(Film, u64), OutputError> {
    let layout = ExrLayout::of(&film, options)?;
    if let (Some(far), Some(depths)) = (options.far_depth, film.plane_mut::<f32>(FilmPlane::Depth))
    {
        for depth in depths.iter_mut().filter(|depth| **depth == f32::INFINITY) {
            *depth = far;
        }
    }
    blocks::write_film(film, layout, file)
}

fn attributes(options: &ExrOptions) -> Result<LayerAttributes, OutputError> {
    let mut attributes = LayerAttributes {
        software_name: Some(Text::from(concat!("spherule ", env!("CARGO_PKG_VERSION")))),
        frames_per_second: options.frames_per_second,
        world_to_camera: options.world_to_camera,
        world_to_normalized_device: options.world_to_ndc,
        horizontal_field_of_view: options.field_of_view.map(|[horizontal, _]| horizontal),
        vertical_field_of_view: options.field_of_view.map(|[_, vertical]| vertical),
        horizontal_density: options.dpi.map(|dpi| dpi as f32),
        environment_map: options.is_panorama.then_some(EnvironmentMap::LatitudeLongitude),
        ..LayerAttributes::default()
    };
    if let Some(width) = options.screen_window_width {
        attributes.screen_window_width = width;
    }
    attributes.comments = options.comments.as_deref().map(text);
    // Check the name of an attribute of the user, which the format limits
    if let Some(CustomAttribute { name, json }) = &options.custom {
        let refuse = |why| OutputError::Attribute { name: name.clone(), why };
        if name.is_empty() || name.len() > NAME_MAX {
            return Err(refuse("the name must have 1 to 255 bytes"));
        }
        if !name.is_ascii() || name.contains('\0') {
            return Err(refuse("the name must be ASCII"));
        }
        attributes.other.insert(text(name), AttributeValue::Text(text(json)));
    }
    Ok(attributes)
}

/// A text attribute in UTF-8; the conversion of the crate `exr` would write Latin-1.
fn text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}

#[cfg(test)]
mod tests;
