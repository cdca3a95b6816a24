//! The functions of an input that terms consist of.
//!
//! ```text
//! Chebyshev n      T_n(x)                                    x: the input scaled to −1 … 1 over its span
//! zone             ((x − ξ)/(1 − ξ))² above the knot ξ, else 0     a piecewise polynomial with a continuous slope
//! step             1 from the threshold on, else 0
//! cosine, sine     cos(2π·(v − v_lo)/P), sin(2π·(v − v_lo)/P)      v: the input, v_lo the lower end of its span, P the period
//! ```
//!
//! A [`TermShape`] holds everything that a form of term needs: its value, its mean over a window, its slope, its powers of the
//! input, its place in the image. Fit, record, export, evaluation and report ask the shape, so a new shape is
//! a new arm of each function in this file.
#![deny(clippy::wildcard_enum_match_arm)]

use sagnac_core::Shape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::basis::{BASIS_LEN, Span, chebyshev, chebyshev_mean, chebyshev_slope};
use crate::model::powers::powers_of_chebyshev;

/// Positions of the image's knots per unit of x.
pub(crate) const KNOTS_PER_ONE: f64 = 32_768.0;

/// What a term acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ActsOn {
    /// The bias drift d, °/h.
    Bias,
    /// The deviation ε of the scale factor, ppm.
    ScaleFactor,
}

impl ActsOn {
    /// Name of the fitted period of a harmonic in the covariance.
    pub(crate) fn period_name(self) -> &'static str {
        match self {
            Self::Bias => "period",
            Self::ScaleFactor => "scale period",
        }
    }
}

/// A function of one input. Knots, thresholds and periods are in the unit of the input.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TermShape {
    /// The Chebyshev polynomial T_n of the scaled input.
    Chebyshev {
        /// Its order n, 0 to 8.
        order: u8,
    },
    /// The square ((x − ξ)/(1 − ξ))² above a knot, 0 below; 1 at the upper end of the span.
    Zone {
        /// The knot.
        knot: f64,
    },
    /// 1 from a threshold on, 0 below.
    Step {
        /// The threshold.
        threshold: f64,
    },
    /// The cosine of the input: 1 at the lower end of the span.
    Cosine {
        /// The period.
        period: f64,
    },
    /// The sine of the input: 0 at the lower end of the span.
    Sine {
        /// The period.
        period: f64,
    },
}

/// How an input moves within a window: the mean of x, its second moment, and the whole numbers that a stepped input takes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Movement<'a> {
    pub(crate) x: f64,
    pub(crate) variance: f64,
    pub(crate) levels: &'a [f64],
}

impl TermShape {
    /// Its value where the input is at `value`, in the input's unit.
    pub fn value(self, span: Span, value: f64) -> f64 {
        match self {
            Self::Chebyshev { order } => of_order(chebyshev(span.x(value)), order),
            Self::Zone { knot } => square_above(span.x(value), knot_x(span, knot)),
            Self::Step { threshold } => f64::from(u8::from(value >= threshold)),
            Self::Cosine { period } => phase(span, period, value).cos(),
            Self::Sine { period } => phase(span, period, value).sin(),
        }
    }

    /// Its mean over a window: to the second moment for polynomials and harmonics (exp(−ω²·var/2) for these), the part
    /// of the window above the threshold for steps.
    pub(crate) fn mean(self, span: Span, over: Movement<'_>) -> f64 {
        match self {
            Self::Chebyshev { order } => of_order(chebyshev_mean(over.x, over.variance), order),
            Self::Zone { knot } => {
                let knot = knot_x(span, knot);
                let inside = if over.x > knot { over.variance / (1.0 - knot).powi(2) } else { 0.0 };
                square_above(over.x, knot) + inside
            }
            Self::Step { threshold } => part_above(threshold, span.at(over.x), over.levels),
            Self::Cosine { period } | Self::Sine { period } => {
                let spread = (omega(span, period) / span.slope()).powi(2) * over.variance;
                self.value(span, span.at(over.x)) * (-0.5 * spread).exp()
            }
        }
    }

    /// Its derivative with respect to the input, per unit of the input. 0 at a step.
    pub(crate) fn slope(self, span: Span, value: f64) -> f64 {
        let x = span.x(value);
        match self {
            Self::Chebyshev { order } => span.slope() * of_order(chebyshev_slope(x), order),
            Self::Zone { knot } => {
                let knot = knot_x(span, knot);
                span.slope() * 2.0 * (x - knot).max(0.0) / (1.0 - knot).powi(2)
            }
            Self::Step { .. } => 0.0,
            Self::Cosine { period } => -omega(span, period) * phase(span, period, value).sin(),
            Self::Sine { period } => omega(span, period) * phase(span, period, value).cos(),
        }
    }

