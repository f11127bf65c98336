//! Verifies image files: decodes every block of every channel, and compares size and channels with those of the job.
//! Works block by block and row by row, so that an image is never in memory as a whole.
//!
//! Damage inside a block is found if the compression has a checksum (Adler-32 in `zip` and `zips`; all previews have
//! checksums), or if the block cannot be decompressed. Uncompressed blocks may contain any numbers, so damage in them
//! is not found.

use std::io::{BufRead, Read, Seek};

use exr::block::UncompressedBlock;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;
use thiserror::Error;

use super::exr::planes::{ExrChannel, PlaneNames, attribute_planes, exr_channels, parts};
use crate::render::layers::MAX_ATTRIBUTE_FLOATS;
use crate::render::{Channels, DataWindow};

/// The expected size and channels of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageShape {
    /// Width of the data window in pixels.
    pub width: u32,
    /// Height of the data window in pixels.
    pub height: u32,
    /// Position of the data window in the image.
    pub window: DataWindow,
    /// The channels, without attributes.
    pub channels: Channels,
    /// Names of the attributes with channels; their number of components is not known.
    pub attributes: Vec<String>,
    /// Names of the light groups with layers.
    pub light_groups: Vec<String>,
    /// Whether data channels are in a part of their own.
    pub has_data_part: bool,
    /// Whether the image may be smaller than its preview, which has overlays beside it.
    pub is_on_page: bool,
}

/// What is wrong with an image.
#[derive(Debug, Error)]
pub enum ImageFault {
    /// It has another size.
    #[error("is {}x{}, expected {}x{}", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Width and height of the image, pixels.
        found: (usize, usize),
        /// Expected width and height, pixels.
        expected: (u32, u32),
    },
    /// It is another part of the image, or a part of an image of another size.
    #[error("has the data window {found}, expected {expected}")]
    Window {
        /// The windows of the file.
        found: String,
        /// The expected windows.
        expected: String,
    },
    /// It has other channels, or channels of another type.
    #[error("has the channels {found}, expected {expected}")]
    Channels {
        /// The channels of the file, with their types.
        found: String,
        /// The expected channels, with their types.
        expected: String,
    },
    /// The file violates its format, or cannot be read.
    #[error("{0}")]
    Damaged(String),
}

impl From<exr::error::Error> for ImageFault {
    fn from(error: exr::error::Error) -> Self {
        Self::Damaged(format!("cannot be decoded: {error}"))
    }
}

impl From<png::DecodingError> for ImageFault {
    fn from(error: png::DecodingError) -> Self {
        Self::Damaged(format!("cannot be decoded: {error}"))
    }
}

/// Decodes the OpenEXR file `file` and compares it with `expected`.
///
/// # Errors
/// The first fault found.
pub fn verify_exr(file: impl Read + Seek, expected: &ImageShape) -> Result<(), ImageFault> {
    let reader = exr::block::read(file, true)?;
    let meta = reader.meta_data().clone();
    // Compare the number of parts
    let parts = expected_parts(&meta.headers, expected);
    if meta.headers.len() != parts.len() {
        let (found, expected) = (meta.headers.len(), parts.len());
        let what = format!("the number of its parts is {found}, not {expected}");
        return Err(ImageFault::Damaged(what));
    }
    // Check the size before memory is allocated for the size in the header
    for (header, channels) in meta.headers.iter().zip(&parts) {
        check_header(header, channels, expected)?;
    }
    // Decode the blocks at the offsets in the file, like viewers do
    let mut all_rows = vec![0; parts.len()];
    for chunk in reader.filter_chunks(true, |_, _, _| true)? {
        let block = UncompressedBlock::decompress_chunk(chunk?, &meta, true)?;
        let (at, size) = (block.index.pixel_position, block.index.pixel_size);
        let (header, rows) = (&meta.headers[block.index.layer], &mut all_rows[block.index.layer]);
        let bytes = size.area() * header.channels.bytes_per_pixel;
        if (at.x(), at.y(), size.x()) != (0, *rows, header.layer_size.x())
            || block.data.len() != bytes
        {
            let what = format!("row {rows} is not where it must be");
            return Err(ImageFault::Damaged(what));
        }
        *rows += size.y();
    }
    // Check that each part has all its rows
    for (header, rows) in meta.headers.iter().zip(all_rows) {
        if rows != header.layer_size.y() {
            let what = format!("has {rows} of {} rows", header.layer_size.y());
            return Err(ImageFault::Damaged(what));
        }
    }
    Ok(())
}

