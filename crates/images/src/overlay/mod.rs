//! What is drawn over a finished picture: colour bars, text, scale bars, axes and pictures. Overlays are small pictures with
//! alpha. They know their size relative to the height of the picture and the corner where they are, but neither jobs
//! nor files.

mod axes;
mod beside;
mod canvas;
mod color_bar;
mod font;
mod image;
mod layout;
mod marks;
mod number_format;
mod pixels;
mod scale_bar;
mod template;
mod ticks;

pub use axes::Axes;
pub use beside::Page;
pub use canvas::Color;
use canvas::{Canvas, Raster};
pub use color_bar::{ColorBar, ColorBarKind};
use font::Font;
use font::missing_glyphs;
pub use font::{FONT_NAME, FontFile, Glyph, Stroke, font_file, outline};
pub use image::Image;
pub use layout::{Boxes, Corner, Layout, Orientation, Placement};
pub use marks::{Drawing, Mark, marks};
pub use number_format::NumberFormat;
pub use pixels::RgbaPixels;
pub use scale_bar::ScaleBar;
pub use template::{FrameValues, Template};
pub use ticks::{Tick, TickChoice, TickSettings, Ticks};

/// Smallest size of text in pixels; smaller text cannot be read.
const MIN_TEXT: f32 = 9.0;

/// Radius of the halo around text and lines, in units of the size of text.
const HALO: f32 = 0.12;

/// Something to draw over a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlay {
    /// What is drawn.
    pub content: Content,
    /// Whether it is over or beside the picture.
    pub layout: Layout,
    /// The corner that users name. Beside the picture, it chooses the side and the end of the strip.
    pub corner: Option<Corner>,
    /// Where it is over the picture.
    pub placement: Placement,
    /// Height of text as a fraction of the height of the page.
    pub size: f32,
    /// Colour of text and lines.
    pub color: Color,
    /// Colour around text and lines.
    pub halo: Color,
}

/// What an overlay shows.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// The colours of a map with their values.
    ColorBar(ColorBar),
    /// Text with variables.
    Text(Template),
    /// A length in the scene.
    ScaleBar(ScaleBar),
    /// The directions of the axes.
    Axes(Axes),
    /// A picture.
    Image(Image),
}

/// What overlays show of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameView {
    /// Values for variables.
    pub values: FrameValues,
    /// Lengths of the scene in the height of the picture, at the depth of the particles.
    pub units_per_height: f64,
    /// The axes of the scene to the right, up and along the view.
    pub axes: [[f32; 3]; 3],
}

/// Where an overlay is on its page, without its halo, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    /// Column and row of its top left corner.
    pub at: [i32; 2],
    /// Width and height.
    pub size: [i32; 2],
}

/// A small picture at a place of a large one: premultiplied sRGB with alpha.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sprite {
    /// Column of its left edge.
    pub left: i32,
    /// Row of its top edge.
    pub top: i32,
    /// Width in pixels.
    pub width: i32,
    /// Height in pixels.
    pub height: i32,
    /// The pixels, row by row.
    pub pixels: Vec<[u8; 4]>,
}

impl Overlay {
    /// Width and height in a picture with `height` rows, in pixels.
    pub fn measure(&self, height: u32, frame: &FrameView) -> [i32; 2] {
        let pen = self.pen(height);
        self.content.measure(&pen, frame).map(|length| {
            #[expect(clippy::cast_possible_truncation, reason = "saturated")]
            let length = length.ceil() as i32;
            length.clamp(0, 1 << 15)
        })
    }

    /// The size, limited to that of the picture.
    fn size_in(&self, width: u32, height: u32, frame: &FrameView) -> [i32; 2] {
        let [own_width, own_height] = self.measure(height, frame);
        let limit = |own: i32, side: u32| own.min(i32::try_from(side).unwrap_or(i32::MAX));
        [limit(own_width, width), limit(own_height, height)]
    }

    /// The texts that do not change from frame to frame.
    fn texts(&self) -> Vec<&str> {
        match &self.content {
            Content::ColorBar(bar) => bar.texts(),
            Content::Text(template) => template.texts().collect(),
            Content::ScaleBar(bar) => vec![&bar.unit],
            Content::Axes(axes) => axes.names.iter().map(String::as_str).collect(),
            Content::Image(_) => Vec::new(),
        }
    }

    /// The characters of its texts that the font does not have.
    pub fn missing_glyphs(&self) -> Vec<char> {
        missing_glyphs(&self.texts().concat())
    }

    fn pen(&self, height: u32) -> Pen {
        let picture = height as f32;
        let size = (self.size * picture).max(MIN_TEXT);
        Pen {
            font: Font::new(size),
            picture,
            line: (size / 16.0).round().max(1.0),
            color: self.color,
        }
    }

