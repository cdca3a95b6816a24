//! What a term may be a function of: a thermometer, the difference of two, an auxiliary column.
//!
//! Each has a span (from the lowest to the highest sample of the rows), a reference at which its terms are zero, and for every
//! row of the problem its mean and second moment. The thermometer of the fit is input 0; its reference is T0. Another
//! thermometer is zero at T0 too (at the nearer end of its span where T0 lies outside), differences and columns at their mean.
//!
//! A column whose windows hold whole numbers, 2 to 16 of them, may have steps between them: the longitudinal mode, a gain.
//!
//! Where it fails: the second moment of a difference within a window is not known from the windows and taken as zero.

use std::borrow::Cow;

use crate::model::basis::{BASIS_LEN, Span, chebyshev, chebyshev_mean};
use crate::model::shape::{KNOTS_PER_ONE, Movement, TermShape};
use crate::window::{WindowShape, Windows, holds_whole_numbers, is_whole};

/// Fewest and most whole numbers of a column that may have steps.
const STEPPED: std::ops::RangeInclusive<usize> = 2..=16;
/// A column narrower than this part of its size has too few codes for an image.
const LEAST_OF_SIZE: f64 = 2e-4;
/// Nor is one narrower than this.
const LEAST_WIDTH: f64 = 1e-15;
/// A column whose second moment within a window is below this stands still in it.
const STILL: f64 = 1e-9;
/// Part of the windows in which an input must be known to be a candidate.
const KNOWN: f64 = 0.95;
/// A thermometer or difference must move by this, °C, to be a candidate.
const LEAST_SPAN_C: f64 = 0.05;

/// A signal of a log that terms may depend on, by its index in [`WindowShape::thermometers`] and [`WindowShape::aux`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    Thermometer(usize),
    Difference { of: usize, less: usize },
    Column(usize),
}

impl Signal {
    /// The input of a name, if the log has it.
    pub(crate) fn named(name: &str, shape: &WindowShape) -> Option<Self> {
        let thermometer = |name: &str| {
            let name = name.trim();
            shape.thermometers.iter().position(|other| label(other) == name)
        };
        let column = || (0..shape.aux.len()).find(|at| Self::Column(*at).name(shape) == name).map(Self::Column);
        let difference = || {
            let (of, less) = name.split_once(" - ")?;
            Some(Self::Difference { of: thermometer(of)?, less: thermometer(less)? })
        };
        thermometer(name).map(Self::Thermometer).or_else(column).or_else(difference)
    }

    /// Its name in models and records.
    pub(crate) fn name(self, shape: &WindowShape) -> String {
        let thermometer = |at: usize| shape.thermometers.get(at).map_or("", |name| label(name));
        match self {
            Self::Thermometer(at) => thermometer(at).to_owned(),
            Self::Difference { of, less } => format!("{} - {}", thermometer(of), thermometer(less)),
            Self::Column(at) => {
                let name = shape.aux.get(at).map_or("", String::as_str);
                let taken = shape.thermometers.iter().any(|other| label(other) == name);
                if taken { format!("aux_{name}") } else { name.to_owned() }
            }
        }
    }

    /// Every signal of a log except the thermometer of the fit, simplest first.
    pub(crate) fn others(shape: &WindowShape, main: usize) -> Vec<Self> {
        let count = shape.thermometers.len();
        let thermometers = (0..count).filter(|at| *at != main).map(Self::Thermometer);
        let pairs = (0..count).flat_map(|of| (0..of).map(move |less| Self::Difference { of, less }));
        thermometers.chain((0..shape.aux.len()).map(Self::Column)).chain(pairs).collect()
    }

    /// Mean and second moment in a window, in its own unit.
    pub(crate) fn in_window(self, windows: &Windows, window: usize) -> (f64, f64) {
        let rows = &windows.rows;
        match self {
            Self::Thermometer(at) => (rows.mean_c[at][window], rows.variance_c2[at][window]),
            Self::Difference { of, less } => (rows.mean_c[of][window] - rows.mean_c[less][window], 0.0),
            Self::Column(at) => (rows.aux[at][window], rows.aux_variance[at][window]),
        }
    }

