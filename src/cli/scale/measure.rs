//! The hidden command that measures one cell for `spherule scale`.

use std::io::{self, Read};
use std::thread;

use crate::cli::{CliError, INTERRUPTED, Outcome, put};
use crate::report::scale::CellOutcome;
use crate::scale::{CellRequest, cell};

/// Its name.
pub(super) const COMMAND: &str = "scale-cell";

/// Reads the request, measures, prints the outcome.
pub(in crate::cli) fn run() -> Result<Outcome, CliError> {
    let mut line = String::new();
    let request: CellRequest = io::stdin()
        .read_line(&mut line)
        .map_err(|e| e.to_string())
        .and_then(|_| serde_json::from_str(&line).map_err(|e| e.to_string()))
        .map_err(|e| {
            CliError::other(format!(
                "standard input: no request of `spherule scale`, whose own command this is: {e}"
            ))
        })?;
    thread::spawn(end_with_parent);
    rayon::ThreadPoolBuilder::new()
        .num_threads(request.threads)
        .build_global()
        .map_err(|e| CliError::other(format!("{} threads: {e}", request.threads)))?;
    let outcome = match cell::measure(&request) {
        Ok(measured) => CellOutcome::Done(Box::new(measured)),
        Err(reason) => CellOutcome::Failed { reason },
    };
    let text = serde_json::to_string(&outcome).map_err(|e| CliError::Other(e.to_string()))?;
    put(&mut io::stdout(), &text);
    Ok(Outcome::Done)
}

/// Whoever wanted the result is gone once our input ends.
fn end_with_parent() {
    let mut rest = [0; 64];
    while io::stdin().read(&mut rest).is_ok_and(|n| n > 0) {}
    std::process::exit(i32::from(INTERRUPTED));
}
