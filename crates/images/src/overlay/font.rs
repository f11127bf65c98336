//! The embedded font: DejaVu Sans with Latin, Greek and mathematical signs (`font/LICENSE_DEJAVU`).
//!
//! Outlines are rasterised by `ab_glyph`, whose arithmetic has no fused multiply-add and no function of the C library
//! except square roots, so that all machines draw the same bytes.

use ab_glyph::{Font as _, FontRef, GlyphId, OutlineCurve, PxScale, ScaleFont as _, point};

static BYTES: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");

/// Height of capitals and digits, in units of the size.
pub(super) const CAP_HEIGHT: f32 = 0.729;

/// Distance of baselines in units of the size.
pub(super) const LINE: f32 = 1.25;

/// The font in one size.
pub(super) struct Font {
    font: FontRef<'static>,
    /// Pixels per em.
    pub(super) size: f32,
    scale: PxScale,
}

impl Font {
    /// The font with `size` pixels per em.
    pub(super) fn new(size: f32) -> Self {
        let font = embedded();
        let per_em = font.units_per_em().unwrap_or(1.0);
        let scale = PxScale::from(size * font.height_unscaled() / per_em);
        Self { font, size, scale }
    }

    /// The glyphs of one line with their distances from its start, and the width of the line, pixels.
    fn line(&self, text: &str) -> (Vec<(GlyphId, f32)>, f32) {
        let scaled = self.font.as_scaled(self.scale);
        let (mut glyphs, mut x) = (Vec::new(), 0.0);
        let mut before = None;
        for c in text.chars() {
            // Characters without a glyph have a box, glyph 0
            let id = self.font.glyph_id(c);
            if let Some(before) = before {
                x += scaled.kern(before, id);
            }
            glyphs.push((id, x));
            x += scaled.h_advance(id);
            before = Some(id);
        }
        (glyphs, x)
    }

    /// Width of the longest line of `text` in pixels.
    pub(super) fn width(&self, text: &str) -> f32 {
        let widths = text.lines().map(|line| self.line(line).1);
        widths.fold(0.0, f32::max)
    }

    /// Calls `visit` with each pixel of one line and the part of it that is covered. `x` is its start, and `baseline` is
    /// rounded to a pixel.
    pub(super) fn draw(
        &self,
        text: &str,
        x: f32,
        baseline: f32,
        mut visit: impl FnMut(i32, i32, f32),
    ) {
        for (id, offset) in self.line(text).0 {
            let position = point(x + offset, baseline.round());
            let glyph = id.with_scale_and_position(self.scale, position);
            let Some(outline) = self.font.outline_glyph(glyph) else {
                continue;
            };
            let corner = outline.px_bounds().min;
            #[expect(clippy::cast_possible_truncation, reason = "pixels of a picture")]
            let (left, top) = (corner.x as i32, corner.y as i32);
            outline.draw(|x, y, coverage| {
                visit(x.cast_signed() + left, y.cast_signed() + top, coverage);
            });
        }
    }

    /// The glyphs of one line.
    pub(super) fn glyphs(&self, text: &str) -> Vec<Glyph> {
        let per_em = self.font.units_per_em().unwrap_or(1.0);
        let glyph = |(character, (id, x)): (char, (GlyphId, f32))| Glyph {
            id: id.0,
            character,
            x: x / self.size,
            advance: self.font.h_advance_unscaled(id) / per_em,
        };
        text.chars().zip(self.line(text).0).map(glyph).collect()
    }
}

/// A glyph of a line of text; lengths are in units of the size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glyph {
    /// Its number in the font.
    pub id: u16,
    /// The character that it stands for.
    pub character: char,
    /// Its distance from the start of the line.
    pub x: f32,
    /// Its width.
    pub advance: f32,
}

/// The embedded font as data for other programs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FontFile {
    /// The TrueType file.
    pub bytes: &'static [u8],
    /// Height of ascenders, depth of descenders (negative) and height of capitals, in units of the size.
    pub heights: [f32; 3],
    /// The box around all glyphs: left, bottom, right, top.
    pub bounds: [f32; 4],
}

/// The name of the font in PDF files; the letters before `+` say that it is a subset.
pub const FONT_NAME: &str = "SPHRLE+DejaVuSans";

/// The embedded font.
pub fn font_file() -> FontFile {
    let font = embedded();
    let per_em = font.units_per_em().unwrap_or(1.0);
    let heights = [font.ascent_unscaled() / per_em, font.descent_unscaled() / per_em, CAP_HEIGHT];
    FontFile { bytes: BYTES, heights, bounds: bounds(BYTES).map(|v| f32::from(v) / per_em) }
}

