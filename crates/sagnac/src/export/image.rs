//! From a calibration to the image that flash holds.
//!
//! Every number of the fit becomes an integer here, rounded once, on the host:
//!
//! ```text
//! b °/h       ─▶ b·tick/S0 counts per tick, Q40 as mantissa·2^(31 − shift), |mantissa| in [2²⁹, 2³⁰]
//! c °/h/(°C/min) ─▶ c·Ṫ_far as b; y = Ṫ/Ṫ_far       e ppm ─▶ e·1e-6, Q40
//! τ s         ─▶ α = 1 − e^(−Δt/τ), 31-bit mantissa    span ─▶ 2⁻²⁴ °C
//! ```
//!
//! Each input becomes an input of the image, in the order of the record. A column's unit is a power of two of its own, so
//! that its valid range fits the codes of an input. A shape gives its target's shape and the factor to it.
//!
//! The values of all terms at their references become, with opposite sign, one term of order 0 for bias and one for the scale
//! factor. A coefficient too large for its width is refused by name, never clipped.

use sagnac_core::{
    Description, Gain, Image, InputSpec, Kind, LagSpec, MAX_IMAGE_LEN, MAX_INPUTS, MAX_TERMS, Multiplier, Shape, Term,
    ValueSource,
};

use crate::calibration::{AxisCalibration, Calibration, Input, InputSource, LogUnit};
use crate::model::input::unit_exponent;
use crate::model::shape::{image_order, image_words};
use crate::model::{ActsOn, Form};
use sagnac_log::error::{Error, Result};

/// 2⁻²⁴ °C per °C.
const Q24: f64 = (1 << 24) as f64;
/// Longest duration of SETTLING, s.
const SETTLING_MAX_S: f64 = 3600.0;
const SETTLING_TAUS: f64 = 3.0;

/// The image of one axis.
///
/// # Errors
/// A number that does not fit the image, by name.
pub fn encode(calibration: &Calibration, axis: &AxisCalibration, parent: [u8; 32], sequence: u32) -> Result<Image> {
    let mut d = Description::empty();
    let serial = calibration.serial.as_bytes();
    let slot = d.serial.get_mut(..serial.len()).ok_or_else(|| too_large("serial", f64::NAN))?;
    slot.copy_from_slice(serial);
    d.axis = u8::try_from(axis.axis).map_err(|_| Error::input("no ASCII letter").column("axis"))?;
    d.tick_ns = calibration.target.tick_ns;
    d.period_ticks = calibration.target.period_ticks;
    d.slew_ticks = calibration.target.slew_ticks;
    d.scale_factor_femto_arcsec = unsigned("arcsec per count", calibration.unit.arcsec_per_lsb() * 1e15)?;
    d.quantum_nano_counts = match calibration.unit {
        LogUnit::Counts { quantum, .. } => unsigned("quantum", quantum * 1e9)?,
        LogUnit::Rates { .. } => 1_000_000_000,
    };
    d.reference_q24 = q24("reference_c", axis.reference_c())?;
    d.sequence = sequence;
    d.parent = parent;
    let channels = channels(axis)?;
    if channels.len() > MAX_INPUTS {
        return Err(too_large("number of inputs", channels.len() as f64));
    }
    for (slot, channel) in d.inputs.iter_mut().zip(&channels) {
        *slot = input_spec(channel, calibration.target.period_s())?;
    }
    d.input_count = channels.len() as u8;
    let terms = terms(calibration, axis, &channels)?;
    if terms.len() > MAX_TERMS {
        return Err(too_large("number of terms", terms.len() as f64));
    }
    d.terms[..terms.len()].copy_from_slice(&terms);
    d.term_count = terms.len() as u8;
    Image::new(d).map_err(|e| Error::input(format!("axis {}: no image can hold this calibration: {e}", axis.axis)))
}

/// The bytes of an image.
pub fn image_bytes(image: &Image) -> Vec<u8> {
    let mut bytes = vec![0; MAX_IMAGE_LEN];
    let len = image.encode(&mut bytes).unwrap_or(0);
    bytes.truncate(len);
    bytes
}

