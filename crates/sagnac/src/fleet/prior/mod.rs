//! What a fleet says of a unit that nobody has tested: the mean curve, and how units scatter about it.
//!
//! ```text
//! β̂ᵢ = βᵢ + eᵢ,  Cov(eᵢ) = Vᵢ (of its record),  βᵢ ~ (μ, Σ)        on the common basis
//! μ̂ = mean β̂ᵢ        S = Cov(β̂ᵢ)        V̄ = mean Vᵢ = L·Lᵀ
//! Σ̂ = L·U·max(Λ − 1, 0)·Uᵀ·Lᵀ   with   L⁻¹·S·L⁻ᵀ = U·Λ·Uᵀ
//! ```
//!
//! S − V̄ is unbiased for Σ whatever the distributions; its positive part is taken where the tests' own uncertainty is 1, so that it
//! does not depend on the basis (for equal Vᵢ and normal units it is the restricted likelihood's). Where units are of several lots, S is
//! pooled about the lots' own means as well: that is the scatter of a unit whose lot is known.
//!
//! Outliers are not of the fleet: a coefficient more than 5 MAD (as σ) from the median of its lot excludes a unit, by name. Sums are
//! exact ([`ExactSum`]), so priors of two factories merge to the bytes that one of both would have.
//!
//! Fails for units of several models, or whose tests span other temperatures: those are not used, and counted. A test that is part of
//! the fleet is no evidence for the prior; the Vᵢ do not hold what other models would add. Of
//! sixty units Σ̂ is uncertain: the covariance of the next unit with Student's t covers the next unit's curve at any temperature with 0.93 to
//! 0.97, but the 95 % ellipsoid of three terms of Σ̂ in 0.83 to 0.91 (asserted in the tests): a gate on it needs a wider bound.

mod exact_sum;
mod groups;
mod lot_sums;
mod members;
mod of_unit;
mod read;
#[cfg(test)]
mod tests;
mod triangle;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

pub use exact_sum::ExactSum;
pub use lot_sums::LotSums;
pub use members::NotUsed;
pub use of_unit::PriorFile;

use lot_sums::values;
use members::{Member, copies, most_frequent, most_frequent_by, odd_ones, without_lags};
use triangle::{lower, place, symmetric};

use super::common_basis::CommonBasis;
use super::control::median;
use super::result::UnitResult;
use sagnac_log::error::{Error, Result};

/// Value of the `format` key.
const FORMAT: &str = "sagnac-fleet-prior";
/// Version of the file.
const VERSION: u32 = 3;
/// Axes that a covariance needs, in all and for each term.
const LEAST_AXES: u64 = 20;
const LEAST_PER_TERM: u64 = 5;
/// An axis is not used if its span ends so far, °C, within that of most.
const SPAN_MARGIN_C: f64 = 5.0;
/// Part of the axes at most that is not used because of its lag.
const MOST_SELECTED: f64 = 0.2;
/// Digits of a log's hash: no two logs of a factory share them by chance.
const LOG_DIGITS: usize = 16;

