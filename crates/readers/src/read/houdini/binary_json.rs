//! Houdini's binary JSON: tokens of one byte, each with its value.
//!
//! Arrays of numbers of one type are stored as such. Names that occur often are defined once and then referred to by
//! a number. After the comments of `UT_JSONDefines.h` of the Houdini Development Kit.

use std::collections::HashMap;

use super::super::numbers::NumberReader;
use super::tokens::{ElementType, Token, UniformArray, Value};
use spherule_frame::{Endian, MemoryBudget, ParseError, ScalarType};

/// The first bytes of a file of a little-endian machine, and of a big-endian one.
const MAGICS: [(&[u8], Endian); 2] = [(b"\x7fNSJb", Endian::Little), (b"\x7fbJSN", Endian::Big)];

/// Bytes of memory that the definition of a name takes.
const NAME_LEN: u64 = 64;

/// Byte order of the file that begins with `head`; `None` if that is no binary JSON.
pub(super) fn endian(head: &[u8]) -> Option<Endian> {
    let mut magics = MAGICS.iter();
    let found = magics.find(|(magic, _)| head.starts_with(magic));
    found.map(|(_, endian)| *endian)
}

/// Reads token after token.
pub(super) struct BinaryTokens<'a> {
    bytes: &'a [u8],
    reader: NumberReader<'a>,
    names: HashMap<u64, &'a [u8]>,
    budget: MemoryBudget,
}

impl<'a> BinaryTokens<'a> {
    /// Before the first token of `bytes`. Definitions of names take no more than `budget`.
    pub(super) fn new(bytes: &'a [u8], endian: Endian, budget: MemoryBudget) -> Self {
        let reader = NumberReader::new(bytes, MAGICS[0].0.len(), endian);
        Self { bytes, reader, names: HashMap::new(), budget }
    }

    /// The next token.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the file ends, or has no token here.
    pub(super) fn next(&mut self) -> Result<Token<'a>, ParseError> {
        loop {
            let at = self.reader.at();
            let value = match self.byte()? {
                0 => Value::Null,
                b'[' | b'{' => Value::Begin,
                b']' | b'}' => Value::End,
                0x10 => Value::Bool(self.byte()? != 0),
                0x11 => Value::Integer(self.number(i8::from_le_bytes)?.into()),
                0x12 => Value::Integer(self.number(i16::from_le_bytes)?.into()),
                0x13 => Value::Integer(self.number(i32::from_le_bytes)?.into()),
                0x14 => Value::Integer(self.number(i64::from_le_bytes)?),
                0x18 => Value::Real(half::f16::from_bits(self.number(u16::from_le_bytes)?).into()),
                0x19 => Value::Real(self.number(f32::from_le_bytes)?.into()),
                0x1a => Value::Real(self.number(f64::from_le_bytes)?),
                0x21 => Value::Integer(self.byte()?.into()),
                0x22 => Value::Integer(self.number(u16::from_le_bytes)?.into()),
                0x27 => Value::Text(self.text()?),
                0x26 => Value::Text(self.name()?),
                0x30 => Value::Bool(false),
                0x31 => Value::Bool(true),
                0x40 => Value::Uniform(self.uniform_array()?),
                0x2b => {
                    self.define_name()?;
                    continue;
                }
                0x2d => {
                    let id = self.length()?;
                    self.names.remove(&id);
                    continue;
                }
                other => {
                    let what = format!(
                        "0x{other:02x} is not a token of binary JSON: the file is damaged here"
                    );
                    return Err(ParseError::malformed(at, what));
                }
            };
            return Ok(Token { at, value });
        }
    }

    fn take(&mut self, len: usize) -> Result<&'a [u8], ParseError> {
        self.reader.take(len)
    }

    fn byte(&mut self) -> Result<u8, ParseError> {
        self.number(u8::from_le_bytes)
    }

    /// A number in the byte order of the file; `decode` reads little-endian ones.
    fn number<T, const N: usize>(&mut self, decode: fn([u8; N]) -> T) -> Result<T, ParseError> {
        self.reader.array().map(decode)
    }

    /// A length or the number of a name, in one to nine bytes.
    fn length(&mut self) -> Result<u64, ParseError> {
        let at = self.reader.at();
        match self.byte()? {
            short @ 0..=0xf0 => Ok(short.into()),
            0xf2 => self.number(u16::from_le_bytes).map(u64::from),
            0xf4 => self.number(u32::from_le_bytes).map(u64::from),
            0xf8 => self.number(u64::from_le_bytes),
            other => {
                let what =
                    format!("0x{other:02x} does not begin a length: the file is damaged here");
                Err(ParseError::malformed(at, what))
            }
        }
    }

    fn count(&mut self) -> Result<usize, ParseError> {
        let at = self.reader.at();
        let count = usize::try_from(self.length()?);
        count.map_err(|_| {
            ParseError::malformed(at, "a length beyond the memory: the file is damaged here")
        })
    }

    fn text(&mut self) -> Result<&'a [u8], ParseError> {
        let len = self.count()?;
        self.take(len)
    }

    fn define_name(&mut self) -> Result<(), ParseError> {
        let id = self.length()?;
        let name = self.text()?;
        self.names.insert(id, name);
        let need = NAME_LEN * self.names.len() as u64;
        self.budget.check(need, "the list of its names is")
    }

    /// The name with the number that comes next.
    fn name(&mut self) -> Result<&'a [u8], ParseError> {
        let at = self.reader.at();
        let id = self.length()?;
        let name = self.names.get(&id).copied();
        name.ok_or_else(|| {
            ParseError::malformed(
                at,
                format!("the name {id} is not defined: the file is damaged here"),
            )
        })
    }

    fn uniform_array(&mut self) -> Result<UniformArray<'a>, ParseError> {
        let at = self.reader.at();
        let code = self.byte()?;
        let count = self.count()?;
        let element = match code {
            0x10 => ElementType::Bits,
            0x11 => ElementType::Number(ScalarType::I8),
            0x12 => ElementType::Number(ScalarType::I16),
            0x13 => ElementType::Number(ScalarType::I32),
            0x14 => ElementType::Number(ScalarType::I64),
            0x18 => ElementType::Half,
            0x19 => ElementType::Number(ScalarType::F32),
            0x1a => ElementType::Number(ScalarType::F64),
            0x21 => ElementType::Number(ScalarType::U8),
            0x22 => ElementType::Number(ScalarType::U16),
            0x26 | 0x27 => ElementType::Text,
            other => {
                let what = format!("an array of elements of the unknown type 0x{other:02x}");
                return Err(ParseError::malformed(at, what));
            }
        };
        let start = self.reader.at();
        match (element, code) {
            (ElementType::Text, 0x26) => (0..count).try_for_each(|_| self.name().map(|_| ()))?,
            (ElementType::Text, _) => (0..count).try_for_each(|_| self.text().map(|_| ()))?,
            (ElementType::Bits, _) => self.skip_numbers(count.div_ceil(32), 4)?,
            (ElementType::Half, _) => self.skip_numbers(count, 2)?,
            (ElementType::Number(scalar), _) => self.skip_numbers(count, scalar.size())?,
        }
        let bytes = self.bytes.get(start..self.reader.at()).unwrap_or_default();
        Ok(UniformArray { element, count, bytes })
    }

    fn skip_numbers(&mut self, count: usize, size: usize) -> Result<(), ParseError> {
        let len = count.saturating_mul(size);
        self.take(len).map(|_| ())
    }
}
