//! How the stamps of a log relate to its rows, by the first of them.
//!
//! ```text
//! groups of equal stamps, regular        ─▶ packets: Δt = step of the stamps / rows of a stamp
//! odd steps at even distances            ─▶ rounded stamps of even rows
//! 32 stamps within one row of a line     ─▶ late stamps of even rows: Δt = slope of the lines
//! equal numbers of rows between pauses   ─▶ bursts, of which two readings are possible
//! anything else                          ─▶ a stamp is the time of its row
//! ```
//!
//! Fails where rows are lost about as often as the rounding makes an odd step: such stamps count as the times of their rows.

use crate::ingest::clock::even::{EvenClock, EvenStamps};

/// Fewest groups or blocks from which anything is concluded.
const FEWEST: usize = 8;
/// Stamps of a block.
const BLOCK: usize = 32;
/// Smallest part of groups, blocks or bursts that are alike.
const MOST: f64 = 0.75;
const HALF: f64 = 0.5;
/// Steps beyond this many usual ones are pauses; beyond the lesser, gaps.
const PAUSE: i64 = 5;
const GAP: f64 = 1.5;
/// Part of the steps that may be gaps, and of an interval that the mean step may be off, where stamps are the times of their rows.
const FEW: f64 = 0.02;
/// Largest distance of late stamps from a line, in rows.
const WIDEST: f64 = 1.1;
/// A clock is coarse whose unit is at least this part of a step.
const COARSE: i64 = 3;
/// Steps of a block whose odd ones are counted, the fewest such blocks, and the largest part of the variance of chance.
const COUNTED: usize = 64;
const FEWEST_COUNTED: usize = 30;
const EVEN: f64 = 0.35;
/// Intervals that are tried around a rough one, and the distance between them, as a part of it.
const TRIED: i32 = 40;
const STEP: f64 = 5e-4;
/// Steps within this part of the median are usual.
const USUAL: u64 = 10;

/// What stamps say of the times of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StampReading {
    /// The time of each row.
    Own,
    /// Even rows.
    Even(EvenStamps),
    /// Several rows share a stamp, in uneven numbers.
    Uneven,
    /// So many rows a `step_ns` apart, a burst every `burst_ns`.
    Bursts { rows: usize, step_ns: i64, burst_ns: i64 },
}

/// The stamps of the first rows.
#[derive(Debug, Default)]
pub(crate) struct FirstStamps {
    /// Of all rows.
    pub(crate) stamps: Vec<i64>,
    /// Rows that repeat stamp and angles of the row before.
    pub(crate) doubled: usize,
}

impl FirstStamps {
    pub(crate) fn reading(&self) -> StampReading {
        let groups: Vec<&[i64]> = self.stamps.chunk_by(|a, b| a == b).collect();
        let sizes = sorted(groups.iter().map(|group| group.len() as i64));
        let shared = self.stamps.len() - groups.len();
        if groups.len() > FEWEST && sizes[sizes.len() / 2] > 1 && 2 * self.doubled < shared {
            return packets(&groups).map_or(StampReading::Uneven, StampReading::Even);
        }
        let stamps: Vec<i64> = groups.iter().map(|group| group[0]).collect();
        let steps: Vec<i64> = stamps.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
        let Some(usual) = TimeSteps::of_steps(steps.iter().copied()) else { return StampReading::Own };
        let is_near = |step: &f64| (0.0..=GAP * usual.typical_ns as f64).contains(step);
        let near: Vec<f64> = steps.iter().map(|step| *step as f64).filter(is_near).collect();
        let gaps = steps.len() - near.len();
        let mean_ns = near.iter().sum::<f64>() / near.len().max(1) as f64;
        let is_even = (mean_ns / usual.typical_ns as f64 - 1.0).abs() <= FEW;
        if is_even && (gaps as f64) < FEW * steps.len() as f64 {
            return StampReading::Own;
        }
        let read = bursts(&steps, &usual).or_else(|| rounded(&stamps, &steps, &usual));
        read.or_else(|| late(&stamps, &steps, &usual)).unwrap_or(StampReading::Own)
    }
}

fn sorted(values: impl Iterator<Item = i64>) -> Vec<i64> {
    let mut values: Vec<i64> = values.collect();
    values.sort_unstable();
    values
}

/// Statistics of the times of some rows.
pub(crate) struct TimeSteps {
    median_ns: i64,
    /// Mean of the steps within a tenth of their median, ns: stamps are often rounded.
    pub(crate) typical_ns: i64,
    /// Mean of all steps forward, ns.
    pub(crate) mean_ns: f64,
    /// Number of steps forward, and the fraction of them within a tenth of their median.
    pub(crate) number: usize,
    pub(crate) regular_part: f64,
}