    /// Its coefficients in ascending powers of the input between two values of it; `None` where it is no polynomial there.
    pub(crate) fn powers(self, span: Span, piece: [f64; 2]) -> Option<[f64; BASIS_LEN]> {
        match self {
            Self::Chebyshev { order } => Some(powers_of_chebyshev(span, order)),
            Self::Zone { knot } => {
                let mut powers = [0.0; BASIS_LEN];
                if piece[0] >= knot {
                    let width = span.hi - knot;
                    let square = [knot * knot, -2.0 * knot, 1.0].map(|c| c / (width * width));
                    powers[..square.len()].copy_from_slice(&square);
                }
                Some(powers)
            }
            Self::Step { .. } | Self::Cosine { .. } | Self::Sine { .. } => None,
        }
    }

    /// Its order, if it is a Chebyshev polynomial.
    pub fn order(self) -> Option<usize> {
        match self {
            Self::Chebyshev { order } => Some(usize::from(order)),
            Self::Zone { .. } | Self::Step { .. } | Self::Cosine { .. } | Self::Sine { .. } => None,
        }
    }

    /// Its degree as a polynomial of the input; `None` where it is none.
    pub(crate) fn degree(self) -> Option<usize> {
        match self {
            Self::Chebyshev { order } => Some(usize::from(order)),
            Self::Zone { .. } => Some(2),
            Self::Step { .. } | Self::Cosine { .. } | Self::Sine { .. } => None,
        }
    }

    /// Value of the input at which the curve is put together from pieces.
    pub(crate) fn joint(self) -> Option<f64> {
        match self {
            Self::Zone { knot } => Some(knot),
            Self::Chebyshev { .. } | Self::Step { .. } | Self::Cosine { .. } | Self::Sine { .. } => None,
        }
    }

    /// Value of the input at which the curve jumps; `None` without a jump.
    pub fn jump(self) -> Option<f64> {
        match self {
            Self::Step { threshold } => Some(threshold),
            Self::Chebyshev { .. } | Self::Zone { .. } | Self::Cosine { .. } | Self::Sine { .. } => None,
        }
    }

    /// The shape of the image and the factor from a coefficient of this shape to one of that; `Err` names what does not fit.
    pub(crate) fn encode(self, span: Span) -> Result<(Shape, f64), &'static str> {
        let knot_q15 = |at: f64, what: &'static str| {
            let knot = (span.x(at) * KNOTS_PER_ONE).round();
            if knot.abs() < KNOTS_PER_ONE { Ok(knot as i16) } else { Err(what) }
        };
        match self {
            Self::Chebyshev { order } => Ok((Shape::Chebyshev(order), 1.0)),
            Self::Zone { knot } => {
                let knot_q15 = knot_q15(knot, "knot (outside of the span)")?;
                // The target's zone is ((x − ξ)/2)².
                let width = 1.0 - f64::from(knot_q15) / KNOTS_PER_ONE;
                Ok((Shape::Zone { knot_q15 }, (2.0 / width).powi(2)))
            }
            Self::Step { threshold } => {
                Ok((Shape::Step { knot_q15: knot_q15(threshold, "threshold (outside of the span)")? }, 1.0))
            }
            Self::Cosine { period } => Ok((Shape::Cosine { turns_q18: target_turns(span, period)? }, 1.0)),
            Self::Sine { period } => Ok((Shape::Sine { turns_q18: target_turns(span, period)? }, 1.0)),
        }
    }

    /// Why a record cannot hold it over an input of this span; `times_rate` where the term is multiplied with the rate.
    pub(crate) fn fault(self, span: Span, times_rate: bool) -> Option<String> {
        let inside = |at: f64| at > span.lo && at < span.hi;
        match self {
            Self::Chebyshev { order } => {
                let lowest = u8::from(!times_rate);
                let most = sagnac_core::MAX_ORDER;
                (!(lowest..=most).contains(&order)).then(|| format!("orders are {lowest} to {most}"))
            }
            Self::Zone { knot } => (!inside(knot)).then(|| "a knot lies within the span of its input".to_owned()),
            Self::Step { threshold } => {
                (!inside(threshold)).then(|| "a threshold lies within the span of its input".to_owned())
            }
            Self::Cosine { period } | Self::Sine { period } => target_turns(span, period)
                .err()
                .map(|_| "a period lies within 1/64 of the span and 64 spans".to_owned()),
        }
    }

    /// Whether its columns span one space with those of the polynomials, whatever basis the fit takes of it.
    pub(crate) fn joins_series(self) -> bool {
        match self {
            Self::Chebyshev { .. } | Self::Zone { .. } => true,
            Self::Step { .. } | Self::Cosine { .. } | Self::Sine { .. } => false,
        }
    }

    /// What follows the word of a term in its name: `2`, `from 35.2000`.
    pub(crate) fn words(self) -> String {
        match self {
            Self::Chebyshev { order } => order.to_string(),
            Self::Zone { knot: at } | Self::Step { threshold: at } => format!("from {at:.4}"),
            Self::Cosine { period } | Self::Sine { period } => format!("of period {period:.4}"),
        }
    }
}

