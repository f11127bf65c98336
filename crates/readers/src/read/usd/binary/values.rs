//! Values of binary USD files. A word of 64 bits has the type of a value, and its place or the value itself.

use super::{CUT_OR_DAMAGED, CrateFile};
use crate::read::numbers::NumberReader;
use crate::read::usd::number_type::{NumberType, Numbers, Scalar};
use crate::read::usd::prim::{Samples, ValueRep};
use spherule_frame::{AttributeData, MemoryBudget, ParseError, ScalarType};

/// Codes of types.
const TOKEN: u8 = 11;
const TOKEN_VECTOR: u8 = 41;
const TIME_SAMPLES: u8 = 46;
const DOUBLE: u8 = 9;
const DOUBLE_VECTOR: u8 = 48;
/// There is no value, although the prim may have had one.
const BLOCK: u8 = 51;

/// Shortest arrays that are compressed.
const MIN_COMPRESSED: usize = 16;

impl ValueRep {
    const fn kind(self) -> u8 {
        self.0.to_le_bytes()[6]
    }

    const fn is_array(self) -> bool {
        self.0 >> 63 & 1 == 1
    }

    const fn is_inlined(self) -> bool {
        self.0 >> 62 & 1 == 1
    }

    const fn is_compressed(self) -> bool {
        self.0 >> 61 & 1 == 1
    }

    const fn payload(self) -> u64 {
        self.0 & 0xffff_ffff_ffff
    }

    /// The value itself, if it is in the word.
    const fn inlined(self) -> Option<[u8; 4]> {
        let [a, b, c, d, ..] = self.0.to_le_bytes();
        if self.is_inlined() && !self.is_array() { Some([a, b, c, d]) } else { None }
    }

    /// An enumerator or a boolean.
    pub(super) fn enumerator(self) -> Option<u32> {
        self.inlined().map(u32::from_le_bytes)
    }

    /// Type of the numbers; `None` for other values.
    fn number_type(self) -> Option<NumberType> {
        const F32: Scalar = Scalar::Plain(ScalarType::F32);
        const F64: Scalar = Scalar::Plain(ScalarType::F64);
        const I32: Scalar = Scalar::Plain(ScalarType::I32);
        let plain = |scalar| NumberType::new(Scalar::Plain(scalar), 1);
        Some(match self.kind() {
            1 | 2 => plain(ScalarType::U8),
            3 => plain(ScalarType::I32),
            4 => plain(ScalarType::U32),
            5 => plain(ScalarType::I64),
            6 => plain(ScalarType::U64),
            7 => NumberType::new(Scalar::Half, 1),
            8 => NumberType::new(F32, 1),
            DOUBLE => NumberType::new(F64, 1),
            14 => NumberType::new(F64, 9),
            15 => NumberType::new(F64, 16),
            16 => NumberType::quaternion(F64),
            17 => NumberType::quaternion(F32),
            18 => NumberType::quaternion(Scalar::Half),
            // Vectors of two, three and four components
            kind @ 19..=30 => {
                let scalar = [F64, F32, Scalar::Half, I32][usize::from((kind - 19) % 4)];
                NumberType::new(scalar, usize::from((kind - 19) / 4) + 2)
            }
            _ => return None,
        })
    }
}

impl<'a> CrateFile<'a> {
    /// The word of 64 bits at byte `at`; 0 behind the end of the file.
    pub(in crate::read::usd) fn u64_at(&self, at: usize) -> u64 {
        let stored = self.bytes.get(at..).and_then(<[u8]>::first_chunk);
        stored.map_or(0, |stored| u64::from_le_bytes(*stored))
    }

    /// The code of the type of a value, if that is not one of numbers.
    pub(in crate::read::usd) fn foreign_type(rep: ValueRep) -> Option<String> {
        let is_foreign = rep.number_type().is_none() && rep.kind() != BLOCK;
        is_foreign.then(|| format!("number {}", rep.kind()))
    }

    /// See [`crate::read::usd::layer::Layer::numbers`].
    pub(in crate::read::usd) fn numbers(
        &self,
        rep: ValueRep,
        budget: MemoryBudget,
    ) -> Result<Option<Numbers>, ParseError> {
        let Some(number_type) = rep.number_type() else {
            return Ok(None);
        };
        let data = if rep.is_array() {
            self.array(rep, number_type, budget)?
        } else if let Some(bytes) = rep.inlined() {
            match inlined_numbers(number_type, bytes) {
                Some(data) => data,
                None => return Ok(None),
            }
        } else {
            let mut reader = self.reader_at(rep.payload(), 0)?;
            number_type.decode(reader.take(number_type.stored_len())?)
        };
        Ok(Some(Numbers {
            components: number_type.components,
            data,
            is_array: rep.is_array(),
            is_quaternion: number_type.is_quaternion,
        }))
    }

