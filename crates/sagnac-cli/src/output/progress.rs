//! Progress of reading a log, fitting it or simulating a test: shown on a terminal after one second, otherwise silent.

use std::collections::BTreeSet;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sagnac::Result;
use sagnac::fit::{Doing, Progress};
use sagnac_log::ingest::{LogReader, ReadMode, Watch};
use sagnac_log::setup::Setup;
use sagnac_units::format::printable;

use crate::output::console::is_quiet;
use crate::output::terminal::{MOST_COLUMNS, columns_of_errors, wrapped};

/// Delay before anything is shown.
const PATIENCE: Duration = Duration::from_secs(1);
const TEMPLATE: &str = "{prefix} {msg} {wide_bar} {bytes} of {total_bytes}, {binary_bytes_per_sec}, {eta} left";

/// Opens a log; a long read from a file shows itself on a terminal, with what is done with it.
pub(crate) fn open_log(path: &Path, setup: &Setup, pace: ReadMode, doing: &'static str) -> Result<LogReader> {
    let regular = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file);
    let watch = regular
        .filter(|_| !is_quiet() && std::io::stderr().is_terminal())
        .map(|metadata| watch(path, metadata.len(), doing));
    let log = LogReader::open_watched(path, setup, pace, watch)?;
    let assumed = log.assumed().join(". ");
    if !assumed.is_empty() && !is_quiet() && is_new(&assumed) {
        let said = printable(&format!("{}: {assumed}", log.summary().file)).into_owned();
        let columns = columns_of_errors().map_or(MOST_COLUMNS, |own| own.min(MOST_COLUMNS));
        let _ = writeln!(std::io::stderr(), "{}", wrapped(&said, Some(columns)));
    }
    Ok(log)
}

/// Logs of one rig are read alike: it is said of the first.
fn is_new(assumed: &str) -> bool {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    SAID.lock().unwrap_or_else(PoisonError::into_inner).insert(assumed.to_owned())
}

/// A bar that appears after a second.
fn watch(path: &Path, length: u64, doing: &'static str) -> Watch {
    let bar = Bar(ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::hidden()));
    if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
        bar.0.set_style(style);
    }
    bar.0.set_prefix(doing);
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    bar.0.set_message(printable(&name).into_owned());
    let mut since: Option<Instant> = None;
    Box::new(move |done| {
        let since = *since.get_or_insert_with(|| {
            bar.0.reset_elapsed();
            Instant::now()
        });
        if bar.0.is_hidden() && since.elapsed() > PATIENCE {
            bar.0.set_draw_target(ProgressDrawTarget::stderr());
        }
        bar.0.set_position(done);
        if done >= length {
            bar.0.finish_and_clear();
        }
    })
}

/// How far a fit is: which part of it, and how much of that.
pub(crate) fn of_fit() -> Progress {
    if !std::io::stderr().is_terminal() {
        return Progress::default();
    }
    let bar = Bar(ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::hidden()));
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos} of {len}, {elapsed}") {
        bar.0.set_style(style);
    }
    let since = Instant::now();
    Progress::to(move |doing: &Doing| {
        if bar.0.is_hidden() && since.elapsed() > PATIENCE {
            bar.0.set_draw_target(ProgressDrawTarget::stderr());
        }
        bar.0.set_message(printable(&doing.what).into_owned());
        bar.0.set_length(doing.of as u64);
        bar.0.set_position(doing.done as u64);
    })
}

/// How far a simulation is, with how many times real time it runs.
pub(crate) struct SimulatedTime {
    bar: Option<Bar>,
    since: Instant,
}

impl SimulatedTime {
    /// Of a test of so many seconds; shows nothing but on a terminal.
    pub(crate) fn new(length_s: f64) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = Bar(ProgressBar::with_draw_target(Some(length_s as u64), ProgressDrawTarget::hidden()));
            if let Ok(style) = ProgressStyle::with_template("simulated {pos} of {len} s {wide_bar} {msg}, {eta} left") {
                bar.0.set_style(style);
            }
            bar
        });
        Self { bar, since: Instant::now() }
    }

    /// So many seconds are done.
    pub(crate) fn at(&mut self, done_s: f64) {
        let Some(Bar(bar)) = &self.bar else { return };
        let took = self.since.elapsed();
        if bar.is_hidden() && took > PATIENCE {
            bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        if !bar.is_hidden() {
            bar.set_message(format!("{:.0} times real time", done_s / took.as_secs_f64()));
            bar.set_position(done_s as u64);
        }
    }
}

/// How many units of a fleet are done, and how long the others take; nothing where standard error is no terminal.
pub(crate) struct UnitProgress(Option<Bar>);

impl UnitProgress {
    pub(crate) fn new(units: usize) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = Bar(ProgressBar::with_draw_target(Some(units as u64), ProgressDrawTarget::stderr()));
            if let Ok(style) = ProgressStyle::with_template("{pos} of {len} units {wide_bar} {elapsed}, {eta} to go") {
                bar.0.set_style(style);
            }
            bar
        });
        Self(bar)
    }

    pub(crate) fn one_more(&self) {
        self.0.iter().for_each(|bar| bar.0.inc(1));
    }

    /// Prints above the bar.
    pub(crate) fn while_hidden(&self, print: impl FnOnce()) {
        match &self.0 {
            Some(bar) => bar.0.suspend(print),
            None => print(),
        }
    }
}

/// Leaves no trace on the terminal, however the reading ended.
struct Bar(ProgressBar);

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
