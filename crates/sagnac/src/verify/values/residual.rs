//! What the corrected windows of a proof come to, value by value, for limits to check.
//!
//! ```text
//! plateau             steady windows (|Ṫ| ≤ 0.05 °C/min) within ±1 °C: σ about their own mean, and that mean about the run's
//! ramps               root mean square of heating and cooling windows about the run's mean
//! ramps less soaks    mean of heating and cooling windows less that of the steady ones: an effect of |Ṫ|, which no slope has
//! per °C, per °C/min  slopes of one line r = a + s·T + q·Ṫ through all windows
//! ARW                 N of the rows, raw, and corrected before they are rounded, by their Allan deviations
//! over temperature    root mean square of a Chebyshev series of order 16 in T through all windows, less what noise makes of it; every
//!                     temperature that was visited counts alike, however long
//! bias instability    least overlapping Allan deviation of the corrected windows / 0.664, across gaps of up to two windows: an estimate
//!                     of B that noise lifts and few degrees of freedom scatter
//! ```
//!
//! Out of sample always: the windows are those of a retest. Standard errors of the slopes and of the series by the noise of the windows,
//! slow noise too ([`super::noise`]); of a plateau's mean by its own scatter.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::diagnostics::{Leg, WindowPoint};
use crate::model::Span;
use crate::verify::values::judged_windows::{Estimate, joined, judged, smooth_columns, smooth_order};
use crate::verify::values::memory::{Memory, memory};
use crate::verify::values::noise::RetestNoise;
use crate::window::level_stretches;
use sagnac_noise::{Deviation, Difference, SquareSum, overlapping, phases};

/// Fewer windows are no plateau.
const FEWEST: usize = 5;
/// Fewer windows of a leg tell no value.
const FEWEST_OF_LEG: usize = 10;
/// Fewer windows of ramps, or of soaks, are not compared.
const FEWEST_OF_SOAKS: f64 = 20.0;
/// Mean square below which temperature does not vary, °C².
const LEAST_SPREAD_C2: f64 = 0.09;
/// The same of its rate, (°C/min)².
const LEAST_SPREAD_CPM2: f64 = 1e-4;
/// 1 − correlation² of T and Ṫ from which on they are separable.
const LEAST_APART: f64 = 1e-3;
/// √(2 ln 2/π): the flat of a flicker of B = 1.
const FLAT: f64 = 0.664_28;

/// Steady stretches of a retest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Plateaus {
    /// How many.
    pub plateaus: usize,
    /// Largest σ within one, about its own mean, °/h.
    pub worst_sigma_dph: f64,
    /// Temperature of the plateau with that σ, °C; absent in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst_sigma_temperature_c: Option<f64>,
    /// Standard error of that σ as a part of it.
    pub worst_relative_sigma: f64,
    /// Largest distance of a plateau's mean from its run's mean, °/h.
    pub worst_offset_dph: Estimate,
    /// Temperature of the plateau with that distance, °C.
    pub worst_offset_temperature_c: f64,
    /// Of a lone plateau: so much more of the next soak, h, would make it a second one. Not in results that were written.
    #[serde(skip)]
    pub missing_h: Option<f64>,
}

/// Angle random walk of the rows, °/√h.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RandomWalk {
    /// As logged.
    pub before_deg_rt_h: f64,
    /// As corrected, before rounding to whole counts.
    pub after_deg_rt_h: f64,
    /// Its 95 % interval, from zero where N is not resolved; null where the five laws do not describe the curve.
    pub after_ends_deg_rt_h: Option<[f64; 2]>,
}

/// Values of the residual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct RetestResidual {
    /// Null without a plateau.
    pub plateaus: Option<Plateaus>,
    /// Null without ramps.
    pub ramps_rms_dph: Option<f64>,
    /// Mean of the ramps less mean of the steady windows, °/h; null where either has fewer than 20.
    pub ramp_offset_dph: Option<Estimate>,
    /// Null where no temperature was soaked from both sides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
    /// °/h per °C; null where the temperature does not move.
    pub temperature_slope: Option<Estimate>,
    /// °/h per °C/min; null where its rate does not.
    pub rate_slope: Option<Estimate>,
    /// Null where the rows do not tell it.
    pub random_walk: Option<RandomWalk>,
    /// Root mean square over temperature of the smooth residual, less what noise makes of it, °/h: every temperature visited counts
    /// alike. Null where the temperature does not move.
    pub over_temperature_dph: Option<Estimate>,
    /// The same of what the correction removed, °/h; null where it removed nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub removed_over_temperature_dph: Option<f64>,
    /// Estimate of the bias instability, °/h; null with too few neighbours.
    pub bias_instability_dph: Option<Estimate>,
}

