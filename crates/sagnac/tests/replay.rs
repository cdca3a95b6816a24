//! Replay against a tick-by-tick computation, written independently from the rules of docs/explanation/arithmetic.md:
//! rows at any nanosecond, rows that slow updates cut, gaps, rates with a virtual LSB, several axes.

use crate::support;
use proptest::prelude::*;
use sagnac::calibration::{Calibration, CorrectionTerm, Lag};
use sagnac::export::{Polynomial, import};
use sagnac::model::Form;
use sagnac::verify::{Correction, InputColumns, Replay, VerifyOptions, verify};
use sagnac_core::{Compensator, State};
use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::setup::Setup;

const TICK_NS: i64 = 100_000;

fn calibration(setup: &Setup) -> Calibration {
    let base = Polynomial { coefficients: vec![0.4, -20.0, 400.0], window_s: 100.0, span_c: [0.0, 60.0] };
    let mut calibration = import(&base, setup).unwrap();
    let axis = &mut calibration.axes[0];
    let thermometer = &mut axis.correction.inputs[0];
    thermometer.lag_s = Some(Lag { value: 40.0, sigma: None });
    thermometer.rate_span_per_min = Some([-5.0, 5.0]);
    axis.correction.terms.push(CorrectionTerm::given(Form::rate(0), thermometer, 3.0));
    calibration
}

/// One tick at a time; the row's counts are spread over its ticks one by one, first come first served.
fn walk(gyro: &Compensator, rows: &[(i64, i64, f64, f64)], lsb: f64) -> Vec<i64> {
    let mut state = State::new();
    let origin = rows[0].0;
    let (mut register, mut clock, mut pending, mut stamp_ns) = (rows[0].2, 0, 0.0, i64::MAX);
    let mut out = Vec::new();
    for &(start_ns, end_ns, celsius, angle) in rows {
        // A code has 32 bits.
        let code = |celsius: f64| (celsius.abs() < 128.0).then(|| (celsius * f64::from(1 << 24)).round() as i64);
        let (from, to) = ((start_ns - origin).div_euclid(TICK_NS), (end_ns - origin).div_euclid(TICK_NS));
        // One and a half rows (of 0.7 s) or more from stamp to stamp: equal steps, here of a slow update (10,000 ticks), which is longer than a row,
        // or of as many as make a thousand of them.
        let (since, is_gap) = (clock, (end_ns - origin) - stamp_ns > 1_050_000_000);
        let gap = (from - since).max(0);
        let long = (gap / 10_000_000).max(1) * 10_000;
        let between = |at: i64| match (code(register), code(celsius)) {
            (Some(before), Some(after)) if is_gap => {
                Some((before + (i128::from(after - before) * i128::from(at) / i128::from(to - since)) as i64) as i32)
            }
            (before, _) => before.map(|before| before as i32),
        };
        let tick_at = |gyro: &Compensator, state: &mut State, at: i64| {
            if state.ticks_to_update() == 0 {
                gyro.update(state, &[between(at)]).unwrap();
            }
        };
        while clock < from {
            tick_at(gyro, &mut state, (clock - since) / long * long);
            gyro.skip(&mut state, 1).unwrap();
            clock += 1;
        }
        let exact: f64 = angle / lsb + pending;
        let mut raw = 0;
        pending = exact;
        if clock < to {
            raw = exact.round() as i64;
            pending = exact - exact.round();
        }
        let mut sum = 0;
        while clock < to {
            tick_at(gyro, &mut state, gap + (clock - since - gap) / 10_000 * 10_000);
            // The split at slow updates is in proportion; within a piece any spread gives the same.
            let piece = i64::from(state.ticks_to_update()).min(to - clock);
            let part = raw * piece / (to - clock);
            for n in 0..piece {
                let share = if n == 0 { part } else { 0 };
                sum += i64::from(gyro.tick(&mut state, share as i32).unwrap().counts);
            }
            raw -= part;
            clock += piece;
        }
        out.push(sum);
        (register, stamp_ns) = (celsius, end_ns - origin);
    }
    out
}

/// Readings that a fit would leave out: jumps, values that no thermometer has, cells without one.
fn readings() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![
        12 => (0.0..60.0_f64).prop_map(Some),
        2 => (-400.0..400.0_f64).prop_map(Some),
        2 => Just(None),
    ]
}

/// A cell without a reading is none; of a thermometer slower than the rows of 0.7 s it is the last one, for one and a half of its intervals.
#[derive(Default)]
struct Register {
    last: Option<(i64, f64)>,
    interval_ns: Option<i64>,
}

