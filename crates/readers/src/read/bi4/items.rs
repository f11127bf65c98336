//! The container of DualSPHysics files: items with values, arrays and items of their own.
//!
//! A header of 64 bytes, then the root item. After `JBinaryData` of DualSPHysics 5.4; lengths of arrays have 64 bits if
//! the header says so, and 32 before that version.

use std::ops::Range;

use super::super::numbers::NumberReader;
use spherule_frame::{Endian, MemoryBudget, ParseError, ScalarType};

/// How the title in the header begins. The name of the content follows.
pub(super) const MAGIC: &[u8] = b"#FileJBD ";
const TITLE: usize = 60;
const HEADER: usize = 64;
/// Added to the byte order if lengths of arrays have 64 bits.
const IS_LONG: u8 = 10;

/// The name of the content of a file that begins with `head`; `None` for other files.
pub(super) fn content_name(head: &[u8]) -> Option<&str> {
    let title = head.get(..TITLE.min(head.len()))?.strip_prefix(MAGIC)?;
    let end = title.iter().position(|b| *b == b' ' || *b == 0);
    str::from_utf8(title.get(..end.unwrap_or(title.len()))?).ok()
}

/// A value of an item.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ItemValue<'a> {
    Text(&'a [u8]),
    Integer(i64),
    Real(f64),
    /// A vector, or an integer beyond the range.
    Other,
}

/// An array of an item.
#[derive(Debug, Clone)]
pub(super) struct ItemArray<'a> {
    pub(super) name: &'a [u8],
    /// Type and components of an element; `None` for text and truth values.
    pub(super) element: Option<(ScalarType, usize)>,
    pub(super) count: usize,
    /// Where the elements are.
    pub(super) range: Range<usize>,
}

/// An item without the items inside.
#[derive(Debug, Default)]
pub(super) struct Item<'a> {
    /// Where it begins.
    pub(super) at: usize,
    pub(super) name: &'a [u8],
    pub(super) values: Vec<(&'a [u8], ItemValue<'a>)>,
    pub(super) arrays: Vec<ItemArray<'a>>,
    item_count: u32,
}

impl<'a> Item<'a> {
    /// The value called `name`.
    pub(super) fn value(&self, name: &str) -> Option<ItemValue<'a>> {
        let mut values = self.values.iter();
        let found = values.find(|(known, _)| *known == name.as_bytes());
        found.map(|(_, value)| *value)
    }

    /// The integer called `name`, if it is not negative.
    pub(super) fn count(&self, name: &str) -> Option<u64> {
        match self.value(name)? {
            ItemValue::Integer(count) => u64::try_from(count).ok(),
            _ => None,
        }
    }

    /// The real number called `name`.
    pub(super) fn real(&self, name: &str) -> Option<f64> {
        match self.value(name)? {
            ItemValue::Real(number) => Some(number),
            _ => None,
        }
    }
}

/// Reads item after item.
pub(super) struct ItemReader<'a> {
    reader: NumberReader<'a>,
    pub(super) endian: Endian,
    is_long: bool,
    budget: MemoryBudget,
}

impl<'a> ItemReader<'a> {
    /// Before the root item of `bytes`. Lists of values and arrays take no more than `budget`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] for a header that is not known.
    pub(super) fn new(bytes: &'a [u8], budget: MemoryBudget) -> Result<Self, ParseError> {
        let mut header = NumberReader::new(bytes, 0, Endian::Little);
        let title = header.take(TITLE)?;
        if !title.starts_with(MAGIC) {
            return Err(ParseError::malformed(
                0,
                "not a DualSPHysics file: it does not begin with #FileJBD",
            ));
        }
        let [order, is_long, _, _] = header.array()?;
        let endian = match order.checked_sub(if is_long == 0 { 0 } else { IS_LONG }) {
            Some(0) => Endian::Little,
            Some(1) => Endian::Big,
            _ => {
                let what = format!("the byte order {order} is not known: the file is damaged here");
                return Err(ParseError::malformed(TITLE, what));
            }
        };
        Ok(Self {
            reader: NumberReader::new(bytes, HEADER, endian),
            endian,
            is_long: is_long != 0,
            budget,
        })
    }

