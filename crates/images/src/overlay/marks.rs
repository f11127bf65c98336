//! Overlays as a list of drawing commands, for formats without pixels.

use std::sync::Arc;

use super::canvas::Canvas;
use super::font::{Font, Glyph};
use super::{
    Color, Content, FrameView, HALO, Orientation, Overlay, Page, RgbaPixels, on_page, place,
};

/// A drawing command. Lengths are in pixels of the page, from the top left.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A rectangle of one colour.
    Fill {
        /// Left and top.
        from: [f32; 2],
        /// Right and bottom.
        to: [f32; 2],
        /// The colour.
        color: Color,
    },
    /// A rectangle with colours from the bottom to the top, or from the left to the right.
    Ramp {
        /// Left and top.
        from: [f32; 2],
        /// Right and bottom.
        to: [f32; 2],
        /// The direction of the colours.
        direction: Orientation,
        /// At least two colours, at equal distances.
        colors: Vec<Color>,
    },
    /// A line with round ends.
    Line {
        /// Its start.
        from: [f32; 2],
        /// Its end.
        to: [f32; 2],
        /// Its width.
        width: f32,
        /// The colour.
        color: Color,
    },
    /// A line of text.
    Text {
        /// The text.
        text: String,
        /// Its glyphs.
        glyphs: Vec<Glyph>,
        /// The start of the line, on the baseline.
        at: [f32; 2],
        /// The size of the font.
        size: f32,
        /// The colour.
        color: Color,
    },
    /// A picture.
    Image {
        /// Left and top.
        corner: [f32; 2],
        /// Width and height.
        size: [f32; 2],
        /// The picture.
        source: Arc<RgbaPixels>,
    },
}

/// The commands of an overlay.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// In order, the first one farthest from the viewer.
    pub marks: Vec<Mark>,
    /// Radius and colour of the halo behind all of them, if there is one.
    pub halo: Option<(f32, Color)>,
}

/// Records commands.
#[derive(Default)]
struct Recorder {
    marks: Vec<Mark>,
}

impl Canvas for Recorder {
    fn fill(&mut self, from: [f32; 2], to: [f32; 2], color: Color) {
        self.marks.push(Mark::Fill { from, to, color });
    }

    fn ramp(&mut self, from: [f32; 2], to: [f32; 2], direction: Orientation, colors: &[Color]) {
        match colors {
            [] => {}
            [color] => self.fill(from, to, *color),
            colors => self.marks.push(Mark::Ramp { from, to, direction, colors: colors.to_vec() }),
        }
    }

    fn line(&mut self, from: [f32; 2], to: [f32; 2], width: f32, color: Color) {
        self.marks.push(Mark::Line { from, to, width, color });
    }

    fn text(&mut self, font: &Font, text: &str, x: f32, baseline: f32, color: Color) {
        if !text.trim().is_empty() {
            let (text, glyphs) = (text.to_owned(), font.glyphs(text));
            self.marks.push(Mark::Text { text, glyphs, at: [x, baseline], size: font.size, color });
        }
    }

    fn image(&mut self, corner: [f32; 2], size: [f32; 2], source: &Arc<RgbaPixels>) {
        self.marks.push(Mark::Image { corner, size, source: Arc::clone(source) });
    }
}

/// The commands for `overlays` on a page: what [`super::draw`] draws.
pub fn marks(overlays: &[Overlay], page: &Page, frame: &FrameView) -> Vec<Drawing> {
    let frame = on_page(frame, page);
    let [width, height] = page.size;
    let sizes: Vec<[i32; 2]> =
        overlays.iter().map(|overlay| overlay.size_in(width, height, &frame)).collect();
    let corners = place(overlays, &sizes, page);
    let drawings = overlays.iter().zip(corners).map(|(overlay, corner)| {
        let pen = overlay.pen(height);
        let mut recorder = Recorder::default();
        overlay.content.draw(&mut recorder, corner.map(|v| v as f32), &pen, &frame);
        let has_halo = !matches!(overlay.content, Content::Image(_));
        let halo = has_halo.then(|| ((HALO * pen.font.size).max(1.0), overlay.halo));
        Drawing { marks: recorder.marks, halo }
    });
    drawings.collect()
}
