//! Finds particles in the shape of an array: which dimension counts them, which one holds x, y, z,
//! and whether there is one of time steps before.

use super::dtype::{Dtype, MAX_COMPONENTS, NumberType, RecordField};
use super::header::{NpyHeader, show};
use crate::read::columns::{self, ComponentStride, ParticleLayout, StridedColumn};
use spherule_frame::ParseError;
use spherule_frame::names::POSITION_ARRAYS;

/// Steps without particles take no bytes, so nothing else bounds their number.
const MAX_EMPTY_FRAMES: usize = 1 << 16;

/// How the particles of an array of positions are laid out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ArrayLayout {
    /// Time steps, if there is a dimension for them.
    pub(super) frames: Option<usize>,
    /// Particles in every step.
    pub(super) count: usize,
    /// Coordinates come before particles: shape (3, N).
    pub(super) planes: bool,
}

impl ArrayLayout {
    /// The layout of an array of positions.
    ///
    /// A last dimension of 3 or 2 holds the coordinates; else a first one of 3 does (after the time
    /// steps). (3, 2) is thus three particles in the plane.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] if it cannot be one.
    pub(super) fn of(header: &NpyHeader) -> Result<Self, ParseError> {
        let layout = Self::of_shape(header)?;
        match layout.frames {
            Some(frames) if layout.count == 0 && frames > MAX_EMPTY_FRAMES => {
                Err(ParseError::malformed(
                    header.data,
                    format!(
                        "{frames} time steps without particles; at most {MAX_EMPTY_FRAMES} are allowed"
                    ),
                ))
            }
            _ => Ok(layout),
        }
    }

    fn of_shape(header: &NpyHeader) -> Result<Self, ParseError> {
        let shape = header.shape.as_slice();
        let layout = |frames, count, planes| Self { frames, count, planes };
        match (&header.item.dtype, shape) {
            (Dtype::Pickled, _) => Err(ParseError::unsupported(
                "pickled python objects ('|O'), which are never unpickled; save plain arrays with \
                 numpy.savez",
            )),
            (Dtype::Opaque(code), _) => Err(ParseError::unsupported(format!(
                "an array of `{code}` cannot be read as positions: save float32 or float64"
            ))),
            (Dtype::Record(_), []) => Ok(layout(None, 1, false)),
            (Dtype::Record(_), [count]) => Ok(layout(None, *count, false)),
            (Dtype::Record(_), [frames, count]) => Ok(layout(Some(*frames), *count, false)),
            // numpy.array([]) is all that is left of (0, 3) in careless code.
            (Dtype::Plain(_), [0]) => Ok(layout(None, 0, false)),
            (Dtype::Plain(_), [count, 3]) => Ok(layout(None, *count, false)),
            (Dtype::Plain(_), [count, 2]) => Ok(layout(None, *count, false)),
            (Dtype::Plain(_), [3, count]) => Ok(layout(None, *count, true)),
            (Dtype::Plain(_), [frames, count, 2 | 3]) => Ok(layout(Some(*frames), *count, false)),
            (Dtype::Plain(_), [frames, 3, count]) => Ok(layout(Some(*frames), *count, true)),
            _ => Err(ParseError::unsupported(format!(
                "an array of shape {} is not a list of positions: save shape (N, 3), or a structured \
                 array with a field pos or fields x, y, z",
                show(shape)
            ))),
        }
    }

    /// Where the particles of time step `frame` (0 if there is only one) are.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] if a structure has no positions among its fields.
    pub(super) fn columns(
        &self,
        header: &NpyHeader,
        frame: usize,
    ) -> Result<ParticleLayout, ParseError> {
        match &header.item.dtype {
            Dtype::Record(fields) => self.record_columns(header, fields, frame),
            _ => {
                let column = self.attribute("P", header, frame);
                // Only shape (0,) has no column, and no particles.
                let axes = column.into_iter().collect();
                Ok(ParticleLayout::new(self.count, axes, Vec::new()))
            }
        }
    }

