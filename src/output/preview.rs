//! A PNG to look at: the film over an opaque background, through the view transform.

use glam::Vec3;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::{
    OutputError,
    view::{byte_from_linear, view_transform},
};
use crate::render::Film;

/// How to show a film.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PreviewOptions {
    /// Brightens by this many stops (factors of two).
    pub exposure: f32,
    /// What lies behind a film that was rendered with a transparent background (linear RGB). A film
    /// that has its background in its colours shows that: leave this `None`.
    pub backdrop: Option<Vec3>,
}

/// Encodes `film` as an 8-bit sRGB PNG.
///
/// # Errors
/// If the encoder refuses the image.
pub fn encode_preview(film: &Film, options: &PreviewOptions) -> Result<Vec<u8>, OutputError> {
    let gain = options.exposure.exp2();
    let mut pixels = Vec::with_capacity(film.color.len() * 3);
    for &[r, g, b, a] in &film.color {
        let behind = options.backdrop.unwrap_or_default() * (1.0 - a);
        let shown = view_transform((Vec3::new(r, g, b) + behind) * gain);
        pixels.extend(shown.to_array().map(byte_from_linear));
    }
    let mut file = Vec::new();
    PngEncoder::new(&mut file)
        .write_image(&pixels, film.width, film.height, ExtendedColorType::Rgb8)
        .map_err(OutputError::Png)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Channels;

    fn decode(png: &[u8]) -> image::RgbImage {
        let image = image::load_from_memory_with_format(png, image::ImageFormat::Png);
        image.unwrap().into_rgb8()
    }

    fn film() -> Film {
        let mut film = Film::new(2, 1, Channels::COLOR);
        film.color = vec![[0.18, 0.18, 0.18, 0.0], [0.09, 0.0, 50.0, 0.5]];
        film
    }

    #[test]
    fn shows_the_film_in_srgb() {
        let png = encode_preview(&film(), &PreviewOptions::default()).unwrap();
        let image = decode(&png);
        assert_eq!(image.dimensions(), (2, 1));
        assert_eq!(image.get_pixel(0, 0).0, [118; 3]);
        assert!(image.get_pixel(1, 0).0[2] >= 254);
        let again = encode_preview(&film(), &PreviewOptions::default()).unwrap();
        assert_eq!(png, again);
    }

    #[test]
    fn exposure_and_backdrop() {
        let options = PreviewOptions {
            exposure: 1.0,
            backdrop: None,
        };
        let image = decode(&encode_preview(&film(), &options).unwrap());
        assert_eq!(image.get_pixel(0, 0).0, [byte_from_linear(0.36); 3]);
        let options = PreviewOptions {
            exposure: 0.0,
            backdrop: Some(Vec3::new(0.18, 0.2, 0.0)),
        };
        let image = decode(&encode_preview(&film(), &options).unwrap());
        assert_eq!(image.get_pixel(0, 0).0[0], byte_from_linear(0.36));
    }
}
