//! Numbers of the rows of a data set, one group for each row, whatever its storage.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::band_cache::BandCache;
use super::chunks::{ChunkGrid, Selection};
use super::slice::Slice;
use super::stored::{Storage, Stored};
use super::types::Field;
use super::virtual_list::VirtualPart;
use super::virtual_rows::{WantedRows, source_rows};
use spherule_frame::{MemoryBudget, ParseError, ScalarType};
use spherule_readers::read::columns::{ComponentStride, StridedColumn};

/// Most numbers in a row.
pub(super) const MAX_COMPONENTS: usize = 64;

/// Numbers of some rows.
#[derive(Debug, Clone)]
pub(super) struct Values {
    stored: Arc<Stored>,
    field: Field,
    /// Bytes of a row.
    row_len: usize,
    /// First row among all rows of the data set.
    first: u64,
    count: u64,
    /// Index along the dimension before the rows.
    frame: Option<u64>,
    /// Rows of the dimension, to find `frame`.
    all_rows: u64,
    chunks: Option<Chunks>,
    /// Data sets that have the rows of a virtual one.
    sources: Vec<Source>,
}

/// Rows of a virtual data set as those of another one.
#[derive(Debug, Clone)]
struct Source {
    /// Counted from the first row.
    rows: Range<u64>,
    values: Values,
}

/// Chunks that hold the rows.
#[derive(Debug, Clone)]
struct Chunks {
    grid: Arc<ChunkGrid>,
    band_rows: u64,
    /// Whether there is memory to decode a chunk in each thread.
    is_parallel: bool,
}

/// Keeps chunks for the next range; `None` if everything is read once.
pub(super) type Cache<'a> = Option<&'a BandCache>;

impl Values {
    /// The numbers of `slice` of `stored`; `None` if its elements are no numbers, or its shape is another.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if they are not all in the file, [`ParseError::Unsupported`] for other filters.
    pub(super) fn find(
        stored: &Arc<Stored>,
        slice: &Slice,
        budget: MemoryBudget,
    ) -> Result<Option<Self>, ParseError> {
        let Some(shape) = RowShape::of(stored, slice) else {
            return Ok(None);
        };
        let rows = slice.rows.clone().unwrap_or(0..shape.rows);
        if rows.start > rows.end || rows.end > shape.rows {
            let (start, end, all) = (rows.start, rows.end, shape.rows);
            return Err(stored.bad(format!("rows {start} to {end} of {all} are used")));
        }
        let mut values = Self {
            stored: Arc::clone(stored),
            field: shape.field,
            row_len: shape.row_len,
            first: rows.start,
            count: rows.end - rows.start,
            frame: slice.frame,
            all_rows: shape.rows,
            chunks: None,
            sources: Vec::new(),
        };
        if values.count == 0 {
            return Ok(Some(values));
        }
        stored.check_whole()?;
        match &stored.place {
            Storage::Compact(_) | Storage::Contiguous(_) => {}
            Storage::Missing => return Err(stored.never_written()),
            Storage::Virtual(parts) => values.find_sources(slice, parts, budget)?,
            Storage::Chunked(layout) => {
                let stride = slice.stride.unwrap_or(1);
                let selection =
                    Selection { frame: slice.frame, rows: rows.start * stride..rows.end * stride };
                let grid = ChunkGrid::find(stored, layout, &selection, budget)?;
                if grid.band_rows % stride != 0 {
                    return Ok(None);
                }
                let threads = rayon::current_num_threads() as u64;
                let need = threads.saturating_mul(4 * grid.chunk_len as u64);
                values.chunks = Some(Chunks {
                    band_rows: grid.band_rows / stride,
                    grid: Arc::new(grid),
                    is_parallel: need <= budget.bytes(),
                });
            }
        }
        Ok(Some(values))
    }

    /// Finds the data sets that have the rows of a virtual one.
    fn find_sources(
        &mut self,
        slice: &Slice,
        parts: &[VirtualPart],
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        let stored = &self.stored;
        let elements = (self.row_len / stored.element_len.max(1)) as u64;
        let row = self.frame.unwrap_or(0) * self.all_rows + self.first;
        let wanted =
            WantedRows { field: slice.field, first: row * elements, count: self.count, elements };
        let own = (self.scalar(), self.components());
        let mut sources = Vec::new();
        for found in source_rows(stored, parts, &wanted)? {
            let values = Self::find(&found.stored, &found.slice, budget)?;
            let fits = |values: &Self| (values.scalar(), values.components()) == own;
            let Some(values) = values.filter(fits) else {
                let (path, from) = (&stored.path, &found.stored.path);
                return Err(ParseError::unsupported(format!(
                    "{path}: a virtual data set with values of {from}, which has numbers of another type; copy it with \
                     h5py"
                )));
            };
            let rows = found.rows;
            sources.push(Source { rows, values });
        }
        self.sources = sources;
        Ok(())
    }