    /// Lowest and highest value in some windows, in its own unit.
    fn extremes(self, windows: &Windows, used: &[usize]) -> (f64, f64) {
        let rows = &windows.rows;
        let range = |window: &usize| match self {
            Self::Thermometer(at) => (rows.min_c[at][*window], rows.max_c[at][*window]),
            Self::Difference { .. } => self.in_track(windows, *window),
            Self::Column(at) => (rows.aux_min[at][*window], rows.aux_max[at][*window]),
        };
        used.iter().map(range).fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), (l, h)| (lo.min(l), hi.max(h)))
    }

    /// Lowest and highest value of its track in a window; its mean where there is no track.
    fn in_track(self, windows: &Windows, window: usize) -> (f64, f64) {
        let (rows, run) = (&windows.rows, &windows.runs[windows.rows.run[window] as usize]);
        let place =
            |ns: i64| usize::try_from(ns.saturating_sub(run.start_ns) / windows.shape.period_ns.max(1)).unwrap_or(0);
        let (from, to) = (place(rows.start_ns[window]), place(rows.end_ns[window]));
        let mean = self.in_window(windows, window).0;
        (from..=to)
            .filter_map(|at| self.track_at(windows, rows.run[window] as usize, at))
            .fold((mean, mean), |(lo, hi), value| (lo.min(value), hi.max(value)))
    }

    /// A point of its track in a run.
    fn track_at(self, windows: &Windows, run: usize, at: usize) -> Option<f64> {
        let tracks = &windows.runs[run].tracks;
        match self {
            Self::Thermometer(sensor) => tracks.get(sensor)?.get(at).copied(),
            Self::Difference { of, less } => Some(tracks.get(of)?.get(at)? - tracks.get(less)?.get(at)?),
            Self::Column(column) => tracks.get(windows.shape.thermometers.len() + column)?.get(at).copied(),
        }
    }

    /// A temperature or a difference of two; else a column in a unit of its own.
    pub(crate) fn in_celsius(self) -> bool {
        !matches!(self, Self::Column(_))
    }

    /// Its track in a run, in its own unit, on the grid of the temperature period.
    pub(crate) fn track(self, windows: &Windows, run: usize) -> Cow<'_, [f64]> {
        let tracks = &windows.runs[run].tracks;
        match self {
            Self::Thermometer(at) => Cow::Borrowed(&tracks[at]),
            Self::Difference { of, less } => tracks[of].iter().zip(&tracks[less]).map(|(a, b)| a - b).collect(),
            Self::Column(at) => Cow::Borrowed(&tracks[windows.shape.thermometers.len() + at]),
        }
    }

    /// Why `auto` does not try it; `None` where it does.
    pub(crate) fn rejection(self, windows: &Windows, used: &[usize]) -> Option<&'static str> {
        let means: Vec<f64> =
            used.iter().map(|i| self.in_window(windows, *i).0).filter(|mean| mean.is_finite()).collect();
        let (lo, hi) = means.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), m| (lo.min(*m), hi.max(*m)));
        if (means.len() as f64) < KNOWN * used.len() as f64 {
            Some("known in fewer than 95 of 100 windows")
        } else if self.in_celsius() && hi - lo < LEAST_SPAN_C {
            Some("moves by less than 0.05 °C")
        } else if !self.in_celsius() && !is_wide([lo, hi]) {
            Some("always the same, or too nearly for the codes of an image")
        } else {
            None
        }
    }
}

/// A column that moves by enough of its size for the codes of an image.
fn is_wide([lo, hi]: [f64; 2]) -> bool {
    hi - lo > (LEAST_OF_SIZE * lo.abs().max(hi.abs())).max(LEAST_WIDTH)
}

/// A thermometer's name; `temperature_c` for the one without.
pub(crate) fn label(name: &str) -> &str {
    if name.is_empty() { "temperature_c" } else { name }
}

/// What an image must read for some inputs: the thermometer of the fit, everything with a code of its own, then the
/// differences, each once.
pub(crate) fn channels(main: Signal, others: &[Signal]) -> Vec<Signal> {
    let mut own = vec![main];
    let mut differences = Vec::new();
    for signal in others {
        let needed = match *signal {
            Signal::Difference { of, less } => {
                differences.push(*signal);
                vec![Signal::Thermometer(of), Signal::Thermometer(less)]
            }
            other => vec![other],
        };
        needed.into_iter().for_each(|signal| {
            if !own.contains(&signal) {
                own.push(signal)
            }
        });
    }
    differences.dedup();
    own.into_iter().chain(differences).collect()
}

