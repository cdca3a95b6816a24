//! Which terms a model has, in the words of `--model`.
//!
//! ```text
//! bias 3, rate 1, zones 4, scale 2        over the thermometer of the fit
//! bias(cavity - block) 1, rate(cavity) 0, scale(path_length_v) 1, steps(mode)        over further inputs, by name
//! ```

use std::fmt;
use std::str::FromStr;

use sagnac_core::MAX_ORDER;

use sagnac_log::error::{Error, Result};

/// Highest order of the rate series.
pub const MAX_RATE_ORDER: u8 = 3;
/// Most zones of a span.
const MAX_ZONES: u8 = 8;

/// Highest order of the scale-factor series that `auto` tries.
const MAX_AUTO_SCALE_ORDER: u8 = 4;

/// Orders of the series of a model.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct ModelSpec {
    /// Order of the bias series; 0: none.
    pub bias: u8,
    /// Order of the series that multiplies Ṫ; `None`: no rate term, `Some(0)`: c₀ alone.
    pub rate: Option<u8>,
    /// Order of the scale-factor series; 0: none.
    pub scale: u8,
    /// Zones of equal width into which the span is cut, with a continuous slope where they meet; 0: none.
    pub zones: u8,
    /// What depends on other inputs, in the order in which it was named.
    pub further: Vec<FurtherTerms>,
}

/// Orders of the series over a further input.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct FurtherTerms {
    /// A thermometer, two with ` - ` between them, or an auxiliary column.
    pub input: String,
    /// Order of the bias series; 0: none.
    pub bias: u8,
    /// Order of the series that multiplies its rate.
    pub rate: Option<u8>,
    /// Order of the scale-factor series; 0: none.
    pub scale: u8,
    /// A step of bias where the input goes from one whole number to the next: how many of them, once the data are known.
    pub steps: Option<u8>,
}

impl FurtherTerms {
    /// No term of this input.
    pub(crate) fn of(input: &str) -> Self {
        Self { input: input.to_owned(), ..Self::default() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::of(&self.input)
    }
}

impl ModelSpec {
    /// Coefficients without the constants of the runs; a lag counts as one.
    pub fn coefficients(&self) -> usize {
        let rates = |rate: Option<u8>| rate.map_or(0, |r| usize::from(r) + 2);
        let further = self.further.iter().map(|of| {
            usize::from(of.bias) + rates(of.rate) + usize::from(of.scale) + usize::from(of.steps.unwrap_or(0))
        });
        usize::from(self.bias)
            + rates(self.rate)
            + usize::from(self.scale)
            + usize::from(self.zones.saturating_sub(1))
            + further.sum::<usize>()
    }

    /// Inputs whose lag is fitted.
    pub(crate) fn lags(&self) -> usize {
        usize::from(self.rate.is_some()) + self.further.iter().filter(|of| of.rate.is_some()).count()
    }

    /// What depends on a further input; begun if nothing did.
    pub(crate) fn of_input(&mut self, input: &str) -> &mut FurtherTerms {
        let at = self.further.iter().position(|of| of.input == input).unwrap_or_else(|| {
            self.further.push(FurtherTerms::of(input));
            self.further.len() - 1
        });
        &mut self.further[at]
    }

    /// Every candidate of the grid over the thermometer of the fit, smallest first; scale terms only where a rate table
    /// tells them.
    pub fn candidates(with_rate: bool, with_scale: bool) -> Vec<Self> {
        let rates = if with_rate { vec![None, Some(0), Some(1), Some(2), Some(3)] } else { vec![None] };
        let scales = 0..=if with_scale { MAX_AUTO_SCALE_ORDER } else { 0 };
        let of = |rate: Option<u8>, scale: u8| {
            (0..=MAX_ORDER).map(move |bias| Self { bias, rate, scale, ..Self::default() })
        };
        let mut all: Vec<Self> =
            rates.iter().flat_map(|rate| scales.clone().flat_map(move |scale| of(*rate, scale))).collect();
        all.sort_by_key(Self::coefficients);
        all
    }
}

impl fmt::Display for ModelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bias {}", self.bias)?;
        if let Some(rate) = self.rate {
            write!(f, ", rate {rate}")?;
        }
        if self.zones > 1 {
            write!(f, ", zones {}", self.zones)?;
        }
        if self.scale > 0 {
            write!(f, ", scale {}", self.scale)?;
        }
        for FurtherTerms { input, bias, rate, scale, steps } in &self.further {
            if *bias > 0 {
                write!(f, ", bias({input}) {bias}")?;
            }
            if let Some(rate) = rate {
                write!(f, ", rate({input}) {rate}")?;
            }
            if *scale > 0 {
                write!(f, ", scale({input}) {scale}")?;
            }
            if steps.is_some() {
                write!(f, ", steps({input})")?;
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
                ("bias", Some(n), None) if n <= MAX_ORDER => spec.bias = n,
                ("scale", Some(n), None) if n <= MAX_ORDER => spec.scale = n,
                ("rate", Some(n), None) if n <= MAX_RATE_ORDER => spec.rate = Some(n),
                ("zones", Some(n), None) if (2..=MAX_ZONES).contains(&n) => spec.zones = n,
                ("zones", Some(_), Some(_)) => {
                    return Err(bad("zones of another input than the thermometer of the fit"));
                }
                ("zones", Some(_), None) => return Err(bad("fewer than two or more than eight zones")),
                ("bias", Some(n), Some(input)) if n <= MAX_ORDER => spec.of_input(input).bias = n,
                ("scale", Some(n), Some(input)) if n <= MAX_ORDER => spec.of_input(input).scale = n,
                ("rate", Some(n), Some(input)) if n <= MAX_RATE_ORDER => spec.of_input(input).rate = Some(n),
                _ if known => return Err(bad("an order too high")),
                _ => return Err(bad("an unknown term")),
            }
        }
        spec.further.retain(|of| !of.is_empty());
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
