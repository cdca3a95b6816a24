//! Laws of the ring laser that the beat must obey, each with its source. Tolerances are at least twice the deviation
//! measured with these seeds.

use crate::gyros::{mean_dph, triangle, walk_deg_rt_h};
use sagnac_loops::{Counting, Quadrature, QuadratureState};
use sagnac_sim::physics::{adler_mean_dph, dithered_arw_deg_rt_h};
use sagnac_sim::{Beat, BeatModel, CountsPerFringe, RingShape, Scenario};

/// Without dither.
fn still(lock_in_dph: f64, model: BeatModel) -> Scenario {
    let mut scenario = triangle(lock_in_dph, 400.0, 0.0);
    scenario.dither.frequency_hz = 0.0;
    scenario.run.beat_model = model;
    scenario
}

/// The source paper: a circle of 10 cm, 10 °/h, 0.6333 µm: Δν = 4AΩ/(λL) = 15.31 Hz.
#[test]
fn the_papers_beat() {
    let mut scenario = still(0.0, BeatModel::Adler);
    scenario.geometry.shape = RingShape::Circle;
    scenario.geometry.perimeter_m = std::f64::consts::TAU * 0.1;
    scenario.geometry.wavelength_um = 0.6333;
    scenario.readout.counting = CountsPerFringe::X1;
    let beat = Beat::build(&scenario).unwrap();
    let mut state = beat.start(1);
    let counts: i64 = (0..1_000_000).map(|_| i64::from(beat.tick(&mut state, 10.0).raw)).sum();
    // 1531.07 in 100 s.
    assert_eq!(counts, 1531);
}

/// Adler (1946), Aronowitz: √(Ω² − Ω_L²) outside the dead band, 0 inside; both forms of the equations.
#[test]
fn adlers_mean_rate_and_the_dead_band() {
    for (model, tolerance) in [(BeatModel::Adler, 2e-4), (BeatModel::TwoMode, 5e-3)] {
        let scenario = still(200.0, model);
        for rate in [-1000.0, -210.0, 205.0, 250.0, 400.0, 3000.0] {
            let mean = mean_dph(&scenario, 1, rate, 20.0);
            let wanted = adler_mean_dph(rate, 200.0);
            assert!((mean - wanted).abs() < tolerance * 200.0, "{model:?} at {rate}: {mean}, Adler {wanted}");
        }
        for rate in [-195.0, -10.0, 0.0, 190.0] {
            let mean = mean_dph(&scenario, 1, rate, 20.0);
            assert!(mean.abs() < 0.01, "{model:?} at {rate} is locked: {mean}");
        }
    }
}

/// Scale-factor error −½(Ω_L/Ω)² of a gyro far from lock-in: held to 1 % of itself.
#[test]
fn scale_factor_error_far_from_lock_in() {
    let scenario = still(300.0, BeatModel::Adler);
    for ratio in [20.0, 40.0, 80.0] {
        let rate = 300.0 * ratio;
        let mean = mean_dph(&scenario, 1, rate, 200.0);
        let error = mean / rate - 1.0;
        let wanted = -0.5 / (ratio * ratio);
        assert!((error / wanted - 1.0).abs() < 0.01, "at {ratio} Ω_L: {error:e}, law {wanted:e}");
    }
}

/// Domain notes §4: ARW = Ω_L/√(KΩ_D), 0.00505 °/√h at 300 °/h, 2.42 arcsec, 400 Hz, 150 arcsec.
#[test]
fn dither_makes_a_walk_of_lock_in() {
    let law = dithered_arw_deg_rt_h(300.0, 2.42, 400.0, 150.0);
    assert!((law - 0.00505).abs() < 1e-5);
    let arw = walk_deg_rt_h(&triangle(300.0, 400.0, 0.05), 1, 4.5, 300);
    assert!((arw / law - 1.0).abs() < 0.05, "{arw}, law {law}");
}

/// Its scaling: with Ω_L, and with the inverse root of the dither frequency. Standard error 1.1 % each.
#[test]
fn the_walk_scales_with_lock_in_and_frequency() {
    for (lock_in, hz) in [(75.0, 400.0), (600.0, 400.0), (300.0, 300.0), (300.0, 600.0)] {
        let arw = walk_deg_rt_h(&triangle(lock_in, hz, 0.1), 2, 4.5, 100);
        let law = dithered_arw_deg_rt_h(lock_in, 2.42, hz, 150.0);
        assert!((arw / law - 1.0).abs() < 0.05, "{lock_in} °/h, {hz} Hz: {arw}, law {law}");
    }
}