fn too_large(name: &str, value: f64) -> Error {
    Error::input("does not fit the image").column(name).value(value.to_string())
}

fn unsigned(name: &str, value: f64) -> Result<u64> {
    let rounded = value.round();
    if (1.0..1.8e19).contains(&rounded) { Ok(rounded as u64) } else { Err(too_large(name, value)) }
}

fn signed(name: &str, value: f64) -> Result<i32> {
    let rounded = value.round();
    if rounded.abs() < f64::from(i32::MAX) { Ok(rounded as i32) } else { Err(too_large(name, value)) }
}

fn q24(name: &str, celsius: f64) -> Result<i32> {
    signed(name, celsius * Q24)
}

/// An input as the image reads it.
struct Channel<'a> {
    input: &'a Input,
    source: ValueSource,
    /// One °C of the image is 2^exponent of its unit.
    exponent: i8,
}

impl Channel<'_> {
    /// The border of the rate span that is farther from zero, units per minute.
    fn rate_far(&self) -> Option<f64> {
        self.input.lag_s?;
        self.input.rate_span_per_min.map(|[lo, hi]| lo.abs().max(hi.abs())).filter(|far| *far > 0.0)
    }

    /// Units of the record per °C of the image.
    fn unit(&self) -> f64 {
        2.0_f64.powi(self.exponent.into())
    }
}

/// The record's inputs in their order.
fn channels(axis: &AxisCalibration) -> Result<Vec<Channel<'_>>> {
    let inputs = &axis.correction.inputs;
    let index_of = |wanted: &String, of: &Input| {
        let found = inputs.iter().position(|other| other.source == InputSource::Thermometer(wanted.clone()));
        found.and_then(|at| u8::try_from(at).ok()).ok_or_else(|| {
            Error::input("a difference of thermometers that are not inputs").column("inputs").value(&of.name)
        })
    };
    let channel = |input| {
        let input: &Input = input;
        let (source, exponent) = match &input.source {
            InputSource::Thermometer(_) => (ValueSource::Code, 0),
            InputSource::Difference(of, less) => {
                (ValueSource::Difference { of: index_of(of, input)?, less: index_of(less, input)? }, 0)
            }
            InputSource::Column(_) => (ValueSource::Code, unit_exponent(input.valid_range)),
            InputSource::Repeat(of) => {
                let found = inputs.iter().position(|other| other.name == *of).and_then(|at| u8::try_from(at).ok());
                let of = found.ok_or_else(|| {
                    Error::input("a repeat of an input that the record does not have")
                        .column("inputs")
                        .value(&input.name)
                })?;
                let exponent = if axis.is_in_celsius(input) { 0 } else { unit_exponent(input.valid_range) };
                (ValueSource::Repeat { of }, exponent)
            }
        };
        Ok(Channel { input, source, exponent })
    };
    inputs.iter().map(channel).collect()
}

/// Codes that the target passes to an image at a slow update.
#[derive(Clone, Debug, PartialEq)]
pub struct Code {
    /// Thermometer, difference, column or repeat.
    pub name: String,
    /// Value at code 0, in its own unit.
    pub offset: f64,
    /// Units per code; `None` for a difference or a repeat, which the target makes itself.
    pub per_code: Option<f64>,
}

/// The codes of an axis in the order of its image.
pub fn codes(axis: &AxisCalibration) -> Vec<Code> {
    let code = |input: &Input| {
        let per_code = input.has_code().then_some(input.gain_per_code);
        Code { name: input.name.clone(), offset: input.offset, per_code }
    };
    axis.correction.inputs.iter().map(code).collect()
}

