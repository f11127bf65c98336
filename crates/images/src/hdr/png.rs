//! PNG images of 8 or 16 bits, in sRGB.

use std::io::Read;

use glam::Vec3;
use png::{BitDepth, ColorType, DecodingError, Limits, Transformations};

use super::{Check, Fault, Pixels};
use crate::scene::RgbEncoding;

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

/// Decodes a file. Transparent pixels show the colour `behind`.
pub(super) fn decode(file: impl Read, check: Check, behind: Vec3) -> Result<Pixels, Fault> {
    let mut decoder = png::Decoder::new_with_limits(file, Limits { bytes: MAX_CHUNKS });
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    check(width, height)?;
    let mut bytes = vec![0; reader.output_buffer_size()];
    let frame = reader.next_frame(&mut bytes)?;
    let bytes = &bytes[..frame.buffer_size()];
    // Decode the codes of samples by a table
    let encoding = match frame.bit_depth {
        BitDepth::Sixteen => RgbEncoding::Srgb16,
        _ => RgbEncoding::Srgb8,
    };
    let codes: u16 = match encoding {
        RgbEncoding::Srgb16 => u16::MAX,
        RgbEncoding::Srgb8 | RgbEncoding::Linear => 255,
    };
    let linear = |code: u16| encoding.color([f64::from(code), 0.0, 0.0]).x;
    let table: Vec<f32> = (0..=codes).map(linear).collect();
    let (channels, has_alpha) = match frame.color_type {
        ColorType::Grayscale => (1, false),
        ColorType::GrayscaleAlpha => (2, true),
        ColorType::Rgb => (3, false),
        ColorType::Rgba => (4, true),
        ColorType::Indexed => {
            return Err(Fault::Other("its palette cannot be decoded".to_owned()));
        }
    };
    let pixel = |codes_of: &dyn Fn(usize) -> u16| {
        let value = |c: usize| table[usize::from(codes_of(c))];
        let color = match channels {
            1 | 2 => Vec3::splat(value(0)),
            _ => Vec3::new(value(0), value(1), value(2)),
        };
        let alpha =
            if has_alpha { f32::from(codes_of(channels - 1)) / f32::from(codes) } else { 1.0 };
        behind.lerp(color, alpha)
    };
    let pixels: Vec<Vec3> = match encoding {
        RgbEncoding::Srgb16 => (bytes.chunks_exact(2 * channels))
            .map(|p| pixel(&|c| u16::from_be_bytes([p[2 * c], p[2 * c + 1]])))
            .collect(),
        RgbEncoding::Srgb8 | RgbEncoding::Linear => {
            (bytes.chunks_exact(channels)).map(|p| pixel(&|c| u16::from(p[c]))).collect()
        }
    };
    if pixels.len() != width * height {
        return Err(Fault::Other("ends before its last row".to_owned()));
    }
    Ok(Pixels { width, height, pixels })
}
