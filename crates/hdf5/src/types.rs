//! Data types of HDF5 as scalars.

use hdf5_reader::{ByteOrder, Datatype};

use spherule_frame::{Endian, ScalarType};

/// The numbers that `datatype` stores; `None` if it stores anything but integers or floats of a usual size.
pub(super) fn stored_scalar(datatype: &Datatype) -> Option<(ScalarType, Endian)> {
    let (scalar, order) = match datatype {
        Datatype::FixedPoint { size, signed, byte_order } => (integer(*size, *signed)?, byte_order),
        Datatype::FloatingPoint { size: 4, byte_order } => (ScalarType::F32, byte_order),
        Datatype::FloatingPoint { size: 8, byte_order } => (ScalarType::F64, byte_order),
        // Booleans of h5py, and named integers.
        Datatype::Enum { base, .. } => return stored_scalar(base),
        _ => return None,
    };
    let endian = match order {
        ByteOrder::LittleEndian => Endian::Little,
        ByteOrder::BigEndian => Endian::Big,
    };
    Some((scalar, endian))
}

const fn integer(size: u8, signed: bool) -> Option<ScalarType> {
    match (size, signed) {
        (1, true) => Some(ScalarType::I8),
        (1, false) => Some(ScalarType::U8),
        (2, true) => Some(ScalarType::I16),
        (2, false) => Some(ScalarType::U16),
        (4, true) => Some(ScalarType::I32),
        (4, false) => Some(ScalarType::U32),
        (8, true) => Some(ScalarType::I64),
        (8, false) => Some(ScalarType::U64),
        _ => None,
    }
}

/// Numbers in each element of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Field {
    /// Bytes from the start of an element.
    pub(super) offset: usize,
    pub(super) scalar: ScalarType,
    pub(super) endian: Endian,
    pub(super) components: usize,
}

impl Field {
    /// The numbers of an element of `datatype`: one, or an array.
    pub(super) fn of(datatype: &Datatype) -> Option<Self> {
        let (base, components) = match datatype {
            Datatype::Array { base, dims } => {
                let components = dims.iter().try_fold(1_u64, |n, dim| n.checked_mul(*dim))?;
                (&**base, usize::try_from(components).ok()?)
            }
            other => (other, 1),
        };
        let (scalar, endian) = stored_scalar(base)?;
        Some(Self { offset: 0, scalar, endian, components })
    }

    /// The fields of numbers of a compound type, with their names.
    pub(super) fn of_compound(datatype: &Datatype) -> Vec<(String, Self)> {
        let Datatype::Compound { fields, .. } = datatype else {
            return Vec::new();
        };
        let fields = fields.iter().filter_map(|field| {
            let numbers = Self::of(&field.datatype)?;
            let offset = usize::try_from(field.byte_offset).ok()?;
            Some((field.name.clone(), Self { offset, ..numbers }))
        });
        fields.collect()
    }

    /// Bytes from the start of an element to the end of its numbers.
    pub(super) const fn end(&self) -> Option<usize> {
        match self.components.checked_mul(self.scalar.size()) {
            Some(len) => self.offset.checked_add(len),
            None => None,
        }
    }
}
