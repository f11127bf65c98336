//! The file layer of GSD: a header, a list of names, and an index of chunks, which are matrices of numbers.

use std::ops::Range;

use crate::read::CUT_SHORT;
use spherule_frame::{ParseError, ScalarType};

/// `0x65DF65DF65DF65DF`, little-endian.
pub(super) const MAGIC: &[u8] = b"\xdf\x65\xdf\x65\xdf\x65\xdf\x65";

/// Bytes of the header.
const HEADER_LEN: usize = 256;
/// Bytes of an entry of the index.
const ENTRY_LEN: usize = 32;
/// Unit of the length of the list of names. In files of version 1 each name takes one unit.
const NAME_UNIT: usize = 64;
/// Most names of a file: an entry of the index has 16 bits for the number of its name.
const MAX_NAMES: usize = 1 << 16;

/// A version: major in the upper half, minor in the lower.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Version(u32);

impl Version {
    pub(super) const fn major(self) -> u32 {
        self.0 >> 16
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.major(), self.0 & 0xffff)
    }
}

/// The first bytes of a file.
#[derive(Debug, Clone, Copy)]
pub(super) struct GsdHeader<'a> {
    pub(super) version: Version,
    pub(super) schema_version: Version,
    /// Program that wrote the file.
    pub(super) application: &'a [u8],
    index_at: u64,
    index_entries: u64,
    names_at: u64,
    name_units: u64,
}

impl<'a> GsdHeader<'a> {
    /// Reads the header and checks that this version and schema are read.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] for other versions and schemas, [`ParseError::Malformed`] for other files.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, ParseError> {
        if !bytes.starts_with(MAGIC) {
            let what = "not a GSD file: it does not begin with its magic number";
            return Err(ParseError::malformed(0, what));
        }
        if bytes.len() < HEADER_LEN {
            let what = format!("file ends within the GSD header: {CUT_SHORT}");
            return Err(ParseError::malformed(bytes.len(), what));
        }
        let [index_at, index_entries, names_at, name_units] =
            [8, 16, 24, 32].map(|at| u64_at(bytes, at));
        let [schema_version, version] = [40, 44].map(|at| Version(u32_at(bytes, at)));
        let [application, schema] = [48, 112].map(|at| {
            let text = bytes.get(at..at + NAME_UNIT);
            until_zero(text.unwrap_or_default())
        });
        // Version 0.3 is that of the last drafts, with the layout of 1.0.
        if !matches!(version.major(), 1 | 2) && version != Version(3) {
            let what = format!("GSD version {version}, versions 1 and 2 are read");
            return Err(ParseError::unsupported(what));
        }
        if schema != b"hoomd" {
            let schema = String::from_utf8_lossy(schema);
            let what = format!(
                "a GSD file with the schema `{schema}`, only `hoomd` is read; write positions and attributes to .npz \
                 with gsd and numpy"
            );
            return Err(ParseError::unsupported(what));
        }
        if !matches!(schema_version.major(), 1 | 2) {
            let what = format!(
                "version {schema_version} of the GSD schema hoomd, versions 1 and 2 are read"
            );
            return Err(ParseError::unsupported(what));
        }
        Ok(Self {
            version,
            schema_version,
            application,
            index_at,
            index_entries,
            names_at,
            name_units,
        })
    }
}

/// One chunk as the index has it: a matrix of `rows` times `columns` numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct IndexEntry {
    /// Byte of the file at which the entry itself is.
    pub(super) at: usize,
    /// Frame of the chunk.
    pub(super) frame: u64,
    pub(super) rows: u64,
    pub(super) columns: u32,
    /// Number of its name.
    pub(super) name: u16,
    /// Byte of the file at which its numbers begin.
    location: u64,
    kind: u8,
    flags: u8,
}

/// The code of text in UTF-8.
const TEXT_KIND: u8 = 11;

