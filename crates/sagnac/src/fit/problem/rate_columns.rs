//! Rate columns of all rows, and those that were computed before, for every problem of an axis with the same rows.
//!
//! They depend on the rows, the signal, its span, and τ alone. An axis has a problem for its levels, one for the search over the thermometer,
//! and one for the selected model; a problem whose inputs have gaps has other rows, and columns of its own.

use crate::fit::problem::lag::RATE_COLUMNS;
use crate::model::basis::Span;
use crate::model::input::{SampledInput, Signal};
use std::sync::{Arc, OnceLock, RwLock};

/// Rate columns of all rows.
pub(crate) type RateRows = Arc<[RateRow]>;

/// Means of Ṫ·T₀ … Ṫ·T₃ over a row, °C/min.
pub(crate) type RateRow = [f64; RATE_COLUMNS];
/// Rows of rate columns that are kept: 64 MB.
const MOST_KNOWN_ROWS: usize = 2_000_000;

/// Rate columns at the τ of the grid, which every model asks for. A second lag has the columns of the first.
#[derive(Clone, Default)]
pub(crate) struct KnownRates(Arc<RwLock<Vec<KnownRate>>>);

/// Those of a signal over a span.
struct KnownRate {
    signal: Signal,
    span: Span,
    tau_s: f64,
    rows: RateRows,
}

/// Rate columns that the problems of an axis have in common: each of a search has the same rows, unless an input of it has gaps.
#[derive(Default)]
pub(crate) struct CommonRates(OnceLock<(Vec<usize>, KnownRates)>);

impl CommonRates {
    /// Those of a problem with these rows: the common ones if its rows are those of the first.
    pub(crate) fn of(&self, used: &[usize]) -> KnownRates {
        let (first, known) = self.0.get_or_init(|| (used.to_vec(), KnownRates::default()));
        if first == used { known.clone() } else { KnownRates::default() }
    }
}

impl KnownRates {
    pub(crate) fn find(&self, input: &SampledInput, tau_s: f64) -> Option<RateRows> {
        let known = self.0.read().ok()?;
        known.iter().find(|rate| rate.is_of(input, tau_s)).map(|rate| Arc::clone(&rate.rows))
    }

    pub(crate) fn keep(&self, input: &SampledInput, tau_s: f64, rows: &RateRows) {
        if let Ok(mut known) = self.0.write()
            && (known.len() + 1) * rows.len() <= MOST_KNOWN_ROWS
            && !known.iter().any(|rate| rate.is_of(input, tau_s))
        {
            known.push(KnownRate { signal: input.signal, span: input.span, tau_s, rows: Arc::clone(rows) });
        }
    }
}

impl KnownRate {
    fn is_of(&self, input: &SampledInput, tau_s: f64) -> bool {
        self.signal == input.signal && self.span == input.span && self.tau_s == tau_s
    }
}
