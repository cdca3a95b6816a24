//! What flash holds, once it has been checked.
//!
//! [`Description`] is the plain list of fields. [`Image::new`] is the only way to an [`Image`]: it refuses every combination for which
//! the arithmetic of [`crate::Compensator`] could overflow or have no meaning. So the arithmetic itself needs no `Result`.
//!
//! A term is `coefficient · shape(x) [· y]`, with x and y of one input. Its shape is a Chebyshev polynomial, a piece that begins at a
//! knot, or a harmonic ([`Shape`]); its coefficient is a mantissa with an exponent. Bias terms are in output counts per tick, scale
//! terms are parts of one. Both are summed in Q40, eight guard bits below the Q32 of the fast path.

use core::fmt;
use core::hash::Hash as _;

use crate::checksum::Checksum;
use crate::harmonic::MAX_TURNS_Q18;
use crate::input::{Gain, InputSpec, LagSpec, ValueSource};
use crate::series::MAX_ORDER;

/// Inputs that one image can describe.
pub const MAX_INPUTS: usize = 4;
/// Terms that one image can hold.
pub const MAX_TERMS: usize = 32;
/// Largest |increment|, counts·2⁻³² per tick.
pub const MAX_INCREMENT: i64 = 1 << 46;
/// Largest |k − 1| in 2⁻³²: 15,625 ppm.
pub const MAX_SCALE: i64 = 1 << 26;
/// Largest |Σ increment| between two slow updates.
const MAX_INCREMENT_SUM: i64 = 1 << 61;
/// Bits below the fast path's Q32 in which terms are summed.
pub(crate) const GUARD_BITS: u32 = 8;

/// What a term adds to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Bias drift: counts per tick to be subtracted.
    Bias,
    /// Scale factor: ε·1e-6.
    Scale,
}

/// What a term's shape is multiplied by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Multiplier {
    /// One: the shape alone.
    One,
    /// The scaled, clamped rate y of the input.
    Rate,
}

/// The function of x in a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// T_order(x), the Chebyshev polynomial of this order, 0..=8.
    Chebyshev(u8),
    /// ((x − knot)/2)² above the knot, 0 below. Added to a series it makes a piecewise polynomial with a continuous slope.
    Zone {
        /// x in 2⁻¹⁵.
        knot_q15: i16,
    },
    /// 1 from the knot on, 0 below.
    Step {
        /// x in 2⁻¹⁵.
        knot_q15: i16,
    },
    /// `cos(2π·u·(x + 1)/2)`: u turns over the span, from phase 0 at its lower end.
    Cosine {
        /// u in 2⁻¹⁸ turns, 1..=[`MAX_TURNS_Q18`].
        turns_q18: u32,
    },
    /// `sin(2π·u·(x + 1)/2)`, the same.
    Sine {
        /// u in 2⁻¹⁸ turns, 1..=[`MAX_TURNS_Q18`].
        turns_q18: u32,
    },
}

impl Shape {
    /// The Chebyshev order, if it is one.
    pub const fn order(self) -> Option<u8> {
        match self {
            Self::Chebyshev(order) => Some(order),
            Self::Zone { .. } | Self::Step { .. } | Self::Cosine { .. } | Self::Sine { .. } => None,
        }
    }

    /// The turns over the span in 2⁻¹⁸, if it is a harmonic.
    pub const fn turns_q18(self) -> Option<u32> {
        match self {
            Self::Cosine { turns_q18 } | Self::Sine { turns_q18 } => Some(turns_q18),
            Self::Chebyshev(_) | Self::Zone { .. } | Self::Step { .. } => None,
        }
    }
}

/// One row of the image's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Term {
    /// What it adds to.
    pub kind: Kind,
    /// Index of the input whose x (and y) it uses.
    pub input: u8,
    /// The function of x.
    pub shape: Shape,
    /// What the shape is multiplied by.
    pub multiplier: Multiplier,
    /// Coefficient = mantissa · 2^(31 − shift) in Q40.
    pub mantissa: i32,
    /// See `mantissa`; 8..=62. A larger shift is a smaller coefficient.
    pub shift: u8,
}

impl Term {
    /// A term that adds nothing; fills unused rows of a description.
    pub const ZERO: Self = Self {
        kind: Kind::Bias,
        input: 0,
        shape: Shape::Chebyshev(0),
        multiplier: Multiplier::One,
        mantissa: 0,
        shift: 62,
    };

