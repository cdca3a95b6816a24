//! Both loops: their own code, running on the simulated plant.

use crate::gyros::{ready, run};
use sagnac_sim::{
    ChamberLeg, IntensityStatus, LoopAverages, LoopDesign, LoopModel, LoopName, PathLengthStatus, PlantConditions,
    RunConfig, Scenario,
};

/// Seconds of both loops while the block goes from one temperature to another at a rate.
fn ramp(scenario: &Scenario, from_c: f64, to_c: f64, cpm: f64) -> Vec<LoopAverages> {
    let design = LoopDesign::build(scenario).unwrap();
    let mut state = design.start(1);
    let seconds = ((to_c - from_c).abs() / cpm * 60.0) as u32;
    let step = (to_c - from_c) / f64::from(seconds);
    // Time to ignite and lock at the start temperature.
    for _ in 0..120 {
        design.advance(&mut state, 10_000, &design.conditions([from_c; 2]));
    }
    (0..seconds)
        .map(|s| {
            let t = [f64::from(s), f64::from(s + 1)].map(|s| from_c + step * s);
            design.advance(&mut state, 10_000, &design.conditions(t))
        })
        .collect()
}

fn rms_waves(seconds: &[LoopAverages]) -> f64 {
    let sum: f64 = seconds.iter().map(|s| s.detuning_squares).sum();
    let ticks: u32 = seconds.iter().map(|s| s.valid_ticks).sum();
    (sum / f64::from(ticks)).sqrt()
}

/// −40 … +70 °C at 2 °C/min: within λ/1000 rms of the peak; resets by whole wavelengths, locked again in the stated
/// time: the move, the time to settle, and two periods of the bandwidth for the lock itself.
#[test]
fn the_path_is_held_and_locked_again() {
    let scenario = ready("triangle-28cm-dithered");
    let seconds = ramp(&scenario, -40.0, 70.0, 2.0);
    let rms = rms_waves(&seconds);
    assert!(rms < 1e-3, "{rms} wavelengths rms");
    // 2.43 wavelengths of growth need two resets with this mirror.
    let resets: Vec<&LoopAverages> = seconds.windows(2).filter(|w| w[0].modes != w[1].modes).map(|w| &w[1]).collect();
    assert_eq!(resets.len(), 2);
    let stated_s =
        scenario.path_length.reset_s + scenario.path_length.settle_s + 2.0 / scenario.path_length.bandwidth_hz;
    let invalid: u32 = seconds.iter().map(|s| s.invalid_ticks).sum();
    let each_s = f64::from(invalid) * 1e-4 / 2.0;
    assert!(each_s < stated_s, "{each_s} s for a reset; {stated_s} s stated");
    assert!(!seconds.last().unwrap().path_status.contains(PathLengthStatus::WAS_LOST));
}

/// A heater instead of a mirror: the same bound, and a lock after each reset.
#[test]
fn a_heater_holds_the_path_too() {
    let scenario = ready("prism-heater-loop");
    let seconds = ramp(&scenario, -40.0, 60.0, 2.0);
    let rms = rms_waves(&seconds);
    assert!(rms < 1e-3, "{rms} wavelengths rms");
    // 3.3 wavelengths of growth, 2.4 of range: the move of 20 s, 60 s to settle, and as long again to close in.
    let resets = seconds.windows(2).filter(|w| w[0].modes != w[1].modes).count();
    assert!(resets >= 1, "no reset on the way");
    let invalid: u32 = seconds.iter().map(|s| s.invalid_ticks).sum();
    let each_s = f64::from(invalid) * 1e-4 / resets as f64;
    assert!(each_s < 2.0 * 80.0, "{each_s} s for a reset");
    assert_eq!(seconds.last().unwrap().invalid_ticks, 0);
    let status = seconds.last().unwrap().path_status;
    assert!(!status.contains(PathLengthStatus::WAS_LOST), "{status:?}");
}

