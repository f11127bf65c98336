//! A source that does not fit into memory: part after part is ordered and written while the next is loaded.

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

/// How often a part is divided again. Each time its curve is over its own particles alone; what is too large
/// then is cut anywhere, because nearly all of its particles are at one position.
const MOST_DIVISIONS: u32 = 8;
/// Particles of a pile that its quantiles are taken from.
const SAMPLE: usize = 1 << 14;

/// Counts for the report.
pub(super) struct PartCounts {
    pub(super) parts: usize,
    pub(super) spilled_bytes: u64,
}

/// Divides, orders and writes everything.
pub(super) fn convert(
    output: &mut FrameOutput,
    limits: &Limits,
    account: &MemoryAccount,
    clock: &mut Clock,
) -> Result<PartCounts, ConvertError> {
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
    let store = ChunkStore::new(settings, account);
    account.hold(limits.window_bytes as u64);
    let mut piles = divide_source(output, cuts, limits, &store)?;
    account.let_go(limits.window_bytes as u64);
    clock.lap(Phase::Divide);
    piles.reverse();
    let waiting = PartQueue {
        piles,
        width,
        limits,
        store: &store,
    };
    let parts = order_all(output, waiting, account)?;
    Ok(PartCounts {
        parts,
        spilled_bytes: store.spilled(),
    })
}

fn scratch_dir(output: &FrameOutput) -> PathBuf {
    let beside = || match output.asked.path.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    let wanted = output.asked.settings.scratch_dir.clone();
    wanted.unwrap_or_else(beside)
}

/// Parts that are still to be ordered.
struct PartQueue<'a> {
    /// The next one is the last.
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
    let (mut part, mut spare) = (
        PartData::with_room(room, width),
        PartData::with_room(room, width),
    );
    account.hold(part.bytes() + spare.bytes());
    let mut ordered = OrderedPart::with_room(room, width);
    let mut carried = PartData::default();
    let mut parts = 0;
    let Some(mut pile) = waiting.next()? else {
        return Ok(0);
    };
    load(&mut pile, store, &mut part)?;
    loop {
        part.prepend(&mut carried);
        let next = waiting.next()?;
        if next.is_some() {
            carried = carry_last(&mut part, &pile.cuts.curve, width, unit);
        }
        let loaded = thread::scope(|scope| {
            let loader = next.map(|mut next| {
                let spare = &mut spare;
                scope.spawn(move || load(&mut next, store, spare).map(|()| next))
            });
            let written = write(output, &part, &mut ordered, account);
            let loaded = loader.map(|loader| {
                loader
                    .join()
                    .unwrap_or_else(|fault| panic::resume_unwind(fault))
            });
            written.and(Ok(loaded.transpose()?))
        })?;
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
    /// The next part, small enough to be ordered.
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
        if pile.depth < MOST_DIVISIONS {
            let sample = self.sample(&mut pile)?;
            let parts = pile.len.div_ceil(self.limits.aimed_len());
            let cuts = Cuts::quantiles(&sample, parts.clamp(2, self.limits.parts));
            if cuts.len() > 1 {
                return divide_pile(pile, cuts, self.width, self.limits, self.store);
            }
        }
        Ok(cut(pile, self.limits.part_len))
    }

    /// Some of the positions of `pile`, spread evenly.
    fn sample(&self, pile: &mut UnorderedPart) -> Result<Vec<Vec3>, ConvertError> {
        let each = (pile.len / SAMPLE).max(1);
        let mut sample = Vec::with_capacity(pile.len / each + pile.held.len());
        // Chunks that are away are read for this; there are few such parts.
        for held in &pile.held {
            self.store.look(held, |chunk| {
                sample.extend(chunk.positions.iter().step_by(each));
            })?;
        }
        Ok(sample)
    }
}

/// Pieces of `pile` of up to `most` particles, as it comes.
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
