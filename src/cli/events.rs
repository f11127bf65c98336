//! `--progress json`: events as JSON, one object a line, alone on standard output. docs/progress.md describes them;
//! whoever changes an event changes it there.
//!
//! There is one standard output, so there is one stream of events in a process. Commands that were not asked for
//! events send them all the same: they go nowhere.

use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

use serde_json::{Map, Value, json};

use super::print::{self, Reader};

/// None if no events were asked for.
static STREAM: Mutex<Option<Stream>> = Mutex::new(None);

struct Stream {
    /// What is known of the run when it ends.
    summary: Map<String, Value>,
    /// Whether nobody reads any more, or nothing can be written.
    is_closed: bool,
}

fn stream() -> MutexGuard<'static, Option<Stream>> {
    STREAM.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Sends events from now on.
pub(super) fn begin() {
    *stream() = Some(Stream {
        summary: Map::new(),
        is_closed: false,
    });
}

/// Sends one event.
pub(super) fn send(event: &str, facts: Value) {
    if let Some(stream) = &mut *stream() {
        stream.send(event, facts);
    }
}

/// Prints a note for people, and sends it.
pub(super) fn note(text: &str) {
    say!("note: {text}");
    send("note", json!({"text": text}));
}

/// Adds to what the last event tells.
pub(super) fn at_end(facts: Value) {
    if let (Some(stream), Value::Object(facts)) = (&mut *stream(), facts) {
        stream.summary.extend(facts);
    }
}

/// Sends the last event: the exit code, and what ended the run before its work was done.
pub(super) fn end(code: u8, errors: &[String]) {
    if let Some(stream) = stream().take() {
        stream.end(code, errors);
    }
}

/// The same from a thread that must not wait: an event that is just being sent to somebody who does not read is
/// the last one then.
pub(super) fn end_at_once(code: u8) {
    let stream = match STREAM.try_lock() {
        Ok(mut stream) => stream.take(),
        Err(TryLockError::Poisoned(stream)) => stream.into_inner().take(),
        Err(TryLockError::WouldBlock) => None,
    };
    if let Some(stream) = stream {
        stream.end(code, &[]);
    }
}

impl Stream {
    fn send(&mut self, event: &str, mut facts: Value) {
        if self.is_closed {
            return;
        }
        facts["event"] = json!(event);
        match print::json(&facts) {
            Ok(Reader::Listening) => {}
            // The work goes on: what counts is in the ledger.
            Ok(Reader::Gone) => self.is_closed = true,
            Err(error) => {
                self.is_closed = true;
                say!("note: {error}; no more events are sent");
            }
        }
    }

    fn end(mut self, code: u8, errors: &[String]) {
        let mut facts = std::mem::take(&mut self.summary);
        let known = facts.entry("errors").or_insert_with(|| json!([]));
        if let Value::Array(known) = known {
            known.extend(errors.iter().map(|error| json!(error)));
        }
        facts.insert("exit_code".to_owned(), json!(code));
        self.send("end", Value::Object(facts));
    }
}
