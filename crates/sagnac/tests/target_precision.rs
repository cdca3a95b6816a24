//! A coefficient from the calibration's `f64` through the image's integers to the correction of the target,
//! compared with the model's equation in `f64`.
//!
//! Asserted (and quoted in docs/explanation/arithmetic.md): d within max(1e-4 °/h, 2⁻²⁶ of its span), k within 5e-4 ppm.

use proptest::prelude::*;
use sagnac::calibration::{Calibration, CorrectionTerm, Lag};
use sagnac::export::{Polynomial, encode, image_bytes, import};
use sagnac::model::{Form, Span, chebyshev};
use sagnac_core::{Compensator, Image, State};
use sagnac_log::setup::Setup;

const PERIOD_S: f64 = 1.0;

#[derive(Clone, Debug)]
struct Case {
    span_c: [f64; 2],
    reference: f64,
    tau_s: f64,
    rate_cpm: f64,
    bias: Vec<f64>,
    rate: Vec<f64>,
    scale: Vec<f64>,
    arcsec: f64,
    walk_c: Vec<f64>,
}

fn any_case() -> impl Strategy<Value = Case> {
    let span = (-60.0..20.0_f64, 12.0..120.0_f64).prop_map(|(lo, width)| [lo, (lo + width).min(110.0)]);
    let size = prop_oneof![Just(0.05), Just(2.0), Just(500.0), Just(20_000.0)];
    let series = |n| prop::collection::vec(-1.0..1.0_f64, 1..=n);
    let parts = (series(8), series(4), series(8), prop::collection::vec(-1.0..1.0_f64, 20..80));
    let rest = (0.0..1.0_f64, 1.0..3000.0_f64, 0.3..8.0_f64, size, prop_oneof![Just(1e-4), Just(0.26475), Just(1.86)]);
    (span, parts, rest).prop_map(|(span_c, (bias, rate, scale, walk_c), (at, tau_s, rate_cpm, size, arcsec))| Case {
        span_c,
        reference: span_c[0] + at * (span_c[1] - span_c[0]),
        tau_s,
        rate_cpm,
        bias: bias.iter().map(|b| b * size).collect(),
        rate: rate.iter().map(|c| c * size / rate_cpm).collect(),
        scale: scale.iter().map(|e| e * 60.0).collect(),
        arcsec,
        walk_c,
    })
}

fn calibration(case: &Case) -> Calibration {
    let setup = Setup { arcsec_per_count: Some(case.arcsec), reference_c: Some(case.reference), ..Setup::default() };
    let base = Polynomial { coefficients: vec![0.0], window_s: 100.0, span_c: case.span_c };
    let mut calibration = import(&base, &setup).unwrap();
    let correction = &mut calibration.axes[0].correction;
    let thermometer = &mut correction.inputs[0];
    thermometer.lag_s = Some(Lag { value: case.tau_s, sigma: None });
    thermometer.rate_span_per_min = Some([-case.rate_cpm, case.rate_cpm]);
    let term =
        |form: fn(u8) -> Form, order: usize, value: f64| CorrectionTerm::given(form(order as u8), thermometer, value);
    let bias = case.bias.iter().enumerate().map(|(i, v)| term(Form::bias, i + 1, *v));
    let rate = case.rate.iter().enumerate().map(|(i, v)| term(Form::rate, i, *v));
    let scale = case.scale.iter().enumerate().map(|(i, v)| term(Form::scale, i + 1, *v));
    correction.terms = bias.chain(rate).chain(scale).collect();
    calibration
}

/// The model's equation; temperatures are whole codes of 2⁻²⁴ °C, as the target sees them.
struct Model<'a> {
    case: &'a Case,
    lag_c: Option<f64>,
}

impl Model<'_> {
    fn series(&self, coefficients: &[f64], first: usize, x: f64, offset: f64) -> f64 {
        let (at, zero) = (chebyshev(x), chebyshev(offset));
        coefficients
            .iter()
            .enumerate()
            .map(|(i, c)| c * (at[i + first] - if first > 0 { zero[i + first] } else { 0.0 }))
            .sum()
    }

    /// d in °/h and ε in ppm.
    fn update(&mut self, t_c: f64) -> (f64, f64) {
        let span = Span::on_grid(self.case.span_c[0], self.case.span_c[1]);
        let x0 = span.x(self.case.reference);
        let x = span.x(t_c.clamp(span.lo, span.hi));
        let lag = self.lag_c.get_or_insert(t_c);
        let step = -(-PERIOD_S / self.case.tau_s).exp_m1() * (t_c - *lag);
        *lag += step;
        let rate = (60.0 * step / PERIOD_S).clamp(-self.case.rate_cpm, self.case.rate_cpm);
        let d = self.series(&self.case.bias, 1, x, x0) + rate * self.series(&self.case.rate, 0, x, x0);
        (d, self.series(&self.case.scale, 1, x, x0))
    }

    /// Span of d over temperatures and rates.
    fn span_of_d(&self) -> f64 {
        let points = (0..=200).map(|i| f64::from(i) / 100.0 - 1.0);
        let values = points.flat_map(|x| {
            let b = self.series(&self.case.bias, 1, x, 0.0);
            let c = self.case.rate_cpm * self.series(&self.case.rate, 0, x, 0.0);
            [b - c, b, b + c]
        });
        let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (v.min(lo), v.max(hi)));
        hi - lo
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn the_target_computes_the_model(case in any_case()) {
        let calibration = calibration(&case);
        let image = match encode(&calibration, &calibration.axes[0], [0; 32], 1) {
            Ok(image) => image,
            // A fine LSB under a huge drift may exceed the increment's range: refused, not wrong.
            Err(error) => { prop_assert!(error.what.contains("image"), "{error}"); return Ok(()) }
        };
        let image = Image::decode(&image_bytes(&image)).unwrap();
        let gyro = Compensator::new(image);
        let (mut state, mut model) = (State::new(), Model { case: &case, lag_c: None });
        let limit = 1e-4_f64.max(model.span_of_d() * 2.0_f64.powi(-26));
        let mut t_c = case.reference;
        for step in &case.walk_c {
            t_c = (t_c + step * case.rate_cpm / 30.0).clamp(-70.0, 115.0);
            let code = (t_c * f64::from(1 << 24)).round() as i32;
            let left = state.ticks_to_update();
            gyro.skip(&mut state, left).unwrap();
            gyro.update(&mut state, &[Some(code)]).unwrap();
            let (d, epsilon) = model.update(f64::from(code) / f64::from(1 << 24));
            let lsb = 2.0_f64.powi(-32);
            let d_target = state.target_increment() as f64 * lsb * case.arcsec / 1e-4;
            let epsilon_target = (state.k_q32() - (1 << 32)) as f64 * lsb * 1e6;
            prop_assert!((d_target - d).abs() <= limit, "d {d_target} {d}, limit {limit}");
            prop_assert!((epsilon_target - epsilon).abs() <= 5e-4, "k {epsilon_target} {epsilon}");
        }
    }
}
