//! Decodes PNG files of all kinds to the codes of their samples.

use std::io::Read;

use png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations};

use super::Fault;

/// Maximum memory of the decoder for chunks other than pixels, bytes.
const MAX_CHUNKS: usize = 64 << 20;

impl From<DecodingError> for Fault {
    fn from(error: DecodingError) -> Self {
        match error {
            DecodingError::IoError(error) => Self::Io(error),
            other => Self::Other(format!("cannot be decoded: {other}")),
        }
    }
}

/// A decoder with bounded memory.
pub(crate) fn decoder<R: Read>(file: R) -> Decoder<R> {
    Decoder::new_with_limits(file, Limits { bytes: MAX_CHUNKS })
}

/// The samples of a file, row by row from the top.
pub(crate) struct PngSamples {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Whether samples have 16 bits instead of 8.
    pub(crate) is_deep: bool,
    channels: usize,
    bytes: Vec<u8>,
}

impl PngSamples {
    /// Decodes `file`. `check` refuses sizes.
    pub(crate) fn decode(
        file: impl Read,
        check: impl Fn(usize, usize) -> Result<(), Fault>,
    ) -> Result<Self, Fault> {
        // Read the header, and check the size before pixels are decoded
        let mut decoder = decoder(file);
        // Palettes and few bits become bytes
        decoder.set_transformations(Transformations::EXPAND);
        let mut reader = decoder.read_info()?;
        let (width, height) = (reader.info().width as usize, reader.info().height as usize);
        check(width, height)?;
        // Decode the pixels
        let mut bytes = vec![0; reader.output_buffer_size()];
        let frame = reader.next_frame(&mut bytes)?;
        bytes.truncate(frame.buffer_size());
        // Check that they are what the rest of the program expects
        let channels = match frame.color_type {
            ColorType::Indexed => {
                return Err(Fault::Other("has colours that cannot be expanded".to_owned()));
            }
            other => other.samples(),
        };
        let is_deep = frame.bit_depth == BitDepth::Sixteen;
        let samples = Self { width, height, is_deep, channels, bytes };
        if samples.bytes.len() != width * height * samples.pixel_bytes() {
            return Err(Fault::Other("has not all of its pixels".to_owned()));
        }
        Ok(samples)
    }

    const fn pixel_bytes(&self) -> usize {
        if self.is_deep { 2 * self.channels } else { self.channels }
    }

    /// The code of full brightness and of full coverage.
    pub(crate) const fn max_code(&self) -> u16 {
        if self.is_deep { u16::MAX } else { 255 }
    }

    /// Codes of red, green, blue and alpha of each pixel; colours are not multiplied by alpha.
    pub(crate) fn rgba(&self) -> impl Iterator<Item = [u16; 4]> {
        let max = self.max_code();
        self.bytes.chunks_exact(self.pixel_bytes()).map(move |pixel| {
            let code = |channel: usize| {
                if self.is_deep {
                    u16::from_be_bytes([pixel[2 * channel], pixel[2 * channel + 1]])
                } else {
                    pixel[channel].into()
                }
            };
            match self.channels {
                1 => [code(0), code(0), code(0), max],
                2 => [code(0), code(0), code(0), code(1)],
                3 => [code(0), code(1), code(2), max],
                _ => [code(0), code(1), code(2), code(3)],
            }
        })
    }
}
