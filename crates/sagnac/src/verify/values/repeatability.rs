//! The retest against its calibration: fixed bias and scale factor, turn-on by turn-on.
//!
//! ```text
//! bias of a run      b_i = mean of its corrected windows − input rate          (a correction is zero at T0)
//! of the record      b_0 = mean over its runs of (run offset − input rate)
//! difference         d_i = b_i − b_0, σ² of both; the worst |d_i| is judged
//! turn-on to turn-on s over the runs of the n stated turn-ons, of the calibration too; one-sided 95 % bound s·√((n − 1)/χ²(0.05, n − 1))
//! scale factor       mean over the plateaus after correction less ε0 of the record, ppm
//! ```
//!
//! σ of a run's mean is that of the noise that the windows show ([`super::noise`]): slow noise moves the run as a whole.
//!
//! Needs the input rate, from the setup (`input_rate_dph`, `[earth]`): without it a difference of bias is none of the gyro's.

use sagnac_units::format::file_name;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::calibration::{AxisCalibration, FixedBias, PpmEstimate};
use crate::verify::values::judged_windows::Estimate;
use crate::verify::values::noise::RetestNoise;
use crate::verify::values::rate_table::{PairedDrifts, ScaleProof};
use crate::window::Windows;
use sagnac_log::setup::{RateUnit, Setup, TurnOnCount, input_rate_hint};

/// Windows of a run that has a bias.
const FEWEST: usize = 8;
/// Why a run has no bias.
pub(crate) const RUN_WITHOUT_BIAS: &str = "a run is shorter than eight windows, or was turned at one rate alone";
/// Input rates closer than this are one, °/h.
const SAME_INPUT_DPH: f64 = 1e-6;
/// Probability of the one-sided bound.
const ONE_SIDED: f64 = 0.95;

/// One run of the retest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RunBias {
    /// File of the run.
    pub file: String,
    /// Fixed bias as corrected, °/h.
    pub bias_dph: Estimate,
    /// The same less that of the calibration, °/h.
    pub difference_dph: Estimate,
    /// As logged less that of the calibration, °/h.
    pub raw_difference_dph: f64,
}

/// Scatter from turn-on to turn-on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct TurnOns {
    /// Stated turn-ons, those of the calibration included.
    pub n: usize,
    /// σ over their runs, °/h.
    pub sigma_dph: f64,
    /// One-sided 95 % upper bound of that σ, °/h.
    pub sigma_upper_dph: f64,
}

/// Fixed bias of the retest against its calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct BiasRepeatability {
    /// Input rate of the retest, °/h: its runs are less of it.
    pub input_rate_dph: f64,
    /// The same of the calibration.
    pub calibration_input_rate_dph: f64,
    /// Fixed bias of the calibration, °/h: mean over its runs, less the bias that the correction removes.
    pub calibration_dph: Estimate,
    /// The runs of the retest.
    pub runs: Vec<RunBias>,
    /// Null where fewer than two turn-ons are stated.
    pub turn_ons: Option<TurnOns>,
    /// The first run whose bias is not known: it is shorter than eight windows, or the table turned it at one rate alone, which does not
    /// tell a bias from a scale factor. Null where there is none; else no limit of the bias is met.
    pub unknown: Option<String>,
}

impl BiasRepeatability {
    /// The input rates in words: one where they agree, else both, for a wrong one is a bias.
    pub fn input_text(&self, units: RateUnit) -> String {
        let [calibration, retest] =
            [self.calibration_input_rate_dph, self.input_rate_dph].map(|dph| units.text(dph, 5));
        match self.has_other_input() {
            false => format!("input rate {retest}"),
            true => format!("input rate {calibration} in the calibration, {retest} in the retest"),
        }
    }

    /// The retest was told another input rate than the calibration.
    pub(crate) fn has_other_input(&self) -> bool {
        (self.calibration_input_rate_dph - self.input_rate_dph).abs() >= SAME_INPUT_DPH
    }

