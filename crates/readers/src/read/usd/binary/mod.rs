//! Binary USD files (`.usdc`, "crate files"): a header, a table of sections, and values anywhere in the file.
//!
//! Sections are lists of tokens, of fields (a name and where its value is), of sets of fields, of paths, and of specs,
//! which give a set of fields to a path. After the layout that OpenUSD documents in `crateFile.h` and
//! `crateFile.cpp`. Versions 0.4 to 0.13 are read.

mod integers;
mod tree;
mod values;

use self::integers::{Coded, RATIO, can_have, coded_len, decoded, unpacked};
pub(super) use self::tree::read;
use super::prim::ValueRep;
use crate::read::numbers::NumberReader;
use spherule_frame::{Endian, MemoryBudget, ParseError};

/// The first bytes.
pub(super) const MAGIC: &[u8] = b"PXR-USDC";

/// Bytes of the header.
const HEADER_LEN: usize = 88;
/// Most sections of a file; OpenUSD writes six.
const MAX_SECTIONS: u64 = 64;
/// Most entries of a list for each byte of the file. Lists of similar entries take few bits each.
const MAX_ENTRIES: u64 = 64;
/// Newest minor version whose layout is known.
const NEWEST: u8 = 13;

/// A file whose lists have been read.
#[derive(Debug)]
pub(super) struct CrateFile<'a> {
    bytes: &'a [u8],
    minor_version: u8,
    /// Tokens, each followed by a zero.
    tokens: Vec<u8>,
    /// Where tokens end in `tokens`.
    token_ends: Vec<u32>,
    /// Token of the name and value of each field.
    fields: Vec<(u32, ValueRep)>,
    /// Numbers of fields; [`NO_FIELD`] ends a set.
    field_sets: Vec<u32>,
    paths: Vec<PathEntry>,
    specs: Vec<Spec>,
}

/// Ends a set of fields.
const NO_FIELD: u32 = u32::MAX;
/// The parent of the root, and of paths that are not defined.
const NO_PATH: u32 = u32::MAX;

/// A path by its last element.
#[derive(Debug, Clone, Copy)]
struct PathEntry {
    parent: u32,
    /// Token of the last element.
    token: u32,
    is_property: bool,
    is_defined: bool,
}

impl PathEntry {
    const UNDEFINED: Self =
        Self { parent: NO_PATH, token: 0, is_property: false, is_defined: false };
}

/// An object of the scene.
#[derive(Debug, Clone, Copy)]
struct Spec {
    path: u32,
    /// Where its fields begin in the list of sets.
    field_set: u32,
    kind: u32,
}

/// Where a section is in the file.
#[derive(Debug, Clone, Copy)]
struct Section {
    start: u64,
}

impl<'a> CrateFile<'a> {
    /// Reads all lists of a file.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if one is damaged; [`ParseError::Unsupported`] for other versions;
    /// [`ParseError::TooLarge`] if they do not fit into `budget`.
    fn open(bytes: &'a [u8], budget: MemoryBudget) -> Result<Self, ParseError> {
        let mut header = NumberReader::new(bytes, 0, Endian::Little);
        let head = header.take(HEADER_LEN)?;
        let (major, minor) = (head[8], head[9]);
        if major != 0 || !(4..=NEWEST).contains(&minor) {
            let what = format!(
                "version {major}.{minor} of binary USD files, 0.4 to 0.{NEWEST} are read; write the file anew: usdcat \
                 old.usd -o new.usda"
            );
            return Err(ParseError::unsupported(what));
        }
        let mut file = Self {
            bytes,
            minor_version: minor,
            tokens: Vec::new(),
            token_ends: Vec::new(),
            fields: Vec::new(),
            field_sets: Vec::new(),
            paths: Vec::new(),
            specs: Vec::new(),
        };
        let table = NumberReader::new(bytes, 16, Endian::Little).u64()?;
        let table = file.reader_at(table, 16)?;
        file.read_tokens(file.section(table, "TOKENS")?, budget)?;
        file.read_fields(file.section(table, "FIELDS")?, budget)?;
        file.read_field_sets(file.section(table, "FIELDSETS")?, budget)?;
        file.read_paths(file.section(table, "PATHS")?, budget)?;
        file.read_specs(file.section(table, "SPECS")?, budget)?;
        Ok(file)
    }

    /// All tokens one after another.
    pub(super) fn token_text(&self) -> &[u8] {
        &self.tokens
    }

    /// Where token `index` is in [`Self::token_text`].
    fn token_range(&self, index: u32) -> Option<std::ops::Range<usize>> {
        let end = *self.token_ends.get(index as usize)? as usize;
        let before = index.checked_sub(1).map(|i| self.token_ends[i as usize]);
        Some(before.map_or(0, |end| end as usize + 1)..end)
    }