    /// Number of rows.
    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    /// Numbers in a row.
    pub(super) const fn components(&self) -> usize {
        self.field.components
    }

    /// Type of the numbers.
    pub(super) const fn scalar(&self) -> ScalarType {
        self.field.scalar
    }

    /// The data set.
    pub(super) fn stored(&self) -> &Stored {
        &self.stored
    }

    /// Rows of a chunk, if there are chunks.
    pub(super) fn band_rows(&self) -> Option<u64> {
        let sources = self.sources.iter().filter_map(|source| source.values.band_rows());
        let own = self.chunks.as_ref().map(|chunks| chunks.band_rows);
        own.into_iter().chain(sources).max()
    }

    /// Bytes of a decoded chunk, 0 without chunks.
    pub(super) fn chunk_len(&self) -> u64 {
        let own = self.chunks.as_ref().map_or(0, |chunks| chunks.grid.chunk_len as u64);
        let sources = self.sources.iter().map(|source| source.values.chunk_len());
        sources.fold(own, u64::max)
    }

    /// Where the numbers are, if they are in one range of the file.
    pub(super) fn column(&self) -> Option<StridedColumn> {
        match self.stored.place {
            Storage::Contiguous(start) if self.count > 0 => Some(self.column_from(start)),
            _ => None,
        }
    }

    /// Reads the rows from `first` on, which exist, little-endian.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a chunk is damaged.
    pub(super) fn read(
        &self,
        cache: Cache<'_>,
        first: u64,
        to: &mut [u8],
    ) -> Result<(), ParseError> {
        let start = usize::try_from(first).unwrap_or(usize::MAX);
        match (&self.stored.place, &self.chunks) {
            (Storage::Contiguous(place), _) => {
                let bytes = self.stored.file.bytes();
                self.column_from(*place).read_values(bytes, start, to);
                Ok(())
            }
            (Storage::Compact(bytes), _) => {
                self.column_from(0).read_values(bytes, start, to);
                Ok(())
            }
            (_, Some(chunks)) => self.read_chunks(cache, chunks, first, to),
            (_, None) => self.read_sources(cache, first, to),
        }
    }

    /// The numbers of all rows if those of the data set begin at byte `start`.
    fn column_from(&self, start: usize) -> StridedColumn {
        let rows = self.frame.unwrap_or(0) * self.all_rows + self.first;
        let rows = usize::try_from(rows).unwrap_or(usize::MAX);
        self.rows_at(start + rows * self.row_len)
    }

    /// The numbers of rows that begin at byte `start`.
    fn rows_at(&self, start: usize) -> StridedColumn {
        let first = ComponentStride { start: start + self.field.offset, stride: self.row_len };
        let scalar = (self.field.scalar, self.field.endian);
        StridedColumn::interleaved(&self.stored.path, scalar, self.field.components, first)
    }

    /// Reads rows of other data sets.
    fn read_sources(&self, cache: Cache<'_>, first: u64, to: &mut [u8]) -> Result<(), ParseError> {
        let width = self.components() * self.scalar().size();
        let mut row = first;
        let mut left = to;
        for source in self.sources.iter().filter(|source| source.rows.end > first) {
            let rows = usize::try_from(source.rows.end - row).unwrap_or(usize::MAX);
            let (own, rest) = left.split_at_mut(rows.saturating_mul(width).min(left.len()));
            if own.is_empty() {
                break;
            }
            source.values.read(cache, row - source.rows.start, own)?;
            row = source.rows.end;
            left = rest;
        }
        Ok(())
    }

