//! A proof on a rate table: drift without the turning, and the scale factor before and after in ppm.
//!
//! ```text
//! drift = y − Ω − k·Ω       k: one slope per run and side, by the rates that meet at one temperature; else by all of the run
//! ```
//!
//! so that before and after speak of bias, as on a gyro at rest, whatever the table does and whatever the scale factor
//! is off at T0 (the correction takes out its variation, not its value). A slope over the whole run would hold what the bias does in
//! ramps, where the table turns one way in heating and the other in cooling. The scale factor over temperature is
//! reported separately, plateau by plateau.

use serde::{Deserialize, Serialize};

use crate::calibration::{Plateau, PpmEstimate};
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::stated::stated_noise;
use crate::rate_table::input::RateTableInput;
use crate::rate_table::plateaus::plateaus_of;
use crate::verify::replay::paired::PairedWindows;
use crate::window::Windows;
use crate::window::level_stretches;
use sagnac_log::error::Result;
use sagnac_log::setup::Setup;

/// Scale factor over the plateaus of a retest, ppm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ScaleValues {
    /// Mean over the plateaus.
    pub mean_ppm: f64,
    /// σ over the plateaus, about that mean.
    pub sigma_ppm: f64,
    /// Largest less smallest.
    pub peak_to_peak_ppm: f64,
}

/// One plateau, before and after.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlateauProof {
    /// Mean temperature, °C.
    pub temperature_c: f64,
    /// As logged.
    pub before: PpmEstimate,
    /// As corrected.
    pub after: PpmEstimate,
    /// Asymmetry as corrected; null where the rates do not determine it.
    pub asymmetry: Option<PpmEstimate>,
    /// Nonlinearity as corrected; null with fewer than three rates.
    pub nonlinearity: Option<PpmEstimate>,
}

/// What the correction does to the scale factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ScaleProof {
    /// As logged.
    pub before: ScaleValues,
    /// As corrected.
    pub after: ScaleValues,
    /// σ over the plateaus that the windows' own scatter makes, ppm.
    pub of_noise_ppm: f64,
    /// The largest stretch of the retest's temperatures without a plateau, as a part of them: above 0.38 no limit of the scale factor
    /// is met.
    pub unvisited_fraction: f64,
    /// In the order of the test.
    pub plateaus: Vec<PlateauProof>,
}

/// Four soaks over the span leave a third between them, and a little more where the ends are not reached.
pub(crate) const MOST_UNVISITED: f64 = 0.38;

/// Squares of rates about their mean above this part of their sum: they vary.
const VARIES: f64 = 1e-6;
/// A table that turns, °/h.
const LEAST_TURN_DPH: f64 = 1.0;
/// Plateaus closer than this are one temperature, °C.
const ONE_TEMPERATURE_C: f64 = 1.0;

impl ScaleProof {
    /// The largest difference between two visits of one temperature, as corrected.
    pub(crate) fn hysteresis(&self) -> Option<(f64, PpmEstimate)> {
        let visits = self.plateaus.iter().enumerate().flat_map(|(at, first)| {
            let again = self.plateaus[at + 1..].iter();
            let same = again.filter(|p| (p.temperature_c - first.temperature_c).abs() <= ONE_TEMPERATURE_C);
            same.map(|second| {
                let ppm = second.after.ppm - first.after.ppm;
                let sigma_ppm = second.after.sigma_ppm.hypot(first.after.sigma_ppm);
                (first.temperature_c, PpmEstimate { ppm, sigma_ppm })
            })
        });
        worst_known(visits)
    }

    /// Temperature of the plateau that is furthest from their mean, as corrected, °C.
    pub(crate) fn furthest_c(&self) -> Option<f64> {
        let away = |plateau: &&PlateauProof| (plateau.after.ppm - self.after.mean_ppm).abs();
        let furthest = self.plateaus.iter().max_by(|a, b| away(a).total_cmp(&away(b)));
        furthest.map(|plateau| plateau.temperature_c)
    }
}

/// A standard error above this multiple of the least one is that of a poorly known value.
const POORLY_KNOWN: f64 = 2.0;
/// Standard errors that a poorly known value is discounted by: of a hundred without any effect, one in a thousand tests shows that much.
const DISCOUNT: f64 = 4.5;

/// The largest of several values, with its temperature. One that is poorly known, as of few windows in a ramp, counts only as far as it stands out of its noise: the
/// largest of many such ones says how uncertain they are, and no longer test would change that.
pub(crate) fn worst_known(values: impl Iterator<Item = (f64, PpmEstimate)>) -> Option<(f64, PpmEstimate)> {
    let all: Vec<(f64, PpmEstimate)> = values.collect();
    let least = all.iter().map(|(_, value)| value.sigma_ppm).fold(f64::INFINITY, f64::min);
    let size = |(_, value): &(f64, PpmEstimate)| {
        let discount = if value.sigma_ppm > POORLY_KNOWN * least { DISCOUNT * value.sigma_ppm } else { 0.0 };
        value.ppm.abs() - discount
    };
    all.into_iter().max_by(|a, b| size(a).total_cmp(&size(b)))
}