/// From the points of an axis and their noise.
pub(crate) fn residual(points: &[WindowPoint], noise: &RetestNoise, random_walk: Option<RandomWalk>) -> RetestResidual {
    let used = judged(points);
    let (temperature_slope, rate_slope) = slopes(&used, noise);
    RetestResidual {
        plateaus: plateaus(&used),
        ramps_rms_dph: ramps(&used),
        ramp_offset_dph: ramp_offset(&used, noise),
        memory: memory(&used, noise),
        temperature_slope,
        rate_slope,
        random_walk,
        over_temperature_dph: over_temperature(&used, noise),
        removed_over_temperature_dph: removed_over_temperature(&used),
        bias_instability_dph: bias_instability(&used),
    }
}

fn mean(points: &[&WindowPoint], value: impl Fn(&WindowPoint) -> f64) -> f64 {
    points.iter().map(|p| value(p)).sum::<f64>() / points.len() as f64
}

fn plateaus(used: &[&WindowPoint]) -> Option<Plateaus> {
    let is_steady = |p: &&WindowPoint| p.leg() == Leg::Steady && p.temperature_c.is_finite();
    let steady: Vec<&WindowPoint> = used.iter().copied().filter(is_steady).collect();
    let stretches = level_stretches(steady.iter().map(|p| (p.run, p.temperature_c)));
    let mut all: Vec<&[&WindowPoint]> = stretches.into_iter().map(|stretch| &steady[stretch]).collect();
    let longest_rest = all.iter().map(|stretch| stretch.len()).filter(|windows| *windows < FEWEST).max();
    let missing_h = (FEWEST - longest_rest.unwrap_or(0)) as f64 * mean(&steady, |p| p.length_h);
    all.retain(|plateau| plateau.len() >= FEWEST);
    let values_of = |plateau: &&[&WindowPoint]| {
        let (n, centre) = (plateau.len() as f64, mean(plateau, |p| p.after_dph));
        let squares: f64 = plateau.iter().map(|p| (p.after_dph - centre).powi(2)).sum();
        let sigma = (squares / (n - 1.0)).sqrt();
        // By its own scatter: slow noise lifts the largest of several distances as it is.
        (sigma, Estimate { value: centre, sigma: sigma / n.sqrt() }, mean(plateau, |p| p.temperature_c), n)
    };
    let values: Vec<_> = all.iter().map(values_of).collect();
    let loudest = values.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let worst = values.iter().max_by(|a, b| a.1.value.abs().total_cmp(&b.1.value.abs()))?;
    Some(Plateaus {
        plateaus: values.len(),
        worst_sigma_dph: loudest.0,
        worst_sigma_temperature_c: Some(loudest.2),
        worst_relative_sigma: (2.0 * (loudest.3 - 1.0)).sqrt().recip(),
        worst_offset_dph: worst.1,
        worst_offset_temperature_c: worst.2,
        missing_h: (values.len() == 1).then_some(missing_h),
    })
}

fn ramps(used: &[&WindowPoint]) -> Option<f64> {
    let moving: Vec<f64> = used.iter().filter(|p| p.leg() != Leg::Steady).map(|p| p.after_dph).collect();
    let square = moving.iter().map(|r| r * r).sum::<f64>() / moving.len() as f64;
    (moving.len() >= FEWEST_OF_LEG).then(|| square.sqrt())
}

/// Means of the ramps, heating and cooling alike, less the mean of the steady windows.
fn ramp_offset(used: &[&WindowPoint], noise: &RetestNoise) -> Option<Estimate> {
    let known = used.iter().filter(|p| p.rate_cpm.is_finite());
    let (steady, ramps) = known.fold((0.0_f64, 0.0_f64), |(steady, ramps), p| match p.leg() {
        Leg::Steady => (steady + 1.0, ramps),
        Leg::Heating | Leg::Cooling => (steady, ramps + 1.0),
    });
    if ramps.min(steady) < FEWEST_OF_SOAKS {
        return None;
    }
    let part = |p: &&WindowPoint| match p.leg() {
        _ if !p.rate_cpm.is_finite() => 0.0,
        Leg::Steady => -1.0 / steady,
        Leg::Heating | Leg::Cooling => 1.0 / ramps,
    };
    let parts: Vec<f64> = used.iter().map(part).collect();
    let value = parts.iter().zip(used).map(|(part, p)| part * p.after_dph).sum();
    Some(Estimate { value, sigma: noise.sigma_dph(&parts) })
}

