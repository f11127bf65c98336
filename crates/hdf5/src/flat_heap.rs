//! Fractal heaps of indirect blocks in indirect blocks, shown to `hdf5-reader` as heaps of one direct block.
//!
//! Groups with many links and objects with many attributes keep these in a fractal heap. Version 0.12.1 of the library
//! finds the direct block of an object below a second level of indirect blocks, but counts the object's offset from
//! the beginning of the heap instead of that of the block's parent: heaps of more than 512 KiB, of about 28 000 links,
//! are unreadable. Here, the blocks are put together in the order of their offsets. Layout: HDF5 File Format
//! Specification 3.0, III.G.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use hdf5_reader::StorageBuffer;
use hdf5_reader::checksum::jenkins_lookup3;
use hdf5_reader::error::Error;
use hdf5_reader::fractal_heap::FractalHeap;
use hdf5_reader::io::Cursor;

/// Signature of the header of a heap.
pub(super) const HEAP_SIGNATURE: &[u8] = b"FRHP";
/// Addresses from here on are those of flat heaps. No file is so long.
const FLAT_START: u64 = 1 << 62;
/// Most levels of indirect blocks. The library has a limit of 64; each level has at least twice the size of the next.
const MAX_LEVELS: u32 = 64;
/// Most rows of an indirect block: heaps have at most 64 bits of addresses.
const MAX_ROWS: u16 = 64;
/// Bytes of numbers in files of the sizes that are shown otherwise: nobody writes such large heaps with others.
const NUMBER_LEN: u8 = 8;
/// Flag of a heap whose direct blocks have checksums.
const CHECKSUMS: u8 = 2;
/// Place of the flags in the header.
const FLAGS: usize = 9;

/// Flat heaps by the places of their headers in the file; `None` for heaps that the library reads as they are.
#[derive(Default)]
pub(super) struct FlatHeaps {
    heaps: BTreeMap<u64, Option<FlatHeap>>,
    /// Bytes of all.
    len: u64,
}

#[derive(Clone)]
struct FlatHeap {
    /// The header as it is shown.
    header: Arc<Vec<u8>>,
    block: Arc<Vec<u8>>,
}

/// The first `len` bytes of `bytes`.
fn buffer(bytes: &Arc<Vec<u8>>, len: usize) -> Result<StorageBuffer, Error> {
    StorageBuffer::from_shared_owner(bytes.clone(), 0, len)
}

impl FlatHeaps {
    /// What is shown instead of the `len` bytes from byte `place` of `file` on, whose addresses begin at byte `base`:
    /// the header of a heap, or the block of a flat one. `None` for all else.
    ///
    /// # Errors
    /// [`Error`] if the heap is damaged.
    pub(super) fn shown(
        &mut self,
        file: &[u8],
        base: u64,
        place: u64,
        len: usize,
    ) -> Result<Option<StorageBuffer>, Error> {
        if let Some(header) = place.checked_sub(FLAT_START) {
            let heap = self
                .heaps
                .get(&header)
                .and_then(Option::as_ref)
                .ok_or(Error::OffsetOutOfBounds(place))?;
            return buffer(&heap.block, len).map(Some);
        }
        let start = usize::try_from(place).unwrap_or(usize::MAX);
        if !file.get(start..).is_some_and(|b| b.starts_with(HEAP_SIGNATURE)) {
            return Ok(None);
        }
        let known = self.heaps.get(&place).cloned();
        let heap = match known {
            Some(heap) => heap,
            None => {
                // Heaps of damaged files may share their blocks
                let most = (2 * file.len() as u64).saturating_sub(self.len);
                let heap = flatten(file, base, place, most)?;
                self.len += heap.as_ref().map_or(0, |heap| heap.block.len() as u64);
                self.heaps.insert(place, heap.clone());
                heap
            }
        };
        match heap {
            Some(heap) if heap.header.len() >= len => buffer(&heap.header, len).map(Some),
            _ => Ok(None),
        }
    }
}

