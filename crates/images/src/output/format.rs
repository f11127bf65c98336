//! Formats of picture files, and JPEG and TIFF files of finished pictures.

use std::io::Cursor;
use std::path::Path;

use image::ExtendedColorType;
use image::codecs::jpeg::{JpegEncoder, PixelDensity};
use tiff::TiffError;
use tiff::encoder::colortype::RGB8;
use tiff::encoder::{Compression, Rational, TiffEncoder};
use tiff::tags::{ExtraSamples, ResolutionUnit};

use super::OutputError;
use super::figure::{Figure, FigurePicture};
use super::preview::{PreviewBackground, PreviewOptions, PreviewPage, SrgbPicture, encode_preview};
use super::view::byte_from_linear;
use crate::overlay::{Drawing, Page, Sprite};
use crate::render::Film;

/// The format of a picture file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// OpenEXR, with all channels.
    Exr,
    /// PNG with 8 bits.
    Png,
    /// JPEG, without alpha.
    Jpeg,
    /// TIFF with 8 bits.
    Tiff,
    /// PDF: the pixels of the particles, with overlays as text and shapes.
    Pdf,
    /// SVG: the same.
    Svg,
}

/// Quality of JPEG files, 1 to 100: no visible loss.
const JPEG_QUALITY: u8 = 95;

impl PictureFormat {
    /// The format of the ending of a file name.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match &*extension {
            "exr" => Self::Exr,
            "png" => Self::Png,
            "jpg" | "jpeg" => Self::Jpeg,
            "tif" | "tiff" => Self::Tiff,
            "pdf" => Self::Pdf,
            "svg" => Self::Svg,
            _ => return None,
        })
    }
}

/// Encodes `film` as a PDF or SVG file after the view transform, with `drawings` over it. Other formats are PDF.
///
/// # Errors
/// The encoder refuses the picture.
pub fn encode_figure(
    film: &Film,
    options: &PreviewOptions,
    drawings: Vec<Drawing>,
    format: PictureFormat,
) -> Result<Vec<u8>, OutputError> {
    let figure = figure(SrgbPicture::of_film(film, options), options, drawings);
    encoded(&figure, format)
}

fn encoded(figure: &Figure, format: PictureFormat) -> Result<Vec<u8>, OutputError> {
    let encoded = match format {
        PictureFormat::Svg => figure.to_svg(),
        _ => figure.to_pdf(),
    };
    encoded.map_err(OutputError::Figure)
}

/// The page of a picture.
fn figure(picture: SrgbPicture, options: &PreviewOptions, drawings: Vec<Drawing>) -> Figure {
    let own = [picture.width, picture.height];
    let (page, paper) = match options.page {
        Some(PreviewPage { page, paper }) => {
            let paper = paper.to_array().map(|v| byte_from_linear(v, 0.5));
            (page, Some(paper).filter(|_| !picture.has_alpha))
        }
        None => (Page::whole(own[0], own[1]), None),
    };
    let picture = FigurePicture {
        size: own,
        bytes: picture.bytes,
        has_alpha: picture.has_alpha,
        at: page.at,
        shown: own,
    };
    Figure { size: page.size, dpi: options.dpi, paper, pictures: vec![picture], drawings }
}

/// Encodes `film` as a PNG, JPEG or TIFF file after the view transform, with `overlays` over it.
///
/// # Errors
/// The encoder refuses the image, or the format has no alpha, which the background needs.
pub fn encode_picture(
    film: &Film,
    options: &PreviewOptions,
    overlays: &[Sprite],
    format: PictureFormat,
) -> Result<Vec<u8>, OutputError> {
    match format {
        PictureFormat::Exr | PictureFormat::Png => encode_preview(film, options, overlays),
        PictureFormat::Jpeg if options.background == PreviewBackground::Transparent => {
            Err(OutputError::NoAlpha)
        }
        PictureFormat::Jpeg => jpeg(&SrgbPicture::of(film, options, overlays), options.dpi),
        PictureFormat::Tiff => {
            tiff(&SrgbPicture::of(film, options, overlays), options.dpi).map_err(OutputError::Tiff)
        }
        PictureFormat::Pdf | PictureFormat::Svg => {
            // Overlays that were drawn already are pixels
            let picture = SrgbPicture::of(film, options, overlays);
            let options = PreviewOptions { page: None, ..*options };
            encoded(&figure(picture, &options, Vec::new()), format)
        }
    }
}

