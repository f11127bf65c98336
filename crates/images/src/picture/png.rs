//! PNG files of 8-bit RGB.

use std::io::{self, Read};

use png::{
    BitDepth, ColorType, Compression, DecodingError, Encoder, Limits, PixelDimensions,
    Transformations, Unit,
};

use super::{Fault, Picture, check_size};

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

/// Decodes a file. Transparent pixels show white.
pub(super) fn picture(file: impl Read) -> Result<Picture, Fault> {
    let (width, pixels) = rgba(file)?;
    let rgb = pixels.iter().flat_map(|&[r, g, b, a]| [r, g, b].map(|v| over_white(v, a)));
    Ok(Picture::new(width, pixels.len() / width, rgb.collect()))
}

/// Decodes a file: the width, and the pixels, whose colours are not multiplied by alpha.
pub(super) fn rgba(file: impl Read) -> Result<(usize, Vec<[u8; 4]>), Fault> {
    let mut decoder = png::Decoder::new_with_limits(file, Limits { bytes: MAX_CHUNKS });
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    check_size(width, height)?;
    let mut bytes = vec![0; reader.output_buffer_size()];
    let frame = reader.next_frame(&mut bytes)?;
    bytes.truncate(frame.buffer_size());
    let pixels = match frame.color_type {
        ColorType::Rgb => pixels_of(&bytes, |&[r, g, b]| [r, g, b, 255]),
        ColorType::Rgba => bytes.as_chunks().0.to_vec(),
        ColorType::Grayscale => pixels_of(&bytes, |&[v]| [v, v, v, 255]),
        ColorType::GrayscaleAlpha => pixels_of(&bytes, |&[v, a]| [v, v, v, a]),
        ColorType::Indexed => {
            return Err(Fault::Other("has colours that cannot be expanded".into()));
        }
    };
    if pixels.len() != width * height {
        return Err(Fault::Other("has not all of its pixels".to_owned()));
    }
    Ok((width, pixels))
}

/// Pixels per inch on paper, if a file says so for both sides alike.
pub(super) fn dpi(file: impl Read) -> Result<Option<u32>, Fault> {
    let decoder = png::Decoder::new_with_limits(file, Limits { bytes: MAX_CHUNKS });
    let reader = decoder.read_info()?;
    let stored = reader.info().pixel_dims.filter(|d| d.unit == Unit::Meter && d.xppu == d.yppu);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive; saturates"
    )]
    let dpi = stored.map(|stored| (f64::from(stored.xppu) * 0.0254).round() as u32);
    Ok(dpi.filter(|dpi| *dpi > 0))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive; saturates")]
fn per_metre(dpi: u32) -> u32 {
    (f64::from(dpi) / 0.0254).round() as u32
}

fn pixels_of<const N: usize>(bytes: &[u8], rgba: impl Fn(&[u8; N]) -> [u8; 4]) -> Vec<[u8; 4]> {
    bytes.as_chunks::<N>().0.iter().map(rgba).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "at most 255")]
fn over_white(value: u8, alpha: u8) -> u8 {
    let (value, alpha) = (u32::from(value), u32::from(alpha));
    ((value * alpha + 255 * (255 - alpha) + 127) / 255) as u8
}

/// See [`Picture::png`].
pub(super) fn encode(picture: &Picture, software: &str, dpi: Option<u32>) -> io::Result<Vec<u8>> {
    let side = |side: usize| u32::try_from(side).map_err(io::Error::other);
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, side(picture.width)?, side(picture.height)?);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Default);
    encoder.set_adaptive_filter(png::AdaptiveFilterType::Adaptive);
    encoder.add_text_chunk("Software".to_owned(), software.to_owned())?;
    encoder.set_pixel_dims(dpi.map(|dpi| {
        let per_metre = per_metre(dpi);
        PixelDimensions { xppu: per_metre, yppu: per_metre, unit: Unit::Meter }
    }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&picture.rgb)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn reads(color: ColorType, depth: BitDepth, data: &[u8], expected: [u8; 3]) {
        let mut file = Vec::new();
        let mut encoder = Encoder::new(&mut file, 1, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        assert_eq!(picture(&file[..]).unwrap().rgb(), expected);
    }

    #[test]
    fn other_kinds_of_pixels_become_rgb() {
        reads(ColorType::Rgb, BitDepth::Eight, &[1, 2, 3], [1, 2, 3]);
        reads(ColorType::Rgb, BitDepth::Sixteen, &[1, 9, 2, 9, 3, 9], [1, 2, 3]);
        reads(ColorType::Grayscale, BitDepth::One, &[0x80], [255; 3]);
        reads(ColorType::Rgba, BitDepth::Eight, &[0, 100, 255, 51], [204, 224, 255]);
        reads(ColorType::GrayscaleAlpha, BitDepth::Eight, &[7, 0], [255; 3]);
    }

    #[test]
    fn written_files_read_back_and_name_their_origin() {
        let pixels: Vec<u8> = (0..3 * 7 * 5).map(|i: u8| i.wrapping_mul(37)).collect();
        let written = Picture::new(7, 5, pixels);
        let file = encode(&written, "origin", Some(300)).unwrap();
        assert_eq!(picture(&file[..]).unwrap(), written);
        assert!(file.windows(6).any(|bytes| bytes == b"origin"));
        assert_eq!(dpi(&file[..]).unwrap(), Some(300));
    }
}