    /// The run farthest from the calibration.
    pub fn worst(&self) -> Option<&RunBias> {
        let distance = |run: &&RunBias| run.difference_dph.value.abs();
        self.runs.iter().max_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// The largest fixed bias of a run, °/h.
    pub fn largest_bias_dph(&self) -> Option<Estimate> {
        let biases = self.runs.iter().map(|run| run.bias_dph);
        biases.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()))
    }

    /// Of the used windows; `Err` says why it is not known.
    pub(crate) fn of(
        drifts: &PairedDrifts<'_>,
        windows: &Windows,
        used: &[usize],
        axis: usize,
        noise: &RetestNoise,
        (record, calibrated): (Option<&AxisCalibration>, Option<TurnOnCount>),
        setup: &Setup,
    ) -> Result<Self, String> {
        let record = record.ok_or("an image alone does not state the bias of the calibration")?;
        let (letter, axes) = (windows.shape.axes[axis], windows.shape.axes.len());
        let input_dph = setup
            .input_rate_of(letter, axes)
            .ok_or_else(|| format!("the input rate is not known: {}", input_rate_hint(letter, axes)))?;
        let calibration_dph = of_record(record).ok_or("the calibration did not know its input rate")?;
        let run = |run: usize| {
            let members: Vec<usize> = used.iter().copied().filter(|i| windows.rows.run[*i] as usize == run).collect();
            if drifts.is_of_one_rate(axis, &members) {
                return None;
            }
            let after = mean_of(windows, &members, |i| drifts.corrected.rate_dph(axis, i))?;
            let before = mean_of(windows, &members, |i| drifts.raw.rate_dph(axis, i))?;
            let bias_dph = Estimate { value: after - input_dph, sigma: noise.sigma_of_mean_dph(run) };
            let difference = bias_dph.value - calibration_dph.value;
            Some(RunBias {
                file: file_name(&windows.runs[run].name()),
                bias_dph,
                difference_dph: Estimate { value: difference, sigma: bias_dph.sigma.hypot(calibration_dph.sigma) },
                raw_difference_dph: before - input_dph - calibration_dph.value - removed_dph(record),
            })
        };
        let biases: Vec<Option<RunBias>> = (0..windows.runs.len()).map(run).collect();
        let unknown = biases.iter().position(Option::is_none).map(|run| file_name(&windows.runs[run].name()));
        let runs: Vec<RunBias> = biases.into_iter().flatten().collect();
        let of_retest = runs.iter().map(|run| run.bias_dph.value).collect();
        let calibration_input_rate_dph = input_of(record).unwrap_or(input_dph);
        let turn_ons = TurnOns::of([(biases_of(record), calibrated), (of_retest, setup.turn_ons)]);
        let input_rate_dph = input_dph;
        Ok(Self { input_rate_dph, calibration_input_rate_dph, calibration_dph, runs, turn_ons, unknown })
    }
}

impl TurnOns {
    /// Of the runs of several tests, each with its stated turn-ons; a test that states none does not count. Runs of one turn-on count by
    /// their mean.
    pub(crate) fn of(tests: impl IntoIterator<Item = (Vec<f64>, Option<TurnOnCount>)>) -> Option<Self> {
        let (mut n, mut biases) = (0, Vec::new());
        for (runs, stated) in tests {
            let of_test = stated.map_or(0, |stated| stated.of_runs(runs.len()));
            n += of_test;
            match of_test {
                0 => {}
                1 => biases.push(runs.iter().sum::<f64>() / runs.len() as f64),
                _ => biases.extend(runs),
            }
        }
        let degrees = n.checked_sub(1).filter(|degrees| *degrees > 0)? as f64;
        let mean = biases.iter().sum::<f64>() / biases.len() as f64;
        let squares: f64 = biases.iter().map(|b| (b - mean).powi(2)).sum();
        let sigma_dph = (squares / (biases.len() - 1) as f64).sqrt();
        let least = ChiSquared::new(degrees).ok()?.inverse_cdf(1.0 - ONE_SIDED);
        Some(Self { n, sigma_dph, sigma_upper_dph: sigma_dph * (degrees / least).sqrt() })
    }
}