    fn draw(&self, [left, top]: [i32; 2], size: [i32; 2], pen: &Pen, frame: &FrameView) -> Sprite {
        let radius = (HALO * pen.font.size).max(1.0);
        #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
        let margin = radius.ceil() as i32 + 1;
        let mut canvas = Raster::new(size[0] + 2 * margin, size[1] + 2 * margin);
        let corner = [margin as f32; 2];
        self.content.draw(&mut canvas, corner, pen, frame);
        if !matches!(self.content, Content::Image(_)) {
            canvas.add_halo(radius, self.halo);
        }
        canvas.into_sprite(left - margin, top - margin)
    }
}

/// The top left corners of `overlays` with these `sizes` on a page. In a corner that users name, overlays that have no
/// corner of their own come last.
fn place(overlays: &[Overlay], sizes: &[[i32; 2]], page: &Page) -> Vec<[i32; 2]> {
    let [left, top] = page.at.map(u32::cast_signed);
    let mut places = vec![[0, 0]; overlays.len()];
    let with = |layout: Layout| (0..overlays.len()).filter(move |i| overlays[*i].layout == layout);
    let beside: Vec<_> = with(Layout::Beside).map(|i| (&overlays[i], sizes[i])).collect();
    for (i, place) in with(Layout::Beside).zip(page.places(&beside)) {
        places[i] = place;
    }
    let mut boxes = Boxes::new(page.picture);
    let mut over: Vec<usize> = with(Layout::Over).collect();
    over.sort_by_key(|i| overlays[*i].corner.is_none());
    for i in over {
        let [x, y] = boxes.add(overlays[i].placement, sizes[i]);
        places[i] = [x + left, y + top];
    }
    places
}

/// The view of a frame for overlays, whose lengths are fractions of the height of the page.
fn on_page(frame: &FrameView, page: &Page) -> FrameView {
    let part = f64::from(page.picture[1]) / f64::from(page.size[1].max(1));
    FrameView { units_per_height: frame.units_per_height / part, ..frame.clone() }
}

/// The areas of `overlays` for a page.
pub fn areas(overlays: &[Overlay], page: &Page, frame: &FrameView) -> Vec<Area> {
    areas_of_view(overlays, page, &on_page(frame, page))
}

/// The same with the view for overlays.
fn areas_of_view(overlays: &[Overlay], page: &Page, frame: &FrameView) -> Vec<Area> {
    let [width, height] = page.size;
    let sizes: Vec<[i32; 2]> =
        overlays.iter().map(|overlay| overlay.size_in(width, height, frame)).collect();
    let corners = place(overlays, &sizes, page);
    corners.into_iter().zip(sizes).map(|(at, size)| Area { at, size }).collect()
}

/// Draws `overlays` for a page.
pub fn draw(overlays: &[Overlay], page: &Page, frame: &FrameView) -> Vec<Sprite> {
    let frame = on_page(frame, page);
    let areas = areas_of_view(overlays, page, &frame);
    let drawn = overlays.iter().zip(areas);
    drawn
        .map(|(overlay, Area { at, size })| {
            overlay.draw(at, size, &overlay.pen(page.size[1]), &frame)
        })
        .collect()
}

/// Memory for drawing `overlays` over a picture of the particles, bytes. Variables of texts count as short.
pub fn bytes(overlays: &[Overlay], width: u32, height: u32) -> u64 {
    /// Bytes per pixel of a sprite, and of the canvas with its halo that it is drawn in.
    const PIXEL: [u64; 2] = [4, 20];
    /// Bytes per pixel of the page beside the picture: with alpha; plain, filtered and compressed.
    const PAGE: u64 = 12;
    let frame = FrameView::default();
    // The page is larger than the picture by its strips
    let strips = |side: u32| side.saturating_mul(2);
    let page = Page::with_room_for(overlays, [strips(width), strips(height)], &frame);
    let [own_width, own_height] = page.picture;
    let around = [strips(width) - own_width, strips(height) - own_height].map(u64::from);
    let beside = around[0] * (u64::from(height) + around[1]) + around[1] * u64::from(width);
    let areas = overlays.iter().map(|overlay| {
        let [width, height] = overlay.size_in(width, height, &frame);
        // Margins of the halo, and values of variables
        2 * u64::from(width.unsigned_abs()) * u64::from(height.unsigned_abs())
    });
    let (sum, most) = areas.fold((0, 0), |(sum, most), area| (sum + area, area.max(most)));
    let files = overlays.iter().map(|overlay| match &overlay.content {
        Content::Image(image) => image.bytes(),
        _ => 0,
    });
    PAGE * beside + PIXEL[0] * sum + PIXEL[1] * most + files.sum::<u64>()
}