/// A prior for the next unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Prior {
    /// `sagnac-fleet-prior`.
    pub format: String,
    /// 3.
    pub version: u32,
    /// The model of all units, in the words of `--model`.
    pub model: String,
    /// Its terms on the common basis.
    pub terms: Vec<String>,
    /// Unit of each term's coefficient.
    pub units: Vec<String>,
    /// Temperatures that every unit's test covers, °C.
    pub span_c: [f64; 2],
    /// Temperature rates that every unit's test covers, °C/min: of the lag, then of the slow lag; empty without rate terms.
    pub rate_spans_cpm: Vec<[f64; 2]>,
    /// Lag of the rate terms where most tests do not resolve one, s: the median of their records; null where it is a parameter, and
    /// without rate terms.
    pub fixed_lag_s: Option<f64>,
    /// Angle random walk, root mean square over the axes whose logs show it, °/√h; 0 where none does.
    pub n_deg_rt_h: f64,
    /// Quantization, root mean square over the same, arcsec.
    pub q_arcsec: f64,
    /// Bias instability of the residuals, root mean square over the axes, °/h.
    pub bias_instability_dph: f64,
    /// Rate random walk of the residuals, root mean square over the axes, °/h/√h.
    pub rate_random_walk_dph_rt_h: f64,
    /// Nominal length of the windows of its units' residuals, s; null where they differ.
    pub window_s: Option<f64>,
    /// Mean of ln r over the axes, r in °/h: σ of a window's residual, with what its autocorrelation adds to the mean of many,
    /// r² = σ²·(1 + ρ)/(1 − ρ).
    pub residual_ln_mean: f64,
    /// Its σ over the axes.
    pub residual_ln_sigma: f64,
    /// All units, without regard to lots.
    pub fleet: Population,
    /// Units about the means of their lots; null with a single lot.
    pub within_lots: Option<Population>,
    /// Means of the lots.
    pub lots: Vec<LotMean>,
    /// Axes that were not used, by reason; the odd ones by name.
    pub not_used: Vec<NotUsed>,
    /// The logs behind it: the first 16 hexadecimal digits of their SHA-256.
    pub logs: BTreeSet<String>,
    /// What it was made of: sums, by lot.
    pub sums: BTreeMap<String, LotSums>,
    /// SHA-256 of all the rest as compact JSON, hex: set where a file is written.
    pub content_sha256: String,
}

/// How axes scatter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Population {
    /// Axes.
    pub axes: u64,
    /// μ̂.
    pub mean: Vec<f64>,
    /// Σ̂: the lower triangle, row by row.
    pub covariance: Vec<f64>,
    /// V̄, what the tests add to it: the lower triangle.
    pub of_tests: Vec<f64>,
    /// Directions in which units scatter more than their tests explain; of as many as there are terms.
    pub directions: usize,
}

/// The mean of a lot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LotMean {
    /// Its name.
    pub lot: String,
    /// Axes.
    pub axes: u64,
    /// Mean of their coefficients.
    pub mean: Vec<f64>,
}

/// What the axes of a prior have in common.
struct PriorHead {
    model: String,
    terms: Vec<String>,
    units: Vec<String>,
    span_c: [f64; 2],
    rate_spans_cpm: Vec<[f64; 2]>,
    fixed_lag_s: Option<f64>,
    window_s: Option<f64>,
    logs: BTreeSet<String>,
}