impl Register {
    fn read(&mut self, now_ns: i64, reading: Option<f64>) -> f64 {
        let Some(celsius) = reading else {
            let slow = self.interval_ns.filter(|interval_ns| *interval_ns > 1_050_000_000);
            let held = self.last.zip(slow).filter(|((last_ns, _), slow)| now_ns - last_ns <= slow + slow / 2);
            return held.map_or(f64::NAN, |((_, celsius), _)| celsius);
        };
        if let Some((last_ns, _)) = self.last.replace((now_ns, celsius)) {
            self.interval_ns = Some(now_ns - last_ns);
        }
        celsius
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn a_row_is_its_ticks(
        steps in prop::collection::vec((20_000_000_i64..900_000_000, readings(), -3.0..3.0_f64, prop::sample::select(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5, 59, 61, 300])), 8..60),
    ) {
        let setup = Setup { arcsec_per_count: Some(1.0), sample_interval_s: Some(0.7), serial: Some("A".into()), ..Setup::default() };
        let mut text = "time_ns,temperature_c,rate_dps\n".to_owned();
        let mut time_ns = 1_700_000_000_000_000_123_i64;
        let (mut seen, mut register) = (Vec::new(), Register::default());
        for (step, celsius, dps, gap) in steps {
            time_ns += step + gap * 1_000_000_000;
            let cell = celsius.map_or(String::new(), |celsius| format!("{celsius:.3}"));
            text += &format!("{time_ns},{cell},{dps:.6}\n");
            seen.push(register.read(time_ns, cell.parse().ok()));
        }
        let mut calibration = calibration(&setup);
        calibration.unit = sagnac::calibration::LogUnit::Rates { lsb_arcsec: 1e-3 };
        let correction = Correction::from_calibration(calibration).unwrap();
        let rates = Setup { arcsec_per_count: None, ..setup };
        let source = Box::new(std::io::Cursor::new(text.into_bytes()));
        let mut log = LogReader::from_reader("log", source, &rates, ReadMode::Bulk).unwrap();
        let shape = log.shape().clone();
        let batch = log.next_batch().unwrap().unwrap().clone();
        let mut replay = Replay::new(&correction.images, &shape, InputColumns::of_one(&correction.images, Some(0)), "log").unwrap();
        let ours = replay.correct(&batch).unwrap();
        let rows: Vec<(i64, i64, f64, f64)> = (0..batch.len())
            .map(|i| (batch.start_ns[i], batch.end_ns[i], seen[i], batch.angle[0][i]))
            .collect();
        let walked = walk(&Compensator::new(correction.images[0]), &rows, 1e-3);
        for (row, counts) in walked.iter().enumerate() {
            prop_assert!((ours.angle[0][row] / 1e-3 - *counts as f64).abs() < 1e-6, "row {row}: {} {counts}", ours.angle[0][row] / 1e-3);
        }
    }
}

/// Two axes of rates, one thermometer stamped 20 s late: with the offset the drift vanishes, without it remains.
#[test]
fn rates_of_two_axes_with_a_late_thermometer() {
    let rate = |t_c: f64, axis: f64| 5.0 + axis * 0.2 * (t_c - 25.0);
    let log = |offset_s: f64| {
        let mut text = "time_s,temperature_c,rate_dph_x,rate_dph_y\n".to_owned();
        for second in 1..=9000_i32 {
            let t_c = |s: f64| 25.0 + 20.0 * (s / 600.0).sin();
            let now = t_c(f64::from(second) - 0.5);
            text += &format!(
                "{second},{:.6},{:.9},{:.9}\n",
                t_c(f64::from(second) - offset_s),
                rate(now, 1.0),
                rate(now, -2.0)
            );
        }
        text.into_bytes()
    };
    let setup = Setup { temperature_offset_s: -20.0, ..Setup::default() };
    let calibration = support::fit(vec![log(20.0)], &setup, "bias 1").unwrap();
    for (axis, slope) in calibration.axes.iter().zip([0.2, -0.4]) {
        assert!((axis.monomial.as_ref().unwrap().coefficients[1] / slope - 1.0).abs() < 1e-3, "{:?}", axis.monomial);
    }
    let proof = |setup: &Setup| {
        let correction = Correction::from_calibration(calibration.clone()).unwrap();
        let reader = support::reader(log(20.0), setup);
        verify(&correction, vec![reader], setup, VerifyOptions::default())
            .map(|proof| proof.verification)
            .unwrap()
            .axes
            .iter()
            .map(|a| a.after.sigma)
            .collect::<Vec<_>>()
    };
    let (aligned, late) = (proof(&setup), proof(&Setup { temperature_offset_s: 0.0, ..setup.clone() }));
    for (aligned, late) in aligned.iter().zip(&late) {
        assert!(*aligned < 0.01 && *late > 10.0 * aligned, "{aligned} {late}");
    }
}
