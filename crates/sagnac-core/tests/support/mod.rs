//! Descriptions of images, fixed and random, for the tests of this folder.

use proptest::prelude::*;
use sagnac_core::{
    Description, Gain, Image, InputSpec, Kind, LagSpec, MAX_TURNS_Q18, Multiplier, Shape, Term, ValueSource,
};

/// Span −40 … +70 °C, rate span ±2 °C/min at Δt = 1 s, τ = 300 s, code = 2⁻²⁴ °C.
pub(crate) fn thermometer() -> InputSpec {
    let half = 55_i64 << 24;
    let alpha = 1.0 - (-1.0_f64 / 300.0).exp();
    let rate_hi = (2.0 / 60.0 * 2.0_f64.powi(36)) as i32;
    InputSpec {
        source: ValueSource::Code,
        unit_exponent: 0,
        offset_q24: 0,
        gain: Gain { mantissa: 1 << 30, shift: 30 },
        valid_lo_q24: -(80 << 24),
        valid_hi_q24: 120 << 24,
        span_lo_q24: -(40 << 24),
        span_hi_q24: 70 << 24,
        x_mantissa: ((1_i64 << 61) / half) as u32,
        x_shift: 14,
        lag: LagSpec {
            alpha_mantissa: (alpha * 2.0_f64.powi(39)) as u32,
            alpha_shift: 39,
            rate_shift: 12,
            rate_lo: -rate_hi,
            rate_hi,
            y_mantissa: ((1_u64 << 61) / rate_hi as u64) as u32,
            y_shift: 30,
        },
        stale_after_updates: 10,
        settling_updates: 900,
        largest_step_q8: 0,
        step_growth: 0,
    }
}

pub(crate) fn term(kind: Kind, order: u8, multiplier: Multiplier, mantissa: i32, shift: u8) -> Term {
    Term { kind, input: 0, shape: Shape::Chebyshev(order), multiplier, mantissa, shift }
}

/// An image with one thermometer and these terms.
pub(crate) fn image(terms: &[Term], period_ticks: u32, slew_ticks: u32) -> Image {
    let mut d = Description::empty();
    d.serial[..6].copy_from_slice(b"RLG-01");
    d.period_ticks = period_ticks;
    d.slew_ticks = slew_ticks;
    d.inputs[0] = thermometer();
    d.input_count = 1;
    d.terms[..terms.len()].copy_from_slice(terms);
    d.term_count = u8::try_from(terms.len()).unwrap();
    Image::new(d).unwrap()
}

fn any_shape() -> impl Strategy<Value = Shape> {
    let (knot, turns) = (any::<i16>(), 1..=MAX_TURNS_Q18);
    prop_oneof![
        4 => (0_u8..=8).prop_map(Shape::Chebyshev),
        1 => knot.prop_map(|knot_q15| Shape::Zone { knot_q15 }),
        1 => knot.prop_map(|knot_q15| Shape::Step { knot_q15 }),
        1 => turns.clone().prop_map(|turns_q18| Shape::Cosine { turns_q18 }),
        1 => turns.prop_map(|turns_q18| Shape::Sine { turns_q18 }),
    ]
}

/// Random images whose increments reach 2⁴⁶ LSB and whose k reaches its bound.
pub(crate) fn any_image() -> impl Strategy<Value = Image> {
    any_image_of(1)
}

/// The same with two thermometers, their difference, which is valid to ±127 °C and spans ±20 °C, and any of the three once more
/// behind a lag of 1,500 s, or a warm-up.
pub(crate) fn any_image_of_four() -> impl Strategy<Value = Image> {
    any_image_of(4)
}

fn any_image_of(inputs: u8) -> impl Strategy<Value = Image> {
    let row = |shifts| (any_shape(), 0..inputs, any::<bool>(), -(1 << 30)..(1_i32 << 30), shifts);
    let (bias, scale) = (row(14_u8..40), row(30_u8..50));
    let rows = (prop::collection::vec(bias, 0..6), prop::collection::vec(scale, 0..4));
    (rows, 1_u32..3000, 0_u32..3000, 0_u8..4).prop_filter_map(
        "sums in range",
        move |((bias, scale), period, slew, repeated)| {
            let mut d = Description::empty();
            let own = [thermometer(), thermometer(), difference()];
            let fourth = own.get(usize::from(repeated)).map_or_else(warm_up, |base| repeat(repeated, *base));
            let all = [own[0], own[1], own[2], fourth];
            let used = usize::from(inputs);
            d.inputs[..used].copy_from_slice(&all[..used]);
            d.input_count = inputs;
            d.period_ticks = period;
            d.slew_ticks = slew.min(period);
            let rows = bias.iter().map(|row| (Kind::Bias, row)).chain(scale.iter().map(|row| (Kind::Scale, row)));
            for (slot, (kind, &(shape, input, rate, mantissa, shift))) in d.terms.iter_mut().zip(rows) {
                let multiplier = if rate { Multiplier::Rate } else { Multiplier::One };
                *slot = Term { kind, input, shape, multiplier, mantissa, shift };
                d.term_count += 1;
            }
            Image::new(d).ok()
        },
    )
}

/// Input `of`, which is `base`, once more behind a lag of 1,500 s.
pub(crate) fn repeat(of: u8, base: InputSpec) -> InputSpec {
    let alpha = 1.0 - (-1.0_f64 / 1500.0).exp();
    let lag = LagSpec { alpha_mantissa: (alpha * 2.0_f64.powi(41)) as u32, alpha_shift: 41, ..base.lag };
    InputSpec {
        source: ValueSource::Repeat { of },
        offset_q24: 0,
        gain: Gain::ONE,
        lag,
        settling_updates: 3600,
        ..base
    }
}

/// A warm-up of 1,500 s since power-on; its rate span holds its start with a thousandth to spare.
pub(crate) fn warm_up() -> InputSpec {
    let alpha = 1.0 - (-1.0_f64 / 1500.0).exp();
    let rate_hi = (alpha * 2.0_f64.powi(24 + 16) * 1.001) as i32;
    InputSpec {
        source: ValueSource::WarmUp,
        lag: LagSpec {
            alpha_mantissa: (alpha * 2.0_f64.powi(41)) as u32,
            alpha_shift: 41,
            rate_shift: 16,
            rate_lo: 0,
            rate_hi,
            y_mantissa: ((1_u64 << 60) / rate_hi.cast_unsigned() as u64) as u32,
            y_shift: 29,
        },
        settling_updates: 3600,
        ..InputSpec::UNUSED
    }
}

/// The second of two thermometers minus the first.
pub(crate) fn difference() -> InputSpec {
    InputSpec {
        source: ValueSource::Difference { of: 1, less: 0 },
        gain: Gain::ONE,
        valid_lo_q24: -(127 << 24),
        valid_hi_q24: 127 << 24,
        span_lo_q24: -(20 << 24),
        span_hi_q24: 20 << 24,
        x_mantissa: ((1_i64 << 59) / (20_i64 << 24)) as u32,
        x_shift: 12,
        ..thermometer()
    }
}