    /// Token `index`; an empty one if there are fewer.
    fn token(&self, index: u32) -> &[u8] {
        let range = self.token_range(index).unwrap_or_default();
        self.tokens.get(range).unwrap_or_default()
    }

    /// The bytes from `offset` on, which byte `at` of the file tells.
    fn reader_at(&self, offset: u64, at: usize) -> Result<NumberReader<'a>, ParseError> {
        match usize::try_from(offset) {
            Ok(start) if start <= self.bytes.len() => {
                Ok(NumberReader::new(self.bytes, start, Endian::Little))
            }
            _ => {
                let len = self.bytes.len();
                let what =
                    format!("something is at byte {offset}, the file has {len}: {CUT_OR_DAMAGED}");
                Err(ParseError::malformed(at, what))
            }
        }
    }

    /// Finds a section in the table that `table` begins with.
    fn section(&self, mut table: NumberReader<'a>, name: &str) -> Result<Section, ParseError> {
        let at = table.at();
        let count = table.u64()?;
        if count > MAX_SECTIONS {
            let what = format!("a table of {count} sections: the file is damaged");
            return Err(ParseError::malformed(at, what));
        }
        for _ in 0..count {
            let own = table.take(16)?;
            let (start, _) = (table.u64()?, table.u64()?);
            if own.split(|byte| *byte == 0).next() == Some(name.as_bytes()) {
                return Ok(Section { start });
            }
        }
        Err(ParseError::malformed(at, format!("the file has no section {name}")))
    }

    /// The number of entries of a list.
    fn count(
        &self,
        reader: &mut NumberReader<'a>,
        name: &str,
        entry_len: u64,
        budget: MemoryBudget,
    ) -> Result<usize, ParseError> {
        let at = reader.at();
        let count = reader.u64()?;
        let len = self.bytes.len() as u64;
        let count = usize::try_from(count).ok().filter(|_| count <= MAX_ENTRIES * len).ok_or_else(
            || {
                ParseError::malformed(
                    at,
                    format!("more {name} than a file of {len} bytes can have"),
                )
            },
        )?;
        let need = entry_len.saturating_mul(count as u64);
        budget.check(need, &format!("the list of its {name} is"))?;
        Ok(count)
    }

    /// The bytes of a compressed block, which follow their length, and where they begin.
    fn block(reader: &mut NumberReader<'a>) -> Result<(&'a [u8], usize), ParseError> {
        let len = usize::try_from(reader.u64()?).unwrap_or(usize::MAX);
        let at = reader.at();
        Ok((reader.take(len)?, at))
    }

    /// A compressed list of `count` integers.
    fn integers<T: Coded>(
        reader: &mut NumberReader<'a>,
        count: usize,
    ) -> Result<Vec<T>, ParseError> {
        let (block, at) = Self::block(reader)?;
        if count == 0 {
            return Ok(Vec::new());
        }
        let damaged = || {
            let what =
                format!("the block here does not have {count} integers: the file is damaged");
            ParseError::malformed(at, what)
        };
        if !can_have(block.len(), count) {
            return Err(damaged());
        }
        let coded = unpacked(block, coded_len::<T>(count), at)?;
        decoded(&coded, count).ok_or_else(damaged)
    }

    fn read_tokens(&mut self, section: Section, budget: MemoryBudget) -> Result<(), ParseError> {
        let mut reader = self.reader_at(section.start, 16)?;
        let count = self.count(&mut reader, "tokens", 4, budget)?;
        let at = reader.at();
        let len = reader.u64()?;
        // LZ4 cannot pack them better
        let most = self.bytes.len().saturating_mul(RATIO) as u64;
        let damaged = || format!("{len} bytes of tokens: the file is damaged");
        let len = u32::try_from(len)
            .ok()
            .filter(|len| u64::from(*len) <= most)
            .ok_or_else(|| ParseError::malformed(at, damaged()))?;
        budget.check(len.into(), "the text of its tokens is")?;
        let (block, at) = Self::block(&mut reader)?;
        if count == 0 {
            return Ok(());
        }
        self.tokens = unpacked(block, len as usize, at)?;
        let zeros = memchr::memchr_iter(0, &self.tokens);
        self.token_ends = zeros.filter_map(|end| u32::try_from(end).ok()).collect();
        if self.token_ends.len() != count || self.tokens.len() != len as usize {
            let found = self.token_ends.len();
            let what = format!("{found} tokens, the file promises {count}: it is damaged");
            return Err(ParseError::malformed(at, what));
        }
        Ok(())
    }

    fn read_fields(&mut self, section: Section, budget: MemoryBudget) -> Result<(), ParseError> {
        let mut reader = self.reader_at(section.start, 16)?;
        let count = self.count(&mut reader, "fields", 32, budget)?;
        let tokens = Self::integers::<u32>(&mut reader, count)?;
        let (block, at) = Self::block(&mut reader)?;
        if count == 0 {
            return Ok(());
        }
        let reps = unpacked(block, 8 * count, at)?;
        let reps = reps.as_chunks().0;
        if reps.len() != count {
            let what = format!("{} values of {count} fields: the file is damaged", reps.len());
            return Err(ParseError::malformed(at, what));
        }
        let reps = reps.iter().map(|rep| ValueRep(u64::from_le_bytes(*rep)));
        self.fields = tokens.into_iter().zip(reps).collect();
        Ok(())
    }

    fn read_field_sets(
        &mut self,
        section: Section,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        let mut reader = self.reader_at(section.start, 16)?;
        let count = self.count(&mut reader, "sets of fields", 8, budget)?;
        self.field_sets = Self::integers(&mut reader, count)?;
        Ok(())
    }

    fn read_paths(&mut self, section: Section, budget: MemoryBudget) -> Result<(), ParseError> {
        let mut reader = self.reader_at(section.start, 16)?;
        let count = self.count(&mut reader, "paths", 16, budget)?;
        let at = reader.at();
        let coded_count = self.count(&mut reader, "paths", 32, budget)?;
        if coded_count > count {
            let what = format!("{coded_count} paths, the file promises {count}: it is damaged");
            return Err(ParseError::malformed(at, what));
        }
        let indices = Self::integers::<u32>(&mut reader, coded_count)?;
        let elements = Self::integers::<u32>(&mut reader, coded_count)?;
        let jumps = Self::integers::<u32>(&mut reader, coded_count)?;
        self.paths = vec![PathEntry::UNDEFINED; count];
        let tree = PathTree { indices, elements, jumps };
        tree.define(&mut self.paths).ok_or_else(|| {
            ParseError::malformed(at, "the paths are not a tree: the file is damaged")
        })
    }

    fn read_specs(&mut self, section: Section, budget: MemoryBudget) -> Result<(), ParseError> {
        let mut reader = self.reader_at(section.start, 16)?;
        let count = self.count(&mut reader, "objects", 32, budget)?;
        let paths = Self::integers::<u32>(&mut reader, count)?;
        let field_sets = Self::integers::<u32>(&mut reader, count)?;
        let kinds = Self::integers::<u32>(&mut reader, count)?;
        let specs = paths
            .into_iter()
            .zip(field_sets)
            .zip(kinds)
            .map(|((path, field_set), kind)| Spec { path, field_set, kind });
        self.specs = specs.collect();
        Ok(())
    }
}