impl TimeSteps {
    pub(crate) fn of(times: &[i64]) -> Option<Self> {
        Self::of_steps(times.windows(2).map(|pair| pair[1].saturating_sub(pair[0])))
    }

    fn of_steps(steps: impl Iterator<Item = i64>) -> Option<Self> {
        let mut steps = sorted(steps.filter(|step| *step > 0));
        let number = steps.len();
        let median_ns = *steps.get(number.checked_sub(1)? / 2)?;
        let sum = |steps: &[i64]| steps.iter().map(|step| i128::from(*step)).sum::<i128>();
        let mean_ns = sum(&steps) as f64 / number as f64;
        steps.retain(|step| is_usual(*step, median_ns));
        let typical_ns = i64::try_from(sum(&steps) / steps.len() as i128).ok()?;
        Some(Self { median_ns, typical_ns, mean_ns, number, regular_part: steps.len() as f64 / number as f64 })
    }

    /// A step within a tenth of the median.
    fn has(&self, step_ns: i64) -> bool {
        is_usual(step_ns, self.median_ns)
    }
}

fn is_usual(step_ns: i64, median_ns: i64) -> bool {
    step_ns.abs_diff(median_ns) <= median_ns.unsigned_abs() / USUAL
}

/// Packets of rows, by their groups; the first and the last may be cut.
fn packets(groups: &[&[i64]]) -> Option<EvenStamps> {
    let steps: Vec<i64> = groups.windows(2).map(|pair| pair[1][0].saturating_sub(pair[0][0])).collect();
    let usual = TimeSteps::of_steps(steps.iter().copied()).filter(|usual| usual.regular_part >= HALF)?;
    // Whole groups: those before a usual step.
    let whole: Vec<f64> =
        (1..steps.len()).filter(|at| usual.has(steps[*at])).map(|at| groups[at].len() as f64).collect();
    let middle = *sorted(whole.iter().map(|size| *size as i64)).get(whole.len() / 2)? as f64;
    let part =
        |alike: &dyn Fn(f64) -> bool| whole.iter().filter(|size| alike(**size)).count() as f64 / whole.len() as f64;
    if part(&|size| (size - middle).abs() <= HALF * middle) < MOST {
        return None;
    }
    let mean = whole.iter().sum::<f64>() / whole.len() as f64;
    let rows_of_stamp = if part(&|size| size == middle) >= MOST { middle } else { mean };
    let interval_ns = usual.typical_ns as f64 / rows_of_stamp;
    let away = sorted(steps.iter().filter(|step| usual.has(**step)).map(|step| (*step - usual.median_ns).abs()));
    let scatter_ns = (0.75 * interval_ns).max(GAP * away[away.len() * 9 / 10] as f64);
    let missing_of_first = (rows_of_stamp - groups[0].len() as f64).max(0.0).round();
    Some(EvenStamps { interval_ns, rows_of_stamp, missing_of_first, scatter_ns })
}

/// Bursts of equal numbers of rows.
fn bursts(steps: &[i64], usual: &TimeSteps) -> Option<StampReading> {
    let pauses: Vec<usize> = (0..steps.len()).filter(|at| steps[*at] > usual.median_ns.saturating_mul(PAUSE)).collect();
    let lengths = sorted(pauses.windows(2).map(|pair| (pair[1] - pair[0]) as i64));
    let rows = *lengths.get(lengths.len() / 2).filter(|rows| **rows > 1 && lengths.len() >= FEWEST)?;
    let alike = lengths.iter().filter(|length| **length == rows).count() as f64 / lengths.len() as f64;
    let periods: Vec<i64> = pauses.windows(2).map(|pair| steps[pair[0]..pair[1]].iter().sum()).collect();
    let period = TimeSteps::of_steps(periods.into_iter()).filter(|of| of.regular_part >= MOST && alike >= MOST)?;
    let (step_ns, burst_ns) = (usual.typical_ns, period.typical_ns);
    Some(StampReading::Bursts { rows: rows as usize, step_ns, burst_ns })
}

