//! The header of NetCDF classic files, versions 1, 2 and 5 (CDF-1, CDF-2, CDF-5).
//!
//! Lists of dimensions, attributes and variables follow the magic number and the number of records. Variables whose
//! first dimension is the unlimited one are stored by record: a slice of each of them, again and again. After the
//! specification in the NetCDF User's Guide. All numbers are big-endian.

use crate::read::numbers::NumberReader;
use spherule_frame::{Endian, ParseError, ScalarType};

/// Tags of lists.
const DIMENSIONS: i32 = 10;
const VARIABLES: i32 = 11;
const ATTRIBUTES: i32 = 12;
/// Most entries of a list: more than the library allows in its default build.
const MAX_ENTRIES: usize = 8192;
/// Most dimensions of a variable.
const MAX_AXES: usize = 1024;

/// A variable.
#[derive(Debug, Clone)]
pub(super) struct Variable {
    name: Vec<u8>,
    /// Lengths of its dimensions; that of records is 0.
    pub(super) shape: Vec<usize>,
    /// `None` for text.
    pub(super) scalar: Option<ScalarType>,
    is_record: bool,
    /// Offset of the first number.
    pub(super) begin: usize,
    /// Attribute `scale_factor`.
    pub(super) scale_factor: Option<f64>,
    /// Attribute `units`; empty if there is none.
    pub(super) units: Vec<u8>,
    /// Offset of the entry in the header.
    pub(super) at: usize,
}

impl Variable {
    /// Bytes of all numbers, or of those of a record.
    fn slice_len(&self) -> usize {
        let axes = self.shape.iter().skip(usize::from(self.is_record));
        let size = self.scalar.map_or(1, ScalarType::size);
        axes.fold(size, |len, axis| len.saturating_mul(*axis))
    }

    /// Checks that the numbers are real.
    ///
    /// # Errors
    /// [`ParseError::Malformed`].
    pub(super) fn check_real(&self, name: &str) -> Result<(), ParseError> {
        if matches!(self.scalar, Some(ScalarType::F32 | ScalarType::F64)) {
            return Ok(());
        }
        let kind = self.scalar.map_or("text", ScalarType::name);
        let what = format!("{name} have the type {kind}, not f32 or f64");
        Err(ParseError::malformed(self.at, what))
    }
}

/// What the header says.
#[derive(Debug)]
pub(super) struct NetCdf<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) version: u8,
    /// `None` while the file is being written as a stream.
    records: Option<usize>,
    texts: Vec<(&'a [u8], &'a [u8])>,
    variables: Vec<Variable>,
    /// Bytes of a record of all variables.
    record_len: usize,
}

