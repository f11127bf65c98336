//! The interface of a server to the thread that renders.

use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde_json::Value;
use spherule_formats::Sequence;

use super::error::ExploreError;
use super::shared::{Answer, PageId, Shared};
use super::stage::Stage;
use super::wish::{Setting, Wish};
use super::worker;
use crate::job::JobManifest;

/// Renders what pages wish, in a thread of its own. It ends with this value.
#[derive(Debug)]
pub struct Explorer {
    shared: Arc<Shared>,
    worker: Option<JoinHandle<()>>,
}

impl Explorer {
    /// Renders frames of `sequence` with the settings of `requested`, which need not be complete.
    ///
    /// # Errors
    /// There is no thread.
    pub fn start(requested: JobManifest, sequence: Sequence) -> std::io::Result<Self> {
        let shared = Arc::<Shared>::default();
        let own = Arc::clone(&shared);
        let worker = thread::Builder::new()
            .name("explorer".to_owned())
            .spawn(move || worker::run(&own, Stage::new(requested, sequence)))?;
        Ok(Self { shared, worker: Some(worker) })
    }

    /// Replaces what `page` wishes. Returns the number of the wish.
    pub fn wish(&self, page: PageId, wish: Wish) -> u64 {
        self.shared.wish(page, wish)
    }

    /// The newest answer to `page` after the one with the number `after`; None if there is none in time.
    pub fn answer(&self, page: PageId, after: u64, patience: Duration) -> Option<Arc<Answer>> {
        self.shared.answer(page, after, patience)
    }

    /// The id of the particle and the point at a place of the picture that `page` shows, as fractions of its width and
    /// height from the top left; None where there is no particle.
    pub fn under(&self, page: PageId, [x, y]: [f64; 2]) -> Option<(u32, [f32; 3])> {
        self.shared.under(page)?.at([x, y])
    }

    /// What the page that was used last wishes, and its answer, if there is one.
    pub fn newest(&self) -> Option<(Wish, Option<Arc<Answer>>)> {
        self.shared.newest()
    }

    /// The wish of `page`.
    pub fn wish_of(&self, page: PageId) -> Option<Wish> {
        self.shared.wish_of(page)
    }

    /// All keys of the manifest with these settings: their values as JSON, with the defaults that follow from the
    /// particles; None if the thread that renders has ended.
    ///
    /// # Errors
    /// The settings are invalid.
    pub fn values(&self, settings: Vec<Setting>) -> Option<Result<Value, ExploreError>> {
        self.ask(move |stage| {
            let prepared = stage.prepare(&settings)?;
            // A manifest with all defaults has no look
            let look = prepared.source.parse()?.0.look;
            let values = prepared.manifest().values();
            let of = |(key, value): (String, Option<String>)| {
                let table = toml::from_str::<toml::Table>(&format!("v = {}", value?)).ok()?;
                Some((key, serde_json::to_value(table.get("v")?).ok()?))
            };
            let mut all: serde_json::Map<String, Value> =
                values.into_iter().filter_map(of).collect();
            all.insert("look".to_owned(), look.name().into());
            Ok(Value::Object(all))
        })
    }

    /// Runs `errand` in the thread that renders, and waits for its result; None if that thread has ended.
    pub(super) fn ask<T: Send + 'static>(
        &self,
        errand: impl FnOnce(&mut Stage) -> T + Send + 'static,
    ) -> Option<T> {
        let (send, receive) = sync_channel(1);
        self.shared.add_errand(Box::new(move |stage| {
            // Who asked may have gone
            let _ = send.send(errand(stage));
        }));
        receive.recv().ok()
    }
}

impl Drop for Explorer {
    fn drop(&mut self) {
        self.shared.end();
        if let Some(worker) = self.worker.take() {
            // A panic was reported where it happened
            let _ = worker.join();
        }
    }
}