fn input_spec(of: &Channel<'_>, period_s: f64) -> Result<InputSpec> {
    let (unit, input) = (of.unit(), of.input);
    let span = input.span;
    // Spans of our own stand on even codes already; others move by one code at most.
    let (span_lo_q24, mut span_hi_q24) = (q24("span_c", span[0] / unit)?, q24("span_c", span[1] / unit)?);
    span_hi_q24 += (span_hi_q24 ^ span_lo_q24) & 1;
    let half = (i64::from(span_hi_q24) - i64::from(span_lo_q24)) / 2;
    let (x_mantissa, shift_to_q31) = reciprocal("span_c", half)?;
    let x_shift =
        shift_to_q31.checked_sub(16).ok_or_else(|| too_large("span_c (narrower than 0.004 °C)", half as f64))?;
    let lag = match (input.lag_s, of.rate_far()) {
        (Some(lag), Some(far)) => {
            let [lo, hi] = input.rate_span_per_min.unwrap_or([-far, far]);
            lag_spec(lag.value, period_s, far / unit, [lo / unit, hi / unit])?
        }
        _ => LagSpec::default(),
    };
    let settling_s = input.lag_s.map_or(0.0, |lag| (SETTLING_TAUS * lag.value).min(SETTLING_MAX_S));
    let has_code = of.source == ValueSource::Code;
    for value in span.into_iter().filter(|_| has_code) {
        let code = (value - input.offset) / input.gain_per_code;
        if code.abs() > f64::from(i32::MAX) {
            let what = format!("32-bit codes of {} do not reach {value:.2} of the fit span", input.name);
            return Err(Error::input(what).column("gain_per_code").value(input.gain_per_code.to_string()));
        }
    }
    Ok(InputSpec {
        source: of.source,
        unit_exponent: of.exponent,
        offset_q24: if has_code { q24("offset", input.offset / unit)? } else { 0 },
        gain: if has_code { gain(input.gain_per_code / unit * Q24)? } else { Gain::ONE },
        valid_lo_q24: q24("valid_range", input.valid_range[0] / unit)?,
        valid_hi_q24: q24("valid_range", input.valid_range[1] / unit)?,
        span_lo_q24,
        span_hi_q24,
        x_mantissa,
        x_shift,
        lag,
        stale_after_updates: (input.stale_after_s / period_s).ceil() as u32,
        settling_updates: if lag.is_used() { (settling_s / period_s).ceil() as u32 } else { 0 },
    })
}

/// `mantissa · 2^−shift` with a mantissa of 30 bits.
fn gain(value: f64) -> Result<Gain> {
    let shift = 30 - value.abs().log2().floor() as i32;
    let shift = shift.clamp(0, 62);
    Ok(Gain { mantissa: signed("gain_per_code", value * 2.0_f64.powi(shift))?, shift: shift as u8 })
}

/// `mantissa · 2^−shift` that takes `border` to 1 in Q31, with 32 significant bits.
fn reciprocal(name: &str, border: i64) -> Result<(u32, u8)> {
    let border_wide = u128::try_from(border).ok().filter(|b| *b > 0).ok_or_else(|| too_large(name, border as f64))?;
    for shift in (0..=31_u8).rev() {
        let mantissa = ((1_u128 << (32 + shift)) / border_wide).div_ceil(2);
        if let Ok(mantissa) = u32::try_from(mantissa) {
            return Ok((mantissa, shift));
        }
    }
    Err(too_large(name, border as f64))
}

