//! The fit of a unit of which something is known before its test: how the units of its fleet scatter.
//!
//! ```text
//! y = levels + X(τ)·β + e                     θ = (β, τ),   M·θ ~ N(μ, Σ) of the fleet,   Σ = L·Lᵀ
//! θ = M⁻¹·(μ + L·z),   z ~ N(0, I)            min |W·(y − levels − X(τ)·β)|²/s² + |z|²,   linear in θ about the last τ
//! Cov θ = M⁻¹·L·(Gᵀ·G/s² + I)⁻¹·Lᵀ·M⁻ᵀ        G: rows of z without the levels, whitened by the slow noise of the test
//! G = U·S·Vᵀ                                  uⱼᵀy: what the test says in direction j, in which units scatter by sⱼ ([`gate`])
//! ```
//!
//! A coefficient that the test does not show is the fleet's, with the fleet's σ. Rows are weighted by the noise here, not by their lengths alone: how much of a curve is the unit's and how much
//! the fleet's is a question of noise.
//!
//! Fails for a unit that is odd where the test does not go: `directions` of the record says in how many of the prior's directions the
//! test could tell. A test that shows none of them is refused.

mod gate;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::calibration::PriorUse;
use crate::fit::design::{Columns, Design, Tau, lag_one};
use crate::fit::least_squares::{LeastSquares, TermColumn};
use crate::fit::slow_noise::{self, SlowNoise, Whitening};
use crate::fit::solution::{FEWEST_DEGREES, FEWEST_FOR_NOISE, Fitted, SLOPE_STEP};
use crate::fit::solve::Factor;
use crate::model::common_basis::{SeriesTerm, onto_common};
use crate::model::spec::ModelSpec;
use sagnac_log::error::{Error, Result};
use sagnac_log::setup::Noise;

/// A direction counts as shown by the test where its scatter is this part of the noise.
const SHOWN_TO_NOISE: f64 = 1e-3;
/// The test contradicts the noise of the fleet where its own explains it better by this in −2·ln(restricted likelihood).
const CONTRADICTED: f64 = 2.0;
/// An autocorrelation is taken as within this.
const MOST_CORRELATED: f64 = 0.95;
/// Windows beyond the parameters, so that the test says how noisy it is.
const LEAST_DEGREES: usize = 10;
/// End of the name of a lag among the parameters.
const LAG: &str = "lag_s";
/// Sweeps over the lags at most, and the change of a lag that is none.
const MOST_SWEEPS: usize = 12;
const STILL: f64 = 1e-4;

/// What is known of a unit's coefficients before its test, on the common basis ([`crate::model::COMMON_SPAN`]).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct UnitPrior {
    /// The model, in the words of `--model`.
    pub model: ModelSpec,
    /// Names of the parameters: those of the terms, then `lag_s` and `slow lag_s`.
    pub terms: Vec<String>,
    /// μ.
    pub mean: Vec<f64>,
    /// Σ, with what is not known of it: the lower triangle, row by row.
    pub covariance: Vec<f64>,
    /// Degrees of freedom of Σ.
    pub degrees: f64,
    /// Temperatures that the tests of the fleet covered, °C.
    pub span_c: [f64; 2],
    /// Rates that they covered, °C/min: of the thermometer's first lag, then of its slow one.
    pub rate_spans_cpm: Vec<[f64; 2]>,
    /// Lag of the rate terms where the fleet's tests do not resolve one, s: that of their records.
    pub fixed_lag_s: Option<f64>,
    /// Bias instability of its units, °/h.
    pub bias_instability_dph: f64,
    /// Rate random walk of its units, °/h/√h.
    pub rate_random_walk_dph_rt_h: f64,
    /// How large residuals of the fleet are; `None` where its tests have windows of several lengths.
    pub residual: Option<ResidualOfFleet>,
    /// Axes behind it.
    pub axes: u64,
    /// The lot, where it is that of a lot.
    pub lot: Option<String>,
    /// SHA-256 of its file, hex.
    pub sha256: String,
}

/// Residuals of a fleet's tests: ln r is normal over its axes, r² = σ²·(1 + ρ)/(1 − ρ).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ResidualOfFleet {
    /// Nominal length of their windows, s.
    pub window_s: f64,
    /// Mean of ln r, r in °/h.
    pub ln_mean: f64,
    /// Its σ.
    pub ln_sigma: f64,
    /// Axes behind both.
    pub axes: u64,
}