    /// Calls `each` with the root item and all items below it, from front to back, and their depths.
    ///
    /// # Errors
    /// [`ParseError`].
    pub(super) fn items(
        &mut self,
        mut each: impl FnMut(usize, Item<'a>),
    ) -> Result<(), ParseError> {
        // Items that are still to come, at each depth
        let mut left = vec![1_u32];
        while let Some(count) = left.last_mut() {
            if *count == 0 {
                left.pop();
                continue;
            }
            *count -= 1;
            let depth = left.len() - 1;
            let item = self.item()?;
            left.push(item.item_count);
            each(depth, item);
        }
        Ok(())
    }

    /// The next item, without those inside.
    fn item(&mut self) -> Result<Item<'a>, ParseError> {
        let at = self.reader.at();
        // The definition
        self.u32()?;
        self.mark(b"\nITEM\n")?;
        let name = self.text()?;
        self.take(8)?;
        self.text()?;
        self.text()?;
        let [array_count, item_count, values_len] = [self.u32()?, self.u32()?, self.u32()?];
        let mut item = Item { at, name, item_count, ..Item::default() };
        // Values
        if values_len > 0 {
            self.mark(b"\nVALUES")?;
            for _ in 0..self.u32()? {
                let value = (self.text()?, self.value()?);
                item.values.push(value);
                self.check_list(item.values.len(), size_of::<(&[u8], ItemValue<'_>)>())?;
            }
        }
        // Arrays
        for _ in 0..array_count {
            let array = self.array()?;
            item.arrays.push(array);
            self.check_list(item.arrays.len(), size_of::<ItemArray<'_>>())?;
        }
        Ok(item)
    }

    fn value(&mut self) -> Result<ItemValue<'a>, ParseError> {
        let at = self.reader.at();
        let kind = self.u32()?;
        Ok(match kind {
            1 => ItemValue::Text(self.text()?),
            3 => ItemValue::Integer(self.number(i8::from_le_bytes)?.into()),
            4 => ItemValue::Integer(self.number(u8::from_le_bytes)?.into()),
            5 => ItemValue::Integer(self.number(i16::from_le_bytes)?.into()),
            6 => ItemValue::Integer(self.number(u16::from_le_bytes)?.into()),
            2 | 7 => ItemValue::Integer(self.number(i32::from_le_bytes)?.into()),
            8 => ItemValue::Integer(self.u32()?.into()),
            9 => ItemValue::Integer(self.number(i64::from_le_bytes)?),
            10 => {
                let number = self.number(u64::from_le_bytes)?;
                i64::try_from(number).map_or(ItemValue::Other, ItemValue::Integer)
            }
            11 => ItemValue::Real(self.number(f32::from_le_bytes)?.into()),
            12 => ItemValue::Real(self.number(f64::from_le_bytes)?),
            20..=22 => {
                self.take(12)?;
                ItemValue::Other
            }
            23 => {
                self.take(24)?;
                ItemValue::Other
            }
            _ => return Err(unknown_type(at, kind)),
        })
    }

    fn array(&mut self) -> Result<ItemArray<'a>, ParseError> {
        self.u32()?;
        self.mark(b"\nARRAY")?;
        let name = self.text()?;
        self.take(4)?;
        let at = self.reader.at();
        let kind = self.u32()?;
        let (count, len) = (self.length()?, self.length()?);
        let element = match kind {
            1 | 2 => None,
            3 => Some((ScalarType::I8, 1)),
            4 => Some((ScalarType::U8, 1)),
            5 => Some((ScalarType::I16, 1)),
            6 => Some((ScalarType::U16, 1)),
            7 => Some((ScalarType::I32, 1)),
            8 => Some((ScalarType::U32, 1)),
            9 => Some((ScalarType::I64, 1)),
            10 => Some((ScalarType::U64, 1)),
            11 => Some((ScalarType::F32, 1)),
            12 => Some((ScalarType::F64, 1)),
            20 => Some((ScalarType::I32, 3)),
            21 => Some((ScalarType::U32, 3)),
            22 => Some((ScalarType::F32, 3)),
            23 => Some((ScalarType::F64, 3)),
            _ => return Err(unknown_type(at, kind)),
        };
        let expected = element.and_then(|(scalar, n)| count.checked_mul(scalar.size() * n));
        if element.is_some() && expected != Some(len) {
            let name = String::from_utf8_lossy(name);
            let what = format!(
                "the array `{name}` of {count} elements has {len} bytes: the file is damaged here"
            );
            return Err(ParseError::malformed(at, what));
        }
        let start = self.reader.at();
        self.take(len)?;
        Ok(ItemArray { name, element, count, range: start..self.reader.at() })
    }

    fn take(&mut self, len: usize) -> Result<&'a [u8], ParseError> {
        self.reader.take(len)
    }

    fn number<T, const N: usize>(&mut self, decode: fn([u8; N]) -> T) -> Result<T, ParseError> {
        self.reader.array().map(decode)
    }

    fn u32(&mut self) -> Result<u32, ParseError> {
        self.number(u32::from_le_bytes)
    }

    fn text(&mut self) -> Result<&'a [u8], ParseError> {
        let len = self.u32()? as usize;
        self.take(len)
    }

    /// The count or the length of an array.
    fn length(&mut self) -> Result<usize, ParseError> {
        let at = self.reader.at();
        let length = if self.is_long { self.reader.u64()? } else { self.u32()?.into() };
        usize::try_from(length)
            .map_err(|_| ParseError::malformed(at, format!("the length {length}")))
    }

    /// Reads the text that begins a part of an item.
    fn mark(&mut self, expected: &[u8]) -> Result<(), ParseError> {
        let at = self.reader.at();
        if self.text()? == expected {
            Ok(())
        } else {
            let expected = String::from_utf8_lossy(expected);
            let what = format!("{} expected here: the file is damaged here", expected.trim());
            Err(ParseError::malformed(at, what))
        }
    }

    fn check_list(&self, len: usize, each: usize) -> Result<(), ParseError> {
        let need = len as u64 * 2 * each as u64;
        self.budget.check(need, "the list of its values is")
    }
}

fn unknown_type(at: usize, kind: u32) -> ParseError {
    ParseError::malformed(at, format!("the type {kind} is not known: the file is damaged here"))
}
