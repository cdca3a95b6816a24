//! `cargo xtask conserve`: over a day of ticks the compensator loses no count.

use anyhow::{Result, bail};
use sagnac_core::{Compensator, Description, Gain, Image, InputSpec, Kind, Multiplier, Shape, State, Term};

/// 1e9 ticks of a gyro at Earth rate with varying temperature: Σ out·2³² + remainder = Σ raw·k − Σ increment, where each
/// side is a separate 128-bit sum, tick by tick.
pub(crate) fn conserve() -> Result<()> {
    const TICKS: u64 = 1_000_000_000;
    let gyro = Compensator::new(swinging_image()?);
    let mut state = State::new();
    let (mut out, mut owed, mut pulses) = (0_i128, 0_i128, 0_u64);
    for tick in 0..TICKS {
        if state.ticks_to_update() == 0 {
            // A triangle between −40 and 70 °C every 2.2 h, in steps of 1/16 °C.
            let second = tick / 10_000 % 7920;
            let sixteenths = if second < 3960 { second } else { 7920 - second } * 1760 / 3960;
            let code = (i32::try_from(sixteenths)? - 640) << 20;
            gyro.update(&mut state, &[Some(code)])?;
        }
        // 4.25 counts per second on average, and a burst now and then.
        pulses += 17 + if tick % 100_003 == 0 { 1_000_000 } else { 0 };
        let raw = i32::try_from(pulses / 40_000)?;
        pulses %= 40_000;
        let output = gyro.tick(&mut state, raw)?;
        out += i128::from(output.counts);
        owed += i128::from(raw) * i128::from(state.k_q32()) - i128::from(state.increment());
    }
    let balance = (out << 32) + i128::from(state.remainder()) - owed;
    if balance != 0 {
        bail!("{balance} of 2^-32 counts lost in {TICKS} ticks");
    }
    println!("conserve: {TICKS} ticks (27.8 h), {out} counts out, remainder {}: nothing lost", state.remainder());
    Ok(())
}

/// Bias, rate and scale terms over −40 … 70 °C.
fn swinging_image() -> Result<Image> {
    let mut d = Description::empty();
    let half = 55_i64 << 24;
    d.inputs[0] = InputSpec {
        gain: Gain { mantissa: 1 << 30, shift: 30 },
        valid_lo_q24: -(80 << 24),
        valid_hi_q24: 120 << 24,
        span_lo_q24: -(40 << 24),
        span_hi_q24: 70 << 24,
        x_mantissa: u32::try_from((1_i64 << 61) / half)?,
        x_shift: 14,
        ..InputSpec::UNUSED
    };
    d.input_count = 1;
    let term = |kind, order, mantissa, shift| Term {
        kind,
        input: 0,
        shape: Shape::Chebyshev(order),
        multiplier: Multiplier::One,
        mantissa,
        shift,
    };
    d.terms[0] = term(Kind::Bias, 1, 987_654_321, 44);
    d.terms[1] = term(Kind::Bias, 3, -765_432_101, 45);
    d.terms[2] = term(Kind::Scale, 2, 555_555_555, 35);
    d.term_count = 3;
    Ok(Image::new(d)?)
}