impl<'a> NetCdf<'a> {
    /// Reads the header of `bytes`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if it is damaged.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let [b'C', b'D', b'F', version @ (1 | 2 | 5), ..] = *bytes else {
            let what = "a NetCDF classic file begins with CDF and its version: 1, 2 or 5";
            return Err(ParseError::malformed(0, what));
        };
        let mut header =
            HeaderReader { numbers: NumberReader::new(bytes, 4, Endian::Big), version };
        let records = header.record_count()?;
        let lengths = header.dimensions()?;
        let (texts, _) = header.attributes()?;
        let variables = header.variables(&lengths)?;
        let mut record_variables = variables.iter().filter(|variable| variable.is_record);
        let padded = |variable: &Variable| variable.slice_len().saturating_add(3) / 4 * 4;
        let record_len = match (record_variables.next(), record_variables.next()) {
            // The records of a single variable are not padded.
            (Some(only), None) => only.slice_len(),
            _ => variables
                .iter()
                .filter(|variable| variable.is_record)
                .fold(0_usize, |len, variable| len.saturating_add(padded(variable))),
        };
        Ok(Self { bytes, version, records, texts, variables, record_len })
    }

    /// The text of an attribute of the file; empty if there is none.
    pub(super) fn text(&self, name: &str) -> &'a [u8] {
        let found = self.texts.iter().find(|(known, _)| *known == name.as_bytes());
        found.map_or(b"", |(_, text)| *text)
    }

    /// The variable called `name`.
    pub(super) fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name.as_bytes())
    }

    /// The length of the first dimension of `variable`. One more is counted than the file has room for, so that reading
    /// it gives the error.
    pub(super) fn outer_len(&self, variable: &Variable) -> usize {
        let left = self.bytes.len().saturating_sub(variable.begin);
        let stride = self.outer_stride(variable).max(1);
        let most = left.div_ceil(stride);
        match (variable.is_record, self.records) {
            (true, None) => most,
            (true, Some(records)) => records.min(left / stride + 1),
            (false, _) => variable.shape.first().map_or(1, |len| (*len).min(left / stride + 1)),
        }
    }

    /// Where the slice of `variable` at `index` of its first dimension begins.
    pub(super) fn outer_start(&self, variable: &Variable, index: usize) -> usize {
        let offset = self.outer_stride(variable).saturating_mul(index);
        variable.begin.saturating_add(offset)
    }

    /// Bytes from one slice to the next.
    fn outer_stride(&self, variable: &Variable) -> usize {
        if variable.is_record {
            return self.record_len;
        }
        let size = variable.scalar.map_or(1, ScalarType::size);
        variable.shape.iter().skip(1).fold(size, |len, axis| len.saturating_mul(*axis))
    }

    /// The number of `variable` at byte `at`.
    pub(super) fn real(&self, variable: &Variable, at: usize) -> Option<f64> {
        let mut numbers = NumberReader::new(self.bytes, at, Endian::Big);
        match variable.scalar? {
            ScalarType::F32 => numbers.f32().ok().map(f64::from),
            ScalarType::F64 => numbers.f64().ok(),
            _ => None,
        }
    }
}

/// Reads the lists of a header from front to back.
struct HeaderReader<'a> {
    numbers: NumberReader<'a>,
    version: u8,
}

/// Texts of the attributes of a file or a variable, and the factor of the latter.
type Attributes<'a> = (Vec<(&'a [u8], &'a [u8])>, Option<f64>);

impl<'a> HeaderReader<'a> {
    /// A length or count: 32 bits, or 64 in version 5.
    fn count(&mut self, name: &str) -> Result<usize, ParseError> {
        if self.version < 5 {
            return self.numbers.count(name);
        }
        let at = self.numbers.at();
        let count = self.numbers.u64()?;
        usize::try_from(count)
            .ok()
            .filter(|count| *count <= usize::MAX / 2)
            .ok_or_else(|| ParseError::malformed(at, format!("the {name} is {count}")))
    }

    fn record_count(&mut self) -> Result<Option<usize>, ParseError> {
        let mut ahead = self.numbers;
        let is_stream = match self.version {
            5 => ahead.u64()? == u64::MAX,
            _ => ahead.i32()? == -1,
        };
        if is_stream {
            self.numbers = ahead;
            return Ok(None);
        }
        self.count("number of records").map(Some)
    }

    /// The number of entries of a list.
    fn list(&mut self, tag: i32, name: &str) -> Result<usize, ParseError> {
        let at = self.numbers.at();
        let found = self.numbers.i32()?;
        let count = self.count(&format!("number of {name}"))?;
        match (found, count) {
            (0, 0) => Ok(0),
            (found, count) if found == tag && count <= MAX_ENTRIES => Ok(count),
            (found, count) => {
                let what = format!(
                    "the list of {name} has the tag {found} and {count} entries, {tag} and up to {MAX_ENTRIES} expected"
                );
                Err(ParseError::malformed(at, what))
            }
        }
    }

