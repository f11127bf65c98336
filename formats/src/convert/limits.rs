//! Divides the memory of a conversion among its stages.

use super::settings::ConvertSettings;
use crate::order::kd;

/// Largest number of particles that are ordered together when all of them fit into memory. Their indices have
/// 32 bits, and ordering more at once gives no better tree.
const LARGEST_WHOLE: u64 = 1 << 26;
/// Largest number of particles of a part, about 200 MiB. One run each of 10^8 particles took 11.6 s, and 13.5 s
/// with twice this number.
const LARGEST_PART: usize = 1 << 22;
const SMALLEST_PART: usize = 1 << 12;
/// Largest number of particles that are gathered, encoded and written together.
const LARGEST_RUN: usize = 1 << 18;
/// Largest number of particles that one thread reads at once, so that its buffers stay in the cache.
const LARGEST_BATCH: usize = 1 << 14;
/// Largest number of records in a chunk.
const LARGEST_CHUNK: usize = 1 << 16;
const SMALLEST_CHUNK: usize = 1 << 8;
/// Largest number of parts that one division makes; larger parts are divided again.
const MAX_PARTS: u64 = 512;
/// Largest number of particles in the sample for the quantiles of a division.
const LARGEST_SAMPLE: u64 = 1 << 19;

/// The numbers of particles, bytes and chunks that keep a conversion within its memory limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Limits {
    /// Whether all particles are ordered together.
    pub(super) is_whole: bool,
    /// Largest number of particles in a part.
    pub(super) part_len: usize,
    /// Particles of a run that is written at once, a multiple of 1024.
    pub(super) run_len: usize,
    /// Particles that a thread reads at once.
    pub(super) batch_len: usize,
    /// Batches that are distributed over parts together.
    pub(super) window: usize,
    /// Bytes of the batches of a window.
    pub(super) window_bytes: usize,
    /// Records of a chunk.
    pub(super) chunk_len: usize,
    /// Chunks that may be in memory.
    pub(super) chunks: usize,
    /// Largest number of parts that one division makes.
    pub(super) parts: usize,
    /// Particles in the sample for quantiles.
    pub(super) sample_len: u64,
}

/// Bytes per particle while a part is ordered: positions before and after, cells, samples and tables of the
/// order; with rows, also the rows and the particle indices.
const fn order_bytes(width: usize) -> usize {
    let followed = if width > 0 { size_of::<u32>() + width } else { 0 };
    34 + followed
}

/// Bytes per particle between the source and the file: codes and data that waits to be written.
const fn run_bytes(width: usize) -> usize {
    64 + 6 * width
}

impl Limits {
    /// The smallest limits, which keep nothing in memory.
    pub(super) const SMALLEST: Self = Self {
        is_whole: false,
        part_len: 1024,
        run_len: 1024,
        batch_len: 256,
        window: 2,
        window_bytes: 0,
        chunk_len: SMALLEST_CHUNK,
        chunks: 0,
        parts: 8,
        sample_len: 1024,
    };

    /// The limits for `count` particles with rows of `width` bytes. `widest` is the largest number of bytes
    /// that the source has for one attribute of a particle.
    pub(super) fn of(settings: &ConvertSettings, count: u64, width: usize, widest: usize) -> Self {
        let bytes = settings.memory.max(ConvertSettings::MIN_MEMORY);
        let memory = usize::try_from(bytes).unwrap_or(usize::MAX);
        let record = 12 + width;
        // Size the parts: one part is ordered while the next one is loaded
        let part_bytes = order_bytes(width) + record;
        let part_len = (memory / 8 / part_bytes).clamp(SMALLEST_PART, LARGEST_PART) / 1024 * 1024;
        // Size the runs and the batches
        let run_len = (memory / 16 / run_bytes(width)).clamp(8192, LARGEST_RUN) / 1024 * 1024;
        let batch_bytes = 24 + widest + 4 + 2 * record + 4;
        let window = (4 * rayon::current_num_threads()).clamp(16, 64);
        let batch_len = (memory / 16 / window / batch_bytes).clamp(256, LARGEST_BATCH);
        // Size the parts of a division and the chunks
        let aimed = aimed(part_len) as u64;
        let parts = count.div_ceil(aimed).clamp(2, MAX_PARTS) as usize;
        let chunk_len =
            (memory / 32 / parts / record).clamp(SMALLEST_CHUNK, LARGEST_CHUNK).min(part_len / 2);
        let window_bytes = window * batch_len * batch_bytes;
        let fixed = part_len * part_bytes + run_len * run_bytes(width) + window_bytes + memory / 32;
        let chunks = memory.saturating_sub(fixed) / (chunk_len * record);
        // Find out whether all particles fit at once
        let whole = count.saturating_mul(order_bytes(width) as u64);
        let beside = run_len * run_bytes(width) + memory / 16;
        Self {
            is_whole: count <= LARGEST_WHOLE && whole <= memory.saturating_sub(beside) as u64,
            part_len,
            run_len,
            batch_len,
            window,
            window_bytes,
            chunk_len,
            chunks,
            parts,
            sample_len: (memory as u64 / 1024).min(LARGEST_SAMPLE),
        }
    }

    /// The number of particles that a division aims at for a part. It is below the limit because quantiles of a
    /// sample are approximate and because the part before hands some particles on.
    pub(super) fn aimed_len(&self) -> usize {
        aimed(self.part_len)
    }

    /// Parts begin at multiples of this number, so that each node above the blocks is in one part. It is a power of 8
    /// blocks, chosen so that a part still has many of them.
    pub(super) fn unit(&self) -> usize {
        let mut unit = 1024;
        while unit * 8 * 64 <= self.part_len {
            unit *= 8;
        }
        unit
    }
}

fn aimed(part_len: usize) -> usize {
    part_len / 8 * 7
}

const _: () = assert!(kd::CELL_LEN >= SMALLEST_PART, "the smallest part is one cell of the order");
