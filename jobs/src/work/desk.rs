//! A worker's place among the others: its card, its signs of life, and what it sees of the others.

use std::collections::HashSet;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

use super::card::is_worker_name;
use super::claim::{Claim, Claimed};
use super::files::{cards, list, remove, sweep_parts};
use super::{CARD, Card, Standing, WORK_DIR, Watch, heart};
use crate::process::{Process, now_ms, owner};

/// Longest time between signs of life.
const BEAT: Duration = Duration::from_secs(5);

/// The end of the name of a card that is being written.
const DRAFT: &str = ".new";

/// The same for the most impatient.
const SHORTEST_BEAT: Duration = Duration::from_millis(10);

/// See the module. Dropped, the worker has left.
#[derive(Debug)]
pub(crate) struct Desk {
    /// The directory `job.work`.
    pub(super) work: PathBuf,
    pub(super) card: Card,
    pub(super) card_path: PathBuf,
    /// The card's first line.
    pub(super) text: Vec<u8>,
    pub(super) watch: Watch,
    is_buried: Arc<AtomicBool>,
    /// Directories in which temporary files are.
    dirs: OnceLock<Vec<PathBuf>>,
}

impl Desk {
    /// Begins to work in the job's directory `dir`; others are taken for dead after `patience` without a
    /// sign of life.
    pub(crate) fn take(dir: &Path, patience: Duration) -> io::Result<Arc<Self>> {
        let work = dir.join(WORK_DIR);
        let pause = BEAT.min(patience / 4).max(SHORTEST_BEAT);
        let card = Card {
            worker: worker_name(),
            process: Process::this().clone(),
            since_ms: now_ms(),
            pause_ms: u64::try_from(pause.as_millis()).unwrap_or(u64::MAX),
        };
        let text = card.line()?;
        let card_path = work.join(card.file_name());
        put_card(&work, &card_path, &text)?;
        let is_buried = Arc::new(AtomicBool::new(false));
        heart::begin(&card_path, pause, &is_buried);
        Ok(Arc::new(Self {
            work,
            card,
            card_path,
            text,
            watch: Watch::new(patience),
            is_buried,
            dirs: OnceLock::new(),
        }))
    }

    /// Tells in which directories workers of this job write, so that who leaves can clear them of what dead
    /// ones have left.
    pub(crate) fn writes_to(&self, dirs: Vec<PathBuf>) {
        let _ = self.dirs.set(dirs);
    }

    /// This worker's name.
    pub(crate) fn worker(&self) -> &str {
        &self.card.worker
    }

    /// Whether others have taken this worker for dead.
    pub(crate) fn is_buried(&self) -> bool {
        self.is_buried.load(Ordering::Relaxed)
    }

    /// Claims `frame`.
    pub(crate) fn claim_frame(self: &Arc<Self>, frame: i64) -> io::Result<Claimed> {
        Claim::take(self, format!("frame.{frame}"))
    }

    /// Claims the right to write the plan and to clear away; waits for it.
    pub(crate) fn lock(self: &Arc<Self>) -> io::Result<Claim> {
        loop {
            match Claim::take(self, "lock".to_owned())? {
                Claimed::Mine(claim) => return Ok(claim),
                Claimed::Held(_) | Claimed::Ended(_) => thread::sleep(Duration::from_millis(5)),
            }
        }
    }

    /// The other workers that live.
    pub(crate) fn others(&self) -> io::Result<Vec<Card>> {
        let all = cards(&self.work)?;
        let alive = |(path, card): (PathBuf, Option<Card>)| {
            let card = card.filter(|card| card.worker != self.card.worker)?;
            (self.watch.standing(&self.work, &card) == Standing::Alive && path.exists())
                .then_some(card)
        };
        Ok(all.into_iter().filter_map(alive).collect())
    }

