//! The interval of a row: as given, otherwise from the first rows. A given interval that contradicts the time column is refused, and
//! decides where bursts of rows have two readings.

use std::collections::VecDeque;

use crate::error::{Error, Result};
use crate::ingest::clock::even::EvenStamps;
use crate::ingest::clock::reading::{FirstStamps, StampReading, TimeSteps};
use crate::ingest::columns::feed::ReadMode;
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::raw::{Faults, RawRows};
use crate::ingest::pieces::Pieces;
use crate::setup::Setup;
use sagnac_units::format::significant;
use sagnac_units::{NS_PER_S, ns_from_s, s_from_ns};

/// Times from which the nominal interval is computed, and rows from which the stamps are read.
const LOOKAHEAD_TIMES: usize = 129;
const LOOKAHEAD_ROWS: usize = 4096;
/// Most rows that are read to find usable ones.
const MOST_LOOKAHEAD: usize = 100_000;
/// Steps from which the interval of a pipe is checked.
const PIPE_STEPS: usize = 16;
/// Largest relative deviation of a given interval from that of the time column; `LOOSE` for fewer steps than [`PIPE_STEPS`].
const CLOSE: f64 = 0.02;
const LOOSE: f64 = 0.1;
/// Smallest fraction of equal steps for which a time column counts as regular.
const REGULAR_PART: f64 = 0.75;

impl TimeSteps {
    /// Checks a given interval. It is refused if the steps are regular and neither their mean nor that of all steps is within 2 %
    /// of it.
    fn judge(&self, given_ns: i64) -> Result<()> {
        let most = if self.number >= PIPE_STEPS { CLOSE } else { LOOSE };
        let close = |ns: f64| (given_ns as f64 / ns - 1.0).abs() <= most;
        if self.regular_part < REGULAR_PART || close(self.typical_ns as f64) || close(self.mean_ns) {
            return Ok(());
        }
        let interval_s = significant(self.typical_ns as f64 / NS_PER_S, 6);
        let what = format!("the time column has a row every {interval_s} s (mean of the first {} steps)", self.number);
        Err(Error::input(
            what,
            "correct --sample-interval (sample_interval_s), or map a wrong time column to \"ignore\" under [columns]",
        )
        .column("sample_interval_s")
        .value(s_from_ns(given_ns).to_string()))
    }
}

/// The interval of a row, and the even rows behind stamps that are not the times of theirs.
pub(crate) struct RowClock {
    pub(crate) nominal_ns: i64,
    pub(crate) even: Option<EvenStamps>,
}

impl RowClock {
    fn own(nominal_ns: i64) -> Self {
        Self { nominal_ns, even: None }
    }

    fn even(stamps: EvenStamps) -> Self {
        Self { nominal_ns: stamps.interval_ns.round() as i64, even: Some(stamps) }
    }

    /// Usual step from stamp to stamp, ns.
    pub(crate) fn stamp_step_ns(&self) -> i64 {
        self.even.map_or(self.nominal_ns, |even| (even.interval_ns * even.rows_of_stamp).round() as i64)
    }

    /// How the stamps are read, in words, where they are not the times of their rows.
    pub(crate) fn words(&self) -> Option<String> {
        let even = self.even?;
        let interval_s = short(even.interval_ns / NS_PER_S);
        Some(if even.rows_of_stamp > 1.0 {
            let rows = short(even.rows_of_stamp);
            format!("{rows} rows share each time stamp: they are read as one row every {interval_s} s")
        } else {
            format!("the time stamps are coarser than the rows: they are read as one row every {interval_s} s")
        })
    }
}

