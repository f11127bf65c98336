//! Writes packed blocks to a file, and packs the blocks of a whole film on all idle threads.
//!
//! The writing thread also packs. Threads of the current pool help when they are idle, and the writing thread never
//! waits for a pool that is busy with tracing the next frame. Only a few bands are in memory as packed blocks at a
//! time.

use std::any::Any;
use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};

use super::file::ScanLineFile;
use super::layout::ExrLayout;
use super::pack::{PackBuffers, PackedBlock, pack_block};
use super::{Compression, ExrOptions, OutputError};
use crate::render::Film;

/// Writes an image with `layout` to `file`, block by block. `blocks` are all blocks of the image, from top to bottom.
/// Returns the number of clamped values, [`super::EncodedExr::clamped`].
///
/// # Errors
/// If a block could not be packed, one is missing, or `file` cannot be written.
pub fn write_blocks(
    file: &mut (impl Write + Seek),
    layout: &ExrLayout,
    blocks: impl IntoIterator<Item = Result<PackedBlock, OutputError>>,
) -> Result<u64, OutputError> {
    let mut clamped = 0;
    let mut file = ScanLineFile::start(file, layout)?;
    for block in blocks {
        let block = block?;
        clamped += block.clamped;
        file.write(block)?;
    }
    file.finish()?;
    Ok(clamped)
}

/// Writes `film` with the help of the current pool. Returns it, so that another frame can reuse its memory, and the
/// number of clamped values. The bytes do not depend on the number of threads.
///
/// # Errors
/// Same as [`write_blocks`].
pub(super) fn write_film(
    film: Film,
    layout: ExrLayout,
    file: &mut (impl Write + Seek),
) -> Result<(Film, u64), OutputError> {
    let job = Arc::new(PackJob::new(film, layout));
    let clamped = write_blocks(file, &job.layout, PackedInOrder::new(&job));
    // Take the film back; helpers that start later find nothing to do
    let taken = job.film.write().unwrap_or_else(PoisonError::into_inner).take();
    let film = taken.expect("only this function takes the film");
    clamped.map(|clamped| (film, clamped))
}

/// The part of a band that is left after compression, in quarters: what noisy images with few samples have.
const PACKED_QUARTERS: u64 = 3;

/// Memory for encoding a film with so many bytes of `channels`, without the film itself: each thread packs a band, and
/// one more each waits to be written.
pub fn encoder_bytes(channels: u64, width: u32, height: u32, options: &ExrOptions) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    // Colours are in half precision
    let samples = channels - 8 * pixels;
    let band_rows = u64::from(options.rows_per_band());
    let rows = u64::from(height).max(1);
    let band = band_rows.min(rows) * samples / rows;
    let packed = match options.compression {
        Compression::None => band,
        _ => PACKED_QUARTERS * band / 4,
    };
    let threads = rayon::current_num_threads() as u64;
    let busy = threads.min(rows.div_ceil(band_rows));
    busy * PackBuffers::predicted_bytes(band, packed) + (busy + 1) * packed
}

/// The blocks of one band, or the reason why it could not be packed.
type PackedBand = Result<Vec<PackedBlock>, OutputError>;

/// A film that is being packed, band by band.
struct PackJob {
    layout: ExrLayout,
    /// None after [`write_film`] has taken the film back.
    film: RwLock<Option<Film>>,
    band_count: usize,
    /// Maximum number of bands that are being packed, or packed and not written yet.
    max_in_flight: usize,
    max_helpers: usize,
    queue: Mutex<Queue>,
    /// Notified when a helper has packed a band.
    band_packed: Condvar,
}

#[derive(Default)]
struct Queue {
    /// The next band to pack.
    next_pack: usize,
    /// The next band to write.
    next_write: usize,
    /// Bands that are packed and not written yet, or the payload of a helper's panic.
    packed: BTreeMap<usize, Result<PackedBand, Box<dyn Any + Send>>>,
    /// Buffers of helpers, one for each that has worked at the same time.
    buffers: Vec<PackBuffers>,
    /// Number of helpers that were spawned and have not ended. In a busy pool, some of them have not started yet.
    helper_count: usize,
}

