//! A day of a gyro's life as fast as this machine goes: 864 million ticks of the image in a file, one call each, with a
//! slow update per second while the temperature swings. Prints ns per tick.
//!
//! `cargo run --release -p sagnac-core --example ticks -- unit.img`

use std::error::Error;
use std::time::Instant;

use sagnac_core::{Compensator, Image, State};

const TICKS: u64 = 864_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("which image?")?;
    let gyro = Compensator::new(Image::decode(&std::fs::read(path)?).map_err(|e| e.to_string())?);
    let mut least = f64::INFINITY;
    for _ in 0..3 {
        let started = Instant::now();
        std::hint::black_box(walk(&gyro).map_err(|e| e.to_string())?);
        least = least.min(started.elapsed().as_secs_f64());
    }
    println!("{:.2} ns per tick", least * 1e9 / TICKS as f64);
    Ok(())
}

/// Counts out of a day at 30 pulses per second.
fn walk(gyro: &Compensator) -> Result<i64, sagnac_core::Misuse> {
    let mut state = State::new();
    let codes = &mut [None; sagnac_core::MAX_INPUTS][..gyro.image().inputs().len()];
    let (mut out, mut phase, mut done) = (0_i64, 0_u32, 0_u64);
    while done < TICKS {
        // 0 … 56 °C and back in two hours, in steps of 1/64 °C.
        let second = done / 10_000 % 7200;
        let swing = if second < 3600 { second } else { 7200 - second };
        codes.fill(Some((swing as i32) << 18));
        gyro.update(&mut state, codes)?;
        let ticks = state.ticks_to_update();
        for _ in 0..ticks {
            phase += 30;
            let raw = i32::from(phase >= 10_000);
            phase -= 10_000 * raw as u32;
            out += i64::from(gyro.tick(&mut state, raw)?.counts);
        }
        done += u64::from(ticks);
    }
    Ok(out)
}