/// ln of σ·√((1 + ρ)/(1 − ρ)): what a residual and its autocorrelation from window to window make of the mean of many.
pub(crate) fn ln_of_residual(sigma_dph: f64, correlation: f64) -> f64 {
    let rho = correlation.clamp(-MOST_CORRELATED, MOST_CORRELATED);
    sigma_dph.max(f64::MIN_POSITIVE).ln() + 0.5 * ((1.0 + rho) / (1.0 - rho)).ln()
}

/// The prior in the parameters of a fit.
struct Known {
    /// θ of the fleet's mean, and M⁻¹·L.
    mean: DVector<f64>,
    root: DMatrix<f64>,
    /// L, on the common basis.
    common_root: DMatrix<f64>,
}

/// The rows of z about some lags.
struct Linear {
    /// Of each z.
    columns: Vec<Vec<f64>>,
    /// What the fleet's mean says of each row.
    expected: Vec<f64>,
}

/// What the rows say at some noise.
struct Solved {
    levels: DVector<f64>,
    z: DVector<f64>,
    /// Of levels and z.
    covariance: DMatrix<f64>,
    /// White variance of a nominal window.
    variance: f64,
    /// S, and Uᵀy.
    singular: DVector<f64>,
    along: DVector<f64>,
    /// V.
    directions: DMatrix<f64>,
}

/// A fit with a prior.
pub(super) struct WithPrior {
    pub(super) fitted: Fitted,
    pub(super) noise: SlowNoise,
    pub(super) white_variance: f64,
    pub(super) used: PriorUse,
}

/// Fits a model with a prior. `stated` is the noise where a setup states it, with its white variance.
///
/// # Errors
/// A prior of other terms; too few windows; a test that shows nothing of what units differ in; a unit that is not of the fleet.
pub(super) fn fit_with_prior(
    problem: &LeastSquares<'_>,
    spec: &ModelSpec,
    prior: &UnitPrior,
    stated: Option<(SlowNoise, f64)>,
) -> Result<WithPrior> {
    let terms = problem.terms(spec);
    let mut taus: Vec<Tau> =
        problem.rated(spec).into_iter().map(|input| Tau { input, value_s: 0.0, resolved: true }).collect();
    let free = prior.terms.iter().filter(|name| name.ends_with(LAG)).count();
    if let ([tau], 0, Some(lag_s)) = (&mut taus[..], free, prior.fixed_lag_s) {
        (tau.value_s, tau.resolved) = (lag_s.clamp(problem.period_s(), problem.longest_run_s()), false);
    } else if free != taus.len() {
        return Err(of_other_terms());
    }
    let known = Known::new(problem, &terms, free, prior)?;
    let parameters = problem.levels.len() + known.mean.len();
    if problem.len() < parameters + LEAST_DEGREES {
        let least = parameters + LEAST_DEGREES;
        return Err(Error::refused(format!(
            "{} windows are too few to tell how noisy the test is; {least} are needed with a prior of {} parameters",
            problem.len(),
            known.mean.len()
        ))
        .help("give more data or a shorter --window"));
    }
    let dependent = || Error::refused("the run offsets are not independent on these data");
    let given = stated.map(|(noise, white)| (noise, Some(white))).unwrap_or_default();
    let (mut linear, mut solved) = settled(problem, &terms, &mut taus, &known, given).ok_or_else(dependent)?;
    let mut noise = given.0;
    if stated.is_none() {
        noise = noise_of(problem, &linear, &solved, prior);
        if noise != SlowNoise::default() {
            (linear, solved) = settled(problem, &terms, &mut taus, &known, (noise, None)).ok_or_else(dependent)?;
        }
    }
    let spare_rows = (problem.len() - parameters) as f64;
    gate::refuse_other_terms(problem, &linear, &solved, (&terms, &taus), noise, spare_rows)?;
    let used = gate::gate(&known, &solved, prior, spare_rows)?;
    let theta = known.theta(&solved);
    let whole: Vec<f64> = solved.levels.iter().chain(theta.iter().take(terms.len())).copied().collect();
    let residuals = Design::new(problem, &terms, &values(&taus)).residuals(&whole);
    let weighted: Vec<f64> = residuals.iter().zip(&problem.weight).map(|(r, w)| r * w.sqrt()).collect();
    let autocorrelation = lag_one(problem, &weighted);
    let degrees = (problem.len() - problem.levels.len()) as f64 - used.determined;
    let effective = degrees_of(problem, &linear, &solved, noise, stated);
    let sigma_dph = (weighted.iter().map(|r| r * r).sum::<f64>() / degrees.max(1.0)).sqrt();
    let used = PriorUse { residual_dph: Some(ln_of_residual(sigma_dph, autocorrelation).exp()), ..used };
    let used = gate::residual_like_the_fleets(used, prior, problem.windows().shape.nominal_s, degrees)?;
    let fitted = Fitted {
        spec: spec.clone(),
        terms,
        taus,
        theta: whole,
        covariance: known.covariance_of_theta(problem.levels.len(), &solved),
        residuals,
        sigma_dph,
        autocorrelation,
        t_quantile_975: StudentsT::new(0.0, 1.0, effective.max(FEWEST_DEGREES)).map_or(1.96, |t| t.inverse_cdf(0.975)),
        conditioning: None,
    };
    Ok(WithPrior { fitted, noise, white_variance: solved.variance, used })
}

