//! Scale factor and bias over temperature from runs on a rate table; many records are in `measured/fit/rate_table.rs`.

use crate::measured::fit::rate_table::{holds_what_was_put_in, setup};
use crate::support;
use crate::support::{fit, retest};
use sagnac::ErrorKind;
use sagnac_log::setup::{Setup, TableRun};
use sagnac_sim::RateTable;
use std::fmt::Write as _;

/// The plateaus agree by the two-direction method, without the fit: 24 of them within four σ.
#[test]
fn plateaus_separate_scale_and_bias() {
    let rig = RateTable::domain_notes();
    let made = fit(vec![rig.csv(1, true), rig.csv(2, true)], &setup(), "bias 2, scale 2").unwrap();
    let scale = made.axes[0].scale_factor().cloned().unwrap();
    assert_eq!(scale.plateaus.len(), 24);
    for p in &scale.plateaus {
        let away = p.scale.ppm - rig.epsilon_ppm(p.temperature_c);
        assert!(away.abs() < 4.0 * p.scale.sigma_ppm, "{p:?}: {away}");
        assert!((p.bias_dph - 4.498 - rig.bias_dph(p.temperature_c)).abs() < 4.0 * p.bias_sigma_dph, "{p:?}");
        // The rig is linear and symmetric: the values are noise, and reported as such.
        let (bent, lame) = (p.nonlinearity.unwrap(), p.asymmetry.unwrap());
        assert!(bent.ppm < 5.0 * bent.sigma_ppm && lame.ppm.abs() < 4.0 * lame.sigma_ppm, "{p:?}");
    }
    let repeats = scale.repeatability.unwrap();
    assert_eq!(repeats.temperatures, 12);
    assert!(repeats.sigma_ppm < 2.0 * repeats.of_noise_ppm, "{repeats:?}");
    let s = scale.arcsec_per_count.unwrap();
    assert!((s / 1.059 - 1.0 - 1e-6 * rig.epsilon_ppm(25.0)).abs() < 0.3e-6, "{s}");
}

/// A table's rate in the setup instead of a column: two sweeps, one per direction.
#[test]
fn rates_per_file_separate_them_too() {
    let rig = |dps: f64| RateTable { rates_dps: vec![dps], soak_s: 3000.0, ..RateTable::domain_notes() };
    let table = |file: &str, dps: f64| TableRun { file: Some(file.into()), rate_dps: Some(dps), axis: None };
    let folder = tempfile::tempdir().unwrap();
    let mut logs = Vec::new();
    for (seed, (name, dps)) in [("plus.csv", 10.0), ("minus.csv", -10.0)].into_iter().enumerate() {
        let path = folder.path().join(name);
        std::fs::write(&path, rig(dps).csv(seed as u64, false)).unwrap();
        logs.push(path);
    }
    let with_rates = Setup { tables: vec![table("plus.csv", 10.0), table("minus.csv", -10.0)], ..setup() };
    let fitted = |setup: &Setup| {
        let open = |path: &std::path::PathBuf| {
            sagnac_log::ingest::LogReader::open(path, setup, sagnac_log::ingest::ReadMode::Bulk)
        };
        let logs = logs.iter().map(|path| open(path).unwrap()).collect::<Vec<_>>();
        let windows = sagnac::window::WindowBuilder::read_all(logs, setup).unwrap().finish();
        let options = sagnac::fit::FitOptions::new(support::model("bias 2, scale 2"));
        sagnac::fit::calibrate(windows, setup, &options)
    };
    holds_what_was_put_in(&rig(10.0), &fitted(&with_rates).unwrap().axes[0], 0.006);
}

/// One rate alone does not separate scale factor and bias; the message says so.
#[test]
fn rates_that_cannot_separate_them_are_refused() {
    let rig = RateTable { rates_dps: vec![10.0], ..RateTable::domain_notes() };
    let refused = fit(vec![rig.csv(1, true), rig.csv(2, true)], &setup(), "bias 2, scale 2").unwrap_err();
    assert_eq!(refused.kind, ErrorKind::Refused);
    assert!(refused.what.contains("scale"), "{refused}");
}

