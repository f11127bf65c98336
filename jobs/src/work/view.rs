//! Who is at work, as seen by somebody who only looks.

use std::fs;
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};

use super::files::{cards, list};
use super::{CARD, Card, WORK_DIR};

/// A worker as its files tell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkerView {
    /// Its name; that of its ledger, too.
    pub worker: String,
    /// The machine it runs on.
    pub host: String,
    /// Its number there.
    pub pid: u32,
    /// When it began, milliseconds since 1970 by its own clock.
    pub since_ms: u64,
    /// Whether it has certainly ended, so that what it has in hand is free.
    pub has_ended: bool,
    /// How long ago it last gave a sign of life, if the clocks of this machine and of the file system agree.
    pub silent_for: Option<Duration>,
    /// Frames in its hands, ascending.
    pub frames: Vec<i64>,
}

/// The workers in the job's directory `dir`, by name.
pub(crate) fn workers(dir: &Path) -> io::Result<Vec<WorkerView>> {
    let work = dir.join(WORK_DIR);
    let mut views: Vec<WorkerView> = cards(&work)?
        .into_iter()
        .filter_map(|(path, card)| Some(WorkerView::of(&path, card?)))
        .collect();
    for path in list(&work)? {
        let name = path.file_name().and_then(|name| name.to_str());
        let Some(frame) = name.and_then(claimed_frame) else {
            continue;
        };
        let Ok(Some(card)) = Card::read(&path) else {
            continue;
        };
        let view = views.iter_mut().find(|view| view.worker == card.worker);
        if let Some(view) = view {
            view.frames.push(frame);
        }
    }
    for view in &mut views {
        view.frames.sort_unstable();
        view.frames.dedup();
    }
    views.sort_by(|a, b| a.worker.cmp(&b.worker));
    Ok(views)
}

impl WorkerView {
    fn of(path: &Path, card: Card) -> Self {
        let changed = fs::metadata(path).and_then(|m| m.modified());
        let silent_for = changed
            .ok()
            .and_then(|at| SystemTime::now().duration_since(at).ok());
        Self {
            has_ended: card.process.has_ended(),
            worker: card.worker,
            host: card.process.host,
            pid: card.process.pid,
            since_ms: card.since_ms,
            silent_for,
            frames: Vec::new(),
        }
    }
}

/// The frame that a file of this name claims.
fn claimed_frame(name: &str) -> Option<i64> {
    let (frame, generation) = name.strip_prefix("frame.")?.split_once('.')?;
    generation.parse::<u32>().ok()?;
    debug_assert!(!name.ends_with(CARD));
    frame.parse().ok()
}
