//! The prior as one unit's fit has it: of the whole fleet, or of the unit's lot.
//!
//! ```text
//! fleet     μ̂ of all,      Σ̂ + (Σ̂ + V̄)/n                  ν = lots − 1, or axes − 1 of a single lot
//! lot l     μ̂ of the lot,  Σ̂_within + (Σ̂_within + V̄)/n_l    ν = axes − lots
//! ```
//!
//! A unit of a lot that the fleet has not seen is as far from the others as lots are from each other, which a few lots do not say: with
//! fewer than [`LEAST_LOTS`] the unit's lot must be one of them. So the first units of a new lot are given the full test. A unit in a wrong
//! lot is found by the gate alone.

use std::path::Path;

use super::read::MOST_BYTES;
use super::{LEAST_OF_LOT, LotMean, Population, Prior};
use crate::fit::UnitPrior;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{hex, sha256};
use sagnac_log::read::read_text;
use sagnac_log::setup::Noise;
use sagnac_units::format::counted;

/// A prior and the hash of its file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PriorFile {
    /// What it says.
    pub prior: Prior,
    /// SHA-256 of the file, hex.
    pub sha256: String,
}

impl PriorFile {
    /// Reads and checks one.
    ///
    /// # Errors
    /// As [`Prior::read`].
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path, "read the prior", MOST_BYTES)?;
        let prior = Prior::from_json(&text).map_err(|e| e.file(path.display().to_string()))?;
        Ok(Self { prior, sha256: hex(&sha256(text.as_bytes())) })
    }

    /// The noise of the fleet's units.
    pub fn noise(&self) -> Noise {
        let Prior { n_deg_rt_h, q_arcsec, bias_instability_dph, rate_random_walk_dph_rt_h, .. } = self.prior;
        Noise::walk(n_deg_rt_h).quantized(q_arcsec).slow(bias_instability_dph, rate_random_walk_dph_rt_h)
    }

    /// What is known of the next unit, of a lot if that is known.
    ///
    /// # Errors
    /// A lot of too few axes, or none, where the prior's lots are several but few.
    pub fn of_unit(&self, lot: Option<&str>) -> Result<UnitPrior> {
        self.prior.of_unit(lot, self.sha256.clone())
    }
}

/// Lots that say how far another one may be.
const LEAST_LOTS: usize = 10;

impl Prior {
    fn of_unit(&self, lot: Option<&str>, sha256: String) -> Result<UnitPrior> {
        let own = self.lot_of(lot)?;
        let (population, mean, axes) = match own {
            None => (&self.fleet, &self.fleet.mean, self.fleet.axes),
            Some(lot) => (self.within_lots.as_ref().unwrap_or(&self.fleet), &lot.mean, lot.axes),
        };
        let lots = self.lots.len() as u64;
        let degrees = if own.is_none() && lots > 1 { lots - 1 } else { self.fleet.axes.saturating_sub(lots) };
        Ok(UnitPrior {
            model: self.model.parse()?,
            terms: self.terms.clone(),
            mean: mean.clone(),
            covariance: population.of_unit(axes, degrees as f64),
            degrees: degrees as f64,
            span_c: self.span_c,
            rate_spans_cpm: self.rate_spans_cpm.clone(),
            fixed_lag_s: self.fixed_lag_s,
            bias_instability_dph: self.bias_instability_dph,
            rate_random_walk_dph_rt_h: self.rate_random_walk_dph_rt_h,
            axes,
            lot: own.map(|lot| lot.lot.clone()),
            sha256,
        })
    }

    /// The lot whose mean a unit is about; `None` for that of all units: where they have no lots, or many, of which it is another.
    fn lot_of(&self, lot: Option<&str>) -> Result<Option<&LotMean>> {
        let is_without_lots = matches!(self.lots.as_slice(), [lot] if lot.lot.is_empty());
        let known = lot.and_then(|name| self.lots.iter().find(|lot| lot.lot == name));
        match (lot, known) {
            _ if is_without_lots => Ok(None),
            (_, Some(known)) if known.axes >= LEAST_OF_LOT as u64 => Ok(Some(known)),
            _ if self.lots.len() >= LEAST_LOTS => Ok(None),
            (Some(name), _) => Err(self.no_lot(name)),
            (None, _) => Err(self.too_few_lots()),
        }
    }

    fn no_lot(&self, name: &str) -> Error {
        let what = format!("the prior has no lot of this name with {LEAST_OF_LOT} axes");
        Error::refused(what).column("--lot").value(name).help(self.known_lots())
    }

    fn too_few_lots(&self) -> Error {
        Error::refused(format!(
            "the lot of the unit is not given, and {} do not say how far another may be: {LEAST_LOTS} are needed",
            counted(self.lots.len(), "lot", "lots")
        ))
        .column("--lot")
        .help(self.known_lots())
    }

    fn known_lots(&self) -> String {
        let is_known = |lot: &&LotMean| lot.axes >= LEAST_OF_LOT as u64;
        let known: Vec<String> = self.lots.iter().filter(is_known).map(|lot| lot.lot.clone()).collect();
        let named =
            if known.is_empty() { String::new() } else { format!("name its lot of {}; ", Error::choices(&known)) };
        format!("{named}give the first units of a new lot the full test")
    }
}

impl Population {
    /// The covariance that a fit uses: that about a mean of so many axes, and one standard error of Σ̂ + V̄ of so many degrees.
    fn of_unit(&self, axes: u64, degrees: f64) -> Vec<f64> {
        let error = (2.0 / degrees).sqrt();
        let scatter = self.covariance.iter().zip(&self.of_tests).map(|(own, tests)| error * (own + tests));
        self.about_mean_of(axes).into_iter().zip(scatter).map(|(value, more)| value + more).collect()
    }

    /// Covariance of the next unit's coefficients about a mean of so many axes, as a lower triangle: the scatter of units, and what is
    /// not known of the mean, Σ̂ + (Σ̂ + V̄)/n.
    pub(super) fn about_mean_of(&self, axes: u64) -> Vec<f64> {
        let n = axes as f64;
        self.covariance.iter().zip(&self.of_tests).map(|(own, tests)| own + (own + tests) / n).collect()
    }
}
