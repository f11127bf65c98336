//! Line and scatter plots as SVG in an HTML page: axes with units, several named series with distinct colours,
//! markers and dashes, and gaps at missing values. The same data give the same text.
//!
//! `plotters` does the mapping and layout. `svg` is a backend for it, because the one of plotters writes fixed
//! colours without classes, so its plots cannot adapt to a dark page. Colours are in [`CSS`] and also in attributes,
//! for SVGs that are extracted from the page. The text size is for a plot that is 480 units wide: readable when a
//! phone shrinks it to three quarters.
//!
//! The caller provides the data; [`super::page`] adds the figure to a page.

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

/// How the points of a series are connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Line {
    /// By a solid line.
    #[default]
    Solid,
    /// By a dashed line with hollow markers, for results of others and for predictions.
    Dashed,
    /// Not connected: a scatter plot.
    None,
}

/// Named points with a common style.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    line: Line,
    hue: Option<usize>,
}

impl Series {
    /// Points that are connected in their order. A NaN or infinite coordinate leaves a gap.
    pub fn new(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self {
            name: name.into(),
            points: points.into_iter().collect(),
            line: Line::default(),
            hue: None,
        }
    }

    /// Sets the kind of line.
    #[must_use]
    pub const fn line(mut self, line: Line) -> Self {
        self.line = line;
        self
    }

    /// Sets the number of colour and marker, which is otherwise the index of the series, so that a series looks the
    /// same in several plots or like a related one. There are seven.
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
    /// An empty plot. `id` is the id of its element on the page: letters, digits and hyphens.
    pub fn new(id: impl Into<String>, title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { id: id.into(), title: title.into(), x, y, series: Vec::new() }
    }

    /// Adds a series.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// The `<figure>`: title, plot and legend, or a message if there is nothing to draw. Series of over 800 points
    /// are thinned to the smallest and the largest value of each interval.
    pub fn figure(&self) -> String {
        let mut notes = String::new();
        // Prepare the series
        let drawn: Vec<drawn::Drawn> = self
            .series
            .iter()
            .enumerate()
            .map(|(place, series)| drawn::Drawn::new(self, series, series.hue.unwrap_or(place)))
            .filter(|drawn| drawn.point_count() > 0)
            .collect();
        // Note values that cannot be shown
        let left_out = self.count_off_log_axis();
        if left_out > 0 {
            notes = format!(
                "<p class=\"note\">{left_out} {} omitted: a logarithmic axis shows only values above zero.</p>\n",
                if left_out == 1 { "value is" } else { "values are" }
            );
        }
        // Draw plot and legend
        let body = if drawn.is_empty() {
            "<p class=\"empty\">No values to plot.</p>\n".to_owned()
        } else {
            draw::svg_of(self, &drawn) + &key::legend(&drawn)
        };
        format!(
            "<figure class=\"plot\">\n<figcaption>{}</figcaption>\n{body}{notes}</figure>\n",
            escaped(&self.title)
        )
    }

    /// Number of finite values that a logarithmic axis cannot show.
    fn count_off_log_axis(&self) -> usize {
        let off = |axis: &Axis, value: f64| axis.is_log() && value.is_finite() && value <= 0.0;
        let points = self.series.iter().flat_map(|s| &s.points);
        points.filter(|(x, y)| off(&self.x, *x) || off(&self.y, *y)).count()
    }
}