fn jpeg(picture: &SrgbPicture, dpi: Option<u32>) -> Result<Vec<u8>, OutputError> {
    let mut file = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY);
    if let Some(dpi) = dpi {
        encoder.set_pixel_density(PixelDensity::dpi(u16::try_from(dpi).unwrap_or(u16::MAX)));
    }
    let (width, height) = (picture.width, picture.height);
    let encoded = encoder.encode(&picture.bytes, width, height, ExtendedColorType::Rgb8);
    encoded.map_err(OutputError::Jpeg)?;
    Ok(file)
}

fn tiff(picture: &SrgbPicture, dpi: Option<u32>) -> Result<Vec<u8>, TiffError> {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file)?.with_compression(Compression::Lzw);
    let mut image = encoder.new_image::<RGB8>(picture.width, picture.height)?;
    if picture.has_alpha {
        image.extra_samples(&[ExtraSamples::UnassociatedAlpha])?;
    }
    if let Some(dpi) = dpi {
        image.resolution(ResolutionUnit::Inch, Rational { n: dpi, d: 1 });
    }
    image.write_data(&picture.bytes)?;
    Ok(file.into_inner())
}

#[cfg(test)]
mod tests {
    use tiff::decoder::{Decoder, DecodingResult, ifd};
    use tiff::tags::Tag;

    use super::*;
    use crate::render::Channels;

    fn film() -> Film {
        let mut film = Film::new(24, 8, Channels::COLOR);
        film.color.fill([0.5, 0.25, 0.0, 0.5]);
        film
    }

    fn encoded(format: PictureFormat, background: PreviewBackground) -> Vec<u8> {
        let options = PreviewOptions { background, dpi: Some(300), ..PreviewOptions::default() };
        encode_picture(&film(), &options, &[], format).unwrap()
    }

    #[test]
    fn endings_have_formats() {
        for (name, format) in [
            ("a.exr", Some(PictureFormat::Exr)),
            ("a.b.PNG", Some(PictureFormat::Png)),
            ("a.jpg", Some(PictureFormat::Jpeg)),
            ("a.JPEG", Some(PictureFormat::Jpeg)),
            ("a.tif", Some(PictureFormat::Tiff)),
            ("a.tiff", Some(PictureFormat::Tiff)),
            ("a.svg", Some(PictureFormat::Svg)),
            ("a.pdf", Some(PictureFormat::Pdf)),
            ("a.eps", None),
            ("png", None),
        ] {
            assert_eq!(PictureFormat::of(Path::new(name)), format, "{name}");
        }
    }

    #[test]
    fn tiff_has_the_pixels_of_png() {
        let mut decoded = Vec::new();
        for background in [PreviewBackground::Included, PreviewBackground::Transparent] {
            let png = encoded(PictureFormat::Png, background);
            let expected = image::load_from_memory(&png).unwrap();
            let file = encoded(PictureFormat::Tiff, background);
            let mut decoder = Decoder::new(Cursor::new(&file)).unwrap();
            let DecodingResult::U8(bytes) = decoder.read_image().unwrap() else {
                panic!("not 8 bits");
            };
            assert_eq!(bytes, expected.as_bytes());
            assert_eq!(decoder.dimensions().unwrap(), (24, 8));
            let dpi = decoder.get_tag(Tag::XResolution).unwrap();
            assert_eq!(dpi, ifd::Value::Rational(300, 1));
            decoded.push(decoder.find_tag(Tag::ExtraSamples).unwrap().is_some());
        }
        assert_eq!(decoded, [false, true]);
    }

    #[test]
    fn jpeg_is_close_to_png_and_has_no_alpha() {
        let png = encoded(PictureFormat::Png, PreviewBackground::Included);
        let png = image::load_from_memory(&png).unwrap().into_rgb8();
        let file = encoded(PictureFormat::Jpeg, PreviewBackground::Included);
        let jpeg = image::load_from_memory(&file).unwrap().into_rgb8();
        assert_eq!(jpeg.dimensions(), png.dimensions());
        for (found, expected) in jpeg.as_raw().iter().zip(png.as_raw()) {
            assert!(found.abs_diff(*expected) <= 4, "{found} {expected}");
        }
        // JFIF: dots per inch, 300 along both axes
        assert_eq!(file[13..18], [1, 1, 44, 1, 44]);
        let options = PreviewOptions {
            background: PreviewBackground::Transparent,
            ..PreviewOptions::default()
        };
        let error = encode_picture(&film(), &options, &[], PictureFormat::Jpeg).unwrap_err();
        assert!(error.to_string().contains("no alpha"), "{error}");
    }
}
