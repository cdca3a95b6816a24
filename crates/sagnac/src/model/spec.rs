//! Which terms a model has, in the words of `--model`.
//!
//! ```text
//! bias 3, rate 1, zones 4, scale 2        over the thermometer of the fit
//! rate 1, slow rate 0, rate(cavity) 0, slow rate(cavity) 0        a second lag, slower than that of the rate
//! bias(cavity - block) 1, rate(cavity) 0, scale(path_length_v) 1, steps(mode)        over other inputs, by name
//! harmonic(path_length_v) 25.3, scale harmonic(path_length_v)      sine and cosine of a stated period, of a fitted one
//! ```

use std::fmt;
use std::str::FromStr;

use sagnac_core::MAX_ORDER;

use sagnac_log::error::{Error, Result};

use crate::model::shape::{ActsOn, Form, TermShape};

/// Highest order of the rate series.
pub const MAX_RATE_ORDER: u8 = 3;
/// Most zones of a span.
const MAX_ZONES: u8 = 8;

/// Highest order of the scale-factor series that `auto` tries.
const MAX_AUTO_SCALE_ORDER: u8 = 4;

/// The terms of a model, input by input. The first entry is the thermometer of the fit, which has no name here.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelSpec {
    inputs: Vec<InputTerms>,
}

/// Orders of the series over one input, and its other shapes.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct InputTerms {
    /// A thermometer, two with ` - ` between them, or an auxiliary column; empty for the thermometer of the fit.
    pub input: String,
    /// Order of the bias series; 0: none.
    pub bias: u8,
    /// Order of the series that multiplies its rate; `None`: no rate term, `Some(0)`: c₀ alone.
    pub rate: Option<u8>,
    /// The same behind a second, slower lag; only next to a `rate`.
    pub slow_rate: Option<u8>,
    /// Order of the scale-factor series; 0: none.
    pub scale: u8,
    /// Zones of equal width into which the span is cut, with a continuous slope where they meet; 0: none. Only of the
    /// thermometer of the fit.
    pub zones: u8,
    /// A step of bias where the input goes from one whole number to the next: how many of them, once the data are known.
    pub steps: Option<u8>,
    /// Sines and cosines of the input.
    pub harmonics: Vec<Harmonic>,
}

/// A sine and a cosine of one period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Harmonic {
    /// What they act on.
    pub acts_on: ActsOn,
    /// The period, in the unit of the input; `None` until it is fitted.
    pub period: Option<f64>,
    /// The period is a parameter of the fit.
    pub is_fitted: bool,
}

impl Harmonic {
    /// Its word in a model.
    pub(crate) fn word(self) -> &'static str {
        match self.acts_on {
            ActsOn::Bias => "harmonic",
            ActsOn::ScaleFactor => "scale harmonic",
        }
    }

    /// The terms of it, once the period is known.
    fn forms(self) -> impl Iterator<Item = Form> {
        let form = move |shape| Form { acts_on: self.acts_on, shape, times_rate: false };
        self.period
            .into_iter()
            .flat_map(move |period| [form(TermShape::Cosine { period }), form(TermShape::Sine { period })])
    }
}

