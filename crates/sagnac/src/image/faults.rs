//! What an image says of faults: how long its lags settle, and which step of an input no value makes.
//!
//! ```text
//! bound         max(0.1 °/h, 0.05·ΣR)      R the effect of a lag at its largest rate Ṫ: status 0 is never off by more
//! settling      τ·max(3, ln(2·R·n/bound))  of each of n lags that begins again: from the fastest cooling to the fastest heating are 2·R
//! largest step  max(that of the record, min(½·bound/Σ(R·α/Ṫ), 20 s at the largest rate))   behind a lag a step of δ is a rate of α·δ
//! ```
//!
//! Scale terms with a rate count for nothing here: their effect follows the input rate.

use sagnac_core::{Description, Kind, Multiplier, ValueSource};

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
    lags: usize,
    bound_dph: f64,
}

impl FaultBounds {
    /// Of an image with all its inputs and terms.
    pub(super) fn of(d: &Description, dph_per_count: f64) -> Self {
        let effect = |input: usize| -> f64 {
            let terms = d.terms[..usize::from(d.term_count)].iter();
            let of_lag = terms.filter(|term| {
                usize::from(term.input) == input && term.multiplier == Multiplier::Rate && term.kind == Kind::Bias
            });
            let counts = of_lag.map(|term| f64::from(term.mantissa).abs() * 2.0_f64.powi(-9 - i32::from(term.shift)));
            counts.sum::<f64>() * dph_per_count
        };
        let inputs = &d.inputs[..usize::from(d.input_count)];
        let effects_dph: Vec<f64> = (0..inputs.len()).map(effect).collect();
        let bound_dph = MOST_DPH.max(MOST_PART * effects_dph.iter().sum::<f64>());
        Self { effects_dph, lags: inputs.iter().filter(|input| input.lag.is_used()).count(), bound_dph }
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
            let step = input.max_step.max((harmless * unit).min(SAMPLED_S * input.max_rate_per_s));
            let largest_step_q8 = if input.max_step > 0.0 { largest_step(step / unit)? } else { 0 };
            d.inputs[at].largest_step_q8 = largest_step_q8;
            d.inputs[at].step_growth = step_growth(largest_step_q8, input.max_rate_per_s / unit * period_s);
        }
        Ok(())
    }

    /// What a step of an input makes behind its lag and those of all that is derived from it, °/h per °C of the image.
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
            if lag.is_used() { self.effects_dph[at] * alpha / far } else { 0.0 }
        };
        (0..self.effects_dph.len()).filter(reads).map(effect).sum()
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
