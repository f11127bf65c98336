//! PDF files of one page. Text is text in the embedded font, with the characters of its glyphs, so that it can be
//! searched, copied and changed.

use std::collections::BTreeMap;
use std::io;

use pdf_writer::types::{
    CidFontType, FontFlags, FunctionShadingType, LineCapStyle, LineJoinStyle, SystemInfo,
    UnicodeCmap,
};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::{Figure, FigurePicture, HALO, POINTS_PER_INCH, cubics, deflated};
use crate::overlay::{
    Color, Drawing, FONT_NAME, FontFile, Glyph, Mark, Orientation, RgbaPixels, Stroke, font_file,
    outline,
};

const FONT: Name<'static> = Name(b"F1");
const HALO_STATE: Name<'static> = Name(b"Halo");
const IDENTITY: Name<'static> = Name(b"Identity-H");
const SYSTEM: SystemInfo<'static> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// A file that is being written.
struct Writer {
    pdf: Pdf,
    content: Content,
    last: i32,
    /// Height of the page, points.
    height: f32,
    /// Points in a pixel.
    scale: f32,
    images: Vec<(String, Ref)>,
    shadings: Vec<(String, Ref)>,
    /// Characters and widths of the glyphs in use.
    glyphs: BTreeMap<u16, (char, f32)>,
}

pub(super) fn encode(figure: &Figure) -> io::Result<Vec<u8>> {
    // Scale pixels to points
    let scale = POINTS_PER_INCH / figure.pixels_per_inch();
    let [width, height] = figure.size.map(|side| side as f32 * scale);
    let mut writer = Writer {
        pdf: Pdf::new(),
        content: Content::new(),
        last: 0,
        height,
        scale,
        images: Vec::new(),
        shadings: Vec::new(),
        glyphs: BTreeMap::new(),
    };
    // Draw the paper, pictures over it, and drawings over them
    if let Some(paper) = figure.paper {
        let [r, g, b] = paper.map(|byte| f32::from(byte) / 255.0);
        writer.content.set_fill_rgb(r, g, b);
        writer.content.rect(0.0, 0.0, width, height).fill_nonzero();
    }
    for picture in &figure.pictures {
        writer.picture(picture)?;
    }
    for drawing in &figure.drawings {
        writer.drawing(drawing)?;
    }
    writer.finish([width, height])
}

impl Writer {
    fn next(&mut self) -> Ref {
        self.last += 1;
        Ref::new(self.last)
    }

    /// A place on the page in points from the bottom left.
    fn point(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        [x * self.scale, self.height - y * self.scale]
    }

    /// A rectangle: left, bottom, width, height.
    fn area(&self, from: [f32; 2], to: [f32; 2]) -> [f32; 4] {
        let [left, top] = self.point(from);
        let [right, bottom] = self.point(to);
        [left, bottom, right - left, top - bottom]
    }

    fn picture(&mut self, picture: &FigurePicture) -> io::Result<()> {
        let id = self.next();
        let (colors, alpha) = picture.planes();
        let mask = alpha.map(|alpha| (self.next(), alpha));
        let [width, height] = picture.size.map(u32::cast_signed);
        // Write alpha as a mask, since colours have none
        if let Some((mask, alpha)) = &mask {
            let bytes = deflated(alpha)?;
            let mut image = self.pdf.image_xobject(*mask, &bytes);
            image.filter(Filter::FlateDecode);
            image.width(width).height(height);
            image.color_space().device_gray();
            image.bits_per_component(8);
        }
        // Write the colours
        let bytes = deflated(&colors)?;
        let mut image = self.pdf.image_xobject(id, &bytes);
        image.filter(Filter::FlateDecode);
        image.width(width).height(height);
        image.color_space().device_rgb();
        image.bits_per_component(8);
        if let Some((mask, _)) = mask {
            image.s_mask(mask);
        }
        image.finish();
        // Draw the image in its place: the unit square is moved there
        let from = picture.at.map(|v| v as f32);
        let to = [0, 1].map(|axis| from[axis] + picture.shown[axis] as f32);
        let [x, y, width, height] = self.area(from, to);
        let name = format!("Im{}", id.get());
        self.content.save_state().transform([width, 0.0, 0.0, height, x, y]);
        self.content.x_object(Name(name.as_bytes())).restore_state();
        self.images.push((name, id));
        Ok(())
    }

    fn drawing(&mut self, drawing: &Drawing) -> io::Result<()> {
        if let Some((radius, color)) = drawing.halo {
            self.content.save_state().set_parameters(HALO_STATE);
            self.content.set_line_join(LineJoinStyle::RoundJoin);
            self.content.set_line_cap(LineCapStyle::RoundCap);
            let [r, g, b] = color;
            self.content.set_stroke_rgb(r, g, b);
            for mark in &drawing.marks {
                self.halo(mark, radius);
            }
            self.content.restore_state();
        }
        for mark in &drawing.marks {
            self.mark(mark)?;
        }
        Ok(())
    }