impl InputTerms {
    /// No term of this input.
    pub(crate) fn of(input: &str) -> Self {
        Self { input: input.to_owned(), ..Self::default() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::of(&self.input)
    }

    /// Orders of the series with a rate in front, the fast lag's first.
    fn rate_orders(&self) -> impl Iterator<Item = u8> {
        self.rate.into_iter().chain(self.slow_rate)
    }

    /// Terms of series with a rate in front, c₀ counted.
    fn rates(&self) -> usize {
        self.rate_orders().map(|order| usize::from(order) + 1).sum()
    }

    /// Lags that are fitted.
    pub(crate) fn lags(&self) -> usize {
        self.rate_orders().count()
    }

    /// Without the rate behind its fast or its slow lag. The one that remains is the only one, so it is `rate`.
    pub(crate) fn drop_rate(&mut self, slow: bool) {
        if !slow {
            self.rate = self.slow_rate;
        }
        self.slow_rate = None;
    }

    /// Terms that act on the bias without a rate.
    fn of_bias(&self) -> usize {
        usize::from(self.bias)
            + usize::from(self.zones.saturating_sub(1))
            + usize::from(self.steps.unwrap_or(0))
            + self.waves(ActsOn::Bias)
    }

    /// Terms of harmonics.
    fn waves(&self, acts_on: ActsOn) -> usize {
        2 * self.harmonics.iter().filter(|harmonic| harmonic.acts_on == acts_on).count()
    }

    /// Terms that act on the scale factor.
    fn of_scale(&self) -> usize {
        usize::from(self.scale) + self.waves(ActsOn::ScaleFactor)
    }

    /// Coefficients; a lag and a fitted period count as one.
    fn coefficients(&self) -> usize {
        let periods = self.harmonics.iter().filter(|harmonic| harmonic.is_fitted).count();
        self.of_bias() + self.rates() + self.lags() + self.of_scale() + periods
    }

    /// Its terms behind the second lag.
    pub(crate) fn slow_forms(&self) -> impl Iterator<Item = Form> {
        self.slow_rate.into_iter().flat_map(|order| (0..=order).map(Form::rate))
    }

    /// Its other terms, over an input whose knots and thresholds are known, in the order of the parameters of a fit.
    pub(crate) fn forms(&self, knots: &[f64], thresholds: &[f64]) -> Vec<Form> {
        let mut forms: Vec<Form> = (1..=self.bias).map(Form::bias).collect();
        forms.extend(self.rate.into_iter().flat_map(|order| (0..=order).map(Form::rate)));
        let on_bias = |shape| Form { shape, ..Form::bias(0) };
        forms.extend(knots.iter().map(|knot| on_bias(TermShape::Zone { knot: *knot })));
        if self.steps.is_some() {
            forms.extend(thresholds.iter().map(|threshold| on_bias(TermShape::Step { threshold: *threshold })));
        }
        let harmonics = |acts_on| self.harmonics.iter().filter(move |harmonic| harmonic.acts_on == acts_on);
        forms.extend(harmonics(ActsOn::Bias).flat_map(|harmonic| harmonic.forms()));
        forms.extend((1..=self.scale).map(Form::scale));
        forms.extend(harmonics(ActsOn::ScaleFactor).flat_map(|harmonic| harmonic.forms()));
        forms
    }
}

impl Default for ModelSpec {
    fn default() -> Self {
        Self { inputs: vec![InputTerms::default()] }
    }
}

impl ModelSpec {
    /// Of these terms over the thermometer of the fit, and nothing else.
    pub(crate) fn of_thermometer(terms: InputTerms) -> Self {
        Self { inputs: vec![terms] }
    }

    /// The terms over the thermometer of the fit.
    pub fn thermometer(&self) -> &InputTerms {
        &self.inputs[0]
    }

    pub(crate) fn thermometer_mut(&mut self) -> &mut InputTerms {
        &mut self.inputs[0]
    }

    /// The terms of every input, the thermometer of the fit first.
    pub fn inputs(&self) -> &[InputTerms] {
        &self.inputs
    }

    pub(crate) fn inputs_mut(&mut self) -> &mut [InputTerms] {
        &mut self.inputs
    }

    /// Without the inputs that have no terms.
    pub(crate) fn drop_empty(&mut self) {
        let mut at = 0;
        self.inputs.retain(|terms| {
            at += 1;
            at == 1 || !terms.is_empty()
        });
    }

    /// Coefficients without the constants of the runs; a lag counts as one.
    pub fn coefficients(&self) -> usize {
        self.inputs.iter().map(InputTerms::coefficients).sum()
    }

    /// Lags that are fitted.
    pub(crate) fn lags(&self) -> usize {
        self.inputs.iter().map(InputTerms::lags).sum()
    }

    /// Inputs with a second lag, each of which an image describes once more.
    pub(crate) fn repeats(&self) -> usize {
        self.inputs.iter().filter(|terms| terms.slow_rate.is_some()).count()
    }

    /// Terms of its image without rate, with rate, and of the scale factor.
    pub(crate) fn image_terms(&self) -> [usize; 3] {
        let sum = |count: &dyn Fn(&InputTerms) -> usize| self.inputs.iter().map(count).sum();
        [sum(&InputTerms::of_bias), sum(&InputTerms::rates), sum(&InputTerms::of_scale)]
    }

    /// What depends on an input; begun if nothing did.
    pub(crate) fn of_input(&mut self, input: &str) -> &mut InputTerms {
        let at = self.inputs.iter().position(|terms| terms.input == input).unwrap_or_else(|| {
            self.inputs.push(InputTerms::of(input));
            self.inputs.len() - 1
        });
        &mut self.inputs[at]
    }

