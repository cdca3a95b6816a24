//! Temperatures of a run on the grid of the target's temperature period, from which the lag filter runs for any τ without the log.
//!
//! ```text
//! track[k] = newest value stamped at or before start + k·Δt     (zero-order hold, as the target reads its thermometers)
//! ```
//!
//! Two cases are not held. The time before the first known value has that value. A gap of the rows of a minute or more
//! ([`LogShape::is_gap`]) has a straight line, for a step would be a rate that the gyro never saw; replay does the same. A thermometer that
//! alone is not read, while rows go on, is held.

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{Batch, LogShape};
use sagnac_log::memory::MemoryBudget;
use sagnac_units::s_from_ns;

/// Readings this near are the same, °C or the column's unit: a smaller change is no step of a thermometer.
pub(crate) const SAME_VALUE: f64 = 1e-9;

/// Longest track, in temperature periods: 48 days at 1 s.
const MAX_TRACK: usize = 1 << 22;

/// The grid of the tracks, and the room for them.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) tick_ns: i64,
    pub(super) period_ns: i64,
    /// Values that a track may have.
    room: usize,
    memory: MemoryBudget,
}

impl Grid {
    /// With the memory that tracks of `kept` values in earlier runs leave to `columns` of this one.
    pub(super) fn new(tick_ns: i64, period_ns: i64, columns: usize, kept: usize, memory: MemoryBudget) -> Self {
        let most = usize::try_from(memory.tracks()).unwrap_or(usize::MAX) / size_of::<f64>();
        let room = most.saturating_sub(kept).checked_div(columns).unwrap_or(MAX_TRACK);
        Self { tick_ns, period_ns, room, memory }
    }

    /// Points from the run's start to a row, the row's own time excluded. As in replay, a stamp counts from the tick it falls into.
    fn points_before(self, since_start_ns: i64) -> usize {
        let elapsed_ns = since_start_ns / self.tick_ns * self.tick_ns;
        let points = elapsed_ns / self.period_ns + i64::from(elapsed_ns % self.period_ns != 0);
        usize::try_from(points).unwrap_or(usize::MAX)
    }

    /// # Errors
    /// More points than a track may have.
    fn check(self, points: usize, columns: usize) -> Result<()> {
        if points > MAX_TRACK {
            return Err(too_many_periods(self.period_ns));
        }
        if points > self.room {
            return Err(too_many_values(columns, self.period_ns, self.memory));
        }
        Ok(())
    }
}

/// The tracks of a run: thermometers, then auxiliary columns.
#[derive(Clone)]
pub(super) struct Tracks {
    start_ns: i64,
    /// Stamp of the newest row, ns.
    newest_ns: i64,
    columns: Vec<InputTrack>,
}

impl Tracks {
    pub(super) fn new(start_ns: i64, columns: usize) -> Self {
        Self { start_ns, newest_ns: start_ns, columns: vec![InputTrack::new(); columns] }
    }

    /// Brings the tracks up to the end of a batch. Only the rows next to a grid point matter.
    ///
    /// # Errors
    /// More points than a track may have, or than there is memory for.
    pub(super) fn sample(&mut self, batch: &Batch, log: &LogShape, grid: Grid) -> Result<()> {
        let columns = || batch.temperature_c.iter().chain(&batch.aux);
        let since_ns = |row: usize| batch.end_ns[row] - self.start_ns;
        let mut at = 0;
        while let Some(points) = self.columns.first().map(|track| track.values.len() as i64) {
            let due_ns =
                points.saturating_mul(grid.period_ns).saturating_add(grid.tick_ns).saturating_add(self.start_ns);
            let next = at + batch.end_ns[at..].partition_point(|end| *end < due_ns);
            for (track, column) in self.columns.iter_mut().zip(columns()) {
                let known = || (at..next).filter(|row| !column[*row].is_nan());
                // The very first stands for the time before it, however rows come in pieces.
                let first = known().next().filter(|_| track.newest.is_nan());
                for row in first.into_iter().chain(known().next_back()) {
                    track.hold(column[row], since_ns(row), grid.period_ns);
                }
            }
            if next == batch.len() {
                break;
            }
            let before = grid.points_before(since_ns(next));
            grid.check(before, self.columns.len()).map_err(|e| e.line(batch.line[next]))?;
            let newest_ns = if next == 0 { self.newest_ns } else { batch.end_ns[next - 1] };
            let is_gap = log.is_gap(newest_ns, batch.end_ns[next]);
            for (track, column) in self.columns.iter_mut().zip(columns()) {
                track.is_gap |= is_gap;
                track.sample(before, column[next], since_ns(next), grid.period_ns);
            }
            at = next + 1;
        }
        self.newest_ns = batch.end_ns.last().copied().unwrap_or(self.newest_ns);
        Ok(())
    }

