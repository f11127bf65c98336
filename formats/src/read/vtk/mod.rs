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
use crate::{Attribute, ParseError, RawParticles};
use walk::{PointArray, Until, Walker};

/// More than any tensor or spectrum has. With no particles nothing else bounds the number, and
/// callers keep something for each component.
pub(in crate::read) const MOST_COMPONENTS: usize = 1 << 16;

/// So many numbers of a particle can be listed however few the particles are.
const FEW_COMPONENTS: usize = 4096;

/// The one time step that `bytes` hold, with the time if a dataset-level FIELD before the points
/// tells it. A damaged file is reported by [`read`], not here.
///
/// # Errors
/// None at present.
pub fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    let mut step = Step::whole(bytes.len());
    step.time = Walker::begin(bytes).ok().and_then(|mut walker| {
        // What went wrong on the way matters to `read`; the time found until then is good.
        let _ = walker.walk(Until::Points);
        walker.time
    });
    Ok(vec![step])
}

/// Reads the particles of a legacy VTK file.
///
/// # Errors
/// [`ParseError::Malformed`] if the file is cut short or breaks the format,
/// [`ParseError::Unsupported`] if it holds a grid or is of a later version.
pub fn read(bytes: &[u8], _step: &Step) -> Result<RawParticles, ParseError> {
    let mut walker = Walker::begin(bytes)?;
    walker.walk(Until::End)?;
    let points = walker.points.ok_or_else(|| no_points(bytes))?;
    let attribute = |array: PointArray| {
        Ok(Attribute {
            name: array.name,
            components: array.components,
            data: array.numbers.decode(bytes)?,
        })
    };
    let attributes: Result<_, ParseError> = walker.arrays.into_iter().map(attribute).collect();
    Ok(RawParticles {
        positions: positions(points.numbers.decode(bytes)?),
        attributes: attributes?,
        time: walker.time,
        step: None,
    })
}

/// Where the particles of a binary file are; none if some of it is text or bits, or if a particle has more
/// numbers than there are particles, so that arrays of no length cannot claim many.
///
/// # Errors
/// As [`read`].
pub(crate) fn layout(bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
    let mut walker = Walker::begin(bytes)?;
    if walker.is_text() {
        return Ok(None);
    }
    walker.walk(Until::End)?;
    let points = walker.points.ok_or_else(|| no_points(bytes))?;
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

fn no_points(bytes: &[u8]) -> ParseError {
    ParseError::malformed(bytes.len(), "the file ends before POINTS")
}
