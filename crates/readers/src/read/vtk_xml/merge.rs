//! Several pieces become one set of particles: arrays are joined in the order of the pieces.

use super::appended::Appended;
use super::document::{DataArray, Piece, XmlDocument};
use super::{value_count, values};
use crate::read::vtk;
use spherule_frame::join::{Part, join};
use spherule_frame::{Attribute, MemoryBudget, ParseError, Positions, RawParticles};

/// The particles of all pieces of `document`. If they have no particles, the attributes of the first are kept.
pub(super) fn particles(
    document: &XmlDocument<'_>,
    appended: Option<Appended<'_>>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let mut parts = Vec::new();
    for (number, piece) in (0..).zip(&document.pieces).filter(|(_, piece)| piece.points > 0) {
        let positions = piece_positions(document, piece, appended)?;
        let attributes = attributes(document, piece, appended)?;
        let particles = RawParticles { positions, attributes, ..RawParticles::default() };
        parts.push(Part { number, name: format!("piece {number}"), particles });
    }
    match document.pieces.first().filter(|_| parts.is_empty()) {
        Some(first) => Ok(RawParticles {
            attributes: attributes(document, first, appended)?,
            ..RawParticles::default()
        }),
        None => join(parts, budget),
    }
}

/// The positions of `piece`, one of those of `document`.
pub(super) fn piece_positions(
    document: &XmlDocument<'_>,
    piece: &Piece<'_>,
    appended: Option<Appended<'_>>,
) -> Result<Positions, ParseError> {
    let Some(array) = &piece.coordinates else {
        return Err(ParseError::malformed(
            0,
            format!("a piece of {} points has no <Points>", piece.points),
        ));
    };
    if array.components.is_some_and(|k| k != 3) {
        return Err(ParseError::malformed(array.at, "points without 3 components"));
    }
    let count = value_count(array, piece.points, 3)?;
    let Some(data) = values(array, document.encoding, appended, count)? else {
        return Err(not_numeric(array));
    };
    Ok(vtk::positions(data))
}

/// The numeric attributes of `piece`.
fn attributes(
    document: &XmlDocument<'_>,
    piece: &Piece<'_>,
    appended: Option<Appended<'_>>,
) -> Result<Vec<Attribute>, ParseError> {
    let mut attributes = Vec::new();
    for array in &piece.point_data {
        let components = array.components.unwrap_or(1);
        if components == 0 {
            continue;
        }
        let count = value_count(array, piece.points, components)?;
        if let Some(data) = values(array, document.encoding, appended, count)? {
            attributes.push(Attribute { name: array.name.clone(), components, data });
        }
    }
    Ok(attributes)
}

/// Pieces that hold particles; VTK drops the attributes of the others.
pub(super) fn filled<'d, 'a>(document: &'d XmlDocument<'a>) -> impl Iterator<Item = &'d Piece<'a>> {
    document.pieces.iter().filter(|piece| piece.points > 0)
}

/// The error for an array of strings.
pub(super) fn not_numeric(array: &DataArray<'_>) -> ParseError {
    ParseError::malformed(
        array.at,
        format!("type `{}` is not a number", super::short(&array.type_name)),
    )
}