/// The verification has values of bias and of scale factor: 36 ppm over the plateaus before, noise after.
#[test]
fn verify_reports_ppm_before_and_after() {
    let rig = RateTable::domain_notes();
    let made = fit(vec![rig.csv(1, true), rig.csv(2, true)], &setup(), "auto").unwrap();
    let proof = retest(&made, rig.csv(3, true), &setup());
    let scale = proof.axes[0].scale_factor.clone().unwrap();
    assert_eq!(scale.plateaus.len(), 12);
    assert!((scale.before.peak_to_peak_ppm - 36.0).abs() < 1.0, "{:?}", scale.before);
    assert!(scale.after.sigma_ppm < 1.7 * scale.of_noise_ppm, "{:?} of noise {}", scale.after, scale.of_noise_ppm);
    // The mean stays: it is the scale factor at T0, which the correction leaves to arcsec_per_count.
    assert!((scale.after.mean_ppm - rig.epsilon_ppm(25.0)).abs() < 0.3, "{:?}", scale.after);
    let axis = &proof.axes[0];
    assert!(axis.after.sigma_dph < 1.1 * axis.noise_floor.as_ref().unwrap().value_dph, "{axis:?}");
    assert!(axis.improvement_sigma.unwrap() > 10.0, "{axis:?}");
}

/// The correction is the exact inverse of y·(1 + ε0 + ε) = Ω + d, not that to first order in ε0: within 1 ppm of the scale factor and
/// 10⁻⁴ of the bias. To first order 1.2 % would leave 80 ppm and 2 °/h.
#[test]
fn the_correction_inverts_a_scale_factor_of_some_per_cent() {
    let setup = Setup { scale_factor_deviation_max_ppm: Some(60_000.0), ..Setup::default() };
    for epsilon_0 in [-0.05, 0.012, 0.05] {
        let mut csv = String::from("time_s,temperature_c,rate_dph,reference_rate_dps\n");
        let mut time_s = 0;
        let mut rows = |seconds: u32, dps: f64, celsius: &dyn Fn(u32) -> f64| {
            for second in 0..seconds {
                time_s += 1;
                let above_c = celsius(second) - 25.0;
                let truth_dph = dps * 3600.0 + 30.0 + 4.0 * above_c;
                let rate_dph = truth_dph / (1.0 + epsilon_0 + 150e-6 * above_c);
                writeln!(csv, "{time_s},{},{rate_dph:.6},{dps}", celsius(second)).unwrap();
            }
        };
        for step in 0..8_u32 {
            let plateau_c = f64::from(step) * 10.0 - 20.0;
            for dps in [0.0, 20.0, -20.0, 0.0] {
                rows(900, dps, &|_| plateau_c);
            }
            rows(2400, 0.0, &|second| plateau_c + f64::from(second) / 240.0);
        }
        let csv = csv.into_bytes();
        let made = fit(vec![csv.clone()], &setup, "bias 1, scale 1").unwrap();
        let proof = retest(&made, csv, &setup);
        let (axis, scale) = (&proof.axes[0], proof.axes[0].scale_factor.as_ref().unwrap());
        assert!((scale.before.peak_to_peak_ppm - 10_500.0).abs() < 600.0, "{:?}", scale.before);
        assert!(scale.after.peak_to_peak_ppm < 1.0, "{epsilon_0}: {:?}", scale.after);
        assert!(axis.after.sigma_dph < 1e-4 * 280.0, "{epsilon_0}: {} °/h", axis.after.sigma_dph);
    }
}

/// A record on a turning table is not a record at rest; a warning says so.
#[test]
fn the_noise_of_a_turned_record_carries_a_warning() {
    use sagnac::allan::{Request, noise_budget};
    use sagnac_noise::Taus;
    let warned = |rig: &RateTable| {
        let log = support::reader(rig.csv(1, true), &setup());
        let said = noise_budget(vec![log], None, &setup(), &Request::new(Taus::Octaves)).unwrap();
        said.warnings.iter().any(|warning| warning.contains("a table turned in this record, from -10.00 to 10.00 °/s"))
    };
    let still = RateTable { rates_dps: vec![0.0], plateaus_c: vec![25.0], ..RateTable::domain_notes() };
    let turned = RateTable { plateaus_c: vec![25.0], ..RateTable::domain_notes() };
    assert!(warned(&turned) && !warned(&still));
}

