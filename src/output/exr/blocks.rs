//! Packed blocks into a file, and a whole film packed on all threads that are idle.
//!
//! The thread that writes also packs. Threads of the current pool help when they come to it: nothing waits for
//! a pool that is busy tracing the next frame. A few bands at most are in memory as packed blocks.

use std::any::Any;
use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::{ChunksWriter, write_chunks_with};
use exr::prelude::SmallVec;

use super::OutputError;
use super::layout::ExrLayout;
use super::pack::{PackBuffers, PackedBlock, pack_block};
use crate::render::Film;

/// Writes the file of `layout`, block by block as `blocks` gives them: all blocks of the image from the top.
/// Returns [`super::EncodedExr::clamped`].
///
/// # Errors
/// If a block could not be packed, one is missing, or `file` fails.
pub fn write_blocks(
    file: &mut (impl Write + Seek),
    layout: &ExrLayout,
    blocks: impl IntoIterator<Item = Result<PackedBlock, OutputError>>,
) -> Result<u64, OutputError> {
    let mut clamped = 0;
    // The writer knows errors of its own kind alone.
    let mut failure = None;
    let headers = SmallVec::from_iter([layout.header.clone()]);
    let written = write_chunks_with(file, headers, true, |_, writer| {
        let blocks = blocks.into_iter().map_while(|block| match block {
            Ok(block) => Some(block),
            Err(error) => {
                failure = Some(error);
                None
            }
        });
        for (index, block) in blocks.enumerate() {
            clamped += block.clamped;
            writer.write_chunk(index, chunk(block))?;
        }
        Ok(())
    });
    match failure {
        Some(error) => Err(error),
        None => written.map(|()| clamped).map_err(OutputError::Exr),
    }
}

fn chunk(block: PackedBlock) -> Chunk {
    Chunk {
        layer_index: 0,
        compressed_block: CompressedBlock::ScanLine(CompressedScanLineBlock {
            y_coordinate: i32::try_from(block.y).expect("images have at most 65536 rows"),
            compressed_pixels_le: block.bytes,
        }),
    }
}

/// Writes `film` with the help of the current pool, and gives it back for another frame. The bytes are the same
/// with any number of threads.
///
/// # Errors
/// As [`write_blocks`].
pub(super) fn write_film(
    film: Film,
    layout: ExrLayout,
    file: &mut (impl Write + Seek),
) -> Result<(Film, u64), OutputError> {
    let job = Arc::new(PackJob::new(film, layout));
    let clamped = write_blocks(file, &job.layout, PackedInOrder::new(&job));
    // Whoever comes to help from now on finds nothing to do.
    let film = job
        .film
        .write()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    let film = film.expect("only this function takes the film");
    clamped.map(|clamped| (film, clamped))
}

/// The blocks of one band, or why there are none.
type PackedBand = Result<Vec<PackedBlock>, OutputError>;

/// A film being packed, band by band.
struct PackJob {
    layout: ExrLayout,
    /// Until it is written.
    film: RwLock<Option<Film>>,
    bands: usize,
    /// Bands that may be in hand or packed and not yet written.
    most_in_hand: usize,
    helpers: usize,
    queue: Mutex<Queue>,
    /// Tells that a helper has packed a band.
    is_packed: Condvar,
}

#[derive(Default)]
struct Queue {
    /// The next band to be packed.
    next: usize,
    /// The next band to be written.
    wanted: usize,
    /// Packed, not yet written; or what a helper panicked with.
    packed: BTreeMap<usize, Result<PackedBand, Box<dyn Any + Send>>>,
    /// Those of helpers, as many as there were at once.
    buffers: Vec<PackBuffers>,
    /// Helpers called that have not gone again; of a busy pool, those that have not come yet too.
    helpers: usize,
}

