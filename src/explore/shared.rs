//! Pages, what they wish, and what they are answered: what the server and the thread that renders share.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::error::Fault;
use super::level::{self, Level, Speed};
use super::stage::{Stage, Under};
use super::wish::Wish;

/// A page, by a number that it chooses.
pub type PageId = u64;

/// Number of pages that are remembered: the one that was used longest ago is forgotten.
const MAX_PAGES: usize = 16;

/// A picture, or why there is none.
#[derive(Debug)]
pub struct Answer {
    /// Rises from answer to answer.
    pub number: u64,
    /// Number of the wish.
    pub wish: u64,
    /// The picture.
    pub result: Result<Shown, Fault>,
}

/// A picture as a page shows it.
#[derive(Debug)]
pub struct Shown {
    /// The file.
    pub bytes: Vec<u8>,
    /// The type of the file, as in HTTP.
    pub mime: &'static str,
    /// What belongs to it, as JSON.
    pub facts: serde_json::Value,
}

/// What threads of the server and the one that renders share.
#[derive(Default)]
pub(super) struct Shared {
    state: Mutex<State>,
    /// There is something to do.
    work: Condvar,
    /// There is an answer.
    news: Condvar,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}

/// Something to do with the frame that is shown.
pub(super) type Errand = Box<dyn FnOnce(&mut Stage) + Send>;

#[derive(Default)]
struct State {
    pages: BTreeMap<PageId, Page>,
    errands: VecDeque<Errand>,
    /// The page that was served last.
    served: PageId,
    /// Number of wishes and answers so far.
    count: u64,
    ends: bool,
}

struct Page {
    wish: Wish,
    number: u64,
    /// The picture of the wish that is finished.
    done: Option<Level>,
    /// Whether nothing finer follows.
    is_over: bool,
    speed: Speed,
    answer: Option<Arc<Answer>>,
    under: Arc<Under>,
    seen: Instant,
}

/// What the thread that renders does next.
pub(super) enum Task {
    Errand(Errand),
    Picture(PageTask),
}

/// The wish of a page.
pub(super) struct PageTask {
    pub(super) page: PageId,
    pub(super) wish: Wish,
    pub(super) number: u64,
    pub(super) done: Option<Level>,
    pub(super) speed: Speed,
}

impl Shared {
    /// See [`super::Explorer::wish`].
    pub(super) fn wish(&self, page: PageId, wish: Wish) -> u64 {
        let mut state = self.lock();
        state.count += 1;
        let number = state.count;
        let is_new = !state.pages.contains_key(&page);
        if is_new && state.pages.len() == MAX_PAGES {
            let oldest = state.pages.iter().min_by_key(|(_, page)| page.seen);
            let oldest = oldest.map(|(id, _)| *id).expect("there are pages");
            state.pages.remove(&oldest);
        }
        let known = state.pages.remove(&page);
        let known = known.map(|page| (page.speed, page.answer, page.under));
        let (speed, answer, under) = known.unwrap_or_default();
        let seen = Instant::now();
        let own = Page { wish, number, done: None, is_over: false, speed, answer, under, seen };
        state.pages.insert(page, own);
        self.work.notify_all();
        number
    }

    /// See [`super::Explorer::answer`].
    pub(super) fn answer(
        &self,
        page: PageId,
        after: u64,
        patience: Duration,
    ) -> Option<Arc<Answer>> {
        let until = Instant::now() + patience;
        let mut state = self.lock();
        loop {
            if let Some(page) = state.pages.get_mut(&page) {
                page.seen = Instant::now();
                if let Some(answer) = page.answer.as_ref().filter(|own| own.number > after) {
                    return Some(Arc::clone(answer));
                }
            }
            let left = until.checked_duration_since(Instant::now()).filter(|_| !state.ends)?;
            state = self.wait(&self.news, state, left);
        }
    }

    /// What is under the pixels of the picture that `page` shows.
    pub(super) fn under(&self, page: PageId) -> Option<Arc<Under>> {
        self.lock().pages.get(&page).map(|page| Arc::clone(&page.under))
    }

    /// The wish of `page`.
    pub(super) fn wish_of(&self, page: PageId) -> Option<Wish> {
        self.lock().pages.get(&page).map(|page| page.wish.clone())
    }

