//! What is read of a job's files, over bytes: for fuzzing. None of these panics, whatever the bytes.

use crate::ledger::parse_lines;
use crate::work::Card;
use crate::{Entry, Plan};

/// A plan, from the bytes of its file.
///
/// # Errors
/// What is wrong with them.
pub fn plan(bytes: &[u8]) -> Result<Plan, String> {
    Plan::parse(bytes)
}

/// The entries of a ledger, from the bytes of its file; what follows the last line feed is dropped.
///
/// # Errors
/// The number of the line that is no entry, from 1, and why.
pub fn ledger(bytes: &[u8]) -> Result<Vec<Entry>, (usize, String)> {
    parse_lines(bytes)
}

/// The name of the worker whose card, or claim, these are the bytes of.
pub fn card(bytes: &[u8]) -> Option<String> {
    Card::parse(bytes).map(|card| card.worker)
}
