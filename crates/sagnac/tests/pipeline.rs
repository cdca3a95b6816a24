//! The whole path from log to correction with simulated logs: replay, refusals of the fit.

use crate::support::{fit, paper_setup, reader, retest, windows};
use sagnac::fit::{FitOptions, calibrate};
use sagnac::verify::{CorrectedFormat, Correction, Limits, VerifyOptions, compensate, verify};
use sagnac::{ErrorKind, calibration::Calibration};
use sagnac_log::ingest::{LogReader, ReadMode, Reason};
use sagnac_log::setup::{Noise, Setup};
use sagnac_sim::{LaggedChamber, PaperRig, csv_bytes};

fn chamber_rig() -> LaggedChamber {
    LaggedChamber { row_s: 5, ..LaggedChamber::domain_notes() }
}

fn chamber_setup() -> Setup {
    Setup { arcsec_per_count: Some(0.151_25), serial: Some("RLG-1".into()), ..Setup::default() }
}

fn refusal(logs: Vec<Vec<u8>>, setup: &Setup, text: &str) -> String {
    let error = fit(logs, setup, text).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Refused, "{error}");
    error.to_string()
}

#[test]
fn the_same_input_gives_the_same_bytes_and_json_goes_round() {
    let make = || fit(vec![csv_bytes(PaperRig::PAPER.run(1))], &paper_setup(), "auto").unwrap();
    let text = make().to_json().unwrap();
    assert_eq!(text, make().to_json().unwrap());
    assert_eq!(Calibration::parse(&text).unwrap(), make());
    for (from, to, word) in [
        ("\"version\": 2", "\"version\": 3", "version"),
        ("\"span_c\"", "\"span_f\"", "missing field `span_c`"),
        ("\"serial\"", "\"extra\": 1, \"serial\"", "extra"),
        ("\"reference_c\": 25.0", "\"reference_c\": 1e999", "readable"),
        ("\"reference_c\": 25.0", "\"reference_c\": 99.0", "reference_c"),
    ] {
        let error = Calibration::parse(&text.replacen(from, to, 1)).unwrap_err();
        assert!(error.to_string().contains(word) && error.kind == ErrorKind::Input, "{from}: {error}");
    }
    // A newer minor version may have more fields; they are ignored.
    let minor = |version: u32| format!("\"minor_version\": {version}");
    let [now, later] = [sagnac::calibration::MINOR_VERSION, sagnac::calibration::MINOR_VERSION + 1].map(minor);
    let newer = text.replacen(&now, &later, 1).replacen("\"serial\"", "\"extra\": 1, \"serial\"", 1);
    assert_eq!(Calibration::parse(&newer).unwrap().serial, make().serial);
    // The reference states both.
    let stated = format!("| {}, {} |", sagnac::calibration::VERSION, sagnac::calibration::MINOR_VERSION);
    assert!(include_str!("../../../docs/reference/versions.md").contains(&stated), "{stated}");
}

#[test]
fn what_the_data_cannot_support_is_refused_by_name() {
    let paper = |rig: PaperRig| vec![csv_bytes(rig.run(1))];
    let setup = paper_setup();
    let cold = Setup { reference_c: Some(5.0), ..setup.clone() };
    assert!(refusal(paper(PaperRig::PAPER), &cold, "auto").contains("outside the span"));
    let narrow = PaperRig { span_c: [24.0, 30.0], ..PaperRig::PAPER };
    assert!(refusal(paper(narrow), &setup, "auto").contains("a fit needs 10 °C"));
    let allowed = Setup { min_span_c: Some(5.0), ..setup.clone() };
    assert!(fit(paper(narrow), &allowed, "bias 1").is_ok());
    let short = PaperRig { windows: 3, ..PaperRig::PAPER };
    assert!(refusal(paper(short), &setup, "bias 3").contains("three windows"));
    assert!(refusal(paper(PaperRig::PAPER), &setup, "bias 1, scale 1").contains("scale"));
    let no_temperature = vec![b"time_s,counts\n1,4\n2,4\n3,5\n".to_vec()];
    assert!(refusal(no_temperature, &setup, "auto").contains("no temperature"));
    // A thermometer that never moves gives no rate.
    let row = |s: i32| format!("{s},{},{}\n", if s < 1500 { 20 } else { 40 }, 4 + s * 7919 % 13 / 7);
    let still = (1..=3000).map(row).collect::<String>();
    let still = vec![format!("time_s,temperature_c,counts\n{still}").into_bytes()];
    assert!(refusal(still, &setup, "bias 3").contains("not independent"));
}