/// The interval of a row: as given, otherwise from the first rows.
pub(crate) fn row_clock(
    pieces: &mut Pieces,
    layout: &Layout,
    setup: &Setup,
    mode: ReadMode,
    ahead: &mut VecDeque<RawRows>,
) -> Result<RowClock> {
    let out_of_range = || {
        Error::input("out of range", "set sample_interval_s to the seconds between two rows, such as 0.01")
            .column("sample_interval_s")
    };
    let given = setup.sample_interval_s.map(|s| ns_from_s(s).ok_or_else(out_of_range)).transpose()?;
    if layout.time.is_none() {
        return untimed(layout, setup, given).map(RowClock::own);
    }
    let live = mode == ReadMode::LineByLine;
    if let Some(given_ns) = given.filter(|_| live) {
        return Ok(RowClock::own(given_ns));
    }
    let (read, first, times) =
        first_times(pieces, if live { [2, 2] } else { [LOOKAHEAD_TIMES, LOOKAHEAD_ROWS] }, ahead)?;
    let steps = TimeSteps::of(&times).filter(|steps| s_from_ns(steps.typical_ns) <= 1e5);
    match (given, steps) {
        (given, Some(steps)) => read_stamps(given, &steps, if live { StampReading::Own } else { first.reading() }),
        // Rows without usable times are checked one by one.
        (Some(given_ns), None) if !times.is_empty() || !is_unreadable(ahead) => Ok(RowClock::own(given_ns)),
        _ => Err(no_interval(read, &times, layout, ahead)),
    }
}

/// The given interval decides between two readings.
fn read_stamps(given: Option<i64>, steps: &TimeSteps, reading: StampReading) -> Result<RowClock> {
    let is_near = |given_ns: i64, ns: f64| (given_ns as f64 / ns - 1.0).abs() <= CLOSE;
    match (given, reading) {
        (None, StampReading::Own) => Ok(RowClock::own(steps.typical_ns)),
        (None, StampReading::Even(stamps)) => Ok(RowClock::even(stamps)),
        (Some(given_ns), StampReading::Even(stamps)) if is_near(given_ns, stamps.interval_ns) => {
            Ok(RowClock { nominal_ns: given_ns, even: Some(EvenStamps { interval_ns: given_ns as f64, ..stamps }) })
        }
        (Some(given_ns), StampReading::Bursts { rows, burst_ns, .. })
            if is_near(given_ns, burst_ns as f64 / rows as f64) =>
        {
            Ok(RowClock::even(EvenStamps::of_rows(burst_ns as f64 / rows as f64, burst_ns as f64)))
        }
        (Some(given_ns), _) => steps.judge(given_ns).map(|()| RowClock::own(given_ns)),
        (None, StampReading::Bursts { rows, step_ns, burst_ns }) => Err(in_bursts(rows, step_ns, burst_ns)),
        (None, StampReading::Uneven) => Err(Error::input(
            "several rows share a time stamp, in uneven numbers: their times are not known",
            "map the time column to \"ignore\" under [columns] and give --sample-interval, if the rows are even",
        )),
    }
}

/// Four significant digits without zeros at the end.
fn short(seconds: f64) -> String {
    significant(seconds, 4).parse().map_or_else(|_| seconds.to_string(), |rounded: f64| rounded.to_string())
}

fn in_bursts(rows: usize, step_ns: i64, burst_ns: i64) -> Error {
    let [step_s, burst_s, even_s] =
        [step_ns as f64, burst_ns as f64, burst_ns as f64 / rows as f64].map(|ns| short(ns / NS_PER_S));
    Error::input(
        format!("rows come in bursts of {rows}, one every {step_s} s, a burst every {burst_s} s"),
        format!(
            "give --sample-interval {even_s} if a buffer sent even rows, or --sample-interval {step_s} if the gyro was read in bursts"
        ),
    )
    .column("sample_interval_s")
}

/// A table without a time column.
fn untimed(layout: &Layout, setup: &Setup, given: Option<i64>) -> Result<i64> {
    if let Some(header) = layout.unread_time(&setup.columns, given.is_none()) {
        return Err(Error::input(
            "this looks like a time without a unit",
            "map it under [columns] to time_s, time_ms, time_us, time_ns, time (ISO 8601 dates) or \"ignore\"",
        )
        .column(header));
    }
    match given {
        Some(given_ns) => Ok(given_ns),
        None if layout.is_count_log() => Err(Error::input(
            "the log has counts but no time column, and the row interval is not given",
            format!(
                "give --sample-interval, or map the time column under [columns]. The log has: {}",
                layout.headers.join(", ")
            ),
        )
        .column("sample_interval_s")),
        None => Ok(1_000_000_000),
    }
}

