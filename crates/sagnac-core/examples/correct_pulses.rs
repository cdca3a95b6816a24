//! Loads an image from bytes and corrects one minute of pulses, tick by tick.
//!
//! ```sh
//! cargo run -p sagnac-core --example correct_pulses
//! ```
//!
//! The image is the source paper's curve, 0.85·T² − 46·T + 1043.39 counts per 100 s with T0 = 25 °C. At 20 °C the gyro drifts by
//! 38.75 counts per 100 s. The output is in quanta of 0.25 count: 93 of them in a minute.

use std::error::Error;

use sagnac_core::{Compensator, Image, State, Status};

/// On a target: `include_bytes!("unit.img")`, or `Banks::load` from flash.
const IMAGE: &[u8] = include_bytes!("../../../testdata/image/paper.img");
/// 100 µs.
const TICKS_PER_SECOND: u32 = 10_000;

fn main() -> Result<(), Box<dyn Error>> {
    // Every check is made here. After that the arithmetic cannot overflow.
    let image = Image::decode(IMAGE)?;
    let compensator = Compensator::new(image);
    let mut state = State::new();

    let (mut raw_sum, mut corrected_sum) = (0, 0);
    let mut held_seconds = 0;
    for second in 0..60_u32 {
        for tick in 0..TICKS_PER_SECOND {
            // The image has one input whose code is 2⁻²⁴ °C. For 5 s the thermometer does not answer: the correction is held.
            if state.ticks_to_update() == 0 {
                let code = if (30..35).contains(&second) { None } else { Some(20 << 24) };
                let status = compensator.update(&mut state, &[code])?;
                held_seconds += i32::from(status.contains(Status::HELD));
            }
            // A gyro at 50 counts per second: one pulse every 200 ticks.
            let raw = i32::from(tick % 200 == 0);
            let output = compensator.tick(&mut state, raw)?;
            // Do not use counts that have no correction.
            if output.status.contains(Status::UNCORRECTED) || output.status.contains(Status::OVERFLOW) {
                return Err(format!("second {second}: status {:?}", output.status).into());
            }
            raw_sum += raw;
            corrected_sum += output.counts;
        }
    }

    println!("{raw_sum} counts in, {corrected_sum} counts out, correction held for {held_seconds} s");
    assert_eq!(raw_sum, 3000);
    assert!((raw_sum - corrected_sum - 93).abs() <= 1, "drift of 93 quanta, found {}", raw_sum - corrected_sum);
    assert_eq!(held_seconds, 5);
    Ok(())
}
