//! From a correction to the image that flash holds: the only place that knows what an image can hold.
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
//! that its valid range fits the codes of an input. A shape gives its target's shape and the factor to it. A warm-up is one more input
//! behind them, with one term over its rate.
//!
//! The values of all terms at their references become, with opposite sign, one term of order 0 for bias and one for the scale
//! factor. A coefficient too large for its width is refused by name, never clipped:
//!
//! ```text
//! a bias term          2¹³ counts per tick: 8,192·S0/tick °/h
//! all bias terms       min(2¹⁴, 2²⁹/ticks of a temperature period) counts per tick, Σ|coefficient|
//! all scale terms      2⁻⁶: 15,625 ppm, Σ|coefficient|
//! ```
//!
//! A rate table gives y·(1 + ε0 + ε) = Ω + C + d for a log rate y: ε0 is the deviation of the scale factor at T0, and stays in the
//! output. The target computes y·(1 + ε′) − d′, so that every coefficient is divided by 1 + ε0 here: (Ω + C)/(1 + ε0) comes out, exactly.
//!
//! The counts of a rate log have no size of their own. [`rate_unit`] takes the finest decade from 1e-4 arcsec on that holds the
//! correction with a margin of [`RATE_MARGIN`]. The fit asks [`Holder`] before it selects a model.

mod channels;
mod faults;

use sagnac_core::{
    Description, Gain, Image, InputSpec, Kind, LagSpec, MAX_IMAGE_LEN, MAX_INPUTS, MAX_SCALE, MAX_TERMS, Multiplier,
    Shape, Term, ValueSource,
};

use crate::calibration::{AxisCalibration, AxisCorrection, Calibration, Input, LogUnit, Target, WarmUp};
use crate::image::channels::{InputChannel, Q24, channels, too_large};
use crate::image::faults::FaultBounds;
use crate::model::shape::image_order;
use crate::model::{ActsOn, Form};
use sagnac_log::error::{Error, Result};
use sagnac_units::format::significant;

/// Largest coefficient of a bias term, counts per tick.
const TERM_MAX: f64 = 8192.0;
/// Counts of a rate log, arcsec.
const RATE_LSBS: [f64; 8] = [1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0];
/// A rate log's count is so large that this many times its correction would still fit.
const RATE_MARGIN: f64 = 4.0;
/// One count per tick in 2⁻³².
const COUNT_PER_TICK: f64 = 4_294_967_296.0;

/// The image of one axis.
///
/// # Errors
/// A number that does not fit the image: axis, term, limit, and what to do.
pub fn encode(calibration: &Calibration, axis: &AxisCalibration, parent: [u8; 32], sequence: u32) -> Result<Image> {
    let scale_at_reference = 1.0 + axis.scale_factor().map_or(0.0, |scale| scale.at_reference.ppm * 1e-6);
    let frame = Frame { axis: axis.axis, unit: calibration.unit, target: calibration.target, scale_at_reference };
    let serial = calibration.serial.as_bytes();
    let image = frame.encode(&axis.correction, |d| {
        (d.parent, d.sequence) = (parent, sequence);
        let slot = d.serial.get_mut(..serial.len()).ok_or_else(|| too_large("serial", f64::NAN, "32 bytes"))?;
        slot.copy_from_slice(serial);
        Ok(())
    })?;
    check_work(&image, calibration.setup.slow_update_instructions_max)?;
    Ok(image)
}

/// Refuses an image whose slow update takes longer than the target has time for.
fn check_work(image: &Image, most: Option<u32>) -> Result<()> {
    let instructions = image.work().instructions();
    most.filter(|most| instructions > *most).map_or(Ok(()), |most| {
        let axis = char::from(image.description().axis);
        Err(Error::input(
            format!(
                "axis {axis}: the slow update takes {instructions} instructions, and the target has time for {most}"
            ),
            "choose a smaller --model, or fewer inputs",
        )
        .column("slow_update_instructions_max"))
    })
}

