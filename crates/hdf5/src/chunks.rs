//! The chunks of a data set: where they are in the file, and their bytes without filters.

use std::borrow::Cow;
use std::ops::Range;

use hdf5_reader::btree_v1::{BTreeV1Key, collect_btree_v1_leaves_storage};
use hdf5_reader::chunk_index::{
    ChunkEntry, collect_implicit_chunk_entries, collect_v2_chunk_entries_storage,
    single_chunk_entry,
};
use hdf5_reader::error::Error;
use hdf5_reader::extensible_array::collect_extensible_array_chunk_entries_storage;
use hdf5_reader::filters::{
    FILTER_DEFLATE, FILTER_FLETCHER32, FILTER_NBIT, FILTER_SCALEOFFSET, FILTER_SHUFFLE,
    FILTER_SZIP, FilterRegistry, apply_pipeline_with_limit,
};
use hdf5_reader::fixed_array::collect_fixed_array_chunk_entries_storage;
use hdf5_reader::messages::layout::ChunkIndexing;

use super::stored::{ChunkedLayout, Stored};
use spherule_frame::{MemoryBudget, ParseError};
use spherule_readers::read::{CUT_SHORT, lzf};

/// Number of the filter LZF of h5py.
const FILTER_LZF: u16 = 32000;

/// Most filters of a pipeline: shuffle, compression and a checksum are usual.
const MAX_FILTERS: usize = 4;

/// The chunks of some rows of a data set, by place. A *band* is the chunks that hold the same rows.
#[derive(Debug)]
pub(super) struct ChunkGrid {
    /// Rows of a band.
    pub(super) band_rows: u64,
    /// Number of the first band.
    first_band: u64,
    /// Chunks of a band, along the dimension after the rows.
    pub(super) band_chunks: usize,
    /// Chunks by band, then along the dimension after the rows.
    chunks: Vec<Chunk>,
    /// Bytes of a decoded chunk.
    pub(super) chunk_len: usize,
}

/// A chunk in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Chunk {
    start: usize,
    len: usize,
    filter_mask: u32,
}

/// The part of a data set whose chunks are looked up.
#[derive(Debug, Clone)]
pub(super) struct Selection {
    /// Index along the dimension before the rows, if there is one.
    pub(super) frame: Option<u64>,
    /// Rows, at least one.
    pub(super) rows: Range<u64>,
}

impl ChunkGrid {
    /// Finds the chunks of `selection`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the index is damaged or a chunk is missing or not in the file,
    /// [`ParseError::Unsupported`] for other filters, [`ParseError::TooLarge`].
    pub(super) fn find(
        stored: &Stored,
        layout: &ChunkedLayout,
        selection: &Selection,
        budget: MemoryBudget,
    ) -> Result<Self, ParseError> {
        check_filters(stored, layout)?;
        let row_dimension = usize::from(selection.frame.is_some());
        let sizes = layout.chunk.iter().map(|size| u64::from(*size));
        let chunk_len = sizes
            .clone()
            .try_fold(stored.element_len as u64, u64::checked_mul)
            .and_then(|len| usize::try_from(len).ok())
            .filter(|len| u32::try_from(*len).is_ok())
            .ok_or_else(|| stored.bad("chunks of more than 4 GiB"))?;
        budget.check(chunk_len as u64, "one of its chunks is")?;
        // Range of chunks along each dimension
        let sizes: Vec<u64> = sizes.collect();
        let mut first = vec![0; sizes.len()];
        let mut last: Vec<u64> = sizes
            .iter()
            .zip(&stored.shape)
            .map(|(size, all)| all.saturating_sub(1) / size)
            .collect();
        if let Some(frame) = selection.frame {
            (first[0], last[0]) = (frame / sizes[0], frame / sizes[0]);
        }
        let band_rows = sizes[row_dimension];
        first[row_dimension] = selection.rows.start / band_rows;
        last[row_dimension] = (selection.rows.end - 1) / band_rows;
        // No more chunks than bytes
        let counts = first.iter().zip(&last).map(|(first, last)| last - first + 1);
        let count = counts.clone().try_fold(1_u64, u64::checked_mul);
        let most = stored.file.bytes().len() as u64;
        let count = count.filter(|count| *count <= most).ok_or_else(|| stored.never_written())?;
        let list_len = count.saturating_mul(160);
        budget.check(list_len, "the list of its chunks is")?;
        let entries = entries(stored, layout, (&first, &last))?;
        // Put each at its place
        let band_chunks = counts.skip(row_dimension + 1).product::<u64>();
        let place = |entry: &ChunkEntry| {
            let mut place = 0;
            for (dimension, (first, last)) in first.iter().zip(&last).enumerate() {
                let number = entry.offsets.get(dimension)? / sizes[dimension];
                if number < *first || number > *last {
                    return None;
                }
                place = place * (last - first + 1) + (number - first);
            }
            usize::try_from(place).ok()
        };
        let mut chunks = vec![None; usize::try_from(count).unwrap_or(usize::MAX)];
        let mut all_len = 0_u64;
        for entry in &entries {
            let Some(slot) = place(entry).and_then(|place| chunks.get_mut(place)) else {
                continue;
            };
            if slot.is_some() {
                return Err(stored.bad(format!("two chunks at {:?}", entry.offsets)));
            }
            let chunk = Chunk::of(stored, entry, chunk_len)?;
            all_len += chunk.len as u64;
            *slot = Some(chunk);
        }
        if all_len > most {
            let what = format!("its chunks have {all_len} bytes together, the file has {most}");
            return Err(stored.bad(what));
        }
        let found: Option<Vec<Chunk>> = chunks.into_iter().collect();
        Ok(Self {
            band_rows,
            first_band: first[row_dimension],
            band_chunks: usize::try_from(band_chunks).unwrap_or(usize::MAX),
            chunks: found.ok_or_else(|| stored.never_written())?,
            chunk_len,
        })
    }