/// Losses that grow by 30 % over −40 … +70 °C: the light stays within 0.1 %.
#[test]
fn the_light_is_held() {
    let mut scenario = ready("square-28cm");
    scenario.intensity.loss_growth = 0.3;
    // No resets: during a reset the light is lost on purpose.
    scenario.block.expansion_ppm_per_c = 0.001;
    let seconds = ramp(&scenario, -40.0, 70.0, 2.0);
    let worst = seconds.iter().map(|s| (s.light - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-3, "{worst}");
    let rise = seconds.last().unwrap().current_ma / seconds[0].current_ma;
    // 1.3^(1/0.7)
    assert!((rise / 1.3_f64.powf(1.0 / 0.7) - 1.0).abs() < 0.01, "current rose by {rise}");
    assert_eq!(seconds.last().unwrap().intensity_status, IntensityStatus::OK);
}

/// A current at its upper limit is reported, and so is the low light.
#[test]
fn the_limit_of_the_current_is_reported() {
    let mut scenario = ready("square-28cm");
    scenario.intensity.loss_growth = 1.0;
    // 1.39 mA would hold the light at 70 °C.
    scenario.intensity.high_ma = 1.1;
    scenario.intensity.ignition_ma = 1.05;
    let last = *ramp(&scenario, 0.0, 70.0, 4.0).last().unwrap();
    let expected = IntensityStatus::END_OF_RANGE | IntensityStatus::LOW_INTENSITY;
    assert!(last.intensity_status.contains(expected), "{:?}", last.intensity_status);
}

/// Loss of light: the loops report it, try to ignite, and lock again when the light returns.
#[test]
fn after_the_dark_it_locks_again() {
    let scenario = ready("triangle-28cm-dithered");
    let design = LoopDesign::build(&scenario).unwrap();
    let mut state = design.start(1);
    let mut seconds = |n: u32, dark: bool| {
        let conditions = PlantConditions { thermal_waves: [0.2; 2], dark, ..PlantConditions::default() };
        (0..n).map(|_| design.advance(&mut state, 10_000, &conditions)).last().unwrap()
    };
    assert_eq!(seconds(5, false).invalid_ticks, 0);
    let dark = seconds(3, true);
    assert_eq!(dark.valid_ticks, 0);
    assert!(dark.intensity_status.contains(IntensityStatus::LOW_INTENSITY));
    assert!(dark.path_status.contains(PathLengthStatus::LOW_SIGNAL | PathLengthStatus::INVALID));
    let back = seconds(10, false);
    assert_eq!((back.invalid_ticks, back.intensity_status), (0, IntensityStatus::OK));
    assert_eq!(back.path_status, PathLengthStatus::WAS_LOST, "and remembers it");
}

/// Without light the attempts to ignite end.
#[test]
fn ignition_gives_up() {
    let mut scenario = ready("triangle-28cm-dithered");
    scenario.intensity.ignition_tries = 3.0;
    let design = LoopDesign::build(&scenario).unwrap();
    let mut state = design.start(1);
    let dark = PlantConditions { dark: true, ..PlantConditions::default() };
    let last = (0..40).map(|_| design.advance(&mut state, 10_000, &dark)).last().unwrap();
    assert!(last.intensity_status.contains(IntensityStatus::FAILED | IntensityStatus::LOW_INTENSITY));
    assert_eq!(last.current_ma, 0.0);
}

/// Swept on the running loop: crossover within 2 %, phase margin within 1.5° of the design for mirror and current.
#[test]
fn the_running_loops_are_those_designed() {
    for name in ["triangle-28cm-dithered", "square-28cm", "prism-heater-loop"] {
        let scenario = ready(name);
        let design = LoopDesign::build(&scenario).unwrap();
        let mut sweeps = vec![design.sweep(LoopName::Intensity, scenario.intensity.bandwidth_hz).unwrap()];
        if name != "prism-heater-loop" {
            sweeps.push(design.sweep(LoopName::PathLength, scenario.path_length.bandwidth_hz).unwrap());
        }
        for sweep in sweeps {
            let (crossover, margin) = (sweep.crossover_hz.unwrap(), sweep.phase_margin_deg.unwrap());
            let which = sweep.which.name();
            assert!((crossover / sweep.design_crossover_hz - 1.0).abs() < 0.02, "{name}, {which}: {crossover} Hz");
            assert!((margin - sweep.design_phase_margin_deg).abs() < 1.5, "{name}, {which}: {margin}°");
        }
    }
}

/// A mirror whose lag attenuates the modulation and shifts its phase.
#[test]
fn a_mirror_with_a_lag_is_designed_too() {
    let mut scenario = ready("triangle-28cm-dithered");
    for lag_s in [5e-5, 1e-4, 3e-4] {
        (scenario.path_length.rising_lag_s, scenario.path_length.falling_lag_s) = (lag_s, lag_s);
        let design = LoopDesign::build(&scenario).unwrap();
        let sweep = design.sweep(LoopName::PathLength, scenario.path_length.bandwidth_hz).unwrap();
        let ratio = sweep.crossover_hz.unwrap() / sweep.design_crossover_hz;
        assert!((ratio - 1.0).abs() < 0.03, "{lag_s}: {ratio}");
        assert!((sweep.phase_margin_deg.unwrap() - sweep.design_phase_margin_deg).abs() < 1.5);
    }
}

/// At 16 cm there is a dark stretch between two modes; the loop locks from every starting point.
#[test]
fn a_dark_start_is_searched_through() {
    let mut scenario = ready("triangle-28cm-dithered");
    scenario.geometry.perimeter_m = 0.16;
    let design = LoopDesign::build(&scenario).unwrap();
    for tenth in 0..10 {
        let mut state = design.start(1);
        let thermal = f64::from(tenth) * 0.1;
        let conditions = PlantConditions { thermal_waves: [thermal; 2], ..PlantConditions::default() };
        let seconds: Vec<LoopAverages> = (0..15).map(|_| design.advance(&mut state, 10_000, &conditions)).collect();
        let last = seconds.last().unwrap();
        assert_eq!(last.invalid_ticks, 0, "from {thermal}: {:?} {:?}", last.path_status, last.intensity_status);
        assert!((last.light - 1.0).abs() < 1e-3);
    }
}

/// The lag of a heater is between those of heating and cooling, and so is its crossover.
#[test]
fn a_heaters_crossover_is_between_heating_and_cooling() {
    let scenario = ready("prism-heater-loop");
    let design = LoopDesign::build(&scenario).unwrap();
    let sweep = design.sweep(LoopName::PathLength, scenario.path_length.bandwidth_hz).unwrap();
    let ratio = sweep.crossover_hz.unwrap() / sweep.design_crossover_hz;
    assert!((6.0 / 9.0..1.0).contains(&ratio), "{ratio}");
    let margin = sweep.phase_margin_deg.unwrap();
    let between = design.path_length.slow_margin_deg - 2.0..=sweep.design_phase_margin_deg + 2.0;
    assert!(between.contains(&margin), "{margin}° is not in {between:?}");
}

/// A whole test with running loops and with ideal ones: the same modes to within a reset, the same actuator to 0.2 % of
/// a wavelength, and the same counts apart from noise.
#[test]
fn ideal_loops_replace_the_running_ones() {
    let mut scenario = ready("triangle-28cm-dithered");
    scenario.chamber.start_c = 0.0;
    scenario.chamber.cycles = 1.0;
    scenario.chamber.leg = vec![ChamberLeg::Soak { soak_s: 60.0 }, ChamberLeg::Ramp { to_c: 20.0, rate_cpm: 5.0 }];
    scenario.block.lag_s = 30.0;
    let rows = |loops: LoopModel| {
        let scenario = Scenario { run: RunConfig { loops, ..scenario.run.clone() }, ..scenario.clone() };
        let mut rows = Vec::new();
        run(&scenario, 5, |row, second| rows.push((row.counts, second.loops, row.valid)));
        rows
    };
    let (ideal, running) = (rows(LoopModel::Ideal), rows(LoopModel::Running));
    let both: Vec<_> = ideal.iter().zip(&running).filter(|(a, b)| a.2 && b.2).collect();
    assert!(both.len() > 250, "{} rows", both.len());
    for (a, b) in &both {
        let waves = (a.1.actuator - b.1.actuator) * scenario.path_length.waves_per_unit;
        let off = waves - waves.round();
        assert!(off.abs() < 0.002, "{off} wavelengths between ideal and running");
        assert!((a.1.light - b.1.light).abs() < 1e-3 && (a.1.current_ma / b.1.current_ma - 1.0).abs() < 0.01);
    }
    let counts = |rows: &[(i64, _, _)]| rows.iter().map(|r: &(i64, _, bool)| r.0).sum::<i64>();
    assert!((counts(&ideal) - counts(&running)).abs() <= 2);
}

/// Converters of 14 and 16 bits suffice: their quantization averages out.
#[test]
fn small_converters_hold_the_path() {
    let mut scenario = ready("triangle-28cm-dithered");
    scenario.intensity.photodiode_bits = 14.0;
    scenario.path_length.converter_bits = 16.0;
    let seconds = ramp(&scenario, 0.0, 20.0, 2.0);
    assert_eq!(seconds.last().unwrap().invalid_ticks, 0);
    let rms = rms_waves(&seconds);
    assert!(rms < 1e-3, "{rms} wavelengths rms");
}
