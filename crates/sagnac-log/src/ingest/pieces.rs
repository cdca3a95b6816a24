//! Pieces of a log: read in order, parsed on all available threads, returned in order.
//!
//! ```text
//! Feed (one at a time: read, hash, unpack) ─▶ parse (any order) ─▶ ready pieces ─▶ next(), in order
//! ```
//!
//! The thread that waits for a piece takes part in the work, so one thread is enough; helpers are started
//! only for logs of more than one piece. The result does not depend on their number. Memory: at most
//! [`Shared::room`] pieces.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};
use crate::ingest::columns::feed::{Feed, Parser};
use crate::ingest::columns::raw::RawRows;
use crate::threads::{helpers, spawn};

/// More threads than this do not read one log faster: hashing is sequential.
const MAX_HELPERS: usize = 3;

/// Feed and numbering of its pieces; whoever holds it reads.
struct FeedInTurn {
    /// `None` at the end: the file is closed there, whichever threads still hold this.
    feed: Option<Box<dyn Feed>>,
    read: u64,
}

/// Pieces that are parsed and wait for their turn.
#[derive(Default)]
struct Ready {
    pieces: BTreeMap<u64, Result<RawRows>>,
    /// Number of pieces, once it is known.
    total: Option<u64>,
    /// Buffers to be used again.
    spare: Vec<RawRows>,
    /// The receiver is closed.
    abandoned: bool,
}

struct Shared {
    reading: Mutex<FeedInTurn>,
    ready: Mutex<Ready>,
    changed: Condvar,
    /// Largest number of waiting pieces.
    room: usize,
}

/// No change under these locks can be incomplete, so a poisoned lock is still valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What one thread needs to turn bytes into rows.
struct Worker {
    text: Vec<u8>,
    parser: Option<Box<dyn Parser>>,
}

impl Shared {
    /// Reads and parses one piece; false at the end.
    fn work(&self, worker: &mut Worker, mut reading: MutexGuard<'_, FeedInTurn>) -> bool {
        let Some(feed) = &mut reading.feed else { return false };
        let mut rows = lock(&self.ready).spare.pop().unwrap_or_default();
        // A panic of a third-party decoder means that the file is damaged.
        let read = catch_unwind(AssertUnwindSafe(|| feed.next(&mut worker.text, &mut rows)));
        let read = read.unwrap_or_else(|_| Err(Error::damaged("file (its decoder gave up)")));
        let number = reading.read;
        if matches!(read, Ok(false)) {
            reading.feed = None;
            drop(reading);
            lock(&self.ready).total = Some(number);
            self.changed.notify_all();
            return false;
        }
        reading.read += 1;
        if read.is_err() {
            reading.feed = None;
        }
        drop(reading);
        let ended = read.is_err();
        let piece = read.and_then(|_| {
            // This piece must be returned in any case, or all threads wait for it.
            let parsed = catch_unwind(AssertUnwindSafe(|| {
                if let Some(parser) = &mut worker.parser {
                    parser.parse(&worker.text, &mut rows);
                }
                rows
            }));
            parsed.map_err(|_| Error::defect("a piece of the log could not be parsed"))
        });
        let mut ready = lock(&self.ready);
        if ended {
            ready.total = Some(number + 1);
        }
        ready.pieces.insert(number, piece);
        drop(ready);
        self.changed.notify_all();
        !ended
    }

    /// Works while there is room, until the end.
    fn help(&self, mut worker: Worker) {
        loop {
            let mut ready = lock(&self.ready);
            while ready.pieces.len() >= self.room && !ready.abandoned {
                ready = self.changed.wait(ready).unwrap_or_else(PoisonError::into_inner);
            }
            if ready.abandoned {
                return;
            }
            drop(ready);
            if !self.work(&mut worker, lock(&self.reading)) {
                return;
            }
        }
    }
}

/// The pieces of one log.
pub(crate) struct Pieces {
    shared: Arc<Shared>,
    worker: Worker,
    /// Helpers to be started when there is more than one piece.
    helpers: Vec<Worker>,
    next: u64,
    lines: u64,
}

impl Pieces {
    /// `lines_before`: lines of the file above its first row. Without `parallel` nothing is read ahead.
    pub(crate) fn new(feed: Box<dyn Feed>, lines_before: u64, parallel: bool) -> Self {
        let worker = || Worker { text: Vec::new(), parser: feed.parser() };
        let most = if parallel { helpers(MAX_HELPERS) } else { 0 };
        let (worker, helpers) = (worker(), (0..most).map(|_| worker()).collect());
        let shared = Shared {
            reading: Mutex::new(FeedInTurn { feed: Some(feed), read: 0 }),
            ready: Mutex::default(),
            changed: Condvar::new(),
            room: 2 + 2 * most,
        };
        Self { shared: Arc::new(shared), worker, helpers, next: 0, lines: lines_before }
    }

    /// The next piece into `rows`; false at the end.
    pub(crate) fn next(&mut self, rows: &mut RawRows) -> Result<bool> {
        if self.next == 1 {
            self.start_helpers();
        }
        let Some(piece) = self.wait() else { return Ok(false) };
        self.next += 1;
        let piece = piece.map_err(|e| if e.place.line.is_none() { e.line(self.lines + 1) } else { e })?;
        let used = std::mem::replace(rows, piece);
        rows.lines_before = self.lines;
        self.lines += rows.lines;
        let mut ready = lock(&self.shared.ready);
        if ready.spare.len() <= self.shared.room {
            ready.spare.push(used);
        }
        drop(ready);
        self.shared.changed.notify_all();
        Ok(true)
    }

    /// The piece whose turn it is, working on it or another meanwhile; `None` after the last.
    fn wait(&mut self) -> Option<Result<RawRows>> {
        loop {
            if let Some(turn) = self.turn() {
                return turn;
            }
            let reading = lock(&self.shared.reading);
            // While this thread waited to read, the piece may have come.
            if let Some(turn) = self.turn() {
                return turn;
            }
            let ahead = reading.read > self.next && lock(&self.shared.ready).pieces.len() >= self.shared.room;
            if reading.feed.is_none() || ahead {
                // Another thread parses it and notifies when it is ready.
                drop(reading);
                self.sleep();
            } else {
                self.shared.work(&mut self.worker, reading);
            }
        }
    }

    /// The piece if it is there, `Some(None)` after the last.
    fn turn(&self) -> Option<Option<Result<RawRows>>> {
        let mut ready = lock(&self.shared.ready);
        match ready.pieces.remove(&self.next) {
            Some(piece) => Some(Some(piece)),
            None if ready.total.is_some_and(|total| self.next >= total) => Some(None),
            None => None,
        }
    }

    fn sleep(&self) {
        let nothing =
            |ready: &mut Ready| !ready.pieces.contains_key(&self.next) && ready.total.is_none_or(|t| self.next < t);
        let waited = self.shared.changed.wait_while(lock(&self.shared.ready), nothing);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }

    fn start_helpers(&mut self) {
        for worker in self.helpers.drain(..) {
            let shared = Arc::clone(&self.shared);
            // Without a further thread this one does all the work.
            let _ = spawn("read", move || shared.help(worker));
        }
    }
}

impl Drop for Pieces {
    /// Helpers end by themselves; one that is blocked on a pipe is not joined.
    fn drop(&mut self) {
        lock(&self.shared.ready).abandoned = true;
        self.shared.changed.notify_all();
    }
}