/// What an image is asked to hold corrections for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Holder {
    /// Size of a count; `None` for a rate log whose counts follow its correction.
    pub(crate) unit: Option<LogUnit>,
    pub(crate) target: Target,
    /// Most instructions of its slow update, where the setup limits them.
    pub(crate) most_instructions: Option<u32>,
}

impl Holder {
    /// # Errors
    /// As [`encode`].
    pub(crate) fn check(self, axis: char, correction: &AxisCorrection) -> Result<()> {
        let unit = match self.unit {
            Some(unit) => unit,
            None => rate_unit(self.target, &[(axis, correction)])?,
        };
        // Before a fit no scale factor is known: it moves the coefficients by some per cent of the margin.
        let frame = Frame { axis, unit, target: self.target, scale_at_reference: 1.0 };
        let image = frame.encode(correction, |_| Ok(()))?;
        check_work(&image, self.most_instructions)
    }
}

/// The virtual count of a rate log: the finest decade in which every axis fits with a margin.
///
/// # Errors
/// As [`encode`], where no size of count helps.
pub(crate) fn rate_unit(target: Target, axes: &[(char, &AxisCorrection)]) -> Result<LogUnit> {
    let fits = |lsb_arcsec: f64| {
        let unit = LogUnit::Rates { lsb_arcsec };
        let holder = Holder { unit: Some(unit), target, most_instructions: None };
        axes.iter().try_for_each(|(axis, correction)| holder.check(*axis, correction))
    };
    let mut refusal = Error::defect("no count size was tried");
    for lsb_arcsec in RATE_LSBS {
        match fits(lsb_arcsec / RATE_MARGIN) {
            Ok(()) => return Ok(LogUnit::Rates { lsb_arcsec }),
            Err(error) => refusal = error,
        }
    }
    Err(refusal)
}

/// All of an image but its correction and its names.
#[derive(Clone, Copy)]
struct Frame {
    axis: char,
    unit: LogUnit,
    target: Target,
    /// 1 + ε0: the scale factor at T0 over its nominal value; 1 where no table gave it.
    scale_at_reference: f64,
}

impl Frame {
    fn encode(self, correction: &AxisCorrection, name: impl Fn(&mut Description) -> Result<()>) -> Result<Image> {
        self.encode_nameless(correction, name).map_err(|error| error.of(&format!("axis {}", self.axis)))
    }

    fn encode_nameless(
        self,
        correction: &AxisCorrection,
        name: impl Fn(&mut Description) -> Result<()>,
    ) -> Result<Image> {
        let Self { axis, unit, target, .. } = self;
        let mut d = Description::empty();
        name(&mut d)?;
        d.axis = u8::try_from(axis)
            .map_err(|_| Error::input("the axis must be one ASCII letter", "name the axis x, y or z").column("axis"))?;
        d.tick_ns = target.tick_ns;
        d.period_ticks = target.period_ticks;
        d.slew_ticks = target.slew_ticks;
        d.scale_factor_femto_arcsec = unsigned("arcsec per count", unit.arcsec_per_lsb() * 1e15)?;
        d.quantum_nano_counts = match unit {
            LogUnit::Counts { quantum, .. } => unsigned("quantum", quantum * 1e9)?,
            LogUnit::Rates { .. } => 1_000_000_000,
        };
        d.reference_q24 = q24("reference_c", correction.inputs.first().map_or(f64::NAN, |main| main.reference))?;
        let channels = channels(correction)?;
        if channels.len() > MAX_INPUTS {
            return Err(too_large("inputs", channels.len() as f64, &format!("{MAX_INPUTS} inputs")));
        }
        for (slot, channel) in d.inputs.iter_mut().zip(&channels) {
            let name = &channel.input.name;
            *slot = input_spec(channel, target.period_s()).map_err(|error| error.of(&format!("input {name}")))?;
        }
        d.input_count = channels.len() as u8;
        let mut rows = self.rows(correction, &channels)?;
        if let Some(warm_up) = &correction.warm_up {
            let slot = d.inputs.get_mut(channels.len()).ok_or_else(|| {
                let inputs = channels.len() as f64 + 1.0;
                too_large("inputs", inputs, &format!("{MAX_INPUTS} inputs, of which a warm-up is one"))
            })?;
            *slot = warm_up_spec(warm_up, target.period_s()).map_err(|error| error.of(WARM_UP))?;
            rows.extend(self.warm_up_row(warm_up, d.input_count)?);
            d.input_count += 1;
        }
        self.check_sums(&rows)?;
        let terms: Vec<Term> = rows.iter().map(|row| row.term).collect();
        if terms.len() > MAX_TERMS {
            return Err(too_large("terms", terms.len() as f64, &format!("{MAX_TERMS} terms")));
        }
        d.terms[..terms.len()].copy_from_slice(&terms);
        d.term_count = terms.len() as u8;
        let taus_s = channels.iter().map(|channel| channel.input.lag_s.map(|lag| lag.value));
        let taus_s: Vec<Option<f64>> =
            taus_s.chain([correction.warm_up.as_ref().map(|warm_up| warm_up.tau_s.value)]).collect();
        let dph_per_count = unit.arcsec_per_lsb() / (f64::from(target.tick_ns) * 1e-9);
        let bounds = FaultBounds::of(&d, dph_per_count);
        bounds.settle(&mut d, &taus_s, target.period_s());
        bounds.limit_steps(&mut d, &channels, target.period_s())?;
        Image::new(d)
            .map_err(|e| Error::input(format!("no image can hold this correction: {e}"), "choose a smaller --model"))
    }
}