#[test]
fn auto_on_pure_noise_keeps_no_term() {
    let flat = LaggedChamber { drift_dph: vec![0.0], rate_effect: 0.0, ..chamber_rig() };
    let kept: Vec<String> = (1..=6)
        .map(|seed| {
            fit(vec![csv_bytes(flat.run(seed))], &chamber_setup(), "auto").unwrap().axes[0].correction.model.clone()
        })
        .collect();
    assert!(kept.iter().all(|m| m == "bias 0"), "{kept:?}");
}

#[test]
fn insignificant_terms_of_a_fixed_model_are_marked() {
    let calibration = fit(vec![csv_bytes(PaperRig::PAPER.run(4))], &paper_setup(), "bias 5").unwrap();
    let marks: Vec<bool> = calibration.axes[0].correction.terms.iter().map(|t| t.significant.unwrap()).collect();
    // The span is symmetric about the vertex, so the truth is in T₂ alone.
    assert!(marks[1], "{marks:?}");
    assert!(marks[2..].iter().any(|m| !m), "{marks:?}");
}

/// A 30 s motion of 47 °/h and ten minutes of a step: detected, named, excluded, without effect on the fit.
#[test]
fn bumps_and_steps_are_left_out_by_name() {
    let clean = fit(vec![csv_bytes(PaperRig::PAPER.run(1))], &paper_setup(), "bias 2").unwrap();
    let spoil = |extra: &dyn Fn(f64) -> f64| {
        let rows = PaperRig::PAPER.run(1).map(|row| sagnac_sim::Row { counts: row.counts + extra(row.time_s), ..row });
        fit(vec![csv_bytes(rows)], &paper_setup(), "bias 2").unwrap()
    };
    let bump = spoil(&|t| if (5050.0..5080.0).contains(&t) { 44.5 } else { 0.0 });
    // One that is taken back after ten minutes is an excursion; one that lasts has no wrong side.
    let excursion = spoil(&|t| if (12_030.0..12_630.0).contains(&t) { 1.0 } else { 0.0 });
    let stepped = PaperRig::PAPER
        .run(1)
        .map(|row| sagnac_sim::Row { counts: row.counts + if row.time_s > 12_030.0 { 1.0 } else { 0.0 }, ..row });
    let refused = refusal(vec![csv_bytes(stepped)], &paper_setup(), "bias 2");
    assert!(refused.contains("steps at 3.3") && refused.contains("stays there"), "{refused}");
    for (spoiled, reason, windows) in [(bump, Reason::Motion, 1), (excursion, Reason::Step, 7)] {
        let excluded = spoiled.axes[0].excluded();
        assert_eq!(excluded.len(), 1, "{excluded:?}");
        assert_eq!(excluded[0].reason, reason);
        assert!(excluded[0].rows.abs_diff(windows * 100) <= 200, "{excluded:?}");
        // The spans differ, so the curves are compared in powers of °C.
        let powers = |of: &Calibration| of.axes[0].monomial.clone().unwrap();
        let (a, b) = (powers(&clean), powers(&spoiled));
        let sigma = b.sigma.as_ref().unwrap()[2];
        assert!((a.coefficients[2] - b.coefficients[2]).abs() < 3.0 * sigma, "{a:?} {b:?}");
    }
}