/// What a term is, apart from its input and its coefficient: what it acts on, its shape, and whether it is multiplied with the
/// rate of its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// What it acts on.
    pub acts_on: ActsOn,
    /// The function of its input.
    pub shape: TermShape,
    /// It is multiplied with the lagged rate of its input, per minute.
    pub times_rate: bool,
}

impl Form {
    /// A polynomial of the bias.
    pub const fn bias(order: u8) -> Self {
        Self { acts_on: ActsOn::Bias, shape: TermShape::Chebyshev { order }, times_rate: false }
    }

    /// A polynomial that multiplies the rate.
    pub const fn rate(order: u8) -> Self {
        Self { acts_on: ActsOn::Bias, shape: TermShape::Chebyshev { order }, times_rate: true }
    }

    /// A polynomial of the scale factor.
    pub const fn scale(order: u8) -> Self {
        Self { acts_on: ActsOn::ScaleFactor, shape: TermShape::Chebyshev { order }, times_rate: false }
    }

    /// Its value where the input is at `value`, less that at the reference; of a rate term the factor of the rate.
    pub(crate) fn value(self, span: Span, value: f64, reference: f64) -> f64 {
        let zero = if self.times_rate { 0.0 } else { self.shape.value(span, reference) };
        self.shape.value(span, value) - zero
    }

    /// Unit of its coefficient, over a temperature (or a difference of two) or over a column with a unit of its own.
    pub fn unit(self, in_celsius: bool) -> &'static str {
        match (self.acts_on, self.times_rate, in_celsius) {
            (ActsOn::Bias, false, _) => "deg/h",
            (ActsOn::Bias, true, true) => "deg/h per degC/min",
            (ActsOn::Bias, true, false) => "deg/h per unit/min",
            (ActsOn::ScaleFactor, false, _) => "ppm",
            (ActsOn::ScaleFactor, true, true) => "ppm per degC/min",
            (ActsOn::ScaleFactor, true, false) => "ppm per unit/min",
        }
    }

    /// Its word in names of terms, as `--model` has it.
    pub(crate) fn word(self) -> String {
        let of_shape = match self.shape {
            TermShape::Chebyshev { .. } => "",
            TermShape::Zone { .. } => "zone",
            TermShape::Step { .. } => "step",
            TermShape::Cosine { .. } => "cosine",
            TermShape::Sine { .. } => "sine",
        };
        let of_form = match (self.acts_on, self.times_rate) {
            (ActsOn::Bias, false) if of_shape.is_empty() => "bias",
            (ActsOn::Bias, false) => "",
            (ActsOn::Bias, true) => "rate",
            (ActsOn::ScaleFactor, false) => "scale",
            (ActsOn::ScaleFactor, true) => "scale rate",
        };
        [of_form, of_shape].into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
    }

    /// Its name, with its input in brackets unless that is the thermometer of the fit: `bias 2`, `rate(cavity) 0`.
    pub(crate) fn name(self, input: Option<&str>) -> String {
        let brackets = input.map_or(String::new(), |input| format!("({input})"));
        format!("{}{brackets} {}", self.word(), self.shape.words())
    }
}

/// Position of a shape among the terms of an image: one record, one image.
pub(crate) fn image_order(shape: Shape) -> (u8, i32) {
    match shape {
        Shape::Chebyshev(order) => (0, order.into()),
        Shape::Zone { knot_q15 } => (1, knot_q15.into()),
        Shape::Step { knot_q15 } => (2, knot_q15.into()),
        Shape::Cosine { turns_q18 } => (3, turns_q18.cast_signed()),
        Shape::Sine { turns_q18 } => (4, turns_q18.cast_signed()),
    }
}

fn of_order(values: [f64; BASIS_LEN], order: u8) -> f64 {
    values.get(usize::from(order)).copied().unwrap_or(0.0)
}

/// x of a knot, on the grid of the image.
fn knot_x(span: Span, knot: f64) -> f64 {
    (span.x(knot) * KNOTS_PER_ONE).round() / KNOTS_PER_ONE
}

/// Turns over the span per unit of the image.
const TURNS_PER_ONE: f64 = (1 << 18) as f64;
/// Fewest and most turns over the span.
const TURNS: std::ops::Range<f64> = 1.0 / 64.0..64.0;

/// Whole turns that a period makes over the span, on the grid of the image.
fn turns(span: Span, period: f64) -> f64 {
    ((span.hi - span.lo) / period * TURNS_PER_ONE).round() / TURNS_PER_ONE
}

