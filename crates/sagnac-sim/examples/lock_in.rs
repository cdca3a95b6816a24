//! Lock-in of a gyro without dither: the simulated mean rate against Adler's √(Ω² − Ω_L²).
//!
//! ```sh
//! cargo run -p sagnac-sim --example lock_in
//! ```
//!
//! Inside ±Ω_L the two beams lock and the beat stops. Outside, the mean rate follows the square root. The last column
//! shows the effect of dither: the dead band disappears.

use std::error::Error;

use sagnac_sim::physics::adler_mean_dph;
use sagnac_sim::{Beat, Scenario};

const SCENARIO: &str = "
[geometry]
perimeter_m = 0.28
[cavity]
backscatter_1_ppm = 0.2
backscatter_2_ppm = 0.2
[[thermometer]]
[chamber]
leg = [{ soak_s = 60 }]
";

/// Time of each measurement.
const SECONDS: f64 = 20.0;

/// Mean rate of the beat after 1 s to settle, °/h. A locked beat settles further by less than 0.005 °/h: 0.
fn mean_dph(scenario: &Scenario, rate_dph: f64) -> Result<f64, Box<dyn Error>> {
    const TICKS_PER_S: u32 = 10_000;
    let beat = Beat::build(scenario)?;
    let mut state = beat.start(1);
    for _ in 0..TICKS_PER_S {
        beat.tick(&mut state, rate_dph);
    }
    let before = beat.drift_fringes(&state);
    for _ in 0..SECONDS as u32 * TICKS_PER_S {
        beat.tick(&mut state, rate_dph);
    }
    let mean_dph = (beat.drift_fringes(&state) - before) * scenario.arcsec_per_fringe() / SECONDS;
    Ok(if mean_dph.abs() < 0.005 { 0.0 } else { mean_dph })
}

fn main() -> Result<(), Box<dyn Error>> {
    let still = Scenario::from_toml(SCENARIO)?;
    let mut dithered = still.clone();
    dithered.dither.frequency_hz = 400.0;

    let lock_in_dph = still.lock_in_dph();
    println!("lock-in threshold {lock_in_dph:.1} °/h\n");
    println!("rate, Ω_L   simulated, °/h   √(Ω² − Ω_L²), °/h   with dither, °/h");
    for ratio in [0.2, 0.5, 0.9, 1.1, 1.5, 2.0, 5.0, 20.0] {
        let rate_dph = ratio * lock_in_dph;
        let (mean, law) = (mean_dph(&still, rate_dph)?, adler_mean_dph(rate_dph, lock_in_dph));
        let free = mean_dph(&dithered, rate_dph)?;
        println!("{ratio:9.1}   {mean:14.2}   {law:17.2}   {free:16.2}");
        // The mean is over 20 s, not over whole periods of the beat: up to a fringe is missing or too many.
        let fringe_dph = still.arcsec_per_fringe() / SECONDS;
        assert!((mean - law).abs() < fringe_dph, "at {rate_dph} °/h: {mean}, closed form {law}");
        // The random walk of the dither leaves 0.03 °/h over 20 s.
        assert!((free - rate_dph).abs() < 0.2, "at {rate_dph} °/h with dither: {free}");
    }
    Ok(())
}