    fn record_columns(
        &self,
        header: &NpyHeader,
        fields: &[RecordField],
        frame: usize,
    ) -> Result<ParticleLayout, ParseError> {
        let strides = header.strides();
        let (start, stride) = match strides.as_slice() {
            [frames, particles] => (header.data + frame * frames, *particles),
            [particles] => (header.data, *particles),
            _ => (header.data, header.item.size),
        };
        let column = |field: &RecordField| {
            let first = ComponentStride { start: start + field.offset, stride };
            let scalar = (field.number.scalar, field.number.endian);
            StridedColumn::interleaved(&field.name, scalar, field.components, first)
        };
        let places = position_fields(fields)?;
        let axes = places.iter().filter_map(|p| fields.get(*p)).map(column).collect();
        let others = fields.iter().enumerate().filter(|(place, _)| !places.contains(place));
        let attributes = columns::group_vectors(others.map(|(_, field)| column(field)).collect());
        Ok(ParticleLayout::new(self.count, axes, attributes))
    }

    /// An array of numbers beside (or with) the positions, if it has one group for each particle of
    /// step `frame`. Without a dimension for time it holds for all steps.
    pub(super) fn attribute(
        &self,
        name: &str,
        header: &NpyHeader,
        frame: usize,
    ) -> Option<StridedColumn> {
        let Dtype::Plain(number) = header.item.dtype else {
            return None;
        };
        let strides = header.strides();
        let mut dimensions: Vec<(usize, usize)> =
            header.shape.iter().copied().zip(strides).collect();
        let mut start = header.data;
        let steps_first = self.frames.is_some_and(|frames| {
            matches!(dimensions.as_slice(), [(f, _), (n, _), ..] if *f == frames && *n == self.count)
                || (self.planes
                    && matches!(dimensions.as_slice(), [(f, _), _, (n, _)] if *f == frames && *n == self.count))
        });
        if steps_first {
            let (_, stride) = dimensions.remove(0);
            start += frame * stride;
        }
        let counts = |(n, _): &(usize, usize)| *n == self.count;
        let last = self.planes && dimensions.len() == 2 && dimensions.last().is_some_and(counts);
        let particles = if last {
            dimensions.pop()?
        } else {
            dimensions.first().copied().filter(counts)?;
            dimensions.remove(0)
        };
        let component_strides = component_strides(start, particles.1, &dimensions)?;
        Some(new_column(name, number, component_strides))
    }
}

fn new_column(
    name: &str,
    number: NumberType,
    component_strides: Vec<ComponentStride>,
) -> StridedColumn {
    StridedColumn {
        name: name.to_owned(),
        scalar: number.scalar,
        endian: number.endian,
        component_strides,
    }
}

/// One component for every index into `dimensions` (size, bytes between neighbours), the last fastest.
fn component_strides(
    start: usize,
    stride: usize,
    dimensions: &[(usize, usize)],
) -> Option<Vec<ComponentStride>> {
    let components = dimensions.iter().try_fold(1, |n: usize, (size, _)| n.checked_mul(*size))?;
    if components > MAX_COMPONENTS {
        return None;
    }
    let mut starts = vec![start];
    for (size, step) in dimensions {
        starts =
            starts.iter().flat_map(|start| (0..*size).map(move |i| start + i * step)).collect();
    }
    Some(starts.into_iter().map(|start| ComponentStride { start, stride }).collect())
}

/// The fields that are the position: one with two or three components, or x, y and perhaps z.
fn position_fields(fields: &[RecordField]) -> Result<Vec<usize>, ParseError> {
    let named = |name: &str, components: std::ops::RangeInclusive<usize>| {
        fields
            .iter()
            .position(|f| f.name.eq_ignore_ascii_case(name) && components.contains(&f.components))
    };
    let vector = POSITION_ARRAYS.iter().find_map(|name| named(name, 2..=3));
    if let Some(place) = vector {
        return Ok(vec![place]);
    }
    let axis = |name| named(name, 1..=1);
    if let (Some(x), Some(y)) = (axis("x"), axis("y")) {
        return Ok([x, y].into_iter().chain(axis("z")).collect());
    }
    let names: Vec<&str> = fields.iter().map(|f| f.name.as_str()).collect();
    Err(ParseError::unsupported(format!(
        "a structured array with no position among its fields [{}]: name one pos, or three x, y, z",
        names.join(", ")
    )))
}
