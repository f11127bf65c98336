//! Distributes particles over the parts of a curve. Batches of the source, or chunks of a part that is too
//! large, are sorted by part in parallel and then appended to their parts in order.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use glam::Vec3;
use rayon::prelude::*;

use super::batch::{Batch, BufferPool, ParticleRange};
use super::curve::Cuts;
use super::limits::Limits;
use super::output::FrameOutput;
use super::settings::{ConvertError, Phase};
use super::store::{Chunk, ChunkStore, StoredChunk};
use crate::FrameError;

/// The particles of one section of the curve, not yet ordered.
#[derive(Debug)]
pub(super) struct UnorderedPart {
    pub(super) held: Vec<StoredChunk>,
    pub(super) len: usize,
    /// The cuts that made this part.
    pub(super) cuts: Arc<Cuts>,
    /// Number of divisions that led to this part.
    pub(super) depth: u32,
}

/// A part that is being filled.
#[derive(Debug, Default)]
struct Heap {
    held: Vec<StoredChunk>,
    len: usize,
    open: Option<Chunk>,
}

/// Records of a batch, sorted by part.
#[derive(Debug, Default)]
struct PartitionedBatch {
    positions: Vec<Vec3>,
    rows: Vec<u8>,
    /// Start of each part, and the end of the last one.
    starts: Vec<u32>,
    /// Part of each particle, in the order before the sort.
    parts: Vec<u16>,
}

/// Distributes the whole source over the parts of `cuts`.
pub(super) fn divide_source(
    output: &mut FrameOutput,
    cuts: Cuts,
    limits: &Limits,
    store: &ChunkStore,
) -> Result<Vec<UnorderedPart>, ConvertError> {
    let (request, columns) = (output.request, output.columns);
    let width = columns.width();
    let total = request.source.count();
    let stretches = total.div_ceil(limits.batch_len as u64);
    let (batches, stages) =
        (BufferPool::<Batch>::default(), BufferPool::<PartitionedBatch>::default());
    // Create an empty heap for each part
    let errors = Mutex::new(std::mem::take(&mut output.errors));
    let mut heaps: Vec<Heap> = (0..cuts.len()).map(|_| Heap::default()).collect();
    let mut first = 0;
    // Read, sort and append a window of batches at a time
    while first < stretches {
        let end = stretches.min(first + limits.window as u64);
        let staged = (first..end)
            .into_par_iter()
            .map(|number| {
                let (mut batch, mut staged) = (batches.take(), stages.take());
                let stretch = ParticleRange::nth(number, limits.batch_len, total);
                batch.read_positions(request.source, request.settings.origin, stretch)?;
                let mut own_errors = vec![0.0; columns.attributes.len()];
                batch.read_rows(request.source, columns, stretch, &mut own_errors)?;
                // Raise the errors of the attributes
                let mut errors = errors.lock().unwrap_or_else(|e| e.into_inner());
                for (all, own) in errors.iter_mut().zip(own_errors) {
                    *all = f64::max(*all, own);
                }
                drop(errors);
                staged.sort(&batch.positions, &batch.rows, width, &cuts);
                batches.put(batch);
                Ok(staged)
            })
            .collect::<Result<Vec<PartitionedBatch>, ConvertError>>()?;
        // Append the window in the order of the source
        append_all(&mut heaps, &staged, width, store)?;
        staged.into_iter().for_each(|s| stages.put(s));
        first = end;
        let done = total.min(first * limits.batch_len as u64);
        request.advance(Phase::Divide, done, total)?;
    }
    // Check that the source still has the surveyed number of particles
    output.errors = errors.into_inner().unwrap_or_else(|e| e.into_inner());
    let piles = closed(heaps, cuts, 1, store)?;
    let found: u64 = piles.iter().map(|pile| pile.len as u64).sum();
    if found != output.survey.count {
        return Err(request.changed());
    }
    Ok(piles)
}