/// The heap whose header is at byte `place`, as one block of at most `most` bytes; `None` if the library can read it.
fn flatten(file: &[u8], base: u64, place: u64, most: u64) -> Result<Option<FlatHeap>, Error> {
    let mut cursor = Cursor::new(file);
    cursor.set_position(place);
    let Ok(heap) = FractalHeap::parse(&mut cursor, NUMBER_LEN, NUMBER_LEN) else {
        // With numbers of another size
        return Ok(None);
    };
    let doubling = DoublingTable::of(&heap);
    if u32::from(heap.current_rows_in_root_indirect) <= doubling.direct_rows
        || heap.io_filters_len > 0
    {
        return Ok(None);
    }
    let mut blocks = Blocks {
        file,
        base,
        doubling,
        heap: &heap,
        visited: BTreeSet::new(),
        flat: Vec::new(),
        most,
    };
    let root = (heap.root_block_address, heap.current_rows_in_root_indirect);
    blocks.add_indirect(root, 0, 0)?;
    let block = blocks.flat;
    // Another root, which has all rows in one block, without a checksum
    let start = usize::try_from(place).unwrap_or(usize::MAX);
    let end = usize::try_from(cursor.position()).unwrap_or(usize::MAX);
    let mut header = file.get(start..end).unwrap_or_default().to_vec();
    let shown = shown_fields(block.len() as u64, (FLAT_START + place).saturating_sub(base));
    for (at, bytes) in shown {
        header[at..at + bytes.len()].copy_from_slice(&bytes);
    }
    header[FLAGS] &= !CHECKSUMS;
    let checksum = header.len() - 4;
    let sum = jenkins_lookup3(&header[..checksum]).to_le_bytes();
    header[checksum..].copy_from_slice(&sum);
    // The library reads more than the header
    let rest = file.get(end..).unwrap_or_default();
    header.extend_from_slice(&rest[..rest.len().min(256)]);
    Ok(Some(FlatHeap { header: Arc::new(header), block: Arc::new(block) }))
}

/// Places in a header with numbers of eight bytes, and what is shown there: size of the first block, address of the
/// root, and its rows, which are 0 for a direct block.
fn shown_fields(len: u64, address: u64) -> [(usize, Vec<u8>); 3] {
    // Twelve numbers and two of two bytes are between the largest managed object and the root
    const STARTING_SIZE: usize = 14 + 12 * 8 + 2;
    const ROOT: usize = STARTING_SIZE + 2 * 8 + 2 + 2;
    [
        (STARTING_SIZE, len.to_le_bytes().to_vec()),
        (ROOT, address.to_le_bytes().to_vec()),
        (ROOT + 8, vec![0; 2]),
    ]
}

/// Sizes of the blocks in a row: the first two have the starting size, each later one twice the one before.
#[derive(Clone, Copy)]
struct DoublingTable {
    starting_size: u64,
    width: u64,
    /// Rows of direct blocks. The rows after them have indirect ones.
    direct_rows: u32,
}

impl DoublingTable {
    fn of(heap: &FractalHeap) -> Self {
        let mut table = Self {
            starting_size: heap.starting_block_size,
            width: u64::from(heap.table_width),
            direct_rows: 0,
        };
        let is_direct = |size: u64| size <= heap.max_direct_block_size;
        while table.direct_rows < u32::from(MAX_ROWS)
            && table.block_len(table.direct_rows).is_some_and(is_direct)
        {
            table.direct_rows += 1;
        }
        table
    }

    fn block_len(&self, row: u32) -> Option<u64> {
        let factor = 1_u64.checked_shl(row.saturating_sub(1))?;
        self.starting_size.checked_mul(factor)
    }

    /// Rows of an indirect block that stands for `len` bytes.
    fn rows_of(&self, len: u64) -> Option<u16> {
        let mut left = len;
        let mut rows = 0;
        while rows < MAX_ROWS {
            let row = self.block_len(u32::from(rows))?.checked_mul(self.width)?;
            match left.checked_sub(row) {
                Some(rest) if row > 0 => left = rest,
                _ => break,
            }
            rows += 1;
        }
        Some(rows)
    }
}