/// The bytes of an image.
pub fn image_bytes(image: &Image) -> Vec<u8> {
    let mut bytes = vec![0; MAX_IMAGE_LEN];
    let len = image.encode(&mut bytes).unwrap_or(0);
    bytes.truncate(len);
    bytes
}

fn unsigned(name: &str, value: f64) -> Result<u64> {
    let rounded = value.round();
    if (1.0..1.8e19).contains(&rounded) {
        Ok(rounded as u64)
    } else {
        Err(too_large(name, value, "1 to 1.8e19 units of its last place"))
    }
}

fn signed(name: &str, value: f64, holds: &str) -> Result<i32> {
    let rounded = value.round();
    if rounded.abs() < f64::from(i32::MAX) { Ok(rounded as i32) } else { Err(too_large(name, value, holds)) }
}

fn q24(name: &str, celsius: f64) -> Result<i32> {
    signed(name, celsius * Q24, "±128 °C, or ±128 of the power of two that a column is scaled by")
}

/// Codes that the target passes to an image at a slow update.
#[derive(Clone, Debug, PartialEq)]
pub struct Code {
    /// Thermometer, difference, column, repeat or warm-up.
    pub name: String,
    /// Value at code 0, in its own unit.
    pub offset: f64,
    /// Units per code; `None` for a difference, a repeat or a warm-up, which the target makes itself.
    pub per_code: Option<f64>,
}

/// The codes of an axis in the order of its image.
pub fn codes(axis: &AxisCalibration) -> Vec<Code> {
    let code = |input: &Input| {
        let per_code = input.has_code().then_some(input.gain_per_code);
        Code { name: input.name.clone(), offset: input.offset, per_code }
    };
    let warm_up =
        axis.correction.warm_up.iter().map(|_| Code { name: WARM_UP.to_owned(), offset: 0.0, per_code: None });
    axis.correction.inputs.iter().map(code).chain(warm_up).collect()
}

