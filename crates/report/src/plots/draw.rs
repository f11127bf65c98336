//! Draws a plot with `plotters`.

use std::cell::RefCell;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters_backend::text_anchor::{HPos, Pos, VPos};

use super::axis::Span;
use super::drawn::Drawn;
use super::svg::{FINE, GRID, INK, SERIES, SvgText};
use super::{Line, Plot, key};
use crate::escape::escaped;

/// Width of a plot, in units in which a line of text is [`FONT`] high.
const WIDTH: i32 = 440;
/// Height of a plot.
const HEIGHT: i32 = 270;
/// Height of a line of text.
const FONT: i32 = 13;
/// Approximate width of a digit.
const DIGIT: i32 = 8;
/// Space above for the title of the vertical axis.
const TOP: i32 = 30;
/// Space below for labels and the title of the horizontal axis.
const BOTTOM: i32 = 46;
/// Space on the right for half of the last label.
const RIGHT: i32 = 22;

/// The SVG of a plot with at least one point.
pub(super) fn svg_of(plot: &Plot, series: &[Drawn]) -> String {
    let text = RefCell::new(format!(
        "<svg class=\"plot\" id=\"{id}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" \
         aria-labelledby=\"{id}-title\" xmlns=\"http://www.w3.org/2000/svg\" \
         font-family=\"system-ui,sans-serif\" font-size=\"{FONT}\" fill=\"#1b1b1b\">\n\
         <title id=\"{id}-title\">{}: {} by {}</title>\n",
        escaped(&plot.title),
        escaped(plot.y.title()),
        escaped(plot.x.title()),
        id = escaped(&plot.id),
    ));
    let size = ((WIDTH * FINE).cast_unsigned(), (HEIGHT * FINE).cast_unsigned());
    let backend = SvgText { text: &text, size };
    draw(plot, series, spans(plot, series), backend, &text)
        .expect("our backend takes everything, and nobody else draws to it");
    text.into_inner() + "</svg>\n"
}

/// The axes with the range of all points.
fn spans(plot: &Plot, series: &[Drawn]) -> (Span, Span) {
    let points = || series.iter().flat_map(|s| s.pieces.iter().flatten());
    let range = |of: fn(&(f64, f64)) -> f64| {
        let low = points().map(of).fold(f64::INFINITY, f64::min);
        let high = points().map(of).fold(f64::NEG_INFINITY, f64::max);
        (low, high)
    };
    let (left, right) = range(|point| point.0);
    let (bottom, top) = range(|point| point.1);
    (plot.x.span(left, right, 6.0), plot.y.span(bottom, top, 5.0))
}

type DrawError = DrawingAreaErrorKind<std::convert::Infallible>;

fn draw(
    plot: &Plot,
    series: &[Drawn],
    (x, y): (Span, Span),
    backend: SvgText,
    text: &RefCell<String>,
) -> Result<(), DrawError> {
    // Lay out the chart, with space for the labels
    let font = TextStyle::from(("sans-serif", FONT * FINE).into_font()).color(&INK);
    let root = backend.into_drawing_area();
    let longest = y.ticks.iter().map(|(_, label)| label.chars().count()).max();
    let left = i32::try_from(longest.unwrap_or(0)).unwrap_or(0) * DIGIT + 14;
    let mut chart = ChartBuilder::on(&root)
        .margin_top(TOP * FINE)
        .margin_right(RIGHT * FINE)
        .x_label_area_size(BOTTOM * FINE)
        .y_label_area_size(left * FINE)
        .build_cartesian_2d(x, y)?;
    // Draw axes and titles
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(GRID)
        .axis_style(GRID)
        .label_style(font.clone())
        .set_tick_mark_size(LabelAreaPosition::Left, 4 * FINE)
        .set_tick_mark_size(LabelAreaPosition::Bottom, 6 * FINE)
        .draw()?;
    root.draw_text(plot.y.title(), &font, (0, 4 * FINE))?;
    let bottom_right = Pos::new(HPos::Right, VPos::Bottom);
    let corner = ((WIDTH - 2) * FINE, (HEIGHT - 4) * FINE);
    root.draw_text(plot.x.title(), &font.pos(bottom_right), corner)?;

    // Draw the series over them
    for drawn in series {
        draw_series(drawn, &root, |point| chart.backend_coord(point), text)?;
    }
    root.present()
}

/// Draws lines, then markers. `at` maps values to places in the SVG, whose elements go to `text`.
fn draw_series(
    series: &Drawn,
    root: &DrawingArea<SvgText, Shift>,
    at: impl Fn(&(f64, f64)) -> (i32, i32),
    text: &RefCell<String>,
) -> Result<(), DrawError> {
    let put = |piece: &str| text.borrow_mut().push_str(piece);
    // Group the elements of a series under its name
    put(&key::group(series.hue, "series"));
    put(&format!("<title>{}</title>\n", escaped(series.name)));
    // Draw lines, interrupted where values are missing
    if series.line != Line::None {
        put(key::part(series.line, false));
        for piece in series.pieces.iter().filter(|piece| piece.len() > 1) {
            root.draw(&PathElement::new(piece.iter().map(&at).collect::<Vec<_>>(), SERIES))?;
        }
        put("</g>\n");
    }
    // Draw markers over the lines
    put(key::part(series.line, true));
    for (x, y) in series.marked().iter().map(at) {
        match key::marker(series.hue) {
            None => root.draw(&Circle::new((x, y), key::MARKER_RADIUS, SERIES.filled()))?,
            Some(corners) => {
                let corners = corners.iter().map(|(dx, dy)| (x + dx, y + dy));
                root.draw(&Polygon::new(corners.collect::<Vec<_>>(), SERIES))?;
            }
        }
    }
    put("</g></g>\n");
    Ok(())
}
