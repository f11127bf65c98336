//! Claims: what one worker alone has in hand.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use super::files::{link_alone, remove};
use super::{Card, Desk, Standing};
use crate::{Status, open_regular};

/// What came of asking for a claim.
#[derive(Debug)]
pub enum Claimed {
    /// It is ours until it is dropped.
    Mine(Claim),
    /// Another worker has it: who, for people.
    Held(String),
    /// Another worker has ended the frame since this one began.
    Ended(Status),
}

/// Something that this worker alone has in hand. Dropped, another one may take it.
#[derive(Debug)]
pub struct Claim {
    desk: Arc<Desk>,
    name: String,
    generation: u32,
    is_over: bool,
}

/// More dead workers at one frame than any job can have.
const MOST_GENERATIONS: u32 = 1 << 20;

impl Claim {
    /// Claims `name`; `Held` if a living worker has it.
    pub(super) fn take(desk: &Arc<Desk>, name: String) -> io::Result<Claimed> {
        let mut generation = 0;
        while generation < MOST_GENERATIONS {
            let path = desk.work.join(file_name(&name, generation));
            if link_alone(&desk.card_path, &path, &desk.text)? {
                let claim = Self::of(desk, name, generation);
                return Ok(match claim.rival() {
                    None => Claimed::Mine(claim),
                    Some(rival) => Claimed::Held(rival.told()),
                });
            }
            let (standing, card) = match Card::read(&path) {
                Ok(Some(card)) => (desk.watch.standing(&desk.work, &card), Some(card)),
                Ok(None) => (desk.watch.signs(&path), None),
                // Given back in between: once more.
                Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
                // Whatever it is, it is in the way like a claim that cannot be read. No worker makes
                // anything but files, so nobody else is behind a pipe or a directory.
                Err(_) => (desk.watch.signs(&path), None),
            };
            match (standing, card) {
                // A network may lose the answer to a request that was done, and ask again.
                (_, Some(card)) if card.worker == desk.card.worker => {
                    return Ok(Claimed::Mine(Self::of(desk, name, generation)));
                }
                (Standing::Alive, card) => {
                    let who = card.map_or_else(|| "another process".to_owned(), |c| c.told());
                    return Ok(Claimed::Held(who));
                }
                (Standing::Silent, Some(card)) => desk.bury(&card)?,
                (Standing::Ended | Standing::Silent, _) => {}
            }
            generation += 1;
        }
        Err(io::Error::other("too many dead claims; remove job.work"))
    }

    fn of(desk: &Arc<Desk>, name: String, generation: u32) -> Self {
        Self {
            desk: Arc::clone(desk),
            name,
            generation,
            is_over: false,
        }
    }

    /// A living worker with a claim of another generation. There is one if a dead claim, which this one
    /// followed, was cleared away meanwhile and its name taken anew. Both make their claim first and
    /// look then, so at least one of them gives way.
    fn rival(&self) -> Option<Card> {
        let below = (0..self.generation).chain(std::iter::once(self.generation + 1));
        for generation in below {
            let card = match Card::read(&self.path(generation)) {
                Ok(Some(card)) if card.worker != self.desk.card.worker => card,
                _ => continue,
            };
            if self.desk.watch.standing(&self.desk.work, &card) == Standing::Alive {
                return Some(card);
            }
        }
        None
    }

    /// Whether this worker still counts as alive. To be asked before something is made visible: a worker that
    /// slept while others took over, or began anew with other settings, must not put its image over theirs.
    pub fn is_valid(&self) -> bool {
        !self.desk.is_buried() && open_regular(&self.desk.card_path).is_ok()
    }

    /// What was claimed is over for everybody: clears away the claims of the dead before this one, too.
    pub fn end(mut self) {
        self.is_over = true;
    }

    fn path(&self, generation: u32) -> PathBuf {
        self.desk.work.join(file_name(&self.name, generation))
    }
}

impl Drop for Claim {
    /// What cannot be removed, others will find dead when this worker is gone.
    fn drop(&mut self) {
        let _ = remove(&self.path(self.generation));
        if self.is_over {
            for generation in 0..self.generation {
                let _ = remove(&self.path(generation));
            }
        }
    }
}

fn file_name(name: &str, generation: u32) -> String {
    format!("{name}.{generation}")
}