/// An input on the rows of a problem.
#[derive(Clone)]
pub(crate) struct SampledInput {
    pub(crate) signal: Signal,
    pub(crate) name: String,
    /// Place of the input that it repeats for a second lag.
    pub(crate) repeats: Option<usize>,
    pub(crate) span: Span,
    /// Where its terms are zero.
    pub(crate) reference: f64,
    /// Per row: mean of x, and T̄ᵢ − Tᵢ(x0).
    pub(crate) x: Vec<f64>,
    pub(crate) basis: Vec<[f64; BASIS_LEN]>,
    /// Per row: second moment of x.
    x_variance: Vec<f64>,
    /// Whole numbers it takes, where steps may stand between them.
    levels: Vec<f64>,
}

impl SampledInput {
    /// On these windows, in which it must be known; `reference` or its own where that is `None`.
    pub(crate) fn new(signal: Signal, windows: &Windows, used: &[usize], reference: f64) -> Self {
        Self::over(signal, windows, used, reference, [f64::INFINITY, f64::NEG_INFINITY])
    }

    /// The same on a span that holds at least these values.
    pub(crate) fn over(signal: Signal, windows: &Windows, used: &[usize], reference: f64, least: [f64; 2]) -> Self {
        let moments: Vec<(f64, f64)> = used.iter().map(|i| signal.in_window(windows, *i)).collect();
        let (lo, hi) = signal.extremes(windows, used);
        let (lo, hi) = (lo.min(least[0]), hi.max(least[1]));
        let exponent = if signal.in_celsius() { 0 } else { unit_exponent(plausible_about([lo, hi])) };
        let unit = 2.0_f64.powi(exponent.into());
        let on_grid = Span::on_grid(lo / unit, hi / unit);
        let span = Span { lo: on_grid.lo * unit, hi: on_grid.hi * unit };
        let reference = match signal {
            Signal::Thermometer(_) => reference.clamp(span.lo, span.hi),
            Signal::Difference { .. } | Signal::Column(_) => {
                moments.iter().map(|(mean, _)| mean).sum::<f64>() / moments.len().max(1) as f64
            }
        };
        let at_reference = chebyshev(span.x(reference));
        let x: Vec<f64> = moments.iter().map(|(mean, _)| span.x(*mean)).collect();
        let x_variance: Vec<f64> = moments.iter().map(|(_, variance)| variance * span.slope().powi(2)).collect();
        let basis = x.iter().zip(&x_variance).map(|(x, variance)| {
            let mean = chebyshev_mean(*x, *variance);
            std::array::from_fn(|n| mean[n] - at_reference[n])
        });
        let basis = basis.collect();
        let levels = if signal.in_celsius() { Vec::new() } else { whole_numbers(&moments) };
        // The image's knots stand on a grid of the span; a threshold must stay between its two levels there.
        let apart = |pair: &[f64]| span.x(pair[1]) - span.x(pair[0]) > 4.0 / KNOTS_PER_ONE;
        let levels = if levels.windows(2).all(apart) { levels } else { Vec::new() };
        let name = signal.name(&windows.shape);
        Self { signal, name, repeats: None, span, reference, x, basis, x_variance, levels }
    }

    /// Every input once more, for a second lag.
    pub(crate) fn repeated(all: &[Self]) -> Vec<Self> {
        let repeat = |(at, input): (usize, &Self)| {
            let mut name = format!("slow {}", input.name);
            // A column may have that name already.
            while all.iter().any(|other| other.name == name) {
                name.insert_str(0, "slow ");
            }
            Self { name, repeats: Some(at), ..input.clone() }
        };
        all.iter().enumerate().map(repeat).collect()
    }

    /// True where an image has codes enough for its span.
    pub(crate) fn fits_codes(&self) -> bool {
        self.signal.in_celsius() || is_wide([self.span.lo, self.span.hi])
    }

