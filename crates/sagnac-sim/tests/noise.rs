//! Noise terms of the scenario are found in the log, at constant temperature; beat and count level agree.
//!
//! Overlapping Allan deviation of counts, by its definition (NIST SP 1065 §5.2.4) on the accumulated angle.

use crate::gyros::{mean_dph, ready, run, walk_deg_rt_h};
use sagnac_sim::{
    BeatModel, BiasConfig, ChamberConfig, ChamberLeg, ERROR_SOURCES, Fidelity, NoiseConfig, RateTableLeg, Scenario,
};

/// A gyro at rest at 25 °C without any error.
fn quiet(hours: f64) -> Scenario {
    let mut scenario = ready("triangle-28cm-dithered");
    scenario.bias = BiasConfig { slope_dph_per_c: 0.0, ..Default::default() };
    scenario.noise = NoiseConfig::default();
    scenario.cavity.backscatter_1_ppm = 0.0;
    scenario.cavity.backscatter_2_ppm = 0.0;
    scenario.chamber =
        ChamberConfig { leg: vec![ChamberLeg::Soak { soak_s: hours * 3600.0 }], ..ChamberConfig::default() };
    scenario.fault.clear();
    scenario
}

/// Angle after each second, arcsec.
fn angle(scenario: &Scenario, seed: u64) -> Vec<f64> {
    let (mut sum, mut out) = (0, vec![0.0]);
    let scale = scenario.arcsec_per_count();
    run(scenario, seed, |row, _| {
        sum += row.counts;
        out.push(sum as f64 * scale);
    });
    out
}

/// Overlapping Allan deviation at m seconds, °/h.
fn oadev(angle: &[f64], m: usize) -> f64 {
    let squares: f64 = angle.windows(2 * m + 1).map(|w| (w[2 * m] - 2.0 * w[m] + w[0]).powi(2)).sum();
    let n = angle.len() - 2 * m;
    (squares / (2.0 * n as f64)).sqrt() / m as f64
}

#[test]
fn angle_random_walk_comes_out() {
    let mut scenario = quiet(300.0);
    scenario.noise.arw_deg_rt_h = 0.003;
    let angle = angle(&scenario, 1);
    // N = 0.18 arcsec/√s; quantization is negligible at 100 s. σ is 0.6 %: 1.5 degrees of freedom per 100 s.
    let n = oadev(&angle, 100) * 10.0 / 60.0;
    assert!((n / 0.003 - 1.0).abs() < 0.02, "{n}");
}

/// Counting only: Q = S/√12, σ(τ) = √3·Q/τ. At one rate the fraction of a count is a sawtooth; over many rates it is
/// white. Mean of 60 rates.
#[test]
fn quantization_comes_out() {
    let mut scenario = quiet(1.0);
    let q = scenario.arcsec_per_count() / 12.0_f64.sqrt();
    for m in [7, 61] {
        let mean_square = (0..60).map(|n| {
            scenario.input.rate_dph = 7.0 + f64::from(n) * 0.618_034;
            (oadev(&angle(&scenario, 1), m) * m as f64).powi(2) / 3.0
        });
        let measured = (mean_square.sum::<f64>() / 60.0).sqrt();
        assert!((measured / q - 1.0).abs() < 0.1, "at {m} s: {measured}, Q {q}");
    }
}

/// Flat at 0.664·B (IEEE Std 952) over three decades, mean of 12 seeds.
#[test]
fn bias_instability_is_flat() {
    let mut scenario = quiet(24.0);
    scenario.noise.bias_instability_dph = 10.0;
    let angles: Vec<Vec<f64>> = (0..12).map(|seed| angle(&scenario, seed)).collect();
    for m in [8, 64, 512, 4096] {
        let mean_square = angles.iter().map(|a| oadev(a, m).powi(2)).sum::<f64>() / 12.0;
        let flat = mean_square.sqrt() / (2.0 * std::f64::consts::LN_2 / std::f64::consts::PI).sqrt() / 10.0;
        assert!((flat - 1.0).abs() < 0.08, "at {m} s: {flat} of B");
    }
}