#[test]
fn verify_goes_through_the_image_and_limits_decide() {
    let setup = chamber_setup();
    let calibration =
        fit(vec![csv_bytes(chamber_rig().run(1)), csv_bytes(chamber_rig().run(2))], &setup, "bias 3, rate 0").unwrap();
    let proof = retest(&calibration, csv_bytes(chamber_rig().run(3)), &setup);
    // The same images alone, without their calibration.
    let correction = Correction::from_calibration(calibration.clone()).unwrap();
    let alone = Correction::from_image(correction.images[0]);
    let alone_setup = alone.setup();
    let log = LogReader::from_reader(
        "simulated.csv",
        Box::new(std::io::Cursor::new(csv_bytes(chamber_rig().run(3)))),
        &alone_setup,
        ReadMode::Bulk,
    );
    let limits = Limits::parse("improvement_min = 1000.0\nsigma_dph_max = 1.0").unwrap();
    let by_image = verify(&alone, vec![log.unwrap()], &alone_setup, VerifyOptions::default())
        .and_then(|proof| proof.limits(&limits))
        .unwrap()
        .verification;
    assert_eq!((&proof.axes[0].before, &proof.axes[0].after), (&by_image.axes[0].before, &by_image.axes[0].after));
    assert_eq!(proof.image_sha256, by_image.image_sha256);
    let passes: Vec<Option<bool>> = by_image.axes[0].limits.iter().map(|l| l.pass).collect();
    assert_eq!((passes, by_image.passed()), (vec![Some(true), Some(false)], false));
    let floor_of = |n_deg_rt_h: f64| {
        let given = Setup { noise: Some(Noise::walk(n_deg_rt_h)), ..setup.clone() };
        retest(&calibration, csv_bytes(chamber_rig().run(3)), &given).axes[0].noise_floor.clone().unwrap().value_dph
    };
    assert!((floor_of(0.0015) - 0.009).abs() < 1e-12, "0.09 arcsec/√s over 100 s is 0.009 °/h");
    let own = proof.axes[0].noise_floor.as_ref().unwrap().value_dph;
    assert_eq!(floor_of(0.006), own, "the setup states twice the noise that the log shows");
}

/// An imported polynomial removes exactly P(T) − P(T0): verifies the correction of the paper.
#[test]
fn an_old_correction_can_be_verified_too() {
    let setup = paper_setup();
    let polynomial = sagnac::export::Polynomial {
        coefficients: vec![0.85, -46.0, 1043.39],
        window_s: 100.0,
        span_c: [17.94, 36.18],
    };
    let old = sagnac::export::import(&polynomial, &setup).unwrap();
    let proof = retest(&old, csv_bytes(PaperRig::PAPER.run(5)), &setup);
    let axis = &proof.axes[0];
    let over_floor = axis.after.sigma_dph / axis.noise_floor.as_ref().unwrap().value_dph;
    assert!((over_floor - 1.0).abs() < 0.15, "{over_floor}");
    assert!((axis.after.mean - 424.64).abs() < 0.5, "the table's after-mean, {}", axis.after.mean);
    // C cancels: the printed constant corrects just as well.
    let printed = sagnac::export::Polynomial { coefficients: vec![0.85, -46.0, 1000.0], ..polynomial };
    let printed = sagnac::export::import(&printed, &setup).unwrap();
    let same = retest(&printed, csv_bytes(PaperRig::PAPER.run(5)), &setup);
    assert_eq!(same.axes[0].after, axis.after);
}

#[test]
fn compensated_output_is_stamped_conserves_counts_and_is_refused_as_input() {
    let setup = paper_setup();
    let calibration = fit(vec![csv_bytes(PaperRig::PAPER.run(1))], &setup, "bias 2").unwrap();
    let proof = retest(&calibration, csv_bytes(PaperRig::PAPER.run(2)), &setup);
    let correction = Correction::from_calibration(calibration).unwrap();
    let make = |pace: ReadMode| {
        let source = Box::new(std::io::Cursor::new(csv_bytes(PaperRig::PAPER.run(2))));
        let mut log = LogReader::from_reader("log", source, &setup, pace).unwrap();
        let mut out = Vec::new();
        compensate(&correction, &mut log, &setup, CorrectedFormat::Csv, &mut out).unwrap();
        String::from_utf8(out).unwrap()
    };
    let text = make(ReadMode::BulkWithText);
    assert_eq!(text, make(ReadMode::LineByLine));
    let mut lines = text.lines();
    assert!(lines.next().unwrap().starts_with("# sagnac compensated"));
    assert_eq!(lines.next().unwrap(), "time_s,temperature_c,compensated_counts,status");
    let total: f64 = lines.map(|line| line.split(',').nth(2).unwrap().parse::<f64>().unwrap()).sum();
    let verified = proof.axes[0].after.mean * proof.axes[0].after.n as f64;
    assert!((total - verified).abs() < 1e-6, "{total} {verified}");
    let without_stamp = text.lines().skip(1).map(|l| format!("{l}\n")).collect::<String>();
    for again in [text, without_stamp] {
        let again = Box::new(std::io::Cursor::new(again.into_bytes()));
        let error = LogReader::from_reader("log", again, &setup, ReadMode::Bulk).err().unwrap();
        assert_eq!(error.kind, ErrorKind::Refused);
    }
}