fn lag_spec(tau_s: f64, period_s: f64, far_cpm: f64, span_cpm: [f64; 2]) -> Result<LagSpec> {
    let alpha = -(-period_s / tau_s).exp_m1();
    let alpha_shift = 30 - alpha.log2().floor() as i32;
    if !(31..=62).contains(&alpha_shift) {
        return Err(too_large("lag_s", tau_s));
    }
    // The finest unit in which the far border of the rate span still fits 31 bits.
    let far_step = far_cpm * period_s / 60.0;
    let far_bits = (far_step * Q24).log2().ceil();
    if !far_bits.is_finite() {
        return Err(too_large("rate_span_cpm", far_cpm));
    }
    let rate_shift = (30.0 - far_bits).clamp(0.0, f64::from(alpha_shift - 1)) as i32;
    let step = |cpm: f64| signed("rate_span_cpm", cpm * period_s / 60.0 * Q24 * 2.0_f64.powi(rate_shift));
    let (rate_lo, rate_hi) = (step(span_cpm[0].min(0.0))?, step(span_cpm[1].max(0.0))?);
    let far = i64::from(rate_lo).abs().max(i64::from(rate_hi).abs());
    let (y_mantissa, y_shift) = reciprocal("rate_span_cpm", far)?;
    Ok(LagSpec {
        alpha_mantissa: (alpha * 2.0_f64.powi(alpha_shift)).round() as u32,
        alpha_shift: alpha_shift as u8,
        rate_shift: rate_shift as u8,
        rate_lo,
        rate_hi,
        y_mantissa,
        y_shift,
    })
}

fn terms(calibration: &Calibration, axis: &AxisCalibration, channels: &[Channel<'_>]) -> Result<Vec<Term>> {
    let per_dph = calibration.target.tick_s() / calibration.unit.arcsec_per_lsb();
    let mut out = Vec::new();
    // The values of all terms at their references: bias, scale factor.
    let mut at_reference = [0.0; 2];
    for fitted in &axis.correction.terms {
        let found = channels.iter().enumerate().find(|(_, channel)| channel.input.name == fitted.input);
        let (index, channel) = found.ok_or_else(|| {
            Error::input("a term over an input that the record does not have")
                .column("terms.input")
                .value(&fitted.input)
        })?;
        let Form { acts_on, shape, times_rate } = fitted.form();
        let span = channel.input.scaling();
        let (target, factor) = shape.encode(span).map_err(|what| too_large(&format!("terms.{what}"), fitted.value))?;
        let (kind, unit) = match acts_on {
            ActsOn::Bias => (Kind::Bias, per_dph),
            ActsOn::ScaleFactor => (Kind::Scale, 1e-6),
        };
        let (multiplier, rate) =
            if times_rate { (Multiplier::Rate, channel.rate_far().unwrap_or(0.0)) } else { (Multiplier::One, 1.0) };
        if !times_rate {
            at_reference[usize::from(kind == Kind::Scale)] +=
                fitted.value * shape.value(span, channel.input.reference) * unit;
        }
        let row = Row { kind, input: index as u8, shape: target, multiplier };
        out.extend(term(row, fitted.value * factor * unit * rate)?);
    }
    for (kind, zero) in [Kind::Bias, Kind::Scale].into_iter().zip(at_reference) {
        let row = Row { kind, input: 0, shape: Shape::Chebyshev(0), multiplier: Multiplier::One };
        out.extend(term(row, -zero)?);
    }
    // Bias before rate before scale, input by input, order by order: one record, one image.
    out.sort_by_key(|term: &Term| {
        (term.kind == Kind::Scale, term.multiplier == Multiplier::Rate, term.input, image_order(term.shape))
    });
    Ok(out)
}

/// A row of the image's table of terms, without its coefficient.
struct Row {
    kind: Kind,
    input: u8,
    shape: Shape,
    multiplier: Multiplier,
}

/// A coefficient in counts per tick (or as a part of one) as mantissa and shift; `None` for zero.
fn term(row: Row, value: f64) -> Result<Option<Term>> {
    let Row { kind, input, shape, multiplier } = row;
    let q40 = value * 2.0_f64.powi(40);
    let shift = (60.0 - q40.abs().log2().floor()).min(62.0);
    let mantissa = (q40 * 2.0_f64.powf(shift - 31.0)).round();
    if mantissa == 0.0 || value == 0.0 {
        return Ok(None);
    }
    if shift < 8.0 || !mantissa.is_finite() {
        let what = format!("{kind:?} term: {}", image_words(shape));
        return Err(too_large(&what, value));
    }
    Ok(Some(Term { kind, input, shape, multiplier, mantissa: mantissa as i32, shift: shift as u8 }))
}
