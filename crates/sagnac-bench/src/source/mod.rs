//! Where bytes come from.
//!
//! ```text
//! address ─▶ a thread each ─▶ Arrived { source, time, bytes | connected | lost | ended } ─▶ queue ─▶ recorder
//! ```
//!
//! A source that is lost is connected again, with a pause that grows from 0.2 to 2 s until a connection holds for longer; it leaves a gap, not an
//! end. A fault of its thread is a loss like others. The queue is bounded: a recorder
//! that cannot write holds up TCP, files and pipes, which then wait. A serial port and UDP cannot wait; what the system drops there shows as
//! missing rows.

mod address;
mod poll;
mod replay;
mod stream;

pub use address::{Address, Instrument};
pub(crate) use poll::spawn_poll;
pub(crate) use stream::spawn_stream;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use serde::{Deserialize, Serialize};

use crate::journal::{Entry, EntryKind};

/// Time to wait for bytes before a source looks whether it is to stop.
pub(crate) const PATIENCE: Duration = Duration::from_millis(200);
/// Pauses between two attempts to connect.
const FIRST_PAUSE: Duration = Duration::from_millis(200);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

/// What a source sends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SourceEvent {
    /// Bytes.
    Bytes(Vec<u8>),
    /// It is connected.
    Connected(Connection),
    /// It is lost: why.
    Lost(String),
    /// It has ended by itself.
    Ended,
}

/// Something that came from a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrived {
    /// Number of the source.
    pub source: u8,
    /// Time of arrival, ns since 1970.
    pub at_ns: i64,
    /// What came.
    pub what: SourceEvent,
}

/// A connection that was made, as the journal has it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Connection {
    /// To what, in words.
    pub to: String,
    /// Place of its first byte, for a source that can be read from a place.
    pub from_byte: Option<u64>,
    /// Its first bytes may be the end of a row: of a network line or a serial port.
    pub may_be_cut: bool,
}

impl Connection {
    /// Of a source whose first bytes begin a row.
    fn whole(to: impl Into<String>) -> Self {
        Self { to: to.into(), ..Self::default() }
    }

    /// Of a source that is read from a place on.
    fn from_byte(to: impl Into<String>, at: u64) -> Self {
        Self { to: to.into(), from_byte: Some(at), may_be_cut: false }
    }

    /// Of a line that may be joined within a row.
    fn within(to: impl Into<String>) -> Self {
        Self { to: to.into(), from_byte: None, may_be_cut: true }
    }

    /// In an entry of the journal.
    pub(crate) fn of(entry: &Entry) -> Self {
        serde_json::from_slice(&entry.payload).unwrap_or_else(|_| Self::whole(String::from_utf8_lossy(&entry.payload)))
    }
}

/// How far a source that can be read from a place was read.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BytePlace(pub(crate) Option<u64>);

impl BytePlace {
    /// Follows an entry of the first source.
    pub(crate) fn follow(&mut self, entry: &Entry) {
        match entry.kind {
            EntryKind::Connected if entry.source == 0 => {
                self.0 = Connection::of(entry).from_byte;
            }
            EntryKind::Bytes if entry.source == 0 => self.0 = self.0.map(|place| place + entry.payload.len() as u64),
            _ => {}
        }
    }
}

/// Where a source that can be read from a place goes on.
#[derive(Clone, Debug, Default)]
pub(crate) struct GoOn {
    pub(crate) place: u64,
    /// The bytes before that place, as they were recorded: a file that has others there is another one.
    pub(crate) tail: Vec<u8>,
}

/// Most bytes of a tail.
const TAIL_BYTES: usize = 4096;

impl GoOn {
    /// Follows the entries of the first source with their place behind them.
    pub(crate) fn follow(&mut self, entry: &Entry, place: BytePlace) {
        let Some(place) = place.0.filter(|_| entry.source == 0) else { return };
        if entry.kind == EntryKind::Connected && place != self.place {
            self.tail.clear();
        } else if entry.kind == EntryKind::Bytes {
            self.tail.extend_from_slice(&entry.payload);
            self.tail.drain(..self.tail.len().saturating_sub(TAIL_BYTES));
        }
        self.place = place;
    }
}