    /// The bytes of chunk `number` of `band`, without filters.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if they are damaged.
    pub(super) fn decode<'a>(
        &self,
        stored: &'a Stored,
        layout: &ChunkedLayout,
        (band, number): (u64, usize),
    ) -> Result<Cow<'a, [u8]>, ParseError> {
        let place = usize::try_from(band - self.first_band)
            .unwrap_or(usize::MAX)
            .saturating_mul(self.band_chunks)
            .saturating_add(number);
        let chunk = self.chunks.get(place).ok_or_else(|| stored.never_written())?;
        let packed =
            stored.file.bytes().get(chunk.start..chunk.start + chunk.len).unwrap_or_default();
        let is_filtered = (0..layout.filters.len()).any(|i| chunk.filter_mask >> i & 1 == 0);
        let len = self.chunk_len;
        let unpacked = if is_filtered {
            unpack(packed, stored, layout, chunk.filter_mask, len).map(Cow::Owned)
        } else {
            Ok(Cow::Borrowed(packed))
        };
        let fault = match unpacked {
            Ok(unpacked) if unpacked.len() == len => return Ok(unpacked),
            Ok(unpacked) if unpacked.len() > len => format!("has more than its {len} bytes"),
            Ok(unpacked) => format!("has {} of its {len} bytes", unpacked.len()),
            Err(error) => format!("is damaged: {error}"),
        };
        let what = format!("{}: the chunk here {fault}", stored.path);
        Err(ParseError::malformed(chunk.start, what))
    }
}

impl Chunk {
    /// The chunk of `entry`, whose bytes must be in the file.
    fn of(stored: &Stored, entry: &ChunkEntry, chunk_len: usize) -> Result<Self, ParseError> {
        let file = &stored.file;
        let base = file.inner().superblock().base_address;
        let start = entry.address.checked_add(base);
        let start = start.and_then(|start| usize::try_from(start).ok());
        // Chunks without filters may have no length in the index.
        let len = match entry.size {
            0 => Some(chunk_len),
            size => usize::try_from(size).ok(),
        };
        let file_len = file.bytes().len();
        let range = start.zip(len).filter(|(start, len)| {
            let end = start.checked_add(*len);
            end.is_some_and(|end| end <= file_len)
        });
        match range {
            Some((start, len)) => Ok(Self {
                start,
                len,
                filter_mask: entry.filter_mask,
            }),
            None => Err(stored.bad(format!(
                "the chunk at {:?} has {} bytes from byte {} on, the file has {file_len}: {CUT_SHORT}",
                entry.offsets, entry.size, entry.address
            ))),
        }
    }
}