impl IndexEntry {
    fn decode(bytes: &[u8; ENTRY_LEN], at: usize) -> Self {
        Self {
            at,
            frame: u64_at(bytes, 0),
            rows: u64_at(bytes, 8),
            location: u64_at(bytes, 16),
            columns: u32_at(bytes, 24),
            name: u16::from_le_bytes([bytes[28], bytes[29]]),
            kind: bytes[30],
            flags: bytes[31],
        }
    }

    /// Type of its numbers; `None` for text.
    pub(super) const fn scalar(&self) -> Option<ScalarType> {
        match self.kind {
            1 => Some(ScalarType::U8),
            2 => Some(ScalarType::U16),
            3 => Some(ScalarType::U32),
            4 => Some(ScalarType::U64),
            5 => Some(ScalarType::I8),
            6 => Some(ScalarType::I16),
            7 => Some(ScalarType::I32),
            8 => Some(ScalarType::I64),
            9 => Some(ScalarType::F32),
            10 => Some(ScalarType::F64),
            _ => None,
        }
    }

    /// Bytes of its numbers; `None` if no file can have as many.
    pub(super) fn byte_len(&self) -> Option<usize> {
        let size = self.scalar().map_or(1, ScalarType::size) as u64;
        let count = self.rows.checked_mul(u64::from(self.columns))?;
        usize::try_from(count.checked_mul(size)?).ok()
    }
}

/// A file whose header, names and index are inside it.
#[derive(Debug)]
pub(super) struct GsdFile<'a> {
    pub(super) bytes: &'a [u8],
    names: Vec<&'a [u8]>,
    entries: &'a [[u8; ENTRY_LEN]],
    entries_at: usize,
}

impl<'a> GsdFile<'a> {
    /// Finds names and index.
    ///
    /// # Errors
    /// As [`GsdHeader::parse`], and [`ParseError::Malformed`] if names or index are not inside the file.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let header = GsdHeader::parse(bytes)?;
        let names = Section {
            what: "the list of names",
            header_at: 24,
            at: header.names_at,
            count: header.name_units,
            each: NAME_UNIT,
        };
        let index = Section {
            what: "the index",
            header_at: 8,
            at: header.index_at,
            count: header.index_entries,
            each: ENTRY_LEN,
        };
        let (names, index) = (names.range(bytes.len())?, index.range(bytes.len())?);
        Ok(Self {
            bytes,
            names: names_in(bytes.get(names).unwrap_or_default(), header.version),
            entries: bytes.get(index.clone()).unwrap_or_default().as_chunks().0,
            entries_at: index.start,
        })
    }

    /// The names of chunks, by number.
    pub(super) fn names(&self) -> &[&'a [u8]] {
        &self.names
    }

    /// Number of the chunks called `name`.
    pub(super) fn name(&self, name: &str) -> Option<u16> {
        let index = self.names.iter().position(|n| *n == name.as_bytes())?;
        u16::try_from(index).ok()
    }

    /// Name of a chunk for messages.
    pub(super) fn name_of(&self, entry: &IndexEntry) -> String {
        let name = self.names.get(usize::from(entry.name));
        String::from_utf8_lossy(name.copied().unwrap_or_default()).into_owned()
    }

    /// Entry `index` of the index; `None` after the last. A location of 0 marks the end.
    pub(super) fn entry(&self, index: usize) -> Option<IndexEntry> {
        let bytes = self.entries.get(index)?;
        let entry = IndexEntry::decode(bytes, self.entries_at + index * ENTRY_LEN);
        (entry.location != 0).then_some(entry)
    }

    /// Checks everything about an entry but that its numbers are there, which only matters where they are read.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the entry.
    pub(super) fn check(&self, entry: &IndexEntry) -> Result<(), ParseError> {
        let what = match () {
            () if entry.scalar().is_none() && entry.kind != TEXT_KIND => {
                format!("a chunk of the unknown type {}", entry.kind)
            }
            () if usize::from(entry.name) >= self.names.len() => {
                format!("a chunk with name {}, the file has {} names", entry.name, self.names.len())
            }
            () if entry.frame >= self.entries.len() as u64 => format!(
                "a chunk of frame {}, the index has {} entries",
                entry.frame,
                self.entries.len()
            ),
            () if entry.flags != 0 => format!("a chunk with the unknown flags {:#x}", entry.flags),
            () => return Ok(()),
        };
        Err(ParseError::malformed(entry.at, format!("{what}: the index of the file is damaged")))
    }

    /// The bytes of the file that hold the numbers of `entry`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the entry if they are not all in the file.
    pub(super) fn range(&self, entry: &IndexEntry) -> Result<Range<usize>, ParseError> {
        let start = usize::try_from(entry.location).ok();
        let end = start.zip(entry.byte_len()).and_then(|(start, len)| start.checked_add(len));
        match start.zip(end) {
            Some((start, end)) if end <= self.bytes.len() => Ok(start..end),
            _ => {
                let what = format!(
                    "{} has {} rows of {} from byte {} on, the file has {} bytes: {CUT_SHORT}",
                    self.name_of(entry),
                    entry.rows,
                    entry.columns,
                    entry.location,
                    self.bytes.len()
                );
                Err(ParseError::malformed(entry.at, what))
            }
        }
    }

    /// The numbers of `entry`, undecoded.
    ///
    /// # Errors
    /// As [`Self::range`].
    pub(super) fn numbers(&self, entry: &IndexEntry) -> Result<&'a [u8], ParseError> {
        let range = self.range(entry)?;
        Ok(self.bytes.get(range).unwrap_or_default())
    }
}

