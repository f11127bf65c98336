//! PNG previews: the film after the view transform, with its alpha if the background is transparent.

use glam::Vec3;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::{
    OutputError,
    view::{DisplayView, byte_from_linear, bytes_from_linear, dither_threshold},
};
use crate::math::Supported;
use crate::overlay::{Page, Sprite};
use crate::render::Film;

/// Settings of a preview.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PreviewOptions {
    /// How scene light is shown.
    pub view: DisplayView,
    /// What is behind the film.
    pub background: PreviewBackground,
    /// Column and row of the first pixel in the whole image, so that the dithering of a part is that of the whole.
    pub first_pixel: [i32; 2],
    /// Pixels per inch on paper, if they are stored.
    pub dpi: Option<u32>,
    /// The page that the film is on, if it is larger.
    pub page: Option<PreviewPage>,
}

/// A page with a picture and overlays beside it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreviewPage {
    /// Where the film is.
    pub page: Page,
    /// The colour around the film, linear RGB; without it if the background is transparent.
    pub paper: Vec3,
}

/// What is behind the film in a preview.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum PreviewBackground {
    /// Nothing more: its colours include the background.
    #[default]
    Included,
    /// Nothing: the PNG has alpha, and its colours are not multiplied by it.
    Transparent,
    /// A colour, linear RGB.
    Color(Vec3),
}

/// Encodes `film` as an 8-bit sRGB PNG, dithered, with `overlays` over it.
///
/// # Errors
/// If the encoder refuses the image.
pub fn encode_preview(
    film: &Film,
    options: &PreviewOptions,
    overlays: &[Sprite],
) -> Result<Vec<u8>, OutputError> {
    let picture = SrgbPicture::of(film, options, overlays);
    let color_type =
        if picture.has_alpha { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
    let mut file = Vec::new();
    PngEncoder::new(&mut file)
        .write_image(&picture.bytes, picture.width, picture.height, color_type)
        .map_err(OutputError::Png)?;
    if let Some(dpi) = options.dpi {
        file.splice(AFTER_HEADER..AFTER_HEADER, density_chunk(dpi));
    }
    Ok(file)
}

/// Memory for encoding a preview: its bytes, plain, filtered and compressed.
pub fn picture_bytes(width: u32, height: u32, options: &PreviewOptions) -> u64 {
    let each = match options.background {
        PreviewBackground::Transparent => 12,
        PreviewBackground::Included | PreviewBackground::Color(_) => 9,
    };
    each * u64::from(width) * u64::from(height)
}

/// A finished picture: 8-bit sRGB, dithered.
pub(super) struct SrgbPicture {
    /// RGB, or RGBA with colours that are not multiplied by alpha, row by row from the top.
    pub(super) bytes: Vec<u8>,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) has_alpha: bool,
}

impl SrgbPicture {
    /// The picture of `film` on its page, with `overlays` over it.
    pub(super) fn of(film: &Film, options: &PreviewOptions, overlays: &[Sprite]) -> Self {
        let plain = Self::of_film(film, options);
        let mut picture = match options.page {
            Some(page) => plain.on(&page),
            None => plain,
        };
        let pixel_len = if picture.has_alpha { 4 } else { 3 };
        let rows = picture.bytes.chunks_mut(pixel_len * picture.width.max(1) as usize);
        for (row, y) in rows.zip(0..) {
            for overlay in overlays {
                if picture.has_alpha {
                    overlay.draw_over_rgba(y, row);
                } else {
                    overlay.draw_over(y, row);
                }
            }
        }
        picture
    }

    /// The same on paper.
    fn on(&self, PreviewPage { page, paper }: &PreviewPage) -> Self {
        let [width, height] = page.size;
        let srgb = paper.to_array().map(|v| byte_from_linear(v, 0.5));
        let paper: &[u8] = if self.has_alpha { &[0; 4] } else { &srgb };
        let pixel_len = paper.len();
        let mut bytes = paper.repeat(width as usize * height as usize);
        let own = self.bytes.chunks(pixel_len * self.width.max(1) as usize);
        let left = pixel_len * page.at[0] as usize;
        let rows = bytes.chunks_mut(pixel_len * width.max(1) as usize).skip(page.at[1] as usize);
        for (row, own) in rows.zip(own) {
            let room = row.get_mut(left..).unwrap_or_default();
            for (byte, own) in room.iter_mut().zip(own) {
                *byte = *own;
            }
        }
        Self { bytes, width, height, has_alpha: self.has_alpha }
    }

