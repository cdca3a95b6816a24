//! What is known of a test while it runs.
//!
//! ```text
//! journal ─▶ rows ─┬▶ seconds ─▶ trend (shown)
//!                  │         └▶ minutes ─▶ warnings
//!                  └▶ reader of logs ─▶ windows, noise ─each minute of the record▶ fit so far ─▶ enough?
//! ```
//!
//! A thread reads rows, another one fits; neither can hold up the recorder. A fit begins no sooner than a minute of the record after the one before,
//! and takes at most a twentieth of a core over time.

mod minutes;
mod pairs;
mod seconds;
mod study;
mod trend;
mod warnings;

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use arrow_array::RecordBatch;
use sagnac::allan::{NoiseBudget, NoiseSoFar};
use sagnac::fit::Model;
use sagnac::plan::EnoughRequest;
use sagnac::window::{WindowBuilder, Windows};
use sagnac_log::Result;
use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::setup::Setup;
use sagnac_log::threads::spawn;
use sagnac_units::s_from_ns;
use serde::Serialize;

pub use study::{CurveAt, DeviationAt, ResidualAt, Study, StudyAxis};
pub use trend::TrendPoint;
pub use warnings::{Warning, WarningKind};

use crate::decode::{ClockReport, Counts, Event};
use crate::live::minutes::Minutes;
use crate::live::seconds::{Columns, Seconds};
use crate::live::study::Studies;
use crate::live::trend::Trend;
use crate::live::warnings::MinuteWatch;
use crate::record::no_thread;
use crate::rows::JournalRows;

/// A fit is made of the record after so long, s of the record.
const STUDY_S: f64 = 60.0;
/// Part of a core that fits may take.
const FIT_SHARE: u32 = 20;
/// Events that are shown.
const SHOWN_EVENTS: usize = 100;
/// Window by default, s.
const WINDOW_S: f64 = 100.0;

/// What is asked of the fits.
#[derive(Clone, Debug)]
pub struct LiveRequest {
    /// The model; `auto` searches for one.
    pub model: Model,
    /// What the test is to tell; `None` without limits.
    pub enough: Option<EnoughRequest>,
    /// The fit is made whenever a minute of the record has passed, however long it takes: for a replay, whose hours are seconds.
    pub every_minute: bool,
}

/// Names of what is shown, in the order of the values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Names {
    /// Letters of the axes.
    pub axes: Vec<char>,
    /// Thermometers.
    pub thermometers: Vec<String>,
}

/// The newest values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Now {
    /// s since the first row.
    pub t_s: f64,
    /// Rates of the last second, °/h.
    pub rates_dph: Vec<Option<f64>>,
    /// Temperatures, °C.
    pub temperatures_c: Vec<Option<f64>>,
    /// Their rates over the last minute, °C/min.
    pub temperature_rates_cpm: Vec<Option<f64>>,
}

/// Everything that is known now.
#[derive(Clone, Debug, Default)]
pub struct LiveState {
    /// Names of the columns.
    pub names: Names,
    /// The newest values.
    pub now: Now,
    /// What was recorded.
    pub counts: Counts,
    /// The gyro's clock next to the computer's.
    pub clock: ClockReport,
    /// What happened, newest last.
    pub events: Vec<Event>,
    /// What is wrong, and was.
    pub warnings: Vec<Warning>,
    /// The fit so far.
    pub study: Arc<Study>,
    /// Why rows are no longer read, if they are not.
    pub failed: Option<String>,
    /// Counts the changes of each part, so that those who show it can tell.
    pub versions: Versions,
    trend: Trend,
}

/// Changes so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Versions {
    /// Of the newest values.
    pub now: u64,
    /// Of the fit.
    pub study: u64,
    /// Of events and warnings.
    pub events: u64,
}

impl LiveState {
    /// The last minutes, second by second.
    pub fn seconds(&self) -> Vec<TrendPoint> {
        self.trend.seconds()
    }

    /// The whole test, in means.
    pub fn means(&self) -> Vec<TrendPoint> {
        self.trend.means()
    }