impl PackJob {
    fn new(film: Film, layout: ExrLayout) -> Self {
        let threads = rayon::current_num_threads();
        Self {
            bands: film.height.div_ceil(layout.rows_per_band()) as usize,
            most_in_hand: threads + 2,
            helpers: threads - 1,
            layout,
            film: RwLock::new(Some(film)),
            queue: Mutex::default(),
            is_packed: Condvar::new(),
        }
    }

    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the next band to pack, if there is one and room for it.
    fn take(&self, queue: &mut Queue) -> Option<usize> {
        let band = queue.next;
        let is_room = band < self.bands.min(queue.wanted + self.most_in_hand);
        is_room.then(|| {
            queue.next += 1;
            band
        })
    }

    /// Packs a band; None if the film is written or given up.
    fn pack(&self, band: usize, buffers: &mut PackBuffers) -> Option<PackedBand> {
        let film = self.film.read().unwrap_or_else(PoisonError::into_inner);
        let rows = self.layout.rows_per_band();
        let top = u32::try_from(band).expect("fewer bands than rows") * rows;
        let band = film.as_ref()?.rows().part(top, rows);
        let blocks = self.layout.blocks(band);
        Some(
            blocks
                .map(|block| pack_block(&block, &self.layout, buffers))
                .collect(),
        )
    }

    /// Packs a band, if there is one to take. One only: a thread that waits for others that trace gets here too,
    /// and is soon wanted again.
    fn help(&self) {
        let mut queue = self.queue();
        if let Some(band) = self.take(&mut queue) {
            let mut buffers = queue.buffers.pop().unwrap_or_default();
            drop(queue);
            let packed = catch_unwind(AssertUnwindSafe(|| self.pack(band, &mut buffers)));
            queue = self.queue();
            queue.buffers.push(buffers);
            if let Some(packed) = packed.transpose() {
                queue.packed.insert(band, packed);
                self.is_packed.notify_all();
            }
        }
        queue.helpers -= 1;
    }

    /// Calls as many helpers as there is work for.
    fn call_helpers(self: &Arc<Self>, queue: &mut Queue) {
        let end = self.bands.min(queue.wanted + self.most_in_hand);
        // One band is for who calls.
        let useful = end.saturating_sub(queue.next + 1).min(self.helpers);
        while queue.helpers < useful {
            queue.helpers += 1;
            let job = Arc::clone(self);
            rayon::spawn(move || job.help());
        }
    }
}

/// All blocks of a film from the top, packed here where no helper has.
struct PackedInOrder<'a> {
    job: &'a Arc<PackJob>,
    buffers: PackBuffers,
    /// The rest of the band that is being written.
    band: std::vec::IntoIter<PackedBlock>,
}

impl<'a> PackedInOrder<'a> {
    fn new(job: &'a Arc<PackJob>) -> Self {
        Self {
            job,
            buffers: PackBuffers::default(),
            band: Vec::new().into_iter(),
        }
    }

    fn next_band(&mut self) -> Option<PackedBand> {
        let job = self.job;
        let mut queue = job.queue();
        while queue.wanted < job.bands {
            let wanted = queue.wanted;
            if let Some(packed) = queue.packed.remove(&wanted) {
                queue.wanted += 1;
                job.call_helpers(&mut queue);
                return Some(packed.unwrap_or_else(|panic| resume_unwind(panic)));
            }
            queue = match job.take(&mut queue) {
                Some(band) => {
                    job.call_helpers(&mut queue);
                    drop(queue);
                    let packed = job.pack(band, &mut self.buffers)?;
                    let mut queue = job.queue();
                    queue.packed.insert(band, Ok(packed));
                    queue
                }
                // Whoever has it works on it.
                None => job
                    .is_packed
                    .wait(queue)
                    .unwrap_or_else(PoisonError::into_inner),
            };
        }
        None
    }
}

impl Iterator for PackedInOrder<'_> {
    type Item = Result<PackedBlock, OutputError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(block) = self.band.next() {
                return Some(Ok(block));
            }
            match self.next_band()? {
                Ok(band) => self.band = band.into_iter(),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