    /// The largest value the term can reach, in Q40, rounded up.
    pub(crate) const fn bound_q40(&self) -> i64 {
        ((self.mantissa as i64).abs() << 31 >> self.shift) + 1
    }
}

/// The fields of an image, not yet checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Description {
    /// Serial number of the gyro, UTF-8, padded with zero bytes.
    pub serial: [u8; 32],
    /// Axis letter, `x`, `y`, `z`, or another printable ASCII byte.
    pub axis: u8,
    /// Length of a tick, ns.
    pub tick_ns: u32,
    /// Ticks per temperature period Δt.
    pub period_ticks: u32,
    /// Ticks over which a new increment is approached; 0 sets it at once.
    pub slew_ticks: u32,
    /// Nominal scale factor: the angle of one output count (one quantum), 1e-15 arcsec.
    pub scale_factor_femto_arcsec: u64,
    /// Counts of the log per output count, 1e-9.
    pub quantum_nano_counts: u64,
    /// Temperature T0 at which the correction is zero, 2⁻²⁴ °C. For display only: the terms contain it.
    pub reference_q24: i32,
    /// Number of this image among those written for this gyro and axis; counts up.
    pub sequence: u32,
    /// Largest |counts| that one call outputs.
    pub output_limit: u32,
    /// SHA-256 of the calibration or image that this one was made from.
    pub parent: [u8; 32],
    /// Inputs; the first `input_count` are used.
    pub inputs: [InputSpec; MAX_INPUTS],
    /// See `inputs`.
    pub input_count: u8,
    /// Terms; the first `term_count` are used.
    pub terms: [Term; MAX_TERMS],
    /// See `terms`.
    pub term_count: u8,
}

impl Description {
    /// No input, no term, 100 µs tick, 1 s period, 1 arcsec per count.
    pub const fn empty() -> Self {
        Self {
            serial: [0; 32],
            axis: b'x',
            tick_ns: 100_000,
            period_ticks: 10_000,
            slew_ticks: 100,
            scale_factor_femto_arcsec: 1_000_000_000_000_000,
            quantum_nano_counts: 1_000_000_000,
            reference_q24: 25 << 24,
            sequence: 0,
            output_limit: i32::MAX as u32,
            parent: [0; 32],
            inputs: [InputSpec::UNUSED; MAX_INPUTS],
            input_count: 0,
            terms: [Term::ZERO; MAX_TERMS],
            term_count: 0,
        }
    }

    /// The largest |increment| that cannot overflow within a temperature period, counts·2⁻³² per tick: what the bias terms may
    /// reach together.
    pub fn increment_bound(&self) -> i64 {
        let by_period = MAX_INCREMENT_SUM >> (32 - self.period_ticks.saturating_sub(1).leading_zeros());
        MAX_INCREMENT.min(by_period)
    }
}

/// Why a description is refused. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageError {
    /// A field of the head is outside its range.
    Head(&'static str),
    /// A field of an input is outside its range.
    Input(u8, &'static str),
    /// A field of a term is outside its range.
    Term(u8, &'static str),
    /// The bias terms together could exceed the increment's range.
    IncrementTooLarge,
    /// The scale terms together could exceed 15,625 ppm.
    ScaleTooLarge,
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Head(field) => write!(f, "head: {field} out of range"),
            Self::Input(i, field) => write!(f, "input {i}: {field} out of range"),
            Self::Term(i, field) => write!(f, "term {i}: {field} out of range"),
            Self::IncrementTooLarge => f.write_str("the bias terms together exceed the increment's range"),
            Self::ScaleTooLarge => f.write_str("the scale terms together exceed 15,625 ppm"),
        }
    }
}

impl core::error::Error for ImageError {}

/// A description that passed every check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Image(Description);

impl Image {
    /// A checksum of every field, for comparing the image in memory with itself later. Not the CRC of its bytes.
    pub fn checksum(&self) -> u32 {
        let mut sum = Checksum::START;
        self.hash(&mut sum);
        sum.sum()
    }