    /// What the page that was used last wishes, and its answer.
    pub(super) fn newest(&self) -> Option<(Wish, Option<Arc<Answer>>)> {
        let state = self.lock();
        let newest = state.pages.values().max_by_key(|page| page.seen)?;
        Some((newest.wish.clone(), newest.answer.clone()))
    }

    /// Adds something to do before the next picture.
    pub(super) fn add_errand(&self, errand: Errand) {
        self.lock().errands.push_back(errand);
        self.work.notify_all();
    }

    /// Ends the thread that renders, after the picture in progress.
    pub(super) fn end(&self) {
        {
            let mut state = self.lock();
            state.ends = true;
            state.errands.clear();
        }
        self.work.notify_all();
        self.news.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(
        &self,
        condition: &Condvar,
        state: MutexGuard<'a, State>,
        at_most: Duration,
    ) -> MutexGuard<'a, State> {
        let waited = condition.wait_timeout(state, at_most);
        waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// What to do next; None at the end.
    pub(super) fn next_task(&self) -> Option<Task> {
        let mut state = self.lock();
        loop {
            if state.ends {
                return None;
            }
            if let Some(errand) = state.errands.pop_front() {
                return Some(Task::Errand(errand));
            }
            if let Some(page) = state.next_page() {
                state.served = page;
                let own = &state.pages[&page];
                return Some(Task::Picture(PageTask {
                    page,
                    wish: own.wish.clone(),
                    number: own.number,
                    done: own.done,
                    speed: own.speed,
                }));
            }
            state = self.wait(&self.work, state, Duration::from_secs(60));
        }
    }

    /// Whether something is more urgent than the next finer picture of the wish `number` of `page`.
    pub(super) fn has_news(&self, page: PageId, number: u64) -> bool {
        let state = self.lock();
        let is_old = state.pages.get(&page).is_none_or(|page| page.number != number);
        let waits = |(id, other): (&PageId, &Page)| *id != page && other.is_new();
        is_old || state.ends || !state.errands.is_empty() || state.pages.iter().any(waits)
    }

    /// Nothing finer follows for the wish `number` of `page`.
    pub(super) fn finish(&self, page: PageId, number: u64) {
        if let Some(page) = self.lock().pages.get_mut(&page).filter(|page| page.number == number) {
            page.is_over = true;
        }
    }

    /// Shows a picture of the wish in `task`, or why there is none. A page that wishes something else by now sees it
    /// until that is there.
    pub(super) fn publish(
        &self,
        task: &PageTask,
        (level, seconds): (Option<Level>, f64),
        result: Result<(Shown, Under), Fault>,
    ) {
        let mut state = self.lock();
        state.count += 1;
        let number = state.count;
        let Some(page) = state.pages.get_mut(&task.page) else {
            return;
        };
        let is_current = page.number == task.number;
        if let Some(level) = level {
            page.speed.learn(&level, seconds);
            page.done = if is_current { Some(level) } else { page.done };
        }
        page.is_over |= is_current && result.is_err();
        let result = result.map(|(shown, under)| {
            page.under = Arc::new(under);
            shown
        });
        page.answer = Some(Arc::new(Answer { number, wish: task.number, result }));
        self.news.notify_all();
    }
}

impl Page {
    /// Whether there is no answer to its wish yet.
    const fn is_new(&self) -> bool {
        self.done.is_none() && !self.is_over
    }

    /// Whether there may be a finer picture.
    fn is_unfinished(&self) -> bool {
        let is_done = self.done.is_some_and(|level| level.is_last || self.wish.is_moving);
        !is_done && !self.is_over
    }
}

impl State {
    /// The page to serve: one without an answer, in turn; else the one that was served last; else another.
    fn next_page(&self) -> Option<PageId> {
        let after = self.pages.range(self.served.saturating_add(1)..);
        let in_turn = || after.clone().chain(self.pages.range(..=self.served));
        let new = in_turn().find(|(_, page)| page.is_new());
        let last = || self.pages.get_key_value(&self.served).filter(|(_, p)| p.is_unfinished());
        let other = || in_turn().find(|(_, page)| page.is_unfinished());
        new.or_else(last).or_else(other).map(|(id, _)| *id)
    }
}

impl PageTask {
    /// The picture to render, of a job with pictures of this `size` and so many `samples`.
    pub(super) fn level(&self, size: [u32; 2], samples: u32) -> Option<Level> {
        level::next(self.done, (size, samples), self.speed, self.wish.is_moving)
    }
}
