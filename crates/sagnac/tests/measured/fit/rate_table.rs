//! Scale factor and bias over temperature from runs on a rate table.

use crate::support;

use crate::support::evidence::{evidence, largest};
use crate::support::fit;
use sagnac::ErrorKind;
use sagnac::calibration::AxisCalibration;
use sagnac::model::ActsOn;
use sagnac_log::setup::{Direction, Earth, Setup};
use sagnac_sim::RateTable;

pub(crate) fn setup() -> Setup {
    let earth = Earth { latitude_deg: 17.4, axis_direction: Direction::Up.into() };
    Setup { arcsec_per_count: Some(1.059), earth: Some(earth), serial: Some("RT-1".into()), ..Setup::default() }
}

/// ε(T) − ε(T0) and d(T) of a record, by the definition.
fn series(axis: &AxisCalibration, of: ActsOn, celsius: f64) -> f64 {
    let [lo, hi] = axis.span_c();
    let x = |t: f64| (2.0 * t - lo - hi) / (hi - lo);
    let chebyshev = |n: u8, x: f64| (f64::from(n) * x.clamp(-1.0, 1.0).acos()).cos();
    let terms = axis.correction.terms.iter().filter(|term| term.acts_on == of && !term.times_rate);
    let of_order = |order: u8| chebyshev(order, x(celsius)) - chebyshev(order, x(axis.reference_c()));
    terms.map(|t| t.value * of_order(t.shape.order().unwrap() as u8)).sum()
}

/// The rig's truth is in other powers than the fit's: ε within 0.25 ppm over 110 °C, d within `most_dph`, ε0 within four
/// of its σ. Returns how far each is off: ppm, °/h, σ.
pub(crate) fn holds_what_was_put_in(rig: &RateTable, axis: &AxisCalibration, most_dph: f64) -> [f64; 3] {
    let mut off = [0.0_f64; 3];
    let at_reference = axis.scale_factor().unwrap().at_reference;
    let away = at_reference.ppm - rig.epsilon_ppm(25.0);
    assert!(away.abs() < 4.0 * at_reference.sigma_ppm && at_reference.sigma_ppm < 0.1, "{at_reference:?}: {away}");
    off[2] = away.abs() / at_reference.sigma_ppm;
    for celsius in [-40.0, -20.0, 0.0, 40.0, 70.0] {
        let epsilon = series(axis, ActsOn::ScaleFactor, celsius) - (rig.epsilon_ppm(celsius) - rig.epsilon_ppm(25.0));
        assert!(epsilon.abs() < 0.25, "{celsius} °C: ε is {epsilon} ppm off");
        let bias = series(axis, ActsOn::Bias, celsius) - (rig.bias_dph(celsius) - rig.bias_dph(25.0));
        assert!(bias.abs() < most_dph, "{celsius} °C: d is {bias} °/h off");
        (off[0], off[1]) = (off[0].max(epsilon.abs()), off[1].max(bias.abs()));
    }
    off
}

#[test]
fn bias_and_scale_factor_come_out_of_one_fit() {
    let rig = RateTable::domain_notes();
    let mut most = [0.0_f64; 3];
    for seed in 0..10 {
        let made =
            fit(vec![rig.csv(2 * seed, true), rig.csv(2 * seed + 1, true)], &setup(), "bias 2, scale 2").unwrap();
        let off = holds_what_was_put_in(&rig, &made.axes[0], 0.006);
        most.iter_mut().zip(off).for_each(|(most, off)| *most = most.max(off));
        let constant = &made.axes[0].run_offsets[0];
        let bias = constant.fixed_bias_dph.unwrap() - rig.bias_dph(25.0);
        assert!(bias.abs() < 5.0 * constant.sigma_dph.unwrap() + 0.001, "the Earth's rate is taken off: {bias}");
    }
    largest("scale factor over temperature on a rate table: largest error, ppm", most[0], "≤ 0.25", 10);
    largest("drift over temperature on a rate table: largest error, °/h", most[1], "≤ 0.006", 10);
    largest("scale factor at T0 on a rate table: largest error in its own σ", most[2], "≤ 4", 10);
    let auto = fit(vec![rig.csv(1, true), rig.csv(2, true)], &setup(), "auto").unwrap();
    assert_eq!(auto.axes[0].correction.model, "bias 2, scale 2");
}

/// A reference whose sign is that of the other direction once gave −2,000,005 ppm and a drift of twice its size in the retest; a
/// scale four times too large 3,000,020 ppm. Both are refused by name, in calibration and in verification, at several rates
/// and at one; 900 ppm pass.
#[test]
fn a_reference_of_the_other_sign_and_a_wrong_scale_are_refused() {
    let rig = RateTable::domain_notes();
    let unit = fit(vec![rig.csv(1, true), rig.csv(2, true)], &setup(), "bias 2, scale 2").unwrap();
    let flip = |csv: Vec<u8>| {
        let text = String::from_utf8(csv).unwrap();
        let flipped = text.lines().enumerate().map(|(line, row)| match row.rsplit_once(',') {
            Some((fields, rate)) if line > 0 => format!("{fields},{}\n", -rate.parse::<f64>().unwrap()),
            _ => format!("{row}\n"),
        });
        flipped.collect::<String>().into_bytes()
    };
    let refused = |error: sagnac::Error, words: &str| {
        assert_eq!(error.kind, ErrorKind::Refused, "{error}");
        assert!(format!("{error:?}").contains(words), "{error:?}");
    };
    let mut flipped = 0;
    for seed in 0..20 {
        refused(fit(vec![flip(rig.csv(seed, true))], &setup(), "auto").unwrap_err(), "opposite signs");
        let correction = sagnac::verify::Correction::from_calibration(unit.clone()).unwrap();
        let retest = vec![support::reader(flip(rig.csv(seed, true)), &setup())];
        let judged = sagnac::verify::verify(&correction, retest, &setup(), Default::default());
        refused(judged.unwrap_err(), "opposite signs");
        flipped += 1;
    }
    let claim = "a reference of the other sign is refused by name, in calibration and in verification";
    evidence(claim, f64::from(flipped) / 20.0, "≥ 1", 20);
    let wrong = Setup { arcsec_per_count: Some(1.059 / 4.0), ..setup() };
    refused(fit(vec![rig.csv(1, true)], &wrong, "auto").unwrap_err(), "wrong by a factor of 4.0");
    let near = Setup { arcsec_per_count: Some(1.059 * (1.0 - 800e-6)), ..setup() };
    let made = fit(vec![rig.csv(1, true), rig.csv(2, true)], &near, "bias 2, scale 2").unwrap();
    assert!((made.axes[0].scale_factor().unwrap().at_reference.ppm - 917.0).abs() < 5.0);
    let strict = Setup { scale_factor_deviation_max_ppm: Some(500.0), ..near };
    refused(fit(vec![rig.csv(1, true)], &strict, "auto").unwrap_err(), "500 ppm");
    // One direction and one rate alone.
    let one = String::from_utf8(rig.csv(1, true)).unwrap();
    let rows = one.lines().enumerate().filter(|(line, row)| *line == 0 || row.ends_with(",10"));
    let one: String = rows.map(|(_, row)| format!("{row}\n")).collect();
    refused(fit(vec![flip(one.into_bytes())], &setup(), "bias 2").unwrap_err(), "opposite signs");
}
