//! Transforms of prims: the operations that `xformOpOrder` lists, the first one outermost.
//!
//! After the documentation of `UsdGeomXformOp`. USD multiplies row vectors with matrices; here vectors are columns.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::layer::Layer;
use super::number_type::Numbers;
use super::prim::Prim;
use super::scene::{changes_around, numbers_at, tokens_at};
use spherule_frame::{MemoryBudget, ParseError};

/// Most operations of a prim.
const MAX_OPERATIONS: usize = 64;

/// The operation that makes a prim independent of those above.
const RESET: &[u8] = b"!resetXformStack!";
const INVERT: &[u8] = b"!invert!";

/// Memory for a value.
const VALUE_BUDGET: MemoryBudget = MemoryBudget::new(1 << 16, "the file is damaged");

/// The transform of the last prim of `chain` to the world at a time code.
///
/// # Errors
/// [`ParseError::Unsupported`] for transforms that are not read, with the path of the prim.
pub(super) fn world_from_prim(
    layer: &Layer<'_>,
    chain: &[usize],
    time: Option<f64>,
) -> Result<DAffine3, ParseError> {
    let mut world = DAffine3::IDENTITY;
    for (depth, index) in chain.iter().enumerate() {
        let Some(prim) = layer.prims.get(*index) else {
            continue;
        };
        let named = |error: ParseError| {
            error.map_message(|what| {
                let path = layer.path(chain.get(..=depth).unwrap_or(chain));
                format!("{path}: {what}")
            })
        };
        apply(layer, prim, time, &mut world).map_err(named)?;
    }
    Ok(world)
}

/// Multiplies `world` with the transform of `prim`.
fn apply(
    layer: &Layer<'_>,
    prim: &Prim,
    time: Option<f64>,
    world: &mut DAffine3,
) -> Result<(), ParseError> {
    let Some(order) = layer.property(prim, b"xformOpOrder") else {
        return Ok(());
    };
    let order = tokens_at(layer, order, time)?;
    if order.len() > MAX_OPERATIONS {
        let what = format!("more than {MAX_OPERATIONS} transforms of a prim are not read");
        return Err(ParseError::unsupported(what));
    }
    for name in order {
        if name == RESET {
            *world = DAffine3::IDENTITY;
            continue;
        }
        let (plain, is_inverse) = match name.strip_prefix(INVERT) {
            Some(plain) => (plain, true),
            None => (name, false),
        };
        let mut own = operation(layer, prim, plain, time)?;
        if is_inverse {
            own = own.inverse();
        }
        if !own.is_finite() {
            return Err(refused(plain, "is not a number, or cannot be inverted"));
        }
        *world *= own;
    }
    Ok(())
}

fn refused(name: &[u8], why: &str) -> ParseError {
    let name = String::from_utf8_lossy(name.get(..80).unwrap_or(name));
    let what = format!("the transform {name} {why}; apply transforms before the export");
    ParseError::unsupported(what)
}

/// The transform of the operation `name`.
fn operation(
    layer: &Layer<'_>,
    prim: &Prim,
    name: &[u8],
    time: Option<f64>,
) -> Result<DAffine3, ParseError> {
    let kind = name.strip_prefix(b"xformOp:");
    let kind = kind.and_then(|kind| kind.split(|byte| *byte == b':').next());
    let Some(kind) = kind else {
        return Err(refused(name, "is not known"));
    };
    // OpenUSD ignores operations without a value
    let Some(property) = layer.property(prim, name) else {
        return Ok(DAffine3::IDENTITY);
    };
    if property.has_spline {
        return Err(refused(name, "is a curve over time, which is not read"));
    }
    let Some(numbers) = numbers_at(layer, property, time, VALUE_BUDGET)? else {
        return match layer.foreign_type(property) {
            Some(_) => Err(refused(name, "has a value of an unknown type")),
            None => Ok(DAffine3::IDENTITY),
        };
    };
    if numbers.is_quaternion && changes_around(layer, property, time)? {
        let why = "has no sample at the time of the positions, and rotations are not interpolated";
        return Err(refused(name, why));
    }
    matrix_of(kind, name, &numbers)
}

/// The transform of an operation of this kind with these numbers; `name` is its name in messages.
fn matrix_of(kind: &[u8], name: &[u8], numbers: &Numbers) -> Result<DAffine3, ParseError> {
    let wrong = || refused(name, "has a value of another type");
    let one = || numbers.single::<1>().map(|[number]| number).ok_or_else(wrong);
    let three = || numbers.single::<3>().ok_or_else(wrong);
    let axis = |letter: u8| DVec3::AXES[usize::from(letter - b'X')];
    // `translateX` has a value for one axis, `rotateXYZ` one for each letter
    let (kind, letters) = kind.split_at(kind.iter().take_while(|c| c.is_ascii_lowercase()).count());
    Ok(match (kind, letters) {
        (b"translate", []) => DAffine3::from_translation(three()?.into()),
        (b"translate", [letter @ b'X'..=b'Z']) => {
            DAffine3::from_translation(one()? * axis(*letter))
        }
        (b"scale", []) => DAffine3::from_scale(three()?.into()),
        (b"scale", [letter @ b'X'..=b'Z']) => {
            DAffine3::from_scale(DVec3::ONE + (one()? - 1.0) * axis(*letter))
        }
        (b"rotate", [letter @ b'X'..=b'Z']) => DAffine3::from_mat3(rotation(*letter, one()?)),
        (b"rotate", letters) if is_order(letters) => {
            let angles = three()?;
            let turns =
                letters.iter().map(|letter| rotation(*letter, angles[usize::from(letter - b'X')]));
            DAffine3::from_mat3(turns.fold(DMat3::IDENTITY, |all, turn| turn * all))
        }
        (b"orient", []) => {
            let [w, x, y, z] = numbers.single::<4>().ok_or_else(wrong)?;
            let quaternion = DQuat::from_xyzw(x, y, z, w);
            if quaternion.length() > 0.0 {
                DAffine3::from_quat(quaternion.normalize())
            } else {
                DAffine3::IDENTITY
            }
        }
        (b"transform", []) => {
            let rows = numbers.single::<16>().ok_or_else(wrong)?;
            if [rows[3], rows[7], rows[11], rows[15]] != [0.0, 0.0, 0.0, 1.0] {
                return Err(refused(name, "is a projection"));
            }
            let row = |start: usize| DVec3::from_slice(&rows[start..start + 3]);
            DAffine3::from_cols(row(0), row(4), row(8), row(12))
        }
        _ => return Err(refused(name, "is not known")),
    })
}

/// Whether `letters` are the three axes in some order.
fn is_order(letters: &[u8]) -> bool {
    let mut sorted = letters.to_vec();
    sorted.sort_unstable();
    sorted == b"XYZ"
}

/// A rotation by degrees around an axis.
fn rotation(axis: u8, degrees: f64) -> DMat3 {
    let angle = degrees.to_radians();
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    match axis {
        b'X' => DMat3::from_cols(
            DVec3::X,
            DVec3::new(0.0, cosine, sine),
            DVec3::new(0.0, -sine, cosine),
        ),
        b'Y' => DMat3::from_cols(
            DVec3::new(cosine, 0.0, -sine),
            DVec3::Y,
            DVec3::new(sine, 0.0, cosine),
        ),
        _ => DMat3::from_cols(
            DVec3::new(cosine, sine, 0.0),
            DVec3::new(-sine, cosine, 0.0),
            DVec3::Z,
        ),
    }
}
