//! What an image cannot hold is never selected: tables of sensors far from a ring laser gyro, of drifts from 10 to 30,000 °/h and
//! scale factors that move by up to 20,000 ppm, and very small ones. The generator shares no code with the fit.

use crate::hostile::{Dice, fraction};
use crate::support::evidence::evidence;
use crate::support::{fit, retest};
use sagnac::Calibration;
use sagnac::calibration::AxisCalibration;
use sagnac::export::encode;
use sagnac_core::{Compensator, State};
use sagnac_log::setup::Setup;
use std::fmt::Write as _;

/// One sensor of microelectromechanics: what its rate log reads.
pub(crate) struct Mems {
    /// Coefficients over u = (T − 22.5)/62.5: bias °/h, scale factor ppm, °/h per °C/min.
    pub(crate) bias_dph: [f64; 4],
    pub(crate) wiggle_dph: f64,
    pub(crate) scale_ppm: [f64; 3],
    pub(crate) rate_dph_per_cpm: f64,
    pub(crate) on_table: bool,
    pub(crate) n_deg_rt_h: f64,
}

impl Mems {
    /// By chance: sizes over decades, signs either way.
    fn of(dice: &mut Dice) -> Self {
        let mut sized = |least: f64, most: f64| {
            let size = least * (most / least).powf(dice.uniform());
            if dice.uniform() < 0.5 { -size } else { size }
        };
        let bias = sized(10.0, 30_000.0);
        let scale = sized(100.0, 20_000.0);
        let mut part = |of: f64| sized(0.05, 1.0) * of;
        let bias_dph = [bias, part(bias), part(bias), part(bias)];
        let (wiggle_dph, rate_dph_per_cpm) = (part(bias), part(bias));
        let scale_ppm = [scale, part(scale), part(scale)];
        let on_table = dice.uniform() < 0.5;
        Self { bias_dph, wiggle_dph, scale_ppm, rate_dph_per_cpm, on_table, n_deg_rt_h: 0.2 }
    }

    /// Rows of 10 s over two cycles −40 … 85 °C at 1.5 °C/min; on a table four rates of either sign, 200 s each.
    pub(crate) fn log(&self, seed: u64) -> Vec<u8> {
        let mut dice = Dice::new(seed);
        let table = if self.on_table { ",reference_rate_dps" } else { "" };
        let mut text = format!("time_s,temperature_c,rate_dps{table}\n");
        let (mut block, row_s) = (-40.0, 10.0);
        for i in 0..2400 {
            let minutes = (i as f64 + 0.5) * row_s / 60.0;
            let in_cycle = minutes % 200.0;
            let chamber = if in_cycle < 100.0 { -40.0 + 1.25 * in_cycle } else { 85.0 - 1.25 * (in_cycle - 100.0) };
            let step = (chamber - block) * (1.0 - (-row_s / 300.0_f64).exp());
            block += step;
            let (u, cpm) = ((block - 22.5) / 62.5, step / row_s * 60.0);
            let powers = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| (sum + c) * u);
            let table_dps = if self.on_table { [-100.0, -20.0, 20.0, 100.0][i / 20 % 4] } else { 0.0 };
            let bias = powers(&self.bias_dph) + self.wiggle_dph * (7.0 * u).sin() + self.rate_dph_per_cpm * cpm;
            let noise = self.n_deg_rt_h / (row_s / 3600.0_f64).sqrt() * dice.normal();
            // ε > 0: fewer counts for the same angle.
            let turned = table_dps * 3600.0 / (1.0 + powers(&self.scale_ppm) * 1e-6);
            let dps = (turned + bias + noise) / 3600.0;
            let seen = if self.on_table { format!(",{table_dps}") } else { String::new() };
            writeln!(text, "{},{block:.4},{dps:.9}{seen}", (i + 1) as f64 * row_s).unwrap();
        }
        text.into_bytes()
    }
}

pub(crate) fn setup() -> Setup {
    Setup { scale_factor_deviation_max_ppm: Some(1e6), input_rate_dph: Some(0.0.into()), ..Setup::default() }
}

/// The image at rest against the record over the span: largest distance in °/h and ppm, as parts of what is allowed: 1e-6 of
/// all terms together, and 1e-5 °/h and 0.001 ppm.
pub(crate) fn away_from_record(found: &Calibration, axis: &AxisCalibration) -> f64 {
    let image = encode(found, axis, [0; 32], 1).unwrap();
    let gyro = Compensator::new(image);
    let input = axis.thermometer();
    let [lo, hi] = axis.span_c();
    let dph_per_count = found.unit.arcsec_per_lsb() / found.target.tick_s();
    let sum: f64 = axis.correction.terms.iter().map(|term| term.value.abs()).sum();
    // The image is the exact inverse: its coefficients are the record's over 1 + ε0.
    let of_nominal = 1.0 + axis.scale_factor().map_or(0.0, |scale| scale.at_reference.ppm * 1e-6);
    let at = |k: i32| {
        let code = ((lo + (hi - lo) * f64::from(k) / 50.0 - input.offset) / input.gain_per_code).round();
        let celsius = (input.offset + code * input.gain_per_code).clamp(lo, hi);
        let mut state = State::new();
        gyro.update(&mut state, &[Some(code as i32)]).unwrap();
        let drift = state.target_increment() as f64 / 2.0_f64.powi(32) * dph_per_count;
        let wanted = axis.drift(celsius, axis.reference_c()) / of_nominal;
        let scale = (state.k_q32() as f64 / 2.0_f64.powi(32) - 1.0) * 1e6;
        let [of_t, of_reference] = [celsius, axis.reference_c()].map(|t| axis.scale_deviation(t)[0]);
        let drift = (drift - wanted).abs() / (1e-5 + 1e-6 * sum);
        let scale = (scale - (of_t - of_reference) / of_nominal).abs() / (1e-3 + 1e-6 * sum);
        drift.max(scale)
    };
    (0..=50).map(at).fold(0.0, f64::max)
}

/// Every model that `auto` selects is exported, and its image says what the record says. Of the tables of 98 real units 34 % once
/// were not.
#[test]
fn whatever_auto_selects_an_image_holds() {
    let sound = fraction(100, |seed| {
        let mut dice = Dice::new(7_000 + seed);
        let sensor = Mems::of(&mut dice);
        // A fifth of them with counts of a stated size, too fine for most.
        let stated = if seed % 5 == 0 { Some(1e-4) } else { None };
        let setup = Setup { rate_lsb_arcsec: stated, ..setup() };
        let found = fit(vec![sensor.log(seed)], &setup, "auto").unwrap();
        let axis = &found.axes[0];
        let rejected = &axis.fit.as_ref().unwrap().rejected_models;
        let away = away_from_record(&found, axis);
        println!(
            "{seed}: bias {:.0}, scale {:.0}, table {}: `{}` {:?} away {away:.4} rejected {rejected:?}",
            sensor.bias_dph[0], sensor.scale_ppm[0], sensor.on_table, axis.correction.model, found.unit
        );
        if stated.is_none() {
            let of_bias = rejected.iter().find(|model| model.reason.contains("°/h, and an image holds"));
            assert!(of_bias.is_none(), "the counts follow the bias: {of_bias:?}");
        }
        // The retest runs at the table's rates through the same image.
        let axis = &retest(&found, sensor.log(seed + 500), &setup).axes[0];
        away < 1.0 && axis.after.sigma_dph.is_finite()
    });
    evidence("a model that `auto` selects for a MEMS rate log of 10 to 30,000 °/h is exported", sound, "≥ 1", 100);
}
