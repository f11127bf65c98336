//! SVG files. Text is drawn as outlines, because programs replace fonts that they do not have; its words are labels of
//! the groups.

use std::fmt::Write as _;
use std::io;

use super::super::base64::data_url;
use super::pdf::{byte, logo};
use super::{Figure, FigurePicture, HALO};
use crate::overlay::{Color, Drawing, Glyph, Mark, Orientation, Stroke, outline};

/// Millimetres in an inch.
const INCH: f32 = 25.4;

pub(super) fn encode(figure: &Figure) -> io::Result<Vec<u8>> {
    let mut svg = Svg::default();
    // Begin with the size, on paper and in pixels
    let [width, height] = figure.size;
    let paper_size = figure.size.map(|side| side as f32 / figure.pixels_per_inch() * INCH);
    let [paper_width, paper_height] = paper_size;
    svg.line(&format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{paper_width}mm\" height=\"{paper_height}mm\" \
         viewBox=\"0 0 {width} {height}\">"
    ));
    svg.line("<!-- Made with spherule -->");
    if let Some([r, g, b]) = figure.paper {
        svg.line(&format!(
            "<rect width=\"{width}\" height=\"{height}\" fill=\"rgb({r},{g},{b})\"/>"
        ));
    }
    // Group pictures and overlays, so that editors can separate them
    svg.line("<g id=\"pictures\">");
    for picture in &figure.pictures {
        svg.picture(picture)?;
    }
    svg.line("</g>");
    svg.line("<g id=\"overlays\">");
    for drawing in &figure.drawings {
        svg.drawing(drawing)?;
    }
    svg.line("</g>");
    svg.line("</svg>");
    Ok(svg.text.into_bytes())
}

#[derive(Default)]
struct Svg {
    text: String,
    gradients: usize,
}

impl Svg {
    fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    fn picture(&mut self, picture: &FigurePicture) -> io::Result<()> {
        let [x, y] = picture.at;
        let [width, height] = picture.shown;
        let url = data_url(&png(picture)?);
        self.line(&format!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             href=\"{url}\"/>"
        ));
        Ok(())
    }

    fn drawing(&mut self, drawing: &Drawing) -> io::Result<()> {
        self.line("<g>");
        if let Some((radius, halo)) = drawing.halo {
            let (width, color) = (2.0 * radius, color(halo));
            self.line(&format!(
                "<g opacity=\"{HALO}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" \
                 stroke-linejoin=\"round\" stroke-linecap=\"round\">"
            ));
            for mark in &drawing.marks {
                self.halo(mark, radius);
            }
            self.line("</g>");
        }
        for mark in &drawing.marks {
            self.mark(mark)?;
        }
        self.line("</g>");
        Ok(())
    }

    fn halo(&mut self, mark: &Mark, radius: f32) {
        match mark {
            Mark::Fill { from, to, .. } | Mark::Ramp { from, to, .. } => {
                self.line(&format!("<rect {}/>", area(*from, *to)));
            }
            Mark::Line { from: [x1, y1], to: [x2, y2], width, .. } => {
                let width = width + 2.0 * radius;
                self.line(&format!("<path d=\"M{x1} {y1}L{x2} {y2}\" stroke-width=\"{width}\"/>"));
            }
            Mark::Text { glyphs, at, size, .. } => {
                let path = path(glyphs, *at, *size);
                self.line(&format!("<path d=\"{path}\"/>"));
            }
            Mark::Image { .. } => {}
        }
    }

    fn mark(&mut self, mark: &Mark) -> io::Result<()> {
        match mark {
            Mark::Fill { from, to, color: own } => {
                self.line(&format!("<rect {} fill=\"{}\"/>", area(*from, *to), color(*own)));
            }
            Mark::Ramp { from, to, direction, colors } => self.ramp(*from, *to, *direction, colors),
            Mark::Line { from: [x1, y1], to: [x2, y2], width, color: own } => {
                let stroke = color(*own);
                self.line(&format!(
                    "<path d=\"M{x1} {y1}L{x2} {y2}\" stroke=\"{stroke}\" stroke-width=\"{width}\" \
                     stroke-linecap=\"round\"/>"
                ));
            }
            Mark::Text { text, glyphs, at, size, color: own } => {
                let (label, path) = (escaped(text), path(glyphs, *at, *size));
                self.line(&format!(
                    "<path role=\"img\" aria-label=\"{label}\" data-size=\"{size}\" fill=\"{}\" d=\"{path}\"/>",
                    color(*own)
                ));
            }
            Mark::Image { corner, size, source } => self.picture(&logo(*corner, *size, source))?,
        }
        Ok(())
    }

    fn ramp(&mut self, from: [f32; 2], to: [f32; 2], direction: Orientation, colors: &[Color]) {
        let id = format!("ramp{}", self.gradients);
        self.gradients += 1;
        let (start, end) = match direction {
            Orientation::Vertical => ([from[0], to[1]], from),
            Orientation::Horizontal => (from, [to[0], from[1]]),
        };
        self.line(&format!(
            "<linearGradient id=\"{id}\" gradientUnits=\"userSpaceOnUse\" x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\">",
            start[0], start[1], end[0], end[1]
        ));
        let last = colors.len().saturating_sub(1).max(1) as f64;
        for (i, own) in colors.iter().enumerate() {
            let (offset, own) = (i as f64 / last, color(*own));
            self.line(&format!("<stop offset=\"{offset:.5}\" stop-color=\"{own}\"/>"));
        }
        self.line("</linearGradient>");
        self.line(&format!("<rect {} fill=\"url(#{id})\"/>", area(from, to)));
    }
}

fn area([left, top]: [f32; 2], [right, bottom]: [f32; 2]) -> String {
    let (width, height) = (right - left, bottom - top);
    format!("x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"")
}

fn color(own: Color) -> String {
    let [r, g, b] = own.map(byte);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The outlines of a line of text that begins at `at`. The baseline is at a pixel, as in PNG files.
fn path(glyphs: &[Glyph], at: [f32; 2], size: f32) -> String {
    let mut path = String::new();
    for glyph in glyphs {
        let to = |[x, y]: [f32; 2]| {
            let [x, y] = [at[0] + (glyph.x + x) * size, at[1].round() - y * size];
            format!("{x:.3} {y:.3}")
        };
        for stroke in outline(glyph.id) {
            // Writing to text cannot fail
            let _ = match stroke {
                Stroke::Start(end) => write!(path, "M{}", to(end)),
                Stroke::Line(end) => write!(path, "L{}", to(end)),
                Stroke::Quadratic(a, end) => write!(path, "Q{} {}", to(a), to(end)),
                Stroke::Cubic(a, b, end) => write!(path, "C{} {} {}", to(a), to(b), to(end)),
            };
        }
    }
    path
}

fn escaped(text: &str) -> String {
    let escape = |c: char| match c {
        '&' => "&amp;".to_owned(),
        '<' => "&lt;".to_owned(),
        '>' => "&gt;".to_owned(),
        '"' => "&quot;".to_owned(),
        // Not allowed in XML
        c if c.is_control() => " ".to_owned(),
        c => c.to_string(),
    };
    text.chars().map(escape).collect()
}

fn png(picture: &FigurePicture) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let [width, height] = picture.size;
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    let kind = if picture.has_alpha { png::ColorType::Rgba } else { png::ColorType::Rgb };
    encoder.set_color(kind);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&picture.bytes)?;
    writer.finish()?;
    Ok(bytes)
}