/// Divides `pile` into smaller parts.
pub(super) fn divide_pile(
    pile: UnorderedPart,
    cuts: Cuts,
    width: usize,
    limits: &Limits,
    store: &ChunkStore,
) -> Result<Vec<UnorderedPart>, ConvertError> {
    // Create an empty heap for each part
    let stages = BufferPool::<PartitionedBatch>::default();
    let mut heaps: Vec<Heap> = (0..cuts.len()).map(|_| Heap::default()).collect();
    // Use as much memory for chunks as for a window of batches
    let together = (limits.window * limits.batch_len / store.chunk_len()).max(1);
    let mut held = pile.held.into_iter();
    // Sort and append a few chunks at a time
    loop {
        let some: Vec<StoredChunk> = held.by_ref().take(together).collect();
        if some.is_empty() {
            break;
        }
        let staged = some
            .into_par_iter()
            .map(|held| {
                let mut staged = stages.take();
                store.give_back(held, |chunk| {
                    staged.sort(&chunk.positions, &chunk.rows, width, &cuts);
                })?;
                Ok(staged)
            })
            .collect::<Result<Vec<PartitionedBatch>, FrameError>>()?;
        append_all(&mut heaps, &staged, width, store)?;
        staged.into_iter().for_each(|s| stages.put(s));
    }
    closed(heaps, cuts, pile.depth + 1, store)
}

fn append_all(
    heaps: &mut [Heap],
    staged: &[PartitionedBatch],
    width: usize,
    store: &ChunkStore,
) -> Result<(), FrameError> {
    heaps.par_iter_mut().enumerate().try_for_each(|(part, heap)| {
        staged.iter().try_for_each(|staged| heap.append(staged, staged.of(part), width, store))
    })
}

fn closed(
    heaps: Vec<Heap>,
    cuts: Cuts,
    depth: u32,
    store: &ChunkStore,
) -> Result<Vec<UnorderedPart>, ConvertError> {
    let cuts = Arc::new(cuts);
    let mut piles = Vec::with_capacity(heaps.len());
    for mut heap in heaps {
        if let Some(open) = heap.open.take() {
            heap.held.push(store.put(open)?);
        }
        piles.push(UnorderedPart {
            held: heap.held,
            len: heap.len,
            cuts: Arc::clone(&cuts),
            depth,
        });
    }
    store.settle()?;
    Ok(piles)
}

impl Heap {
    /// Appends records `range` of `staged`.
    fn append(
        &mut self,
        staged: &PartitionedBatch,
        mut range: Range<usize>,
        width: usize,
        store: &ChunkStore,
    ) -> Result<(), FrameError> {
        self.len += range.len();
        while !range.is_empty() {
            // Fill the open chunk
            let mut open = match self.open.take() {
                Some(open) => open,
                None => store.take()?,
            };
            let room = store.chunk_len() - open.positions.len();
            let end = range.end.min(range.start + room);
            let own = range.start..end;
            open.rows.extend_from_slice(&staged.rows[own.start * width..own.end * width]);
            open.positions.extend_from_slice(&staged.positions[own]);
            // Store the chunk when it is full
            if open.positions.len() == store.chunk_len() {
                self.held.push(store.put(open)?);
            } else {
                self.open = Some(open);
            }
            range.start = end;
        }
        Ok(())
    }
}

impl PartitionedBatch {
    /// Sorts the records by part; the order within each part stays.
    fn sort(&mut self, positions: &[Vec3], rows: &[u8], width: usize, cuts: &Cuts) {
        // Count the particles of each part
        self.parts.clear();
        self.starts.clear();
        self.starts.resize(cuts.len() + 1, 0);
        #[expect(clippy::cast_possible_truncation, reason = "at most 512 parts")]
        for position in positions {
            let part = cuts.part(*position);
            self.parts.push(part as u16);
            self.starts[part + 1] += 1;
        }
        // Turn the counts into starts
        for part in 0..cuts.len() {
            self.starts[part + 1] += self.starts[part];
        }
        self.positions.resize(positions.len(), Vec3::ZERO);
        self.rows.resize(rows.len(), 0);
        // Scatter the records: each start moves to the end of its part, which is the start of the next one
        for (number, part) in self.parts.iter().enumerate() {
            let slot = &mut self.starts[usize::from(*part)];
            let to = *slot as usize;
            *slot += 1;
            self.positions[to] = positions[number];
            if width > 0 {
                self.rows[to * width..][..width].copy_from_slice(&rows[number * width..][..width]);
            }
        }
        // Move the starts back
        self.starts.rotate_right(1);
        self.starts[0] = 0;
    }

    fn of(&self, part: usize) -> Range<usize> {
        self.starts[part] as usize..self.starts[part + 1] as usize
    }
}
