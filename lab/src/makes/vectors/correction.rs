//! Vectors of the correction: terms, inputs, lags, edges.

use anyhow::Result;
use sagnac_core::{Description, Gain, InputSpec, Kind, LagSpec, MAX_RAW, Multiplier, Shape, Term, ValueSource};
use sagnac_vectors::Module;

use crate::makes::making::{Making, image_bytes};

/// Codes of 2^-24 °C, a lag of 32 updates, a rate span of ±0.25 °C an update.
fn thermometer(span_c: [i32; 2]) -> Result<InputSpec> {
    let half = i64::from(span_c[1] - span_c[0]) << 23;
    let bits = 63 - half.leading_zeros();
    let x_shift = bits - 15;
    Ok(InputSpec {
        gain: Gain { mantissa: 1 << 30, shift: 30 },
        valid_lo_q24: -(80 << 24),
        valid_hi_q24: 120 << 24,
        span_lo_q24: span_c[0] << 24,
        span_hi_q24: span_c[1] << 24,
        x_mantissa: u32::try_from((1_i64 << (47 + x_shift)) / half)?,
        x_shift: u8::try_from(x_shift)?,
        lag: LagSpec {
            alpha_mantissa: 0x6000_0123,
            alpha_shift: 36,
            rate_shift: 8,
            rate_lo: -(1 << 30),
            rate_hi: 1 << 30,
            y_mantissa: 1 << 31,
            y_shift: 30,
        },
        stale_after_updates: 20,
        settling_updates: 96,
        ..InputSpec::UNUSED
    })
}

fn series(kind: Kind, input: u8, order: u8, multiplier: Multiplier, mantissa: i32, shift: u8) -> Term {
    Term { kind, input, shape: Shape::Chebyshev(order), multiplier, mantissa, shift }
}

fn terms(d: &mut Description, terms: &[(Kind, u8, u8, Multiplier, i32, u8)]) {
    for (slot, &(kind, input, order, multiplier, mantissa, shift)) in d.terms.iter_mut().zip(terms) {
        *slot = series(kind, input, order, multiplier, mantissa, shift);
    }
    d.term_count = terms.len() as u8;
}

/// Bias 5, rate 1, scale 2 through a whole profile: a million ticks.
pub(super) fn compensator_full() -> Result<Making> {
    use Kind::{Bias, Scale};
    use Multiplier::{One, Rate};
    let mut d = Description { period_ticks: 1000, ..Description::empty() };
    d.serial[..4].copy_from_slice(b"FULL");
    (d.inputs[0], d.input_count) = (thermometer([-35, 65])?, 1);
    terms(
        &mut d,
        &[
            (Bias, 0, 0, One, 558_484_714, 33),
            (Bias, 0, 1, One, -657_166_594, 34),
            (Bias, 0, 2, One, 621_868_304, 33),
            (Bias, 0, 3, One, -987_654_321, 36),
            (Bias, 0, 4, One, 1_012_345_679, 38),
            (Bias, 0, 5, One, 700_000_001, 39),
            (Bias, 0, 0, Rate, -1_050_505_051, 33),
            (Bias, 0, 1, Rate, 888_888_883, 35),
            (Scale, 0, 0, One, 611_953_011, 40),
            (Scale, 0, 1, One, -1_060_000_007, 41),
            (Scale, 0, 2, One, 777_777_777, 42),
        ],
    );
    let about = "compensator: bias 5, rate 1, scale 2, a million ticks over -40 ... 70 degC and back";
    let mut making = Making::new(Module::Compensator, image_bytes(d)?, about)?;
    for update in 0..1000_u32 {
        // Soak, up by 0.25 degC an update, soak, down; a little noise; now and then no sample.
        let quarters = i32::try_from(update.clamp(40, 480) - 40)? - i32::try_from(update.clamp(540, 980) - 540)?;
        let wobble = (update.wrapping_mul(2_654_435_761) >> 14) as i32 - (1 << 17);
        let code = (-40 << 24) + quarters * (1 << 22) + wobble;
        let present = u32::from(update % 97 != 96);
        making.step(1, &[present, code as u32])?;
        making.step(2, &[1000, update * 7919 + 1, 37, 5])?;
    }
    Ok(making)
}