/// The channels of each part of the file with `headers`, as they are expected.
fn expected_parts(headers: &[Header], expected: &ImageShape) -> Vec<Vec<ExrChannel>> {
    let channels = headers.iter().flat_map(|header| &header.channels.list);
    let found: Vec<String> = channels.map(|channel| channel.name.to_string()).collect();
    let mut channels = expected.channels;
    let attributes = attributes(&found, &expected.attributes);
    channels.layers.attributes = u8::try_from(attributes.len()).unwrap_or(u8::MAX);
    let names = PlaneNames { attributes, light_groups: expected.light_groups.clone() };
    parts(exr_channels(channels, &names), expected.has_data_part)
}

fn check_header(
    header: &Header,
    channels: &[ExrChannel],
    expected: &ImageShape,
) -> Result<(), ImageFault> {
    let size = (header.layer_size.x(), header.layer_size.y());
    check_window(header, &picture_window(size, expected)?)?;
    let found: Vec<(String, SampleType)> =
        header.channels.list.iter().map(|c| (c.name.to_string(), c.sample_type)).collect();
    let channels: Vec<_> =
        channels.iter().map(|channel| (channel.name.clone(), channel.sample_type())).collect();
    let has_all_pixels = |c: &ChannelDescription| c.sampling.x() == 1 && c.sampling.y() == 1;
    let is_complete = header.channels.list.iter().all(has_all_pixels);
    if is_complete && found.len() == channels.len() && channels.iter().all(|c| found.contains(c)) {
        return Ok(());
    }
    Err(ImageFault::Channels { found: listed(&found), expected: listed(&channels) })
}

/// The names of the planes of attributes `names`, with the number of components that each has among the channels
/// `found`.
fn attributes(found: &[String], names: &[String]) -> Vec<String> {
    let is_found = |plane: &String| found.contains(plane);
    let planes = |name: &String| {
        let counts = (1..=MAX_ATTRIBUTE_FLOATS).rev();
        let mut all = counts.map(|count| attribute_planes(name, count));
        let complete = all.find(|planes| planes.iter().all(is_found));
        complete.unwrap_or_else(|| attribute_planes(name, 1))
    };
    names.iter().flat_map(planes).collect()
}

fn check_size(found: (usize, usize), expected: &ImageShape) -> Result<(), ImageFault> {
    let expected = (expected.width, expected.height);
    if found == (expected.0 as usize, expected.1 as usize) {
        Ok(())
    } else {
        Err(ImageFault::Size { found, expected })
    }
}

/// The window that an OpenEXR image of size `found` must have.
fn picture_window(found: (usize, usize), expected: &ImageShape) -> Result<DataWindow, ImageFault> {
    let side = |own: usize, page: u32| u32::try_from(own).ok().filter(|own| *own <= page);
    let sides = side(found.0, expected.width).zip(side(found.1, expected.height));
    match sides {
        Some((width, height)) if expected.is_on_page => Ok(DataWindow::whole(width, height)),
        _ => check_size(found, expected).map(|()| expected.window),
    }
}

/// Compares the position of the data window and the display window.
fn check_window(header: &Header, expected: &DataWindow) -> Result<(), ImageFault> {
    let at = header.own_attributes.layer_position;
    let image = header.shared_attributes.display_window;
    let side = |side: usize| i64::try_from(side).unwrap_or(i64::MAX);
    let found = [at.x(), at.y(), image.position.x(), image.position.y()].map(i64::from);
    let wanted = [expected.left, expected.top, 0, 0].map(i64::from);
    let found_size = [side(image.size.x()), side(image.size.y())];
    let wanted_size = expected.image.map(i64::from);
    if found == wanted && found_size == wanted_size {
        return Ok(());
    }
    let text = |[x, y, left, top]: [i64; 4], [width, height]: [i64; 2]| {
        format!("at ({x}, {y}) in an image of {width}x{height} at ({left}, {top})")
    };
    Err(ImageFault::Window { found: text(found, found_size), expected: text(wanted, wanted_size) })
}

/// Names and types of channels for messages.
fn listed(channels: &[(String, SampleType)]) -> String {
    let description = |(name, kind): &(String, SampleType)| match kind {
        SampleType::F16 => format!("{name} (half)"),
        SampleType::F32 => format!("{name} (float)"),
        SampleType::U32 => format!("{name} (uint)"),
    };
    channels.iter().map(description).collect::<Vec<_>>().join(", ")
}

/// Decodes the PNG file `file` and compares its size with `expected`.
///
/// # Errors
/// The first fault found.
pub fn verify_preview(file: impl BufRead + Seek, expected: &ImageShape) -> Result<(), ImageFault> {
    let mut options = png::DecodeOptions::default();
    options.set_ignore_checksums(false);
    let mut decoder = png::Decoder::new_with_options(file, options);
    let header = decoder.read_header_info()?;
    check_size((header.width as usize, header.height as usize), expected)?;
    let mut reader = decoder.read_info()?;
    while reader.next_row()?.is_some() {}
    Ok(reader.finish()?)
}

#[cfg(test)]
#[path = "verify_tests.rs"]
mod tests;