fn of_other_terms() -> Error {
    Error::input("the prior's parameters are not those of its model in this program")
        .help("make the prior anew with `sagnac fleet prior`")
}

fn values(taus: &[Tau]) -> Vec<(usize, f64)> {
    taus.iter().map(|tau| (tau.input, tau.value_s)).collect()
}

impl Known {
    fn new(problem: &LeastSquares<'_>, terms: &[TermColumn], lags: usize, prior: &UnitPrior) -> Result<Self> {
        let (p, q) = (terms.len(), terms.len() + lags);
        let other = of_other_terms;
        if prior.mean.len() != q || prior.covariance.len() != q * (q + 1) / 2 {
            return Err(other());
        }
        let like = |one: &TermColumn, other: &TermColumn| {
            let key = |term: &TermColumn| (term.input, term.form.acts_on, term.form.times_rate);
            key(one) == key(other)
        };
        let of_series = |term: &TermColumn| {
            let series = terms.iter().position(|other| like(other, term)).filter(|_| problem.is_main(term.input))?;
            Some(SeriesTerm { series, shape: term.form.shape, times_rate: term.form.times_rate })
        };
        let series: Vec<SeriesTerm> = terms.iter().map(of_series).collect::<Option<_>>().ok_or_else(other)?;
        let onto = onto_common(problem.span(), &series).ok_or_else(other)?;
        let mut matrix = DMatrix::identity(q, q);
        matrix.view_mut((0, 0), (p, p)).fill(0.0);
        for (row, weights) in onto.iter().enumerate() {
            weights.iter().for_each(|(own, weight)| matrix[(row, *own)] = *weight);
        }
        let entry = |i: usize, j: usize| prior.covariance[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
        let scale = DVector::from_fn(q, |i, _| entry(i, i).max(0.0).sqrt());
        let scaled = DMatrix::from_fn(q, q, |i, j| entry(i, j) / (scale[i] * scale[j]));
        let root = scaled.cholesky().ok_or_else(|| Error::input("the prior's covariance is not positive"))?;
        let common_root = DMatrix::from_diagonal(&scale) * root.unpack();
        let inverse = matrix.try_inverse().ok_or_else(other)?;
        let mean = &inverse * DVector::from_column_slice(&prior.mean);
        Ok(Self { mean, root: inverse * &common_root, common_root })
    }

    fn theta(&self, solved: &Solved) -> DVector<f64> {
        &self.mean + &self.root * &solved.z
    }

    /// Of levels, terms and lags.
    fn covariance_of_theta(&self, levels: usize, solved: &Solved) -> DMatrix<f64> {
        let q = self.mean.len();
        let mut map = DMatrix::identity(levels + q, levels + q);
        map.view_mut((levels, levels), (q, q)).copy_from(&self.root);
        &map * &solved.covariance * map.transpose()
    }
}

impl Linear {
    /// About the lags of `taus` and some coefficients of the terms.
    fn about(problem: &LeastSquares<'_>, terms: &[TermColumn], taus: &[Tau], of_terms: &[f64], known: &Known) -> Self {
        let design = Design::new(problem, terms, &values(taus));
        let of_term = |term: &TermColumn| -> Vec<f64> {
            (0..problem.len()).map(|row| problem.regressor(term, row, &design.rates)).collect()
        };
        // A lag that is fixed has no column.
        let free = taus.iter().take(known.mean.len() - terms.len());
        let own: Vec<Vec<f64>> =
            terms.iter().map(of_term).chain(free.map(|tau| design.slope_of_lag(tau, of_terms))).collect();
        let mix = |weights: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let mut sum = vec![0.0; problem.len()];
            for (at, column) in own.iter().enumerate() {
                let weight = weights(at);
                sum.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value);
            }
            sum
        };
        let at_mean = |at: usize| known.mean[at] - at.checked_sub(terms.len()).map_or(0.0, |lag| taus[lag].value_s);
        let columns = (0..own.len()).map(|z| mix(&|at| known.root[(at, z)])).collect();
        Self { columns, expected: mix(&at_mean) }
    }

    /// The rows whitened by some noise, reduced.
    fn factor(&self, problem: &LeastSquares<'_>, noise: SlowNoise) -> Factor {
        let whitening = (noise != SlowNoise::default()).then(|| Whitening::new(problem.noise_rows(), noise));
        let mut design = Design::with_rates(problem, &[], Vec::new());
        (design.whitening, design.expected) = (whitening.as_ref(), Some(self.expected.as_slice()));
        design.factor(&self.columns).factor
    }

    /// The best z at some noise, whose white variance is that of the residual where none is given.
    fn solved(&self, problem: &LeastSquares<'_>, (noise, white): (SlowNoise, Option<f64>)) -> Option<Solved> {
        let (levels, q) = (problem.levels.len(), self.columns.len());
        let factor = self.factor(problem, noise);
        let block = factor.beyond(levels);
        let residual = block[(q, q)].powi(2) / (problem.len() - levels - q) as f64;
        let svd = block.view((0, 0), (q, q)).into_owned().svd(true, true);
        let along = svd.u?.transpose() * block.view((0, q), (q, 1)).column(0);
        let at = |variance: f64| -> Option<(DVector<f64>, DMatrix<f64>)> {
            let mut of_prior = DMatrix::zeros(q, levels + q + 1);
            of_prior.view_mut((0, levels), (q, q)).fill_with_identity();
            let both = [factor.scaled(variance.sqrt().recip()), Factor::of(of_prior)];
            let whole = Columns { factor: Factor::join(both.iter())?, count: levels + q };
            let solution = whole.solve_all()?;
            let covariance = solution.inverse_normal()?;
            Some((solution.theta, covariance))
        };
        let mut variance = white.unwrap_or(residual);
        let (mut theta, mut covariance) = at(variance)?;
        if white.is_none() && noise == SlowNoise::default() {
            // Correlation that the slow noise does not have is a part of the variance, as in the fit without a prior.
            let rho = self.autocorrelation(problem, &theta);
            variance *= (1.0 + rho) / (1.0 - rho);
            (theta, covariance) = at(variance)?;
        }
        Some(Solved {
            levels: theta.rows(0, levels).into_owned(),
            z: theta.rows(levels, q).into_owned(),
            covariance,
            variance,
            singular: svd.singular_values,
            along,
            directions: svd.v_t?.transpose(),
        })
    }

    /// γ/σ of one more column, of which nothing is known before; `None` where the others explain it whole.
    fn beside(&self, problem: &LeastSquares<'_>, column: Vec<f64>, noise: SlowNoise, variance: f64) -> Option<f64> {
        let (levels, q) = (problem.levels.len(), self.columns.len());
        let columns: Vec<Vec<f64>> = self.columns.iter().cloned().chain([column]).collect();
        let more = Self { columns, expected: self.expected.clone() };
        let mut of_prior = DMatrix::zeros(q, levels + q + 2);
        of_prior.view_mut((0, levels), (q, q)).fill_with_identity();
        let both = [more.factor(problem, noise).scaled(variance.sqrt().recip()), Factor::of(of_prior)];
        let whole = Columns { factor: Factor::join(both.iter())?, count: levels + q + 1 };
        let solution = whole.solve_all()?;
        let covariance = solution.inverse_normal()?;
        let sigma = covariance[(levels + q, levels + q)].sqrt();
        Some(solution.theta[levels + q] / sigma).filter(|in_sigma| in_sigma.is_finite())
    }

    fn autocorrelation(&self, problem: &LeastSquares<'_>, theta: &DVector<f64>) -> f64 {
        let levels = problem.levels.len();
        let residual = |row: usize| {
            let of_levels: f64 =
                problem.levels.iter().zip(theta).map(|(level, value)| problem.level(row, *level) * value).sum();
            let of_z: f64 = self.columns.iter().enumerate().map(|(z, column)| column[row] * theta[levels + z]).sum();
            (problem.y[row] - self.expected[row] - of_levels - of_z) * problem.weight[row].sqrt()
        };
        lag_one(problem, &(0..problem.len()).map(residual).collect::<Vec<_>>())
    }
}

