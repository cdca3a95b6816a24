//! Every price and threshold by which a model is selected or judged, with the evidence for its value, or the words *not shown*.
//!
//! Evidence is in `docs/explanation/evidence/sagnac.csv` under the named test. The two thresholds of the noise are with the noise
//! (`noise_model::estimate`), for `verify` uses them without a fit.
//!
//! | what | value | evidence |
//! |---|---|---|
//! | condition of the terms | ≤ 100 | *not shown* |
//! | price of a coefficient | max(5, ln n − 2) | `hours::selection`: a term too many in 0.01 … 0.05 of 300 records, bound 0.08 |
//! | an order of the rate series more | 1.5 | without it 0.05 of all selections had one too many |
//! | price in the weights | 2.5 | `hours::selection`: intervals after `auto` cover 0.99, bound 0.90 |
//! | weight that is looked at | 1e-4 | *not shown* |
//! | a rise of a free curve | 2 | Akaike's; `measured::fit::coverage`: a saturating curve in 0.91 … 0.95 of the intervals, else 0.74 … 0.87 |
//! | lack of fit | Δχ² 10 | `measured::fit::coverage`: said in 60 of 60 records over a bend, in 0 of 240 where the model is right |
//! | a column of time | Δχ² 10 | `measured::fit::entanglement`: a useless rate term in 1 of 100 records, else in 94 |
//! | a column of time that temperature explains | 0.8 | `measured::fit::entanglement` |
//! | models of one size | e^(2/n) | *not shown* |
//! | noise that is nearly white | 0.3 of the white variance | *not shown* |
//! | held-out error far behind | 1.5 in σ | one ramp of one recording: *not shown* on many records |
//! | lags that judge a given model | one in 4 | *not shown*: it saves time |
//! | inputs known together | 0.9 of the windows | *not shown* |
//! | a prior's noise is contradicted | 2 in −2·ln L | *not shown* |

/// Beyond this condition terms cannot be separated.
pub(crate) const CONDITION_MAX: f64 = 100.0;

/// Highest order of the rate over inputs other than the thermometer of the fit, and of a second lag.
pub(crate) const MOST_RATE: u8 = 1;
/// Zones that are tried, one after the other.
pub(crate) const ZONES: [u8; 4] = [2, 3, 4, 6];

/// Price of a coefficient in a grade, at least and below ln n.
const LEAST_PRICE: f64 = 5.0;
const PRICE_LESS: f64 = 2.0;
/// What an order of the rate series costs more than one of the bias: next to a curve and a rate term it is one more of many that
/// noise may fit.
pub(crate) const RATE_SLOPE_PRICE: f64 = 1.5;

/// What a coefficient costs: Δχ² = 5, 2.2 of its standard errors, and growing with the logarithm of the windows, so that the
/// selection is consistent.
pub(crate) fn price(windows: f64) -> f64 {
    (windows.ln() - PRICE_LESS).max(LEAST_PRICE)
}

/// Price of a coefficient in the weights (2 is Akaike's): a term that was nearly selected counts.
pub(crate) const WEIGHT_PRICE: f64 = 2.5;
/// Models of less weight are not looked at.
pub(crate) const LEAST_WEIGHT: f64 = 1e-4;
/// Akaike's price of an effective rise of a free curve.
pub(crate) const RISE_PRICE: f64 = 2.0;

/// What χ² must fall by with another curve, after the price of its coefficients, that the rows contradict the fitted one: odds of 150 to 1.
pub(crate) const CONTRADICTED_BY: f64 = 10.0;
/// By how much a column of time must be better than none: odds of 150 to 1. Where they are nearly as good, a rate term comes
/// first, for it can be corrected.
pub(crate) const TIME_DECISIVE: f64 = 10.0;
/// Most of a column's variation that the curve over temperature may explain.
pub(crate) const TIME_EXPLAINED_MAX: f64 = 0.8;

/// ln of the held-out gain between models of one size, times the windows.
pub(crate) const SAME_SIZE: f64 = 2.0;
/// Slow noise of less than this part of the white variance, each process, still counts as nearly white.
pub(crate) const NEARLY_WHITE: f64 = 0.3;
/// Held-out mean square of a model over that of a smaller one, from which on a grade does not count: 1.5 in σ.
pub(crate) const FAR_BEHIND: f64 = 2.25;
/// Of the lags of the grid, one of so many judges a given model.
pub(crate) const GIVEN_TAUS: usize = 4;
/// Fraction of the windows in which all inputs of `auto` must be known.
pub(crate) const KNOWN_TOGETHER: f64 = 0.9;
/// A test contradicts the noise of its fleet where its own explains it better by this in −2·ln(restricted likelihood).
pub(crate) const PRIOR_CONTRADICTED: f64 = 2.0;
