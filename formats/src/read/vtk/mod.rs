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
use crate::{ParseError, RawParticles};
use walk::{Until, Walker};

/// More than any tensor or spectrum has. With no particles nothing else bounds the number, and
/// callers keep something for each component.
pub(in crate::read) const MOST_COMPONENTS: usize = 1 << 16;

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
    let Some(positions) = walker.positions else {
        return Err(ParseError::malformed(
            bytes.len(),
            "the file ends before POINTS",
        ));
    };
    Ok(RawParticles {
        positions,
        attributes: walker.attributes,
        time: walker.time,
        step: None,
    })
}
