//! The slow path against the same image evaluated in big integers with 200 fractional bits: what the
//! target's own roundings add.

use std::sync::LazyLock;

use crate::support::any_image_of_four;
use num_bigint::BigInt;
use proptest::prelude::*;
use sagnac_core::{Compensator, Image, Kind, Multiplier, Shape, State, ValueSource};

const FRACTION: u32 = 200;

fn fixed(numerator: impl Into<BigInt>, shift: u32) -> BigInt {
    numerator.into() << (FRACTION - shift)
}

/// The lag filter without any rounding, one per input.
#[derive(Default)]
struct Exact {
    lags: [Option<BigInt>; 4],
}

/// One input: T₀(x) … T₈(x) and y.
struct Scaled {
    basis: Vec<BigInt>,
    y: BigInt,
}

impl Exact {
    /// (increment, k − 1) with `FRACTION` fractional bits, at one slow update.
    fn update(&mut self, image: &Image, own_q24: [i32; 2]) -> (BigInt, BigInt) {
        let scaled: Vec<Scaled> = (0..image.inputs().len())
            .map(|index| {
                let value = |index: usize| match image.inputs()[index].source {
                    ValueSource::Difference { of, less } => own_q24[usize::from(of)] - own_q24[usize::from(less)],
                    _ => own_q24[index],
                };
                let t_q24 = match image.inputs()[index].source {
                    ValueSource::Repeat { of } => value(usize::from(of)),
                    ValueSource::Code | ValueSource::Difference { .. } => value(index),
                    ValueSource::WarmUp => 0,
                };
                self.scale(image, index, t_q24)
            })
            .collect();
        let (mut bias, mut scale) = (BigInt::ZERO, BigInt::ZERO);
        for term in image.terms() {
            let Scaled { basis, y } = &scaled[usize::from(term.input)];
            let above = |knot: i16| (&basis[1] - fixed(knot, 15)).max(BigInt::ZERO);
            let mut value = match term.shape {
                Shape::Chebyshev(order) => basis[usize::from(order)].clone(),
                Shape::Zone { knot_q15 } => (above(knot_q15) * above(knot_q15)) >> (FRACTION + 2),
                Shape::Step { knot_q15 } => fixed(i32::from(basis[1] >= fixed(knot_q15, 15)), 0),
                Shape::Cosine { turns_q18 } => sine_of_turns(turns(&basis[1], turns_q18) + fixed(1, 2)),
                Shape::Sine { turns_q18 } => sine_of_turns(turns(&basis[1], turns_q18)),
            };
            if term.multiplier == Multiplier::Rate {
                value = (value * y) >> FRACTION;
            }
            // Q40 mantissa·2^(31 − shift).
            let value = ((value * term.mantissa) << 31_u32 >> u32::from(term.shift)) >> 40_u32;
            match term.kind {
                Kind::Bias => bias += value,
                Kind::Scale => scale += value,
            }
        }
        (bias, scale)
    }

    fn scale(&mut self, image: &Image, index: usize, t_q24: i32) -> Scaled {
        let spec = &image.inputs()[index];
        let one = fixed(1, 0);
        let clamped = t_q24.clamp(spec.span_lo_q24, spec.span_hi_q24);
        let middle = (i64::from(spec.span_lo_q24) + i64::from(spec.span_hi_q24)) / 2;
        let x = fixed((i64::from(clamped) - middle) * i64::from(spec.x_mantissa), u32::from(spec.x_shift) + 47);
        let x = x.clamp(-one.clone(), one.clone());

        let t = fixed(t_q24, 24);
        // A warm-up begins at −1 °C.
        let begin = if spec.source == ValueSource::WarmUp { -one.clone() } else { t.clone() };
        let lag = self.lags[index].get_or_insert(begin);
        let step = ((&t - &*lag) * spec.lag.alpha_mantissa) >> u32::from(spec.lag.alpha_shift);
        *lag += &step;
        let unit = 24 + u32::from(spec.lag.rate_shift);
        let rate = step.clamp(fixed(spec.lag.rate_lo, unit), fixed(spec.lag.rate_hi, unit));
        let y = (rate * spec.lag.y_mantissa) << unit >> (u32::from(spec.lag.y_shift) + 31);
        let y = y.clamp(-one.clone(), one.clone());

        let mut basis = vec![one, x.clone()];
        for n in 1..8 {
            let next = ((&x * &basis[n]) >> (FRACTION - 1)) - &basis[n - 1];
            basis.push(next);
        }
        Scaled { basis, y }
    }
}

/// u·(x + 1)/2.
fn turns(x: &BigInt, turns_q18: u32) -> BigInt {
    ((x + fixed(1, 0)) * turns_q18) >> 19_u32
}