/// The fit at some noise, linear about its own lags.
fn settled(
    problem: &LeastSquares<'_>,
    terms: &[TermColumn],
    taus: &mut [Tau],
    known: &Known,
    noise: (SlowNoise, Option<f64>),
) -> Option<(Linear, Solved)> {
    let p = terms.len();
    let [shortest_s, longest_s] = [problem.period_s(), problem.longest_run_s()];
    let set = |taus: &mut [Tau], theta: &DVector<f64>| {
        let mut moved = false;
        for (tau, value_s) in taus.iter_mut().zip(theta.iter().skip(p)) {
            let value_s = value_s.clamp(shortest_s, longest_s.max(shortest_s));
            moved |= (value_s - tau.value_s).abs() > STILL * value_s;
            tau.value_s = value_s;
        }
        moved
    };
    let mut theta = known.mean.clone();
    set(taus, &theta);
    for sweep in 1.. {
        let linear = Linear::about(problem, terms, taus, &theta.as_slice()[..p], known);
        let solved = linear.solved(problem, noise)?;
        theta = known.theta(&solved);
        if !set(taus, &theta) || sweep == MOST_SWEEPS {
            return Some((linear, solved));
        }
    }
    None
}

/// The slow noise of the test: that of the fleet, unless the test contradicts it. By restricted likelihood, beside the directions that
/// the test shows.
fn noise_of(problem: &LeastSquares<'_>, linear: &Linear, solved: &Solved, prior: &UnitPrior) -> SlowNoise {
    let rows = problem.len();
    let shown = shown(solved, SHOWN_TO_NOISE);
    let parameters = problem.levels.len() + shown.len();
    let stated = Noise::walk(0.0).slow(prior.bias_instability_dph, prior.rate_random_walk_dph_rt_h);
    let of_fleet = SlowNoise::stated(stated, solved.variance).unwrap_or_default();
    if !problem.has_rate() || rows < FEWEST_FOR_NOISE || rows < 2 * parameters {
        return of_fleet;
    }
    let along = |direction: &usize| -> Vec<f64> {
        let weights = solved.directions.column(*direction);
        (0..problem.len()).map(|row| linear.columns.iter().zip(&weights).map(|(c, w)| w * c[row]).sum()).collect()
    };
    let columns: Vec<Vec<f64>> = shown.iter().map(along).collect();
    let mut design = Design::with_rates(problem, &[], Vec::new());
    design.expected = Some(linear.expected.as_slice());
    let Some(likelihood) = design.likelihood(&columns) else { return of_fleet };
    let criterion = |noise| likelihood.criterion(noise);
    let measured = slow_noise::estimate(likelihood.nominal_s, criterion).best;
    if criterion(of_fleet) < criterion(measured) + CONTRADICTED { of_fleet } else { measured }
}