/// Two thermometers, their difference with a lag of its own, a voltage; zones and steps of bias and scale, with and
/// without the rate.
pub(super) fn compensator_inputs() -> Result<Making> {
    use Kind::{Bias, Scale};
    use Multiplier::{One, Rate};
    let mut d = Description { period_ticks: 200, slew_ticks: 50, ..Description::empty() };
    d.serial[..6].copy_from_slice(b"INPUTS");
    let difference = InputSpec {
        source: ValueSource::Difference { of: 1, less: 0 },
        gain: sagnac_core::Gain::ONE,
        valid_lo_q24: -(40 << 24),
        valid_hi_q24: 40 << 24,
        lag: LagSpec { alpha_mantissa: 0x4abc_def1, alpha_shift: 33, ..thermometer([-35, 65])?.lag },
        stale_after_updates: 5,
        ..thermometer([-6, 11])?
    };
    let voltage = InputSpec {
        unit_exponent: 1,
        gain: sagnac_core::Gain { mantissa: 1_333_333_333, shift: 24 },
        lag: LagSpec::default(),
        settling_updates: 0,
        ..thermometer([-45, 45])?
    };
    d.inputs = [thermometer([-35, 65])?, thermometer([-30, 60])?, difference, voltage];
    d.input_count = 4;
    let piece =
        |kind, input, shape, multiplier, mantissa, shift| Term { kind, input, shape, multiplier, mantissa, shift };
    let (zone, step) = (|knot_q15| Shape::Zone { knot_q15 }, |knot_q15| Shape::Step { knot_q15 });
    let all = [
        series(Bias, 0, 0, One, -558_484_714, 33),
        series(Bias, 0, 2, One, 621_868_304, 33),
        series(Bias, 0, 0, Rate, 1_012_345_679, 34),
        piece(Bias, 0, zone(-10_923), One, -1_000_000_007, 32),
        piece(Bias, 0, zone(10_922), One, 1_073_741_789, 31),
        piece(Bias, 0, zone(-30_000), One, 777_777_777, 34),
        piece(Bias, 0, zone(32_000), Rate, -888_888_883, 30),
        piece(Bias, 1, zone(i16::MIN), One, 600_000_001, 36),
        piece(Bias, 1, step(i16::MIN), One, 500_000_003, 37),
        series(Bias, 1, 1, One, 987_654_321, 36),
        series(Bias, 2, 1, One, -700_000_001, 34),
        series(Bias, 2, 1, Rate, 650_000_011, 35),
        series(Bias, 3, 1, One, 536_870_909, 35),
        piece(Bias, 3, step(-16_384), One, -1_060_000_007, 34),
        piece(Bias, 3, step(0), One, 900_000_001, 33),
        piece(Scale, 3, step(16_384), One, 611_953_011, 41),
        piece(Scale, 2, zone(-1), Rate, -1_050_505_051, 38),
        series(Scale, 3, 1, One, 800_000_011, 42),
    ];
    d.terms[..all.len()].copy_from_slice(&all);
    d.term_count = all.len() as u8;
    let about =
        "compensator: two thermometers, their difference, a voltage; zones and steps, missing and absurd samples";
    let mut making = Making::new(Module::Compensator, image_bytes(d)?, about)?;
    let mut seen = vec![[false; 2]; all.len()];
    for update in 0..1000_u32 {
        let dice = update.wrapping_mul(2_654_435_761) >> 8;
        let up = i64::from(update.min(1000 - update));
        // -43 ... 72 degC and back, beyond both ends of the span; the second lags by up to 12 degC and turns later; the
        // voltage runs through its span and falls back.
        let first = (-43_i64 << 24) + (up * (115 << 24)) / 500 + i64::from(dice % (1 << 18));
        let second = first + ((i64::from(update % 400) - 200) << 20) + i64::from((dice >> 3) % (1 << 17));
        let volts = (i64::from(update % 140) - 70) * 144_000 + i64::from(dice % 4_000);
        let mut present = 0b1011 | (dice & 4);
        if dice % 53 == 0 {
            present &= dice >> 7;
        }
        let absurd = if dice % 71 == 0 { i32::MAX } else { i32::try_from(second)? };
        let codes = [i32::try_from(first)?, absurd, dice as i32, i32::try_from(volts)?];
        making.step(1, &[present, codes[0] as u32, codes[1] as u32, codes[2] as u32, codes[3] as u32])?;
        making.step(2, &[200, update * 7919 + 1, 21, 4])?;
        if update % 250 == 249 {
            making.step(5, &[])?;
        }
        let shown = [first, second, second - first, codes[3].into()];
        for (seen, term) in seen.iter_mut().zip(&all).filter(|_| present & 0b1011 == 0b1011) {
            seen[usize::from(is_above(
                &d.inputs[usize::from(term.input)],
                term.shape,
                shown[usize::from(term.input)],
            ))] = true;
        }
    }
    // Each zone and step has been on both sides of its knot.
    let lowest = |shape| matches!(shape, Shape::Zone { knot_q15: i16::MIN } | Shape::Step { knot_q15: i16::MIN });
    for (term, seen) in all.iter().zip(&seen).filter(|(term, _)| !lowest(term.shape)) {
        anyhow::ensure!(
            term.shape.order().is_some() || *seen == [true; 2],
            "{term:?} stays on one side of its knot: {seen:?}"
        );
    }
    Ok(making)
}