    /// The names of all workers here, dead or alive, also of those whose cards are damaged.
    pub(crate) fn names(&self) -> io::Result<Vec<String>> {
        let all = cards(&self.work)?;
        let name = |(path, _): (PathBuf, Option<Card>)| {
            let name = path.file_name()?.to_str()?.strip_suffix(CARD)?;
            is_worker_name(name).then(|| name.to_owned())
        };
        Ok(all.into_iter().filter_map(name).collect())
    }

    /// Declares a worker dead: from now on all agree that its claims are free, and should it come back it
    /// will know.
    pub(super) fn bury(&self, card: &Card) -> io::Result<()> {
        remove(&self.work.join(card.file_name()))
    }

    /// Clears away what dead workers have left; must be done by one alone. Returns the processes that may
    /// still write.
    pub(crate) fn sweep(&self) -> io::Result<HashSet<String>> {
        sweep(&self.work, &self.watch, Some(&self.card))
    }
}

impl Drop for Desk {
    /// The last one to leave clears away what the dead have left. What cannot be removed is found dead by
    /// the next run.
    fn drop(&mut self) {
        heart::end(&self.card_path);
        let _ = remove(&self.card_path);
        let Ok(mut left) = sweep(&self.work, &self.watch, None) else {
            return;
        };
        if left.is_empty() {
            let _ = fs::remove_dir(&self.work);
        }
        // A process may have other jobs.
        left.insert(owner().to_owned());
        for dir in self.dirs.get().into_iter().flatten() {
            let _ = sweep_parts(dir, &left);
        }
    }
}

/// Buries the dead. With nobody left but the worker `mine`, its files alone stay: then no claim of a dead
/// worker has a successor that it keeps from being made twice.
fn sweep(work: &Path, watch: &Watch, mine: Option<&Card>) -> io::Result<HashSet<String>> {
    let mut at_work = HashSet::new();
    let mut others = 0;
    for (path, card) in cards(work)? {
        let standing = match &card {
            Some(card) if Some(card) == mine => {
                at_work.insert(owner().to_owned());
                continue;
            }
            Some(card) => watch.standing(work, card),
            None => watch.signs(&path),
        };
        match (standing, card) {
            (Standing::Alive, card) => {
                others += 1;
                at_work.extend(card.map(|card| card.process.token));
            }
            // What cannot be removed does no harm.
            _ => drop(remove(&path)),
        }
    }
    if others == 0 {
        for path in list(work)?.into_iter().filter(|path| is_ours(path)) {
            let owner = Card::read(&path).ok().flatten();
            if mine.is_none() || owner.as_ref() != mine {
                // A newcomer's card is not there for long without being seen; its claims come later.
                let is_new = owner.is_some_and(|c| watch.standing(work, &c) == Standing::Alive);
                if !is_new {
                    let _ = remove(&path);
                }
            }
        }
    }
    Ok(at_work)
}

/// Whether a file is one that workers make.
fn is_ours(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy());
    name.is_some_and(|name| {
        let is_claim = name.starts_with("frame.") || name.starts_with("lock.");
        is_claim || name.ends_with(CARD) || name.ends_with(DRAFT)
    })
}

/// A process may have several jobs open.
fn worker_name() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let token = &Process::this().token;
    match COUNT.fetch_add(1, Ordering::Relaxed) {
        0 => token.clone(),
        count => format!("{token}-{count}"),
    }
}

/// Puts the card into the directory, which is made if need be: the last one to leave removes it.
fn put_card(work: &Path, card_path: &Path, text: &[u8]) -> io::Result<()> {
    let draft = card_path.with_extension(&DRAFT[1..]);
    let put = || {
        fs::create_dir_all(work)?;
        let mut file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .open(&draft)?;
        file.write_all(text)?;
        fs::rename(&draft, card_path)
    };
    for _ in 0..100 {
        match put() {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => {
                let _ = remove(&draft);
                let _ = fs::remove_dir(work);
                return Err(e);
            }
            Ok(()) => return Ok(()),
        }
    }
    put()
}
