//! Sums of the window that is being filled, and where it must end.
//!
//! ```text
//! mean = Σ w·x/Σ w        variance = Σ w·x²/Σ w − mean²        about the first value; in four lanes by place in the window
//! ```
//!
//! The lanes make the result independent of how rows come in pieces. A window ends when a temperature has moved by 2 °C in it.

use std::ops::Range;

use sagnac_core::Status;
use sagnac_log::ingest::Batch;

/// A window ends when a temperature has moved by this much within it, °C.
const SPLIT_C: f64 = 2.0;
const LANES: usize = 4;

/// Sums of the window being filled.
#[derive(Clone)]
pub(super) struct WindowSums {
    pub(super) index: i64,
    pub(super) start_ns: i64,
    pub(super) end_ns: i64,
    pub(super) duration_ns: i64,
    pub(super) samples: u32,
    pub(super) first_line: u64,
    pub(super) angle: Vec<LaneSum>,
    pub(super) temperatures: Vec<Moments>,
    /// Per thermometer: lowest and highest.
    pub(super) extremes_c: Vec<(f64, f64)>,
    pub(super) aux: Vec<Moments>,
    /// Per auxiliary column: lowest and highest.
    pub(super) aux_extremes: Vec<(f64, f64)>,
    pub(super) reference: Moments,
    /// Per axis: union of the status bits.
    pub(super) status: Vec<Status>,
}

/// A sum in four lanes, which a processor adds side by side. A value's lane is its place in the window, so the
/// result does not depend on how rows come in pieces.
#[derive(Clone, Copy, Default)]
pub(super) struct LaneSum([f64; LANES]);

impl LaneSum {
    /// Adds `count` values that begin at a place of the window.
    pub(super) fn add(&mut self, place: usize, count: usize, value: impl Fn(usize) -> f64) {
        let mut lanes = self.0;
        let head = ((LANES - place % LANES) % LANES).min(count);
        (0..head).for_each(|i| lanes[(place + i) % LANES] += value(i));
        let whole = head + (count - head) / LANES * LANES;
        for from in (head..whole).step_by(LANES) {
            (0..LANES).for_each(|lane| lanes[lane] += value(from + lane));
        }
        (whole..count).for_each(|i| lanes[i - whole] += value(i));
        self.0 = lanes;
    }

    pub(super) fn total(self) -> f64 {
        self.0.iter().sum()
    }
}

/// Weighted sums about the first value, so that no digits are lost.
#[derive(Clone, Copy)]
pub(super) struct Moments {
    /// First value; NaN before it.
    origin: f64,
    weights: LaneSum,
    sums: LaneSum,
    squares: LaneSum,
}

impl Moments {
    const EMPTY: Self = Self {
        origin: f64::NAN,
        weights: LaneSum([0.0; LANES]),
        sums: LaneSum([0.0; LANES]),
        squares: LaneSum([0.0; LANES]),
    };

    /// Adds values that begin at a place of the window. NaN is passed over.
    pub(super) fn add(&mut self, place: usize, values: &[f64], weights: &[f64]) {
        if self.origin.is_nan() {
            self.origin = values.iter().copied().find(|value| !value.is_nan()).unwrap_or(f64::NAN);
        }
        let (origin, count) = (self.origin, values.len().min(weights.len()));
        let (values, weights) = (&values[..count], &weights[..count]);
        let from_origin = |i: usize| if values[i].is_nan() { 0.0 } else { values[i] - origin };
        self.weights.add(place, count, |i| if values[i].is_nan() { 0.0 } else { weights[i] });
        self.sums.add(place, count, |i| weights[i] * from_origin(i));
        self.squares.add(place, count, |i| weights[i] * from_origin(i) * from_origin(i));
    }

    pub(super) fn weight(&self) -> f64 {
        self.weights.total()
    }

    pub(super) fn mean(&self) -> f64 {
        self.origin + self.sums.total() / self.weight()
    }

    pub(super) fn variance(&self) -> f64 {
        (self.squares.total() / self.weight() - (self.sums.total() / self.weight()).powi(2)).max(0.0)
    }
}

