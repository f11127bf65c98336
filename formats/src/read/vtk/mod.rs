//! Legacy VTK (`.vtk`), versions 1 to 5.1, ASCII and binary: the points of POLYDATA and
//! UNSTRUCTURED_GRID with all numeric point data.
//!
//! The file is walked line by line: a keyword line tells how many bytes of payload follow, exactly
//! those are taken or skipped, so nothing is ever searched for inside binary data. Cells and cell
//! data are stepped over: points without cells are particles too. Grids have no particles and are
//! refused. Layout after "VTK File Formats" (the VTK user's guide) and after files of VTK 9,
//! SPlisHSPlasH and others.

mod ascii;
mod attributes;
mod cursor;
mod keywords;
mod payload;
mod positions;
#[cfg(test)]
mod tests;
mod walk;

pub(in crate::read) use ascii::parse_values;
pub(in crate::read) use positions::positions;

use super::Step;
use super::columns::{Column, ParticleLayout};
use super::input::TextInput;
use crate::{Attribute, MemoryBudget, ParseError, RawParticles};
use walk::{PointArray, Until, Walker};

/// More than any tensor or spectrum has. With no particles nothing else bounds the number, and
/// callers keep something for each component.
pub(in crate::read) const MOST_COMPONENTS: usize = 1 << 16;

/// So many numbers of a particle can be listed however few the particles are.
const FEW_COMPONENTS: usize = 4096;

/// The one time step that `text` holds, with the time if a dataset-level FIELD before the points
/// tells it. A damaged file is reported by [`read`], not here.
pub(crate) fn steps(text: &mut TextInput<'_>, budget: MemoryBudget) -> Vec<Step> {
    let mut step = Step::whole(text.left_about());
    step.time = Walker::begin(text, budget).ok().and_then(|mut walker| {
        // What went wrong on the way matters to `read`; the time found until then is good.
        let _ = walker.walk(Until::Points);
        walker.time
    });
    vec![step]
}

/// Reads the particles of a legacy VTK file.
///
/// # Errors
/// [`ParseError::Malformed`] if the file is cut short or breaks the format,
/// [`ParseError::Unsupported`] if it holds a grid or is of a later version,
/// [`ParseError::TooLarge`] beyond `budget`.
pub(crate) fn read(
    text: &mut TextInput<'_>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let bytes = text.as_whole().unwrap_or_default();
    let mut walker = Walker::begin(text, budget)?;
    walker.walk(Until::End)?;
    let points = walker.points.take();
    let (arrays, time) = (std::mem::take(&mut walker.arrays), walker.time);
    let points = points.ok_or_else(|| no_points(text.at()))?;
    let attribute = |array: PointArray| {
        Ok(Attribute {
            name: array.name,
            components: array.components,
            data: array.numbers.decode(bytes)?,
        })
    };
    let attributes: Result<_, ParseError> = arrays.into_iter().map(attribute).collect();
    Ok(RawParticles {
        positions: positions(points.numbers.decode(bytes)?),
        attributes: attributes?,
        time,
        step: None,
    })
}

/// True if numbers are text in the file that begins with `head`.
pub(crate) fn is_text(head: &[u8]) -> bool {
    let mut text = TextInput::whole(head);
    Walker::begin(&mut text, MemoryBudget::UNLIMITED).is_ok_and(|walker| walker.is_text())
}

/// Where the particles of a binary file are; none if some of it is text or bits, or if a particle has more
/// numbers than there are particles, so that arrays of no length cannot claim many.
///
/// # Errors
/// As [`read`].
pub(crate) fn layout(bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
    let mut text = TextInput::whole(bytes);
    let mut walker = Walker::begin(&mut text, MemoryBudget::UNLIMITED)?;
    if walker.is_text() {
        return Ok(None);
    }
    walker.walk(Until::End)?;
    let points = walker.points.ok_or_else(|| no_points(bytes.len()))?;
    let components = walker.arrays.iter().map(|array| array.components);
    if components.fold(0, usize::saturating_add) > FEW_COMPONENTS.max(points.count) {
        return Ok(None);
    }
    let column = |array: PointArray| array.numbers.column(array.name, array.components);
    let attributes: Option<Vec<Column>> = walker.arrays.into_iter().map(column).collect();
    let axes = points.numbers.column("POINTS".to_owned(), 3);
    Ok(axes
        .zip(attributes)
        .map(|(axes, attributes)| ParticleLayout {
            time: walker.time,
            ..ParticleLayout::new(points.count, vec![axes], attributes)
        }))
}

fn no_points(end: usize) -> ParseError {
    ParseError::malformed(end, "the file ends before POINTS")
}