fn input_spec(channel: &InputChannel<'_>, period_s: f64) -> Result<InputSpec> {
    let (unit, input) = (channel.unit(), channel.input);
    let span = input.span;
    // Spans of our own stand on even codes already; others move by one code at most.
    let (span_lo_q24, mut span_hi_q24) = (q24("span_c", span[0] / unit)?, q24("span_c", span[1] / unit)?);
    span_hi_q24 += (span_hi_q24 ^ span_lo_q24) & 1;
    let half = (i64::from(span_hi_q24) - i64::from(span_lo_q24)) / 2;
    let (x_mantissa, shift_to_q31) = reciprocal("span_c", half)?;
    let x_shift =
        shift_to_q31.checked_sub(16).ok_or_else(|| too_large("span", half as f64, "spans of 0.004 °C or more"))?;
    let lag = match (input.lag_s, channel.rate_far()) {
        (Some(lag), Some(far)) => {
            let [lo, hi] = input.rate_span_per_min.unwrap_or([-far, far]);
            lag_spec(lag.value, period_s, far / unit, [lo / unit, hi / unit])?
        }
        _ => LagSpec::default(),
    };
    let has_code = channel.source == ValueSource::Code;
    for value in span.into_iter().filter(|_| has_code) {
        let code = (value - input.offset) / input.gain_per_code;
        if code.abs() > f64::from(i32::MAX) {
            let what = format!("32-bit codes of {} do not reach {value:.2} of the fit span", input.name);
            return Err(Error::input(what, "set a larger gain_per_code under [[aux]]")
                .column("gain_per_code")
                .value(input.gain_per_code.to_string()));
        }
    }
    Ok(InputSpec {
        source: channel.source,
        unit_exponent: channel.exponent,
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
        settling_updates: 0,
        largest_step_q8: 0,
        step_growth: 0,
    })
}

/// Name of the input behind a warm-up.
const WARM_UP: &str = "warm-up";
/// The rate of a warm-up at power-on as a fraction of its span: below one, so that no rounding clamps it.
const WARM_UP_START: f64 = 1.0 / 1.001;

/// The rate of a warm-up at power-on, °C per temperature period: α.
fn warm_up_rate(warm_up: &WarmUp, period_s: f64) -> f64 {
    -(-period_s / warm_up.tau_s.value).exp_m1()
}

/// The input of a warm-up: 0 °C behind a lag that begins at −1 °C.
fn warm_up_spec(warm_up: &WarmUp, period_s: f64) -> Result<InputSpec> {
    let far_cpm = warm_up_rate(warm_up, period_s) / WARM_UP_START * 60.0 / period_s;
    let lag = lag_spec(warm_up.tau_s.value, period_s, far_cpm, [0.0, far_cpm])?;
    Ok(InputSpec { source: ValueSource::WarmUp, lag, ..InputSpec::UNUSED })
}

/// `mantissa · 2^−shift` with a mantissa of 30 bits.
fn gain(value: f64) -> Result<Gain> {
    let shift = 30 - value.abs().log2().floor() as i32;
    let shift = shift.clamp(0, 62);
    Ok(Gain {
        mantissa: signed("gain_per_code", value * 2.0_f64.powi(shift), "gains of up to 128 °C per code")?,
        shift: shift as u8,
    })
}

/// `mantissa · 2^−shift` that takes `border` to 1 in Q31, with 32 significant bits.
fn reciprocal(name: &str, border: i64) -> Result<(u32, u8)> {
    let border_wide = u128::try_from(border)
        .ok()
        .filter(|b| *b > 0)
        .ok_or_else(|| too_large(name, border as f64, "an interval wider than nothing"))?;
    for shift in (0..=31_u8).rev() {
        let mantissa = ((1_u128 << (32 + shift)) / border_wide).div_ceil(2);
        if let Ok(mantissa) = u32::try_from(mantissa) {
            return Ok((mantissa, shift));
        }
    }
    Err(too_large(name, border as f64, "an interval wider than nothing"))
}