/// Two lags of a thermometer and of a difference: the repeats have no code, and are missing with what they repeat. The lags of a
/// repeat reach from the shortest, a whole step, to 1,024 updates.
pub(super) fn compensator_lags() -> Result<Making> {
    use Kind::{Bias, Scale};
    use Multiplier::{One, Rate};
    let mut d = Description { period_ticks: 50, slew_ticks: 9, ..Description::empty() };
    d.serial[..4].copy_from_slice(b"LAGS");
    // The ramp moves by 0.45 °C an update; while there is no value the reach grows by 0.25 °C.
    let first = InputSpec { largest_step_q8: 128, step_growth: 15, ..thermometer([-35, 65])? };
    let second = InputSpec {
        offset_q24: -(2 << 24),
        gain: Gain { mantissa: 1_234_567_891, shift: 22 },
        // Its steps are not held open.
        largest_step_q8: 256,
        ..thermometer([-30, 60])?
    };
    let repeat = |of: u8, lag: LagSpec, base: InputSpec| InputSpec {
        source: ValueSource::Repeat { of },
        offset_q24: 0,
        gain: Gain::ONE,
        lag,
        settling_updates: 3 * base.settling_updates,
        largest_step_q8: 0,
        step_growth: 0,
        ..base
    };
    let slow = LagSpec { alpha_mantissa: 0x7ffe_0005, alpha_shift: 41, rate_shift: 13, ..first.lag };
    let at_once = LagSpec { alpha_mantissa: 1 << 31, alpha_shift: 31, rate_shift: 3, ..first.lag };
    d.inputs = [first, repeat(0, slow, first), second, repeat(2, at_once, second)];
    d.input_count = 4;
    terms(
        &mut d,
        &[
            (Bias, 0, 0, One, -558_484_714, 33),
            (Bias, 0, 3, One, 621_868_304, 33),
            (Bias, 0, 0, Rate, 1_012_345_679, 34),
            (Bias, 0, 1, Rate, -987_654_321, 35),
            (Bias, 1, 0, Rate, -1_050_505_051, 33),
            (Bias, 1, 1, Rate, 888_888_883, 34),
            (Bias, 2, 1, One, 700_000_001, 36),
            (Bias, 2, 0, Rate, 650_000_011, 35),
            (Bias, 3, 2, Rate, -1_060_000_007, 34),
            (Scale, 1, 0, Rate, 611_953_011, 41),
            (Scale, 3, 1, One, 777_777_777, 42),
        ],
    );
    let about = "compensator: two thermometers, each once more behind a second lag; spikes, steps that stay, missing, absurd and stale samples";
    let mut making = Making::new(Module::Compensator, image_bytes(d)?, about)?;
    for update in 0..1500_u32 {
        let dice = update.wrapping_mul(2_654_435_761) >> 8;
        // -43 ... 72 degC and back, with soaks in which the slow lag alone still moves.
        let up = i64::from((update % 750).min(750 - update % 750).clamp(60, 315)) - 60;
        let warm = (-43_i64 << 24) + (up * (115 << 24)) / 255 + i64::from(dice % (1 << 16));
        // In codes of its own gain, 294 to the degree.
        let second = up * 33_000 / 255 - 10_000 + i64::from(dice >> 4 & 15);
        let mut present = 0b0101 | (dice & 0b1010);
        if dice % 53 == 0 || (400..440).contains(&update) {
            present &= dice >> 7;
        }
        // Spikes of one update and of two, and from the middle on another level; absurd codes.
        let spike = if dice % 67 < 2 || update % 97 < 2 { 15 << 24 } else { 0 };
        let level = if update >= 800 { 3 << 24 } else { 0 };
        let absurd = if dice % 71 == 0 { i32::MAX } else { i32::try_from(warm + spike + level)? };
        let codes = [absurd, dice as i32, i32::try_from(second)?, -(dice as i32)];
        making.step(1, &[present, codes[0] as u32, codes[1] as u32, codes[2] as u32, codes[3] as u32])?;
        making.step(2, &[50, update * 7919 + 1, 21, 4])?;
        if update % 400 == 399 {
            making.step(5, &[])?;
        }
    }
    open_steps(&mut making)?;
    Ok(making)
}