    /// Checks a description and makes it an image.
    ///
    /// # Errors
    /// The first broken rule, in the order of the fields.
    pub fn new(description: Description) -> Result<Self, ImageError> {
        let image = Self(description);
        image.check_head()?;
        for (i, input) in (0_u8..).zip(image.inputs()) {
            check_input(input)
                .and_then(|()| image.check_source(i, input))
                .map_err(|field| ImageError::Input(i, field))?;
        }
        for (i, term) in (0_u8..).zip(image.terms()) {
            image.check_term(term).map_err(|field| ImageError::Term(i, field))?;
        }
        image.check_sums()?;
        Ok(image)
    }

    /// No input, no term: corrects nothing ([`Description::empty`] passes every check; a test confirms it).
    pub const fn empty() -> Self {
        Self(Description::empty())
    }

    /// The largest value that the terms of one kind can reach together, in 2⁻³² counts per tick (bias) or 2⁻³² (scale).
    ///
    /// |shape| ≤ 1 and |y| ≤ 1, so the sum of the coefficients' magnitudes is a bound.
    pub fn reach(&self, kind: Kind) -> i64 {
        let terms = self.terms().iter().filter(|term| term.kind == kind);
        terms.map(Term::bound_q40).fold(0_i64, i64::saturating_add) >> GUARD_BITS
    }

    /// The fields.
    pub const fn description(&self) -> &Description {
        &self.0
    }

    /// The inputs in use.
    pub fn inputs(&self) -> &[InputSpec] {
        self.0.inputs.get(..usize::from(self.0.input_count)).unwrap_or(&[])
    }

    /// The terms in use.
    pub fn terms(&self) -> &[Term] {
        self.0.terms.get(..usize::from(self.0.term_count)).unwrap_or(&[])
    }

    /// The serial number, or `None` if it is not UTF-8.
    pub fn serial(&self) -> Option<&str> {
        core::str::from_utf8(&self.0.serial).ok().map(|text| text.trim_end_matches('\0'))
    }

    fn check_head(&self) -> Result<(), ImageError> {
        let d = &self.0;
        let rules = [
            (self.serial().is_some(), "serial (not UTF-8)"),
            (d.axis.is_ascii_graphic(), "axis"),
            (d.tick_ns > 0, "tick_ns"),
            (d.period_ticks > 0 && d.period_ticks <= 1 << 24, "period_ticks"),
            (d.slew_ticks <= d.period_ticks, "slew_ticks"),
            (d.scale_factor_femto_arcsec > 0, "scale_factor_femto_arcsec"),
            (d.quantum_nano_counts > 0, "quantum_nano_counts"),
            (d.output_limit > 0 && d.output_limit <= i32::MAX as u32, "output_limit"),
            (usize::from(d.input_count) <= MAX_INPUTS, "input_count"),
            (usize::from(d.term_count) <= MAX_TERMS, "term_count"),
        ];
        first_broken(&rules).map_err(ImageError::Head)
    }