    /// Every candidate of the grid over the thermometer of the fit, smallest first; scale terms only where a rate table
    /// determines them.
    pub fn candidates(with_rate: bool, with_scale: bool) -> Vec<Self> {
        let rates = if with_rate { vec![None, Some(0), Some(1), Some(2), Some(3)] } else { vec![None] };
        let scales = 0..=if with_scale { MAX_AUTO_SCALE_ORDER } else { 0 };
        let biases = |rate: Option<u8>, scale: u8| {
            let terms = move |bias| InputTerms { bias, rate, scale, ..InputTerms::default() };
            (0..=MAX_ORDER).map(move |bias| Self::of_thermometer(terms(bias)))
        };
        let mut all: Vec<Self> =
            rates.iter().flat_map(|rate| scales.clone().flat_map(move |scale| biases(*rate, scale))).collect();
        all.sort_by_key(Self::coefficients);
        all
    }
}

impl fmt::Display for ModelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bias {}", self.thermometer().bias)?;
        for (at, InputTerms { input, bias, rate, slow_rate, scale, zones, steps, harmonics }) in
            self.inputs.iter().enumerate()
        {
            let brackets = if at == 0 { String::new() } else { format!("({input})") };
            if at > 0 && *bias > 0 {
                write!(f, ", bias{brackets} {bias}")?;
            }
            if let Some(rate) = rate {
                write!(f, ", rate{brackets} {rate}")?;
            }
            if let Some(rate) = slow_rate {
                write!(f, ", slow rate{brackets} {rate}")?;
            }
            if *zones > 1 {
                write!(f, ", zones{brackets} {zones}")?;
            }
            if *scale > 0 {
                write!(f, ", scale{brackets} {scale}")?;
            }
            if steps.is_some() {
                write!(f, ", steps{brackets}")?;
            }
            for harmonic in harmonics {
                write!(f, ", {}{brackets}", harmonic.word())?;
                if let Some(period) = harmonic.period.filter(|_| !harmonic.is_fitted) {
                    write!(f, " {period}")?;
                }
            }
        }
        Ok(())
    }
}

/// A term of `--model`: its word, its input if one is named, the number behind it if there is one.
struct ModelWord<'a> {
    word: &'a str,
    input: Option<&'a str>,
    number: &'a str,
}

impl<'a> ModelWord<'a> {
    fn parse(text: &'a str) -> std::result::Result<Self, &'static str> {
        let (head, input, rest) = match text.split_once('(') {
            Some((word, rest)) => {
                let (input, rest) = rest.rsplit_once(')').ok_or("a bracket that is not closed")?;
                (word, Some(input.trim()), rest)
            }
            None => {
                // Words, then a number.
                let digits =
                    text.find(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.')).unwrap_or(text.len());
                let (word, rest) = text.split_at(digits);
                (word, None, rest)
            }
        };
        Ok(Self { word: head.trim(), input, number: rest.trim() })
    }

    fn order(&self) -> std::result::Result<Option<u8>, &'static str> {
        match self.number {
            "" => Ok(None),
            digits => digits.parse().map(Some).map_err(|_| "an order that is no small whole number"),
        }
    }

    /// What a harmonic acts on, if it is one.
    fn harmonic(&self) -> std::result::Result<Option<Harmonic>, &'static str> {
        let acts_on = match self.word {
            "harmonic" => ActsOn::Bias,
            "scale harmonic" => ActsOn::ScaleFactor,
            _ => return Ok(None),
        };
        let period = match self.number {
            "" => None,
            digits => {
                let period = digits.parse().ok().filter(|period: &f64| period.is_finite() && *period > 0.0);
                Some(period.ok_or("a period that is no number above zero")?)
            }
        };
        Ok(Some(Harmonic { acts_on, period, is_fitted: period.is_none() }))
    }
}

/// The parts between commas that stand in no bracket.
fn parts(text: &str) -> Vec<&str> {
    let mut depth = 0_usize;
    let in_no_bracket = |c: char| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        c == ',' && depth == 0
    };
    text.split(in_no_bracket).map(str::trim).collect()
}