    /// The picture of `film` alone.
    pub(super) fn of_film(film: &Film, options: &PreviewOptions) -> Self {
        // Prepare buffers for a row
        let display = options.view.conversion();
        let width = film.width.max(1) as usize;
        let is_transparent = options.background == PreviewBackground::Transparent;
        let pixel_len = if is_transparent { 4 } else { 3 };
        let mut bytes = vec![0; film.color.len() * pixel_len];
        let (mut linear, mut thresholds) = (vec![0.0; 3 * width], vec![0.0; 3 * width]);
        let mut colors = vec![0; 3 * width];
        let rows = film.color.chunks(width).zip(bytes.chunks_mut(pixel_len * width));
        for (y, (row, bytes)) in (0..film.height).zip(rows) {
            // Put pixels before the background, and map them to what a screen shows
            let pixels = linear.as_chunks_mut().0.iter_mut();
            for (pixel, &[r, g, b, a]) in pixels.zip(row) {
                let color = match options.background {
                    PreviewBackground::Included => Vec3::new(r, g, b),
                    PreviewBackground::Transparent => straight(Vec3::new(r, g, b), a),
                    PreviewBackground::Color(color) => Vec3::new(r, g, b) + color * (1.0 - a),
                };
                *pixel = display(color).to_array();
            }
            // Round them with a pattern, which hides bands
            let pixels = thresholds.as_chunks_mut::<3>().0.iter_mut();
            let [left, top] = options.first_pixel.map(i32::cast_unsigned);
            for (pixel, x) in pixels.zip(0..film.width) {
                // One threshold for all components, so that grey stays grey
                *pixel = [dither_threshold(left.wrapping_add(x), top.wrapping_add(y)); 3];
            }
            bytes_from_linear(Supported::default(), &linear, &thresholds, &mut colors);
            // Write the row
            if is_transparent {
                add_alpha(&colors, row, &thresholds, bytes);
            } else {
                bytes.copy_from_slice(&colors);
            }
        }
        Self { bytes, width: film.width, height: film.height, has_alpha: is_transparent }
    }
}

/// A colour that is not multiplied by `alpha`; black where nothing covers the background.
fn straight(premultiplied: Vec3, alpha: f32) -> Vec3 {
    if alpha > 0.0 { premultiplied / alpha } else { Vec3::ZERO }
}

/// Joins the `colors` of a row with the alpha of `pixels`, dithered like them.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "in 0 to 255 after clamping; NaN becomes 0"
)]
fn add_alpha(colors: &[u8], pixels: &[[f32; 4]], thresholds: &[f32], rgba: &mut [u8]) {
    let colors = colors.as_chunks::<3>().0.iter();
    let thresholds = thresholds.as_chunks::<3>().0.iter();
    let pixels = pixels.iter().zip(colors).zip(thresholds);
    for (rgba, ((pixel, &[r, g, b]), [threshold, ..])) in
        rgba.as_chunks_mut().0.iter_mut().zip(pixels)
    {
        let alpha = pixel[3].clamp(0.0, 1.0) * 255.0 + threshold;
        *rgba = [r, g, b, alpha as u8];
    }
}

/// Bytes of a PNG file up to the chunk after `IHDR`: signature, and a chunk with 13 bytes of data.
const AFTER_HEADER: usize = 8 + 12 + 13;

