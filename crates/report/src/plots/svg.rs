//! A backend for `plotters` that writes SVG with classes instead of colours: elements in [`INK`] or [`GRID`] get that
//! class, elements of a series the style of the group around them.
//!
//! Coordinates of plotters are integers, so one unit here is a tenth of a unit of the plot.

use std::cell::RefCell;
use std::convert::Infallible;
use std::fmt::Write as _;

use plotters::style::RGBColor;
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
};

use crate::escape::escaped;

/// Represents the colour of text.
pub(super) const INK: RGBColor = RGBColor(0, 0, 0);
/// Represents the colour of lines in the background.
pub(super) const GRID: RGBColor = RGBColor(1, 0, 0);
/// Represents the colour of the current series.
pub(super) const SERIES: RGBColor = RGBColor(2, 0, 0);

/// Units per unit of the plot.
pub(super) const FINE: i32 = 10;

/// Writes to a text that is also written to by others between two drawings.
pub(super) struct SvgText<'a> {
    pub(super) text: &'a RefCell<String>,
    /// Width and height.
    pub(super) size: (u32, u32),
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

fn class(color: BackendColor) -> &'static str {
    match color.rgb {
        (0, 0, 0) => " class=\"ink\"",
        (1, 0, 0) => " class=\"grid\"",
        _ => "",
    }
}

/// A coordinate in units of the plot.
fn units(fine: i32) -> String {
    let sign = if fine < 0 { "-" } else { "" };
    let (whole, tenth) = ((fine / FINE).abs(), (fine % FINE).abs());
    if tenth == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{tenth}") }
}

fn path(points: impl IntoIterator<Item = BackendCoord>) -> String {
    let mut data = String::new();
    for (x, y) in points {
        data.push(if data.is_empty() { 'M' } else { 'L' });
        data += &units(x);
        data.push(' ');
        data += &units(y);
    }
    data
}

impl SvgText<'_> {
    #[expect(clippy::unnecessary_wraps, reason = "what the trait's methods return")]
    fn put(&self, element: std::fmt::Arguments) -> Drawn {
        let mut text = self.text.borrow_mut();
        writeln!(text, "{element}").expect("a string takes everything");
        Ok(())
    }
}

impl DrawingBackend for SvgText<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Drawn {
        self.draw_circle((x, y), 5, &color, true)
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Drawn {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        (left, top): BackendCoord,
        (right, bottom): BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        if fill {
            self.fill_polygon(corners, style)
        } else {
            self.draw_path(corners.into_iter().chain([(left, top)]), style)
        }
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        points: I,
        style: &S,
    ) -> Drawn {
        self.put(format_args!(
            "<path{} fill=\"none\" d=\"{}\"/>",
            class(style.color()),
            path(points)
        ))
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        (x, y): BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let hollow = if fill { "" } else { " fill=\"none\"" };
        let radius = units(i32::try_from(radius).unwrap_or(i32::MAX));
        self.put(format_args!(
            "<circle{}{hollow} cx=\"{}\" cy=\"{}\" r=\"{radius}\"/>",
            class(style.color()),
            units(x),
            units(y),
        ))
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        points: I,
        style: &S,
    ) -> Drawn {
        self.put(format_args!("<path{} d=\"{}Z\"/>", class(style.color()), path(points)))
    }

    /// Supports only horizontal text.
    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Drawn {
        let anchor = match style.anchor().h_pos {
            HPos::Left => "start",
            HPos::Center => "middle",
            HPos::Right => "end",
        };
        // Distance from the given position to the base line; digits are 0.7 em high.
        let down = match style.anchor().v_pos {
            VPos::Top => "0.72em",
            VPos::Center => "0.36em",
            VPos::Bottom => "0",
        };
        self.put(format_args!(
            "<text x=\"{}\" y=\"{}\" dy=\"{down}\" text-anchor=\"{anchor}\">{}</text>",
            units(x),
            units(y),
            escaped(text)
        ))
    }
}