/// The time of arrivals: the clock of the computer at the start, and its monotonic clock since, so that a clock that is set does not step it.
#[derive(Clone, Copy, Debug)]
pub struct ArrivalClock {
    start: Instant,
    start_ns: i64,
}

impl ArrivalClock {
    /// From now on; not before `after_ns`, so that a resumed recording goes on behind the one before.
    pub fn start(after_ns: i64) -> Self {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let now_ns = i64::try_from(since.as_nanos()).unwrap_or(i64::MAX);
        Self { start: Instant::now(), start_ns: now_ns.max(after_ns) }
    }

    /// Now, ns since 1970.
    pub fn now_ns(&self) -> i64 {
        let since = i64::try_from(self.start.elapsed().as_nanos()).unwrap_or(i64::MAX);
        self.start_ns.saturating_add(since)
    }
}

/// Tells threads to stop, and wakes those that wait.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<(Mutex<bool>, Condvar)>);

impl Stop {
    /// Tells every thread to stop.
    pub fn stop(&self) {
        *self.0.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.0.1.notify_all();
    }

    /// True once it was told.
    pub fn is_stopped(&self) -> bool {
        *self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for so long, or until the stop; true if it is to stop.
    pub fn wait(&self, time: Duration) -> bool {
        let guard = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.0.1.wait_timeout_while(guard, time, |stopped| !*stopped);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

/// The way of one source to the recorder.
pub(crate) struct Out {
    pub(crate) number: u8,
    pub(crate) clock: ArrivalClock,
    pub(crate) to: SyncSender<Arrived>,
    pub(crate) stop: Stop,
}

impl Out {
    /// Sends; false when nobody records any more.
    pub(crate) fn send(&self, what: SourceEvent) -> bool {
        self.to.send(Arrived { source: self.number, at_ns: self.clock.now_ns(), what }).is_ok()
    }

    /// Runs a source that can be connected again, until it is to stop or has ended. `session` reports how long it held and how it ended.
    pub(crate) fn keep(&self, mut session: impl FnMut(&Self) -> SessionEnd) {
        let mut pause = FIRST_PAUSE;
        let mut said = String::new();
        while !self.stop.is_stopped() {
            let begun = Instant::now();
            let ended = catch_unwind(AssertUnwindSafe(|| session(self)));
            let why = match ended.unwrap_or_else(|_| SessionEnd::Lost("a fault of this program".to_owned())) {
                SessionEnd::Stopped => return,
                SessionEnd::Ended => {
                    self.send(SourceEvent::Ended);
                    return;
                }
                SessionEnd::Lost(why) => {
                    // One that answers wrongly at once is not asked faster than one that is away.
                    if begun.elapsed() > LONGEST_PAUSE {
                        pause = FIRST_PAUSE;
                        said.clear();
                    }
                    why
                }
                SessionEnd::NotConnected(why) => why,
            };
            // The same reason is not said at each attempt.
            if why != said && !self.send(SourceEvent::Lost(why.clone())) {
                return;
            }
            said = why;
            if self.stop.wait(pause) {
                return;
            }
            pause = (pause * 2).min(LONGEST_PAUSE);
        }
    }
}

/// How a connection ended.
pub(crate) enum SessionEnd {
    /// It is to stop.
    Stopped,
    /// The source has nothing more.
    Ended,
    /// It broke.
    Lost(String),
    /// It was not made.
    NotConnected(String),
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use super::*;

    /// A thread that panics says so, and its source begins again.
    #[test]
    fn a_fault_of_a_source_is_a_loss() {
        let (to, from) = sync_channel(8);
        let out = Out { number: 0, clock: ArrivalClock::start(0), to, stop: Stop::default() };
        let mut sessions = 0;
        out.keep(|_| {
            sessions += 1;
            assert!(sessions > 1, "a fault on purpose");
            SessionEnd::Ended
        });
        drop(out);
        let said: Vec<SourceEvent> = from.iter().map(|arrived| arrived.what).collect();
        assert_eq!(said, [SourceEvent::Lost("a fault of this program".to_owned()), SourceEvent::Ended]);
    }
}