/// From power-on: steps of the first thermometer that stay open, each from an update on, 10⁻³ °C: away and back; away, partly back but out of reach, farther,
/// back; away, and back behind missing samples; a jump within reach behind others; away for longer than the lag settles. The second steps for good.
fn open_steps(making: &mut Making) -> Result<()> {
    const STEPS: [(u32, i64); 11] = [
        (0, 20_000),
        (40, 23_000),
        (90, 20_200),
        (130, 40_000),
        (136, 28_000),
        (150, 60_000),
        (200, 20_300),
        (230, 26_000),
        (281, 20_400),
        (331, 24_000),
        (400, 30_000),
    ];
    making.step(0, &[])?;
    for update in 0..800_u32 {
        let milli = STEPS.iter().rev().find(|(from, _)| *from <= update).map_or(0, |(_, milli)| *milli);
        let missing = (250..281).contains(&update) || (300..331).contains(&update);
        let second = 3_000 + if update < 400 { 0 } else { 300_000 };
        let present = if missing { 0b0100 } else { 0b0101 };
        making.step(1, &[present, i32::try_from((milli << 24) / 1000)? as u32, 0, second, 0])?;
        making.step(2, &[50, update * 104_729 + 1, 21, 4])?;
    }
    Ok(())
}

/// A warm-up next to a thermometer and a repeat of it: from power-on, over many updates without a sample, and after a change of the
/// image, when it is over.
pub(super) fn compensator_warm_up() -> Result<Making> {
    use Kind::{Bias, Scale};
    use Multiplier::{One, Rate};
    let mut d = Description { period_ticks: 50, slew_ticks: 9, ..Description::empty() };
    d.serial[..7].copy_from_slice(b"WARM-UP");
    let first = thermometer([-35, 65])?;
    let again = InputSpec {
        source: ValueSource::Repeat { of: 0 },
        offset_q24: 0,
        gain: Gain::ONE,
        lag: LagSpec { alpha_mantissa: 0x7ffe_0005, alpha_shift: 41, rate_shift: 13, ..first.lag },
        ..first
    };
    // α = 1/256 and its tenth part: the rate begins at α·2²⁴·2^rate_shift, its span is wider by a 64th.
    let warm = |alpha_mantissa: u32, alpha_shift: u8, rate_hi: i32, settling_updates| InputSpec {
        source: ValueSource::WarmUp,
        lag: LagSpec {
            alpha_mantissa,
            alpha_shift,
            rate_shift: 12,
            rate_lo: 0,
            rate_hi,
            y_mantissa: ((1_u64 << (32 + rate_hi.ilog2())) / u64::from(rate_hi.unsigned_abs())) as u32,
            y_shift: rate_hi.ilog2() as u8 + 1,
        },
        settling_updates,
        ..InputSpec::UNUSED
    };
    let fast = warm(1 << 30, 38, (1 << 28) + (1 << 22), 40);
    let slow = warm(0x6666_6666, 42, 0x0199_9999 + (1 << 20), 0);
    d.inputs = [fast, first, again, slow];
    d.inputs[2].source = ValueSource::Repeat { of: 1 };
    d.input_count = 4;
    terms(
        &mut d,
        &[
            (Bias, 0, 0, Rate, 987_654_321, 33),
            (Bias, 1, 0, One, -558_484_714, 33),
            (Bias, 1, 2, One, 621_868_304, 34),
            (Bias, 2, 0, Rate, -1_050_505_051, 33),
            (Bias, 3, 0, Rate, -900_000_001, 34),
            (Scale, 3, 0, Rate, 777_777_777, 41),
        ],
    );
    let about =
        "compensator: two warm-ups next to a thermometer and its repeat, from power-on and after a change of the image";
    let mut making = Making::new(Module::Compensator, image_bytes(d)?, about)?;
    for update in 0..1000_u32 {
        let dice = update.wrapping_mul(2_654_435_761) >> 8;
        let up = i64::from(update.min(1000 - update));
        let warm = (-30_i64 << 24) + (up * (90 << 24)) / 500 + i64::from(dice % (1 << 16));
        // A warm-up's own code and bit mean nothing.
        let present =
            if dice % 37 == 0 || (300..330).contains(&update) { dice >> 9 & 0b1001 } else { 0b0010 | dice & 0b1001 };
        making.step(1, &[present, dice, i32::try_from(warm)? as u32, 0, !dice])?;
        making.step(2, &[50, update * 7919 + 1, 21, 4])?;
        if update == 599 || update == 799 {
            making.step(5, &[])?;
        }
    }
    Ok(making)
}

