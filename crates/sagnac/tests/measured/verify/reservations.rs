//! What speaks against a retest before its values do: time that is not there, flagged faults, facts stated otherwise, noise that is not the
//! unit's. By generators that share no code with the program; a hostile review had most of these accepted.

use super::acceptance::{missed, navigation, proof};
use crate::hostile::curves::calibrated;
use crate::hostile::{Bench, Now, fraction, usual};
use crate::support::evidence::{Records, evidence};
use crate::support::reader;
use crate::support::rows::{Rows, to_decimals};
use sagnac::Limits;
use sagnac::calibration::Calibration;
use sagnac::verify::{Correction, Override, Proof, VerifyOptions, verify};
use sagnac_log::setup::{RunDivision, Setup};

const RECORDS: Records = Records::new(60).few(20);

fn with_setup(unit: &Calibration, logs: Vec<Rows<3>>, setup: &Setup) -> Proof {
    let correction = Correction::from_calibration(unit.clone()).unwrap();
    let logs: Vec<_> = logs.into_iter().map(|log| reader(log, setup)).collect();
    verify(&correction, logs, setup, VerifyOptions::default()).unwrap().limits(&navigation()).unwrap()
}

/// Half a degree an hour for two hours, which are cut out; the remainder as two files of one clock. Accepted 39 times of 60.
#[test]
fn hours_cut_out_between_files_are_missing() {
    let unit = calibrated();
    let cut = |seed: u64| {
        let fault = |hours: f64| if (6.0..8.0).contains(&hours) { 0.5 } else { 0.0 };
        let log = Bench::retest(41_000 + seed, &usual).log_with(&fault);
        let headers = log.headers;
        let (before, after): (Vec<_>, Vec<_>) = log.rows.into_iter().partition(|row| row[0] < 6.0 * 3600.0);
        let after = after.into_iter().filter(|row| row[0] >= 8.0 * 3600.0 + 5.0);
        [Rows { headers, rows: before }, Rows { headers, rows: after.collect() }]
    };
    let refused = fraction(RECORDS, |seed| {
        let found = with_setup(&unit, cut(seed).into(), &Bench::setup());
        assert!((found.verification.axes[0].missing_fraction - 2.0 / 14.83).abs() < 0.002, "{seed}");
        missed(&found).contains(&"missing_max".to_owned())
    });
    evidence("two hours cut out between two files of one clock are refused by `missing_max`", refused, "≥ 1", RECORDS);
    // Whatever the order in which they are given.
    let [before, after] = cut(1);
    let found = with_setup(&unit, vec![after, before], &Bench::setup()).verification;
    assert!((found.axes[0].missing_fraction - 2.0 / 14.83).abs() < 0.002 && found.new_clocks.is_empty());
    // A clock that begins again cannot show it: it is said.
    let of_new_clock = |seed: u64| {
        let [before, mut after] = cut(seed);
        let first_s = after.rows[0][0] - 5.0;
        after.rows.iter_mut().for_each(|row| row[0] = to_decimals(row[0] - first_s, 3));
        vec![before, after]
    };
    let found = with_setup(&unit, of_new_clock(1), &Bench::setup());
    assert_eq!((found.verification.new_clocks.len(), found.verification.axes[0].missing_fraction), (1, 0.0));
    // Separate tests are stated as such.
    let separate = Setup { runs: RunDivision::Files, ..Bench::setup() };
    for logs in [of_new_clock(1), cut(1).into()] {
        let found = with_setup(&unit, logs, &separate);
        assert_eq!((found.verification.new_clocks.len(), found.verification.axes[0].missing_fraction), (0, 0.0));
    }
}

/// The log with flags on the rows whose middles lie at some hours.
fn flagged(log: Rows<3>, is_flagged: impl Fn(f64) -> bool) -> Rows<4> {
    let [t, c, n] = log.headers;
    let row = |[time_s, c, n]: [f64; 3]| [time_s, c, n, f64::from(u8::from(!is_flagged((time_s - 2.5) / 3600.0)))];
    Rows { headers: [t, c, n, "valid"], rows: log.rows.into_iter().map(row).collect() }
}