    /// The newest point.
    pub fn newest(&self) -> Option<TrendPoint> {
        self.trend.newest().cloned()
    }
}

/// What is known, shared with those who show it.
#[derive(Clone, Debug, Default)]
pub struct Live(Arc<(Mutex<LiveState>, Condvar)>);

impl Live {
    fn lock(&self) -> MutexGuard<'_, LiveState> {
        lock(&self.0.0)
    }

    /// Looks at what is known.
    pub fn look<T>(&self, look: impl FnOnce(&LiveState) -> T) -> T {
        look(&self.lock())
    }

    fn change(&self, change: impl FnOnce(&mut LiveState)) {
        change(&mut self.lock());
        self.0.1.notify_all();
    }

    /// Waits until something is newer, or so long.
    pub fn wait(&self, known: Versions, time: Duration) -> Versions {
        let same = |state: &mut LiveState| state.versions == known;
        let waited = self.0.1.wait_timeout_while(self.lock(), time, same);
        waited.unwrap_or_else(PoisonError::into_inner).0.versions
    }

    /// Begins to read rows behind the recorder.
    ///
    /// # Errors
    /// A thread that cannot be started.
    pub fn begin(&self, rows: JournalRows, setup: &Setup, request: LiveRequest) -> Result<JoinHandle<()>> {
        let (live, setup) = (self.clone(), setup.clone());
        spawn("live", move || {
            if let Err(error) = live.read(rows, &setup, request) {
                live.change(|state| {
                    state.failed = Some(error.to_string());
                    state.versions.events += 1;
                });
            }
        })
        .map_err(|e| no_thread(&e))
    }

    /// Looks through a recording that has ended, for what would have been shown and warned of, without a fit.
    ///
    /// # Errors
    /// A failed read; headers that contradict the setup.
    pub fn look_through(&self, mut rows: JournalRows) -> Result<()> {
        let mut monitor = Monitor::new(self.clone(), rows.start().setup());
        while let Some(batch) = rows.next_rows()? {
            monitor.push(&batch, &rows);
        }
        Ok(())
    }

    fn read(&self, mut rows: JournalRows, setup: &Setup, request: LiveRequest) -> Result<()> {
        let mut monitor = Monitor::new(self.clone(), setup.clone());
        while rows.decoder().schema().is_none() {
            let has_ended = rows.has_ended_before_columns()?;
            monitor.heard(&rows);
            if has_ended {
                return Ok(());
            }
        }
        let table = rows.table("the recording", move |batch, rows| monitor.push(batch, rows))?;
        let every_minute = request.every_minute;
        let fitter = Fitter::begin(self.clone(), setup, request)?;
        let mut log = LogReader::from_table(table, setup, ReadMode::Bulk)?;
        let mut windows = WindowBuilder::new(log.shape(), setup)?;
        let mut noise = NoiseSoFar::new(log.shape())?;
        let (mut first_ns, mut recorded_s, mut studied_s) = (None, 0.0, 0.0);
        // Without rows there is an empty batch each second, so that a fit that is due comes when the fitter has rested.
        while let Some(batch) = log.next_batch()? {
            windows.push(batch)?;
            noise.push(batch);
            if let (Some(start_ns), Some(end_ns)) = (batch.start_ns.first(), batch.end_ns.last()) {
                recorded_s = s_from_ns(end_ns.saturating_sub(*first_ns.get_or_insert(*start_ns)));
            }
            if recorded_s - studied_s >= STUDY_S {
                let work = || (windows.so_far(log.summary()), noise.so_far().ok(), false);
                if fitter.take(work, every_minute) {
                    studied_s = recorded_s;
                }
            }
        }
        // The last fit is of the whole record.
        fitter.take(|| (windows.so_far(log.summary()), noise.so_far().ok(), true), true);
        fitter.join();
        Ok(())
    }
}

/// Rows to what is shown, and warnings.
struct Monitor {
    live: Live,
    setup: Setup,
    made: Option<(Seconds, Minutes, MinuteWatch)>,
}

impl Monitor {
    fn new(live: Live, setup: Setup) -> Self {
        Self { live, setup, made: None }
    }