/// The chunk `pHYs`: pixels per metre along both axes.
fn density_chunk(dpi: u32) -> Vec<u8> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive; saturates"
    )]
    let per_metre = (f64::from(dpi) / 0.0254).round() as u32;
    let mut chunk = b"pHYs".to_vec();
    chunk.extend(per_metre.to_be_bytes());
    chunk.extend(per_metre.to_be_bytes());
    // The unit is the metre
    chunk.push(1);
    let crc = crc32fast::hash(&chunk);
    let length: u32 = 9;
    [&length.to_be_bytes()[..], &chunk, &crc.to_be_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::view::srgb_from_linear;
    use crate::render::Channels;

    fn decode(png: &[u8]) -> image::RgbImage {
        let image = image::load_from_memory_with_format(png, image::ImageFormat::Png);
        image.unwrap().into_rgb8()
    }

    /// A film of one colour.
    fn film(color: [f32; 4]) -> Film {
        let mut film = Film::new(24, 8, Channels::COLOR);
        film.color.fill(color);
        film
    }

    /// Mean of each 8-bit component in the preview of a film of one `color`.
    fn mean(color: [f32; 4], options: &PreviewOptions) -> Vec3 {
        let image = decode(&encode_preview(&film(color), options, &[]).unwrap());
        let count = f32::from(u8::try_from(image.pixels().len()).unwrap());
        let bytes = |pixel: &image::Rgb<u8>| Vec3::from_array(pixel.0.map(f32::from));
        image.pixels().map(bytes).sum::<Vec3>() / count
    }

    fn assert_near(shown: f32, linear: f32) {
        let expected = 255.0 * srgb_from_linear(linear);
        assert!((shown - expected).abs() < 0.05, "{shown} {expected}");
    }

    #[test]
    fn shows_the_film_in_srgb() {
        let options = PreviewOptions::default();
        let png = encode_preview(&film([0.18, 0.02, 50.0, 0.5]), &options, &[]).unwrap();
        assert_eq!(decode(&png).dimensions(), (24, 8));
        let again = encode_preview(&film([0.18, 0.02, 50.0, 0.5]), &options, &[]).unwrap();
        assert_eq!(png, again);
        let shown = mean([0.18, 0.02, 0.5, 0.0], &options);
        assert_near(shown.x, 0.18);
        assert_near(shown.y, 0.02);
        assert_near(shown.z, 0.5);
    }

    #[test]
    fn black_and_white_are_exact() {
        let options = PreviewOptions::default();
        assert_eq!(mean([1.0, 1.0, 1.0, 0.0], &options), Vec3::splat(255.0));
        assert_eq!(mean([0.0, 0.0, 0.0, 1.0], &options), Vec3::ZERO);
        assert_eq!(mean([7.0, 7.0, 7.0, 1.0], &options), Vec3::splat(255.0));
    }

    #[test]
    fn faint_gradient_has_no_banding() {
        // The gradient spans about three 8-bit values. Without dithering, each band would be hundreds of pixels wide.
        let mut film = Film::new(600, 16, Channels::COLOR);
        for (index, color) in film.color.iter_mut().enumerate() {
            let across = (index % 600) as f32 / 600.0;
            *color = [0.2 + 0.006 * across, 0.2, 0.2, 1.0];
        }
        let image = decode(&encode_preview(&film, &PreviewOptions::default(), &[]).unwrap());
        for left in (0..600).step_by(16).filter(|left| left + 16 <= 600) {
            let (mut shown, mut expected) = (0.0, 0.0);
            for (x, y) in (0..256).map(|i| (left + i % 16, i / 16)) {
                shown += f32::from(image.get_pixel(x, y).0[0]) / 256.0;
                expected += 255.0 * srgb_from_linear(0.2 + 0.006 * x as f32 / 600.0) / 256.0;
            }
            assert!((shown - expected).abs() < 0.05, "{left}: {shown} {expected}");
        }
    }

    #[test]
    fn exposure_and_background() {
        let options = PreviewOptions {
            view: DisplayView { exposure: 1.0, ..DisplayView::default() },
            ..PreviewOptions::default()
        };
        assert_near(mean([0.18, 0.0, 0.0, 1.0], &options).x, 0.36);
        let options = PreviewOptions {
            background: PreviewBackground::Color(Vec3::new(0.18, 0.2, 0.0)),
            ..PreviewOptions::default()
        };
        assert_near(mean([0.09, 0.0, 0.0, 0.5], &options).x, 0.18);
    }

    #[test]
    fn a_transparent_background_has_straight_alpha() {
        let options = PreviewOptions {
            background: PreviewBackground::Transparent,
            ..PreviewOptions::default()
        };
        let mut film = film([0.0; 4]);
        film.color[1] = [0.5, 0.02, 1.0, 1.0];
        film.color[2] = [0.09, 0.01, 0.5, 0.5];
        film.color[3] = [f32::NAN, 0.5, 0.5, f32::NAN];
        let png = encode_preview(&film, &options, &[]).unwrap();
        let image = image::load_from_memory(&png).unwrap();
        assert_eq!(image.color(), image::ColorType::Rgba8);
        let pixels: Vec<[u8; 4]> = image.into_rgba8().pixels().map(|p| p.0).collect();
        assert_eq!(pixels[0], [0; 4]);
        // Colours are those of what covers the pixel, whatever part of it
        for (pixel, linear, alpha) in
            [(pixels[1], [0.5, 0.02, 1.0], 255.0), (pixels[2], [0.18, 0.02, 1.0], 127.5)]
        {
            let [r, g, b] = linear.map(|linear| 255.0 * srgb_from_linear(linear));
            for (byte, expected) in pixel.into_iter().zip([r, g, b, alpha]) {
                assert!((f32::from(byte) - expected).abs() <= 1.0, "{pixel:?}");
            }
        }
        assert_eq!(pixels[1][3], 255);
        assert_eq!(pixels[3][3], 0);
    }
}