/// Slopes over T and Ṫ of one line, each `None` where its column does not vary, both where they vary as one.
fn slopes(used: &[&WindowPoint], noise: &RetestNoise) -> (Option<Estimate>, Option<Estimate>) {
    let sound: Vec<usize> =
        (0..used.len()).filter(|at| used[*at].temperature_c.is_finite() && used[*at].rate_cpm.is_finite()).collect();
    if sound.len() < FEWEST_OF_LEG {
        return (None, None);
    }
    let n = sound.len() as f64;
    // About their mean; zero where they are not known.
    let centred = |of: fn(&WindowPoint) -> f64| {
        let mean = sound.iter().map(|at| of(used[*at])).sum::<f64>() / n;
        let mut column = DVector::zeros(used.len());
        sound.iter().for_each(|at| column[*at] = of(used[*at]) - mean);
        column
    };
    let (t, q, r) = (centred(|p| p.temperature_c), centred(|p| p.rate_cpm), centred(|p| p.after_dph));
    let (tt, qq, tq) = (t.norm_squared(), q.norm_squared(), t.dot(&q));
    let slope = |parts: DVector<f64>| Some(Estimate { value: parts.dot(&r), sigma: noise.sigma_dph(parts.as_slice()) });
    match (tt > LEAST_SPREAD_C2 * n, qq > LEAST_SPREAD_CPM2 * n) {
        (true, true) => {
            let det = tt * qq - tq * tq;
            if det < LEAST_APART * tt * qq {
                return (None, None);
            }
            (slope((&t * qq - &q * tq) / det), slope((&q * tt - &t * tq) / det))
        }
        (true, false) => (slope(t / tt), None),
        (false, true) => (None, slope(q / qq)),
        (false, false) => (None, None),
    }
}

/// Windows that the smooth residual needs.
const FEWEST_FOR_SMOOTH: usize = 40;
/// A span below this holds no drift over temperature, °C.
const LEAST_SPAN_C: f64 = 1.0;
/// Bands of equal width over the span, of which each that was visited counts alike.
const BANDS: f64 = 24.0;

/// The smooth residual over temperature: a series θ through all windows, its mean square over the bands of temperature that were
/// visited,
///
/// ```text
/// m = θᵀMθ − tr(MC)        C the covariance of θ, M the mean of (b − b̄)(b − b̄)ᵀ over the bands, b the series' columns
/// σ² of m = 2·tr(MCMC) + 4·θᵀMCMθ
/// ```
///
/// Not the mean over the windows: forty hours at one temperature would hide the ends of the span.
fn over_temperature(used: &[&WindowPoint], noise: &RetestNoise) -> Option<Estimate> {
    let known: Vec<usize> = (0..used.len()).filter(|at| used[*at].temperature_c.is_finite()).collect();
    let celsius = |at: usize| used[known[at]].temperature_c;
    let (lo, hi) =
        (0..known.len()).map(celsius).fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), t| (lo.min(t), hi.max(t)));
    if known.len() < FEWEST_FOR_SMOOTH || hi - lo < LEAST_SPAN_C {
        return None;
    }
    let order = smooth_order(known.len());
    let columns = smooth_columns(known.len(), order, Span { lo, hi }, celsius);
    let svd = columns.clone().svd(true, true);
    let least = 1e-9 * svd.singular_values.max();
    let inverse = svd.pseudo_inverse(least).ok()?;
    let theta = &inverse * DVector::from_fn(known.len(), |i, _| used[known[i]].after_dph);
    let weight = band_weights((0..known.len()).map(|i| (celsius(i) - lo) / (hi - lo)));
    let mean = columns.tr_mul(&weight).transpose();
    let mut about = columns;
    for (mut row, weight) in about.row_iter_mut().zip(weight.iter()) {
        row -= &mean;
        row *= weight.sqrt();
    }
    let m = about.tr_mul(&about);
    let m_theta = &m * &theta;
    let mut parts = DMatrix::zeros(used.len(), order + 1);
    known.iter().enumerate().for_each(|(i, at)| parts.set_row(*at, &inverse.column(i).transpose()));
    let (covariance, widening) = noise.covariance(&parts, |covariance| (&m * covariance).trace());
    let of_noise = &m * covariance;
    let square = theta.dot(&m_theta);
    let value = (square - of_noise.trace()).clamp(0.0, f64::INFINITY).sqrt();
    let along = if square > 0.0 { value * value / square } else { 0.0 };
    let sigma_of_square =
        (2.0 * (&of_noise * &of_noise).trace() + 4.0 * along * theta.dot(&(&of_noise * &m_theta))).sqrt();
    // Near zero the root of the mean square's own uncertainty.
    let sigma = sigma_of_square / (2.0 * value).max(sigma_of_square.sqrt());
    Some(Estimate { value, sigma: widening * sigma })
}

