//! Numbers in arrays of all kinds, uniform or not.

use super::cursor::JsonCursor;
use super::tokens::{ElementType, Token, UniformArray, Value, unexpected};
use spherule_frame::{AttributeData, Endian, MemoryBudget, ParseError, ScalarType};

/// Numbers as they are in the file.
#[derive(Debug)]
pub(super) enum Numbers<'a> {
    /// An array of one type.
    Uniform(UniformArray<'a>),
    /// Numbers and arrays of numbers, one after another.
    Integers(Vec<i64>),
    /// The same, if one of them is not an integer.
    Reals(Vec<f64>),
}

impl<'a> Numbers<'a> {
    /// The numbers of the value that `token` begins. Arrays in arrays become one array.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if it has anything but numbers and truth values; [`ParseError::TooLarge`].
    pub(super) fn read(
        cursor: &mut JsonCursor<'a>,
        token: Token<'a>,
        budget: MemoryBudget,
    ) -> Result<Self, ParseError> {
        match token.value {
            Value::Uniform(array) if array.element != ElementType::Bits => {
                return Ok(Self::Uniform(array));
            }
            Value::Uniform(_) | Value::Begin => {}
            _ => return Err(unexpected(token.at, "an array of numbers")),
        }
        let mut numbers = Self::Integers(Vec::new());
        let mut depth = 0_usize;
        let mut next = token;
        loop {
            match next.value {
                Value::Begin => depth += 1,
                Value::End => depth = depth.saturating_sub(1),
                Value::Integer(number) => numbers.push_integer(number),
                Value::Bool(flag) => numbers.push_integer(flag.into()),
                Value::Real(number) => numbers.push_real(number),
                Value::Uniform(array) => numbers.extend(array, cursor.endian, budget)?,
                Value::Null | Value::Text(_) => return Err(unexpected(next.at, "a number")),
            }
            budget.check(8 * numbers.len() as u64, "its numbers in memory are")?;
            if depth == 0 {
                return Ok(numbers);
            }
            next = cursor.next()?;
        }
    }

    pub(super) const fn len(&self) -> usize {
        match self {
            Self::Uniform(array) => array.count,
            Self::Integers(numbers) => numbers.len(),
            Self::Reals(numbers) => numbers.len(),
        }
    }

    /// Bytes that the numbers take beside the file.
    pub(super) const fn byte_len(&self) -> u64 {
        match self {
            Self::Uniform(_) => 0,
            Self::Integers(_) | Self::Reals(_) => 8 * self.len() as u64,
        }
    }

    /// The numbers as `target`; `at` is where they are in the file.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] for numbers that `target` does not have.
    pub(super) fn decode(
        &self,
        endian: Endian,
        target: ScalarType,
        at: usize,
    ) -> Result<AttributeData, ParseError> {
        let data = match self {
            Self::Uniform(array) => decode_array(*array, endian),
            Self::Integers(numbers) => AttributeData::I64(numbers.clone()),
            Self::Reals(numbers) => AttributeData::F64(numbers.clone()),
        };
        if data.scalar_type() == target {
            return Ok(data);
        }
        convert(&data, target).ok_or_else(|| {
            let (found, target) = (data.scalar_type().name(), target.name());
            let what =
                format!("numbers of the type {found} do not fit into the stated type {target}");
            ParseError::malformed(at, what)
        })
    }

    /// The numbers as counts.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if one of them is not one.
    pub(super) fn counts(&self, endian: Endian, at: usize) -> Result<Vec<usize>, ParseError> {
        let AttributeData::I64(numbers) = self.decode(endian, ScalarType::I64, at)? else {
            return Err(unexpected(at, "integers"));
        };
        let counts: Result<Vec<usize>, _> = numbers.into_iter().map(usize::try_from).collect();
        counts.map_err(|_| unexpected(at, "positive integers"))
    }

    fn push_integer(&mut self, number: i64) {
        match self {
            Self::Integers(numbers) => numbers.push(number),
            #[expect(clippy::cast_precision_loss, reason = "one of the numbers is real")]
            _ => self.push_real(number as f64),
        }
    }

    fn push_real(&mut self, number: f64) {
        if let Self::Integers(numbers) = self {
            #[expect(clippy::cast_precision_loss, reason = "one of the numbers is real")]
            let reals = numbers.iter().map(|n| *n as f64).collect();
            *self = Self::Reals(reals);
        }
        if let Self::Reals(numbers) = self {
            numbers.push(number);
        }
    }