/// Domain notes: 20 % amplitude noise raises the walk by 1.5 to 3 % (⟨1/A⟩ is 1 + σ² to second order).
#[test]
fn amplitude_noise_raises_the_walk() {
    let walk = |noise: f64| walk_deg_rt_h(&triangle(300.0, 400.0, noise), 3, 4.5, 2000);
    let (low, high) = std::thread::scope(|s| {
        let low = s.spawn(|| walk(0.03));
        (walk(0.2), low.join())
    });
    let raised = low / high.unwrap() - 1.0;
    assert!((0.015..0.03).contains(&raised), "{raised}");
}

/// Pure sine dither: within Ω_L·|J_n(Kθ)| of n·f_D fringes per second the mean is exactly n·f_D. The Bessel function
/// is that of libm.
#[test]
fn dynamic_lock_in_zones_come_with_pure_sine_and_go_with_noise() {
    let scenario = triangle(300.0, 400.0, 0.0);
    let k = std::f64::consts::TAU / scenario.arcsec_per_fringe();
    for n in [0, 1, 2] {
        let middle = f64::from(n) * 400.0 * scenario.arcsec_per_fringe();
        let half = 300.0 * libm::jn(n, k * 150.0).abs();
        assert!(half > 1.0, "zone {n} is {half} wide");
        let mean = |rate: f64, scenario: &Scenario| mean_dph(scenario, 1, rate, 40.0);
        let inside = mean(middle + 0.8 * half, &scenario);
        assert!((inside - middle).abs() < 0.1, "zone {n}: {inside} is not {middle}");
        let outside = mean(middle + 1.5 * half, &scenario);
        let free = half * (1.5_f64 * 1.5 - 1.0).sqrt();
        assert!((outside - middle - free).abs() < 0.1 * half, "zone {n}: {outside} is not {middle} + {free}");
        // With noise only the walk remains: 0.3 °/h σ over 40 s would be 0.005 °/√h.
        let noisy = mean(middle + 0.8 * half, &triangle(300.0, 400.0, 0.2));
        assert!((noisy - middle - 0.8 * half).abs() < 0.5, "zone {n} with noise: {noisy}");
    }
}

/// The two-mode form gives the same walk: its lock-in is that of the same backscatter.
#[test]
fn both_forms_walk_alike() {
    let mut scenario = triangle(300.0, 400.0, 0.1);
    let adler = walk_deg_rt_h(&scenario, 4, 4.5, 60);
    scenario.run.beat_model = BeatModel::TwoMode;
    let two = walk_deg_rt_h(&scenario, 4, 4.5, 60);
    assert!((two / adler - 1.0).abs() < 0.01, "{two} and {adler}");
}

/// The counter of the beat is the quadrature counter of `sagnac-loops`, fed with the comparators of the same phase.
#[test]
fn counting_is_that_of_the_target() {
    let mut scenario = still(100.0, BeatModel::Adler);
    scenario.readout.phase_error_deg = 20.0;
    for (counting, of_target) in
        [(CountsPerFringe::X1, Counting::X1), (CountsPerFringe::X2, Counting::X2), (CountsPerFringe::X4, Counting::X4)]
    {
        scenario.readout.counting = counting;
        let beat = Beat::build(&scenario).unwrap();
        let mut light = beat.start(1);
        let counter = Quadrature { counting: of_target };
        let mut state = QuadratureState::default();
        let second_edge = 0.25 + 20.0 / 360.0;
        let mut levels = |phase: f64| {
            let within = phase - phase.floor();
            // A rises at 0 and falls at ½; B follows a quarter later.
            let (a, b) = (within < 0.5, (second_edge..second_edge + 0.5).contains(&within));
            i64::from(counter.update(&mut state, a, b))
        };
        levels(beat.phase_fringes(&light));
        let (mut ours, mut theirs) = (0, 0);
        for tick in 0..400_000 {
            // Slowly forth and back, so that every state of the comparators is seen.
            let rate = 2000.0 * libm::sin(f64::from(tick) * 3e-5);
            ours += i64::from(beat.tick(&mut light, rate).raw);
            theirs += levels(beat.phase_fringes(&light));
            assert!((ours - theirs).abs() <= 1, "{counting:?} at tick {tick}: {ours} and {theirs}");
        }
        assert_eq!(state.lost, 0);
        assert!(ours.abs() > 10, "{counting:?} counted {ours}");
    }
}
