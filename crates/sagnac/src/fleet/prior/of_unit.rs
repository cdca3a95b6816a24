//! The prior as one unit's fit has it: of the whole fleet, or of the unit's lot.
//!
//! ```text
//! no lots   μ̂ of all,      Σ̂ + (Σ̂ + V̄)/n                    ν = axes − 1
//! lot l     μ̂ of the lot,  Σ̂_within + (Σ̂_within + V̄)/n_l    ν = axes − lots
//! new lot   mean of the lots' means m_l,  Σ̂_new + (Σ̂_new + V̄)/lots,  Σ̂_new = Σ̂_within + Cov(m_l)    ν = lots − 1
//! ```
//!
//! Of a new lot each lot counts once, however large it is. Cov(m_l) holds what few axes say of a lot's mean, so that it is rather too wide.
//!
//! A unit of a lot that the fleet has not seen is as far from the others as lots are from each other, which a few lots do not say: with
//! fewer than [`LEAST_LOTS`] the unit's lot must be one of them. So the first units of a new lot are given the full test. A unit in a wrong
//! lot is found by the gate alone.

use std::path::Path;

use super::read::MOST_BYTES;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::lot_sums::LotSums;
use super::members::LEAST_OF_LOT;
use super::{LotMean, Population, Prior, scatter_about_means};
use crate::fit::{ResidualOfFleet, UnitPrior};
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

/// Of so many lots that scatter like the others one is refused, where the variance of a variance is so many times that of a normal law.
const LIKE_OTHERS: f64 = 0.999;
const KURTOSIS: f64 = 4.0;
/// Lots that say how far another one may be.
const LEAST_LOTS: usize = 10;

impl Prior {
    fn of_unit(&self, lot: Option<&str>, sha256: String) -> Result<UnitPrior> {
        let own = self.lot_of(lot)?;
        if let Some(lot) = own {
            self.refuse_wide(lot)?;
        }
        let of_new_lot = self.within_lots.as_ref().map(|within| self.of_new_lot(within));
        let (population, mean, axes) = match (own, &of_new_lot) {
            (None, Some(of_new_lot)) => (of_new_lot, &of_new_lot.mean, of_new_lot.axes),
            (None, None) => (&self.fleet, &self.fleet.mean, self.fleet.axes),
            (Some(lot), _) => (self.within_lots.as_ref().unwrap_or(&self.fleet), &lot.mean, lot.axes),
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
            residual: self.window_s.map(|window_s| ResidualOfFleet {
                window_s,
                ln_mean: self.residual_ln_mean,
                ln_sigma: self.residual_ln_sigma,
                axes: self.fleet.axes,
            }),
            axes: own.map_or(self.fleet.axes, |lot| lot.axes),
            lot: own.map(|lot| lot.lot.clone()),
            sha256,
        })
    }

    /// Refuses a lot whose units scatter more than those of the other lots: Σ̂_within would be too narrow for it. The ratio of the
    /// variances, mean over the terms, has about Fisher's distribution; a quarter of the degrees stands for tails of Student's t of five.
    fn refuse_wide(&self, lot: &LotMean) -> Result<()> {
        let (p, lots) = (self.terms.len(), self.sums.len());
        let (Some(sums), true) = (self.sums.get(&lot.lot), lots > 1) else { return Ok(()) };
        let others: Vec<&LotSums> =
            self.sums.iter().filter(|(name, _)| **name != lot.lot).map(|(_, sums)| sums).collect();
        let of_others = others.iter().map(|sums| sums.axes).sum::<u64>();
        if of_others < others.len() as u64 + LEAST_OF_LOT as u64 {
            return Ok(());
        }
        let (own, usual) = (scatter_about_means(&[sums], p), scatter_about_means(&others, p));
        let Some(factor) = usual.cholesky() else { return Ok(()) };
        let ratio = factor.solve(&own).trace() / p as f64;
        let degrees = |axes: u64, groups: usize| (p as f64 * (axes as f64 - groups as f64) / KURTOSIS).max(1.0);
        let law = FisherSnedecor::new(degrees(sums.axes, 1), degrees(of_others, lots - 1));
        let most = law.map_or(f64::INFINITY, |law| law.inverse_cdf(LIKE_OTHERS));
        if ratio <= most {
            return Ok(());
        }
        let what = format!(
            "the units of this lot scatter {:.1} times as much as those of the other lots, at most {:.1} times at {} %",
            ratio.sqrt(),
            most.sqrt(),
            100.0 * LIKE_OTHERS
        );
        Err(Error::refused(what, "make a prior from this lot's units alone").column("--lot").value(&lot.lot))
    }

    /// Units of a lot that is not one of the fleet's.
    fn of_new_lot(&self, within: &Population) -> Population {
        let (p, lots) = (self.terms.len(), self.lots.len() as f64);
        let mean: Vec<f64> = (0..p).map(|at| self.lots.iter().map(|lot| lot.mean[at]).sum::<f64>() / lots).collect();
        let of_lots = |i: usize, j: usize| {
            let away = self.lots.iter().map(|lot| (lot.mean[i] - mean[i]) * (lot.mean[j] - mean[j]));
            away.sum::<f64>() / (lots - 1.0)
        };
        let entries = (0..p).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let covariance = entries.zip(&within.covariance).map(|((i, j), own)| own + of_lots(i, j)).collect();
        let (axes, of_tests) = (self.lots.len() as u64, within.of_tests.clone());
        Population { axes, mean, covariance, of_tests, directions: p }
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
        Error::refused(what, self.known_lots()).column("--lot").value(name)
    }

    fn too_few_lots(&self) -> Error {
        Error::refused(
            format!(
                "the lot of the unit is not given, and {} are too few without it: {LEAST_LOTS} are needed",
                counted(self.lots.len(), "lot", "lots")
            ),
            self.known_lots(),
        )
        .column("--lot")
    }

    fn known_lots(&self) -> String {
        let is_known = |lot: &&LotMean| lot.axes >= LEAST_OF_LOT as u64;
        let known: Vec<String> = self.lots.iter().filter(is_known).map(|lot| lot.lot.clone()).collect();
        let named = if known.is_empty() {
            String::new()
        } else {
            format!("give its lot with --lot ({}), or ", Error::choices(&known))
        };
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