impl Sprite {
    /// Draws the part of the sprite in row `y` over the row of a picture, sRGB.
    pub fn draw_over(&self, y: i32, row: &mut [u8]) {
        let row = row.as_chunks_mut::<3>().0;
        self.each_in_row(y, row.len(), |x, [r, g, b, a]| {
            let under = u32::from(255 - a);
            for (byte, over) in row[x].iter_mut().zip([r, g, b]) {
                let below = (u32::from(*byte) * under + 127) / 255;
                let sum = u32::from(over) + below;
                *byte = u8::try_from(sum).unwrap_or(u8::MAX);
            }
        });
    }

    /// The same over the row of a picture with alpha, whose colours are not multiplied by it.
    pub fn draw_over_rgba(&self, y: i32, row: &mut [u8]) {
        let row = row.as_chunks_mut::<4>().0;
        self.each_in_row(y, row.len(), |x, [r, g, b, a]| {
            // In units of 1 / 255^2
            let below = u32::from(row[x][3]) * u32::from(255 - a);
            let alpha = 255 * u32::from(a) + below;
            if alpha == 0 {
                return;
            }
            for (byte, over) in row[x].iter_mut().zip([r, g, b]) {
                let sum = 255 * 255 * u32::from(over) + u32::from(*byte) * below;
                *byte = u8::try_from((sum + alpha / 2) / alpha).unwrap_or(u8::MAX);
            }
            row[x][3] = u8::try_from((alpha + 127) / 255).unwrap_or(u8::MAX);
        });
    }

    /// Calls `visit` with the column and the colour of each pixel in row `y` of a picture with `width` columns.
    pub fn each_in_row(&self, y: i32, width: usize, mut visit: impl FnMut(usize, [u8; 4])) {
        let inside = y.checked_sub(self.top).filter(|row| (0..self.height).contains(row));
        let Some(row) = inside.and_then(|row| usize::try_from(row).ok()) else {
            return;
        };
        let own = usize::try_from(self.width).unwrap_or(0);
        let pixels = self.pixels.iter().skip(row * own).take(own);
        for (pixel, x) in pixels.zip(self.left..) {
            if let Some(x) = usize::try_from(x).ok().filter(|x| *x < width) {
                visit(x, *pixel);
            }
        }
    }
}

/// What contents are drawn with.
struct Pen {
    font: Font,
    /// Height of the picture in pixels.
    picture: f32,
    /// Width of thin lines in pixels.
    line: f32,
    color: Color,
}

impl Pen {
    /// Width and height of lines of text.
    fn text_size(&self, text: &str) -> [f32; 2] {
        let lines = text.lines().count();
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let height = font::LINE * (lines as f32 - 1.0).max(0.0) + if lines > 0 { 1.0 } else { 0.0 };
        [self.font.width(text), height * self.font.size]
    }

    /// Draws lines of text below `corner`.
    fn text(&self, canvas: &mut dyn Canvas, text: &str, corner: [f32; 2]) {
        // Capitals are in the middle of the line
        let mut baseline = corner[1] + 0.5 * (1.0 + font::CAP_HEIGHT) * self.font.size;
        for line in text.lines() {
            canvas.text(&self.font, line, corner[0], baseline, self.color);
            baseline += font::LINE * self.font.size;
        }
    }

    /// Draws a label whose capitals and digits have their middle at `middle`.
    fn label(&self, canvas: &mut dyn Canvas, text: &str, x: f32, middle: f32) {
        let baseline = middle + 0.5 * font::CAP_HEIGHT * self.font.size;
        canvas.text(&self.font, text, x, baseline, self.color);
    }
}

impl Content {
    fn measure(&self, pen: &Pen, frame: &FrameView) -> [f32; 2] {
        match self {
            Self::ColorBar(bar) => bar.measure(pen),
            Self::Text(template) => pen.text_size(&template.expand(&frame.values)),
            Self::ScaleBar(bar) => bar.measure(pen, frame),
            Self::Axes(axes) => axes.measure(pen),
            Self::Image(image) => image.measure(pen),
        }
    }

    fn draw(&self, canvas: &mut dyn Canvas, corner: [f32; 2], pen: &Pen, frame: &FrameView) {
        match self {
            Self::ColorBar(bar) => bar.draw(canvas, corner, pen),
            Self::Text(template) => pen.text(canvas, &template.expand(&frame.values), corner),
            Self::ScaleBar(bar) => bar.draw(canvas, corner, pen, frame),
            Self::Axes(axes) => axes.draw(canvas, corner, pen, frame),
            Self::Image(image) => image.draw(canvas, corner, pen),
        }
    }
}

#[cfg(test)]
mod tests;
