//! Which τ a deviation is shown at.

use crate::recorder::MOST_ROWS;

/// The longest τ that is fitted and, by default, shown: a third of the longest stretch.
pub(crate) const LONGEST_PART: u64 = 3;
/// Points per decade of τ by default.
const PER_DECADE: usize = 10;
/// [`Taus::All`] shows at most this many τ.
pub const MOST_TAUS: usize = 20_000;

/// The τ to show.
#[derive(Clone, Debug, PartialEq)]
pub enum Taus {
    /// Ten per decade.
    LogSpaced,
    /// Powers of two of the row's interval.
    Octaves,
    /// Every multiple of the row's interval.
    All,
    /// These, s; each to the nearest multiple.
    Given(Vec<f64>),
}

/// A τ that rows of this interval cannot have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("τ must be a multiple of the row's interval, {interval_s} s, and at least it")]
pub struct TauError {
    /// The τ, s.
    pub tau_s: f64,
    /// Interval of a row, s.
    pub interval_s: f64,
}

impl Taus {
    /// Distances in rows, rising, for rows of `tau0_s` seconds; for [`Taus::All`] the first [`MOST_TAUS`].
    ///
    /// # Errors
    /// A τ below the interval of a row, not a number, or beyond any record.
    pub fn multiples(&self, tau0_s: f64) -> Result<Vec<usize>, TauError> {
        let mut out: Vec<usize> = match self {
            Self::LogSpaced => {
                let exponents = 0..=12 * PER_DECADE;
                exponents.map(|i| 10.0_f64.powf(i as f64 / PER_DECADE as f64).round() as usize).collect()
            }
            Self::Octaves => (0..40).map(|octave| 1 << octave).collect(),
            Self::All => (1..=MOST_TAUS).collect(),
            Self::Given(seconds) => {
                let one = |tau_s: &f64| {
                    let m = (tau_s / tau0_s).round();
                    let in_range = (1.0..MOST_ROWS as f64).contains(&m);
                    if in_range { Ok(m as usize) } else { Err(TauError { tau_s: *tau_s, interval_s: tau0_s }) }
                };
                seconds.iter().map(one).collect::<Result<_, _>>()?
            }
        };
        out.sort_unstable();
        out.dedup();
        out.retain(|m| *m <= MOST_ROWS);
        Ok(out)
    }

    /// The longest distance to show for a longest stretch of `longest_phases`: a given τ is shown if at least one difference
    /// exists, otherwise up to a third of the stretch.
    pub fn longest_shown(&self, longest_phases: u64) -> usize {
        let part = match self {
            Self::Given(_) => 2,
            Self::LogSpaced | Self::Octaves | Self::All => LONGEST_PART,
        };
        usize::try_from(longest_phases / part).unwrap_or(usize::MAX)
    }
}