/// Refuses filters that are not known, and pipelines that nobody writes.
fn check_filters(stored: &Stored, layout: &ChunkedLayout) -> Result<(), ParseError> {
    let known = [
        FILTER_DEFLATE,
        FILTER_SHUFFLE,
        FILTER_FLETCHER32,
        FILTER_NBIT,
        FILTER_SCALEOFFSET,
        FILTER_SZIP,
        FILTER_LZF,
    ];
    let other = layout.filters.iter().find(|f| !known.contains(&f.id));
    if let Some(filter) = other {
        let name = match filter.id {
            307 => "bzip2",
            32001 => "Blosc",
            32004 => "LZ4",
            32008 => "Bitshuffle",
            32013 => "ZFP",
            32015 => "Zstandard",
            32017 => "SZ",
            32026 => "Blosc2",
            _ => filter.name.as_deref().unwrap_or("an unknown filter"),
        };
        return Err(ParseError::unsupported(format!(
            "{}: compressed with {name} (filter {}), which is not read; repack the file with `h5repack -f GZIP=4`",
            stored.path, filter.id
        )));
    }
    if layout.filters.len() > MAX_FILTERS {
        let count = layout.filters.len();
        return Err(stored.bad(format!("{count} filters, at most {MAX_FILTERS} are read")));
    }
    Ok(())
}

/// Removes the filters of a chunk that has `len` bytes then.
fn unpack(
    packed: &[u8],
    stored: &Stored,
    layout: &ChunkedLayout,
    filter_mask: u32,
    len: usize,
) -> Result<Vec<u8>, Error> {
    let mut registry = FilterRegistry::new();
    let lzf = move |_: &_, data: &[u8], _| {
        let damaged = |what| Error::DecompressionError(format!("LZF: {what}"));
        lzf::decompress(data, len).map_err(damaged)
    };
    registry.register(FILTER_LZF, Box::new(lzf));
    apply_pipeline_with_limit(
        packed,
        &layout.filters,
        filter_mask,
        stored.element_len,
        Some(&registry),
        Some(len + 1),
    )
}

/// The chunks between the numbers `bounds` (along each dimension, both included), from whatever index there is.
fn entries(
    stored: &Stored,
    layout: &ChunkedLayout,
    bounds: (&[u64], &[u64]),
) -> Result<Vec<ChunkEntry>, ParseError> {
    let file = &stored.file;
    let inner = file.inner();
    let (storage, index, chunk) = (inner.storage(), layout.index, layout.chunk.as_slice());
    let (offset_size, length_size) = {
        let superblock = inner.superblock();
        (superblock.offset_size, superblock.length_size)
    };
    let rank = stored.shape.len();
    let rank_u32 = u32::try_from(rank).unwrap_or(u32::MAX);
    let bounds = Some(bounds);
    let entries = match &layout.indexing {
        None => {
            let sizes = (offset_size, length_size);
            btree_v1(stored, layout, sizes, bounds)
        }
        Some(ChunkIndexing::SingleChunk { filtered_size, filters }) => {
            Ok(vec![single_chunk_entry(index, *filtered_size, *filters, rank)])
        }
        Some(ChunkIndexing::BTreeV2) => collect_v2_chunk_entries_storage(
            storage,
            index,
            offset_size,
            length_size,
            rank_u32,
            chunk,
            bounds,
        ),
        Some(ChunkIndexing::Implicit) => {
            let (shape, len) = (&stored.shape, storage.len());
            collect_implicit_chunk_entries(index, shape, chunk, stored.element_len, bounds, len)
        }
        Some(ChunkIndexing::FixedArray { .. }) => collect_fixed_array_chunk_entries_storage(
            storage,
            index,
            offset_size,
            length_size,
            &stored.shape,
            chunk,
            bounds,
        ),
        Some(ChunkIndexing::ExtensibleArray { .. }) => {
            collect_extensible_array_chunk_entries_storage(
                storage,
                index,
                offset_size,
                length_size,
                &stored.shape,
                stored.max_shape.as_deref(),
                chunk,
                bounds,
            )
        }
    };
    entries.map_err(|e| file.error(&e, index, &stored.path))
}

/// First and last numbers of chunks along each dimension.
type Bounds<'a> = Option<(&'a [u64], &'a [u64])>;

/// The entries of an index that is a B-tree of version 1.
fn btree_v1(
    stored: &Stored,
    layout: &ChunkedLayout,
    (offset_size, length_size): (u8, u8),
    bounds: Bounds<'_>,
) -> Result<Vec<ChunkEntry>, Error> {
    let rank = stored.shape.len();
    let leaves = collect_btree_v1_leaves_storage(
        stored.file.inner().storage(),
        layout.index,
        offset_size,
        length_size,
        Some(u32::try_from(rank).unwrap_or(u32::MAX)),
        &layout.chunk,
        bounds,
    )?;
    let entries = leaves.into_iter().filter_map(|(key, address)| match key {
        BTreeV1Key::RawData { chunk_size, filter_mask, mut offsets } => {
            offsets.truncate(rank);
            Some(ChunkEntry { address, size: u64::from(chunk_size), filter_mask, offsets })
        }
        BTreeV1Key::Group { .. } => None,
    });
    Ok(entries.collect())
}
