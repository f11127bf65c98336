//! How the memory of a conversion is shared out.

use super::settings::ConvertSettings;
use crate::order::kd;

/// Most particles that are ordered together when all of them fit into memory: their indices have 32 bits, and a
/// longer order is no better.
const LARGEST_WHOLE: u64 = 1 << 26;
/// Most particles of a part: some 200 MiB. One run each of 10^8 took 11.6 s, and 13.5 s with twice as many.
const LARGEST_PART: usize = 1 << 22;
const SMALLEST_PART: usize = 1 << 12;
/// Most particles that are gathered, coded and written together.
const LARGEST_RUN: usize = 1 << 18;
/// Particles that one thread reads at once: what it needs for them stays in its cache.
const LARGEST_BATCH: usize = 1 << 14;
/// Most records of a chunk.
const LARGEST_CHUNK: usize = 1 << 16;
const SMALLEST_CHUNK: usize = 1 << 8;
/// Most parts that a division makes; larger parts are divided again.
const MOST_PARTS: u64 = 512;
/// Most particles that the quantiles of a division are taken from.
const LARGEST_SAMPLE: u64 = 1 << 19;

/// Numbers of particles, bytes and chunks that keep a conversion within its memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Limits {
    /// Whether all particles are ordered together.
    pub(super) is_whole: bool,
    /// Most particles of a part.
    pub(super) part_len: usize,
    /// Particles of a run that goes to the file, a multiple of 1024.
    pub(super) run_len: usize,
    /// Particles that are read at once by a thread.
    pub(super) batch_len: usize,
    /// Batches that are brought into parts together.
    pub(super) window: usize,
    /// Bytes that these take.
    pub(super) window_bytes: usize,
    /// Records of a chunk.
    pub(super) chunk_len: usize,
    /// Chunks that may be in memory.
    pub(super) chunks: usize,
    /// Most parts that one division makes.
    pub(super) parts: usize,
    /// Particles that quantiles are taken from.
    pub(super) sample_len: u64,
}

/// Bytes of a particle while a part is ordered: positions before and after, cells, samples and tables of the
/// order, and where there are rows, these and the particles' numbers.
const fn order_bytes(width: usize) -> usize {
    let followed = if width > 0 {
        size_of::<u32>() + width
    } else {
        0
    };
    34 + followed
}

/// Bytes of a particle on its way from the source to the file: codes and what waits to be written.
const fn run_bytes(width: usize) -> usize {
    64 + 6 * width
}

impl Limits {
    /// The smallest of all, and nothing stays in memory.
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

    /// For `count` particles with rows of `width` bytes, of which the source has up to `widest` bytes for one
    /// attribute.
    pub(super) fn of(settings: &ConvertSettings, count: u64, width: usize, widest: usize) -> Self {
        let memory = settings.memory.max(ConvertSettings::LEAST_MEMORY);
        let memory = usize::try_from(memory).unwrap_or(usize::MAX);
        let record = 12 + width;
        // A part is ordered while the next one is loaded.
        let part_bytes = order_bytes(width) + record;
        let part_len = (memory / 8 / part_bytes).clamp(SMALLEST_PART, LARGEST_PART) / 1024 * 1024;
        let run_len = (memory / 16 / run_bytes(width)).clamp(8192, LARGEST_RUN) / 1024 * 1024;
        let batch_bytes = 24 + widest + 4 + 2 * record + 4;
        let window = (4 * rayon::current_num_threads()).clamp(16, 64);
        let batch_len = (memory / 16 / window / batch_bytes).clamp(256, LARGEST_BATCH);
        let aimed = aimed(part_len) as u64;
        let parts = count.div_ceil(aimed).clamp(2, MOST_PARTS) as usize;
        let chunk_len = (memory / 32 / parts / record).clamp(SMALLEST_CHUNK, LARGEST_CHUNK);
        let chunk_len = chunk_len.min(part_len / 2);
        let window_bytes = window * batch_len * batch_bytes;
        let fixed = part_len * part_bytes + run_len * run_bytes(width) + window_bytes + memory / 32;
        let chunks = memory.saturating_sub(fixed) / (chunk_len * record);
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

    /// Particles that a division wants in a part: a sample tells quantiles but roughly, and some particles are
    /// handed on from the part before.
    pub(super) fn aimed_len(&self) -> usize {
        aimed(self.part_len)
    }

    /// Parts begin at multiples of this, so that the nodes above blocks are cells of one part: a power of 8
    /// blocks, the largest of which a part still has many.
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

const _: () = assert!(
    kd::CELL_LEN >= SMALLEST_PART,
    "the smallest part is one cell of the order"
);