/// Drifts before and after.
pub(crate) struct PairedDrifts<'a> {
    pub(crate) raw: Drifts<'a>,
    pub(crate) corrected: Drifts<'a>,
}

impl<'a> PairedDrifts<'a> {
    /// Of the used windows.
    ///
    /// # Errors
    /// As [`RateTableInput::of`].
    pub(crate) fn of(pair: &'a PairedWindows, used: &[usize], setup: &Setup, sensor: Option<usize>) -> Result<Self> {
        let side = |windows| Drifts::of(windows, used, setup, sensor);
        let (raw, corrected) = (side(&pair.raw)?, side(&pair.corrected)?);
        for (axis, turning) in raw.turnings.iter().enumerate() {
            turning.check_scale(&pair.raw, axis, setup.scale_factor_deviation_max_ppm())?;
        }
        Ok(Self { raw, corrected })
    }

    /// A run was turned at one rate alone, which does not tell a bias from a scale factor.
    pub(crate) fn is_of_one_rate(&self, axis: usize, members: &[usize]) -> bool {
        self.raw.turnings.get(axis).is_some_and(|turning| {
            let turns = members.iter().any(|i| turning.along_dph[*i].abs() > LEAST_TURN_DPH);
            turns && turning.rates(members.iter().copied()).len() < 2
        })
    }

    /// A table turned the gyro.
    pub(crate) fn is_turned(&self) -> bool {
        !self.raw.turnings.is_empty()
    }

    /// A table turned the gyro about this axis.
    pub(crate) fn is_turned_about(&self, axis: usize) -> bool {
        self.raw
            .turnings
            .get(axis)
            .is_some_and(|turning| turning.along_dph.iter().any(|dph| dph.abs() > LEAST_TURN_DPH))
    }

    /// A table turned the gyro about this axis in both directions.
    pub(crate) fn is_turned_both_ways(&self, used: &[usize], axis: usize) -> bool {
        let along = |sign: f64| {
            let turns = |turning: &RateTableInput| used.iter().any(|i| sign * turning.along_dph[*i] > LEAST_TURN_DPH);
            self.raw.turnings.get(axis).is_some_and(turns)
        };
        along(1.0) && along(-1.0)
    }

    /// The scale factor of an axis before and after; `None` without two plateaus that tell it.
    pub(crate) fn scale_proof(&self, used: &[usize], axis: usize, sensor: Option<usize>) -> Option<ScaleProof> {
        let sensor = sensor?;
        let (before, after) = (self.raw.plateaus(used, axis, sensor)?, self.corrected.plateaus(used, axis, sensor)?);
        if before.len() < 2 || before.len() != after.len() {
            return None;
        }
        let plateaus: Vec<PlateauProof> = before
            .iter()
            .zip(&after)
            .map(|(b, a)| PlateauProof {
                temperature_c: b.temperature_c,
                before: b.scale,
                after: a.scale,
                asymmetry: a.asymmetry,
                nonlinearity: a.nonlinearity,
            })
            .collect();
        let noise = plateaus.iter().map(|p| p.after.sigma_ppm.powi(2)).sum::<f64>() / plateaus.len() as f64;
        Some(ScaleProof {
            before: scale_values(plateaus.iter().map(|p| p.before.ppm)),
            after: scale_values(plateaus.iter().map(|p| p.after.ppm)),
            of_noise_ppm: noise.sqrt(),
            unvisited_fraction: unvisited(
                used.iter().map(|i| self.raw.windows.rows.mean_c[sensor][*i]),
                plateaus.iter().map(|plateau| plateau.temperature_c),
            ),
            plateaus,
        })
    }
}

/// Rates of the windows of one side, less what a table turned.
pub(crate) struct Drifts<'a> {
    windows: &'a Windows,
    /// Per axis and window, °/h; empty without a table.
    drift_dph: Vec<Vec<f64>>,
    turnings: Vec<RateTableInput>,
    /// Per axis that was turned: slow noise that the setup states, and the white variance next to it.
    stated: Vec<Option<(SlowNoise, f64)>>,
}

impl<'a> Drifts<'a> {
    fn of(windows: &'a Windows, used: &[usize], setup: &Setup, sensor: Option<usize>) -> Result<Self> {
        let (mut drift_dph, mut turnings, mut stated) = (Vec::new(), Vec::new(), Vec::new());
        for axis in 0..windows.shape.axes.len() {
            let Some(turning) = RateTableInput::of(windows, axis, setup)? else { continue };
            let mut drift: Vec<f64> =
                (0..windows.len()).map(|i| windows.rate_dph(axis, i) - turning.along_dph[i]).collect();
            for run in 0..windows.runs.len() {
                let members: Vec<usize> =
                    used.iter().copied().filter(|i| windows.rows.run[*i] as usize == run).collect();
                let level = level_groups(windows, &members, sensor);
                take_slope(&mut drift, &members, &level, |i| turning.along_dph[i]);
                take_slope(&mut drift, &members, &level, |i| turning.across_dph[i].1);
            }
            drift_dph.push(drift);
            turnings.push(turning);
            stated.push(stated_noise(windows, axis, setup));
        }
        Ok(Self { windows, drift_dph, turnings, stated })
    }