impl FromStr for ModelSpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = |why: &str| {
            Error::input(format!("{why} in the model"), "write `auto`, or orders such as `bias 3`, `bias 3, rate 1`, `bias 3, rate 1, slow rate 0` (two lags), `bias 2, zones 4`, \
                 `bias 2, bias(cavity - block) 1, steps(mode)` (bias and scale up to 8, rate up to 3, zones up to 8), or `harmonic(path_length_v) 25.3` with its period, `harmonic(path_length_v)` to fit \
                 it").column("--model").value(text)
        };
        let mut spec = Self::default();
        let mut seen = Vec::new();
        for part in parts(text) {
            let part = ModelWord::parse(part).map_err(bad)?;
            let (word, input, harmonic) = (part.word, part.input, part.harmonic().map_err(bad)?);
            if seen.contains(&(word, input)) && harmonic.is_none() {
                return Err(bad("the same term twice"));
            }
            seen.push((word, input));
            if input.is_some_and(str::is_empty) {
                return Err(bad("an input without a name"));
            }
            if let Some(harmonic) = harmonic {
                let terms = spec.of_input(input.unwrap_or_default());
                if terms
                    .harmonics
                    .iter()
                    .any(|other| other.acts_on == harmonic.acts_on && other.period == harmonic.period)
                {
                    return Err(bad("the same harmonic twice"));
                }
                terms.harmonics.push(harmonic);
                continue;
            }
            let order = part.order().map_err(bad)?;
            let known = ["bias", "rate", "slow rate", "scale", "zones", "steps"].contains(&word);
            match (word, order, input) {
                ("steps", None, Some(input)) => spec.of_input(input).steps = Some(0),
                ("steps", _, None) => return Err(bad("steps without an input")),
                ("steps", Some(_), _) => return Err(bad("steps with an order")),
                (_, None, _) if known => return Err(bad("a term without its order")),
                ("zones", Some(n), None) if (2..=MAX_ZONES).contains(&n) => spec.thermometer_mut().zones = n,
                ("zones", Some(_), Some(_)) => {
                    return Err(bad("zones of another input than the thermometer of the fit"));
                }
                ("zones", Some(_), None) => return Err(bad("fewer than two or more than eight zones")),
                ("bias", Some(n), of) if n <= MAX_ORDER => spec.of_input(of.unwrap_or_default()).bias = n,
                ("scale", Some(n), of) if n <= MAX_ORDER => spec.of_input(of.unwrap_or_default()).scale = n,
                ("rate", Some(n), of) if n <= MAX_RATE_ORDER => spec.of_input(of.unwrap_or_default()).rate = Some(n),
                ("slow rate", Some(n), of) if n <= MAX_RATE_ORDER => {
                    spec.of_input(of.unwrap_or_default()).slow_rate = Some(n);
                }
                _ if known => return Err(bad("an order too high")),
                _ => return Err(bad("an unknown term")),
            }
        }
        if spec.inputs.iter().any(|terms| terms.slow_rate.is_some() && terms.rate.is_none()) {
            return Err(bad("a slow rate without the rate that it is slower than"));
        }
        spec.drop_empty();
        Ok(spec)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_orders_go_both_ways() {
        for text in [
            "bias 2",
            "bias 3, rate 1",
            "bias 0, rate 0, scale 2",
            "bias 2, zones 4",
            "bias 1, rate 0, zones 2, scale 1, bias(a, b (c)) 2, rate(a, b (c)) 0, bias(cavity - block) 1, steps(mode)",
            "bias 3, rate 1, slow rate 0, rate(v) 0, slow rate(v) 2",
            "bias 2, harmonic 12.5, bias(v) 1, harmonic(v) 25.3, harmonic(v), scale harmonic(v) 3",
        ] {
            assert_eq!(text.parse::<ModelSpec>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "bias",
            "bias 9",
            "rate 4",
            "rate 1, slow rate 4",
            "slow rate 1",
            "rate 1, slow rate(v) 1",
            "rate 1, slow rate",
            "rate 1, slow rate 1, slow rate 1",
            "bias 1, bias 2",
            "cubic 3",
            "bias -1",
            "zones 1",
            "zones 9",
            "zones(cavity) 3",
            "steps",
            "steps(mode) 3",
            "bias() 1",
            "bias(cavity 1",
            "bias(cavity)",
            "bias(cavity) 1, bias(cavity) 2",
            "harmonic(v) -3",
            "harmonic(v) 3, harmonic(v) 3",
            "harmonic(v) x",
        ] {
            assert!(text.parse::<ModelSpec>().is_err(), "{text}");
        }
        assert_eq!(ModelSpec::candidates(true, false).len(), 45);
        assert_eq!(ModelSpec::candidates(true, true).len(), 45 * 5);
    }
}