    fn extend(
        &mut self,
        array: UniformArray<'_>,
        endian: Endian,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        let need = (self.len() + array.count) as u64;
        budget.check(need.saturating_mul(8), "its numbers in memory are")?;
        if array.element == ElementType::Bits {
            bits(array, endian).for_each(|bit| self.push_integer(bit.into()));
            return Ok(());
        }
        let data = decode_array(array, endian);
        if matches!(data, AttributeData::F32(_) | AttributeData::F64(_)) {
            (0..data.len()).for_each(|i| self.push_real(data.get_f64(i)));
        } else if let Some(AttributeData::I64(numbers)) = convert(&data, ScalarType::I64) {
            numbers.into_iter().for_each(|n| self.push_integer(n));
        }
        Ok(())
    }
}

/// The truth values of the value that `token` begins.
///
/// # Errors
/// As [`Numbers::read`].
pub(super) fn flags<'a>(
    cursor: &mut JsonCursor<'a>,
    token: Token<'a>,
    budget: MemoryBudget,
) -> Result<Vec<bool>, ParseError> {
    if let Value::Uniform(array) = token.value
        && array.element == ElementType::Bits
    {
        budget.check(array.count as u64, "its numbers in memory are")?;
        return Ok(bits(array, cursor.endian).collect());
    }
    let numbers = Numbers::read(cursor, token, budget)?;
    let data = numbers.decode(cursor.endian, ScalarType::F64, token.at)?;
    Ok((0..data.len()).map(|i| data.get_f64(i) != 0.0).collect())
}

/// The bits of words of 32, the lowest first.
fn bits(array: UniformArray<'_>, endian: Endian) -> impl Iterator<Item = bool> {
    let words = array.bytes.as_chunks().0.iter().map(move |word| match endian {
        Endian::Little => u32::from_le_bytes(*word),
        Endian::Big => u32::from_be_bytes(*word),
    });
    let bits = words.flat_map(|word| (0..32).map(move |bit| word & (1 << bit) != 0));
    bits.take(array.count)
}

/// The numbers of an array, in its type; half precision becomes single precision. No numbers of other arrays.
fn decode_array(array: UniformArray<'_>, endian: Endian) -> AttributeData {
    match array.element {
        ElementType::Number(scalar) => {
            let data = scalar.decode(endian, array.bytes);
            data.unwrap_or_else(|_| AttributeData::U8(Vec::new()))
        }
        ElementType::Half => {
            let numbers = array.bytes.as_chunks().0.iter().map(|bytes| match endian {
                Endian::Little => half::f16::from_le_bytes(*bytes),
                Endian::Big => half::f16::from_be_bytes(*bytes),
            });
            AttributeData::F32(numbers.map(f32::from).collect())
        }
        ElementType::Bits | ElementType::Text => AttributeData::U8(Vec::new()),
    }
}

/// `data` as `target`; `None` if an integer does not fit, or for real numbers as integers.
fn convert(data: &AttributeData, target: ScalarType) -> Option<AttributeData> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the file states the precision of its numbers"
    )]
    match target {
        ScalarType::F32 => {
            let numbers = (0..data.len()).map(|i| data.get_f64(i) as f32);
            return Some(AttributeData::F32(numbers.collect()));
        }
        ScalarType::F64 => {
            let numbers = (0..data.len()).map(|i| data.get_f64(i));
            return Some(AttributeData::F64(numbers.collect()));
        }
        _ => {}
    }
    let integers: Vec<i64> = match data {
        AttributeData::I8(v) => v.iter().map(|n| (*n).into()).collect(),
        AttributeData::U8(v) => v.iter().map(|n| (*n).into()).collect(),
        AttributeData::I16(v) => v.iter().map(|n| (*n).into()).collect(),
        AttributeData::U16(v) => v.iter().map(|n| (*n).into()).collect(),
        AttributeData::I32(v) => v.iter().map(|n| (*n).into()).collect(),
        AttributeData::I64(v) => v.clone(),
        _ => return None,
    };
    macro_rules! integers {
        ($($variant:ident $ty:ty),*) => {
            match target {
                $(ScalarType::$variant => {
                    let numbers = integers.iter().map(|n| <$ty>::try_from(*n).ok());
                    Some(AttributeData::$variant(numbers.collect::<Option<Vec<_>>>()?))
                })*
                _ => None,
            }
        };
    }
    integers!(I8 i8, U8 u8, I16 i16, U16 u16, I32 i32, U32 u32, I64 i64)
}
