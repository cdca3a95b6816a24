//! Gyros and measurements shared by several tests.

use sagnac_sim::{Beat, LogRow, Scenario, Second};

/// A ready scenario.
pub(crate) fn ready(name: &str) -> Scenario {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let file = folder.join(name).join(format!("{name}.toml"));
    Scenario::from_file(file).unwrap_or_else(|error| panic!("{name}: {error}"))
}

pub(crate) const READY: [&str; 4] = ["paper", "square-28cm", "prism-heater-loop", "triangle-28cm-dithered"];

/// The domain notes' triangle, 2.42 arcsec per fringe and 150 arcsec of dither, with a given lock-in threshold.
pub(crate) fn triangle(lock_in_dph: f64, dither_hz: f64, noise: f64) -> Scenario {
    let mut scenario = ready("triangle-28cm-dithered");
    scenario.geometry.perimeter_m *= scenario.arcsec_per_fringe() / 2.42;
    scenario.dither.frequency_hz = dither_hz;
    scenario.dither.noise = noise;
    let scale = lock_in_dph / scenario.lock_in_dph();
    scenario.cavity.backscatter_1_ppm *= scale;
    scenario.cavity.backscatter_2_ppm *= scale;
    assert!((scenario.lock_in_dph() - lock_in_dph).abs() < 1e-9 * lock_in_dph.max(1.0));
    scenario
}

/// Mean rate in °/h of the true phase over a time, after 0.2 s to settle.
pub(crate) fn mean_dph(scenario: &Scenario, seed: u64, rate_dph: f64, seconds: f64) -> f64 {
    let beat = Beat::build(scenario).unwrap();
    let mut state = beat.start(seed);
    let ticks = |seconds: f64| (seconds * 1e4).round() as u64;
    (0..ticks(0.2)).for_each(|_| {
        beat.tick(&mut state, rate_dph);
    });
    let start = beat.drift_fringes(&state);
    (0..ticks(seconds)).for_each(|_| {
        beat.tick(&mut state, rate_dph);
    });
    (beat.drift_fringes(&state) - start) * scenario.arcsec_per_fringe() / seconds
}

/// Angle random walk in °/√h of the true phase, in increments of 25 ms about the input rate.
pub(crate) fn walk_deg_rt_h(scenario: &Scenario, seed: u64, rate_dph: f64, seconds: u32) -> f64 {
    const PER_SECOND: u32 = 40;
    let beat = Beat::build(scenario).unwrap();
    let mut state = beat.start(seed);
    let mut last = beat.drift_fringes(&state);
    let (mut sum, mut squares) = (0.0, 0.0);
    let n = seconds * PER_SECOND;
    for _ in 0..n {
        (0..10_000 / PER_SECOND).for_each(|_| {
            beat.tick(&mut state, rate_dph);
        });
        let now = beat.drift_fringes(&state);
        let arcsec = (now - last) * scenario.arcsec_per_fringe();
        last = now;
        sum += arcsec;
        squares += arcsec * arcsec;
    }
    let n = f64::from(n);
    let variance = squares / n - (sum / n).powi(2);
    (variance * f64::from(PER_SECOND)).sqrt() / 60.0
}

/// Runs a scenario to its end.
pub(crate) fn run(scenario: &Scenario, seed: u64, mut each: impl FnMut(&LogRow, &Second)) {
    let mut run = scenario.build().unwrap().start(seed);
    run.each_row(|row, second| {
        each(row, second);
        Ok::<(), ()>(())
    })
    .unwrap();
}

/// The same for the first rows only.
pub(crate) fn run_rows(scenario: &Scenario, seed: u64, rows: usize, mut each: impl FnMut(&LogRow, &Second)) {
    let mut so_far = 0;
    // An error of the closure ends the run.
    let _ = scenario.build().unwrap().start(seed).each_row(|row, second| {
        each(row, second);
        so_far += 1;
        if so_far < rows { Ok(()) } else { Err(()) }
    });
    assert!(so_far > 0);
}