/// By the mean of each band of temperature: what follows its rate has another sign on the way back.
fn removed_over_temperature(used: &[&WindowPoint]) -> Option<f64> {
    let known: Vec<&&WindowPoint> = used.iter().filter(|p| p.temperature_c.is_finite()).collect();
    let ends = |(lo, hi): (f64, f64), t: f64| (lo.min(t), hi.max(t));
    let (lo, hi) = known.iter().map(|p| p.temperature_c).fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    let mut bands = [(0.0, 0.0); BANDS as usize];
    for p in known.iter().filter(|_| hi - lo >= LEAST_SPAN_C) {
        let (sum, n) = &mut bands[band((p.temperature_c - lo) / (hi - lo))];
        (*sum, *n) = (*sum + p.before_dph - p.after_dph, *n + 1.0);
    }
    let means: Vec<f64> = bands.iter().filter(|(_, n)| *n > 0.0).map(|(sum, n)| sum / n).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let square = means.iter().map(|dph| (dph - mean).powi(2)).sum::<f64>() / means.len() as f64;
    Some(square.sqrt()).filter(|rms| *rms > 0.0)
}

/// The band of a place in the span, 0 to 1.
fn band(place: f64) -> usize {
    (place * BANDS).min(BANDS - 1.0) as usize
}

/// Weights of windows by their place in the span, 0 to 1: all of a band together as much as those of any other.
fn band_weights(places: impl Iterator<Item = f64>) -> DVector<f64> {
    let bands: Vec<usize> = places.map(band).collect();
    let mut counts = [0.0; BANDS as usize];
    bands.iter().for_each(|band| counts[*band] += 1.0);
    let visited = counts.iter().filter(|count| **count > 0.0).count() as f64;
    DVector::from_iterator(bands.len(), bands.iter().map(|band| 1.0 / (counts[*band] * visited)))
}

/// Longest gap that a stretch reaches across, in windows.
const MOST_BRIDGED: f64 = 2.0;
/// Largest fraction of the windows that may be filled: σ at long τ is too large by half of it in white noise, and off by as much in
/// flicker.
const MOST_FILLED: f64 = 0.1;

/// The windows in stretches without a gap. Short gaps are filled with the mean of the windows next to them, unless these are too many:
/// a minute that is missing in each hour must not hide every τ above an hour.
fn stretches(used: &[&WindowPoint]) -> Vec<Vec<f64>> {
    let longest_h = used.iter().map(|point| point.length_h).fold(0.0, f64::max);
    let gap_h = |a: &WindowPoint, b: &WindowPoint| (b.hours - 0.5 * b.length_h) - (a.hours + 0.5 * a.length_h);
    let lost = |a: &WindowPoint, b: &WindowPoint| {
        let windows = gap_h(a, b) / longest_h;
        (a.run == b.run && !joined(a, b) && windows <= MOST_BRIDGED).then(|| windows.round().max(0.0) as usize)
    };
    let all: usize = used.windows(2).filter_map(|pair| lost(pair[0], pair[1])).sum();
    let fills = all as f64 <= MOST_FILLED * used.len() as f64;
    let mut stretches: Vec<Vec<f64>> = vec![used.first().map(|point| point.after_dph).into_iter().collect()];
    for pair in used.windows(2) {
        let (before, point) = (pair[0], pair[1]);
        let filled = lost(before, point).filter(|_| fills);
        if filled.is_none() && !joined(before, point) {
            stretches.push(Vec::new());
        }
        if let Some(last) = stretches.last_mut() {
            let mean = 0.5 * (before.after_dph + point.after_dph);
            last.extend(std::iter::repeat_n(mean, filled.unwrap_or(0)));
            last.push(point.after_dph);
        }
    }
    stretches
}