/// Why something is not where the file says.
const CUT_OR_DAMAGED: &str = "it is damaged or cut short";

/// Paths in depth-first order.
struct PathTree {
    /// Number of each path.
    indices: Vec<u32>,
    /// Token of the last element; its negative for properties.
    elements: Vec<u32>,
    /// Above 0: the first child follows, and the next sibling is so much further; 0: the next sibling follows; -1: the
    /// first child follows, and there is no sibling; -2: there is neither.
    jumps: Vec<u32>,
}

impl PathTree {
    /// Fills in the entries of `paths`. Each entry of the tree is visited once; `None` if that does not work out.
    fn define(&self, paths: &mut [PathEntry]) -> Option<()> {
        // Entries whose subtrees are still to be visited, with the number of the parent's path
        let mut pending = vec![(0_usize, NO_PATH)];
        if self.indices.is_empty() {
            return Some(());
        }
        while let Some((mut at, mut parent)) = pending.pop() {
            loop {
                let index = *self.indices.get(at)?;
                let element = self.elements.get(at)?.cast_signed();
                let entry = paths.get_mut(index as usize)?;
                // Also ends damaged trees in which entries are reached twice
                if entry.is_defined {
                    return None;
                }
                *entry = PathEntry {
                    parent,
                    token: element.unsigned_abs(),
                    is_property: element < 0,
                    is_defined: true,
                };
                let jump = self.jumps.get(at)?.cast_signed();
                let sibling = usize::try_from(jump).ok().filter(|jump| *jump > 0);
                if let Some(jump) = sibling {
                    // The root has no siblings
                    pending.push((at.checked_add(jump)?, parent));
                }
                match jump {
                    -1 | 1.. => parent = index,
                    0 => {}
                    _ => break,
                }
                at += 1;
            }
        }
        Some(())
    }
}