/// The table's angle, and a mark per revolution, instead of its rate.
#[test]
fn angles_and_marks_give_the_rate() {
    let rig = RateTable { rates_dps: vec![10.0, -10.0], dwell_s: 720, soak_s: 2880.0, ..RateTable::domain_notes() };
    let text = String::from_utf8(rig.csv(1, true)).unwrap();
    let (mut angle, mut turned) = (0.0_f64, 0.0_f64);
    let mut with_angle = String::from("time_s,temperature_c,counts,table_angle_deg\n");
    let mut with_marks = String::from("time_s,temperature_c,counts,table_mark\n");
    for row in text.lines().skip(1) {
        let (fields, rate) = row.rsplit_once(',').unwrap();
        let rate: f64 = rate.parse().unwrap();
        angle = (angle + rate).rem_euclid(360.0);
        turned += rate;
        let mark = if turned.abs() >= 360.0 { turned.signum() } else { 0.0 };
        turned -= 360.0 * mark;
        writeln!(with_angle, "{fields},{angle}").unwrap();
        writeln!(with_marks, "{fields},{mark}").unwrap();
    }
    // Windows of whole revolutions: 36 s each.
    let setup = Setup { window: Some(sagnac_log::setup::WindowSize::Seconds(72.0)), ..setup() };
    for log in [with_angle, with_marks] {
        let made = fit(vec![log.into_bytes()], &setup, "bias 2, scale 2").unwrap();
        holds_what_was_put_in(&rig, &made.axes[0], 0.012);
    }
}

/// Three gyros, the table turned about z and then about x: the misalignment of each input axis towards the turned one.
#[test]
fn misalignment_from_two_orientations() {
    let arcsec = 180.0 / std::f64::consts::PI * 3600.0;
    // Rows: gyros x, y, z; columns: the rate about x, y, z that each sees, rad.
    let lean = [[1.0, 0.0, 35.0 / arcsec], [-20.0 / arcsec, 1.0, 12.0 / arcsec], [50.0 / arcsec, 0.0, 1.0]];
    let log = |turned: usize, seed: u64| {
        let mut state = seed | 1;
        let mut noise = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut text = String::from("time_s,temperature_c,rate_dph_x,rate_dph_y,rate_dph_z,reference_rate_dps\n");
        for second in 1..=20_000_u32 {
            let celsius = -10.0 + 50.0 * f64::from(second) / 20_000.0;
            let dps = if (second - 1) / 200 % 2 == 0 { 5.0 } else { -5.0 };
            let rates = lean.map(|row| row[turned] * 3600.0 * dps + 0.002 * (celsius - 25.0) + noise());
            writeln!(text, "{second},{celsius},{},{},{},{dps}", rates[0], rates[1], rates[2]).unwrap();
        }
        text.into_bytes()
    };
    let folder = tempfile::tempdir().unwrap();
    let paths = [("about-z.csv", 2), ("about-x.csv", 0)].map(|(name, turned)| {
        std::fs::write(folder.path().join(name), log(turned, 7 + turned as u64)).unwrap();
        folder.path().join(name)
    });
    let table = |file: &str, axis: &str| TableRun { file: Some(file.into()), axis: Some(axis.into()), rate_dps: None };
    let tables = vec![table("about-z.csv", "z"), table("about-x.csv", "x")];
    let fitted = |tables: Vec<TableRun>| {
        let setup = Setup { tables, ..Setup::default() };
        let open = |path: &std::path::PathBuf| {
            sagnac_log::ingest::LogReader::open(path, &setup, sagnac_log::ingest::ReadMode::Bulk)
        };
        let logs = paths.iter().map(|path| open(path).unwrap()).collect::<Vec<_>>();
        let windows = sagnac::window::WindowBuilder::read_all(logs, &setup).unwrap().finish();
        let options = sagnac::fit::FitOptions::new(support::model("bias 1"));
        sagnac::fit::calibrate(windows, &setup, &options)
    };
    let made = fitted(tables).unwrap();
    for (axis, wanted) in made.axes.iter().zip([vec![('z', 35.0)], vec![('x', -20.0), ('z', 12.0)], vec![('x', 50.0)]])
    {
        let found: Vec<char> = axis.fit.as_ref().unwrap().misalignment.iter().map(|m| m.towards).collect();
        assert_eq!(found, wanted.iter().map(|(letter, _)| *letter).collect::<Vec<_>>(), "axis {}", axis.axis);
        for (m, (_, arcsec)) in axis.fit.as_ref().unwrap().misalignment.iter().zip(wanted) {
            assert!((m.arcsec - arcsec).abs() < 4.0 * m.sigma_arcsec && m.sigma_arcsec < 0.5, "{}: {m:?}", axis.axis);
        }
    }
    let asked = fitted(Vec::new()).unwrap_err();
    assert!(asked.what.contains("its gyro axis is not given"), "{asked}");
}