impl Prior {
    /// The prior of a fleet's results, of one model: that of most axes, or the one given.
    ///
    /// # Errors
    /// [`sagnac_log::ErrorKind::Refused`] where too few axes have the model to tell a covariance.
    pub fn learned(results: &[UnitResult], model: Option<&str>) -> Result<Self> {
        let all: Vec<Member<'_>> = results
            .iter()
            .flat_map(|unit| unit.axes.iter().map(move |axis| (unit, axis)))
            .filter_map(|(unit, axis)| Some(Member { unit, axis, basis: Cow::Borrowed(axis.common.as_ref()?) }))
            .collect();
        let without = results.iter().map(|unit| unit.axes.len()).sum::<usize>() - all.len();
        let model = model.map_or_else(|| most_frequent(&all), |model| Some(model.to_owned()));
        let model = model.ok_or_else(|| {
            Error::refused(
                "no unit of this fleet has a model on the common basis",
                "calibrate the fleet with one model: sagnac fleet calibrate … --model 'bias 3, rate 1'",
            )
        })?;
        let mut not_used = vec![counted("its model has no terms on the common basis", without)];
        let (all, others) = parted(all, |member| !member.axis.with_prior);
        not_used.push(counted("its record was made with a prior", others.len()));
        let (members, others) = parted(all, |member| member.axis.model == model);
        not_used.push(counted("another model", others.len()));
        // A test that does not resolve a lag has fewer parameters: the prior has those of most.
        let usual = most_frequent_by(&members, |member| member.basis.terms.len()).unwrap_or(0);
        let (mut members, mut others) = parted(members, |member| member.basis.terms.len() == usual);
        if others.len() as f64 > MOST_SELECTED * (members.len() + others.len()) as f64 {
            // Either part would be a selection by the lag, and by whatever goes with it: all take part, without it.
            members.append(&mut others);
            members.iter_mut().for_each(|member| member.basis = Cow::Owned(without_lags(&member.basis)));
        }
        let usual = members.first().map_or(0, |member| member.basis.terms.len());
        let (fewer, more) = parted(others, |member| member.basis.terms.len() < usual);
        not_used.push(counted("its test does not resolve the lag", fewer.len()));
        not_used.push(counted("its test resolves a lag that most do not", more.len()));
        let (members, copies) = copies(members);
        not_used.extend(copies);
        let ends = |end: usize| median(&members.iter().map(|member| member.axis.span_c[end]).collect::<Vec<_>>());
        let [lo, hi] = [ends(0), ends(1)];
        let (members, short) = parted(members, |Member { axis, .. }| {
            axis.span_c[0] <= lo + SPAN_MARGIN_C && axis.span_c[1] >= hi - SPAN_MARGIN_C
        });
        not_used.push(counted("its test spans fewer temperatures than most", short.len()));
        let odd = odd_ones(&members);
        let (members, odd_ones) = parted(members, |member| !odd.contains_key(&member.name()));
        not_used.extend(odd_ones.iter().map(|member| {
            let name = member.name();
            NotUsed { reason: odd[&name].clone(), axis: name, axes: 1 }
        }));
        groups::refuse(&members)?;
        let CommonBasis { terms, units, .. } =
            members.first().map(|member| member.basis.as_ref().clone()).unwrap_or_default();
        let span_c = [
            members.iter().map(|member| member.axis.span_c[0]).fold(f64::NEG_INFINITY, f64::max),
            members.iter().map(|member| member.axis.span_c[1]).fold(f64::INFINITY, f64::min),
        ];
        let rate_spans_cpm = members
            .iter()
            .map(|member| member.axis.rate_spans_cpm.clone())
            .reduce(|a, b| both(&a, &b))
            .unwrap_or_default();
        let has_lag = terms.iter().any(|term| term.ends_with("lag_s"));
        let lags: Vec<f64> = members.iter().filter_map(|member| member.axis.lag_s).collect();
        let fixed_lag_s = (!has_lag && !lags.is_empty()).then(|| median(&lags));
        let windows: Vec<f64> = members.iter().map(|member| member.axis.window_s).collect();
        let window_s = windows.first().copied().filter(|first| windows.iter().all(|window| window == first));
        let logs = members.iter().flat_map(|member| &member.unit.inputs_sha256);
        let logs = logs.map(|log| log.chars().take(LOG_DIGITS).collect()).collect();
        let mut by_lot: BTreeMap<String, Vec<&Member<'_>>> = BTreeMap::new();
        for member in &members {
            by_lot.entry(member.unit.lot.clone()).or_default().push(member);
        }
        let sums = by_lot.into_iter().map(|(lot, members)| (lot, LotSums::of(&members))).collect();
        not_used.retain(|part| part.axes > 0);
        Self::of_sums(
            PriorHead { model, terms, units, span_c, rate_spans_cpm, fixed_lag_s, window_s, logs },
            not_used,
            sums,
        )
    }