    /// The values of each column.
    pub(super) fn into_values(self) -> Vec<Vec<f64>> {
        self.columns.into_iter().map(|track| track.values).collect()
    }
}

/// One thermometer or auxiliary column on the grid, °C or the column's unit.
#[derive(Clone)]
struct InputTrack {
    newest: f64,
    newest_ns: i64,
    /// No row came for long since the newest value.
    is_gap: bool,
    /// Smallest change of a value so far: what is interpolated is read in such steps too, for the survey takes them for the resolution.
    step: f64,
    values: Vec<f64>,
}

impl InputTrack {
    fn new() -> Self {
        Self { newest: f64::NAN, newest_ns: 0, is_gap: false, step: f64::INFINITY, values: Vec::new() }
    }

    /// Every point strictly before the row's time still has the value before it.
    fn sample(&mut self, points_before: usize, value: f64, since_start_ns: i64, period_ns: i64) {
        if self.values.len() < points_before {
            self.values.resize(points_before, self.newest);
        }
        self.hold(value, since_start_ns, period_ns);
    }

    /// The newest value.
    fn hold(&mut self, value: f64, since_start_ns: i64, period_ns: i64) {
        if value.is_nan() {
            return;
        }
        if self.newest.is_nan() {
            self.values.fill(value);
        } else if self.is_gap {
            self.interpolate(value, since_start_ns, period_ns);
        }
        self.is_gap = false;
        let change = (value - self.newest).abs();
        if change > SAME_VALUE {
            self.step = self.step.min(change);
        }
        (self.newest, self.newest_ns) = (value, since_start_ns);
    }

    /// The points since the value before, on a straight line to this one.
    fn interpolate(&mut self, value: f64, since_start_ns: i64, period_ns: i64) {
        let length_ns = (since_start_ns - self.newest_ns) as f64;
        let first = usize::try_from(self.newest_ns / period_ns + 1).unwrap_or(usize::MAX);
        for (point, filled) in self.values.iter_mut().enumerate().skip(first) {
            let covered_fraction = (point as f64 * period_ns as f64 - self.newest_ns as f64) / length_ns;
            let change = (value - self.newest) * covered_fraction.clamp(0.0, 1.0);
            let whole = (change / self.step).round() * self.step;
            *filled = self.newest + if whole.is_finite() { whole } else { change };
        }
    }
}

fn too_many_values(columns: usize, period_ns: i64, memory: MemoryBudget) -> Error {
    let what = format!("{columns} columns every {} s in all runs take together", s_from_ns(period_ns));
    let or = "map unneeded columns to \"ignore\" under [columns], set a longer temperature_period_s";
    memory.exceeded(&what, memory.tracks(), or).column("temperature_period_s")
}

fn too_many_periods(period_ns: i64) -> Error {
    Error::input(
        format!("the run is longer than {MAX_TRACK} temperature periods of {} s", s_from_ns(period_ns)),
        "cut the log into shorter files (each is a run), or set a longer temperature_period_s",
    )
    .column("temperature_period_s")
}
