//! How far rows scatter about their median, and whether counts alone show that none is far from it.
//!
//! ```text
//! scale² = ((q₉₅ − q₅) / 3.29)² + step²/6        3.29 σ between these quantiles of a normal distribution; rounding to the smallest step
//! far    = 6·scale                               noise alone exceeds it once in 10⁸ rows
//! ```
//!
//! Most blocks have no row that far, and counts show it without the quantiles: if at least so many rows lie at or below a level as a
//! quantile has below it, the quantile is not above that level ([`Bounds`]). The result is the same.

/// Fewest rows that give a scale.
const FEWEST: usize = 32;
/// Scales from the median to a disturbed row.
const FAR: f64 = 6.0;
/// Fraction of the rows in each tail outside the quantiles that give the scale, and the distance of these quantiles in
/// standard deviations of a normal distribution.
const TAIL: f64 = 0.05;
const TAILS_APART: f64 = 3.29;

/// Median and scale of rows.
pub(crate) struct Level {
    low: f64,
    pub(crate) median: f64,
    high: f64,
    /// Distance from the median beyond which a row is disturbed.
    pub(crate) far: f64,
}

impl Level {
    /// `None` for too few rows, and for rows that are all alike.
    pub(crate) fn of(mut rows: Vec<f64>) -> Option<Self> {
        if rows.len() < FEWEST {
            return None;
        }
        let rounding = variance_of_rounding(smallest_step(&rows));
        let mut at = |part: f64| {
            let place = place_of_quantile(rows.len(), part);
            *rows.select_nth_unstable_by(place, f64::total_cmp).1
        };
        let (high, low) = (at(1.0 - TAIL), at(TAIL));
        let spread = (high - low) / TAILS_APART;
        let scale = (spread * spread + rounding).sqrt();
        (scale > 0.0).then(|| Self { low, median: at(0.5), high, far: FAR * scale })
    }
}

/// Smallest step between two rows that follow each other and differ.
fn smallest_step(rows: &[f64]) -> f64 {
    let pairs = rows.iter().zip(rows.get(1..).unwrap_or_default());
    pairs.fold(f64::INFINITY, |least, (a, b)| {
        let step = (b - a).abs();
        if step > 0.0 && step < least { step } else { least }
    })
}

/// The smallest step is at least that of rounding; its differences have a variance of step²/6.
fn variance_of_rounding(step: f64) -> f64 {
    if step.is_finite() { step * step / 6.0 } else { 0.0 }
}

/// Where a quantile is in sorted rows.
fn place_of_quantile(rows: usize, part: f64) -> usize {
    ((rows - 1) as f64 * part).round() as usize
}

/// Levels near the quantiles of a block, from which counts bound those of the next.
#[derive(Clone)]
pub(crate) struct Bounds {
    /// Above the low quantile and below the high one.
    tails: [f64; 2],
    /// Below and above the median.
    middle: [f64; 2],
}

impl Bounds {
    /// Distance of a level from its quantile, in the distance between the tails: quantiles of the next block scatter by less.
    const MARGIN: f64 = 0.07;
    /// Share of the threshold that is used: rounding is far less.
    const SHARE: f64 = 0.999;

    pub(crate) fn about(level: &Level) -> Self {
        let margin = Self::MARGIN * (level.high - level.low);
        Self {
            tails: [level.low + margin, level.high - margin],
            middle: [level.median - margin, level.median + margin],
        }
    }

    /// True if none of these rows can be disturbed by [`Level`], with the context before them.
    pub(crate) fn hold(&self, context: &[f64], rows: &[f64]) -> bool {
        let number = context.len() + rows.len();
        if number < FEWEST {
            return false;
        }
        let mut seen = Counts::default();
        [context, rows].into_iter().for_each(|rows| seen.add(rows, self));
        let joint: Vec<f64> = context.last().into_iter().chain(rows.first()).copied().collect();
        let step = [context, &joint, rows].map(smallest_step).into_iter().fold(f64::INFINITY, f64::min);
        let [low, middle, high] = [TAIL, 0.5, 1.0 - TAIL].map(|part| place_of_quantile(number, part));
        let bounded = seen.low as usize > low
            && seen.high as usize >= number - high
            && seen.below as usize <= middle
            && (seen.above as usize) < number - middle;
        let spread = (self.tails[1] - self.tails[0]) / TAILS_APART;
        let far = Self::SHARE * FAR * (spread * spread + variance_of_rounding(step)).sqrt();
        bounded && seen.most - self.middle[0] < far && self.middle[1] - seen.least < far
    }
}

/// Rows beyond each level, and the outermost.
struct Counts {
    low: u64,
    below: u64,
    above: u64,
    high: u64,
    least: f64,
    most: f64,
}

impl Default for Counts {
    fn default() -> Self {
        Self { low: 0, below: 0, above: 0, high: 0, least: f64::INFINITY, most: f64::NEG_INFINITY }
    }
}

impl Counts {
    fn add(&mut self, rows: &[f64], bounds: &Bounds) {
        let ([low, high], [below, above]) = (bounds.tails, bounds.middle);
        for row in rows {
            self.low += u64::from(*row <= low);
            self.high += u64::from(*row >= high);
            self.below += u64::from(*row < below);
            self.above += u64::from(*row > above);
            self.least = if *row < self.least { *row } else { self.least };
            self.most = if *row > self.most { *row } else { self.most };
        }
    }
}