    /// Rate of a window without the turning, °/h.
    pub(crate) fn rate_dph(&self, axis: usize, window: usize) -> f64 {
        match self.drift_dph.get(axis) {
            Some(drift) => drift[window],
            None => self.windows.rate_dph(axis, window),
        }
    }

    /// Plateaus of an axis that was turned.
    fn plateaus(&self, used: &[usize], axis: usize, sensor: usize) -> Option<Vec<Plateau>> {
        let stated = self.stated.get(axis).copied().flatten();
        Some(plateaus_of(self.windows, used, axis, sensor, self.turnings.get(axis)?, stated))
    }
}

/// Windows of a run at one temperature each.
fn level_groups(windows: &Windows, members: &[usize], sensor: Option<usize>) -> Vec<Vec<usize>> {
    let Some(sensor) = sensor else { return Vec::new() };
    let known: Vec<usize> = members.iter().copied().filter(|i| windows.rows.mean_c[sensor][*i].is_finite()).collect();
    let places = known.iter().map(|i| (0, windows.rows.mean_c[sensor][*i]));
    level_stretches(places).into_iter().map(|stretch| known[stretch].to_vec()).collect()
}

/// Takes the straight line's slope over `of` out of some windows: that within groups of one temperature, where it varies within any; else
/// that over all; nothing where it does not vary.
fn take_slope(drift: &mut [f64], members: &[usize], groups: &[Vec<usize>], value: impl Fn(usize) -> f64) {
    let size = members.iter().map(|i| value(*i).powi(2)).sum::<f64>();
    let sums_of = |group: &[usize]| {
        let n = group.len() as f64;
        let mean_of = group.iter().map(|i| value(*i)).sum::<f64>() / n;
        let mean = group.iter().map(|i| drift[*i]).sum::<f64>() / n;
        let square = group.iter().map(|i| (value(*i) - mean_of).powi(2)).sum::<f64>();
        let product = group.iter().map(|i| (value(*i) - mean_of) * (drift[*i] - mean)).sum::<f64>();
        (square, product)
    };
    let add = |(square, product): (f64, f64), (s, p): (f64, f64)| (square + s, product + p);
    let within = groups.iter().map(|group| sums_of(group)).fold((0.0, 0.0), add);
    let (square, product) = if within.0 > VARIES * size { within } else { sums_of(members) };
    if square > VARIES * size {
        members.iter().for_each(|i| drift[*i] -= product / square * value(*i));
    }
}

/// The largest stretch of some temperatures without a plateau, ends included, as a part of them.
fn unvisited(temperatures_c: impl Iterator<Item = f64>, plateaus_c: impl Iterator<Item = f64>) -> f64 {
    let (lo, hi) = temperatures_c
        .filter(|c| c.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), c| (c.min(lo), c.max(hi)));
    let mut visited: Vec<f64> = plateaus_c.chain([lo, hi]).collect();
    visited.sort_by(f64::total_cmp);
    let most = visited.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    if hi - lo > ONE_TEMPERATURE_C { most / (hi - lo) } else { 0.0 }
}

fn scale_values(values: impl Iterator<Item = f64>) -> ScaleValues {
    let all: Vec<f64> = values.collect();
    let n = all.len() as f64;
    let mean_ppm = all.iter().sum::<f64>() / n;
    let sigma_ppm = (all.iter().map(|v| (v - mean_ppm).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt();
    let (lo, hi) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (v.min(lo), v.max(hi)));
    ScaleValues { mean_ppm, sigma_ppm, peak_to_peak_ppm: hi - lo }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_poorly_known_value_counts_where_it_stands_out() {
        let value = |(ppm, sigma_ppm)| (20.0, PpmEstimate { ppm, sigma_ppm });
        let worst = |all: &[(f64, f64)]| worst_known(all.iter().copied().map(value)).unwrap().1.ppm;
        // Soaks, and a few windows of a ramp.
        assert_eq!(worst(&[(0.3, 0.2), (-0.5, 0.3), (7.9, 3.7), (-9.0, 3.9)]), -0.5);
        assert_eq!(worst(&[(0.3, 0.2), (-0.5, 0.3), (30.0, 3.7)]), 30.0);
        // All alike: the largest.
        assert_eq!(worst(&[(7.9, 3.7), (-9.0, 3.9)]), -9.0);
        assert_eq!(worst_known(std::iter::empty()), None);
    }
}
