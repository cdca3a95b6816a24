//! The recorder: from the queue of all sources to the journal, on a path of its own.
//!
//! ```text
//! queue ─▶ block ─write, every 0.1 s─▶ journal ─▶ published length ─▶ everything else reads behind it
//!                └─fsync, every second
//! ```
//!
//! Nothing else can hold it up: who shows, fits or judges reads the journal behind the published length, at his own pace. `kill -9` loses at most
//! what waits for its block, 0.1 s; a power cut at most the second since the last fsync.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sagnac_log::{Error, Result};
use sagnac_units::format::significant;
use serde::Serialize;

use crate::journal::{Entry, EntryKind, JournalWriter};
use crate::source::{ArrivalClock, Arrived, SourceEvent, Stop};

/// A block is written after this time, or when it is this long.
const WRITE_AFTER: Duration = Duration::from_millis(100);
const WRITE_BYTES: usize = 1 << 18;
const SYNC_AFTER: Duration = Duration::from_secs(1);
/// Entries that a full queue holds.
pub(crate) const QUEUE: usize = 256;
/// Time between two looks at the sources' silence.
const LOOK: Duration = Duration::from_millis(50);

/// How often the room on the disk is looked at.
const ROOM_LOOK: Duration = Duration::from_secs(60);
/// A warning comes when the disk is full in this time, s, or has less than this.
const ROOM_S: f64 = 2.0 * 3600.0;
const LEAST_ROOM_BYTES: f64 = (256_u64 << 20) as f64;

/// How a source is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SourceState {
    /// Nothing came yet.
    Waiting,
    /// It sends.
    Live,
    /// It is connected, and says nothing.
    Silent,
    /// It is lost, and connected again as soon as it can be.
    Lost,
    /// It has ended by itself.
    Ended,
}

/// A source, as it is shown.
#[derive(Clone, Debug, Serialize)]
pub struct SourceStatus {
    /// Its name.
    pub name: String,
    /// How it is.
    pub state: SourceState,
    /// Why, if it is lost.
    pub why: String,
    /// Time of its last byte, ns since 1970; 0 before the first.
    pub last_ns: i64,
    /// Bytes that came from it.
    pub bytes: u64,
    /// It is silent after this time, s.
    pub silent_after_s: f64,
}

impl SourceStatus {
    /// One that nothing came from.
    pub fn waiting(name: String, silent_after_s: f64) -> Self {
        Self { name, state: SourceState::Waiting, why: String::new(), last_ns: 0, bytes: 0, silent_after_s }
    }
}

#[derive(Debug, Default)]
struct Shown {
    length: u64,
    ended: bool,
}

/// How far the journal is written, for those who read behind it.
#[derive(Clone, Debug, Default)]
pub struct Published(Arc<(Mutex<Shown>, Condvar)>);

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Published {
    /// The journal is whole up to here.
    pub fn length(&self) -> u64 {
        lock(&self.0.0).length
    }

    /// Nothing more will come.
    pub fn is_ended(&self) -> bool {
        lock(&self.0.0).ended
    }

    pub(crate) fn publish(&self, length: u64) {
        lock(&self.0.0).length = length;
        self.0.1.notify_all();
    }

    /// The journal ends here.
    pub fn end(&self) {
        lock(&self.0.0).ended = true;
        self.0.1.notify_all();
    }

    /// Waits until there is more than this, or the end, or so long; the length then.
    pub fn wait_beyond(&self, length: u64, time: Duration) -> u64 {
        let nothing = |shown: &mut Shown| shown.length <= length && !shown.ended;
        let waited = self.0.1.wait_timeout_while(lock(&self.0.0), time, nothing);
        waited.unwrap_or_else(PoisonError::into_inner).0.length
    }
}

/// The state of all sources, shared with those who show it.
#[derive(Clone, Debug, Default)]
pub struct Sources(Arc<Mutex<Vec<SourceStatus>>>);

impl Sources {
    /// Of these sources.
    pub fn new(all: Vec<SourceStatus>) -> Self {
        Self(Arc::new(Mutex::new(all)))
    }

