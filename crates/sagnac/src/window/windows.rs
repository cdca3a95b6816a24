//! Windows as a table: their shape, their runs, and every axis and column of them.

use crate::window::rest::Rest;
use sagnac_log::ingest::{AngleUnit, LogSummary, Reason, Tallies};
use sagnac_log::setup::WindowSize;
use sagnac_noise::{FILLED, Hump, JudgedWindow, MeasuredNoise, Trace, WindowSquares, WindowedCurve};
use sagnac_units::s_from_ns;

/// What a set of windows consists of.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowShape {
    /// Axis letters.
    pub axes: Vec<char>,
    /// Thermometer names.
    pub thermometers: Vec<String>,
    /// Auxiliary columns.
    pub aux: Vec<String>,
    /// Unit of the angles.
    pub unit: AngleUnit,
    /// A table turns the unit: the rows of a window go on with those of none.
    pub is_turned: bool,
    /// False for tables without time: no track, no rate.
    pub timed: bool,
    /// Window length asked for.
    pub window: WindowSize,
    /// Length to which sums per window are scaled, s.
    pub nominal_s: f64,
    /// Temperature period Δt of tracks and target, ns.
    pub period_ns: i64,
    /// Interval of a row of the log, s (of the first run).
    pub sample_interval_s: f64,
}

/// One file of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunFile {
    /// Start of its first row's interval, ns.
    pub start_ns: i64,
    /// File, hash, rows, tallies.
    pub summary: LogSummary,
}

/// One run: a file, or several that go on one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Its files in their order; one at least.
    pub files: Vec<RunFile>,
    /// Start of the first row's interval, ns; origin of windows, track and ticks.
    pub start_ns: i64,
    /// Time of the last row, ns.
    pub end_ns: i64,
    /// Per thermometer, then per auxiliary column: newest value at start + k·Δt (zero-order hold), °C for thermometers.
    pub tracks: Vec<Vec<f64>>,
}

impl Run {
    /// Its file, or the first of several and their number.
    pub fn name(&self) -> String {
        let first = self.files.first().map_or("", |file| file.summary.file.as_str());
        match self.files.len() {
            0 | 1 => first.to_owned(),
            n => format!("{first} and {} more", n - 1),
        }
    }

    /// The file that holds a time.
    pub fn file_at(&self, ns: i64) -> &str {
        let later = self.files.partition_point(|file| file.start_ns <= ns).max(1);
        self.files.get(later - 1).map_or("", |file| file.summary.file.as_str())
    }

    /// Length of the run, s.
    pub fn length_s(&self) -> f64 {
        s_from_ns(self.end_ns - self.start_ns)
    }
}

/// Columns of windows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowRows {
    /// Index of the run.
    pub run: Vec<u32>,
    /// Start, ns.
    pub start_ns: Vec<i64>,
    /// End, ns.
    pub end_ns: Vec<i64>,
    /// Sum of the rows' intervals, ns (less than end − start where rows were rejected).
    pub duration_ns: Vec<i64>,
    /// Rows of the log in it.
    pub samples: Vec<u32>,
    /// Per axis: sum of angles in `WindowShape::unit`; whole quanta for count logs.
    pub angle: Vec<Vec<f64>>,
    /// Per thermometer: mean, °C; NaN with fewer than half of the samples.
    pub mean_c: Vec<Vec<f64>>,
    /// Per thermometer: second moment about the mean, °C².
    pub variance_c2: Vec<Vec<f64>>,
    /// Per thermometer: lowest sample, °C.
    pub min_c: Vec<Vec<f64>>,
    /// Per thermometer: highest sample, °C.
    pub max_c: Vec<Vec<f64>>,
    /// Per auxiliary column: mean.
    pub aux: Vec<Vec<f64>>,
    /// Per auxiliary column: second moment about the mean.
    pub aux_variance: Vec<Vec<f64>>,
    /// Per auxiliary column: lowest value.
    pub aux_min: Vec<Vec<f64>>,
    /// Per auxiliary column: highest value.
    pub aux_max: Vec<Vec<f64>>,
    /// Mean reference rate, °/s; NaN without.
    pub reference_dps: Vec<f64>,
    /// Line of the window's first row.
    pub first_line: Vec<u64>,
    /// Per axis: squared differences of the raw samples that end in the window.
    pub squares: Vec<Vec<WindowSquares>>,
    /// Why the window is left out, if it is.
    pub excluded: Vec<Option<Reason>>,
}