/// The box around all glyphs of a TrueType file, from its table `head`; empty if there is none.
fn bounds(bytes: &[u8]) -> [i16; 4] {
    let tables = bytes.get(12..).unwrap_or_default().as_chunks::<16>().0;
    let head = tables.iter().find(|table| table.starts_with(b"head"));
    let place = head.map(|table| u32::from_be_bytes([table[8], table[9], table[10], table[11]]));
    let start = place.and_then(|place| usize::try_from(place).ok()).unwrap_or(usize::MAX);
    std::array::from_fn(|i| {
        let at = start.saturating_add(36 + 2 * i);
        let pair = bytes.get(at..at.saturating_add(2)).and_then(|pair| pair.try_into().ok());
        pair.map_or(0, i16::from_be_bytes)
    })
}

/// A part of the outline of a glyph, in units of the size; y points upwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stroke {
    /// The start of a closed curve.
    Start([f32; 2]),
    /// A straight line to a point.
    Line([f32; 2]),
    /// A quadratic Bezier curve: its control point and its end.
    Quadratic([f32; 2], [f32; 2]),
    /// A cubic Bezier curve: its control points and its end.
    Cubic([f32; 2], [f32; 2], [f32; 2]),
}

/// The outline of glyph number `id`.
pub fn outline(id: u16) -> Vec<Stroke> {
    let font = embedded();
    let per_em = font.units_per_em().unwrap_or(1.0);
    let Some(outline) = font.outline(GlyphId(id)) else {
        return Vec::new();
    };
    let at = |p: ab_glyph::Point| [p.x / per_em, p.y / per_em];
    let mut end = None;
    let mut strokes = Vec::new();
    // Join curves to strokes: a new one starts where a curve does not continue the last one
    for curve in outline.curves {
        let (start, stroke, last) = match curve {
            OutlineCurve::Line(a, b) => (a, Stroke::Line(at(b)), b),
            OutlineCurve::Quad(a, b, c) => (a, Stroke::Quadratic(at(b), at(c)), c),
            OutlineCurve::Cubic(a, b, c, d) => (a, Stroke::Cubic(at(b), at(c), at(d)), d),
        };
        if end != Some(start) {
            strokes.push(Stroke::Start(at(start)));
        }
        end = Some(last);
        strokes.push(stroke);
    }
    strokes
}

fn embedded() -> FontRef<'static> {
    FontRef::try_from_slice(BYTES).expect("the embedded font is complete")
}

/// The characters of `text` that the font does not have, in the order of the text.
pub(super) fn missing_glyphs(text: &str) -> Vec<char> {
    let font = embedded();
    let mut missing: Vec<char> = Vec::new();
    for c in text.chars().filter(|c| *c != '\n') {
        if font.glyph_id(c).0 == 0 && !missing.contains(&c) {
            missing.push(c);
        }
    }
    missing
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlay::canvas::Canvas as _;
    use crate::overlay::canvas::Raster;

    #[test]
    fn widths_are_those_of_the_font() {
        // Advances of DejaVu Sans in units of 1/2048 em, read with fontTools: S 1300, p 1300, e 1260, d 1300
        let font = Font::new(2048.0);
        assert_eq!(font.width("Speed"), 1300.0 + 1300.0 + 1260.0 + 1260.0 + 1300.0);
        assert_eq!(Font::new(20.48).width("m").round(), 20.0);
        assert_eq!(font.width("d\nSpeed\nm"), font.width("Speed"));
        assert_eq!(font.width(""), 0.0);
        // Digits have the same width, so that numbers do not jump from frame to frame
        for digit in '0'..='9' {
            assert_eq!(font.width(&digit.to_string()), 1303.0, "{digit}");
        }
    }

    #[test]
    fn letters_have_the_height_of_capitals() {
        let mut canvas = Raster::new(120, 120);
        canvas.text(&Font::new(100.0), "H", 10.0, 100.0, [1.0; 3]);
        let is_drawn = |row: i32| (0..120).any(|x| canvas.alpha(x, row) > 0.8);
        let rows: Vec<i32> = (0..120).filter(|row| is_drawn(*row)).collect();
        assert_eq!((rows[0], rows[rows.len() - 1]), (27, 99), "72.9 pixels above the baseline");
    }

    #[test]
    fn missing_glyphs_are_found_and_boxes() {
        assert!(missing_glyphs("ρ (kg/m³) ≤ 10⁻³ µm Ångström √∂∑ ½").is_empty());
        assert_eq!(missing_glyphs("漢a\n漢字"), ['漢', '字']);
        let mut canvas = Raster::new(40, 40);
        canvas.text(&Font::new(30.0), "漢", 4.0, 32.0, [1.0; 3]);
        assert!((0..1600).any(|i| canvas.alpha(i % 40, i / 40) > 0.9));
    }
}
