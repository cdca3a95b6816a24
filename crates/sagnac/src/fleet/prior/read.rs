//! A prior as a file.

use std::path::Path;

use super::{FORMAT, Head, NOISES, Prior, Sums, VERSION};
use sagnac_log::error::{Error, Result};
use sagnac_log::read::read_text;

/// Longest file: 64 terms of a thousand lots are 100 MB.
pub(super) const MOST_BYTES: u64 = 256 << 20;

/// Axes of a lot.
const MOST_AXES: u64 = 1 << 32;

impl Prior {
    /// As JSON.
    ///
    /// # Errors
    /// A number that JSON does not have.
    pub fn to_json(&self) -> Result<String> {
        let text = serde_json::to_string_pretty(self);
        text.map(|text| text + "\n").map_err(|e| Error::input(format!("cannot write the prior: {e}")))
    }

    /// Reads and checks one. Means and covariances are made anew of the sums: what somebody wrote into them does not count.
    ///
    /// # Errors
    /// Unreadable, of another version, or with sums that do not belong together.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path, "read the prior", MOST_BYTES)?;
        Self::from_json(&text).map_err(|e| e.file(path.display().to_string()))
    }

    /// The same of a text.
    ///
    /// # Errors
    /// As [`Prior::read`].
    pub fn from_json(text: &str) -> Result<Self> {
        let found: Self =
            serde_json::from_str(text).map_err(|e| Error::input(format!("not a prior of a fleet: {e}")))?;
        if found.format != FORMAT || found.version != VERSION {
            let what = format!("{} version {}; this program reads {FORMAT} {VERSION}", found.format, found.version);
            return Err(Error::input(what));
        }
        let p = found.terms.len();
        let triangle = p * (p + 1) / 2;
        let lengths = |sums: &Sums| [&sums.value, &sums.product, &sums.covariance, &sums.noise].map(Vec::len);
        let fits = found.sums.values().all(|sums| lengths(sums) == [p, triangle, triangle, NOISES]);
        if !fits
            || found.units.len() != p
            || found.sums.values().any(|sums| !(1..=MOST_AXES).contains(&sums.axes) || sums.noise_axes > sums.axes)
        {
            return Err(Error::input("sums that do not fit the terms").column("sums"));
        }
        if found.span_c[0].partial_cmp(&found.span_c[1]) != Some(std::cmp::Ordering::Less) {
            return Err(Error::input("a span that ends before it begins").column("span_c"));
        }
        let is_rate_span = |[lo, hi]: &[f64; 2]| *lo <= 0.0 && *hi >= 0.0 && lo.is_finite() && hi.is_finite();
        if !found.rate_spans_cpm.iter().all(is_rate_span) {
            return Err(Error::input("a span of rates without 0").column("rate_spans_cpm"));
        }
        if found.fixed_lag_s.is_some_and(|lag_s| !(lag_s > 0.0 && lag_s.is_finite())) {
            return Err(Error::input("a lag that is none").column("fixed_lag_s"));
        }
        let Self { model, terms, units, span_c, rate_spans_cpm, fixed_lag_s, not_used, sums, .. } = found;
        Self::of_sums(Head { model, terms, units, span_c, rate_spans_cpm, fixed_lag_s }, not_used, sums)
    }
}
