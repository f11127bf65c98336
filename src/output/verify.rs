//! Whether images are what they were written as: every block of every channel decoded, with the size and
//! the channels they must have. Block by block and row by row: an image is never in memory as a whole.
//!
//! Damage inside a block is found where its compression has a checksum (`zip` and `zips`, by Adler-32; all
//! previews) or cannot be undone. A block without compression, as all are in files without, may hold any
//! numbers.

use std::io::{BufRead, Read, Seek};

use exr::block::UncompressedBlock;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;
use thiserror::Error;

use super::exr::planes::planes;
use crate::render::Channels;

/// What an image of a job must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageShape {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// What is in it.
    pub channels: Channels,
}

/// What is wrong with an image.
#[derive(Debug, Error)]
pub enum ImageFault {
    /// It is another picture.
    #[error("is {}x{}, {}x{} is wanted", found.0, found.1, wanted.0, wanted.1)]
    Size {
        /// Width and height of the file.
        found: (usize, usize),
        /// Width and height it must have.
        wanted: (u32, u32),
    },
    /// It holds other channels, or of another type.
    #[error("has the channels {found}, {wanted} are wanted")]
    Channels {
        /// Those of the file.
        found: String,
        /// Those it must have.
        wanted: String,
    },
    /// The file breaks its format, or cannot be read.
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

/// Decodes the OpenEXR file `file`.
///
/// # Errors
/// The first fault.
pub fn verify_exr(file: impl Read + Seek, wanted: &ImageShape) -> Result<(), ImageFault> {
    let reader = exr::block::read(file, true)?;
    let meta = reader.meta_data().clone();
    let [header] = &meta.headers[..] else {
        let count = meta.headers.len();
        return Err(ImageFault::Damaged(format!("has {count} parts, not one")));
    };
    // Before anything as large as the header says is made.
    check_header(header, wanted)?;
    let mut rows = 0;
    // By the offsets in the file, as viewers do.
    for chunk in reader.filter_chunks(true, |_, _, _| true)? {
        let block = UncompressedBlock::decompress_chunk(chunk?, &meta, true)?;
        let (at, size) = (block.index.pixel_position, block.index.pixel_size);
        let bytes = size.area() * header.channels.bytes_per_pixel;
        if (at.x(), at.y(), size.x()) != (0, rows, header.layer_size.x())
            || block.data.len() != bytes
        {
            let what = format!("row {rows} is not where it must be");
            return Err(ImageFault::Damaged(what));
        }
        rows += size.y();
    }
    if rows == header.layer_size.y() {
        Ok(())
    } else {
        let what = format!("has {rows} of {} rows", header.layer_size.y());
        Err(ImageFault::Damaged(what))
    }
}

fn check_header(header: &Header, wanted: &ImageShape) -> Result<(), ImageFault> {
    let size = (header.layer_size.x(), header.layer_size.y());
    check_size(size, wanted)?;
    let found = header.channels.list.iter();
    let found = found.map(|c| (c.name.to_string(), c.sample_type));
    let found: Vec<(String, SampleType)> = found.collect();
    let planes = planes(wanted.channels).into_iter();
    let planes: Vec<_> = planes
        .map(|plane| (plane.name.to_owned(), plane.sample_type()))
        .collect();
    let is_whole = |c: &ChannelDescription| c.sampling.x() == 1 && c.sampling.y() == 1;
    let are_whole = header.channels.list.iter().all(is_whole);
    if are_whole && found.len() == planes.len() && planes.iter().all(|p| found.contains(p)) {
        return Ok(());
    }
    Err(ImageFault::Channels {
        found: listed(&found),
        wanted: listed(&planes),
    })
}

fn check_size(found: (usize, usize), wanted: &ImageShape) -> Result<(), ImageFault> {
    let wanted = (wanted.width, wanted.height);
    if found == (wanted.0 as usize, wanted.1 as usize) {
        Ok(())
    } else {
        Err(ImageFault::Size { found, wanted })
    }
}

fn listed(planes: &[(String, SampleType)]) -> String {
    let told = |(name, kind): &(String, SampleType)| match kind {
        SampleType::F16 => format!("{name} (half)"),
        SampleType::F32 => format!("{name} (float)"),
        SampleType::U32 => format!("{name} (uint)"),
    };
    planes.iter().map(told).collect::<Vec<_>>().join(", ")
}

/// Decodes the PNG file `file`.
///
/// # Errors
/// The first fault.
pub fn verify_preview(file: impl BufRead + Seek, wanted: &ImageShape) -> Result<(), ImageFault> {
    let mut options = png::DecodeOptions::default();
    options.set_ignore_checksums(false);
    let mut decoder = png::Decoder::new_with_options(file, options);
    let header = decoder.read_header_info()?;
    check_size((header.width as usize, header.height as usize), wanted)?;
    let mut reader = decoder.read_info()?;
    while reader.next_row()?.is_some() {}
    Ok(reader.finish()?)
}

#[cfg(test)]
#[path = "verify_tests.rs"]
mod tests;