/// Multi-axis rates with two thermometers, a gap and missing temperatures: HELD, STALE and the gap do not
/// disturb the sums: corrected − raw is −Σd·dt of the covered time only.
#[test]
fn replay_reports_held_and_stale_and_skips_gaps() {
    let setup = Setup { serial: Some("A".into()), arcsec_per_count: Some(1.0), ..Setup::default() };
    let polynomial = sagnac::export::Polynomial { coefficients: vec![10.0, 0.0], window_s: 100.0, span_c: [0.0, 50.0] };
    let correction = Correction::from_calibration(sagnac::export::import(&polynomial, &setup).unwrap()).unwrap();
    let row = |t: u32| {
        let celsius = if (100..140).contains(&t) { String::new() } else { "35".to_owned() };
        format!("{t},{celsius},40\n")
    };
    let rows: String = (1..=300).filter(|t| !(200..250).contains(t)).map(row).collect();
    let mut log = reader(format!("time_s,temperature_c,counts\n{rows}").into_bytes(), &setup);
    let mut log_with_text = {
        let source = Box::new(std::io::Cursor::new(format!("time_s,temperature_c,counts\n{rows}").into_bytes()));
        LogReader::from_reader("log", source, &setup, ReadMode::BulkWithText).unwrap()
    };
    assert!(log.next_batch().unwrap().is_some());
    let mut out = Vec::new();
    compensate(&correction, &mut log_with_text, &setup, CorrectedFormat::Csv, &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    let status =
        |t: u32| text.lines().find(|l| l.starts_with(&format!("{t},"))).unwrap().rsplit(',').next().unwrap().to_owned();
    assert_eq!((status(50).as_str(), status(105).as_str(), status(125).as_str()), ("OK", "HELD", "HELD|STALE"));
    assert_eq!((status(150).as_str(), status(255).as_str()), ("OK", "OK"));
    let total: i64 = text.lines().skip(2).map(|l| l.split(',').nth(2).unwrap().parse::<i64>().unwrap()).sum();
    // d = 0.1 counts/s per °C, T − T0 = 10 °C: one count per second over 250 s; the first slew of 10 ms
    // saves half a hundredth of one, which stays in the remainder.
    assert_eq!(total, 250 * 40 - 250);
}

/// An excluded glitch must not raise the noise floor of the other windows.
#[test]
fn a_glitch_that_is_left_out_leaves_no_trace_in_the_floor() {
    let setup = chamber_setup();
    let cycle = |seed: u64, glitch: f64| {
        let rows = chamber_rig().run(seed).enumerate();
        csv_bytes(rows.map(|(i, row)| sagnac_sim::Row { counts: if i == 2000 { glitch } else { row.counts }, ..row }))
    };
    let clean = csv_bytes(chamber_rig().run(3));
    let calibration = fit(vec![csv_bytes(chamber_rig().run(1))], &setup, "bias 1").unwrap();
    let floor = |log: Vec<u8>| retest(&calibration, log, &setup).axes[0].noise_floor.clone().unwrap().value_dph;
    let (without, with) = (floor(clean), floor(cycle(3, 1e6)));
    assert!((with / without - 1.0).abs() < 0.02, "{with} {without}");
}

/// Windows cut short by a fast ramp are noisier, and the noise floor accounts for that: pure noise is at its floor.
#[test]
fn noise_is_at_its_floor_on_any_ramp() {
    for rate_cpm in [1.0, 3.0, 10.0] {
        let legs: Vec<_> =
            (0..12).map(|i| sagnac_sim::Leg::Ramp(if i % 2 == 0 { 60.0 } else { -20.0 }, rate_cpm)).collect();
        let rig = LaggedChamber {
            start_c: -20.0,
            legs,
            block_lag_s: 1.0,
            drift_dph: vec![0.0],
            rate_effect: 0.0,
            row_s: 1,
            ..LaggedChamber::domain_notes()
        };
        let setup = chamber_setup();
        let calibration = fit(vec![csv_bytes(rig.run(1))], &setup, "bias 1").unwrap();
        let proof = retest(&calibration, csv_bytes(rig.run(2)), &setup);
        let over_floor = proof.axes[0].after.sigma_dph / proof.axes[0].noise_floor.as_ref().unwrap().value_dph;
        println!("{rate_cpm} °C/min: {over_floor:.3}");
        assert!((over_floor - 1.0).abs() < 0.1, "{rate_cpm} °C/min: {over_floor}");
        let axis = &calibration.axes[0];
        let held_out = axis.cross_validation().unwrap().sigma_dph / axis.residual().unwrap().sigma_dph;
        assert!((held_out - 1.0).abs() < 0.1, "{held_out}");
    }
}

/// A short run that lies completely in one block does not remove candidates.
#[test]
fn a_run_shorter_than_a_block_is_judged_about_its_own_mean() {
    let setup = paper_setup();
    let short = PaperRig { windows: 5, ..PaperRig::PAPER };
    let long = || vec![csv_bytes(PaperRig::PAPER.run(1)), csv_bytes(PaperRig::PAPER.run(2))];
    let with_short = || long().into_iter().chain([csv_bytes(short.run(3))]).collect();
    // Two lags are not separated by these runs, short or long, and have no held-out error.
    let scored = |logs| {
        let axis = fit(logs, &setup, "auto").unwrap().axes.remove(0);
        assert!(axis.correction.model.starts_with("bias 2"), "{}", axis.correction.model);
        let scored = axis.candidates().iter().filter(|c| c.held_out_dph.is_some());
        let mut models: Vec<String> = scored.map(|c| c.model.clone()).collect();
        models.retain(|model| !model.contains("zones"));
        models
    };
    let models = scored(with_short());
    assert_eq!(models, scored(long()));
    assert!(models.len() >= 40 && models.iter().all(|model| !model.contains("slow")), "{models:?}");
}

#[test]
fn the_same_log_twice_is_no_second_run() {
    let logs = || vec![csv_bytes(PaperRig::PAPER.run(1)), csv_bytes(PaperRig::PAPER.run(1))];
    let readers = logs().into_iter().map(|csv| reader(csv, &paper_setup())).collect::<Vec<_>>();
    let error = sagnac::window::WindowBuilder::read_all(readers, &paper_setup()).err().unwrap();
    assert!(error.kind == ErrorKind::Input && error.what.contains("same bytes"), "{error}");
}

/// A record edited by hand is accepted unchanged or refused, never in part.
#[test]
fn hand_edited_records_are_refused_by_field() {
    let text =
        fit(vec![csv_bytes(chamber_rig().run(1))], &chamber_setup(), "bias 2, rate 1").unwrap().to_json().unwrap();
    for (from, to, word) in [
        ("\"order\": 2\n", "\"order\": 9\n", "orders are 1 to 8"),
        ("\"order\": 2\n", "\"order\": 1\n", "the same term twice"),
        ("\"order\": 2\n", "\"order\": 0\n", "orders are 1 to 8"),
        ("\"times_rate\": false", "\"times_rate\": true", "the unit of such a term"),
        ("\"input\": \"temperature_c\"", "\"input\": \"cavity\"", "an input that the record does not contain"),
        ("\"unit\": \"deg/h\"", "\"unit\": \"deg/s\"", "deg/h"),
        ("\"serial\": \"RLG-1\"", "\"serial\": \"\"", "1 to 32"),
        ("\"axis\": \"x\"", "\"axis\": \"/\"", "letters or digits"),
        ("\"stale_after_s\": 10.0", "\"stale_after_s\": -1.0", "within"),
        ("\"gain_per_code\": 5.960464477539063e-8", "\"gain_per_code\": 1e-300", "within"),
    ] {
        assert!(text.contains(from), "{from}");
        let error = Calibration::parse(&text.replacen(from, to, 1)).unwrap_err();
        assert!(error.to_string().contains(word), "{from}: {error}");
    }
    // Earlier programs wrote intervals by a bootstrap into a term.
    let earlier = text.replacen("\"times_rate\": false", "\"bootstrap\": [0.1, 0.2], \"times_rate\": false", 1);
    assert_eq!(Calibration::parse(&earlier).unwrap().to_json().unwrap(), text);
}

/// The timing of the target has one source: an imported polynomial uses the setup, like a fit.
#[test]
fn fit_and_import_take_the_same_timing_from_the_setup() {
    let setup = Setup { tick_s: Some(2e-4), temperature_period_s: Some(0.5), slew_ticks: Some(20), ..paper_setup() };
    let fitted = fit(vec![csv_bytes(PaperRig::PAPER.run(1))], &setup, "bias 2").unwrap();
    let span_c = [17.94, 36.18];
    let old = sagnac::export::Polynomial { coefficients: vec![0.85, -46.0, 1043.39], window_s: 100.0, span_c };
    let imported = sagnac::export::import(&old, &setup).unwrap();
    assert_eq!(fitted.target, imported.target);
    assert_eq!((fitted.target.tick_ns, fitted.target.period_ticks, fitted.target.slew_ticks), (200_000, 2500, 20));
}

/// Hysteresis is always reported: the rate effect before the fit, nothing after it; without the rate
/// term it stays.
#[test]
fn hysteresis_is_always_reported() {
    let rig = LaggedChamber::domain_notes();
    let setup = Setup { arcsec_per_count: Some(rig.arcsec_per_count), ..Setup::default() };
    let legs = |model: &str| {
        let made = fit(vec![csv_bytes(rig.run(1))], &setup, model).unwrap();
        made.axes[0].fit.as_ref().unwrap().hysteresis.unwrap()
    };
    // 0.05 °/h per °C/min at up to ±1 °C/min, less in the tails of the ramps: up to a tenth of a °/h between the legs.
    let with_rate = legs("bias 3, rate 0");
    assert!((0.05..0.1).contains(&with_rate.before_dph), "{with_rate:?}");
    assert!(with_rate.after_dph.abs() < 3.0 * with_rate.sigma_dph, "{with_rate:?}");
    let without = legs("bias 3");
    assert!(without.after_dph > 10.0 * without.sigma_dph.min(0.005), "{without:?}");
}

/// A listener gets every part of a fit from start to end, and changes nothing.
#[test]
fn a_fit_tells_what_it_is_doing() {
    use sagnac::fit::{Doing, Progress};
    use std::sync::{Arc, Mutex};

    let (logs, setup) = (vec![csv_bytes(PaperRig::PAPER.run(1))], paper_setup());
    let told: Arc<Mutex<Vec<Doing>>> = Arc::default();
    let watcher = {
        let told = Arc::clone(&told);
        Progress::to(move |doing| told.lock().unwrap().push(doing.clone()))
    };
    let options = || FitOptions::new(sagnac::fit::Model::Auto);
    let watched = calibrate(windows(logs.clone(), &setup), &setup, &options().progress(watcher)).unwrap();
    let silent = calibrate(windows(logs, &setup), &setup, &options()).unwrap();
    assert_eq!(watched.to_json().unwrap(), silent.to_json().unwrap());
    let told = told.lock().unwrap();
    for part in ["models, each held out", "model search, step 1"] {
        let of_part: Vec<&Doing> = told.iter().filter(|doing| doing.what.contains(part)).collect();
        assert!(of_part.iter().all(|doing| doing.what.starts_with("axis x: ") && doing.done <= doing.of), "{part}");
        assert!(of_part.iter().any(|doing| doing.done == 0), "{part}");
        assert!(of_part.iter().any(|doing| doing.done == doing.of), "{part}: {of_part:?}");
    }
}
