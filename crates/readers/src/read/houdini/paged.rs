//! Values of an attribute: pages of elements, each with a part for each packed vector.
//!
//! The components of a value are divided among packed vectors: 4 may be 3 and 1. A page has the first vectors of its
//! elements, then the second ones. A flag for each page and packed vector says that all elements of the page share one
//! vector, which is stored once. Text files have tuples, or one array for each component, instead.

use super::cursor::JsonCursor;
use super::numbers::{Numbers, flags};
use super::tokens::{Token, Value, unexpected};
use spherule_frame::{AttributeData, Endian, MemoryBudget, ParseError, ScalarType};

/// Most elements of a page; Houdini writes 1024. The limit keeps a few constant pages from standing for any number of
/// elements.
const MAX_PAGE: usize = 1 << 16;

/// How the numbers are arranged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Arrangement {
    Pages,
    /// Element by element.
    Tuples,
    /// Component by component.
    Arrays,
}

/// The values of one attribute as the file has them.
#[derive(Debug)]
pub(super) struct StoredValues<'a> {
    /// Where they are in the file.
    at: usize,
    /// Components of a value.
    pub(super) size: usize,
    storage: &'a [u8],
    /// Components of each packed vector; none for one vector of all components.
    packing: Vec<usize>,
    /// Elements of a page.
    page_len: usize,
    /// A flag for each page, for each packed vector; none if no page is constant.
    constant_pages: Vec<Vec<bool>>,
    numbers: Option<(Arrangement, Numbers<'a>)>,
}

impl<'a> StoredValues<'a> {
    /// Reads the value that `token` begins.
    ///
    /// # Errors
    /// [`ParseError`].
    pub(super) fn read(
        cursor: &mut JsonCursor<'a>,
        token: Token<'a>,
        budget: MemoryBudget,
    ) -> Result<Self, ParseError> {
        let mut this = Self {
            at: token.at,
            size: 1,
            storage: b"fpreal32",
            packing: Vec::new(),
            page_len: 0,
            constant_pages: Vec::new(),
            numbers: None,
        };
        cursor.pairs(token, |cursor, name, value| {
            match name {
                b"size" => this.size = count(value)?,
                b"pagesize" => this.page_len = count(value)?,
                b"storage" => {
                    let Value::Text(storage) = value.value else {
                        return Err(unexpected(value.at, "a type of numbers"));
                    };
                    this.storage = storage;
                }
                b"packing" => {
                    let packing = Numbers::read(cursor, value, budget)?;
                    this.packing = packing.counts(cursor.endian, value.at)?;
                }
                b"constantpageflags" => cursor.elements(value, |cursor, _, vector| {
                    this.constant_pages.push(flags(cursor, vector, budget)?);
                    Ok(())
                })?,
                b"rawpagedata" => this.read_numbers(cursor, Arrangement::Pages, value, budget)?,
                b"tuples" => this.read_numbers(cursor, Arrangement::Tuples, value, budget)?,
                b"arrays" => this.read_numbers(cursor, Arrangement::Arrays, value, budget)?,
                _ => cursor.skip(value)?,
            }
            Ok(())
        })?;
        Ok(this)
    }

    /// Bytes that the numbers take beside the file.
    pub(super) fn numbers_len(&self) -> u64 {
        self.numbers.as_ref().map_or(0, |(_, numbers)| numbers.byte_len())
    }

    fn read_numbers(
        &mut self,
        cursor: &mut JsonCursor<'a>,
        arrangement: Arrangement,
        value: Token<'a>,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        self.at = value.at;
        let numbers = Numbers::read(cursor, value, budget)?;
        self.numbers = Some((arrangement, numbers));
        Ok(())
    }

    /// The type of the decoded numbers.
    fn scalar(&self) -> Result<ScalarType, ParseError> {
        Ok(match self.storage {
            b"fpreal16" | b"fpreal32" => ScalarType::F32,
            b"fpreal64" => ScalarType::F64,
            b"int8" => ScalarType::I8,
            b"uint8" => ScalarType::U8,
            b"int16" => ScalarType::I16,
            b"int32" => ScalarType::I32,
            b"int64" => ScalarType::I64,
            b"bool" => ScalarType::U8,
            other => {
                let what =
                    format!("numbers of the unknown type `{}`", String::from_utf8_lossy(other));
                return Err(ParseError::malformed(self.at, what));
            }
        })
    }

    /// The values of `count` elements in their order, one component after another. `name` is that of the attribute.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if there are more or fewer numbers, [`ParseError::TooLarge`].
    pub(super) fn decode(
        &self,
        name: &str,
        count: usize,
        endian: Endian,
        budget: MemoryBudget,
    ) -> Result<AttributeData, ParseError> {
        let scalar = self.scalar()?;
        let Some((arrangement, numbers)) = &self.numbers else {
            let what = format!("attribute `{name}` has no values");
            return Err(ParseError::malformed(self.at, what));
        };
        // Check the number of numbers before memory is taken for them
        let is_paged = *arrangement == Arrangement::Pages;
        let vectors = if is_paged { self.vectors(name, count)? } else { Vec::new() };
        let total = count.checked_mul(self.size);
        let expected = if is_paged { self.stored_count(&vectors, count) } else { total };
        if expected != Some(numbers.len()) {
            let what = format!(
                "attribute `{name}` has {} numbers, which do not fit {count} points of {} components",
                numbers.len(),
                self.size
            );
            return Err(ParseError::malformed(self.at, what));
        }
        let total = total.unwrap_or(usize::MAX);
        let need = (total as u64).saturating_add(numbers.len() as u64);
        budget.check(need.saturating_mul(scalar.size() as u64), "its numbers in memory are")?;
        // Decode, and put the numbers in order
        let stored = numbers.decode(endian, scalar, self.at)?;
        let is_in_order = match arrangement {
            Arrangement::Pages => vectors.len() == 1 && vectors.iter().all(|v| !v.is_constant()),
            Arrangement::Tuples => true,
            Arrangement::Arrays => self.size == 1,
        };
        if is_in_order {
            return Ok(stored);
        }
        macro_rules! ordered {
            ($($variant:ident),*) => {
                match stored {
                    $(AttributeData::$variant(stored) => {
                        AttributeData::$variant(self.ordered(&stored, &vectors, total))
                    })*
                }
            };
        }
        Ok(ordered!(I8, U8, I16, U16, I32, U32, I64, U64, F32, F64))
    }

