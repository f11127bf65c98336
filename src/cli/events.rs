//! `--progress json`: events as JSON, one object per line, on standard output. docs/progress.md describes them. Keep
//! it up to date.
//!
//! There is one standard output, so a process has one stream of events. Commands send events in any case; without
//! `--progress json` they are discarded.

use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

use serde_json::{Map, Value, json};

use super::print::{self, Reader};

/// None unless events were requested.
static STREAM: Mutex<Option<Stream>> = Mutex::new(None);

struct Stream {
    /// Fields of the last event.
    summary: Map<String, Value>,
    /// Whether the reader has gone, or nothing can be written.
    is_closed: bool,
}

fn stream() -> MutexGuard<'static, Option<Stream>> {
    STREAM.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts the stream of events.
pub(super) fn start() {
    *stream() = Some(Stream { summary: Map::new(), is_closed: false });
}

/// Whether events are sent.
pub(super) fn are_sent() -> bool {
    stream().is_some()
}

/// Sends one event.
pub(super) fn send(event: &str, facts: Value) {
    if let Some(stream) = &mut *stream() {
        stream.send(event, facts);
    }
}

/// Prints a note and sends it as an event.
pub(super) fn note(text: &str) {
    message!("note: {text}");
    send("note", json!({"text": text}));
}

/// Adds fields to the last event.
pub(super) fn add_to_end(facts: Value) {
    if let (Some(stream), Value::Object(facts)) = (&mut *stream(), facts) {
        stream.summary.extend(facts);
    }
}

/// Sends the last event: exit code and errors.
pub(super) fn end(code: u8, errors: &[String]) {
    if let Some(stream) = stream().take() {
        stream.end(code, errors);
    }
}

/// Sends the last event from a thread that must not block. If another event is being sent to a reader that does
/// not read, that one stays the last.
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
            // Continue: the results are in the ledger
            Ok(Reader::Gone) => self.is_closed = true,
            Err(error) => {
                self.is_closed = true;
                message!("note: {error}; no more events are sent");
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