impl PackJob {
    fn new(film: Film, layout: ExrLayout) -> Self {
        let threads = rayon::current_num_threads();
        Self {
            band_count: film.height.div_ceil(layout.rows_per_band()) as usize,
            max_in_flight: threads + 2,
            max_helpers: threads - 1,
            layout,
            film: RwLock::new(Some(film)),
            queue: Mutex::default(),
            band_packed: Condvar::new(),
        }
    }

    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Claims the next band to pack; None if there is none or too many bands are in flight.
    fn claim_band(&self, queue: &mut Queue) -> Option<usize> {
        let band = queue.next_pack;
        let may_pack = band < self.band_count.min(queue.next_write + self.max_in_flight);
        may_pack.then(|| {
            queue.next_pack += 1;
            band
        })
    }

    /// Packs a band; None if the film has been taken back, because it is written or writing has failed.
    fn pack(&self, band: usize, buffers: &mut PackBuffers) -> Option<PackedBand> {
        let film = self.film.read().unwrap_or_else(PoisonError::into_inner);
        let rows = self.layout.rows_per_band();
        let top = u32::try_from(band).expect("fewer bands than rows") * rows;
        let band = film.as_ref()?.rows().part(top, rows);
        let blocks = self.layout.blocks(band);
        Some(blocks.map(|block| pack_block(&block, &self.layout, buffers)).collect())
    }

    /// Packs at most one band. Only one, because a thread may also get here while it waits for tracing threads, and
    /// should soon continue with tracing.
    fn help(&self) {
        let mut queue = self.queue();
        if let Some(band) = self.claim_band(&mut queue) {
            let mut buffers = queue.buffers.pop().unwrap_or_default();
            drop(queue);
            let packed = catch_unwind(AssertUnwindSafe(|| self.pack(band, &mut buffers)));
            queue = self.queue();
            queue.buffers.push(buffers);
            if let Some(packed) = packed.transpose() {
                queue.packed.insert(band, packed);
                self.band_packed.notify_all();
            }
        }
        queue.helper_count -= 1;
    }

    /// Spawns as many helpers as there are bands for them.
    fn spawn_helpers(self: &Arc<Self>, queue: &mut Queue) {
        let end = self.band_count.min(queue.next_write + self.max_in_flight);
        // The calling thread packs one band itself
        let useful = end.saturating_sub(queue.next_pack + 1).min(self.max_helpers);
        while queue.helper_count < useful {
            queue.helper_count += 1;
            let job = Arc::clone(self);
            rayon::spawn(move || job.help());
        }
    }
}

/// Iterates over all blocks of a film from top to bottom. Packs those that no helper has claimed.
struct PackedInOrder<'a> {
    job: &'a Arc<PackJob>,
    buffers: PackBuffers,
    /// The remaining blocks of the band that is being written.
    band: std::vec::IntoIter<PackedBlock>,
}

impl<'a> PackedInOrder<'a> {
    fn new(job: &'a Arc<PackJob>) -> Self {
        Self { job, buffers: PackBuffers::default(), band: Vec::new().into_iter() }
    }

    fn next_band(&mut self) -> Option<PackedBand> {
        let job = self.job;
        let mut queue = job.queue();
        while queue.next_write < job.band_count {
            // Return the next band if it is packed
            let next = queue.next_write;
            if let Some(packed) = queue.packed.remove(&next) {
                queue.next_write += 1;
                job.spawn_helpers(&mut queue);
                return Some(packed.unwrap_or_else(|panic| resume_unwind(panic)));
            }
            // Otherwise pack a band, or wait for one
            queue = match job.claim_band(&mut queue) {
                Some(band) => {
                    job.spawn_helpers(&mut queue);
                    drop(queue);
                    let packed = job.pack(band, &mut self.buffers)?;
                    let mut queue = job.queue();
                    queue.packed.insert(band, Ok(packed));
                    queue
                }
                // A helper is packing it
                None => job.band_packed.wait(queue).unwrap_or_else(PoisonError::into_inner),
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