impl WindowRows {
    /// Some of the windows. Every column is named, so that a new one cannot be forgotten.
    fn only(&self, members: &[usize]) -> Self {
        fn one<T: Clone>(column: &[T], members: &[usize]) -> Vec<T> {
            members.iter().map(|i| column[*i].clone()).collect()
        }
        fn all<T: Clone>(columns: &[Vec<T>], members: &[usize]) -> Vec<Vec<T>> {
            columns.iter().map(|column| one(column, members)).collect()
        }
        Self {
            run: one(&self.run, members),
            start_ns: one(&self.start_ns, members),
            end_ns: one(&self.end_ns, members),
            duration_ns: one(&self.duration_ns, members),
            samples: one(&self.samples, members),
            angle: all(&self.angle, members),
            mean_c: all(&self.mean_c, members),
            variance_c2: all(&self.variance_c2, members),
            min_c: all(&self.min_c, members),
            max_c: all(&self.max_c, members),
            aux: all(&self.aux, members),
            aux_variance: all(&self.aux_variance, members),
            aux_min: all(&self.aux_min, members),
            aux_max: all(&self.aux_max, members),
            reference_dps: one(&self.reference_dps, members),
            first_line: one(&self.first_line, members),
            squares: all(&self.squares, members),
            excluded: one(&self.excluded, members),
        }
    }
}

/// Windows of one or several runs.
#[derive(Clone, Debug)]
pub struct Windows {
    /// What they consist of.
    pub shape: WindowShape,
    /// The runs.
    pub runs: Vec<Run>,
    /// The windows.
    pub rows: WindowRows,
    /// Rows that were not used, and windows that are left out (in rows of the log).
    pub tallies: Tallies,
    /// Motion and rest of the rows; `None` from few rows, without a clock, and on a rate table.
    pub rest: Option<Rest>,
    /// The noise of the rows of the first axis, by which a copy is recognised.
    pub trace: Trace,
}

/// Standard errors beyond which a window's scatter is not noise.
const SHAKEN_SIGMAS: f64 = 8.0;

/// Median of the mean squares at the shortest τ.
fn median_square<'a>(all: impl Iterator<Item = &'a WindowSquares>) -> f64 {
    let mut squares: Vec<f64> = all.filter_map(WindowSquares::shortest).map(|(square, _)| square).collect();
    squares.sort_by(f64::total_cmp);
    squares.get(squares.len() / 2).copied().unwrap_or(0.0)
}

/// Far above the median by the scatter of a variance of so many degrees of freedom.
fn is_shaken(squares: &WindowSquares, median: f64) -> bool {
    let beyond = |freedom: f64| median * (1.0 + SHAKEN_SIGMAS * (2.0 / freedom.max(1.0)).sqrt());
    squares.shortest().is_some_and(|(square, freedom)| square > beyond(freedom) && median > 0.0)
}

/// Noise below this part of a window's angle is that of sums.
const ROUNDING: f64 = 1e-12;

impl Windows {
    /// Number of windows.
    pub fn len(&self) -> usize {
        self.rows.run.len()
    }

    /// True without windows.
    pub fn is_empty(&self) -> bool {
        self.rows.run.is_empty()
    }

    /// Duration of a window, s.
    pub fn duration_s(&self, window: usize) -> f64 {
        s_from_ns(self.rows.duration_ns[window])
    }

    /// Middle of a window since the start of its run, s.
    pub fn middle_s(&self, window: usize) -> f64 {
        let origin_ns = self.runs[self.rows.run[window] as usize].start_ns;
        0.5 * (s_from_ns(self.rows.start_ns[window] - origin_ns) + s_from_ns(self.rows.end_ns[window] - origin_ns))
    }

    /// Mean rate of an axis over a window, °/h (1 arcsec/s = 1 °/h).
    pub fn rate_dph(&self, axis: usize, window: usize) -> f64 {
        self.rows.angle[axis][window] * self.shape.unit.arcsec() / self.duration_s(window)
    }

    /// The noise of an axis from the raw samples of the used windows; `None` where they do not show it.
    pub fn measured_noise(&self, axis: usize) -> Option<MeasuredNoise> {
        // A window that was shaken shows nothing of the noise of the others.
        let used = self.rows.squares[axis].iter().zip(&self.rows.excluded).filter(|(_, reason)| reason.is_none());
        let median = median_square(used.map(|(squares, _)| squares));
        self.noise_of(axis, |squares| !is_shaken(squares, median))
    }

