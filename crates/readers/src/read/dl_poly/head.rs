//! The lines before the atoms in files of DL_POLY: codes, frames, and edges of the cell.

use glam::DVec3;

use super::VECTORS;
use crate::read::input::TextInput;
use crate::read::line_words::{LineWords, next_line};
use crate::read::text::{self, Line};
use spherule_frame::{ParseError, SimulationCell};

/// What the second line of a file says.
pub(super) struct Codes {
    /// Vectors of an atom beside its position.
    pub(super) vectors: usize,
    pub(super) boundary: i64,
    /// Number of atoms, or of the step.
    pub(super) third: Option<i64>,
}

impl Codes {
    /// The codes of a file that begins with `head`.
    pub(super) fn in_head(head: &[u8]) -> Result<Self, ParseError> {
        let mut text = TextInput::whole(head);
        text.line();
        Self::of(next_line(&mut text, "line of codes")?)
    }

    pub(super) fn of(line: Line<'_>) -> Result<Self, ParseError> {
        let mut words = LineWords::new(line);
        let vectors = words.count("the code of vectors")?;
        let boundary = words.integer("the code of boundaries")?;
        if vectors > VECTORS.len() || !(0..=7).contains(&boundary) {
            let what = format!("codes {vectors} and {boundary}, which are 0 to 2 and 0 to 7");
            return Err(ParseError::malformed(line.at, what));
        }
        Ok(Self { vectors, boundary, third: text::integer(words.next()) })
    }

    /// Reads the edges of the cell, if they are there. Bodies with more than six faces give none.
    pub(super) fn edges(
        &self,
        text: &mut TextInput<'_>,
    ) -> Result<Option<SimulationCell>, ParseError> {
        if self.boundary == 0 && !has_edges(text) {
            return Ok(None);
        }
        let mut edges = [DVec3::ZERO; 3];
        for edge in &mut edges {
            let line = next_line(text, "edge of the cell")?;
            *edge = LineWords::new(line).vector("an edge of the cell")?.into();
        }
        let [a, b, c] = edges;
        let is_periodic = self.boundary != 0;
        let periodic = [is_periodic, is_periodic, is_periodic && self.boundary != 6];
        let cell = SimulationCell::new(-0.5 * (a + b + c), edges, periodic);
        Ok(cell.filter(|_| !matches!(self.boundary, 4 | 5 | 7)))
    }
}

/// The line `timestep number atoms vectors boundary length [time]`; the codes are those of the file.
pub(super) struct Frame {
    pub(super) number: i64,
    pub(super) count: usize,
    pub(super) time: Option<f64>,
}

impl Frame {
    pub(super) fn of(line: Line<'_>) -> Result<Self, ParseError> {
        let mut words = LineWords::new(line);
        words.next();
        let number = words.integer("the number of a step")?;
        let count = words.count("a number of atoms")?;
        words.next();
        words.next();
        // Older versions have the length of a step only
        let length = text::number(words.next());
        let time = text::number(words.next()).or_else(|| Some(length? * number as f64));
        Ok(Self { number, count, time: time.filter(|time| time.is_finite()) })
    }

    /// Lines behind the first one.
    pub(super) fn lines(&self, codes: &Codes, has_edges: bool) -> usize {
        let edges = if has_edges { 3 } else { 0 };
        self.count.saturating_mul(2 + codes.vectors).saturating_add(edges)
    }
}

/// Whether edges of a cell follow: an atom begins with its name.
pub(super) fn has_edges(text: &mut TextInput<'_>) -> bool {
    text.peek_line().is_some_and(is_vector)
}

/// Whether a line is three numbers.
pub(super) fn is_vector(line: Line<'_>) -> bool {
    let mut words = LineWords::new(line);
    words.vector("x").is_ok() && words.rest().is_empty()
}