    /// Draws around a mark, in the colour for strokes.
    fn halo(&mut self, mark: &Mark, radius: f32) {
        let width = 2.0 * radius * self.scale;
        match mark {
            Mark::Fill { from, to, .. } | Mark::Ramp { from, to, .. } => {
                let [x, y, w, h] = self.area(*from, *to);
                self.content.set_line_width(width).rect(x, y, w, h).stroke();
            }
            Mark::Line { from, to, width: own, .. } => {
                self.line(*from, *to, own + 2.0 * radius);
            }
            Mark::Text { glyphs, at, size, .. } => {
                self.content.set_line_width(width);
                for glyph in glyphs {
                    self.outline(glyph, *at, *size);
                }
            }
            Mark::Image { .. } => {}
        }
    }

    fn line(&mut self, from: [f32; 2], to: [f32; 2], width: f32) {
        let [from, to] = [from, to].map(|point| self.point(point));
        self.content.set_line_width(width * self.scale);
        self.content.move_to(from[0], from[1]).line_to(to[0], to[1]).stroke();
    }

    /// Strokes the outline of a glyph of a line of text that begins at `at`.
    fn outline(&mut self, glyph: &Glyph, at: [f32; 2], size: f32) {
        // Find the origin of the glyph, in points
        let [left, baseline] = self.point([at[0] + glyph.x * size, at[1]]);
        let size = size * self.scale;
        let to = |[x, y]: [f32; 2]| [left + x * size, baseline + y * size];
        let strokes = cubics(outline(glyph.id));
        // Draw its outline
        for stroke in &strokes {
            match *stroke {
                Stroke::Start(point) => {
                    let [x, y] = to(point);
                    self.content.move_to(x, y);
                }
                Stroke::Line(point) | Stroke::Quadratic(_, point) => {
                    let [x, y] = to(point);
                    self.content.line_to(x, y);
                }
                Stroke::Cubic(a, b, c) => {
                    let [a, b, c] = [a, b, c].map(to);
                    self.content.cubic_to(a[0], a[1], b[0], b[1], c[0], c[1]);
                }
            }
        }
        if !strokes.is_empty() {
            self.content.stroke();
        }
    }

    fn mark(&mut self, mark: &Mark) -> io::Result<()> {
        match mark {
            Mark::Fill { from, to, color: [r, g, b] } => {
                let [x, y, width, height] = self.area(*from, *to);
                self.content.set_fill_rgb(*r, *g, *b).rect(x, y, width, height).fill_nonzero();
            }
            Mark::Ramp { from, to, direction, colors } => {
                self.ramp(self.area(*from, *to), *direction, colors);
            }
            Mark::Line { from, to, width, color: [r, g, b] } => {
                self.content.set_stroke_rgb(*r, *g, *b).set_line_cap(LineCapStyle::RoundCap);
                self.line(*from, *to, *width);
            }
            Mark::Text { glyphs, at, size, color, .. } => self.text(glyphs, *at, *size, *color),
            Mark::Image { corner, size, source } => self.picture(&logo(*corner, *size, source))?,
        }
        Ok(())
    }