/// sin(2π·turns), turns ≥ 0: folded into a quarter, then the power series.
fn sine_of_turns(turns: BigInt) -> BigInt {
    /// 2π by Machin's formula, π/4 = 4·atan(1/5) − atan(1/239).
    static TAU: LazyLock<BigInt> = LazyLock::new(|| {
        let atan_of_one_by = |n: i32| {
            let (mut sum, mut power, mut k) = (BigInt::ZERO, fixed(1, 0) / n, 1);
            while power != BigInt::ZERO {
                sum += &power / k * if k % 4 == 1 { 1 } else { -1 };
                power /= n * n;
                k += 2;
            }
            sum
        };
        (atan_of_one_by(5) * 4 - atan_of_one_by(239)) * 8
    });
    let fraction = turns % fixed(1, 0);
    let (past, sign) = if fraction < fixed(1, 1) { (fraction, 1) } else { (fraction - fixed(1, 1), -1) };
    let nearer = past.clone().min(fixed(1, 1) - past);
    let angle = (nearer * &*TAU) >> FRACTION;
    let square = (&angle * &angle) >> FRACTION;
    let (mut sum, mut power, mut k) = (BigInt::ZERO, angle, 1);
    while power != BigInt::ZERO {
        sum += &power;
        power = -((power * &square) >> FRACTION) / ((k + 1) * (k + 2));
        k += 2;
    }
    sum * sign
}

/// Sum of the sizes of the coefficients of one kind, in LSB of Q32.
fn size(image: &Image, kind: Kind) -> f64 {
    let terms = image.terms().iter().filter(|term| term.kind == kind);
    terms.map(|t| f64::from(t.mantissa).abs() * 2.0_f64.powi(31 - i32::from(t.shift) - 8)).sum()
}

fn off_by(exact: &BigInt, rounded: i64) -> f64 {
    let difference: BigInt = exact - fixed(rounded, 32);
    let lsb: BigInt = difference >> (FRACTION - 32 - 20);
    i64::try_from(lsb).unwrap() as f64 / f64::from(1 << 20)
}

/// The reference itself, where the sine is known in closed form.
#[test]
fn the_big_sine_is_one() {
    let near = |found: BigInt, exact: BigInt| {
        let off: BigInt = found - exact;
        assert!(off.clone().max(-off.clone()) < fixed(1, 190), "{off}");
    };
    near(sine_of_turns(fixed(13, 2)), fixed(1, 0));
    near(sine_of_turns(fixed(7, 2)), fixed(-1, 0));
    near(sine_of_turns(fixed(5, 1)), BigInt::ZERO);
    // sin 30° = 1/2; sin² 45° = 1/2.
    near(sine_of_turns(fixed(1, 0) / 12), fixed(1, 1));
    let half = sine_of_turns(fixed(3, 3));
    near((&half * &half) >> FRACTION, fixed(1, 1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Bound of docs/explanation/arithmetic.md: 2⁻²⁷ of the coefficients' sum, and one LSB of Q32 for the last rounding.
    /// SAG-CORE-002, SAG-CORE-005, SAG-CORE-006, SAG-CORE-007, SAG-CORE-008, SAG-CORE-009, SAG-CORE-011
    #[test]
    fn roundings_stay_within_their_bound(
        image in any_image_of_four(),
        start in prop::array::uniform2(-(45 << 24)..(75_i32 << 24)),
        steps in prop::collection::vec(prop::array::uniform2(-(1 << 22)..(1_i32 << 22)), 1..120),
    ) {
        let gyro = Compensator::new(image);
        let (mut state, mut exact) = (State::new(), Exact::default());
        let mut t = start;
        for step in steps {
            // The two stay within 60 °C of each other, so that their difference fits its codes.
            t = [(t[0] + step[0]).clamp(-(79 << 24), 0), (t[1] + step[1]).clamp(-(40 << 24), 40 << 24)];
            let left = state.ticks_to_update();
            gyro.skip(&mut state, left).unwrap();
            gyro.update(&mut state, &[Some(t[0]), Some(t[1]), None, None]).unwrap();
            let (bias, scale) = exact.update(&image, t);
            let bound = |kind| size(&image, kind) * 2.0_f64.powi(-27) + 1.0;
            let (d_off, k_off) = (off_by(&bias, state.target_increment()), off_by(&scale, state.k_q32() - (1 << 32)));
            prop_assert!(d_off.abs() <= bound(Kind::Bias), "{d_off} LSB, bound {}", bound(Kind::Bias));
            prop_assert!(k_off.abs() <= bound(Kind::Scale), "{k_off} LSB, bound {}", bound(Kind::Scale));
        }
    }
}