    /// Two priors as one: as if it had been learned from the fleets of both, each without its own outliers.
    ///
    /// # Errors
    /// Priors of two models.
    pub fn merged(mut self, other: Self) -> Result<Self> {
        if (&self.model, &self.terms, &self.units) != (&other.model, &other.terms, &other.units) {
            let what = format!("a prior for `{}` and one for `{}` cannot be merged", self.model, other.model);
            return Err(Error::input(what, "calibrate both fleets with the same --model"));
        }
        let span_c = [self.span_c[0].max(other.span_c[0]), self.span_c[1].min(other.span_c[1])];
        let rate_spans_cpm = both(&self.rate_spans_cpm, &other.rate_spans_cpm);
        let mut not_used: BTreeMap<(String, String), u64> = BTreeMap::new();
        for NotUsed { axis, reason, axes } in std::mem::take(&mut self.not_used).into_iter().chain(other.not_used) {
            *not_used.entry((axis, reason)).or_default() += axes;
        }
        let not_used = not_used.into_iter().map(|((axis, reason), axes)| NotUsed { axis, reason, axes }).collect();
        let twice = self.logs.intersection(&other.logs).count();
        if twice > 0 {
            let what = format!("{} of {} logs are in both", twice, other.logs.len());
            return Err(Error::input(what, "give each unit once"));
        }
        let mut sums = std::mem::take(&mut self.sums);
        let mut logs = std::mem::take(&mut self.logs);
        logs.extend(other.logs);
        let window_s = self.window_s.filter(|window_s| other.window_s == Some(*window_s));
        for (lot, more) in other.sums {
            sums.entry(lot).or_insert_with(|| LotSums::empty(self.terms.len())).merge(&more);
        }
        // Of two fleets the one whose tests say more: their records' lags differ by less than they can tell.
        let fixed_lag_s = self.fixed_lag_s.into_iter().chain(other.fixed_lag_s).reduce(f64::max);
        let Self { model, terms, units, .. } = self;
        Self::of_sums(
            PriorHead { model, terms, units, span_c, rate_spans_cpm, fixed_lag_s, window_s, logs },
            not_used,
            sums,
        )
    }

    fn of_sums(head: PriorHead, mut not_used: Vec<NotUsed>, sums: BTreeMap<String, LotSums>) -> Result<Self> {
        let PriorHead { model, terms, units, span_c, rate_spans_cpm, fixed_lag_s, window_s, logs } = head;
        not_used.sort();
        let mut all = LotSums::empty(terms.len());
        sums.values().for_each(|lot| all.merge(lot));
        let least = LEAST_AXES.max(LEAST_PER_TERM * terms.len() as u64) + sums.len() as u64;
        if all.axes < least {
            let reasons: Vec<String> =
                not_used.iter().map(|part| format!("{} not used: {}", part.axes, part.reason)).collect();
            return Err(Error::refused(
                format!(
                    "{} axes of `{model}` are too few for the scatter of {} terms: {least} are needed",
                    all.axes,
                    terms.len()
                ),
                if reasons.is_empty() {
                    "calibrate more units".to_owned()
                } else {
                    format!("calibrate the fleet with one --model ({})", reasons.join("; "))
                },
            ));
        }
        let mean = |sums: &LotSums| sums.value.iter().map(|sum| sum.value() / sums.axes as f64).collect::<Vec<f64>>();
        let lots: Vec<LotMean> =
            sums.iter().map(|(lot, sums)| LotMean { lot: lot.clone(), axes: sums.axes, mean: mean(sums) }).collect();
        let whole = std::iter::once(&all).collect::<Vec<_>>();
        let each: Vec<&LotSums> = sums.values().collect();
        let fleet = Population::of(&all, mean(&all), &whole)?;
        let within_lots = (each.len() > 1).then(|| Population::of(&all, mean(&all), &each)).transpose()?;
        let [ln, ln_square] = [4, 5].map(|at| all.noise[at].value() / all.axes as f64);
        let ln_variance = (ln_square - ln * ln).max(0.0) * all.axes as f64 / (all.axes - 1) as f64;
        let root_mean = |at: usize, axes: u64| (all.noise[at].value() / axes.max(1) as f64).max(0.0).sqrt();
        Ok(Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            model,
            terms,
            units,
            span_c,
            rate_spans_cpm,
            fixed_lag_s,
            n_deg_rt_h: root_mean(0, all.noise_axes),
            q_arcsec: root_mean(1, all.noise_axes),
            bias_instability_dph: root_mean(2, all.axes),
            rate_random_walk_dph_rt_h: root_mean(3, all.axes),
            window_s,
            residual_ln_mean: ln,
            residual_ln_sigma: ln_variance.sqrt(),
            fleet,
            within_lots,
            lots,
            not_used,
            logs,
            sums,
            content_sha256: String::new(),
        })
    }
}