/// Directions in which units scatter by this part of the noise or more.
fn shown(solved: &Solved, part: f64) -> Vec<usize> {
    let least = part * solved.variance.sqrt();
    (0..solved.singular.len()).filter(|at| solved.singular[*at] > least).collect()
}

/// Degrees of freedom of the interval after Satterthwaite, as [`super::solution::with_slow_noise`] has them.
fn degrees_of(
    problem: &LeastSquares<'_>,
    linear: &Linear,
    solved: &Solved,
    noise: SlowNoise,
    stated: Option<(SlowNoise, f64)>,
) -> f64 {
    let (n, levels) = (problem.len(), problem.levels.len());
    let mut of_noise = 0.0;
    if noise.log_variance > 0.0 && stated.is_none() {
        let at = |step: f64| linear.solved(problem, (noise.scaled(step.exp()), None));
        if let (Some(more), Some(less)) = (at(SLOPE_STEP), at(-SLOPE_STEP)) {
            let slope = |at: usize| (more.covariance[(at, at)] / less.covariance[(at, at)]).ln() / (2.0 * SLOPE_STEP);
            let steepest = (levels..levels + solved.z.len()).map(slope).fold(0.0_f64, |most, s| most.max(s.abs()));
            of_noise = 0.5 * steepest.powi(2) * noise.log_variance;
        }
    }
    (((n - levels - solved.z.len()).max(1) as f64).recip() + of_noise).recip()
}