    /// A difference uses two inputs that come before it and have codes of their own. A repeat uses one input that comes before it
    /// and is itself neither a repeat nor a warm-up; unit, valid range and hold time are the same. A warm-up has a lag, and 0 °C is
    /// valid. None of the three has a conversion or a
    /// largest step: both are already applied.
    fn check_source(&self, index: u8, t: &InputSpec) -> Result<(), &'static str> {
        let before = |i: u8| self.inputs().get(usize::from(i)).filter(|_| i < index);
        let no_conversion = t.offset_q24 == 0 && t.gain == Gain::ONE;
        let steps_of_source = t.source == ValueSource::Code || t.largest_step_q8 == 0;
        let grows_by_steps = t.step_growth <= 16 && (t.step_growth == 0 || t.largest_step_q8 > 0);
        first_broken(&[
            (steps_of_source, "largest step (an input without a code has those of its source)"),
            (grows_by_steps, "growth of the largest step (at most 16, and 0 without one)"),
        ])?;
        match t.source {
            ValueSource::Code => Ok(()),
            ValueSource::Difference { of, less } => {
                let own_code = |i: u8| before(i).is_some_and(|other| other.source == ValueSource::Code);
                first_broken(&[
                    (own_code(of) && own_code(less) && of != less, "difference"),
                    (no_conversion, "conversion (a difference has no code)"),
                ])
            }
            ValueSource::Repeat { of } => {
                let repeated = before(of)
                    .filter(|other| !matches!(other.source, ValueSource::Repeat { .. } | ValueSource::WarmUp));
                let held = |t: &InputSpec| (t.unit_exponent, t.valid_lo_q24, t.valid_hi_q24, t.stale_after_updates);
                first_broken(&[
                    (repeated.is_some(), "repeat"),
                    (no_conversion, "conversion (a repeat has no code)"),
                    (
                        repeated.is_some_and(|other| held(other) == held(t)),
                        "unit, valid range or hold time (not those of the input that it repeats)",
                    ),
                ])
            }
            ValueSource::WarmUp => first_broken(&[
                (no_conversion, "conversion (a warm-up has no code)"),
                (t.lag.is_used(), "lag (a warm-up is one)"),
                (t.valid_lo_q24 <= 0 && t.valid_hi_q24 >= 0, "valid range (a warm-up is 0)"),
            ]),
        }
    }

    fn check_term(&self, term: &Term) -> Result<(), &'static str> {
        let input = self.inputs().get(usize::from(term.input));
        let has_rate = input.is_some_and(|input| input.lag.is_used());
        first_broken(&[
            (input.is_some(), "input"),
            (term.shape.order().is_none_or(|order| order <= MAX_ORDER), "order"),
            (term.shape.turns_q18().is_none_or(|turns| (1..=MAX_TURNS_Q18).contains(&turns)), "turns"),
            (term.multiplier == Multiplier::One || has_rate, "multiplier (the input has no lag filter)"),
            (term.mantissa != i32::MIN, "mantissa"),
            ((8..=62).contains(&term.shift), "shift"),
        ])
    }

    /// **SAG-CORE-019** An image whose terms together can leave the range of increment or scale is refused.
    fn check_sums(&self) -> Result<(), ImageError> {
        if self.reach(Kind::Bias) > self.0.increment_bound() {
            return Err(ImageError::IncrementTooLarge);
        }
        if self.reach(Kind::Scale) > MAX_SCALE {
            return Err(ImageError::ScaleTooLarge);
        }
        Ok(())
    }
}

fn check_input(t: &InputSpec) -> Result<(), &'static str> {
    let span = i64::from(t.span_hi_q24) - i64::from(t.span_lo_q24);
    first_broken(&[
        (t.gain.mantissa != 0, "gain mantissa"),
        (t.gain.shift <= 62, "gain shift"),
        (t.valid_lo_q24 > i32::MIN && t.valid_hi_q24 < i32::MAX, "valid range (beyond ±128 °C)"),
        (t.valid_lo_q24 < t.valid_hi_q24, "valid range"),
        (span > 0 && span & 1 == 0, "span"),
        (t.unit_exponent.unsigned_abs() <= 100, "unit exponent"),
        (t.x_shift <= 15 && reaches_one(span >> 1, t.x_mantissa, t.x_shift + 16), "x mantissa or shift"),
    ])?;
    if t.lag.is_used() { check_lag(&t.lag) } else { first_broken(&[(t.lag == LagSpec::default(), "lag")]) }
}

fn check_lag(lag: &LagSpec) -> Result<(), &'static str> {
    let far = i64::from(lag.rate_lo).abs().max(i64::from(lag.rate_hi).abs());
    first_broken(&[
        (lag.alpha_mantissa <= 1 << 31, "alpha mantissa"),
        ((31..=62).contains(&lag.alpha_shift), "alpha shift"),
        (lag.rate_shift < lag.alpha_shift, "rate shift"),
        (lag.rate_lo > i32::MIN && lag.rate_lo <= 0 && lag.rate_hi >= 0 && far > 0, "rate span"),
        (reaches_one(far, lag.y_mantissa, lag.y_shift), "y mantissa or shift"),
    ])
}

/// `border · mantissa · 2^−shift` is 1 in Q31 to within 2⁻²⁸, and its product with a rounding fits an `i64`.
fn reaches_one(border: i64, mantissa: u32, shift: u8) -> bool {
    const TOLERANCE_Q31: u64 = 8;
    if shift > 31 || mantissa == 0 {
        return false;
    }
    // border ≤ 2^31 and mantissa < 2^32.
    border.checked_mul(i64::from(mantissa)).and_then(|p| p.checked_add(1 << 31)).is_some_and(|product| {
        let end = (product - (1 << 31)) >> shift;
        end.abs_diff(crate::series::ONE_Q31) <= TOLERANCE_Q31
    })
}

fn first_broken(rules: &[(bool, &'static str)]) -> Result<(), &'static str> {
    rules.iter().find(|(holds, _)| !holds).map_or(Ok(()), |(_, field)| Err(*field))
}
