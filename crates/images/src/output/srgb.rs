//! Pixels of encoded pictures in memory.

use super::OutputError;

/// Pixels in 8-bit sRGB, row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SrgbPixels {
    /// Bytes of each pixel: 3 for red, green and blue, 4 with alpha.
    pub channels: usize,
    /// The bytes of all pixels.
    pub bytes: Vec<u8>,
}

impl SrgbPixels {
    /// The pixels of a PNG file that this crate has encoded.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn decode(png: &[u8]) -> Result<Self, OutputError> {
        let image = image::load_from_memory(png).map_err(OutputError::Png)?;
        Ok(Self { channels: image.color().channel_count().into(), bytes: image.into_bytes() })
    }
}