/// The same as the image has them; `Err` where it cannot.
fn target_turns(span: Span, period: f64) -> Result<u32, &'static str> {
    let turns = turns(span, period);
    if TURNS.contains(&turns) {
        Ok((turns * TURNS_PER_ONE) as u32)
    } else {
        Err("period (outside of 1/64 to 64 spans)")
    }
}

/// The period nearest to this one that the image can hold over a span.
pub(crate) fn period_on_grid(span: Span, period: f64) -> f64 {
    (span.hi - span.lo) / turns(span, period)
}

/// Phase of a harmonic, rad.
fn phase(span: Span, period: f64, value: f64) -> f64 {
    omega(span, period) * (value - span.lo)
}

/// Its change per unit of the input.
fn omega(span: Span, period: f64) -> f64 {
    std::f64::consts::TAU * turns(span, period) / (span.hi - span.lo)
}

/// ((x − ξ)/(1 − ξ))² above ξ, 0 below.
fn square_above(x: f64, knot: f64) -> f64 {
    ((x - knot).max(0.0) / (1.0 - knot)).powi(2)
}

/// Part of a window that a stepped input spends above a threshold, from its mean between the two levels next to it.
fn part_above(threshold: f64, mean: f64, levels: &[f64]) -> f64 {
    let above = levels.partition_point(|level| *level < threshold);
    match (above.checked_sub(1).and_then(|at| levels.get(at)), levels.get(above)) {
        (Some(lo), Some(hi)) => ((mean - lo) / (hi - lo)).clamp(0.0, 1.0),
        (None | Some(_), None | Some(_)) => f64::from(u8::from(mean >= threshold)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Span = Span { lo: -40.0, hi: 70.0 };
    const SHAPES: [TermShape; 6] = [
        TermShape::Chebyshev { order: 3 },
        TermShape::Chebyshev { order: 8 },
        TermShape::Zone { knot: 15.0 },
        TermShape::Zone { knot: -12.5 },
        TermShape::Cosine { period: 27.5 },
        TermShape::Sine { period: 110.0 },
    ];

    /// Central differences of the value.
    #[test]
    fn slopes_are_those_of_the_values() {
        for shape in SHAPES {
            for value in [-39.0, -3.7, 14.0, 33.3, 69.0] {
                let step = 1e-4;
                let expected = (shape.value(SPAN, value + step) - shape.value(SPAN, value - step)) / (2.0 * step);
                let slope = shape.slope(SPAN, value);
                assert!((slope - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{shape:?} at {value}: {slope}");
            }
        }
    }

    /// Means over a uniform movement, by 2,000 points; the second moment is exact for orders up to 3 and for zones.
    #[test]
    fn means_are_those_of_the_values() {
        for shape in SHAPES {
            if shape == (TermShape::Chebyshev { order: 8 }) {
                continue;
            }
            let (middle, half) = (33.0, 1.0);
            let mean = |of: &dyn Fn(f64) -> f64| {
                (0..2000).map(|i| of(middle + half * ((f64::from(i) + 0.5) / 1000.0 - 1.0))).sum::<f64>() / 2000.0
            };
            let variance = mean(&|v| (v - middle).powi(2)) * SPAN.slope().powi(2);
            let over = Movement { x: SPAN.x(middle), variance, levels: &[] };
            let expected = mean(&|v| shape.value(SPAN, v));
            // Of a harmonic the fourth moment is not known: ω⁴·half⁴/120 here, 2.3e-5.
            let bound = if shape.degree().is_some() { 1e-9 } else { 5e-5 };
            assert!((shape.mean(SPAN, over) - expected).abs() < bound, "{shape:?}");
        }
    }

    #[test]
    fn powers_are_those_of_the_values() {
        for shape in SHAPES.into_iter().filter(|shape| shape.degree().is_some()) {
            for (piece, value) in [([-40.0, 14.0], -13.0), ([15.0, 70.0], 44.0)] {
                let powers = shape.powers(SPAN, piece).unwrap();
                let sum = powers.iter().rev().fold(0.0, |sum, c| sum * value + c);
                assert!((sum - shape.value(SPAN, value)).abs() < 1e-9, "{shape:?} at {value}: {sum}");
            }
        }
    }

    #[test]
    fn names_are_words_of_the_model() {
        assert_eq!(Form::bias(2).name(None), "bias 2");
        assert_eq!(Form::rate(0).name(Some("cavity")), "rate(cavity) 0");
        assert_eq!(Form::scale(1).name(None), "scale 1");
        let step = Form { shape: TermShape::Step { threshold: 1.5 }, ..Form::bias(0) };
        assert_eq!(step.name(Some("mode")), "step(mode) from 1.5000");
    }
}
