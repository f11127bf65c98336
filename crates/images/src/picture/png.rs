//! PNG files of 8-bit RGB.

use std::io::{self, Read};

use png::{BitDepth, ColorType, Compression, Encoder, PixelDimensions, Unit};

use super::{Picture, check_size};
use crate::file::Fault;
use crate::file::png::{PngSamples, decoder};

/// Decodes a file. Transparent pixels show white.
pub(super) fn picture(file: impl Read) -> Result<Picture, Fault> {
    let (width, pixels) = rgba(file)?;
    let rgb = pixels.iter().flat_map(|&[r, g, b, a]| [r, g, b].map(|v| over_white(v, a)));
    Ok(Picture::new(width, pixels.len() / width, rgb.collect()))
}

/// Decodes a file: the width, and the pixels, whose colours are not multiplied by alpha.
pub(super) fn rgba(file: impl Read) -> Result<(usize, Vec<[u8; 4]>), Fault> {
    let samples = PngSamples::decode(file, check_size)?;
    let byte =
        |code: u16| if samples.is_deep { code.to_be_bytes()[0] } else { code.to_be_bytes()[1] };
    Ok((samples.width, samples.rgba().map(|pixel| pixel.map(byte)).collect()))
}

/// Pixels per inch on paper, if a file says so for both sides alike.
pub(super) fn dpi(file: impl Read) -> Result<Option<u32>, Fault> {
    let reader = decoder(file).read_info()?;
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
