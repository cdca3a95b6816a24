//! Which terms a model has, in the words of `--model`.
//!
//! ```text
//! bias 3, rate 1, zones 4, scale 2        over the thermometer of the fit
//! bias(cavity - block) 1, rate(cavity) 0, scale(path_length_v) 1, steps(mode)        over other inputs, by name
//! ```

use std::fmt;
use std::str::FromStr;

use sagnac_core::MAX_ORDER;

use sagnac_log::error::{Error, Result};

use crate::model::shape::{Form, Shape};

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
    /// Order of the scale-factor series; 0: none.
    pub scale: u8,
    /// Zones of equal width into which the span is cut, with a continuous slope where they meet; 0: none. Only of the
    /// thermometer of the fit.
    pub zones: u8,
    /// A step of bias where the input goes from one whole number to the next: how many of them, once the data are known.
    pub steps: Option<u8>,
}

impl InputTerms {
    /// No term of this input.
    pub(crate) fn of(input: &str) -> Self {
        Self { input: input.to_owned(), ..Self::default() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::of(&self.input)
    }

    /// Terms of a series with a rate in front, c₀ counted.
    fn rates(&self) -> usize {
        self.rate.map_or(0, |order| usize::from(order) + 1)
    }

    /// Terms that act on the bias without a rate.
    fn of_bias(&self) -> usize {
        usize::from(self.bias) + usize::from(self.zones.saturating_sub(1)) + usize::from(self.steps.unwrap_or(0))
    }

    /// Coefficients; a lag counts as one.
    fn coefficients(&self) -> usize {
        self.of_bias() + self.rates() + usize::from(self.rate.is_some()) + usize::from(self.scale)
    }

    /// Its terms, over an input whose knots and thresholds are known, in the order of the parameters of a fit.
    pub(crate) fn forms(&self, knots: &[f64], thresholds: &[f64]) -> Vec<Form> {
        let mut forms: Vec<Form> = (1..=self.bias).map(Form::bias).collect();
        forms.extend(self.rate.into_iter().flat_map(|order| (0..=order).map(Form::rate)));
        let on_bias = |shape| Form { shape, ..Form::bias(0) };
        forms.extend(knots.iter().map(|knot| on_bias(Shape::Zone { knot: *knot })));
        if self.steps.is_some() {
            forms.extend(thresholds.iter().map(|threshold| on_bias(Shape::Step { threshold: *threshold })));
        }
        forms.extend((1..=self.scale).map(Form::scale));
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
        self.inputs.retain(|of| {
            at += 1;
            at == 1 || !of.is_empty()
        });
    }

    /// Coefficients without the constants of the runs; a lag counts as one.
    pub fn coefficients(&self) -> usize {
        self.inputs.iter().map(InputTerms::coefficients).sum()
    }

    /// Inputs whose lag is fitted.
    pub(crate) fn lags(&self) -> usize {
        self.inputs.iter().filter(|of| of.rate.is_some()).count()
    }

    /// Terms of its image without rate, with rate, and of the scale factor.
    pub(crate) fn image_terms(&self) -> [usize; 3] {
        let sum = |of: &dyn Fn(&InputTerms) -> usize| self.inputs.iter().map(of).sum();
        [sum(&InputTerms::of_bias), sum(&InputTerms::rates), sum(&|of| usize::from(of.scale))]
    }

    /// What depends on an input; begun if nothing did.
    pub(crate) fn of_input(&mut self, input: &str) -> &mut InputTerms {
        let at = self.inputs.iter().position(|of| of.input == input).unwrap_or_else(|| {
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
        let of = |rate: Option<u8>, scale: u8| {
            let terms = move |bias| InputTerms { bias, rate, scale, ..InputTerms::default() };
            (0..=MAX_ORDER).map(move |bias| Self::of_thermometer(terms(bias)))
        };
        let mut all: Vec<Self> =
            rates.iter().flat_map(|rate| scales.clone().flat_map(move |scale| of(*rate, scale))).collect();
        all.sort_by_key(Self::coefficients);
        all
    }
}

impl fmt::Display for ModelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bias {}", self.thermometer().bias)?;
        for (at, InputTerms { input, bias, rate, scale, zones, steps }) in self.inputs.iter().enumerate() {
            let of = if at == 0 { String::new() } else { format!("({input})") };
            if at > 0 && *bias > 0 {
                write!(f, ", bias{of} {bias}")?;
            }
            if let Some(rate) = rate {
                write!(f, ", rate{of} {rate}")?;
            }
            if *zones > 1 {
                write!(f, ", zones{of} {zones}")?;
            }
            if *scale > 0 {
                write!(f, ", scale{of} {scale}")?;
            }
            if steps.is_some() {
                write!(f, ", steps{of}")?;
            }
        }
        Ok(())
    }
}

/// A term of `--model`: its word, its input if one is named, its order if it has one.
struct Part<'a> {
    word: &'a str,
    input: Option<&'a str>,
    order: Option<u8>,
}

impl<'a> Part<'a> {
    fn parse(text: &'a str) -> std::result::Result<Self, &'static str> {
        let (head, input, rest) = match text.split_once('(') {
            Some((word, rest)) => {
                let (input, rest) = rest.rsplit_once(')').ok_or("a bracket that is not closed")?;
                (word, Some(input.trim()), rest)
            }
            None => {
                let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
                (word, None, rest)
            }
        };
        let order = match rest.trim() {
            "" => None,
            digits => Some(digits.parse().map_err(|_| "an order that is no small whole number")?),
        };
        Ok(Self { word: head.trim(), input, order })
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
            Error::input(format!("{why} in the model")).column("--model").value(text).help(
                "write `auto`, or orders such as `bias 3`, `bias 3, rate 1`, `bias 2, zones 4`, `bias 2, bias(cavity - block) 1, \
                 steps(mode)` (bias and scale up to 8, rate up to 3, zones up to 8)",
            )
        };
        let mut spec = Self::default();
        let mut seen = Vec::new();
        for part in parts(text) {
            let Part { word, input, order } = Part::parse(part).map_err(bad)?;
            if seen.contains(&(word, input)) {
                return Err(bad("the same term twice"));
            }
            seen.push((word, input));
            if input.is_some_and(str::is_empty) {
                return Err(bad("an input without a name"));
            }
            let known = ["bias", "rate", "scale", "zones", "steps"].contains(&word);
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
                _ if known => return Err(bad("an order too high")),
                _ => return Err(bad("an unknown term")),
            }
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
        ] {
            assert_eq!(text.parse::<ModelSpec>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "bias",
            "bias 9",
            "rate 4",
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
        ] {
            assert!(text.parse::<ModelSpec>().is_err(), "{text}");
        }
        assert_eq!(ModelSpec::candidates(true, false).len(), 45);
        assert_eq!(ModelSpec::candidates(true, true).len(), 45 * 5);
    }
}