/// Cosines and sines from a part of a turn to nearly 64 turns, of bias and scale, with and without the rate, on two thermometers;
/// x from beyond one end of the span to beyond the other, both ends themselves, and back.
pub(super) fn compensator_harmonic() -> Result<Making> {
    use Kind::{Bias, Scale};
    use Multiplier::{One, Rate};
    let mut d = Description { period_ticks: 100, slew_ticks: 20, ..Description::empty() };
    d.serial[..8].copy_from_slice(b"HARMONIC");
    (d.inputs[0], d.inputs[1]) = (thermometer([-35, 65])?, thermometer([-20, 50])?);
    d.input_count = 2;
    let wave =
        |kind, input, shape, multiplier, mantissa, shift| Term { kind, input, shape, multiplier, mantissa, shift };
    let cosine = |turns_q18| Shape::Cosine { turns_q18 };
    let sine = |turns_q18| Shape::Sine { turns_q18 };
    let all = [
        series(Bias, 0, 0, One, -558_484_714, 33),
        series(Bias, 0, 3, One, 621_868_304, 33),
        series(Bias, 0, 0, Rate, 1_012_345_679, 34),
        wave(Bias, 0, cosine(3 << 18), One, -1_000_000_007, 32),
        wave(Bias, 0, sine(3 << 18), One, 1_073_741_789, 33),
        wave(Bias, 0, cosine(1_234_567), Rate, 777_777_777, 34),
        wave(Bias, 0, sine(sagnac_core::MAX_TURNS_Q18), One, -888_888_883, 31),
        wave(Bias, 1, cosine(1), One, 600_000_001, 36),
        wave(Bias, 1, sine(5 << 16), Rate, -1_060_000_007, 33),
        wave(Bias, 1, cosine(17 << 17), One, 900_000_001, 34),
        wave(Scale, 0, cosine(2 << 18), One, 611_953_011, 41),
        wave(Scale, 1, sine(2_718_282), One, -800_000_011, 40),
        wave(Scale, 0, sine(7 << 17), Rate, -1_050_505_051, 40),
    ];
    d.terms[..all.len()].copy_from_slice(&all);
    d.term_count = all.len() as u8;
    let about =
        "compensator: cosines and sines over the span, up to 64 turns, of bias and scale, with and without the rate";
    let mut making = Making::new(Module::Compensator, image_bytes(d)?, about)?;
    for update in 0..1200_u32 {
        let dice = update.wrapping_mul(2_654_435_761) >> 8;
        // -38 ... 68 degC and back; every tenth code is an end of a span, a quarter of it, or a code next to one of them.
        let up = i64::from(update.min(1200 - update));
        let along = (-38_i64 << 24) + (up * (106 << 24)) / 600 + i64::from(dice % (1 << 19));
        let quarter =
            |[lo, hi]: [i64; 2]| (lo << 24) + i64::from(dice % 5) * ((hi - lo) << 22) + i64::from(dice / 5 % 3) - 1;
        let first = if update % 10 == 7 { quarter([-35, 65]) } else { along };
        let second =
            if update % 10 == 3 { quarter([-20, 50]) } else { along * 3 / 4 - i64::from((dice >> 5) % (1 << 18)) };
        let codes = [i32::try_from(first)?, i32::try_from(second)?];
        let present = if dice % 61 == 0 { dice >> 7 & 3 } else { 3 };
        making.step(1, &[present, codes[0] as u32, codes[1] as u32])?;
        making.step(2, &[100, update * 7919 + 1, 21, 4])?;
    }
    Ok(making)
}

