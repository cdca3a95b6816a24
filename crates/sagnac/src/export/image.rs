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
//! The offsets −Σ bᵢTᵢ(x0) and −Σ e_kT_k(x0) become terms of order 0. A coefficient too large for its
//! width is refused by name, never clipped.

use sagnac_core::{Description, Image, Kind, LagSpec, MAX_IMAGE_LEN, MAX_TERMS, Multiplier, Scale, Term, Thermometer};

use crate::calibration::{AxisCalibration, Calibration, LogUnit, TermKind};
use crate::error::{Error, Result};
use crate::fit::{BASIS_LEN, Span, chebyshev};

/// 2⁻²⁴ °C per °C.
const Q24: f64 = (1 << 24) as f64;
/// SETTLING lasts no longer than this, s.
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
    d.reference_q24 = q24("reference_c", axis.reference_c)?;
    d.sequence = sequence;
    d.parent = parent;
    let far_cpm = rate_far(axis);
    d.thermometers[0] = thermometer(calibration, axis, far_cpm)?;
    d.thermometer_count = 1;
    let terms = terms(calibration, axis, far_cpm)?;
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

/// The border of the rate span that is farther from zero, °C/min.
fn rate_far(axis: &AxisCalibration) -> Option<f64> {
    axis.lag_s?;
    axis.rate_span_cpm.map(|[lo, hi]| lo.abs().max(hi.abs())).filter(|far| *far > 0.0)
}

fn thermometer(calibration: &Calibration, axis: &AxisCalibration, far_cpm: Option<f64>) -> Result<Thermometer> {
    let spec = &calibration.thermometer;
    let period_s = calibration.target.period_s();
    // Spans of our own stand on even codes already; others move by one code at most.
    let (span_lo_q24, mut span_hi_q24) = (q24("span_c", axis.span_c[0])?, q24("span_c", axis.span_c[1])?);
    span_hi_q24 += (span_hi_q24 ^ span_lo_q24) & 1;
    let half = (i64::from(span_hi_q24) - i64::from(span_lo_q24)) / 2;
    let (x_mantissa, shift_to_q31) = reciprocal("span_c", half)?;
    let x_shift =
        shift_to_q31.checked_sub(16).ok_or_else(|| too_large("span_c (narrower than 0.004 °C)", half as f64))?;
    let lag = match (axis.lag_s, far_cpm) {
        (Some(lag), Some(far)) => lag_spec(lag.value, period_s, far, axis.rate_span_cpm.unwrap_or([-far, far]))?,
        _ => LagSpec::default(),
    };
    let settling_s = axis.lag_s.map_or(0.0, |lag| (SETTLING_TAUS * lag.value).min(SETTLING_MAX_S));
    for celsius in axis.span_c {
        let code = (celsius - spec.offset_c) / spec.gain_c_per_code;
        if code.abs() > f64::from(i32::MAX) {
            let what = format!("the thermometer's 32-bit codes do not reach {celsius:.2} °C of the fit span");
            return Err(Error::input(what)
                .column("thermometer.gain_c_per_code")
                .value(spec.gain_c_per_code.to_string()));
        }
    }
    Ok(Thermometer {
        offset_q24: q24("thermometer.offset_c", spec.offset_c)?,
        gain: gain(spec.gain_c_per_code * Q24)?,
        plausible_lo_q24: q24("thermometer.plausible_c", spec.plausible_c[0])?,
        plausible_hi_q24: q24("thermometer.plausible_c", spec.plausible_c[1])?,
        span_lo_q24,
        span_hi_q24,
        x_mantissa,
        x_shift,
        lag,
        hold_updates: (spec.hold_s / period_s).ceil() as u32,
        settling_updates: if lag.is_used() { (settling_s / period_s).ceil() as u32 } else { 0 },
    })
}

/// `mantissa · 2^−shift` with a mantissa of 30 bits.
fn gain(value: f64) -> Result<Scale> {
    let shift = 30 - value.abs().log2().floor() as i32;
    let shift = shift.clamp(0, 62);
    Ok(Scale { mantissa: signed("thermometer.gain_c_per_code", value * 2.0_f64.powi(shift))?, shift: shift as u8 })
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

fn terms(calibration: &Calibration, axis: &AxisCalibration, far_cpm: Option<f64>) -> Result<Vec<Term>> {
    let span = Span { lo_c: axis.span_c[0], hi_c: axis.span_c[1] };
    let at_reference = chebyshev(span.x(axis.reference_c));
    let per_dph = calibration.target.tick_s() / calibration.unit.arcsec_per_lsb();
    let mut out = Vec::new();
    let mut series = |kind: Kind, multiplier: Multiplier, name: TermKind, factor: f64| -> Result<()> {
        let mut coefficients = axis.series(name);
        if multiplier == Multiplier::One {
            coefficients[0] = -(1..BASIS_LEN).map(|n| coefficients[n] * at_reference[n]).sum::<f64>();
        }
        for (order, coefficient) in (0_u8..).zip(coefficients) {
            out.extend(term(kind, order, multiplier, coefficient * factor)?);
        }
        Ok(())
    };
    series(Kind::Bias, Multiplier::One, TermKind::Bias, per_dph)?;
    if let Some(far) = far_cpm {
        series(Kind::Bias, Multiplier::Rate, TermKind::Rate, per_dph * far)?;
    }
    series(Kind::Scale, Multiplier::One, TermKind::Scale, 1e-6)?;
    Ok(out)
}

/// A coefficient in counts per tick (or as a part of one) as mantissa and shift; `None` for zero.
fn term(kind: Kind, order: u8, multiplier: Multiplier, value: f64) -> Result<Option<Term>> {
    let q40 = value * 2.0_f64.powi(40);
    let shift = (60.0 - q40.abs().log2().floor()).min(62.0);
    let mantissa = (q40 * 2.0_f64.powf(shift - 31.0)).round();
    if mantissa == 0.0 || value == 0.0 {
        return Ok(None);
    }
    if shift < 8.0 || !mantissa.is_finite() {
        return Err(too_large(&format!("{kind:?} term of order {order}"), value));
    }
    Ok(Some(Term { kind, sensor: 0, order, multiplier, mantissa: mantissa as i32, shift: shift as u8 }))
}
