//! What an image says of faults: how long its lags settle, and which step of an input no value makes.
//!
//! ```text
//! bound         max(0.1 °/h, 0.05·ΣR)      R the effect of a lag at its largest rate Ṫ: status 0 is never off by more
//! settling      τ·max(3, ln(2·R·n/bound))  of each of n lags that begins again: from the fastest cooling to the fastest heating are 2·R
//! largest step  max(that of the record, Δt at the largest rate, min(½·bound/Σ(R·α/Ṫ + D), 20 s at the largest rate))
//!               behind a lag a step of δ is a rate of α·δ, on the terms D·δ with their steepest slope D; Δt is the temperature period
//! ```
//!
//! Scale terms with a rate count for nothing here: their effect follows the input rate.

use std::f64::consts::PI;

use sagnac_core::{Description, Kind, Multiplier, Shape, Term, ValueSource};

use crate::calibration::SAMPLED_S;
use crate::image::channels::{InputChannel, Q24, too_large};
use sagnac_log::error::Result;

/// SETTLING lasts at least so many time constants.
const SETTLING_TAUS: f64 = 3.0;
/// What status 0 may be off by: °/h, or a part of the largest rate effect of the image, whichever is larger.
const MOST_DPH: f64 = 0.1;
const MOST_PART: f64 = 0.05;
/// Rate terms have half of the bound; the curve and a ramp have the other.
const HALVES: f64 = 2.0;
/// Largest exponent of a step's growth.
const MOST_GROWTH: u8 = 16;

/// The effects of an image's lags, and the bound that they make.
pub(super) struct FaultBounds {
    /// Of each input, at its largest rate, °/h.
    effects_dph: Vec<f64>,
    /// The steepest slope of each input's terms, °/h per half of its span.
    slopes_dph: Vec<f64>,
    lags: usize,
    bound_dph: f64,
}

impl FaultBounds {
    /// Of an image with all its inputs and terms.
    pub(super) fn of(d: &Description, dph_per_count: f64) -> Self {
        let terms = &d.terms[..usize::from(d.term_count)];
        let sum = |input: usize, part: fn(&Term) -> f64| -> f64 {
            let own = terms.iter().filter(|term| usize::from(term.input) == input && term.kind == Kind::Bias);
            let size = |term: &Term| f64::from(term.mantissa).abs() * 2.0_f64.powi(-9 - i32::from(term.shift));
            own.map(|term| size(term) * part(term)).sum::<f64>() * dph_per_count
        };
        let inputs = &d.inputs[..usize::from(d.input_count)];
        let of_rate = |term: &Term| f64::from(u8::from(term.multiplier == Multiplier::Rate));
        let effects_dph: Vec<f64> = (0..inputs.len()).map(|input| sum(input, of_rate)).collect();
        let slopes_dph = (0..inputs.len()).map(|input| sum(input, steepest)).collect();
        let bound_dph = MOST_DPH.max(MOST_PART * effects_dph.iter().sum::<f64>());
        Self { effects_dph, slopes_dph, lags: inputs.iter().filter(|input| input.lag.is_used()).count(), bound_dph }
    }

    /// The settling time of each lag, from their time constants in the order of the inputs.
    pub(super) fn settle(&self, d: &mut Description, taus_s: &[Option<f64>], period_s: f64) {
        for ((input, effect), tau_s) in d.inputs.iter_mut().zip(&self.effects_dph).zip(taus_s) {
            let taus = SETTLING_TAUS.max((2.0 * effect * self.lags as f64 / self.bound_dph).ln());
            let settling_s = tau_s.filter(|_| input.lag.is_used()).map_or(0.0, |tau_s| taus * tau_s);
            input.settling_updates = (settling_s / period_s).ceil() as u32;
        }
    }

    /// The largest step of each input with a code, and its growth while no value comes.
    ///
    /// # Errors
    /// A step that no image holds.
    pub(super) fn limit_steps(&self, d: &mut Description, channels: &[InputChannel<'_>], period_s: f64) -> Result<()> {
        for (at, channel) in channels.iter().enumerate().filter(|(_, channel)| channel.source == ValueSource::Code) {
            let (unit, input) = (channel.unit(), channel.input);
            let harmless = self.bound_dph / (HALVES * self.effect_of_step(d, at));
            let widened = (harmless * unit).min(SAMPLED_S * input.max_rate_per_s);
            let step = input.max_step.max(widened).max(period_s * input.max_rate_per_s);
            let largest_step_q8 = if input.max_step > 0.0 { largest_step(step / unit)? } else { 0 };
            d.inputs[at].largest_step_q8 = largest_step_q8;
            d.inputs[at].step_growth = step_growth(largest_step_q8, input.max_rate_per_s / unit * period_s);
        }
        Ok(())
    }

    /// The effect of a step of an input on its terms and behind its lag, and on all that is derived from it, °/h per °C of the image.
    fn effect_of_step(&self, d: &Description, of: usize) -> f64 {
        let reads = |at: &usize| match d.inputs[*at].source {
            ValueSource::Difference { of: a, less } => [a, less].map(usize::from).contains(&of),
            ValueSource::Repeat { of: a } => usize::from(a) == of,
            ValueSource::Code | ValueSource::WarmUp => *at == of,
        };
        let effect = |at: usize| {
            let lag = d.inputs[at].lag;
            let alpha = f64::from(lag.alpha_mantissa) * 2.0_f64.powi(-i32::from(lag.alpha_shift));
            let border = f64::from(lag.rate_hi.max(lag.rate_lo.saturating_neg()));
            let far = border * 2.0_f64.powi(-i32::from(lag.rate_shift)) / Q24;
            let half = (f64::from(d.inputs[at].span_hi_q24) - f64::from(d.inputs[at].span_lo_q24)) / 2.0 / Q24;
            let on_terms = if half > 0.0 { self.slopes_dph[at] / half } else { 0.0 };
            on_terms + if lag.is_used() { self.effects_dph[at] * alpha / far } else { 0.0 }
        };
        (0..self.effects_dph.len()).filter(reads).map(effect).sum()
    }
}

/// The steepest slope of a term's shape over half a span: n² of T_n, π times the turns of a harmonic over the whole.
fn steepest(term: &Term) -> f64 {
    match term.shape {
        Shape::Chebyshev(order) => f64::from(order).powi(2),
        Shape::Zone { .. } => 1.0,
        Shape::Step { .. } => 0.0,
        Shape::Cosine { turns_q18 } | Shape::Sine { turns_q18 } => PI * f64::from(turns_q18) / f64::from(1 << 18),
    }
}

/// Rounded up; a step that no code can make is any step.
fn largest_step(celsius: f64) -> Result<u16> {
    let q8 = (celsius * 256.0).ceil();
    if q8 <= f64::from(u16::MAX) {
        Ok(q8 as u16)
    } else {
        Err(too_large(
            "max_step",
            celsius,
            "steps of up to 255 °C, or of 255 times the power of two that a column is scaled by",
        ))
    }
}

/// The least power of two of the largest step that is as far as a value may move in a temperature period, °C.
fn step_growth(largest_step_q8: u16, celsius: f64) -> u8 {
    let growth = |shift: &u8| f64::from(largest_step_q8) * 2.0_f64.powi(i32::from(*shift)) >= celsius * Q24;
    match largest_step_q8 > 0 && celsius > 0.0 {
        true => (1..=MOST_GROWTH).find(growth).unwrap_or(MOST_GROWTH),
        false => 0,
    }
}
