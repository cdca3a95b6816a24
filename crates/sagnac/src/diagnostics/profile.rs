//! What moved together in a test: temperature with its rate, temperature with time.
//!
//! ```text
//! explained = 1 − SSR/SST      of Ṫ, or of the time since the start of the run, on T₁ … T₄ of the temperature; each run about its mean
//! ```
//!
//! A test that heats and cools has 0: every temperature occurs with both signs of Ṫ. One that only heats has nearly 1: a drift
//! with the rate, or with time, is then also a curve over temperature, and no fit can tell which. Such a calibration holds for
//! the profile that it was made from.
//!
//! Fails where the rate is constant: it is then part of the run's offset, and not counted here.

use nalgebra::{DMatrix, DVector};

use crate::diagnostics::WindowPoint;
use crate::model::basis::{Span, chebyshev};

/// More than this part explained by temperature: they moved together.
pub(crate) const TOGETHER: f64 = 0.8;
/// Order of the series in temperature.
const ORDER: usize = 4;
/// Fewer windows show nothing.
const FEWEST: usize = 20;
/// Rates that vary by less, °C/min, are one rate.
const ONE_RATE_CPM: f64 = 0.02;

/// Part of the variation of Ṫ that temperature explains, 0 to 1; `None` without time, or with one rate.
pub(crate) fn rate_explained(points: &[WindowPoint]) -> Option<f64> {
    explained(points, |p| p.rate_cpm, ONE_RATE_CPM)
}

/// Part of the variation of the time within the runs that temperature explains, 0 to 1; `None` without time.
pub(crate) fn time_explained(points: &[WindowPoint]) -> Option<f64> {
    explained(points, |p| p.hours, 0.0)
}

/// Least by σ of the target.
fn explained(points: &[WindowPoint], value: impl Fn(&WindowPoint) -> f64, least: f64) -> Option<f64> {
    let is_known = |p: &&WindowPoint| p.excluded.is_none() && p.temperature_c.is_finite() && value(p).is_finite();
    let used: Vec<&WindowPoint> = points.iter().filter(is_known).collect();
    let (lo, hi) = used
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| (lo.min(p.temperature_c), hi.max(p.temperature_c)));
    if used.len() < FEWEST || hi <= lo {
        return None;
    }
    let span = Span { lo, hi };
    let rows: Vec<[f64; ORDER + 1]> = used
        .iter()
        .map(|p| {
            let basis = chebyshev(span.x(p.temperature_c));
            std::array::from_fn(|k| if k < ORDER { basis[k + 1] } else { value(p) })
        })
        .collect();
    let runs: Vec<usize> = used.iter().map(|p| p.run).collect();
    let rows = about_means(&rows, &runs);
    let target = DVector::from_iterator(rows.len(), rows.iter().map(|row| row[ORDER]));
    let columns = DMatrix::from_fn(rows.len(), ORDER, |i, k| rows[i][k]);
    let whole = target.norm_squared();
    if whole <= least * least * rows.len() as f64 {
        return None;
    }
    let solved = columns.clone().svd(true, true).solve(&target, 1e-9).ok()?;
    Some((1.0 - (target - columns * solved).norm_squared() / whole).clamp(0.0, 1.0))
}

/// Rows less the means of their runs.
fn about_means<const N: usize>(rows: &[[f64; N]], runs: &[usize]) -> Vec<[f64; N]> {
    let mut sums = vec![([0.0; N], 0.0); runs.iter().max().map_or(0, |last| last + 1)];
    for (row, run) in rows.iter().zip(runs) {
        sums[*run].0.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        sums[*run].1 += 1.0;
    }
    let centred = |(row, run): (&[f64; N], &usize)| std::array::from_fn(|k| row[k] - sums[*run].0[k] / sums[*run].1);
    rows.iter().zip(runs).map(centred).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn test_of(minutes: usize, celsius: impl Fn(f64) -> f64) -> Vec<WindowPoint> {
        let one = |i: usize| {
            let at = i as f64;
            WindowPoint {
                run: 0,
                hours: at / 60.0,
                length_h: 1.0 / 60.0,
                temperature_c: celsius(at),
                rate_cpm: celsius(at + 0.5) - celsius(at - 0.5),
                before_dph: 0.0,
                inputs_dph: 0.0,
                after_dph: 0.0,
                excluded: None,
            }
        };
        (0..minutes).map(one).collect()
    }

    #[test]
    fn heating_alone_moves_together_and_a_cycle_does_not() {
        // A block of 20 min behind a chamber that steps from −40 to 70 °C: Ṫ = (70 − T)/20 exactly.
        let heating = test_of(120, |minutes| 70.0 - 110.0 * (-minutes / 20.0).exp());
        assert!(rate_explained(&heating).unwrap() > 0.999 && time_explained(&heating).unwrap() > TOGETHER);
        // A sine: at every temperature both rates.
        let cycle = test_of(720, |minutes| 15.0 - 55.0 * (std::f64::consts::TAU * minutes / 360.0).cos());
        assert!(rate_explained(&cycle).unwrap() < 0.02, "{:?}", rate_explained(&cycle));
        assert!(time_explained(&cycle).unwrap() < 0.02, "{:?}", time_explained(&cycle));
        let steady = test_of(60, |minutes| minutes);
        assert_eq!(rate_explained(&steady), None, "one rate is part of the offset");
    }
}