/// Whether a temperature in 2^-24 degC (a code, for a thermometer with one) is above the knot of a shape.
fn is_above(of: &InputSpec, shape: Shape, value: i64) -> bool {
    let knot_q15 = match shape {
        Shape::Chebyshev(_) | Shape::Cosine { .. } | Shape::Sine { .. } => return true,
        Shape::Zone { knot_q15 } | Shape::Step { knot_q15 } => i64::from(knot_q15),
    };
    let t = if of.source == ValueSource::Code { of.value_q24(value as i32).map_or(0, i64::from) } else { value };
    let (lo, hi) = (i64::from(of.span_lo_q24), i64::from(of.span_hi_q24));
    // x > knot, with x clamped to the span.
    (2 * t.clamp(lo, hi) - lo - hi) * 32_768 > knot_q15 * (hi - lo)
}

/// The paper's curve at its own period.
pub(super) fn compensator_paper(image: &[u8]) -> Result<Making> {
    let about = "compensator: the paper's curve (testdata/image/paper.img), 20 s";
    let mut making = Making::new(Module::Compensator, image.to_vec(), about)?;
    for second in 0..20_u32 {
        making.step(1, &[1, (17 + second) << 24])?;
        making.step(2, &[10_000, second + 1, 0, 2])?;
    }
    Ok(making)
}

/// Misuse and extreme values: late and early updates, missing and absurd temperatures, limits, overflow.
///
/// An advance of many ticks into an output limit has no equivalent in single ticks. The test benches of the hardware, which
/// run single ticks, therefore skip the last of these files.
pub(super) fn compensator_edges(output_limit: u32, longest: u32) -> Result<Making> {
    use Kind::{Bias, Scale};
    use Multiplier::{One, Rate};
    let mut d = Description { period_ticks: 40, slew_ticks: 7, output_limit, ..Description::empty() };
    d.serial[..5].copy_from_slice(b"EDGES");
    d.inputs[0] = InputSpec { stale_after_updates: 3, settling_updates: 5, ..thermometer([-35, 65])? };
    d.inputs[1] = InputSpec {
        offset_q24: 3 << 24,
        gain: sagnac_core::Gain { mantissa: -1_234_567_891, shift: 22 },
        ..thermometer([10, 30])?
    };
    d.input_count = 2;
    terms(
        &mut d,
        &[
            (Bias, 0, 8, One, 900_000_001, 22),
            (Bias, 1, 7, Rate, -1_073_741_823, 23),
            (Bias, 1, 1, One, 536_870_913, 20),
            (Scale, 1, 3, Rate, 1_000_000_007, 38),
            (Scale, 0, 0, One, -777_777_773, 37),
        ],
    );
    let about = match (output_limit, longest) {
        (9, 1) => "compensator: two thermometers, limited output, missing and absurd samples, misuse, overflow",
        (9, _) => "compensator: the same, with advances of many ticks into the limit",
        _ => "compensator: the same without a limit, with advances of many ticks",
    };
    let mut making = Making::new(Module::Compensator, image_bytes(d)?, about)?;
    making.step(3, &[5, 1])?;
    for round in 0..400_u32 {
        let dice = round.wrapping_mul(2_654_435_761) >> 8;
        let cold = ((dice % 130) as i32 - 50) << 24 | (dice as i32 & 0xff_ffff);
        let second = ((dice >> 5) % 40_000) as i32 - 20_000;
        let present = if dice % 7 == 0 { dice % 4 } else { 3 };
        let code = if dice % 11 == 0 { i32::MIN + round as i32 } else { cold };
        making.step(1, &[present, code as u32, second as u32])?;
        match dice % 6 {
            0 => making.step(1, &[3, 0, 0])?,
            1 => making.step(4, &[dice % 45])?,
            2 => making.step(3, &[(MAX_RAW + (dice % 3) as i32 - 1) as u32, 1])?,
            3 => making.step(5, &[])?,
            4 => making.step(3, &[dice % 90, 1 + dice % longest])?,
            _ => making.step(2, &[dice % 44, round, 0, 3])?,
        };
        // To the next update, and one beyond it.
        making.step(2, &[41, round, (dice % 3).wrapping_sub(1), 4 + dice % 3])?;
        if round % 50 == 49 {
            making.step(0, &[])?;
        }
    }
    for _ in 0..6 {
        making.step(1, &[3, 20 << 24, 0])?;
        making.step(3, &[MAX_RAW as u32, 1])?;
        making.step(2, &[41, 9, 0, 0])?;
    }
    making.step(2, &[3, 1, 1, 0])?;
    // Where it has overflowed, counts come again from a remainder of zero; elsewhere nothing changes.
    for seed in 1..4 {
        making.step(6, &[])?;
        making.step(2, &[11, seed, 3, 2])?;
    }
    Ok(making)
}