/// The least deviation over octaves of the windows, to a sixth of what hangs together.
fn bias_instability(used: &[&WindowPoint]) -> Option<Estimate> {
    let stretches = stretches(used);
    let longest = stretches.iter().map(Vec::len).max().unwrap_or(0);
    let wanted: Vec<Difference> = (0..16)
        .map(|octave| 1_usize << octave)
        .take_while(|m| 6 * m <= longest)
        .map(|m| Difference { deviation: Deviation::Allan, m })
        .collect();
    let mut sums = vec![SquareSum::default(); wanted.len()];
    for stretch in &stretches {
        let parts = overlapping(&phases(stretch, 0.0), &wanted);
        sums.iter_mut().zip(parts).for_each(|(sum, part)| sum.merge(part));
    }
    let variances = wanted.iter().zip(&sums).filter_map(|(d, sum)| {
        let variance = sum.variance(Deviation::Allan, d.m as f64)?;
        // Of flicker, an overlapping deviation at m has about 5n/(4m) − 1 degrees of freedom (NIST SP 1065).
        let freedom = (1.25 * sum.number / d.m as f64 - 1.0).max(1.0);
        Some((variance.sqrt() / FLAT, freedom))
    });
    let (value, freedom) = variances.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Estimate { value, sigma: value / (2.0 * freedom).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::tests::noise;

    fn points(after: impl Fn(usize, f64, f64) -> f64) -> Vec<WindowPoint> {
        let one = |i: usize| {
            let (celsius, rate) = match i / 50 {
                0 => (-40.0, 0.0),
                1 => (-40.0 + (i - 50) as f64, 0.6),
                2 => (10.0, 0.0),
                _ => (10.0 - (i - 150) as f64, -0.6),
            };
            WindowPoint {
                run: 0,
                hours: i as f64 / 36.0,
                length_h: 1.0 / 36.0,
                temperature_c: celsius,
                rate_cpm: rate,
                before_dph: 0.0,
                inputs_dph: 0.0,
                after_dph: after(i, celsius, rate),
                excluded: None,
            }
        };
        (0..200).map(one).collect()
    }

    fn residual_of(points: &[WindowPoint]) -> RetestResidual {
        residual(points, &RetestNoise::of(&judged(points), false), None)
    }

    /// Windows of 100 s: a second soak of fewer than five lacks the others.
    #[test]
    fn a_lone_plateau_says_how_much_of_the_next_is_missing() {
        let all = points(|i, _, _| 0.01 * noise(i));
        for rest in 0..10 {
            let plateaus = residual_of(&all[..100 + rest]).plateaus.unwrap();
            let missing = plateaus.missing_h.map(|hours| (36.0 * hours).round() as usize);
            assert_eq!(missing, 5_usize.checked_sub(rest).filter(|windows| *windows > 0), "{rest}");
        }
    }

    #[test]
    fn what_was_put_in_comes_out() {
        let found = residual_of(&points(|i, t, r| 0.002 * t + 0.05 * r + 0.01 * noise(i)));
        let (temperature_slope, rate_slope) = (found.temperature_slope.unwrap(), found.rate_slope.unwrap());
        assert!(
            (temperature_slope.value - 0.002).abs() < 4.0 * temperature_slope.sigma && temperature_slope.sigma < 1e-4,
            "{temperature_slope:?}"
        );
        assert!((rate_slope.value - 0.05).abs() < 4.0 * rate_slope.sigma && rate_slope.sigma < 3e-3, "{rate_slope:?}");
        let plateaus = found.plateaus.unwrap();
        assert_eq!((plateaus.plateaus, plateaus.missing_h), (2, None));
        assert!(
            (plateaus.worst_offset_dph.value + 0.08).abs() < 0.002
                && (plateaus.worst_offset_temperature_c + 40.0).abs() < 0.1
        );
        assert!((plateaus.worst_sigma_dph - 0.01 / 12.0_f64.sqrt()).abs() < 0.001, "{plateaus:?}");
        // Ramps: 0.002·T ± 0.03 over −40 … 10 °C up and down.
        let wanted = (100.0_f64.recip()
            * (0..50)
                .map(|k| {
                    let t = 0.002 * (f64::from(k) - 40.0);
                    let down = 0.002 * (10.0 - f64::from(k));
                    (t + 0.03).powi(2) + (down - 0.03).powi(2)
                })
                .sum::<f64>())
        .sqrt();
        assert!((found.ramps_rms_dph.unwrap() - wanted).abs() < 0.002);
    }

    /// White windows of σ: the deviation falls to τ = 32 windows, σ/√32.
    #[test]
    fn the_instability_is_the_least_deviation() {
        let found = residual_of(&points(|i, _, _| noise(i))).bias_instability_dph.unwrap().value;
        let white = (1.0_f64 / 12.0).sqrt() / 32.0_f64.sqrt() / FLAT;
        assert!((0.4..2.0).contains(&(found / white)), "{found} for {white}");
        assert_eq!(residual_of(&points(|_, _, _| 0.0)[..8]).bias_instability_dph.unwrap().value, 0.0);
    }
}
