//! Decodes stored numbers.

use crate::{AttributeData, Endian, ParseError, ScalarType, with_number_type};

impl ScalarType {
    /// Decodes all of `bytes`, which must be a whole number of scalars.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at byte 0 if the length is not a multiple of [`Self::size`].
    pub fn decode(self, endian: Endian, bytes: &[u8]) -> Result<AttributeData, ParseError> {
        if !bytes.len().is_multiple_of(self.size()) {
            return Err(ParseError::malformed(
                0,
                format!("{} bytes are not a whole number of {}", bytes.len(), self.name()),
            ));
        }
        Ok(with_number_type!(self, Number => {
            let words = bytes.as_chunks::<{ size_of::<Number>() }>().0.iter();
            let numbers: Vec<Number> = match endian {
                Endian::Little => words.map(|b| Number::from_le_bytes(*b)).collect(),
                Endian::Big => words.map(|b| Number::from_be_bytes(*b)).collect(),
            };
            numbers.into()
        }))
    }
}