/// The direct blocks of a heap, one after the other.
struct Blocks<'a> {
    file: &'a [u8],
    base: u64,
    doubling: DoublingTable,
    heap: &'a FractalHeap,
    /// Addresses of all blocks. None is there twice.
    visited: BTreeSet<u64>,
    flat: Vec<u8>,
    most: u64,
}

fn damaged(what: &str) -> Error {
    Error::InvalidData(format!("fractal heap: {what}"))
}

impl Blocks<'_> {
    /// Adds what is below the indirect block at an address with a number of rows, from `offset` of the heap on.
    fn add_indirect(
        &mut self,
        (address, rows): (u64, u16),
        offset: u64,
        level: u32,
    ) -> Result<(), Error> {
        if level >= MAX_LEVELS || rows > MAX_ROWS || !self.visited.insert(address) {
            return Err(damaged("too many levels or rows, or a block twice"));
        }
        let mut cursor = Cursor::new(self.file);
        cursor.set_position(address.saturating_add(self.base));
        if cursor.read_bytes(4)? != b"FHIB" {
            return Err(damaged("an indirect block is missing"));
        }
        // Version, address of the heap, offset of the block
        cursor
            .skip(1 + usize::from(NUMBER_LEN) + usize::from(self.heap.max_heap_size).div_ceil(8))?;
        let mut start = offset;
        for row in 0..u32::from(rows) {
            let len = self.doubling.block_len(row).ok_or_else(|| damaged("too long"))?;
            for _ in 0..self.doubling.width {
                let child = cursor.read_offset(NUMBER_LEN)?;
                if Cursor::is_undefined_offset(child, NUMBER_LEN) {
                    // Never written, or free again
                } else if row < self.doubling.direct_rows {
                    self.add_direct(child, start, len)?;
                } else {
                    let rows = self.doubling.rows_of(len).ok_or_else(|| damaged("too long"))?;
                    self.add_indirect((child, rows), start, level + 1)?;
                }
                start = start.checked_add(len).ok_or_else(|| damaged("too long"))?;
            }
        }
        Ok(())
    }

    /// Adds the `len` bytes of the direct block at `address`, at `offset` of the heap.
    fn add_direct(&mut self, address: u64, offset: u64, len: u64) -> Result<(), Error> {
        let end = offset
            .checked_add(len)
            .filter(|end| *end <= self.most)
            .ok_or_else(|| damaged("longer than the file"))?;
        if !self.visited.insert(address) {
            return Err(damaged("a block twice"));
        }
        let size = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
        let mut cursor = Cursor::new(self.file);
        cursor.set_position(address.saturating_add(self.base));
        let block = cursor.read_bytes(size(len))?;
        if !block.starts_with(b"FHDB") {
            return Err(damaged("a direct block is missing"));
        }
        if self.heap.flags & CHECKSUMS != 0 {
            self.verify(block)?;
        }
        let flat_len = self.flat.len().max(size(end));
        self.flat.resize(flat_len, 0);
        self.flat[size(offset)..size(end)].copy_from_slice(block);
        Ok(())
    }

    /// Compares the checksum of a direct block, which counts as 0 in it.
    fn verify(&self, block: &[u8]) -> Result<(), Error> {
        let offset_len = usize::from(self.heap.max_heap_size).div_ceil(8);
        let place = 5 + usize::from(NUMBER_LEN) + offset_len;
        let mut zeroed = block.to_vec();
        let stored = zeroed
            .get_mut(place..place + 4)
            .ok_or_else(|| damaged("a direct block is too short"))?;
        let expected = Cursor::new(stored).read_u32_le()?;
        stored.fill(0);
        if expected == jenkins_lookup3(&zeroed) {
            Ok(())
        } else {
            Err(damaged("wrong checksum of a direct block"))
        }
    }
}