fn biases_of(record: &AxisCalibration) -> Vec<f64> {
    record.run_offsets.iter().filter_map(|offset| Some(offset.fixed_bias_dph? - removed_dph(record))).collect()
}

/// Input rate of a record, °/h: mean over its runs.
fn input_of(record: &AxisCalibration) -> Option<f64> {
    let rates: Vec<f64> =
        record.run_offsets.iter().filter_map(|offset| Some(offset.value_dph - offset.fixed_bias_dph?)).collect();
    (!rates.is_empty()).then(|| rates.iter().sum::<f64>() / rates.len() as f64)
}

/// Of a record after its correction, which may remove the fixed bias: then a retest is compared with zero.
fn of_record(record: &AxisCalibration) -> Option<Estimate> {
    let bias = FixedBias::of(&record.run_offsets)?;
    Some(Estimate { value: bias.value_dph - removed_dph(record), sigma: bias.sigma_dph })
}

/// The fixed bias that the correction removes, °/h.
fn removed_dph(record: &AxisCalibration) -> f64 {
    record.correction.fixed_bias.map_or(0.0, |bias| bias.value_dph)
}

/// Mean over windows by their lengths.
fn mean_of(windows: &Windows, members: &[usize], rate_dph: impl Fn(usize) -> f64) -> Option<f64> {
    let (sum, all) = members.iter().fold((0.0, 0.0), |(sum, all), i| {
        let length = windows.duration_s(*i);
        (sum + length * rate_dph(*i), all + length)
    });
    (members.len() >= FEWEST).then_some(sum / all)
}

/// Scale factor of the retest less that of the record at T0, ppm; `None` where either does not know it.
pub(crate) fn scale_difference(proof: Option<&ScaleProof>, record: Option<&AxisCalibration>) -> Option<PpmEstimate> {
    let (proof, known) = (proof?, record?.fit.as_ref()?.scale_factor.as_ref()?.at_reference);
    let n = proof.plateaus.len() as f64;
    let sigma_ppm = (proof.of_noise_ppm.powi(2) / n + known.sigma_ppm.powi(2)).sqrt();
    Some(PpmEstimate { ppm: proof.after.mean_ppm - known.ppm, sigma_ppm })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// n = 5: χ²(0.05, 4) = 0.710723 (tables), so the bound is s·√(4/0.710723) = 2.37236 s.
    #[test]
    fn the_bound_of_the_turn_on_scatter_is_that_of_chi_squared() {
        let biases = [0.001, -0.002, 0.0, 0.003, -0.002];
        let of = |biases: &[f64], stated| TurnOns::of([(biases.to_vec(), stated)]);
        let found = of(&biases, Some(TurnOnCount::FILES)).unwrap();
        assert_eq!(found.n, 5);
        assert!((found.sigma_dph - 0.002_121_320_3).abs() < 1e-9, "{found:?}");
        assert!((found.sigma_upper_dph / found.sigma_dph - 2.372_36).abs() < 1e-4, "{found:?}");
        // Five files of two turn-ons: χ²(0.05, 1) = 0.00393214 (tables).
        let of_two = of(&biases, Some(TurnOnCount::Number(2))).unwrap();
        assert_eq!((of_two.n, of_two.sigma_dph), (2, found.sigma_dph));
        assert!((of_two.sigma_upper_dph / of_two.sigma_dph - 15.947_3).abs() < 1e-3, "{of_two:?}");
        // Fewer than two are stated: one file, files of one turn-on, nothing.
        assert_eq!(of(&biases[..1], Some(TurnOnCount::Number(7))), None);
        assert_eq!(of(&biases, Some(TurnOnCount::Number(1))), None);
        assert_eq!(of(&biases, None), None);
    }
}
