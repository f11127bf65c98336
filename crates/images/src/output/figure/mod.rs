//! Figures for print: pictures of pixels under overlays that are not pixels, as PDF and SVG.
//!
//! Both formats take the drawing commands of overlays, so that labels are where those of PNG files are.

use std::io::{self, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;

use crate::overlay::{Drawing, Stroke};

mod pdf;
mod svg;

/// Opacity of halos: that of previews.
const HALO: f32 = 0.8;

/// Points in an inch, as in PostScript and PDF.
const POINTS_PER_INCH: f32 = 72.0;

/// Pixels per inch of figures whose pictures do not say it: that of CSS.
const USUAL_DPI: u32 = 96;

/// A page with pictures and overlays. Lengths are in pixels, from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Width and height.
    pub size: [u32; 2],
    /// Pixels per inch on paper, if known.
    pub dpi: Option<u32>,
    /// The colour of the page, sRGB; None for a transparent one.
    pub paper: Option<[u8; 3]>,
    /// The pictures, the first one farthest from the viewer.
    pub pictures: Vec<FigurePicture>,
    /// What is drawn over them.
    pub drawings: Vec<Drawing>,
}

/// A picture on a page.
#[derive(Debug, Clone, PartialEq)]
pub struct FigurePicture {
    /// Width and height in its own pixels.
    pub size: [u32; 2],
    /// 8-bit sRGB, row by row from the top: RGB, or RGBA whose colours are not multiplied by alpha.
    pub bytes: Vec<u8>,
    /// Whether the pixels have alpha.
    pub has_alpha: bool,
    /// Left and top on the page.
    pub at: [u32; 2],
    /// Width and height on the page.
    pub shown: [u32; 2],
}

impl Figure {
    /// The figure as a PDF file: pictures without loss, text as text in the embedded font.
    ///
    /// # Errors
    /// The compression fails.
    pub fn to_pdf(&self) -> io::Result<Vec<u8>> {
        pdf::encode(self)
    }

    /// The figure as an SVG file: pictures as PNG, text as outlines with its words as labels.
    ///
    /// # Errors
    /// The encoder of the pictures fails.
    pub fn to_svg(&self) -> io::Result<Vec<u8>> {
        svg::encode(self)
    }

    fn pixels_per_inch(&self) -> f32 {
        self.dpi.unwrap_or(USUAL_DPI).max(1) as f32
    }
}

impl FigurePicture {
    /// Colours and, if there is one, alpha.
    fn planes(&self) -> (Vec<u8>, Option<Vec<u8>>) {
        if !self.has_alpha {
            return (self.bytes.clone(), None);
        }
        let pixels = self.bytes.as_chunks::<4>().0;
        let colors = pixels.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect();
        (colors, Some(pixels.iter().map(|pixel| pixel[3]).collect()))
    }
}

/// `bytes` compressed for a stream of a PDF file.
fn deflated(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// The outline of a glyph with cubic curves only.
fn cubics(strokes: Vec<Stroke>) -> Vec<Stroke> {
    // Raise the degree of quadratic curves, which keeps their shape
    let mut at = [0.0; 2];
    let cubic = strokes.into_iter().map(|stroke| match stroke {
        Stroke::Start(end) | Stroke::Line(end) => {
            at = end;
            stroke
        }
        Stroke::Quadratic(control, end) => {
            let toward = |from: [f32; 2]| {
                [0, 1].map(|axis| from[axis] + 2.0 / 3.0 * (control[axis] - from[axis]))
            };
            let cubic = Stroke::Cubic(toward(at), toward(end), end);
            at = end;
            cubic
        }
        Stroke::Cubic(_, _, end) => {
            at = end;
            stroke
        }
    });
    cubic.collect()
}

#[cfg(test)]
mod tests;