    /// The next rows.
    fn push(&mut self, batch: &RecordBatch, rows: &JournalRows) {
        if self.made.is_none()
            && let Ok(columns) = Columns::new(batch, &self.setup)
        {
            let names = Names {
                axes: columns.axes.iter().map(|axis| axis.letter).collect(),
                thermometers: columns.thermometers.iter().map(|t| t.name.clone()).collect(),
            };
            self.live.change(|state| state.names = names);
            let window_s = self.setup.window.and_then(sagnac_log::setup::WindowSize::seconds).unwrap_or(WINDOW_S);
            self.made = Some((Seconds::new(columns.clone()), Minutes::default(), MinuteWatch::new(columns, window_s)));
        }
        self.heard(rows);
        let Some((seconds, minutes, watch)) = &mut self.made else { return };
        let (done, mut warnings) = (seconds.push(batch), None);
        for second in &done {
            if let Some(minute) = minutes.push(second) {
                watch.push(minute, rows.decoder().clock());
                warnings = Some(watch.all());
            }
        }
        self.live.change(|state| {
            done.iter().for_each(|second| state.trend.push(second));
            if let Some(newest) = state.trend.newest() {
                state.now = Now {
                    t_s: newest.t_s,
                    rates_dph: newest.rates_dph.clone(),
                    temperatures_c: newest.temperatures_c.clone(),
                    temperature_rates_cpm: state.trend.temperature_rates_cpm(),
                };
            }
            state.versions.now += u64::from(!done.is_empty());
            if let Some(warnings) = warnings.filter(|warnings| *warnings != state.warnings) {
                state.warnings = warnings;
                state.versions.events += 1;
            }
        });
    }

    /// What is known besides rows.
    fn heard(&self, rows: &JournalRows) {
        let decoder = rows.decoder();
        let events = decoder.events();
        let shown = events.get(events.len().saturating_sub(SHOWN_EVENTS)..).unwrap_or_default();
        self.live.change(|state| {
            state.counts = decoder.counts();
            state.clock = decoder.clock();
            if state.events != shown {
                state.events = shown.to_vec();
                state.versions.events += 1;
            }
        });
    }
}

/// Windows and noise so far, and whether they are of the whole record.
type Work = (Windows, Option<NoiseBudget>, bool);

/// Fits, on a thread of its own.
struct Fitter {
    to: SyncSender<Work>,
    thread: JoinHandle<()>,
    /// It takes no work before this; `None` while it fits.
    rests_until: Arc<Mutex<Option<Instant>>>,
}

impl Fitter {
    fn begin(live: Live, setup: &Setup, request: LiveRequest) -> Result<Self> {
        let (to, from) = sync_channel(0);
        let rests_until = Arc::new(Mutex::new(Some(Instant::now())));
        let rests = Arc::clone(&rests_until);
        let studies = Studies::new(Setup { bench: Default::default(), ..setup.clone() }, request.model, request.enough);
        let thread = spawn("fit", move || fit(&live, studies, &from, &rests)).map_err(|e| no_thread(&e))?;
        Ok(Self { to, thread, rests_until })
    }

    /// Hands windows over, if it is idle and rested; `waits` until it is.
    fn take(&self, work: impl FnOnce() -> Work, waits: bool) -> bool {
        let is_ready = lock(&self.rests_until).is_some_and(|until| until <= Instant::now());
        (waits || is_ready) && self.to.send(work()).is_ok()
    }

    fn join(self) {
        drop(self.to);
        let _ = self.thread.join();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn fit(live: &Live, mut studies: Studies, from: &Receiver<Work>, rests_until: &Mutex<Option<Instant>>) {
    while let Ok((windows, noise, is_last)) = from.recv() {
        *lock(rests_until) = None;
        let at_s = live.look(|state| state.now.t_s);
        let (study, took) = studies.next(windows, noise.as_ref(), is_last);
        live.change(|state| {
            state.study = Arc::new(Study { at_s, ..study });
            state.versions.study += 1;
        });
        *lock(rests_until) = Some(Instant::now() + took * FIT_SHARE);
    }
}