    /// As they are now.
    pub fn now(&self) -> Vec<SourceStatus> {
        lock(&self.0).clone()
    }

    fn with<T>(&self, source: usize, change: impl FnOnce(&mut SourceStatus) -> T) -> Option<T> {
        lock(&self.0).get_mut(source).map(change)
    }

    fn count(&self) -> usize {
        lock(&self.0).len()
    }
}

/// The room on the disk of a recording, and which of it was warned of last.
struct DiskRoom {
    begun: Instant,
    begun_bytes: u64,
    said_bytes: f64,
}

impl DiskRoom {
    fn new(begun_bytes: u64) -> Self {
        Self { begun: Instant::now(), begun_bytes, said_bytes: f64::INFINITY }
    }

    /// A warning while there is time to make room; again when half of it is gone. The log that is made at the end takes as much as the
    /// journal at most.
    fn warning(&mut self, journal_bytes: u64, free_bytes: u64) -> Option<String> {
        let (journal, free) = (journal_bytes as f64, free_bytes as f64);
        let per_s = journal_bytes.saturating_sub(self.begun_bytes) as f64 / self.begun.elapsed().as_secs_f64().max(1.0);
        let left_s = (free - journal).max(0.0) / per_s.max(1.0);
        if (left_s > ROOM_S && free > LEAST_ROOM_BYTES) || free > 0.5 * self.said_bytes {
            return None;
        }
        self.said_bytes = free;
        let hours = significant(left_s / 3600.0, 2);
        Some(format!(
            "the disk has {:.0} MB of room, enough for {hours} h of this test and its log: make room now",
            free / 1e6
        ))
    }
}

/// Bytes that may still be written to the disk of a file.
#[cfg(unix)]
fn free_bytes(path: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(path).ok()?;
    disk.f_bavail.checked_mul(disk.f_frsize)
}

/// A system that is not asked.
#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<u64> {
    None
}

/// Records until the first source ends or everybody is to stop.
pub(crate) struct JournalRecorder {
    pub(crate) journal: JournalWriter,
    pub(crate) clock: ArrivalClock,
    pub(crate) published: Published,
    pub(crate) sources: Sources,
    pub(crate) stop: Stop,
}

impl JournalRecorder {
    /// Records what comes.
    ///
    /// # Errors
    /// A write that failed: then nothing more is recorded, and what was recorded is kept.
    pub(crate) fn run(mut self, queue: &Receiver<Arrived>) -> Result<()> {
        let recorded = self.pour(queue);
        let closed = recorded.and_then(|()| self.close());
        self.stop.stop();
        self.published.end();
        closed
    }