#[test]
fn rate_random_walk_and_ramp_come_out() {
    let mut scenario = quiet(24.0);
    scenario.noise.rate_random_walk_dph_rt_h = 5.0;
    let mean_square = (0..12).map(|seed| oadev(&angle(&scenario, seed), 1200).powi(2)).sum::<f64>() / 12.0;
    // K·√(τ/3), τ in hours.
    let k = mean_square.sqrt() / (1200.0_f64 / 3600.0 / 3.0).sqrt();
    assert!((k / 5.0 - 1.0).abs() < 0.08, "{k}");
    let mut scenario = quiet(24.0);
    scenario.noise.rate_ramp_dph_h = 0.5;
    let r = oadev(&angle(&scenario, 1), 7200) / (2.0 / 2.0_f64.sqrt());
    assert!((r / 0.5 - 1.0).abs() < 0.002, "{r}");
}

/// One mode more is a scale factor smaller by 1/m: 2.26 ppm at 28 cm (domain notes §4).
#[test]
fn a_mode_change_steps_the_scale_factor() {
    let mut scenario = quiet(1.0);
    scenario.input.table = vec![RateTableLeg { rate_dps: 100.0, for_s: 1e6 }];
    scenario.noise.arw_deg_rt_h = 0.001;
    scenario.block.lag_s = 1.0;
    scenario.chamber.leg = vec![
        ChamberLeg::Soak { soak_s: 2000.0 },
        ChamberLeg::Ramp { to_c: 70.0, rate_cpm: 10.0 },
        ChamberLeg::Soak { soak_s: 2000.0 },
    ];
    scenario.scale_factor.actuator_ppm_per_wave = 0.0;
    let (mut counts, mut rows, mut modes) = ([0_i64; 2], [0_i64; 2], Vec::new());
    run(&scenario, 1, |row, second| {
        let side = usize::from(second.end_s > 2200.0);
        if row.valid && !(2000.0..2400.0).contains(&second.end_s) {
            counts[side] += row.counts;
            rows[side] += 1;
        }
        modes.push(second.loops.mode);
    });
    let steps = modes.last().unwrap() - modes[0];
    assert_eq!(steps, 1, "one reset on the way");
    let rate = |side: usize| counts[side] as f64 / rows[side] as f64;
    let step_ppm = (rate(1) / rate(0) - 1.0) * 1e6;
    // More counts for the same angle.
    assert!((step_ppm - 2.26).abs() < 0.03, "{step_ppm} ppm");
}

/// Mean rate, walk and scale factor of both levels, for three scenarios.
#[test]
fn beat_and_count_level_agree() {
    for name in ["triangle-28cm-dithered", "square-28cm", "prism-heater-loop"] {
        let scenario = ready(name);
        let (count_arw, seconds) = (scenario.arw_deg_rt_h(), 200);
        let beat_arw = walk_deg_rt_h(&scenario, 1, scenario.input_dph(), seconds);
        // The noise of the dither adds half its variance: 0.5 %; σ is 0.8 %.
        assert!((beat_arw / count_arw - 1.0).abs() < 0.035, "{name}: {beat_arw} and {count_arw} °/√h");
        // The count level counts input over S; so does the beat, to four sigma of its walk: 0.1 ppm at the high rate.
        for rate in [scenario.input_dph(), 1_800_000.0] {
            let beat = mean_dph(&scenario, 2, rate, 60.0);
            let sigma = 60.0 * count_arw / 60.0_f64.sqrt();
            assert!((beat - rate).abs() < 4.0 * sigma, "{name} at {rate}: {beat}, σ {sigma}");
        }
    }
}

