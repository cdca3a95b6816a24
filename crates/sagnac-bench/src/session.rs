//! A recording from its beginning to its end.

use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;

use sagnac_log::setup::{PollSetup, Setup};
use sagnac_log::threads::spawn;
use sagnac_log::{Error, Result};

use crate::decode::Decoder;
use crate::journal::{Entry, EntryKind, JournalReader, JournalWriter};
use crate::record::{JournalRecorder, Published, QUEUE, SourceStatus, Sources, no_thread};
use crate::source::{Address, ArrivalClock, BytePlace, GoOn, Instrument, Out, Stop, spawn_poll, spawn_stream};
use crate::start::Start;

/// A source is silent after so long by default, s, and after so many rows or questions.
const SILENT_AFTER_S: f64 = 2.5;
const SILENT_ROWS: f64 = 3.0;

/// The journal next to a log.
pub fn journal_of(log: &Path) -> PathBuf {
    let mut name = log.as_os_str().to_owned();
    name.push(".journal");
    PathBuf::from(name)
}

/// A recording that runs.
pub struct Session {
    /// How far the journal is written.
    pub published: Published,
    /// How the sources are.
    pub sources: Sources,
    /// Ends the recording.
    pub stop: Stop,
    /// The time of arrivals.
    pub clock: ArrivalClock,
    /// What is recorded.
    pub start: Start,
    recorder: JoinHandle<Result<()>>,
}

/// What was recorded before.
struct Before {
    start: Start,
    newest_ns: i64,
    go_on: GoOn,
}

impl Session {
    /// Begins a recording, or goes on with one.
    ///
    /// # Errors
    /// Sources that are none; a journal that is there, or that is not where it should be, or of another setup.
    pub fn begin(setup: &Setup, program: &str, journal: &Path, resume: bool) -> Result<Self> {
        let address = address_of(setup)?;
        let instruments = instruments_of(setup)?;
        let names = names_of(&address, &instruments);
        // Headers of the setup that are none are found before anything is recorded.
        Decoder::new(&Start::new(program, 0, setup, names.clone()))?;
        let (mut writer, before) = match resume {
            true => {
                let before = before(journal)?;
                check_same(&before.start, setup)?;
                (JournalWriter::resume(journal)?, Some(before))
            }
            false => (JournalWriter::create(journal)?, None),
        };
        let clock = ArrivalClock::start(before.as_ref().map_or(0, |before| before.newest_ns));
        // Another source is read from its beginning; the same one may come at another speed.
        let bare =
            |source: Option<String>| source.map(|source| source.split('?').next().unwrap_or_default().to_owned());
        let is_same = |before: &&Before| bare(before.start.setup().bench.source) == bare(setup.bench.source.clone());
        let go_on = before.as_ref().filter(is_same).map(|before| before.go_on.clone()).unwrap_or_default();
        let start = match before {
            Some(before) => {
                writer.push(&Entry::text(EntryKind::Resumed, 0, clock.now_ns(), program))?;
                before.start
            }
            None => {
                let start = Start::new(program, clock.now_ns(), setup, names.clone());
                // Twice, in blocks of their own: without it no row could be read.
                writer.push(&start.entry()?)?;
                writer.write()?;
                writer.push(&start.entry()?)?;
                start
            }
        };
        let published = Published::default();
        published.publish(writer.write()?);
        writer.sync()?;
        let sources = Sources::new(statuses(setup, &names));
        let stop = Stop::default();
        let (to, queue) = sync_channel(QUEUE);
        let out = |number: usize| {
            let number = u8::try_from(number).unwrap_or(u8::MAX);
            Out { number, clock, to: to.clone(), stop: stop.clone() }
        };
        let recorder = JournalRecorder {
            journal: writer,
            clock,
            published: published.clone(),
            sources: sources.clone(),
            stop: stop.clone(),
        };
        let recorder = spawn("record", move || recorder.run(&queue)).map_err(|e| no_thread(&e))?;
        spawn_stream(address, go_on, setup.clone(), out(0)).map_err(|e| no_thread(&e))?;
        let mut number = 1;
        for (instrument, poll) in instruments {
            let outs = (0..poll.columns.len()).map(|at| out(number + at)).collect();
            number += poll.columns.len();
            spawn_poll(instrument, poll, outs).map_err(|e| no_thread(&e))?;
        }
        Ok(Self { published, sources, stop, clock, start, recorder })
    }