impl WindowSums {
    pub(super) fn new(index: i64, start_ns: i64, batch: &Batch, i: usize) -> Self {
        Self {
            index,
            start_ns,
            end_ns: start_ns,
            duration_ns: 0,
            samples: 0,
            first_line: batch.line[i],
            angle: vec![LaneSum::default(); batch.angle.len()],
            temperatures: vec![Moments::EMPTY; batch.temperature_c.len()],
            extremes_c: Vec::new(),
            aux: vec![Moments::EMPTY; batch.aux.len()],
            aux_extremes: vec![(f64::INFINITY, f64::NEG_INFINITY); batch.aux.len()],
            reference: Moments::EMPTY,
            status: vec![Status::OK; batch.angle.len()],
        }
    }

    pub(super) fn add(&mut self, batch: &Batch, rows: Range<usize>, weights: &[f64]) {
        self.end_ns = batch.end_ns[rows.end - 1];
        // The rows join, so their intervals add up to the whole.
        self.duration_ns += self.end_ns - batch.start_ns[rows.start];
        let place = self.samples as usize;
        self.samples += rows.len() as u32;
        for (sum, column) in self.angle.iter_mut().zip(&batch.angle) {
            let column = &column[rows.clone()];
            sum.add(place, column.len(), |i| column[i]);
        }
        let temperatures = self.temperatures.iter_mut().zip(&batch.temperature_c);
        for (moments, column) in temperatures.chain(self.aux.iter_mut().zip(&batch.aux)) {
            moments.add(place, &column[rows.clone()], weights);
        }
        for (extremes, column) in self.aux_extremes.iter_mut().zip(&batch.aux) {
            *extremes = extremes_with(*extremes, &column[rows.clone()]);
        }
        self.reference.add(place, batch.reference_dps.get(rows).unwrap_or(&[]), weights);
    }

    pub(super) fn add_status(&mut self, status: &[Vec<Status>], rows: Range<usize>) {
        for (all, column) in self.status.iter_mut().zip(status) {
            column[rows.clone()].iter().for_each(|bits| *all |= *bits);
        }
    }
}

/// The end of the rows that can join the open window before a temperature has moved too far (the start of
/// them if not even the first can), and the window's extremes with them.
pub(super) fn until_split(open: Option<&WindowSums>, batch: &Batch, rows: Range<usize>) -> (usize, Vec<(f64, f64)>) {
    let extremes = |until: usize| -> Vec<(f64, f64)> {
        let sensors = batch.temperature_c.iter().enumerate();
        let with = sensors.map(|(sensor, column)| {
            let before = open.map_or((f64::INFINITY, f64::NEG_INFINITY), |sums| sums.extremes_c[sensor]);
            extremes_with(before, &column[rows.start..until])
        });
        with.collect()
    };
    let close = |extremes: &[(f64, f64)]| extremes.iter().all(|(min, max)| max - min <= SPLIT_C);
    let all = extremes(rows.end);
    if close(&all) {
        return (rows.end, all);
    }
    // The spread only grows with the rows.
    let (mut fits, mut too_many) = (rows.start, rows.end);
    while too_many - fits > 1 {
        let middle = fits.midpoint(too_many);
        if close(&extremes(middle)) { fits = middle } else { too_many = middle }
    }
    // Without an open window a single row always fits.
    let end = if open.is_none() { fits.max(rows.start + 1) } else { fits };
    (end, extremes(end))
}

/// Lowest and highest with these values too; NaN is passed over.
fn extremes_with((min, max): (f64, f64), values: &[f64]) -> (f64, f64) {
    let lower = |min: f64, value: f64| if value < min { value } else { min };
    let higher = |max: f64, value: f64| if value > max { value } else { max };
    let (mut mins, mut maxs) = ([min; LANES], [max; LANES]);
    let parts = values.chunks_exact(LANES);
    let rest = parts.remainder();
    for part in parts {
        (0..LANES).for_each(|lane| mins[lane] = lower(mins[lane], part[lane]));
        (0..LANES).for_each(|lane| maxs[lane] = higher(maxs[lane], part[lane]));
    }
    (
        mins.into_iter().chain(rest.iter().copied()).fold(min, lower),
        maxs.into_iter().chain(rest.iter().copied()).fold(max, higher),
    )
}