fn lag_spec(tau_s: f64, period_s: f64, far_cpm: f64, span_cpm: [f64; 2]) -> Result<LagSpec> {
    let alpha = -(-period_s / tau_s).exp_m1();
    let alpha_shift = 30 - alpha.log2().floor() as i32;
    if !(31..=62).contains(&alpha_shift) {
        let holds = format!("lags of {} s and more", significant(period_s, 3));
        return Err(too_large("lag_s", tau_s, &holds).help("remove the rate terms from --model"));
    }
    // The finest unit in which the far border of the rate span still fits 31 bits.
    let far_step = far_cpm * period_s / 60.0;
    let far_bits = (far_step * Q24).log2().ceil();
    if !far_bits.is_finite() {
        return Err(too_large("rate_span_per_min", far_cpm, "finite rates other than zero"));
    }
    let rate_shift = (30.0 - far_bits).clamp(0.0, f64::from(alpha_shift - 1)) as i32;
    let step = |cpm: f64| {
        let holds = format!("±{} °C/min", significant(127.0 * 60.0 / period_s, 3));
        signed("rate_span_per_min", cpm * period_s / 60.0 * Q24 * 2.0_f64.powi(rate_shift), &holds)
    };
    let (rate_lo, rate_hi) = (step(span_cpm[0].min(0.0))?, step(span_cpm[1].max(0.0))?);
    let far = i64::from(rate_lo).abs().max(i64::from(rate_hi).abs());
    let (y_mantissa, y_shift) = reciprocal("rate_span_per_min", far)?;
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

/// A row of the image's table of terms, with its name in the record.
struct TermRow {
    term: Term,
    name: String,
    /// Coefficient in counts per tick, or as a part of one.
    value: f64,
}

/// A row without its coefficient.
struct TermHead {
    kind: Kind,
    input: u8,
    shape: Shape,
    multiplier: Multiplier,
}

impl Frame {
    /// Counts per tick that one °/h is.
    fn per_dph(self) -> f64 {
        self.target.tick_s() / self.unit.arcsec_per_lsb()
    }

    fn rows(self, correction: &AxisCorrection, channels: &[InputChannel<'_>]) -> Result<Vec<TermRow>> {
        let mut out = Vec::new();
        // The values of all terms at their references: bias, scale factor.
        let mut at_reference = [0.0; 2];
        for fitted in &correction.terms {
            let read_by = channels.iter().enumerate().find(|(_, channel)| channel.input.name == fitted.input);
            let (index, channel) = read_by.ok_or_else(|| {
                Error::input(
                    "the term names an input that the record does not contain",
                    "calibrate again, or copy the file again from its source",
                )
                .column("terms.input")
                .value(&fitted.input)
            })?;
            let name = fitted.form().name((index > 0).then_some(fitted.input.as_str()));
            let Form { acts_on, shape, times_rate } = fitted.form();
            let span = channel.input.scaling();
            let (target, factor) =
                shape.encode(span).map_err(|what| too_large(&name, fitted.value, &format!("no such {what}")))?;
            let (kind, unit) = match acts_on {
                ActsOn::Bias => (Kind::Bias, self.per_dph()),
                ActsOn::ScaleFactor => (Kind::Scale, 1e-6),
            };
            let (multiplier, rate) =
                if times_rate { (Multiplier::Rate, channel.rate_far().unwrap_or(0.0)) } else { (Multiplier::One, 1.0) };
            if !times_rate {
                at_reference[usize::from(kind == Kind::Scale)] +=
                    fitted.value * shape.value(span, channel.input.reference) * unit;
            }
            let head = TermHead { kind, input: index as u8, shape: target, multiplier };
            out.extend(self.row(head, name, fitted.value * factor * unit * rate)?);
        }
        // The correction is zero at T0, but for a fixed bias that it removes.
        at_reference[0] -= correction.fixed_bias.map_or(0.0, |bias| bias.value_dph * self.per_dph());
        for (kind, zero) in [Kind::Bias, Kind::Scale].into_iter().zip(at_reference) {
            let head = TermHead { kind, input: 0, shape: Shape::Chebyshev(0), multiplier: Multiplier::One };
            out.extend(self.row(head, "the value of all terms at their references".to_owned(), -zero)?);
        }
        // Bias before rate before scale, input by input, order by order: one record, one image.
        out.sort_by_key(|TermRow { term, .. }| {
            (term.kind == Kind::Scale, term.multiplier == Multiplier::Rate, term.input, image_order(term.shape))
        });
        Ok(out)
    }

    /// a·e^(−t/τ) as a term over the rate α·e^(−t/τ), which has its span at 1.001·α.
    fn warm_up_row(self, warm_up: &WarmUp, input: u8) -> Result<Option<TermRow>> {
        let head = TermHead { kind: Kind::Bias, input, shape: Shape::Chebyshev(0), multiplier: Multiplier::Rate };
        self.row(head, WARM_UP.to_owned(), warm_up.value_dph * self.per_dph() / WARM_UP_START)
    }

    /// A coefficient as mantissa and shift; `None` for zero.
    fn row(self, head: TermHead, name: String, value: f64) -> Result<Option<TermRow>> {
        let TermHead { kind, input, shape, multiplier } = head;
        let value = value / self.scale_at_reference;
        let q40 = value * 2.0_f64.powi(40);
        let shift = (60.0 - q40.abs().log2().floor()).min(62.0);
        let mantissa = (q40 * 2.0_f64.powf(shift - 31.0)).round();
        if mantissa == 0.0 || value == 0.0 {
            return Ok(None);
        }
        if shift < 8.0 || !mantissa.is_finite() {
            return Err(self.beyond(kind, value.abs(), TERM_MAX, &format!("the term `{name}` reaches")));
        }
        let term = Term { kind, input, shape, multiplier, mantissa: mantissa as i32, shift: shift as u8 };
        Ok(Some(TermRow { term, name, value }))
    }

    /// Refuses terms whose sum could exceed what [`Image::new`] takes.
    fn check_sums(self, rows: &[TermRow]) -> Result<()> {
        let increments = Description { period_ticks: self.target.period_ticks, ..Description::empty() };
        let limits = [
            (Kind::Bias, increments.increment_bound() as f64 / COUNT_PER_TICK),
            (Kind::Scale, MAX_SCALE as f64 / COUNT_PER_TICK),
        ];
        for (kind, limit) in limits {
            let of_kind = || rows.iter().filter(|row| row.term.kind == kind);
            let sum: f64 = of_kind().map(|row| row.value.abs()).sum();
            let largest = of_kind().max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()));
            if let Some(largest) = largest.filter(|_| sum > limit) {
                let words = match kind {
                    Kind::Bias => "bias",
                    Kind::Scale => "scale",
                };
                let own = self.in_unit(kind, largest.value.abs());
                let what = format!("the {words} terms, the largest `{}` with {own}, together reach", largest.name);
                return Err(self.beyond(kind, sum, limit, &what));
            }
        }
        Ok(())
    }

    fn in_unit(self, kind: Kind, value: f64) -> String {
        match kind {
            Kind::Bias => format!("{} °/h", significant(value / self.per_dph(), 4)),
            Kind::Scale => format!("{} ppm", significant(value * 1e6, 5)),
        }
    }

    /// The refusal of a value beyond its limit, with what would hold it.
    fn beyond(self, kind: Kind, value: f64, limit: f64, what: &str) -> Error {
        let (reached, holds) = (self.in_unit(kind, value), self.in_unit(kind, limit));
        let over = value / limit;
        let remedy = match (kind, self.unit) {
            (Kind::Scale, _) => "use fewer scale terms, a reference_c in the middle of the span, or a narrower span \
                                 of temperature"
                .to_owned(),
            (Kind::Bias, LogUnit::Rates { lsb_arcsec }) => {
                let enough = RATE_LSBS.into_iter().find(|lsb| *lsb >= lsb_arcsec * over);
                let lsb = enough.map_or("a coarser value".to_owned(), |lsb| lsb.to_string());
                format!("set rate_lsb_arcsec to {lsb}, remove that key, or choose a smaller --model")
            }
            (Kind::Bias, LogUnit::Counts { .. }) if limit < TERM_MAX => {
                let period_s = significant(self.target.period_s() / over, 2);
                format!("set temperature_period_s to {period_s} or less, or choose a smaller --model")
            }
            (Kind::Bias, LogUnit::Counts { .. }) => {
                let tick_s = significant(self.target.tick_s() / over, 2);
                format!("set tick_s to {tick_s} or less, or choose a smaller --model")
            }
        };
        Error::input(format!("{what} {reached}, and the limit of an image is {holds}"), remedy)
    }
}
