//! A prior as a file.

use std::path::Path;

use super::lot_sums::{LotSums, NOISES};
use super::{FORMAT, Prior, PriorHead, VERSION};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{hex, sha256};
use sagnac_log::read::read_text;

/// Longest file: 64 terms of a thousand lots are 100 MB.
pub(super) const MOST_BYTES: u64 = 256 << 20;

/// Axes of a lot.
const MOST_AXES: u64 = 1 << 32;

/// SHA-256 of a prior as compact JSON, hex.
fn hash_of(prior: &Prior) -> serde_json::Result<String> {
    Ok(hex(&sha256(serde_json::to_string(prior)?.as_bytes())))
}

/// The remedy for a file that is no whole prior.
const AGAIN: &str = "make the prior again: sagnac fleet prior FLEET/ -o fleet.prior.json";

impl Prior {
    /// As JSON.
    ///
    /// # Errors
    /// A number that JSON does not have.
    pub fn to_json(&self) -> Result<String> {
        let broken = |e: serde_json::Error| Error::defect(format!("cannot write the prior: {e}"));
        let mut whole = self.clone();
        whole.content_sha256.clear();
        whole.content_sha256 = hash_of(&whole).map_err(broken)?;
        serde_json::to_string_pretty(&whole).map(|text| text + "\n").map_err(broken)
    }

    /// Reads and checks one. Means and covariances are made again of the sums. A file that was changed by hand is refused by the hash of its
    /// content: a plan of a prior with two terms exchanged would promise as confidently as that of a whole one.
    ///
    /// # Errors
    /// Unreadable, of another version, changed after it was made, or with sums that do not belong together.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path, "read the prior", MOST_BYTES)?;
        Self::from_json(&text).map_err(|e| e.file(path.display().to_string()))
    }

    /// The same of a text.
    ///
    /// # Errors
    /// As [`Prior::read`].
    pub fn from_json(text: &str) -> Result<Self> {
        let prior: Self =
            serde_json::from_str(text).map_err(|e| Error::input(format!("not a prior of a fleet: {e}"), AGAIN))?;
        if prior.format != FORMAT || prior.version != VERSION {
            let what = format!(
                "the file is {} version {}, and this program reads {FORMAT} {VERSION}",
                prior.format, prior.version
            );
            return Err(Error::input(what, AGAIN));
        }
        let mut content = prior.clone();
        let stated = std::mem::take(&mut content.content_sha256);
        if hash_of(&content).ok().as_deref() != Some(stated.as_str()) {
            return Err(Error::input("the file was edited: its hash does not match its content", AGAIN)
                .column("content_sha256"));
        }
        let p = prior.terms.len();
        let triangle = p * (p + 1) / 2;
        let lengths = |sums: &LotSums| [&sums.value, &sums.product, &sums.covariance, &sums.noise].map(Vec::len);
        let fits = prior.sums.values().all(|sums| lengths(sums) == [p, triangle, triangle, NOISES]);
        if !fits
            || prior.units.len() != p
            || prior.sums.values().any(|sums| !(1..=MOST_AXES).contains(&sums.axes) || sums.noise_axes > sums.axes)
        {
            return Err(Error::input("sums that do not fit the terms", AGAIN).column("sums"));
        }
        if prior.span_c[0].partial_cmp(&prior.span_c[1]) != Some(std::cmp::Ordering::Less) {
            return Err(Error::input("a span that ends before it begins", AGAIN).column("span_c"));
        }
        let is_rate_span = |[lo, hi]: &[f64; 2]| *lo <= 0.0 && *hi >= 0.0 && lo.is_finite() && hi.is_finite();
        if !prior.rate_spans_cpm.iter().all(is_rate_span) {
            return Err(Error::input("a span of rates without 0", AGAIN).column("rate_spans_cpm"));
        }
        if prior.fixed_lag_s.is_some_and(|lag_s| !(lag_s > 0.0 && lag_s.is_finite())) {
            return Err(Error::input("the lag is not a positive number", AGAIN).column("fixed_lag_s"));
        }
        let Self { model, terms, units, span_c, rate_spans_cpm, fixed_lag_s, window_s, logs, not_used, sums, .. } =
            prior;
        let head = PriorHead { model, terms, units, span_c, rate_spans_cpm, fixed_lag_s, window_s, logs };
        Self::of_sums(head, not_used, sums)
    }
}