    fn read_chunks(
        &self,
        cache: Cache<'_>,
        chunks: &Chunks,
        first: u64,
        to: &mut [u8],
    ) -> Result<(), ParseError> {
        // Divide the rows among the bands that hold them
        let width = self.field.components * self.field.scalar.size();
        let mut left = to;
        let mut row = self.first + first;
        let mut tasks = Vec::new();
        while left.len() >= width {
            let band = row / chunks.band_rows;
            let in_band = (band + 1) * chunks.band_rows - row;
            let len = usize::try_from(in_band).unwrap_or(usize::MAX).saturating_mul(width);
            let (own, rest) = left.split_at_mut(len.min(left.len()));
            tasks.push((band, row - band * chunks.band_rows, own));
            row += in_band;
            left = rest;
        }
        let read = |(band, row, to): (u64, u64, &mut [u8])| {
            let row = usize::try_from(row).unwrap_or(usize::MAX);
            let decode = || self.band(chunks, band);
            match cache {
                None => self.rows_at(0).read_values(&decode()?, row, to),
                Some(cache) => {
                    let key = (self.stored.key(), self.frame, band);
                    let rows = cache.get(key, decode)?;
                    self.rows_at(0).read_values(&rows, row, to);
                }
            }
            Ok(())
        };
        if !chunks.is_parallel || tasks.len() == 1 {
            return tasks.into_iter().try_for_each(read);
        }
        // The error of the first damaged chunk, whatever the threads
        let results: Vec<Result<(), ParseError>> = tasks.into_par_iter().map(read).collect();
        results.into_iter().collect()
    }

    /// The rows of a band as they are without filters.
    fn band(&self, chunks: &Chunks, band: u64) -> Result<Vec<u8>, ParseError> {
        let (stored, grid) = (&*self.stored, &chunks.grid);
        let Storage::Chunked(layout) = &stored.place else {
            return Ok(Vec::new());
        };
        let rows = usize::try_from(chunks.band_rows).unwrap_or(usize::MAX);
        // A chunk may hold several frames
        let rank = usize::from(self.frame.is_some());
        let frames = self.frame.map_or(1, |_| u64::from(layout.chunk[0]));
        let frame = self.frame.unwrap_or(0) % frames.max(1);
        let frame_len = grid.chunk_len / usize::try_from(frames.max(1)).unwrap_or(usize::MAX);
        let start = usize::try_from(frame).unwrap_or(usize::MAX) * frame_len;
        let decoded = |number| grid.decode(stored, layout, (band, number));
        if grid.band_chunks == 1 && frame_len == rows * self.row_len {
            let mut chunk = decoded(0)?.into_owned();
            chunk.drain(..start);
            return Ok(chunk);
        }
        // Join the chunks along the dimension after the rows, cutting off what exceeds it
        let mut joined = vec![0; rows.saturating_mul(self.row_len)];
        let elements = layout.chunk.get(rank + 1).map_or(1, |n| *n as usize);
        let part_len = elements * stored.element_len;
        for number in 0..grid.band_chunks {
            let chunk = decoded(number)?;
            let parts = chunk[start..].chunks_exact(part_len.max(1));
            let at = number * part_len;
            for (row, part) in joined.chunks_exact_mut(self.row_len).zip(parts) {
                let own = row.get_mut(at..).unwrap_or_default();
                let len = own.len().min(part.len());
                own[..len].copy_from_slice(&part[..len]);
            }
        }
        Ok(joined)
    }
}

/// A data set as rows.
struct RowShape {
    rows: u64,
    row_len: usize,
    field: Field,
}

impl RowShape {
    /// How `slice` divides `stored` into rows; `None` if it does not.
    fn of(stored: &Stored, slice: &Slice) -> Option<Self> {
        let shape = match (slice.frame, stored.shape.as_slice()) {
            (None, shape) => shape,
            (Some(frame), [frames, shape @ ..]) if frame < *frames => shape,
            (Some(_), _) => return None,
        };
        let (rows, elements) = match (shape, slice.stride) {
            ([rows], None) => (*rows, 1),
            ([rows, elements], None) => (*rows, *elements),
            ([all], Some(stride)) if stride > 0 && all % stride == 0 => (all / stride, stride),
            _ => return None,
        };
        let elements = usize::try_from(elements).ok()?;
        let row_len = elements.checked_mul(stored.element_len)?;
        let field = match slice.field {
            Some(field) if elements == 1 => field,
            Some(_) => return None,
            None => {
                let field = Field::of(&stored.datatype)?;
                let components = field.components.checked_mul(elements)?;
                Field { components, ..field }
            }
        };
        let is_inside = field.end().is_some_and(|end| end <= row_len);
        let has_few = (1..=MAX_COMPONENTS).contains(&field.components);
        (is_inside && has_few).then_some(Self { rows, row_len, field })
    }
}
