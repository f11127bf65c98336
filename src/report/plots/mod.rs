//! Line and scatter plots as SVG inside an HTML page: axes with units, several named series told
//! apart by colour, marker and dash, gaps where values are missing. The same data give the same text.
//!
//! `plotters` maps and lays out; `svg` is our backend for it, because that of plotters writes
//! fixed colours and no classes, so that its plots cannot follow a dark page. The colours stand in
//! [`CSS`] and again as attributes, for whoever takes the SVG out of the page. Text is sized for a
//! plot 480 units wide: readable when a phone shrinks it to three quarters.
//!
//! What is in the data is left to the caller; [`super::page`] puts the figure onto a page.

mod axis;
#[cfg(test)]
mod axis_tests;
mod draw;
mod drawn;
mod key;
mod svg;
#[cfg(test)]
mod tests;

pub use axis::{Axis, Scale};
pub use key::CSS;

use super::escape::escaped;

/// How the points of a series are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Line {
    /// By a line.
    #[default]
    Solid,
    /// By a dashed line with hollow markers: figures of others, predictions.
    Dashed,
    /// Not at all: a scatter plot.
    None,
}

/// Named points of one look.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    line: Line,
    hue: Option<usize>,
}

impl Series {
    /// Points joined in the order given. A coordinate that is NaN or infinite leaves a gap.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self {
            name: name.into(),
            points: points.into_iter().collect(),
            line: Line::default(),
            hue: None,
        }
    }

    /// Joins the points in another way.
    #[must_use]
    pub const fn line(mut self, line: Line) -> Self {
        self.line = line;
        self
    }

    /// Takes colour and marker number `hue` instead of that of its place, so that a series looks
    /// the same in several plots or like another that it belongs to. Seven are told apart.
    #[must_use]
    pub const fn hue(mut self, hue: usize) -> Self {
        self.hue = Some(hue);
        self
    }
}

/// A plot before it is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    id: String,
    title: String,
    x: Axis,
    y: Axis,
    series: Vec<Series>,
}

impl Plot {
    /// An empty plot. `id` names its element on the page: letters, digits and hyphens.
    pub fn new(id: impl Into<String>, title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            x,
            y,
            series: Vec::new(),
        }
    }

    /// Adds a series.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// The `<figure>`: title, plot and legend, or a sentence where there is nothing to draw.
    /// Series of over 800 points are thinned to the least and the largest value of each stretch.
    pub fn figure(&self) -> String {
        let mut notes = String::new();
        let drawn: Vec<drawn::Drawn> = self
            .series
            .iter()
            .enumerate()
            .map(|(place, series)| drawn::Drawn::new(self, series, series.hue.unwrap_or(place)))
            .filter(|drawn| drawn.point_count() > 0)
            .collect();
        let left_out = self.count_off_log_axis();
        if left_out > 0 {
            notes = format!(
                "<p class=\"note\">{left_out} {} left out: nothing up to zero has a place on a \
                 logarithmic axis.</p>\n",
                if left_out == 1 {
                    "value is"
                } else {
                    "values are"
                }
            );
        }
        let body = if drawn.is_empty() {
            "<p class=\"empty\">There are no values to plot.</p>\n".to_owned()
        } else {
            draw::svg_of(self, &drawn) + &key::legend(&drawn)
        };
        format!(
            "<figure class=\"plot\">\n<figcaption>{}</figcaption>\n{body}{notes}</figure>\n",
            escaped(&self.title)
        )
    }

    /// Finite values that a logarithmic axis cannot show.
    fn count_off_log_axis(&self) -> usize {
        let off = |axis: &Axis, value: f64| axis.is_log() && value.is_finite() && value <= 0.0;
        let points = self.series.iter().flat_map(|s| &s.points);
        points
            .filter(|(x, y)| off(&self.x, *x) || off(&self.y, *y))
            .count()
    }
}
