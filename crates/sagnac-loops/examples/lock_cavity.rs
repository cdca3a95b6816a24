//! Designs the path-length loop from SI units and locks a simulated cavity to the peak of its gain.
//!
//! ```sh
//! cargo run -p sagnac-loops --example lock_cavity
//! ```
//!
//! The piezo of a mirror moves the path by 3.6 wavelengths over ±150 V. The cavity drifts by 0.2 wavelengths per
//! second, so the loop has to follow and, near the end of the range, to make a mode reset.

use std::error::Error;

use sagnac_loops::{LoopGoal, PathLengthConfig, PathLengthStatus};

const CODES_PER_VOLT: f64 = 870.0;
const WAVES_PER_VOLT: f64 = 0.012;
const PEAK_CODE: f64 = 1_000_000.0;
const CURVATURE: f64 = 3.0;
const DRIFT_WAVES_PER_S: f64 = 0.2;
const TICK_S: f64 = 1e-4;

fn main() -> Result<(), Box<dyn Error>> {
    let config = PathLengthConfig {
        tick_s: TICK_S,
        modulation_hz: 1250.0,
        modulation_waves: 0.01,
        separate_modulator: false,
        answer_ticks: 0,
        range: [-150.0, 150.0],
        waves_per_unit: WAVES_PER_VOLT,
        codes_per_unit: CODES_PER_VOLT,
        lag_s: [0.0; 2],
        peak_code: PEAK_CODE,
        curvature: CURVATURE,
        noise: 1e-4,
        goal: LoopGoal { bandwidth_hz: 10.0, phase_margin_deg: 60.0 },
        reset_margin_waves: 0.2,
        reset_s: 0.01,
        settle_s: 0.01,
        sweep_s: 0.5,
        lock_waves: 0.005,
    };
    let design = config.build()?;
    println!("kp {:.4}, ki {:.6}, phase margin {:.1}°", design.pi.kp, design.pi.ki, design.pi.phase_margin_deg);

    // What runs on the target: a table of integers and a state.
    let path_length = design.integers;
    let mut state = path_length.start();
    let (mut actuator, mut modulation) = (state.held(), 0);
    let (mut locked_ticks, mut worst_waves) = (0_u32, 0.0_f64);
    for tick in 0..100_000_u32 {
        let time_s = f64::from(tick) * TICK_S;
        let output = path_length.tick(&mut state, light_code(time_s, actuator + modulation));
        (actuator, modulation) = (output.actuator, output.modulation);
        // The counts of a tick are valid only with a status of zero.
        if output.status == PathLengthStatus::OK {
            locked_ticks += 1;
            worst_waves = worst_waves.max(error_waves(time_s, actuator).abs());
        }
    }

    println!(
        "locked for {:.2} of 10 s, error at most {worst_waves:.4} wavelengths, mode resets by {} wavelengths",
        f64::from(locked_ticks) * TICK_S,
        state.modes()
    );
    assert!(locked_ticks > 85_000);
    assert!(worst_waves < 0.03);
    assert!(state.modes() != 0, "2 wavelengths of drift need a mode reset");
    assert!(!state.status().contains(PathLengthStatus::WAS_LOST));
    Ok(())
}

/// Distance from the nearest peak, wavelengths.
fn error_waves(time_s: f64, code: i32) -> f64 {
    let waves = f64::from(code) / CODES_PER_VOLT * WAVES_PER_VOLT + 0.3 + DRIFT_WAVES_PER_S * time_s;
    waves - waves.round()
}

/// The photodiode: I = I₀(1 − c·x²), dark far from a peak.
fn light_code(time_s: f64, code: i32) -> i32 {
    let x = error_waves(time_s, code);
    (PEAK_CODE * (1.0 - CURVATURE * x * x).max(0.0)) as i32
}