    /// Thresholds of its steps: halfway between the whole numbers it takes.
    pub(crate) fn thresholds(&self) -> Vec<f64> {
        self.levels.windows(2).map(|pair| f64::midpoint(pair[0], pair[1])).collect()
    }

    /// Mean of a shape over a row, less its value at the reference.
    pub(crate) fn mean(&self, shape: TermShape, row: usize) -> f64 {
        if let TermShape::Chebyshev { order } = shape {
            return self.basis[row].get(usize::from(order)).copied().unwrap_or(0.0);
        }
        let over = Movement { x: self.x[row], variance: self.x_variance[row], levels: &self.levels };
        shape.mean(self.span, over) - shape.value(self.span, self.reference)
    }

    /// Mean of a row, in its own unit.
    pub(crate) fn value(&self, row: usize) -> f64 {
        f64::midpoint(self.span.lo, self.span.hi) + self.x[row] / self.span.slope()
    }
}

/// Knots of so many zones of equal width over a span, on the grid of the image, in the unit of the input.
pub(crate) fn knots(zones: u8, span: Span) -> Vec<f64> {
    let on_grid = |x: f64| (x * KNOTS_PER_ONE).round() / KNOTS_PER_ONE;
    (1..zones).map(|k| span.at(on_grid(2.0 * f64::from(k) / f64::from(zones) - 1.0))).collect()
}

/// The whole numbers of a column, if its windows hold nothing else but where it changes.
fn whole_numbers(moments: &[(f64, f64)]) -> Vec<f64> {
    // A window that changes between two numbers may have a whole mean, but it does not stand still.
    let still = |(mean, variance): &(f64, f64)| if *variance < STILL { *mean } else { f64::NAN };
    let enough = holds_whole_numbers(moments.iter().map(still));
    let mut levels: Vec<f64> = moments.iter().map(still).filter(|mean| is_whole(*mean)).map(f64::round).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    if enough && STEPPED.contains(&levels.len()) { levels } else { Vec::new() }
}

/// A column is accepted as far from its span as the span is wide.
pub(crate) fn plausible_about([lo, hi]: [f64; 2]) -> [f64; 2] {
    let wide = (hi - lo).max(1e-9 * lo.abs().max(hi.abs())).max(f64::MIN_POSITIVE);
    [lo - wide, hi + wide]
}

/// The power of two by which a column's unit is taken so that what is accepted of it fits the codes of a thermometer.
pub(crate) fn unit_exponent([lo, hi]: [f64; 2]) -> i8 {
    const MOST: f64 = 120.0;
    let exponent = (lo.abs().max(hi.abs()) / MOST).log2().ceil();
    exponent.clamp(-60.0, 60.0) as i8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zones_meet_with_a_continuous_slope() {
        let span = Span { lo: -1.0, hi: 1.0 };
        let knot = knots(4, span)[2];
        let zone = TermShape::Zone { knot };
        assert!((knot - 0.5).abs() < 1e-12);
        assert!(zone.slope(span, knot - 1e-6).abs() < 1e-9 && zone.slope(span, knot + 1e-6).abs() < 1e-4);
        assert!((zone.value(span, 1.0) - 1.0).abs() < 1e-12 && (zone.slope(span, 0.75) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn a_column_of_modes_has_steps_and_a_voltage_has_none() {
        let modes: Vec<(f64, f64)> = (0..100).map(|i| (f64::from(i / 30 + 7), 0.0)).collect();
        assert_eq!(whole_numbers(&modes), [7.0, 8.0, 9.0, 10.0]);
        let changing: Vec<(f64, f64)> = modes.iter().map(|(m, _)| (m + 0.3, 0.2)).collect();
        assert!(whole_numbers(&changing).is_empty());
        let volts: Vec<(f64, f64)> = (0..100).map(|i| (f64::from(i), 0.0)).collect();
        assert!(whole_numbers(&volts).is_empty());
    }

    #[test]
    fn units_hold_what_is_accepted() {
        assert_eq!(unit_exponent([-270.0, 270.0]), 2);
        assert_eq!(unit_exponent([0.0, 0.006]), -14);
        assert!(0.006 / 2.0_f64.powi(-14) <= 120.0);
        assert_eq!(unit_exponent([-100.0, 120.0]), 0);
    }
}