/// A table that the header points to: `count` items of `each` bytes from byte `at` on.
struct Section {
    what: &'static str,
    /// Byte of the header that has `at`.
    header_at: usize,
    at: u64,
    count: u64,
    each: usize,
}

impl Section {
    /// Its bytes in a file of `len` bytes.
    fn range(&self, len: usize) -> Result<Range<usize>, ParseError> {
        let Self { what, at, count, each, .. } = self;
        let end = count
            .checked_mul(*each as u64)
            .and_then(|bytes| usize::try_from(bytes.checked_add(*at)?).ok());
        match (usize::try_from(*at), end) {
            (Ok(start), Some(end)) if end <= len => Ok(start..end),
            _ => {
                let what = format!(
                    "{what} has {count} times {each} bytes from byte {at} on, the file has {len}: {CUT_SHORT}"
                );
                Err(ParseError::malformed(self.header_at, what))
            }
        }
    }
}

/// The names in a list: each up to its zero, or in version 1 at the start of each unit. An empty one is the end.
fn names_in(list: &[u8], version: Version) -> Vec<&[u8]> {
    if version.major() < 2 {
        let units = list.chunks(NAME_UNIT).map(until_zero);
        return units.take_while(|n| !n.is_empty()).take(MAX_NAMES).collect();
    }
    let names = list.split(|b| *b == 0);
    names.take_while(|n| !n.is_empty()).take(MAX_NAMES).collect()
}

pub(super) fn until_zero(bytes: &[u8]) -> &[u8] {
    bytes.split(|b| *b == 0).next().unwrap_or_default()
}

/// The number at byte `at`, which is inside `bytes`.
fn u64_at(bytes: &[u8], at: usize) -> u64 {
    let stored = bytes.get(at..).and_then(<[u8]>::first_chunk);
    stored.map_or(0, |stored| u64::from_le_bytes(*stored))
}

/// The number at byte `at`, which is inside `bytes`.
fn u32_at(bytes: &[u8], at: usize) -> u32 {
    let stored = bytes.get(at..).and_then(<[u8]>::first_chunk);
    stored.map_or(0, |stored| u32::from_le_bytes(*stored))
}