/// A fault that the unit flags itself: 36 minutes of 1 °/h (0.04 of the time), or fifty bursts of 20 s and 2 °/h (0.019).
#[test]
fn flagged_rows_that_are_off_are_not_left_out() {
    let unit = calibrated();
    let accepted_and_off = |fault: &(dyn Fn(f64) -> f64 + Sync), first: u64| {
        fraction(RECORDS, |seed| {
            let log = flagged(Bench::retest(first + seed, &usual).log_with(fault), |hours| fault(hours) != 0.0);
            let found = proof(&unit, vec![log], VerifyOptions::default()).limits(&navigation()).unwrap();
            let axis = &found.verification.axes[0];
            let off = axis.flagged_off.unwrap();
            let size = fault(5.1).max(2.0 * f64::from(u8::from(fault(5.1) == 0.0)));
            assert!((off.difference_dph.value - size).abs() < 4.0 * off.difference_dph.sigma + 0.05 * size, "{off:?}");
            missed(&found).contains(&"excluded_max".to_owned())
        })
    };
    let once = |hours: f64| if (5.0..5.6).contains(&hours) { 1.0 } else { 0.0 };
    let refused = accepted_and_off(&once, 42_000);
    evidence("36 min of 1 °/h that are flagged are refused by `excluded_max`", refused, "≥ 1", RECORDS);
    let bursts = |hours: f64| if hours < 14.0 && (hours * 100.0) % 28.0 < 100.0 / 180.0 { 2.0 } else { 0.0 };
    let refused = accepted_and_off(&bursts, 43_000);
    evidence("50 bursts of 2 °/h and 20 s that are flagged are refused by `excluded_max`", refused, "≥ 0.95", RECORDS);
    // At the start of the log, and without a mean.
    let at_start = |hours: f64| if hours < 0.6 { 1.0 } else { 0.0 };
    let sine = |hours: f64| if (5.0..5.6).contains(&hours) { (hours * 3600.0).sin() } else { 0.0 };
    for fault in [&at_start as &(dyn Fn(f64) -> f64 + Sync), &sine] {
        for seed in 0..5 {
            let log = flagged(Bench::retest(43_500 + seed, &usual).log_with(fault), |hours| fault(hours) != 0.0);
            let found = proof(&unit, vec![log], VerifyOptions::default()).limits(&navigation()).unwrap();
            assert!(missed(&found).contains(&"excluded_max".to_owned()), "{seed}");
        }
    }
    // Flags on rows like the others are no fault.
    let sound = fraction(RECORDS, |seed| {
        let log =
            flagged(Bench::retest(44_000 + seed, &usual).log(), |hours| once(hours) != 0.0 || bursts(hours) != 0.0);
        let found = proof(&unit, vec![log], VerifyOptions::default()).limits(&navigation()).unwrap();
        found.verification.axes[0].left_out_fraction().is_none_or(|part| part < 0.005)
    });
    evidence("rows of a sound unit with 0.06 of them flagged are like their neighbours", sound, "≥ 0.98", RECORDS);
}

/// Facts stated otherwise than for the calibration, and limits made easier, are in the verdict.
#[test]
fn overrides_stand_in_the_verdict() {
    let unit = calibrated();
    let log = || vec![Bench { bias_dph: 0.3, ..Bench::retest(45_001, &usual) }.log()];
    let hidden = Setup { input_rate_dph: Some(4.8.into()), ..Bench::setup() };
    let found = with_setup(&unit, log(), &hidden).verification;
    assert!(found.reservations().ends_with(", overridden: input rate"), "{}", found.reservations());
    assert!(matches!(&found.overrides[..], [Override::InputRate { retest_dph, .. }] if *retest_dph == 4.8));
    // Limits in thousandths of the unit.
    let easy =
        "base = \"navigation-grade\"\nhysteresis_dph_max = 35.0\nbias_repeatability_dph_max = 35.0\nmissing_max = 0.01";
    let with = |text: &str, setup: &Setup| {
        let correction = Correction::from_calibration(unit.clone()).unwrap();
        let limits: Limits = text.parse().unwrap();
        let logs = vec![reader(log().remove(0), setup)];
        verify(&correction, logs, setup, VerifyOptions::default()).unwrap().limits(&limits).unwrap()
    };
    let found = with(easy, &Bench::setup()).verification;
    assert!(found.reservations().ends_with(", overridden: 2 limits"), "{}", found.reservations());
    let simple = "base = \"navigation-grade\"\ndecision = \"simple\"";
    assert!(with(simple, &Bench::setup()).verification.reservations().ends_with(", overridden: decision"));
    let found = with("missing_max = 0.5", &hidden).verification;
    assert!(found.passed() && found.reservations().ends_with(", overridden: input rate, a single limit"));
    assert!(
        with(easy, &Setup { window: Some(sagnac_log::setup::WindowSize::Seconds(105.0)), ..Bench::setup() })
            .verification
            .reservations()
            .ends_with(", overridden: window, 2 limits")
    );
    // The target has no other offset of the temperature than that of its calibration.
    let late = Setup { temperature_offset_s: -600.0, ..Bench::setup() };
    let found = with("missing_max = 0.5", &late);
    assert!(!found.passed() && found.verification.objections[0].contains("temperature_offset_s = -600"));
}

