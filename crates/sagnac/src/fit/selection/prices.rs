//! Prices and thresholds of the selection, each with the evidence for its value, or the words *not shown*.

/// Beyond this condition terms cannot be separated.
pub(crate) const CONDITION_MAX: f64 = 100.0;
pub(crate) const MOST_RATE: u8 = 1;
/// Zones that are tried, one after the other.
pub(crate) const ZONES: [u8; 4] = [2, 3, 4, 6];
/// By how much a column of time must be better than none: odds of 150 to 1. Where they are nearly as good, a rate term comes
/// first, for it can be corrected.
pub(crate) const DECISIVE: f64 = 10.0;
/// Price of a coefficient in the weights (2 is Akaike's): a term that was nearly selected counts.
pub(crate) const WEIGHT_PRICE: f64 = 2.5;