/// Reads rows until enough of them have a time; returns the number of rows read, their stamps, and the times without repeated ones.
/// Broken rows do not count, and a pipe may begin in the middle of a row. A recording that still grows has an empty piece where no row
/// has come: then the times decide alone.
fn first_times(
    pieces: &mut Pieces,
    [times_wanted, rows_wanted]: [usize; 2],
    ahead: &mut VecDeque<RawRows>,
) -> Result<(usize, FirstStamps, Vec<i64>)> {
    let (mut read, mut first, mut times, mut before) = (0, FirstStamps::default(), Vec::new(), None);
    let mut rows = RawRows::default();
    while (times.len() < times_wanted || first.stamps.len() < rows_wanted) && pieces.next(&mut rows)? {
        if rows.len() == 0 && times.len() >= times_wanted {
            break;
        }
        read += rows.len();
        for row in (0..rows.len()).filter(|row| !rows.faults[*row].has(Faults::RAGGED)) {
            let Some(time) = rows.time(row) else { continue };
            let repeats = before.replace(time) == Some(time);
            // Of stamps that are no times no differences are taken.
            if first.stamps.len() < rows_wanted && rows.sound_time(row).is_some() {
                let is_same = |column: &Vec<f64>| row > 0 && column[row] == column[row - 1];
                first.doubled += usize::from(repeats && rows.axes.iter().all(is_same));
                first.stamps.push(time);
            }
            if !repeats && times.len() < times_wanted {
                times.push(time);
            }
        }
        ahead.push_back(std::mem::take(&mut rows));
        if read > MOST_LOOKAHEAD {
            break;
        }
    }
    Ok((read, first, times))
}

/// True if there are complete rows, but none of them has a time.
fn is_unreadable(ahead: &VecDeque<RawRows>) -> bool {
    let mut whole = ahead.iter().flat_map(|rows| &rows.faults).filter(|faults| !faults.has(Faults::RAGGED));
    whole.next().is_some()
}

fn no_interval(read: usize, times: &[i64], layout: &Layout, ahead: &VecDeque<RawRows>) -> Error {
    let backwards = times.windows(2).any(|pair| pair[1] < pair[0]);
    let header = layout.time.and_then(|(index, _)| layout.headers.get(index)).cloned().unwrap_or_default();
    let (what, help) = match read {
        0 => ("a header, but no row below it", "a log needs rows"),
        _ if !is_unreadable(ahead) => (
            "no row has as many fields as the header",
            "use one delimiter for header and rows: tab, semicolon or comma",
        ),
        _ if times.is_empty() && layout.has_dates() => (
            "unknown unit: a time column without a unit needs ISO 8601 dates, and no row begins with one",
            "map the column under [columns] to time_s, time_ms, time_us, time_ns or time_excel, or write dates like 2024-02-29T12:00:05.5Z",
        ),
        _ if times.is_empty() => (
            "the times in the first rows are not numbers",
            "write times as numbers, or map the column to `time` under [columns] for ISO 8601 dates",
        ),
        1 => ("the log has a single row, so the row interval is unknown", "give --sample-interval SECONDS"),
        _ if backwards => ("rows are not in the order of their times", "sort the log by time"),
        _ => (
            "time does not advance in the first rows, so the row interval is unknown",
            "correct the time column, or map it to \"ignore\" and give --sample-interval",
        ),
    };
    let error = Error::input(what, help);
    if times.is_empty() && read > 0 && is_unreadable(ahead) { error.column(header) } else { error }
}

/// Checks the given interval of a pipe as its rows arrive.
#[derive(Debug)]
pub(crate) struct PipeWatch {
    times: Vec<i64>,
    given_ns: i64,
}

impl PipeWatch {
    pub(crate) fn new(given_ns: i64) -> Self {
        Self { times: Vec::new(), given_ns }
    }

    /// The time of the next row.
    pub(crate) fn see(&mut self, time_ns: i64) -> Result<()> {
        if self.times.len() > PIPE_STEPS {
            return Ok(());
        }
        self.times.push(time_ns);
        match TimeSteps::of(&self.times).filter(|_| self.times.len() > PIPE_STEPS) {
            Some(steps) => steps.judge(self.given_ns),
            None => Ok(()),
        }
    }
}