    /// True once nothing more is recorded.
    pub fn is_ended(&self) -> bool {
        self.published.is_ended()
    }

    /// Waits for the end.
    ///
    /// # Errors
    /// A write that failed.
    pub fn join(self) -> Result<()> {
        let defect = |_| Err(Error::defect("the recorder gave up"));
        self.recorder.join().unwrap_or_else(defect)
    }
}

/// The gyro's source.
fn address_of(setup: &Setup) -> Result<Address> {
    let source = setup.bench.source.as_deref().ok_or_else(|| {
        Error::input("the source of the gyro's bytes is not given", "give --source, or `source` under [bench]: -, file:PATH, tcp://HOST:PORT, udp://HOST:PORT, serial:DEVICE, replay:LOG")
            .column("bench.source")
    })?;
    source.parse()
}

fn instruments_of(setup: &Setup) -> Result<Vec<(Instrument, PollSetup)>> {
    let one = |poll: &PollSetup| {
        let instrument: Instrument = poll.source.parse()?;
        let is_scpi = matches!(instrument, Instrument::Scpi(_));
        if let Some(column) = poll.columns.iter().find(|column| column.query.is_some() != is_scpi) {
            let what =
                if is_scpi { "an SCPI instrument needs a `query`" } else { "a Modbus instrument needs a `register`" };
            return Err(Error::input(
                what,
                format!("give each column of this instrument a `{}`", if is_scpi { "query" } else { "register" }),
            )
            .column("bench.poll.columns")
            .value(&column.name));
        }
        Ok((instrument, poll.clone()))
    };
    setup.bench.polls.iter().map(one).collect()
}

/// Names of the sources: the gyro's, then each column of each instrument.
fn names_of(address: &Address, instruments: &[(Instrument, PollSetup)]) -> Vec<String> {
    let columns = instruments.iter().flat_map(|(instrument, poll)| {
        poll.columns.iter().map(move |column| format!("{} of {}", column.name, instrument.shown()))
    });
    std::iter::once(address.shown()).chain(columns).collect()
}

fn statuses(setup: &Setup, names: &[String]) -> Vec<SourceStatus> {
    let rows = SILENT_ROWS * setup.sample_interval_s.unwrap_or(0.0);
    let gyro = setup.bench.silent_after_s.unwrap_or(SILENT_AFTER_S).max(rows);
    let asked = setup.bench.polls.iter().flat_map(|poll| poll.columns.iter().map(|_| SILENT_ROWS * poll.every_s));
    let after = std::iter::once(gyro).chain(asked.map(|s| s.max(SILENT_AFTER_S)));
    names.iter().cloned().zip(after).map(|(name, s)| SourceStatus::waiting(name, s)).collect()
}

/// Reads what was recorded before, as far as going on needs it.
fn before(journal: &Path) -> Result<Before> {
    if !journal.exists() {
        return Err(Error::input("there is no recording to continue", "remove --resume to begin one")
            .file(journal.display().to_string()));
    }
    let mut reader = JournalReader::open(journal)?;
    let first = reader.next_block(u64::MAX)?.unwrap_or_default();
    let start = Start::of(&first).map_err(|e| e.file(journal.display().to_string()))?;
    let (mut newest_ns, mut place, mut go_on) = (start.started_ns, BytePlace::default(), GoOn::default());
    let mut entries = first;
    loop {
        for entry in &entries {
            newest_ns = newest_ns.max(entry.arrival_ns);
            place.follow(entry);
            go_on.follow(entry, place);
        }
        match reader.next_block(u64::MAX)? {
            Some(next) => entries = next,
            None => return Ok(Before { start, newest_ns, go_on }),
        }
    }
}

/// A recording goes on with the setup that it began with, as far as rows and windows depend on it.
fn check_same(start: &Start, setup: &Setup) -> Result<()> {
    let before = start.setup();
    let same_bench = before.bench.format == setup.bench.format
        && before.bench.headers == setup.bench.headers
        && before.bench.polls == setup.bench.polls;
    if before.makes_the_windows_of(setup) && same_bench {
        return Ok(());
    }
    Err(Error::input(
        "the setup differs from the recording's: rows or windows would change",
        "give the bench.toml of the recording, or make the log with --finish",
    ))
}