    /// The number of values of an array, and the bytes that follow.
    fn array_start(&self, rep: ValueRep) -> Result<(usize, NumberReader<'a>), ParseError> {
        let mut reader = self.reader_at(rep.payload(), 0)?;
        let count = match self.minor_version {
            7.. => reader.u64()?,
            5..7 => u64::from(reader.i32()?.cast_unsigned()),
            _ => {
                // Number of dimensions, which is 1
                reader.i32()?;
                u64::from(reader.i32()?.cast_unsigned())
            }
        };
        Ok((usize::try_from(count).unwrap_or(usize::MAX), reader))
    }

    fn array(
        &self,
        rep: ValueRep,
        number_type: NumberType,
        budget: MemoryBudget,
    ) -> Result<AttributeData, ParseError> {
        // An array without values
        if rep.payload() == 0 {
            return Ok(number_type.decode(&[]));
        }
        let (count, mut reader) = self.array_start(rep)?;
        let each = number_type.components * number_type.in_memory().size();
        let need = count.saturating_mul(each) as u64;
        if !rep.is_compressed() || count < MIN_COMPRESSED {
            let len = count.saturating_mul(number_type.stored_len());
            let bytes = reader.take(len)?;
            budget.check(need, "its numbers in memory are")?;
            return Ok(number_type.decode(bytes));
        }
        // Compressed arrays have integers on the way, of up to 8 bytes in three steps
        let need = need.saturating_add((count as u64).saturating_mul(32));
        budget.check(need, "its numbers in memory are")?;
        let at = reader.at();
        if number_type.components != 1 {
            let what = "a compressed array of vectors, which no version has: the file is damaged";
            return Err(ParseError::malformed(at, what));
        }
        match number_type.scalar {
            Scalar::Plain(ScalarType::I32) => {
                let numbers =
                    Self::integers::<u32>(&mut reader, count)?.into_iter().map(u32::cast_signed);
                Ok(AttributeData::I32(numbers.collect()))
            }
            Scalar::Plain(ScalarType::U32) => {
                Ok(AttributeData::U32(Self::integers(&mut reader, count)?))
            }
            Scalar::Plain(ScalarType::I64) => {
                let numbers =
                    Self::integers::<u64>(&mut reader, count)?.into_iter().map(u64::cast_signed);
                Ok(AttributeData::I64(numbers.collect()))
            }
            Scalar::Plain(ScalarType::U64) => {
                Ok(AttributeData::U64(Self::integers(&mut reader, count)?))
            }
            scalar @ (Scalar::Half | Scalar::Plain(ScalarType::F32 | ScalarType::F64)) => {
                Self::compressed_floats(reader, scalar, count)
            }
            Scalar::Plain(_) => {
                let what = "a compressed array of bytes, which no version has: the file is damaged";
                Err(ParseError::malformed(at, what))
            }
        }
    }

    /// Floating-point numbers that are all integers, or have few different values.
    fn compressed_floats(
        mut reader: NumberReader<'a>,
        scalar: Scalar,
        count: usize,
    ) -> Result<AttributeData, ParseError> {
        let at = reader.at();
        match reader.take(1)? {
            b"i" => {
                let numbers =
                    Self::integers::<u32>(&mut reader, count)?.into_iter().map(u32::cast_signed);
                Ok(match scalar {
                    Scalar::Plain(ScalarType::F64) => {
                        AttributeData::F64(numbers.map(f64::from).collect())
                    }
                    #[expect(clippy::cast_precision_loss, reason = "written if it is exact")]
                    _ => AttributeData::F32(numbers.map(|n| n as f32).collect()),
                })
            }
            b"t" => {
                let len = reader.i32()?.cast_unsigned() as usize;
                let table = scalar.decode(reader.take(len.saturating_mul(scalar.stored_len()))?);
                let indices = Self::integers::<u32>(&mut reader, count)?;
                looked_up(&table, &indices).ok_or_else(|| {
                    let what =
                        format!("an index beyond a table of {len} numbers: the file is damaged");
                    ParseError::malformed(at, what)
                })
            }
            code => {
                let what =
                    format!("an array in the unknown encoding {:#x}: the file is damaged", code[0]);
                Err(ParseError::malformed(at, what))
            }
        }
    }

    /// See [`crate::read::usd::layer::Layer::tokens`].
    pub(in crate::read::usd) fn tokens(&self, rep: ValueRep) -> Result<Vec<&[u8]>, ParseError> {
        if rep.kind() == TOKEN
            && let Some(index) = rep.enumerator()
        {
            return Ok(vec![self.token(index)]);
        }
        let (count, mut reader) = match rep.kind() {
            TOKEN if rep.is_array() && rep.payload() != 0 => self.array_start(rep)?,
            TOKEN_VECTOR if !rep.is_inlined() => {
                let mut reader = self.reader_at(rep.payload(), 0)?;
                let count = usize::try_from(reader.u64()?).unwrap_or(usize::MAX);
                (count, reader)
            }
            _ => return Ok(Vec::new()),
        };
        let indices = reader.take(count.saturating_mul(4))?.as_chunks().0;
        Ok(indices.iter().map(|index| self.token(u32::from_le_bytes(*index))).collect())
    }

