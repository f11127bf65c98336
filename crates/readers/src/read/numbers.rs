//! Numbers of a binary file from front to back, in either byte order.

use super::CUT_SHORT;
use spherule_frame::{Endian, ParseError};

/// Numbers of a file from front to back.
#[derive(Debug, Clone, Copy)]
pub(super) struct NumberReader<'a> {
    bytes: &'a [u8],
    at: usize,
    endian: Endian,
}

impl<'a> NumberReader<'a> {
    /// The numbers of `bytes` from `at` on, in the byte order `endian`.
    pub(super) const fn new(bytes: &'a [u8], at: usize, endian: Endian) -> Self {
        Self { bytes, at, endian }
    }

    /// Offset of the next number.
    pub(super) const fn at(&self) -> usize {
        self.at
    }

    /// The next `len` bytes.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the end of the file.
    pub(super) fn take(&mut self, len: usize) -> Result<&'a [u8], ParseError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some(taken) = rest.get(..len) else {
            let what =
                format!("{len} bytes expected here, file has {} left: {CUT_SHORT}", rest.len());
            return Err(ParseError::malformed(self.at, what));
        };
        self.at += len;
        Ok(taken)
    }

    /// The bytes of a number, the least significant first.
    ///
    /// # Errors
    /// As [`Self::take`].
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], ParseError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        if self.endian == Endian::Big {
            array.reverse();
        }
        Ok(array)
    }

    pub(super) fn i32(&mut self) -> Result<i32, ParseError> {
        self.array().map(i32::from_le_bytes)
    }

    pub(super) fn i64(&mut self) -> Result<i64, ParseError> {
        self.array().map(i64::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, ParseError> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Result<f32, ParseError> {
        self.array().map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, ParseError> {
        self.array().map(f64::from_le_bytes)
    }

    /// A count or a length, called `name` in the error.
    pub(super) fn count(&mut self, name: &str) -> Result<usize, ParseError> {
        let at = self.at;
        let count = self.i32()?;
        usize::try_from(count)
            .map_err(|_| ParseError::malformed(at, format!("the {name} is {count}")))
    }
}
