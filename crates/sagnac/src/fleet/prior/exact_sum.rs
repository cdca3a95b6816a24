//! A sum without rounding, so that parts merge to the same bytes in any order.
//!
//! ```text
//! sum = Σ partsₖ exactly, no two of which overlap (Shewchuk, "Adaptive precision floating-point arithmetic", 1997, theorem 10)
//! ```
//!
//! Fails where a sum is beyond the range of f64: then it is infinite or no number, and says so by its value.

use serde::{Deserialize, Serialize};

/// A sum of f64 as its exact value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ExactSum(Vec<f64>);

impl ExactSum {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        let mut carried = value;
        let mut kept = Vec::with_capacity(self.0.len() + 1);
        for part in &self.0 {
            let (sum, error) = two_sum(carried, *part);
            if error != 0.0 {
                kept.push(error);
            }
            carried = sum;
        }
        if carried != 0.0 || kept.is_empty() {
            kept.push(carried);
        }
        self.0 = kept;
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        other.0.iter().for_each(|part| self.add(*part));
        self.in_one_form();
    }

    /// The sum, rounded once.
    pub fn value(&self) -> f64 {
        // The largest part, and what the others add to it; more than a half of its last place decides the last bit.
        let mut parts = self.0.iter().rev();
        let Some(mut sum) = parts.next().copied() else { return 0.0 };
        let mut error = 0.0;
        for part in parts.by_ref() {
            (sum, error) = two_sum(sum, *part);
            if error != 0.0 {
                break;
            }
        }
        let Some(next) = parts.next() else { return sum };
        let (twice, with_twice) = (2.0 * error, sum + 2.0 * error);
        let is_half = with_twice - sum == twice && (error < 0.0) == (*next < 0.0) && *next != 0.0;
        if is_half { with_twice } else { sum }
    }

    /// The same sum in the parts that any order of adding gives: each is what is still missing, rounded.
    fn in_one_form(&mut self) {
        let mut rest = self.clone();
        let mut parts = Vec::new();
        while parts.len() < MOST_PARTS {
            let value = rest.value();
            if value == 0.0 || !value.is_finite() {
                break;
            }
            parts.push(value);
            rest.add(-value);
        }
        if parts.iter().sum::<f64>().is_finite() && rest.value() == 0.0 {
            parts.reverse();
            self.0 = if parts.is_empty() { vec![0.0] } else { parts };
        }
    }

    /// Sum of some values, in the form that their order does not change.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sum = Self::default();
        values.into_iter().for_each(|value| sum.add(value));
        sum.in_one_form();
        sum
    }
}

/// Parts of any sum: 53 bits each, from 2^1024 down to 2^-1074.
const MOST_PARTS: usize = 40;

/// a + b rounded, and the error of that (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Values that lose everything in plain sums (the example of Python's `math.fsum`).
    #[test]
    fn nothing_is_lost() {
        assert_eq!(ExactSum::of([0.1; 10]).value(), 1.0);
        assert_eq!(ExactSum::of([1e100, 1.0, -1e100, 1e-100]).value(), 1.0);
        assert_eq!(ExactSum::of([]).value(), 0.0);
        assert_eq!(ExactSum::of([1.0, 2f64.powi(-53), 2f64.powi(-106)]).value(), 1.0 + 2f64.powi(-52));
    }

    proptest! {
        /// Against integers: values of 2^-60 … 2^40, in any order, merged in any parts.
        #[test]
        fn order_and_parts_do_not_matter(
            values in prop::collection::vec((any::<i32>(), 0i32..60), 0..40),
            split in 0usize..40,
        ) {
            let numbers: Vec<f64> = values.iter().map(|(m, e)| f64::from(*m) * 2f64.powi(e - 60)).collect();
            let exact: i128 = values.iter().map(|(m, e)| i128::from(*m) << e).sum();
            let sum = ExactSum::of(numbers.iter().copied());
            // i128 as f64 rounds once, to nearest even; the power of two is exact.
            prop_assert_eq!(sum.value(), exact as f64 * 2f64.powi(-60));
            let (a, b) = numbers.split_at(split.min(numbers.len()));
            let mut merged = ExactSum::of(b.iter().rev().copied());
            merged.merge(&ExactSum::of(a.iter().copied()));
            let mut empty = ExactSum::default();
            empty.merge(&sum);
            prop_assert_eq!(&merged, &empty);
        }
    }
}