/// Stamps in whole units of the clock, as coarse as the rows: their odd steps come at even distances, those of lost rows by chance.
fn rounded(stamps: &[i64], steps: &[i64], usual: &TimeSteps) -> Option<StampReading> {
    let unit_ns = steps.iter().copied().filter(|step| *step > 0).min()?;
    let is_unit = unit_ns == 10_i64.pow(unit_ns.ilog10()) && usual.median_ns <= unit_ns.saturating_mul(COARSE);
    let blocks: Vec<&[i64]> = steps.chunks_exact(COUNTED).collect();
    if !is_unit || blocks.len() < FEWEST_COUNTED || steps.iter().any(|step| step % unit_ns != 0) {
        return None;
    }
    let odd = |block: &&[i64]| block.iter().filter(|step| !usual.has(**step)).count() as f64;
    let counts: Vec<f64> = blocks.iter().map(odd).collect();
    let mean = counts.iter().sum::<f64>() / counts.len() as f64;
    let variance = counts.iter().map(|count| (count - mean).powi(2)).sum::<f64>() / (counts.len() - 1) as f64;
    if variance > EVEN * mean * (1.0 - mean / COUNTED as f64) {
        return None;
    }
    // Rows lost in a block lengthen it.
    let spans = sorted(blocks.iter().map(|block| block.iter().sum::<i64>()));
    let roughly_ns = spans[spans.len() / 2] as f64 / COUNTED as f64;
    refined(stamps, roughly_ns, |interval_ns| (HALF * interval_ns).max(0.75 * unit_ns as f64))
}

/// Even rows of the interval that counts the rows of these stamps, lost ones included; each interval has its scatter.
fn refined(stamps: &[i64], roughly_ns: f64, scatter_ns: impl Fn(f64) -> f64) -> Option<StampReading> {
    let stamps_of = |interval_ns: f64| EvenStamps::of_rows(interval_ns, scatter_ns(interval_ns));
    // The last stamp may be out of order.
    let last = (1..stamps.len()).rev().find(|at| stamps[at - 1] < stamps[*at] && stamps[*at] >= stamps[at / 2])?;
    let (stamps, span_ns) = (&stamps[..=last], (stamps[last] - stamps[0]) as f64);
    let count = |interval_ns: f64| EvenClock::new(stamps_of(interval_ns)).rows_to_the_last(stamps);
    let tried = (-TRIED..=TRIED).map(|step| roughly_ns * (1.0 + f64::from(step) * STEP));
    let counted = tried.map(count).min_by_key(|(_, off)| *off);
    let interval_ns = span_ns / counted?.0;
    (interval_ns.is_finite() && interval_ns >= 1.0).then(|| StampReading::Even(stamps_of(interval_ns)))
}

/// Even rows whose stamps are late by up to a row.
fn late(stamps: &[i64], steps: &[i64], usual: &TimeSteps) -> Option<StampReading> {
    // Where rows are lost, steps are multiples.
    let is_multiple = |step: i64| {
        let rows = (step as f64 / usual.typical_ns as f64).round();
        rows > 1.0 && (step as f64 - rows * usual.typical_ns as f64).abs() <= usual.typical_ns as f64 / USUAL as f64
    };
    let odd = || steps.iter().filter(|step| **step > 0 && !usual.has(**step));
    if odd().filter(|step| is_multiple(**step)).count() as f64 > HALF * odd().count() as f64 {
        return None;
    }
    let lines: Vec<Line> = stamps.chunks_exact(BLOCK).map(Line::through).filter(|line| line.slope_ns > 0.0).collect();
    let mut straight: Vec<&Line> = lines.iter().filter(|line| line.range_ns <= WIDEST * line.slope_ns).collect();
    if straight.len() < FEWEST || (straight.len() as f64) < HALF * lines.len() as f64 {
        return None;
    }
    straight.sort_by(|a, b| a.slope_ns.total_cmp(&b.slope_ns));
    let interval_ns = straight[straight.len() / 2].slope_ns;
    let range_ns = straight.iter().map(|line| line.range_ns).fold(0.0, f64::max);
    let scatter_ns = (HALF * interval_ns).max(0.75 * range_ns);
    refined(stamps, interval_ns, |_| scatter_ns)
}

/// The line of least squares through stamps one row apart.
struct Line {
    slope_ns: f64,
    /// From the lowest to the highest residual.
    range_ns: f64,
}

impl Line {
    fn through(stamps: &[i64]) -> Self {
        let n = stamps.len() as f64;
        let value = |at: usize| stamps[at].saturating_sub(stamps[0]) as f64;
        let row = |at: usize| at as f64 - (n - 1.0) / 2.0;
        let squares = n * (n * n - 1.0) / 12.0;
        let slope_ns = (0..stamps.len()).map(|at| row(at) * value(at)).sum::<f64>() / squares;
        let residuals = (0..stamps.len()).map(|at| value(at) - slope_ns * row(at));
        let (low, high) = residuals.fold((f64::MAX, f64::MIN), |(low, high), r| (low.min(r), high.max(r)));
        Self { slope_ns, range_ns: high - low }
    }
}
