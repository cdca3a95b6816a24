//! Which terms a model has, in the words of `--model`.

use std::fmt;
use std::str::FromStr;

use sagnac_core::MAX_ORDER;

use crate::error::{Error, Result};

/// Highest order of the rate series.
pub const MAX_RATE_ORDER: u8 = 3;

/// Highest order of the scale-factor series that `auto` tries.
const MAX_AUTO_SCALE_ORDER: u8 = 4;

/// Orders of the series of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ModelSpec {
    /// Order of the bias series; 0: none.
    pub bias: u8,
    /// Order of the series that multiplies Ṫ; `None`: no rate term, `Some(0)`: c₀ alone.
    pub rate: Option<u8>,
    /// Order of the scale-factor series; 0: none.
    pub scale: u8,
}

impl ModelSpec {
    /// Coefficients without the constants of the runs; the lag counts as one.
    pub fn coefficients(&self) -> usize {
        usize::from(self.bias) + self.rate.map_or(0, |r| usize::from(r) + 2) + usize::from(self.scale)
    }

    /// Coefficients in the order of parameters before those of the scale series; the lag is none of them.
    pub(crate) fn coefficients_before_scale(&self) -> usize {
        usize::from(self.bias) + self.rate.map_or(0, |r| usize::from(r) + 1)
    }

    /// Every candidate of `auto`, smallest first; scale terms only where a rate table tells them.
    pub fn candidates(with_rate: bool, with_scale: bool) -> Vec<Self> {
        let rates = if with_rate { vec![None, Some(0), Some(1), Some(2), Some(3)] } else { vec![None] };
        let scales = 0..=if with_scale { MAX_AUTO_SCALE_ORDER } else { 0 };
        let of = |rate: Option<u8>, scale: u8| (0..=MAX_ORDER).map(move |bias| Self { bias, rate, scale });
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
        if self.scale > 0 {
            write!(f, ", scale {}", self.scale)?;
        }
        Ok(())
    }
}

impl FromStr for ModelSpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = |why: &str| {
            Error::input(format!("{why} in the model")).column("--model").value(text).help(
                "write `auto`, or orders such as `bias 3`, `bias 3, rate 1`, `bias 2, scale 1` \
                 (bias and scale up to 8, rate up to 3)",
            )
        };
        let mut spec = Self { bias: 0, rate: None, scale: 0 };
        let mut seen = Vec::new();
        for part in text.split(',').map(str::trim) {
            let (word, order) = part.split_once(char::is_whitespace).ok_or_else(|| bad("a term without its order"))?;
            let order: u8 = order.trim().parse().map_err(|_| bad("an order that is no small whole number"))?;
            if seen.contains(&word) {
                return Err(bad("the same term twice"));
            }
            seen.push(word);
            match word {
                "bias" if order <= MAX_ORDER => spec.bias = order,
                "scale" if order <= MAX_ORDER => spec.scale = order,
                "rate" if order <= MAX_RATE_ORDER => spec.rate = Some(order),
                "bias" | "scale" | "rate" => return Err(bad("an order too high")),
                _ => return Err(bad("an unknown term")),
            }
        }
        Ok(spec)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_orders_go_both_ways() {
        for text in ["bias 2", "bias 3, rate 1", "bias 0, rate 0, scale 2"] {
            assert_eq!(text.parse::<ModelSpec>().unwrap().to_string(), text);
        }
        for text in ["", "bias", "bias 9", "rate 4", "bias 1, bias 2", "cubic 3", "bias -1"] {
            assert!(text.parse::<ModelSpec>().is_err(), "{text}");
        }
        assert_eq!(ModelSpec::candidates(true, false).len(), 45);
        assert_eq!(ModelSpec::candidates(true, true).len(), 45 * 5);
    }
}