    fn pour(&mut self, queue: &Receiver<Arrived>) -> Result<()> {
        let (mut written, mut synced, mut looked) = (Instant::now(), Instant::now(), Instant::now());
        let (mut room, mut room_looked) = (DiskRoom::new(self.journal.length()), None::<Instant>);
        loop {
            match queue.recv_timeout(LOOK) {
                Ok(arrived) => {
                    if self.took(arrived)? {
                        return Ok(());
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            if self.journal.waiting() >= WRITE_BYTES || written.elapsed() >= WRITE_AFTER {
                self.write()?;
                written = Instant::now();
            }
            if synced.elapsed() >= SYNC_AFTER {
                self.journal.sync()?;
                synced = Instant::now();
            }
            if looked.elapsed() >= LOOK {
                self.look_for_silence()?;
                looked = Instant::now();
            }
            if room_looked.is_none_or(|looked| looked.elapsed() >= ROOM_LOOK) {
                room_looked = Some(Instant::now());
                let free = free_bytes(self.journal.path());
                if let Some(said) = free.and_then(|free| room.warning(self.journal.length(), free)) {
                    self.journal.push(&Entry::text(EntryKind::Note, 0, self.clock.now_ns(), &said))?;
                }
            }
            if self.stop.is_stopped() {
                return self.rest(queue);
            }
        }
    }

    /// What was on its way when everybody was told to stop.
    fn rest(&mut self, queue: &Receiver<Arrived>) -> Result<()> {
        while let Ok(arrived) = queue.try_recv() {
            self.took(arrived)?;
        }
        Ok(())
    }

    /// Takes something over; true at the end of the first source.
    fn took(&mut self, arrived: Arrived) -> Result<bool> {
        let Arrived { source, at_ns, what } = arrived;
        let is_first = source == 0;
        let entry = match what {
            SourceEvent::Bytes(payload) => {
                self.sources.with(source.into(), |status| {
                    status.state = SourceState::Live;
                    status.last_ns = at_ns;
                    status.bytes += payload.len() as u64;
                });
                Entry { kind: EntryKind::Bytes, source, arrival_ns: at_ns, payload }
            }
            SourceEvent::Connected(to) => {
                self.sources.with(source.into(), |status| {
                    status.state = SourceState::Waiting;
                    status.last_ns = at_ns;
                });
                Entry::text(EntryKind::Connected, source, at_ns, &serde_json::to_string(&to).unwrap_or(to.to))
            }
            SourceEvent::Lost(why) => {
                self.sources.with(source.into(), |status| {
                    status.state = SourceState::Lost;
                    status.why.clone_from(&why);
                });
                Entry::text(EntryKind::Lost, source, at_ns, &why)
            }
            SourceEvent::Ended => {
                self.sources.with(source.into(), |status| status.state = SourceState::Ended);
                Entry::text(EntryKind::Ended, source, at_ns, "")
            }
        };
        self.journal.push(&entry)?;
        Ok(is_first && entry.kind == EntryKind::Ended)
    }

    fn write(&mut self) -> Result<()> {
        let length = self.journal.write()?;
        self.published.publish(length);
        Ok(())
    }

    /// Names a source that is connected and silent.
    fn look_for_silence(&mut self) -> Result<()> {
        let now_ns = self.clock.now_ns();
        for source in 0..self.sources.count() {
            let fell_silent = self.sources.with(source, |status| {
                let is_connected =
                    matches!(status.state, SourceState::Live | SourceState::Waiting) && status.last_ns > 0;
                let silent = is_connected && (now_ns - status.last_ns) as f64 * 1e-9 > status.silent_after_s;
                if silent {
                    status.state = SourceState::Silent;
                }
                silent.then(|| format!("{}: silent for {} s", status.name, status.silent_after_s))
            });
            if let Some(Some(said)) = fell_silent {
                let number = u8::try_from(source).unwrap_or(u8::MAX);
                self.journal.push(&Entry::text(EntryKind::Note, number, now_ns, &said))?;
            }
        }
        Ok(())
    }

    fn close(&mut self) -> Result<()> {
        self.journal.push(&Entry::text(EntryKind::Stopped, 0, self.clock.now_ns(), ""))?;
        self.write()?;
        self.journal.sync()
    }
}

/// The error of a thread that could not be started.
pub(crate) fn no_thread(error: &std::io::Error) -> Error {
    Error::input(
        format!("cannot start a thread: {error}"),
        "raise the limit of threads (`ulimit -u`) or close other programs",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A test of 1 MB/s: no word with a day of room, one with an hour, none again before half of that is gone, and one on a small disk.
    #[test]
    fn a_full_disk_is_foreseen() {
        let begun = Instant::now().checked_sub(Duration::from_secs(1000)).unwrap();
        let mut room = DiskRoom { begun, begun_bytes: 0, said_bytes: f64::INFINITY };
        let journal = 1_000_000_000;
        assert_eq!(room.warning(journal, 100_000_000_000), None);
        let said = room.warning(journal, 4_600_000_000).unwrap();
        assert!(said.contains("4600 MB") && said.contains("1.0 h of this test"), "{said}");
        assert_eq!(room.warning(journal, 4_000_000_000), None);
        assert!(room.warning(journal, 2_000_000_000).unwrap().contains("0.28 h"));
        assert!(DiskRoom::new(0).warning(0, 100 << 20).is_some());
        assert!(cfg!(not(unix)) || free_bytes(Path::new(".")).is_some_and(|free| free > 0));
    }
}