    /// How neighbouring rows of the used windows correlate: σ² at two rows over that at one.
    pub(crate) fn second_over_first(&self, axis: usize) -> Option<f64> {
        self.curve_of(axis, |_| true).second_over_first()
    }

    /// A hump of the curve of all rows, beyond the laws of noise.
    pub(crate) fn hump(&self, axis: usize) -> Option<Hump> {
        self.curve_of(axis, |_| true).hump()
    }

    /// The same of every used window, shaken or not: what the gyro did, not what its floor is.
    pub(crate) fn noise_with_shaken(&self, axis: usize) -> Option<MeasuredNoise> {
        self.noise_of(axis, |_| true)
    }

    /// N² that a correction adds to these rows, arcsec²/s.
    pub(crate) fn walk_added_in(&self, corrected: &Self, axis: usize) -> Option<f64> {
        self.curve_of(axis, |_| true).walk_added_in(&corrected.curve_of(axis, |_| true))
    }

    fn noise_of(&self, axis: usize, counts: impl Fn(&WindowSquares) -> bool) -> Option<MeasuredNoise> {
        let (rows, shape) = (&self.rows, &self.shape);
        let noise = self.curve_of(axis, counts).noise()?;
        // What the rounding of sums makes is no noise: of a counter that always counts the same.
        let largest = rows.angle[axis].iter().fold(0.0_f64, |most, angle| most.max(angle.abs()));
        let noise_arcsec = noise.terms.q_arcsec + noise.terms.n_arcsec_rt_s * shape.sample_interval_s.sqrt();
        (noise_arcsec > ROUNDING * largest * shape.unit.arcsec()).then_some(noise)
    }

    fn curve_of(&self, axis: usize, counts: impl Fn(&WindowSquares) -> bool) -> WindowedCurve {
        let (rows, shape) = (&self.rows, &self.shape);
        let intervals = |ns: i64| (s_from_ns(ns) / shape.sample_interval_s).round() as u64;
        let is_rates = shape.unit == AngleUnit::Arcsec;
        let judged = |i: usize| {
            let gap =
                (i > 0 && rows.run[i] == rows.run[i - 1]).then(|| intervals(rows.start_ns[i] - rows.end_ns[i - 1]));
            let follows = !shape.is_turned && gap.is_some_and(|gap| gap == 0 || is_rates && gap <= FILLED);
            let whole = intervals(rows.end_ns[i] - rows.start_ns[i]) + gap.filter(|_| follows).unwrap_or(0);
            let missing = whole.saturating_sub(u64::from(rows.samples[i]));
            JudgedWindow {
                squares: &rows.squares[axis][i],
                intervals: whole,
                holes: if is_rates { 0 } else { missing },
                filled: if is_rates { missing } else { 0 },
                follows,
                is_used: rows.excluded[i].is_none() && counts(&rows.squares[axis][i]),
            }
        };
        let count_arcsec = (!is_rates).then(|| shape.unit.arcsec());
        let windows = (0..self.len()).map(judged);
        WindowedCurve::of(windows, shape.sample_interval_s, shape.nominal_s).counted(count_arcsec)
    }

    /// Some of the windows, in their order; the runs stay.
    pub(crate) fn only(&self, members: &[usize]) -> Self {
        Self {
            shape: self.shape.clone(),
            runs: self.runs.clone(),
            rows: self.rows.only(members),
            tallies: self.tallies.clone(),
            rest: self.rest.clone(),
            trace: self.trace.clone(),
        }
    }

    /// Marks windows of less than a tenth of the nominal length.
    pub(crate) fn mark_fragments(&mut self) {
        for i in 0..self.len() {
            if self.duration_s(i) < self.shape.nominal_s / 10.0 {
                self.exclude(i, Reason::ShortWindow);
            }
        }
    }

    /// Takes over which windows are left out, and the tallies, from windows of the same bounds.
    pub(crate) fn exclude_as(&mut self, other: &Self) {
        self.rows.excluded.clone_from(&other.rows.excluded);
        self.tallies.clone_from(&other.tallies);
    }

    /// Marks a window as left out and counts its rows.
    pub(crate) fn exclude(&mut self, window: usize, reason: Reason) {
        if self.rows.excluded[window].is_some() {
            return;
        }
        self.rows.excluded[window] = Some(reason);
        let file = self.runs[self.rows.run[window] as usize].file_at(self.rows.start_ns[window]).to_owned();
        let line = self.rows.first_line[window];
        self.tallies.add(reason, u64::from(self.rows.samples[window]), || format!("{file}:{line}"));
    }
}
