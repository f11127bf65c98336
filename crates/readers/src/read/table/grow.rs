//! Columns that grow piece by piece, within a budget.

use super::{ColumnValues, NumberKind, TargetArray};
use spherule_frame::{MemoryBudget, ParseError};

/// What the message about too many numbers begins with.
const TOO_LARGE: &str = "its numbers in memory are";

/// The values of all targets so far.
pub(super) struct GrowingColumn {
    values: Vec<ColumnValues>,
    bytes: u64,
    budget: MemoryBudget,
}

impl GrowingColumn {
    /// Nothing yet; there is room for `rows`, which are no more than a guess, if `budget` allows as many.
    pub(super) fn new(targets: &[TargetArray], rows: usize, budget: MemoryBudget) -> Self {
        let numbers = |target: &TargetArray| rows.saturating_mul(target.components);
        let all = targets.iter().map(numbers).fold(0, usize::saturating_add);
        let fits = (all as u64).saturating_mul(size_of::<f64>() as u64) <= budget.bytes();
        let empty = |target: &TargetArray| {
            let room = if fits { numbers(target) } else { 0 };
            match target.numbers {
                NumberKind::Real => ColumnValues::Real(with_room(room)),
                NumberKind::WholeIfAll => ColumnValues::Whole(with_room(room)),
            }
        };
        Self { values: targets.iter().map(empty).collect(), bytes: 0, budget }
    }

    /// Appends the values of the next piece.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`].
    pub(super) fn append(&mut self, piece: Vec<ColumnValues>) -> Result<(), ParseError> {
        let more: usize = piece.iter().map(ColumnValues::len).sum();
        self.bytes += (more * size_of::<f64>()) as u64;
        self.budget.check(self.bytes, TOO_LARGE)?;
        for (all, more) in self.values.iter_mut().zip(piece) {
            if append(all, more).is_none() {
                let there = MemoryBudget::UNLIMITED.less(u64::MAX - self.bytes);
                return Err(there.exceeded(TOO_LARGE));
            }
        }
        Ok(())
    }

    pub(super) fn into_values(self) -> Vec<ColumnValues> {
        self.values
    }
}

/// A vector with room for `len` items if they can be had: pages that are not used cost nothing.
fn with_room<T>(len: usize) -> Vec<T> {
    let mut room = Vec::new();
    let _ = room.try_reserve_exact(len);
    room
}

/// `None` if there is no memory.
fn append(all: &mut ColumnValues, more: ColumnValues) -> Option<()> {
    match (&mut *all, more) {
        (ColumnValues::Text, _) => {}
        (_, ColumnValues::Text) => *all = ColumnValues::Text,
        (ColumnValues::Whole(all), ColumnValues::Whole(more)) => {
            all.try_reserve(more.len()).ok()?;
            all.extend_from_slice(&more);
        }
        (ColumnValues::Real(all), ColumnValues::Real(more)) => {
            all.try_reserve(more.len()).ok()?;
            all.extend_from_slice(&more);
        }
        (ColumnValues::Real(all), ColumnValues::Whole(more)) => {
            all.try_reserve(more.len()).ok()?;
            all.extend(more.iter().map(|v| *v as f64));
        }
        (ColumnValues::Whole(whole), more @ ColumnValues::Real(_)) => {
            let whole = std::mem::take(whole);
            // In the same memory: both have eight bytes.
            *all = ColumnValues::Real(whole.into_iter().map(|v| v as f64).collect());
            return append(all, more);
        }
    }
    Some(())
}