impl Population {
    /// Axes about the means of the groups that they are in.
    fn of(all: &LotSums, mean: Vec<f64>, groups: &[&LotSums]) -> Result<Self> {
        let (p, n) = (mean.len(), all.axes as f64);
        let scatter = scatter_about_means(groups, p);
        let of_tests = symmetric(&values(&all.covariance), p) / n;
        let (covariance, directions) = beyond(&scatter, &of_tests).ok_or_else(|| {
            Error::refused(
                "the scatter of this fleet is smaller than the errors of its tests",
                "add units, or test each unit longer",
            )
        })?;
        Ok(Self { axes: all.axes, mean, covariance: lower(&covariance), of_tests: lower(&of_tests), directions })
    }

    /// σ of the units in a term, without that of their tests.
    pub fn sigma(&self, term: usize) -> f64 {
        self.covariance.get(place(term, term)).map_or(f64::NAN, |variance| variance.sqrt())
    }

    /// σ that the tests have in a term.
    pub fn sigma_of_tests(&self, term: usize) -> f64 {
        self.of_tests.get(place(term, term)).map_or(f64::NAN, |variance| variance.sqrt())
    }
}

/// Covariance of axes about the means of their groups.
fn scatter_about_means(groups: &[&LotSums], p: usize) -> DMatrix<f64> {
    let mut scatter = DMatrix::zeros(p, p);
    let mut degrees = 0.0;
    for group in groups {
        let own = DVector::from_iterator(p, group.value.iter().map(ExactSum::value));
        scatter += symmetric(&values(&group.product), p) - &own * own.transpose() / group.axes as f64;
        degrees += group.axes as f64 - 1.0;
    }
    scatter / degrees
}

/// The part of a scatter beyond a covariance, and the number of its directions; `None` where the covariance is not positive.
fn beyond(scatter: &DMatrix<f64>, covariance: &DMatrix<f64>) -> Option<(DMatrix<f64>, usize)> {
    // At unit variances first: terms of ppm and of °/h stand next to each other.
    let scale = covariance.diagonal().map(f64::sqrt);
    if scale.iter().any(|sigma| !sigma.is_finite() || *sigma <= 0.0) {
        return None;
    }
    let scaled = |m: &DMatrix<f64>| m.map_with_location(|i, j, value| value / (scale[i] * scale[j]));
    let factor = scaled(covariance).cholesky()?.unpack();
    let half = factor.solve_lower_triangular(&scaled(scatter))?;
    let whitened = factor.solve_lower_triangular(&half.transpose())?;
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new((&whitened + whitened.transpose()) / 2.0);
    let roots = eigenvalues.map(|value| (value - 1.0).max(0.0).sqrt());
    let directions = roots.iter().filter(|root| **root > 0.0).count();
    let root = factor * eigenvectors * DMatrix::from_diagonal(&roots);
    let beyond = &root * root.transpose();
    let back = beyond.map_with_location(|i, j, value| value * scale[i] * scale[j]);
    back.iter().all(|value| value.is_finite()).then_some((back, directions))
}

/// Rates that both spans hold, lag by lag.
fn both(one: &[[f64; 2]], other: &[[f64; 2]]) -> Vec<[f64; 2]> {
    one.iter().zip(other).map(|(a, b)| [a[0].max(b[0]), a[1].min(b[1])]).collect()
}

fn parted<T>(all: Vec<T>, is: impl Fn(&T) -> bool) -> (Vec<T>, Vec<T>) {
    all.into_iter().partition(is)
}

fn counted(reason: &str, axes: usize) -> NotUsed {
    NotUsed { axis: String::new(), reason: reason.to_owned(), axes: axes as u64 }
}