/// A retest made up with a third of the noise, and one whose counts were smoothed over 50 s.
#[test]
fn a_retest_quieter_than_the_record_is_not_accepted() {
    let unit = calibrated();
    let says = |bench: Bench<'_>, smooth: usize| {
        let mut log = bench.log();
        if smooth > 1 {
            let counts: Vec<f64> = log.rows.iter().map(|row| row[2]).collect();
            let mean = |i: usize| {
                let part = &counts[(i + 1).saturating_sub(smooth)..=i];
                part.iter().sum::<f64>() / part.len() as f64
            };
            // A counter behind a moving mean: whole counts of its running total.
            let (mut total, mut counted) = (0.0_f64, 0.0);
            for (i, row) in log.rows.iter_mut().enumerate() {
                total += mean(i);
                (row[2], counted) = (total.floor() - counted, total.floor());
            }
        }
        let found = proof(&unit, vec![log], VerifyOptions::default()).limits(&navigation()).unwrap();
        let is_quieter = found.verification.objections.iter().any(|why| why.contains("quieter"));
        assert!(!(is_quieter && found.passed()));
        [is_quieter, found.passed()]
    };
    let made_up =
        fraction(RECORDS, |seed| says(Bench { n_deg_rt_h: 0.001, ..Bench::retest(46_000 + seed, &usual) }, 1)[0]);
    evidence("a retest with a third of the record's N is not accepted for it", made_up, "≥ 0.95", RECORDS);
    let smoothed =
        fraction(RECORDS, |seed| says(Bench { n_deg_rt_h: 0.005, ..Bench::retest(47_000 + seed, &usual) }, 10)[1]);
    evidence("a retest of N = 0.005 smoothed over 50 s is accepted", smoothed, "≤ 0.02", RECORDS);
    let sound = fraction(Records::new(300).few(20), |seed| {
        says(Bench { b_dph: 0.004, ..Bench::retest(48_000 + seed, &usual) }, 1)[0]
    });
    evidence("a sound retest is called quieter than its record", sound, "≤ 0.01", Records::new(300).few(20));
}

/// The log of another unit under this serial: other curve, three times the noise. The same unit after a move of 0.01 °/h and another slope
/// of its curve is none.
#[test]
fn the_log_of_another_unit_is_named() {
    let unit = calibrated();
    let is_named = |bench: Bench<'_>| {
        let found = proof(&unit, vec![bench.log()], VerifyOptions::default()).limits(&navigation()).unwrap();
        let is_named = found.verification.objections.iter().any(|why| why.contains("another unit"));
        assert!(!(is_named && found.passed()));
        is_named
    };
    let other = |now: Now| -0.012 * now.u() + 0.015 * now.u().powi(2) - 0.02 * now.cpm;
    let named = fraction(RECORDS, |seed| is_named(Bench::retest(49_500 + seed, &other)));
    evidence("the log of a unit with another curve is named", named, "≥ 0.95", RECORDS);
    let named = fraction(RECORDS, |seed| is_named(Bench { n_deg_rt_h: 0.009, ..Bench::retest(49_600 + seed, &usual) }));
    evidence("the log of a unit with three times the N is named", named, "≥ 0.95", RECORDS);
    let moved = |now: Now| usual(now) + 0.01 * now.u();
    let sound = Records::new(300).few(40);
    let named = fraction(sound, |seed| {
        let b_dph = [0.002, 0.005, 0.01][seed as usize % 3];
        is_named(Bench { b_dph, bias_dph: 0.01, ..Bench::retest(49_700 + seed, &moved) })
    });
    evidence("a unit that moved by 0.01 °/h at the ends of its span is taken for another", named, "≤ 0.01", sound);
}

/// The log as rates behind one pole with a time constant of 10 s.
fn filtered(log: Rows<3>) -> Rows<3> {
    let [t, c, _] = log.headers;
    let mut rate_dph = None;
    let row = |[time_s, celsius, counts]: [f64; 3]| {
        let now = counts * crate::hostile::QUANTUM_ARCSEC / 5.0;
        let last = rate_dph.unwrap_or(now);
        let next = last + (now - last) * (1.0 - (-0.5_f64).exp());
        rate_dph = Some(next);
        [time_s, celsius, to_decimals(next, 6)]
    };
    Rows { headers: [t, c, "rate_dph"], rows: log.rows.into_iter().map(row).collect() }
}

/// A filter that calibration and retest have is no fault, whether the record names it or not.
#[test]
fn a_filter_of_both_tests_is_no_fault() {
    const RECORDS: Records = Records::new(100).few(20);
    let setup = Setup { arcsec_per_count: None, ..Bench::setup() };
    let called = fraction(RECORDS, |seed| {
        let log = |k: u64| Bench { cycles: 1, ..Bench::new(49_000 + 3 * seed + k, &usual) }.log();
        let unit = crate::support::fit(vec![filtered(log(0)), filtered(log(1))], &setup, "bias 3, rate 0").unwrap();
        let retest = filtered(Bench::retest(49_002 + 3 * seed, &usual).log());
        let correction = Correction::from_calibration(unit).unwrap();
        let found = verify(&correction, vec![reader(retest, &setup)], &setup, VerifyOptions::default()).unwrap();
        found.verification.objections.iter().any(|why| why.contains("quieter"))
    });
    evidence(
        "a retest behind the filter of its calibration, one pole of 10 s, is called quieter",
        called,
        "≤ 0.01",
        RECORDS,
    );
}