    /// Where the samples of an attribute are; `None` if `rep` is another value.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if they are not in the file.
    pub(super) fn samples(&self, rep: ValueRep) -> Result<Option<Samples>, ParseError> {
        if rep.kind() != TIME_SAMPLES || rep.is_inlined() {
            return Ok(None);
        }
        // Each list is behind values that its entries refer to: skip them
        let skip = |at: u64| -> Result<NumberReader<'a>, ParseError> {
            let mut reader = self.reader_at(at, 0)?;
            let place = reader.at();
            let distance = reader.i64()?;
            self.reader_at(at.saturating_add_signed(distance), place)
        };
        let mut reader = skip(rep.payload())?;
        let at = reader.at();
        let times = ValueRep(reader.u64()?);
        let mut list = match times.kind() {
            DOUBLE_VECTOR | DOUBLE if times.payload() == 0 => return Ok(None),
            DOUBLE_VECTOR if !times.is_inlined() => self.reader_at(times.payload(), at)?,
            DOUBLE if times.is_array() && !times.is_compressed() => {
                let (count, list) = self.array_start(times)?;
                return self.sample_ranges(count, list, skip(reader.at() as u64)?).map(Some);
            }
            _ => {
                let what = format!("a list of times that are not numbers: {CUT_OR_DAMAGED}");
                return Err(ParseError::malformed(at, what));
            }
        };
        let count = usize::try_from(list.u64()?).unwrap_or(usize::MAX);
        self.sample_ranges(count, list, skip(reader.at() as u64)?).map(Some)
    }

    /// The ranges of `count` times at `times` and of as many values, whose number is at `values`.
    fn sample_ranges(
        &self,
        count: usize,
        mut times: NumberReader<'a>,
        mut values: NumberReader<'a>,
    ) -> Result<Samples, ParseError> {
        let len = count.saturating_mul(8);
        let start = times.at();
        times.take(len)?;
        let at = values.at();
        let value_count = values.u64()?;
        if value_count != count as u64 {
            let what = format!("{value_count} values at {count} times: the file is damaged");
            return Err(ParseError::malformed(at, what));
        }
        let values_start = values.at();
        values.take(len)?;
        Ok(Samples::Binary { times: start..start + len, values: values_start..values_start + len })
    }

    /// A number of the metadata.
    pub(super) fn number(&self, rep: ValueRep) -> Option<f64> {
        // A packed array may be many times as long as the file
        if rep.is_array() {
            return None;
        }
        let numbers = self.numbers(rep, MemoryBudget::UNLIMITED).ok()??;
        numbers.single::<1>().map(|[number]| number)
    }
}

/// Numbers that are in the word of their value.
fn inlined_numbers(number_type: NumberType, bytes: [u8; 4]) -> Option<AttributeData> {
    let components = number_type.components;
    let small = || bytes.iter().take(components).map(|byte| byte.cast_signed());
    let single = u32::from_le_bytes(bytes);
    Some(match (number_type.scalar, components) {
        (Scalar::Half, 1 | 2) => number_type.decode(bytes.get(..2 * components)?),
        (Scalar::Plain(scalar), 1) => match scalar {
            // Stored as the next smaller type
            ScalarType::F64 => AttributeData::F64(vec![f32::from_bits(single).into()]),
            ScalarType::I64 => AttributeData::I64(vec![single.cast_signed().into()]),
            ScalarType::U64 => AttributeData::U64(vec![single.into()]),
            _ => number_type.decode(bytes.get(..scalar.size())?),
        },
        // Quaternions are never inlined
        _ if number_type.is_quaternion => return None,
        // The diagonals of matrices, and vectors, with components of eight bits
        (Scalar::Plain(ScalarType::F64), 9 | 16) => diagonal(&bytes, components),
        (Scalar::Plain(ScalarType::F64), 2..=4) => {
            AttributeData::F64(small().map(f64::from).collect())
        }
        (Scalar::Plain(ScalarType::F32) | Scalar::Half, 2..=4) => {
            AttributeData::F32(small().map(f32::from).collect())
        }
        (Scalar::Plain(ScalarType::I32), 2..=4) => {
            AttributeData::I32(small().map(i32::from).collect())
        }
        _ => return None,
    })
}

/// A matrix of `len` numbers whose diagonal is `bytes`.
fn diagonal(bytes: &[u8; 4], len: usize) -> AttributeData {
    let rows = if len == 16 { 4 } else { 3 };
    let mut numbers = vec![0.0; len];
    for (to, byte) in numbers.iter_mut().step_by(rows + 1).zip(bytes) {
        *to = byte.cast_signed().into();
    }
    AttributeData::F64(numbers)
}

/// The numbers of `table` at `indices`; `None` if one is beyond it.
fn looked_up(table: &AttributeData, indices: &[u32]) -> Option<AttributeData> {
    fn values<T: Copy>(table: &[T], indices: &[u32]) -> Option<Vec<T>> {
        let values = indices.iter().map(|index| table.get(*index as usize).copied());
        values.collect()
    }
    match table {
        AttributeData::F32(table) => values(table, indices).map(AttributeData::F32),
        AttributeData::F64(table) => values(table, indices).map(AttributeData::F64),
        _ => None,
    }
}
