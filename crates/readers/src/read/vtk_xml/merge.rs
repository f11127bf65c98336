//! Several pieces become one set of particles: arrays are joined in the order of the pieces.

use std::collections::{HashMap, HashSet};

use super::appended::Appended;
use super::document::{DataArray, Piece, XmlDocument};
use super::{scalar_type, value_count, values};
use crate::read::vtk;
use spherule_frame::{Attribute, AttributeData, ParseError, Positions, ScalarType};

/// The positions of all pieces; double precision if any piece has it.
pub(super) fn positions(
    document: &XmlDocument<'_>,
    appended: Option<Appended<'_>>,
) -> Result<Positions, ParseError> {
    let mut joined = Positions::F32(Vec::new());
    for piece in filled(document) {
        joined = join_positions(joined, piece_positions(document, piece, appended)?);
    }
    Ok(joined)
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

fn join_positions(joined: Positions, more: Positions) -> Positions {
    match (joined, more) {
        (first, more) if first.is_empty() => more,
        (Positions::F32(mut a), Positions::F32(b)) => {
            a.extend(b);
            Positions::F32(a)
        }
        (a, b) => {
            let mut wide = into_f64(a);
            wide.extend(into_f64(b));
            Positions::F64(wide)
        }
    }
}

fn into_f64(positions: Positions) -> Vec<glam::DVec3> {
    match positions {
        Positions::F32(v) => v.iter().map(|p| p.as_dvec3()).collect(),
        Positions::F64(v) => v,
    }
}

/// The attributes that every piece with particles has, with the same type and components.
pub(super) fn attributes(
    document: &XmlDocument<'_>,
    appended: Option<Appended<'_>>,
) -> Result<Vec<Attribute>, ParseError> {
    let mut pieces: Vec<&Piece<'_>> = filled(document).collect();
    if pieces.is_empty() {
        // No particles: keep the set of attributes all the same.
        pieces.extend(document.pieces.first());
    }
    let Some((first, others)) = pieces.split_first() else {
        return Ok(Vec::new());
    };
    // A file may list as many arrays as it has room for: each is looked up, never searched for.
    let others: Vec<(&Piece<'_>, ArraysByKind<'_, '_>)> =
        others.iter().map(|p| (*p, by_kind(p))).collect();
    let mut tried = HashSet::new();
    let mut names = HashSet::new();
    let mut joined: Vec<Attribute> = Vec::new();
    for array in &first.point_data {
        let components = array.components.unwrap_or(1);
        // What was left out once is left out again.
        let kind = kind(array);
        if components == 0 || !tried.insert(kind) || names.contains(array.name.as_str()) {
            continue;
        }
        let everywhere: Option<Vec<&DataArray<'_>>> =
            others.iter().map(|(_, arrays)| arrays.get(&kind).copied()).collect();
        let Some(parts) = everywhere else {
            continue;
        };
        let count = value_count(array, first.points, components)?;
        let Some(mut data) = values(array, document.encoding, appended, count)? else {
            continue;
        };
        for ((piece, _), part) in others.iter().zip(parts) {
            let count = value_count(part, piece.points, components)?;
            match values(part, document.encoding, appended, count)? {
                Some(more) => extend(&mut data, more),
                None => return Err(not_numeric(part)),
            }
        }
        names.insert(array.name.as_str());
        joined.push(Attribute { name: array.name.clone(), components, data });
    }
    Ok(joined)
}

/// Pieces that hold particles; VTK drops the attributes of the others.
pub(super) fn filled<'d, 'a>(document: &'d XmlDocument<'a>) -> impl Iterator<Item = &'d Piece<'a>> {
    document.pieces.iter().filter(|piece| piece.points > 0)
}

/// What arrays of two pieces must share to be joined: name, components and type.
type AttributeKind<'p> = (&'p str, usize, Option<ScalarType>);

/// The first array of each kind in a piece.
type ArraysByKind<'p, 'a> = HashMap<AttributeKind<'p>, &'p DataArray<'a>>;

fn kind<'p>(array: &'p DataArray<'_>) -> AttributeKind<'p> {
    (&array.name, array.components.unwrap_or(1), scalar_type(&array.type_name))
}

fn by_kind<'p, 'a>(piece: &'p Piece<'a>) -> ArraysByKind<'p, 'a> {
    let mut arrays = HashMap::with_capacity(piece.point_data.len());
    for array in &piece.point_data {
        arrays.entry(kind(array)).or_insert(array);
    }
    arrays
}

/// Appends `more`, which has the same type: it is of the same [`AttributeKind`].
fn extend(data: &mut AttributeData, more: AttributeData) {
    use AttributeData::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    match (data, more) {
        (I8(a), I8(b)) => a.extend(b),
        (U8(a), U8(b)) => a.extend(b),
        (I16(a), I16(b)) => a.extend(b),
        (U16(a), U16(b)) => a.extend(b),
        (I32(a), I32(b)) => a.extend(b),
        (U32(a), U32(b)) => a.extend(b),
        (I64(a), I64(b)) => a.extend(b),
        (U64(a), U64(b)) => a.extend(b),
        (F32(a), F32(b)) => a.extend(b),
        (F64(a), F64(b)) => a.extend(b),
        (a, b) => unreachable!("{:?} joined with {:?}", a.scalar_type(), b.scalar_type()),
    }
}

/// The error for an array of strings.
pub(super) fn not_numeric(array: &DataArray<'_>) -> ParseError {
    ParseError::malformed(
        array.at,
        format!("type `{}` is not a number", super::short(&array.type_name)),
    )
}
