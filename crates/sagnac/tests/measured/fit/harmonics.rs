//! Harmonics of an input: a bias that is periodic in a stabilisation voltage, as in prism gyros. The generator here shares no
//! code with the fit: rows of °/h with a cosine of the voltage, a line in temperature and white noise.

use std::f64::consts::TAU;

use crate::support::evidence::{Records, evidence};
use crate::support::fit;
use crate::support::rows::{Rows, to_decimals};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sagnac::ErrorKind;
use sagnac::calibration::{AxisCalibration, Calibration};
use sagnac::model::TermShape;
use sagnac_log::setup::Setup;

/// A gyro whose bias follows `amplitude_dph·cos(2π·v/period + phase)`.
#[derive(Clone, Copy)]
pub(crate) struct Prism {
    pub(crate) amplitude_dph: f64,
    pub(crate) period_v: f64,
    pub(crate) phase: f64,
    pub(crate) seed: u64,
}

const ROW_S: f64 = 10.0;
const ROWS: usize = 4_000;
/// σ of a row, °/h: 0.02 of a window of 100 s.
const SIGMA_DPH: f64 = 0.063;

impl Prism {
    pub(crate) fn log(self) -> Rows<4> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut normal = || {
            let uniform = |rng: &mut ChaCha8Rng| (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            let (u, w) = (1.0 - uniform(&mut rng), uniform(&mut rng));
            (-2.0 * u.ln()).sqrt() * (TAU * w).cos()
        };
        let mut log = Rows::new(["time_s", "temperature_c", "rate_dph", "aux_stab_v"]);
        for row in 1..=ROWS {
            let t = ROW_S * row as f64;
            let celsius = 20.0 + 30.0 * (TAU * t / 40_000.0).sin();
            // The voltage follows the temperature and wanders by itself, as the cavity ages.
            let volts = 1.1 * celsius + 18.0 * (TAU * t / 17_000.0).cos();
            let wave = self.amplitude_dph * (TAU * volts / self.period_v + self.phase).cos();
            let rate = 4.5 + 0.001 * (celsius - 25.0) + wave + SIGMA_DPH * normal();
            log.push([t, to_decimals(celsius, 4), to_decimals(rate, 6), to_decimals(volts, 4)]);
        }
        log
    }
}

pub(crate) fn setup() -> Setup {
    Setup { serial: Some("PRISM-1".into()), ..Setup::default() }
}

pub(crate) fn amplitude(axis: &AxisCalibration) -> f64 {
    let of =
        |wanted: fn(TermShape) -> bool| axis.correction.terms.iter().find(|term| wanted(term.shape)).unwrap().value;
    of(|shape| matches!(shape, TermShape::Cosine { .. })).hypot(of(|shape| matches!(shape, TermShape::Sine { .. })))
}

pub(crate) fn made(gyro: Prism, model: &str) -> sagnac::Result<Calibration> {
    fit(vec![gyro.log()], &setup(), model)
}

/// A hundred gyros of amplitude 0.01 … 0.05 °/h and period 9 … 24 V: the fitted period is found in each, and its 95 % interval
/// holds the true one in at least 88 (the bound for 95 % of 100, 0.999).
#[test]
fn a_fitted_period_is_found_and_its_interval_covers() {
    const GYROS: Records = Records::new(100).few(30);
    let (mut covered, mut close) = (0, 0);
    // In the order of every 37th, so that a few of them are of every size.
    for seed in GYROS.each().map(|at| at * 37 % 100) {
        let part = seed as f64 / 99.0;
        let gyro = Prism {
            amplitude_dph: 0.01 + 0.04 * part,
            period_v: 9.0 + 15.0 * ((seed * 37) % 100) as f64 / 100.0,
            phase: 6.2 * part,
            seed,
        };
        let found = made(gyro, "bias 1, harmonic(stab_v)").unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        let axis = &found.axes[0];
        let period = axis.nonlinear().into_iter().find(|found| found.name == "period(stab_v)").unwrap();
        let half = axis.residual().unwrap().t_quantile_975 * period.sigma.unwrap();
        covered += usize::from((period.value - gyro.period_v).abs() <= half);
        close += usize::from((amplitude(axis) / gyro.amplitude_dph - 1.0).abs() < 0.25);
    }
    let part = |of: usize| of as f64 / GYROS.count() as f64;
    evidence("95 % interval of a fitted period covers the truth", part(covered), "≥ 0.88", GYROS);
    evidence("a harmonic of 0.01 … 0.05 °/h is found, its amplitude within 25 %", part(close), "≥ 1", GYROS);
}

/// Noise alone: of a hundred gyros without a harmonic at most three pass, all others are refused with the reason.
#[test]
fn noise_has_no_period() {
    const GYROS: Records = Records::new(100);
    let mut passed = 0;
    for seed in GYROS.each() {
        let gyro = Prism { amplitude_dph: 0.0, period_v: 10.0, phase: 0.0, seed: 1000 + seed };
        match made(gyro, "bias 1, harmonic(stab_v)") {
            Ok(_) => passed += 1,
            Err(error) => {
                assert!(
                    error.kind == ErrorKind::Refused && error.what.contains("no more than chance")
                        || error.what.contains("more than chance"),
                    "{error}"
                );
            }
        }
    }
    evidence("a period is found in noise alone", f64::from(passed) / GYROS.count() as f64, "≤ 0.03", GYROS);
}
