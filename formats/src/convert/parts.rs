//! Converts a source that does not fit into memory: one part is ordered and written while the next one is loaded.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{panic, thread};

use glam::Vec3;

use super::Clock;
use super::account::MemoryAccount;
use super::carry::carry_last;
use super::curve::Cuts;
use super::divide::{UnorderedPart, divide_pile, divide_source};
use super::limits::Limits;
use super::order::{OrderedPart, PartData};
use super::output::FrameOutput;
use super::settings::{ConvertError, Phase};
use super::store::{ChunkStore, StoreSettings};
use crate::FrameError;

/// Largest number of times that a part is divided. Each division spans its curve over the particles of this
/// part alone. A part that is still too large is cut at any place, because nearly all of its particles are at
/// one position.
const MAX_DIVISIONS: u32 = 8;
/// Sampled particles of a part that is divided again.
const SAMPLE: usize = 1 << 14;

/// Counts for the report.
pub(super) struct PartCounts {
    pub(super) parts: usize,
    pub(super) spilled_bytes: u64,
}

/// Divides, orders and writes all particles.
pub(super) fn convert(
    output: &mut FrameOutput,
    limits: &Limits,
    account: &MemoryAccount,
    clock: &mut Clock,
) -> Result<PartCounts, ConvertError> {
    // Choose the cuts from the sample of the survey
    let width = output.columns.width();
    let count = usize::try_from(output.survey.count).unwrap_or(usize::MAX);
    let parts = count.div_ceil(limits.aimed_len()).clamp(1, limits.parts);
    let cuts = Cuts::quantiles(&output.survey.sample, parts);
    let settings = StoreSettings {
        chunk_len: limits.chunk_len,
        width,
        chunks: limits.chunks,
        open: cuts.len(),
        dir: scratch_dir(output),
    };
    // Divide the source into parts
    let store = ChunkStore::new(settings, account);
    account.hold(limits.window_bytes as u64);
    let mut piles = divide_source(output, cuts, limits, &store)?;
    account.let_go(limits.window_bytes as u64);
    clock.lap(Phase::Divide);
    // Order and write the parts
    piles.reverse();
    let waiting = PartQueue { piles, width, limits, store: &store };
    let parts = order_all(output, waiting, account)?;
    Ok(PartCounts { parts, spilled_bytes: store.spilled() })
}

fn scratch_dir(output: &FrameOutput) -> PathBuf {
    let beside = || match output.request.path.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    let requested = output.request.settings.scratch_dir.clone();
    requested.unwrap_or_else(beside)
}

/// Parts that wait to be ordered.
struct PartQueue<'a> {
    /// In reverse order: the next part is the last entry.
    piles: Vec<UnorderedPart>,
    width: usize,
    limits: &'a Limits,
    store: &'a ChunkStore<'a>,
}

fn order_all(
    output: &mut FrameOutput,
    mut waiting: PartQueue,
    account: &MemoryAccount,
) -> Result<usize, ConvertError> {
    let store = waiting.store;
    let unit = waiting.limits.unit();
    let room = waiting.limits.part_len + unit;
    let width = waiting.width;
    // Allocate two parts, to load one while the other is written
    let (mut part, mut spare) =
        (PartData::with_room(room, width), PartData::with_room(room, width));
    account.hold(part.bytes() + spare.bytes());
    let mut ordered = OrderedPart::with_room(room, width);
    let mut carried = PartData::default();
    let mut parts = 0;
    // Load the first part
    let Some(mut pile) = waiting.next()? else {
        return Ok(0);
    };
    load(&mut pile, store, &mut part)?;
    loop {
        // Hand particles beyond whole nodes on to the next part
        part.prepend(&mut carried);
        let next = waiting.next()?;
        if next.is_some() {
            carried = carry_last(&mut part, &pile.cuts.curve, width, unit);
        }
        // Write this part while a thread loads the next one
        let loaded = thread::scope(|scope| {
            let loader = next.map(|mut next| {
                let spare = &mut spare;
                scope.spawn(move || load(&mut next, store, spare).map(|()| next))
            });
            let written = write(output, &part, &mut ordered, account);
            let loaded = loader
                .map(|loader| loader.join().unwrap_or_else(|fault| panic::resume_unwind(fault)));
            written.and(Ok(loaded.transpose()?))
        })?;
        // Go on with the loaded part
        parts += usize::from(part.len() > 0);
        match loaded {
            Some(next) => pile = next,
            None => return Ok(parts),
        }
        std::mem::swap(&mut part, &mut spare);
        spare.clear();
    }
}

fn write(
    output: &mut FrameOutput,
    part: &PartData,
    ordered: &mut OrderedPart,
    account: &MemoryAccount,
) -> Result<(), ConvertError> {
    if part.len() == 0 {
        return Ok(());
    }
    ordered.order(part, account);
    output.push(part, ordered)
}

fn load(
    pile: &mut UnorderedPart,
    store: &ChunkStore,
    part: &mut PartData,
) -> Result<(), FrameError> {
    let mut held = pile.held.drain(..);
    held.try_for_each(|held| store.load(held, part))
}

impl PartQueue<'_> {
    /// The next part that is small enough to be ordered.
    fn next(&mut self) -> Result<Option<UnorderedPart>, ConvertError> {
        while let Some(pile) = self.piles.pop() {
            if pile.len == 0 {
                continue;
            }
            if pile.len <= self.limits.part_len {
                return Ok(Some(pile));
            }
            let smaller = self.divided(pile)?;
            self.piles.extend(smaller.into_iter().rev());
        }
        Ok(None)
    }

    fn divided(&self, mut pile: UnorderedPart) -> Result<Vec<UnorderedPart>, ConvertError> {
        if pile.depth < MAX_DIVISIONS {
            let sample = self.sample(&mut pile)?;
            let parts = pile.len.div_ceil(self.limits.aimed_len());
            let cuts = Cuts::quantiles(&sample, parts.clamp(2, self.limits.parts));
            if cuts.len() > 1 {
                return divide_pile(pile, cuts, self.width, self.limits, self.store);
            }
        }
        Ok(cut(pile, self.limits.part_len))
    }

    /// An evenly spread sample of the positions of `pile`.
    fn sample(&self, pile: &mut UnorderedPart) -> Result<Vec<Vec3>, ConvertError> {
        let each = (pile.len / SAMPLE).max(1);
        let mut sample = Vec::with_capacity(pile.len / each + pile.held.len());
        // This reads spilled chunks too; few parts need it.
        for held in &pile.held {
            self.store.peek(held, |chunk| {
                sample.extend(chunk.positions.iter().step_by(each));
            })?;
        }
        Ok(sample)
    }
}

/// Cuts `pile` into pieces of at most `most` particles, in the order of its chunks.
fn cut(pile: UnorderedPart, most: usize) -> Vec<UnorderedPart> {
    let mut pieces: Vec<UnorderedPart> = Vec::new();
    for held in pile.held {
        let len = held.len();
        match pieces.last_mut() {
            Some(piece) if piece.len + len <= most => {
                piece.len += len;
                piece.held.push(held);
            }
            _ => pieces.push(UnorderedPart {
                held: vec![held],
                len,
                cuts: Arc::clone(&pile.cuts),
                depth: pile.depth,
            }),
        }
    }
    pieces
}
