//! Coverage of the intervals for residuals that are not white, and accuracy of the forecast for more data.

use crate::support::evidence::{Records, evidence, ratio};
use crate::support::farthest;
use crate::support::fit;
use crate::support::rows::Rows;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sagnac::calibration::Calibration;
use sagnac::compare::compare;
use sagnac_log::setup::{Noise, Setup, WindowSize};

const SEEDS: Records = Records::new(500).few(30);
const SIGMA: f64 = 0.02;
/// b₁, b₂, b₃ on −40 … +70 °C.
const TRUTH: [f64; 3] = [0.04, -0.02, 0.01];

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || ((rng.next_u64() >> 11) + 1) as f64 / (1_u64 << 53) as f64;
    (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

fn drift(celsius: f64) -> f64 {
    let x = ((celsius - 15.0) / 55.0).clamp(-1.0, 1.0);
    TRUTH.iter().enumerate().map(|(n, b)| b * ((n as f64 + 1.0) * x.acos()).cos()).sum()
}

/// Up and down between −40 and +70 °C twice, then a soak at −40 °C; residuals of σ 0.02 °/h and this correlation time.
pub(crate) fn log(windows: usize, soak: usize, correlation_windows: f64, seed: u64) -> Rows<3> {
    log_with_walk(windows, soak, correlation_windows, 0.0, seed)
}

/// The same with a rate random walk next to them, °/h/√h.
fn log_with_walk(windows: usize, soak: usize, correlation_windows: f64, k_dph_rt_h: f64, seed: u64) -> Rows<3> {
    let mut walk = 0.0;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let keep = if correlation_windows > 0.0 { (-1.0 / correlation_windows).exp() } else { 0.0 };
    let mut noise = normal(&mut rng);
    let mut log = Rows::new(["time_s", "temperature_c", "rate_dph"]);
    for k in 0..windows + soak {
        let phase = (4.0 * (k as f64 + 0.5) / windows as f64).min(4.0);
        let celsius = 15.0 + 55.0 * (1.0 - 2.0 * (phase % 2.0 - 1.0).abs());
        log.push([(100 * (k + 1)) as f64, celsius, 4.5 + drift(celsius) + SIGMA * noise + walk]);
        if k_dph_rt_h > 0.0 {
            walk += k_dph_rt_h * (100.0_f64 / 3600.0).sqrt() * normal(&mut rng);
        }
        noise = keep * noise + (1.0 - keep * keep).sqrt() * normal(&mut rng);
    }
    log
}

fn mean(of: &[f64]) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

pub(crate) fn by_rows() -> Setup {
    Setup { window: Some(WindowSize::ROW), ..Setup::default() }
}

/// Fractions of 500 records whose 95 % intervals contain the truth: three coefficients, the curve at three temperatures, a
/// new window.
fn coverage(correlation_windows: f64) -> [f64; 7] {
    let mut covered = [0_u32; 7];
    for seed in SEEDS.each() {
        let made = fit(vec![log(300, 0, correlation_windows, seed)], &by_rows(), "bias 3").unwrap();
        let axis = &made.axes[0];
        let t95 = axis.residual().unwrap().t_quantile_975;
        for (i, term) in axis.correction.terms.iter().enumerate() {
            covered[i] += u32::from((term.value - TRUTH[i]).abs() <= t95 * term.sigma.unwrap());
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed + 1_000_000);
        for (i, celsius) in [-39.0, -10.0, 60.0].into_iter().enumerate() {
            let said = axis.predict(celsius).unwrap();
            let away = said.drift_dph - (drift(celsius) - drift(25.0));
            covered[3 + i] += u32::from(away.abs() <= said.curve_dph);
            if i == 1 {
                covered[6] += u32::from((away + SIGMA * normal(&mut rng)).abs() <= said.window_dph);
            }
        }
    }
    let parts = covered.map(|n| f64::from(n) / SEEDS.count() as f64);
    println!("correlation over {correlation_windows} windows: {parts:?}");
    parts
}

/// Measured: 0.934 … 0.964 over one window, 0.926 … 0.970 over five.
#[test]
fn intervals_hold_under_residuals_that_hang_together() {
    let of_one = [
        "95 % intervals of three coefficients, residuals correlated over 1 window: coverage farthest from 0.95",
        "95 % intervals of the curve at three temperatures, residuals correlated over 1 window: coverage farthest from 0.95",
        "95 % interval of a new window, residuals correlated over 1 window: coverage",
    ];
    let of_five = [
        "95 % intervals of three coefficients, residuals correlated over 5 windows: coverage farthest from 0.95",
        "95 % intervals of the curve at three temperatures, residuals correlated over 5 windows: coverage farthest from 0.95",
        "95 % interval of a new window, residuals correlated over 5 windows: coverage",
    ];
    for (correlation_windows, claims) in [(1.0, of_one), (5.0, of_five)] {
        let parts = coverage(correlation_windows);
        for (claim, parts) in claims.into_iter().zip([&parts[..3], &parts[3..6], &parts[6..]]) {
            evidence(claim, farthest(parts.iter().copied(), 0.95), "0.92 … 0.98", SEEDS);
        }
    }
}

/// The forecast of the record for hours of soak at −40 °C, against fits with these hours: mean over 40 records. Under a walk that
/// makes half of the uncertainty, hours of soak buy little, and the forecast knows it.
#[test]
fn the_forecast_of_a_soak_comes_true() {
    const HOURS: Records = Records::new(40);
    let cases = [
        ("white residuals", 0.0, 0.0),
        ("residuals correlated over 1 window", 1.0, 0.0),
        ("a stated walk of 0.01 °/h/√h", 0.0, 0.01),
    ];
    let by_rows = by_rows();
    // Stated, because an estimate of K gets better with the hours as well. 0.02 °/h of a window of 100 s is N = 0.02/6 °/√h.
    let stated = Setup { noise: Some(Noise::walk(SIGMA / 6.0).slow(0.0, 0.01)), ..Setup::default() };
    for (name, correlation_windows, walk) in cases {
        let mut ratios = [Vec::new(), Vec::new()];
        for seed in HOURS.each() {
            let made = |soak: usize| {
                let log = log_with_walk(300, soak, correlation_windows, walk, seed);
                fit(vec![log], if walk > 0.0 { &stated } else { &by_rows }, "bias 3").unwrap()
            };
            let soak = made(0).axes[0].fit.as_ref().unwrap().soak.clone().unwrap();
            let cold = &soak.rows[0];
            assert!((cold.temperature_c + 40.0).abs() < 1.0 && soak.hours == [1.0, 2.0, 4.0, 8.0]);
            // Under slow noise a longer soak may add more noise than it averages.
            if walk == 0.0 && correlation_windows == 0.0 {
                assert!(cold.after_dph.is_sorted_by(|a, b| a > b) && cold.after_dph[0] < cold.sigma_dph);
            }
            for (ratios, (hours, forecast)) in
                ratios.iter_mut().zip([(36, cold.after_dph[0]), (144, cold.after_dph[2])])
            {
                let after = made(hours).axes[0].fit.as_ref().unwrap().soak.clone().unwrap();
                ratios.push(after.rows[0].sigma_dph / forecast);
            }
        }
        for (hours, ratios) in [1, 4].into_iter().zip(ratios) {
            let claim = format!("σ of the curve after {hours} h more soak over its forecast, {name}");
            ratio(&claim, &ratios, mean, ["0.94 … 1.06", "0.75 … 1.25"], HOURS);
        }
    }
}

/// Three cycles of one gyro agree; a fourth with another slope is reported by name.
#[test]
fn records_of_one_gyro_agree_and_a_changed_one_is_reported() {
    let unit = |seed: u64| fit(vec![log(300, 0, 1.0, seed)], &by_rows(), "bias 3").unwrap();
    let named = |records: Vec<Calibration>| -> Vec<(String, Calibration)> {
        records.into_iter().enumerate().map(|(i, record)| (format!("{i}.cal.json"), record)).collect()
    };
    let mut stood_out = 0;
    for seed in 0..20 {
        let same = compare(&named((0..3).map(|cycle| unit(10 * seed + cycle)).collect()), None).unwrap();
        let curve = &same.axes[0].curves[0];
        assert_eq!((curve.values.len(), curve.temperatures_c.len()), (3, 12));
        stood_out += u32::from(curve.worst.as_ref().unwrap().sigmas > 3.0);
    }
    // About ten independent comparisons each: three sigma by chance in 3 of 100.
    let claim = "one of three calibrations of an unchanged gyro stands out by three σ in `compare`";
    evidence(claim, f64::from(stood_out) / 20.0, "≤ 0.1", 20);
    let mut changed = unit(7);
    changed.axes[0].correction.terms[0].value += 0.03;
    let apart = compare(&named(vec![unit(5), unit(6), changed]), None).unwrap();
    let curve = &apart.axes[0].curves[0];
    let worst = curve.worst.as_ref().unwrap();
    assert!(worst.record == 2 && worst.sigmas > 4.0, "{worst:?}");
    assert!(curve.beyond[0] > 0.01 && curve.beyond[11] > 0.003, "{:?}", curve.beyond);
}
