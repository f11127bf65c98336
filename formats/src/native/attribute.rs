//! An attribute of a native frame, accessed in place: values are decoded on access.

use std::ops::Range;

use super::layout::AttributeIndex;
use super::stored::StoredType;
use spherule_frame::values::{Column, Named};

use crate::{Attribute, AttributeData, Endian, ParseError, ScalarType};

impl Named for AttributeView<'_> {
    fn name(&self) -> &str {
        self.name()
    }

    fn components(&self) -> usize {
        self.components()
    }

    fn is_integer(&self) -> bool {
        matches!(self.stored(), StoredType::Plain(kind) if !matches!(kind, ScalarType::F32 | ScalarType::F64))
    }
}

impl Column for AttributeView<'_> {
    fn get(&self, index: usize, component: usize) -> f64 {
        self.get(index, component)
    }

    fn magnitude(&self, index: usize) -> f64 {
        self.magnitude(index)
    }
}

/// The values of an attribute, in place.
#[derive(Debug, Clone, Copy)]
pub struct AttributeView<'a> {
    index: &'a AttributeIndex,
    stored: StoredType,
    bytes: &'a [u8],
}

impl<'a> AttributeView<'a> {
    pub(super) const fn new(
        index: &'a AttributeIndex,
        stored: StoredType,
        bytes: &'a [u8],
    ) -> Self {
        Self { index, stored, bytes }
    }

    /// Name.
    pub fn name(&self) -> &'a str {
        &self.index.name
    }

    /// How values are stored.
    pub const fn stored(&self) -> StoredType {
        self.stored
    }

    /// Numbers per particle.
    pub const fn components(&self) -> usize {
        self.index.components as usize
    }

    /// Component `component` of particle `index`; NaN if it does not exist.
    #[inline]
    pub fn get(&self, index: usize, component: usize) -> f64 {
        let range = self.index.ranges.get(component).copied();
        self.bytes_of(index, component)
            .map_or(f64::NAN, |bytes| self.stored.value(bytes, range.unwrap_or_default()))
    }

    /// The value of particle `index`; the Euclidean length of a vector, as in [`Attribute::magnitude`].
    #[inline]
    pub fn magnitude(&self, index: usize) -> f64 {
        if self.components() == 1 {
            return self.get(index, 0);
        }
        let squares = (0..self.components()).map(|component| {
            let value = self.get(index, component);
            value * value
        });
        squares.sum::<f64>().sqrt()
    }

    /// The low 32 bits of an integer, for the display of ids; `None` if the particle does not exist or its
    /// value is not an integer.
    pub fn low_bits(&self, index: usize) -> Option<u32> {
        let bytes = self.bytes_of(index, 0)?;
        let StoredType::Plain(kind) = self.stored else {
            return None;
        };
        let is_negative = bytes.last().is_some_and(|top| top & 0x80 != 0);
        let fill = match kind {
            ScalarType::F32 | ScalarType::F64 => return None,
            ScalarType::I8 | ScalarType::I16 | ScalarType::I32 | ScalarType::I64 if is_negative => {
                0xff
            }
            _ => 0,
        };
        let byte = |i: usize| bytes.get(i).copied().unwrap_or(fill);
        Some(u32::from_le_bytes(std::array::from_fn(byte)))
    }

    /// Copies the values of the particles `places`, little-endian, in the types of [`Self::to_attribute`];
    /// `None` if there are too few values.
    pub(crate) fn copy_to(&self, places: Range<usize>, to: &mut [u8]) -> Option<()> {
        let width = self.components().checked_mul(self.stored.size())?;
        let bytes = places.start.checked_mul(width)?..places.end.checked_mul(width)?;
        let values = self.bytes.get(bytes)?;
        if let StoredType::Plain(_) = self.stored {
            to.get_mut(..values.len())?.copy_from_slice(values);
            return Some(());
        }
        let (to, _) = to.as_chunks_mut::<4>();
        for (to, value) in to.iter_mut().zip(self.decoded(values)) {
            *to = value.to_le_bytes();
        }
        Some(())
    }

    /// A copy of all values in their stored type; half-precision values and 8-bit codes become f32.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if there are too few bytes.
    pub fn to_attribute(&self) -> Result<Attribute, ParseError> {
        let data = match self.stored {
            StoredType::Plain(kind) => kind.decode(Endian::Little, self.bytes)?,
            StoredType::Half | StoredType::Ranged => {
                AttributeData::F32(self.decoded(self.bytes).collect())
            }
        };
        Ok(Attribute { name: self.index.name.clone(), components: self.components(), data })
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "values of 16 bits and fewer are shown in f32"
    )]
    fn decoded(&self, bytes: &'a [u8]) -> impl Iterator<Item = f32> {
        let (components, ranges) = (self.components(), &self.index.ranges);
        let values = bytes.chunks_exact(self.stored.size()).enumerate();
        values.map(move |(place, bytes)| {
            let range = ranges.get(place % components).copied();
            self.stored.value(bytes, range.unwrap_or_default()) as f32
        })
    }

    #[inline]
    fn bytes_of(&self, index: usize, component: usize) -> Option<&'a [u8]> {
        let size = self.stored.size();
        let place = index.checked_mul(self.components())?.checked_add(component)?;
        let start = place.checked_mul(size)?;
        self.bytes.get(start..start.checked_add(size)?)
    }
}