    /// The packed vectors with their flags.
    fn vectors(&self, name: &str, count: usize) -> Result<Vec<PackedVector<'_>>, ParseError> {
        let widths = match self.packing.as_slice() {
            [] => &[self.size][..],
            packing => packing,
        };
        let sum = widths.iter().try_fold(0_usize, |sum, width| sum.checked_add(*width));
        if sum != Some(self.size) || widths.contains(&0) {
            let what = format!(
                "the packing of attribute `{name}` is not that of {} components",
                self.size
            );
            return Err(ParseError::malformed(self.at, what));
        }
        if count > 0 && !(1..=MAX_PAGE).contains(&self.page_len) {
            let what = format!("attribute `{name}` has pages of {} points", self.page_len);
            return Err(ParseError::malformed(self.at, what));
        }
        let page_count = count.div_ceil(self.page_len.max(1));
        let flags = self.constant_pages.iter().map(Vec::as_slice);
        let flags: Vec<&[bool]> =
            flags.chain(std::iter::repeat(&[][..])).take(widths.len()).collect();
        let is_fit = |flags: &&[bool]| flags.is_empty() || flags.len() == page_count;
        if self.constant_pages.len() > widths.len() || !flags.iter().all(is_fit) {
            let what = format!(
                "attribute `{name}` does not have a flag for each of its {page_count} pages"
            );
            return Err(ParseError::malformed(self.at, what));
        }
        let vectors = widths.iter().zip(flags);
        Ok(vectors
            .map(|(width, constant_pages)| PackedVector { width: *width, constant_pages })
            .collect())
    }

    /// Number of numbers that `vectors` of `count` elements have in the file; `None` if that is beyond memory.
    fn stored_count(&self, vectors: &[PackedVector<'_>], count: usize) -> Option<usize> {
        let last_len = match count % self.page_len.max(1) {
            0 => self.page_len,
            rest => rest,
        };
        vectors.iter().try_fold(0_usize, |sum, vector| {
            let constant = vector.constant_pages.iter().filter(|is| **is).count();
            let mut missing =
                constant.checked_mul(self.page_len - usize::from(self.page_len > 0))?;
            if vector.constant_pages.last() == Some(&true) {
                missing = missing.checked_sub(self.page_len - last_len)?;
            }
            let rows = count.checked_sub(missing)?;
            sum.checked_add(rows.checked_mul(vector.width)?)
        })
    }

    /// The numbers `stored` element by element, `total` in all.
    fn ordered<T: Copy + Default>(
        &self,
        stored: &[T],
        vectors: &[PackedVector<'_>],
        total: usize,
    ) -> Vec<T> {
        let mut all = vec![T::default(); total];
        if vectors.is_empty() {
            // One array for each component
            let count = total / self.size.max(1);
            for (component, numbers) in stored.chunks_exact(count.max(1)).enumerate() {
                let places = all.iter_mut().skip(component).step_by(self.size.max(1));
                places.zip(numbers).for_each(|(place, number)| *place = *number);
            }
            return all;
        }
        let mut rest = stored;
        let page_len = self.page_len.saturating_mul(self.size).max(1);
        for (page, elements) in all.chunks_mut(page_len).enumerate() {
            let mut first = 0;
            for vector in vectors {
                let is_constant = vector.constant_pages.get(page) == Some(&true);
                let step = if is_constant { 0 } else { vector.width };
                let mut at = 0;
                for element in elements.chunks_exact_mut(self.size) {
                    let to = element.get_mut(first..first + vector.width);
                    let from = rest.get(at..at + vector.width);
                    if let (Some(to), Some(from)) = (to, from) {
                        to.copy_from_slice(from);
                    }
                    at += step;
                }
                let taken = if is_constant { vector.width } else { at };
                rest = rest.get(taken..).unwrap_or_default();
                first += vector.width;
            }
        }
        all
    }
}

/// A packed vector of an attribute.
struct PackedVector<'v> {
    /// Components.
    width: usize,
    /// A flag for each page; none if no page is constant.
    constant_pages: &'v [bool],
}

impl PackedVector<'_> {
    fn is_constant(&self) -> bool {
        self.constant_pages.contains(&true)
    }
}

/// The number of elements that `token` is.
///
/// # Errors
/// [`ParseError::Malformed`] for anything else.
pub(super) fn count(token: Token<'_>) -> Result<usize, ParseError> {
    let Value::Integer(count) = token.value else {
        return Err(unexpected(token.at, "a count"));
    };
    usize::try_from(count)
        .map_err(|_| ParseError::malformed(token.at, format!("the count {count}")))
}