/// The same through counter, stripper and log: counts of 100 s at both levels.
#[test]
fn stripped_counts_agree_with_the_count_level() {
    let mut scenario = ready("square-28cm");
    scenario.chamber = ChamberConfig { leg: vec![ChamberLeg::Soak { soak_s: 100.0 }], ..ChamberConfig::default() };
    let mut counts = |fidelity: Fidelity, model: BeatModel| {
        scenario.run.fidelity = fidelity;
        scenario.run.beat_model = model;
        let (mut sum, mut worst) = (0, 0);
        run(&scenario, 3, |row, _| {
            sum += row.counts;
            worst = worst.max(row.counts.abs());
        });
        (sum, worst)
    };
    let (count, _) = counts(Fidelity::Count, BeatModel::Adler);
    for model in [BeatModel::Adler, BeatModel::TwoMode] {
        let (beat, worst) = counts(Fidelity::Beat, model);
        // 2281 counts; the walk is 2.3 counts in 100 s, and the last period has not ended.
        assert!((count - beat).abs() < 14, "{model:?}: {beat} and {count}");
        assert!(worst < 40, "a second of {model:?} has {worst} counts: it contains the dither");
    }
}

/// A scale-factor error has the same sign and size at both levels: 80 ppm at 100 °/s.
#[test]
fn the_scale_factor_is_the_same_at_both_levels() {
    let mut scenario = quiet(1.0);
    scenario.chamber.leg = vec![ChamberLeg::Soak { soak_s: 60.0 }];
    scenario.chamber.start_c = 45.0;
    scenario.input.rate_dph = 360_000.0;
    scenario.scale_factor.actuator_ppm_per_wave = -100.0;
    let counts = |fidelity, scenario: &mut Scenario| {
        scenario.run.fidelity = fidelity;
        let (mut sum, mut ppm) = (0, 0.0);
        run(scenario, 1, |row, second| {
            sum += row.counts;
            ppm = second.scale_ppm;
        });
        (sum as f64, ppm)
    };
    let (count, ppm) = counts(Fidelity::Count, &mut scenario);
    let (beat, _) = counts(Fidelity::Beat, &mut scenario);
    let nominal = scenario.input_dph() * 60.0 / scenario.arcsec_per_count();
    assert!(ppm.abs() > 30.0, "{ppm} ppm");
    // The stripper holds back a period: 42 ppm of a minute at most.
    for (level, counts) in [("count", count), ("beat", beat)] {
        let shown = -(counts / nominal - 1.0) * 1e6;
        assert!(shown > ppm - 3.0 && shown < ppm + 45.0, "{level}: {shown} of {ppm} ppm");
    }
}

/// Warm-up, gradient, null shift and lock-in are in the truth with their sign and size.
#[test]
fn every_source_is_in_the_truth() {
    let mut scenario = quiet(1.0);
    scenario.chamber.cold_start = true;
    scenario.bias.warm_up_1_dph = 0.3;
    scenario.bias.warm_up_1_s = 100.0;
    scenario.bias.gradient_dph_per_c = 0.1;
    scenario.cavity.null_shift_dph_per_ma = 2.0;
    scenario.cavity.current_imbalance_ma = -0.25;
    scenario.input.rate_dph = 50.0;
    scenario.cavity.backscatter_1_ppm = 0.02;
    scenario.dither.frequency_hz = 0.0;
    let lock_in = scenario.lock_in_dph();
    assert!((1.0..40.0).contains(&lock_in), "{lock_in}");
    let mut seconds = Vec::new();
    run(&scenario, 1, |_, second| seconds.push(second.clone()));
    let column = |name: &str| ERROR_SOURCES.iter().position(|s| *s == name).unwrap();
    let of = |name: &str, at: usize| seconds[at - 1].errors_dph[column(name)];
    assert!((of("warm_up", 100) / 0.3 - (-1.0_f64).exp()).abs() < 1e-9);
    // The anode starts 2 °C below its steady value and approaches it with 700 s.
    assert!((of("gradient", 700) / (0.1 * -2.0) - (-1.0_f64).exp()).abs() < 0.01);
    assert!((of("null_shift", 5) + 0.5).abs() < 1e-9);
    let rate = seconds[9].input_dph + seconds[9].errors_dph.iter().sum::<f64>() - of("uncounted", 10);
    let counted = (rate * rate - lock_in * lock_in).sqrt();
    assert!((of("uncounted", 10) - (counted - rate)).abs() < 1e-9);
}