    /// Bytes that are filled up to a multiple of four.
    fn padded(&mut self, len: usize) -> Result<&'a [u8], ParseError> {
        let bytes = self.numbers.take(len)?;
        self.numbers.take(len.wrapping_neg() % 4)?;
        Ok(bytes)
    }

    fn name(&mut self) -> Result<&'a [u8], ParseError> {
        let len = self.count("length of a name")?;
        self.padded(len)
    }

    /// Lengths of the dimensions; 0 is that of records.
    fn dimensions(&mut self) -> Result<Vec<usize>, ParseError> {
        let count = self.list(DIMENSIONS, "dimensions")?;
        let mut lengths = Vec::new();
        for _ in 0..count {
            self.name()?;
            lengths.push(self.count("length of a dimension")?);
        }
        Ok(lengths)
    }

    fn attributes(&mut self) -> Result<Attributes<'a>, ParseError> {
        let count = self.list(ATTRIBUTES, "attributes")?;
        let mut texts = Vec::new();
        let mut scale_factor = None;
        for _ in 0..count {
            let name = self.name()?;
            let kind = self.kind()?;
            let count = self.count("length of an attribute")?;
            let mut numbers = self.numbers;
            let size = kind.map_or(1, ScalarType::size);
            let value = self.padded(size.saturating_mul(count))?;
            match kind {
                None => texts.push((name, value)),
                Some(ScalarType::F32) if name == b"scale_factor" => {
                    scale_factor = numbers.f32().ok().map(f64::from);
                }
                Some(ScalarType::F64) if name == b"scale_factor" => {
                    scale_factor = numbers.f64().ok();
                }
                Some(_) => {}
            }
        }
        Ok((texts, scale_factor))
    }

    /// A type; `None` is text.
    fn kind(&mut self) -> Result<Option<ScalarType>, ParseError> {
        let at = self.numbers.at();
        Ok(Some(match self.numbers.i32()? {
            1 => ScalarType::I8,
            2 => return Ok(None),
            3 => ScalarType::I16,
            4 => ScalarType::I32,
            5 => ScalarType::F32,
            6 => ScalarType::F64,
            7 => ScalarType::U8,
            8 => ScalarType::U16,
            9 => ScalarType::U32,
            10 => ScalarType::I64,
            11 => ScalarType::U64,
            kind => {
                return Err(ParseError::malformed(at, format!("the type {kind} is unknown")));
            }
        }))
    }

    fn variables(&mut self, lengths: &[usize]) -> Result<Vec<Variable>, ParseError> {
        let count = self.list(VARIABLES, "variables")?;
        let mut variables = Vec::new();
        for _ in 0..count {
            let at = self.numbers.at();
            let name = self.name()?.to_vec();
            let axes = self.count("number of dimensions of a variable")?;
            if axes > MAX_AXES {
                let what = format!("a variable has {axes} dimensions");
                return Err(ParseError::malformed(at, what));
            }
            let mut shape = Vec::new();
            for _ in 0..axes {
                let index = self.count("number of a dimension")?;
                let length = lengths.get(index).copied().ok_or_else(|| {
                    let what =
                        format!("dimension {index} does not exist, there are {}", lengths.len());
                    ParseError::malformed(at, what)
                })?;
                shape.push(length);
            }
            let (texts, scale_factor) = self.attributes()?;
            let units = texts.iter().find(|(name, _)| *name == b"units");
            let units = units.map_or(b"".as_slice(), |(_, units)| *units);
            let scalar = self.kind()?;
            // Too short for large variables, and known from the shape.
            self.numbers.take(if self.version == 5 { 8 } else { 4 })?;
            let begin = match self.version {
                1 => self.numbers.count("offset of a variable")?,
                _ => usize::try_from(self.numbers.u64()?).unwrap_or(usize::MAX),
            };
            variables.push(Variable {
                name,
                is_record: shape.first() == Some(&0),
                shape,
                scalar,
                begin,
                scale_factor,
                units: units.trim_ascii_end().to_vec(),
                at,
            });
        }
        Ok(variables)
    }
}
