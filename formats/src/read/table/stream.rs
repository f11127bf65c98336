//! Rows of a text that is never in memory as a whole.

use memchr::memrchr;
use rayon::prelude::*;

use super::{
    Dialect, Growing, Particles, Place, RowFormat, Target, Values, particles, pieces_at_once,
};
use crate::unpack::{ByteSource, SourceError};
use crate::{MemoryBudget, ParseError};

/// Bytes of a piece: smaller than of text in memory, since all pieces at work are held.
const PIECE: usize = 1 << 18;

/// Bytes of the pieces at work and of the values found in them, as many.
pub(crate) fn stream_bytes() -> u64 {
    (2 * PIECE * pieces_at_once()) as u64
}

/// Rows to parse, see [`super::Table`].
#[derive(Debug)]
pub(in crate::read) struct TableStream {
    /// Where the rows begin, from the start of the file.
    pub(in crate::read) start: usize,
    /// How a row is written.
    pub(in crate::read) dialect: Dialect,
    /// Where each field of a row goes.
    pub(in crate::read) fields: Vec<Option<Place>>,
    /// The arrays to fill, positions first.
    pub(in crate::read) targets: Vec<Target>,
    /// How many rows there may be.
    pub(in crate::read) rows: usize,
}

impl TableStream {
    /// Parses the rows that `source` gives from the start of the file on.
    ///
    /// # Errors
    /// As [`super::Table::parse`], and what `source` says.
    pub(in crate::read) fn particles(
        self,
        source: &mut dyn ByteSource,
        budget: MemoryBudget,
    ) -> Result<Particles, SourceError> {
        let format = RowFormat {
            dialect: self.dialect,
            fields: &self.fields,
            targets: &self.targets,
        };
        let mut lines = LinePieces::behind(self.start, source, budget)?;
        let mut values = Growing::new(&self.targets, self.rows, budget);
        loop {
            let some = lines.take(pieces_at_once())?;
            if some.is_empty() {
                break;
            }
            let parsed: Vec<Result<Vec<Values>, ParseError>> = some
                .par_iter()
                .map(|piece| {
                    let rows = format.in_bytes(&piece.bytes);
                    let values = rows.parse_piece(0..piece.bytes.len());
                    values.map_err(|error| error.behind(piece.at))
                })
                .collect();
            for piece in parsed {
                values.append(piece?)?;
            }
            lines.take_back(some);
        }
        Ok(particles(self.targets, values.into_values()))
    }
}

/// Whole lines.
struct LinePiece {
    /// Offset of the first byte from the start of the file.
    at: usize,
    bytes: Vec<u8>,
}

/// Cuts what comes of a source into pieces of whole lines.
struct LinePieces<'s> {
    source: &'s mut dyn ByteSource,
    /// The beginning of a line.
    rest: Vec<u8>,
    /// Memory of pieces that are done.
    spare: Vec<Vec<u8>>,
    /// Its offset.
    at: usize,
    ended: bool,
    budget: MemoryBudget,
}

impl<'s> LinePieces<'s> {
    /// The lines from byte `start` of the source on.
    fn behind(
        start: usize,
        source: &'s mut dyn ByteSource,
        budget: MemoryBudget,
    ) -> Result<Self, SourceError> {
        let mut passed = Vec::new();
        let mut left = start;
        while left > 0 {
            passed.clear();
            let count = source.fill(&mut passed, left.min(PIECE))?;
            if count == 0 {
                break;
            }
            left -= count;
        }
        Ok(Self {
            source,
            rest: Vec::new(),
            spare: Vec::new(),
            at: start,
            ended: false,
            budget,
        })
    }

    /// Up to `most` pieces; none at the end.
    fn take(&mut self, most: usize) -> Result<Vec<LinePiece>, SourceError> {
        let mut pieces = Vec::with_capacity(most);
        while pieces.len() < most
            && let Some(piece) = self.next()?
        {
            pieces.push(piece);
        }
        Ok(pieces)
    }

    /// Uses the memory of `pieces` for those to come.
    fn take_back(&mut self, pieces: Vec<LinePiece>) {
        self.spare
            .extend(pieces.into_iter().map(|piece| piece.bytes));
    }

    fn next(&mut self) -> Result<Option<LinePiece>, SourceError> {
        let mut bytes = self.spare.pop().unwrap_or_default();
        bytes.clear();
        bytes.append(&mut self.rest);
        let mut looked_at = 0;
        while !self.ended {
            bytes.reserve_exact(PIECE);
            self.ended = self.source.fill(&mut bytes, PIECE)? < PIECE;
            let new = bytes.get(looked_at..).unwrap_or_default();
            if let Some(newline) = memrchr(b'\n', new).filter(|_| !self.ended) {
                let end = looked_at + newline + 1;
                self.rest
                    .extend_from_slice(bytes.get(end..).unwrap_or_default());
                bytes.truncate(end);
                break;
            }
            looked_at = bytes.len();
            self.budget
                .check(looked_at as u64, "it has a line that is")?;
        }
        if bytes.is_empty() {
            return Ok(None);
        }
        let at = self.at;
        self.at += bytes.len();
        Ok(Some(LinePiece { at, bytes }))
    }
}