    /// Fills a rectangle with colours at equal distances.
    fn ramp(&mut self, [x, y, width, height]: [f32; 4], direction: Orientation, colors: &[Color]) {
        let (function, shading) = (self.next(), self.next());
        let samples: Vec<u8> = colors.iter().flatten().map(|v| byte(*v)).collect();
        let mut writer = self.pdf.sampled_function(function, &samples);
        writer.domain([0.0, 1.0]).range([0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
        writer.size([i32::try_from(colors.len()).unwrap_or(i32::MAX)]).bits_per_sample(8);
        writer.finish();
        let end = match direction {
            Orientation::Vertical => [x, y + height],
            Orientation::Horizontal => [x + width, y],
        };
        let mut writer = self.pdf.function_shading(shading);
        writer.shading_type(FunctionShadingType::Axial);
        writer.color_space().device_rgb();
        writer.coords([x, y, end[0], end[1]]).function(function);
        writer.finish();
        let name = format!("Sh{}", shading.get());
        self.content.save_state().rect(x, y, width, height).clip_nonzero().end_path();
        self.content.shading(Name(name.as_bytes())).restore_state();
        self.shadings.push((name, shading));
    }

    fn text(&mut self, glyphs: &[Glyph], at: [f32; 2], size: f32, [r, g, b]: Color) {
        // The baseline is at a pixel, as in PNG files
        let [x, y] = self.point([at[0], at[1].round()]);
        self.content.set_fill_rgb(r, g, b).begin_text();
        self.content.set_font(FONT, size * self.scale).next_line(x, y);
        let mut shown = self.content.show_positioned();
        let mut items = shown.items();
        for (glyph, next) in glyphs.iter().zip(glyphs.iter().skip(1).map(Some).chain([None])) {
            items.show(Str(&glyph.id.to_be_bytes()));
            // Kerning, in thousandths of the size
            let kern = next.map_or(0.0, |next| 1000.0 * (glyph.x + glyph.advance - next.x));
            if kern.abs() > 0.05 {
                items.adjust(kern);
            }
            self.glyphs.insert(glyph.id, (glyph.character, 1000.0 * glyph.advance));
        }
        items.finish();
        shown.finish();
        self.content.end_text();
    }

    /// Writes the embedded font as object `id`.
    fn font(&mut self, id: Ref) -> io::Result<()> {
        let [cid, descriptor, file, cmap] = [(); 4].map(|()| self.next());
        // Describe the font, whose codes are the numbers of its glyphs
        let name = Name(FONT_NAME.as_bytes());
        let mut font = self.pdf.type0_font(id);
        font.base_font(name).encoding_predefined(IDENTITY).descendant_font(cid).to_unicode(cmap);
        font.finish();
        let mut font = self.pdf.cid_font(cid);
        font.subtype(CidFontType::Type2).base_font(name).system_info(SYSTEM);
        font.font_descriptor(descriptor).cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = font.widths();
        for (id, (_, width)) in &self.glyphs {
            widths.consecutive(*id, [*width]);
        }
        widths.finish();
        font.finish();
        // Describe its measures, in thousandths of the text size
        let FontFile { bytes, heights, bounds } = font_file();
        let [ascent, descent, cap_height] = heights.map(|height| 1000.0 * height);
        let [left, bottom, right, top] = bounds.map(|v| 1000.0 * v);
        let mut writer = self.pdf.font_descriptor(descriptor);
        writer.name(name).flags(FontFlags::NON_SYMBOLIC).italic_angle(0.0).stem_v(80.0);
        writer.bbox(Rect::new(left, bottom, right, top));
        writer.ascent(ascent).descent(descent).cap_height(cap_height).font_file2(file);
        writer.finish();
        // Embed the file
        let compressed = deflated(bytes)?;
        let mut stream = self.pdf.stream(file, &compressed);
        stream.filter(Filter::FlateDecode);
        stream.pair(Name(b"Length1"), i32::try_from(bytes.len()).unwrap_or(i32::MAX));
        stream.finish();
        // Map glyphs back to characters, so that text can be copied and searched
        let mut map = UnicodeCmap::<u16>::new(Name(b"Spherule"), SYSTEM);
        for (id, (character, _)) in &self.glyphs {
            map.pair(*id, *character);
        }
        self.pdf.cmap(cmap, &map.finish());
        Ok(())
    }

    fn finish(mut self, [width, height]: [f32; 2]) -> io::Result<Vec<u8>> {
        // Write the structure of the document: a single page
        let [catalog, pages, page, content, halo, font, info] = [(); 7].map(|()| self.next());
        if !self.glyphs.is_empty() {
            self.font(font)?;
        }
        self.pdf.catalog(catalog).pages(pages);
        self.pdf.pages(pages).kids([page]).count(1);
        self.pdf.ext_graphics(halo).stroking_alpha(HALO).non_stroking_alpha(HALO);
        self.pdf.document_info(info).producer(TextStr("Made with spherule"));
        let mut writer = self.pdf.page(page);
        writer.media_box(Rect::new(0.0, 0.0, width, height)).parent(pages).contents(content);
        // List what the page uses
        let mut resources = writer.resources();
        resources.ext_g_states().pair(HALO_STATE, halo);
        if !self.glyphs.is_empty() {
            resources.fonts().pair(FONT, font);
        }
        let mut images = resources.x_objects();
        for (name, id) in &self.images {
            images.pair(Name(name.as_bytes()), *id);
        }
        images.finish();
        let mut shadings = resources.shadings();
        for (name, id) in &self.shadings {
            shadings.pair(Name(name.as_bytes()), *id);
        }
        shadings.finish();
        resources.finish();
        writer.finish();
        // Write its content
        let bytes = deflated(&self.content.finish())?;
        self.pdf.stream(content, &bytes).filter(Filter::FlateDecode);
        Ok(self.pdf.finish())
    }
}

/// A picture among the overlays.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole pixels; saturates"
)]
pub(super) fn logo(corner: [f32; 2], size: [f32; 2], source: &RgbaPixels) -> FigurePicture {
    FigurePicture {
        size: [source.width(), source.height()].map(|v| u32::try_from(v).unwrap_or(u32::MAX)),
        bytes: source.pixels().as_flattened().to_vec(),
        has_alpha: true,
        at: corner.map(|v| v as u32),
        shown: size.map(|v| v as u32),
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0 to 255")]
pub(super) fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
