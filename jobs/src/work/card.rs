//! A worker's card: the first line of its file, and of its claims.
//!
//! It is read by others, who use what it says for file names and to judge whether the worker lives. So a
//! line that was damaged or made up is no card.

use std::io::{self, Read};
use std::path::Path;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::CARD;
use crate::open_regular;
use crate::process::Process;

/// Longer lines are no cards.
const MAX_LINE: u64 = 1 << 16;

/// Longest name of a worker.
const MAX_NAME: usize = 128;

/// Longest time between signs of life that is believed. Workers of this version give one every five seconds.
const MAX_PAUSE: Duration = Duration::from_secs(60);

/// What a worker says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Card {
    /// Its name, unique: letters, digits, `-` and `_`.
    pub(crate) worker: String,
    /// Who works.
    pub(crate) process: Process,
    /// When it began, milliseconds since 1970 by its own clock; for people.
    pub(crate) since_ms: u64,
    /// Milliseconds between its signs of life.
    #[serde(default)]
    pub(super) pause_ms: u64,
}

/// A card as it is written.
#[derive(Serialize, Deserialize)]
struct SealedCard {
    #[serde(flatten)]
    card: Card,
    /// BLAKE3 of the card alone as JSON, in hex. Cards of spherule 0.1.0 have none.
    #[serde(default)]
    blake3: Option<String>,
}

impl Card {
    /// The card in the file at `path`; None if there is none in it.
    pub(super) fn read(path: &Path) -> io::Result<Option<Self>> {
        let mut bytes = Vec::new();
        let (file, _) = open_regular(path)?;
        // Signs of life follow, which may be many.
        file.take(MAX_LINE).read_to_end(&mut bytes)?;
        Ok(Self::parse(&bytes))
    }

    /// The card in the first line of `bytes`, if there is one, undamaged.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let line = bytes.split(|b| *b == b'\n').next()?;
        let sealed: SealedCard = serde_json::from_slice(line).ok()?;
        let card = sealed.card;
        let is_whole = match sealed.blake3 {
            Some(checksum) => card.checksum().is_ok_and(|own| own == checksum),
            None => true,
        };
        (is_whole && is_worker_name(&card.worker)).then_some(card)
    }

    /// Its line.
    pub(super) fn line(&self) -> serde_json::Result<Vec<u8>> {
        let sealed = SealedCard {
            card: self.clone(),
            blake3: Some(self.checksum()?),
        };
        let mut line = serde_json::to_vec(&sealed)?;
        line.push(b'\n');
        Ok(line)
    }

    fn checksum(&self) -> serde_json::Result<String> {
        let text = serde_json::to_vec(self)?;
        Ok(blake3::hash(&text).to_hex().to_string())
    }

    /// Time between its signs of life.
    pub(super) fn pause(&self) -> Duration {
        Duration::from_millis(self.pause_ms).min(MAX_PAUSE)
    }

    /// The name of its file.
    pub(super) fn file_name(&self) -> String {
        format!("{}{CARD}", self.worker)
    }

    /// Whether it lies at `path` under its own name.
    pub(super) fn is_at(&self, path: &Path) -> bool {
        path.file_name()
            .is_some_and(|name| *name == *self.file_name())
    }

    /// Who it is, for people.
    pub(crate) fn told(&self) -> String {
        format!("process {} on {}", self.process.pid, self.process.host)
    }
}

/// Whether `name` can be a worker's: it becomes part of paths.
pub(super) fn is_worker_name(name: &str) -> bool {
    let is_plain = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_';
    (1..=MAX_NAME).contains(&name.len()) && name.bytes().all(is_plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn card(worker: &str) -> Card {
        Card {
            worker: worker.to_owned(),
            process: Process::this().clone(),
            since_ms: 5,
            pause_ms: 5000,
        }
    }

    #[test]
    fn names_that_would_leave_the_directory_are_no_cards() {
        let long = "x".repeat(129);
        let names = [
            "../../victim",
            "/victim",
            "a/b",
            "..",
            "",
            "a b",
            "é",
            &long,
        ];
        for name in names {
            assert_eq!(Card::parse(&card(name).line().unwrap()), None, "{name}");
        }
        let good = card("host_1-23-ff-2");
        let mut line = good.line().unwrap();
        line.extend(b"......");
        assert_eq!(Card::parse(&line).as_ref(), Some(&good));
        // As spherule 0.1.0 writes it.
        let old = serde_json::to_vec(&good).unwrap();
        assert_eq!(Card::parse(&old).as_ref(), Some(&good));
        let forged = Card {
            pause_ms: u64::MAX,
            ..good
        };
        assert_eq!(forged.pause(), MAX_PAUSE);
    }

    /// Whatever a bit was, it is no card or still the same.
    #[test]
    fn no_flipped_bit_changes_a_card() {
        let card = card("host-23-ff");
        let line = card.line().unwrap();
        for at in 0..line.len() {
            for bit in 0..8 {
                let mut damaged = line.clone();
                damaged[at] ^= 1 << bit;
                if let Some(read) = Card::parse(&damaged) {
                    assert_eq!(read, card, "byte {at}, bit {bit}");
                }
            }
        }
    }
}
