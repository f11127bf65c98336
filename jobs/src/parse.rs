//! Parsers of the files of a job, for fuzzing. They never panic, whatever the bytes.

use crate::ledger::parse_lines;
use crate::workers::WorkerRecord;
use crate::{EntryError, LedgerEntry, Plan, PlanError};

/// Parses the file of a plan.
///
/// # Errors
/// Why it is invalid.
pub fn plan(bytes: &[u8]) -> Result<Plan, PlanError> {
    Plan::parse(bytes)
}

/// Parses the file of a ledger. Bytes after the last line feed are ignored.
///
/// # Errors
/// The number of the invalid line, from 1, and why it is invalid.
pub fn ledger(bytes: &[u8]) -> Result<Vec<LedgerEntry>, (usize, EntryError)> {
    parse_lines(bytes)
}

/// Parses a worker record or a claim; returns the name of the worker.
pub fn worker_record(bytes: &[u8]) -> Option<String> {
    WorkerRecord::parse(bytes).map(|record| record.worker)
}
