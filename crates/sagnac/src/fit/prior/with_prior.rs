//! The fit of a unit of which something is known before its test: how the units of its fleet scatter ([`super::posterior`]).
//!
//! Fails for a unit that is odd where the test does not go: `directions` of the record says in how many of the prior's directions the
//! test could tell. A test that shows none of them is refused.

use crate::calibration::PriorUse;
use crate::fit::one_model::design::{Design, Tau, lag_one};
use crate::fit::one_model::solution::Fitted;
use crate::fit::prior::gate::{gate, refuse_other_terms, residual_like_the_fleets};
use crate::fit::prior::posterior::{Known, Linear, Solved, of_other_terms, settled, shown, values};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::unit_prior::{UnitPrior, ln_of_residual};
use crate::fit::selection::prices::PRIOR_CONTRADICTED;
use crate::model::spec::ModelSpec;
use crate::noise_model::estimate::{FEWEST_DEGREES, FEWEST_FOR_NOISE, SLOPE_STEP, estimate};
use crate::noise_model::processes::SlowNoise;
use sagnac_log::error::{Error, Result};
use sagnac_log::setup::Noise;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A direction counts as shown by the test where its scatter is this part of the noise.
const SHOWN_TO_NOISE: f64 = 1e-3;
/// Windows beyond the parameters, so that the test says how noisy it is.
const LEAST_DEGREES: usize = 10;
/// End of the name of a lag among the parameters.
const LAG: &str = "lag_s";

/// A fit with a prior.
pub(crate) struct WithPrior {
    pub(crate) fitted: Fitted,
    pub(crate) noise: SlowNoise,
    pub(crate) white_variance: f64,
    pub(crate) used: PriorUse,
}

/// Fits a model with a prior. `stated` is the noise where a setup states it, with its white variance.
///
/// # Errors
/// A prior of other terms; too few windows; a test that shows nothing of what units differ in; a unit that is not of the fleet.
pub(crate) fn fit_with_prior(
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
    let parameters = problem.levels().len() + known.mean.len();
    if problem.len() < parameters + LEAST_DEGREES {
        let least = parameters + LEAST_DEGREES;
        return Err(Error::refused(
            format!(
                "{} windows are too few for the noise of the test: a prior of {} parameters needs {least}",
                problem.len(),
                known.mean.len()
            ),
            "give more data, or set a shorter --window",
        ));
    }
    let dependent = || {
        Error::refused(
            "the run offsets are not independent on these data",
            "give longer runs, or calibrate without --prior",
        )
    };
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
    refuse_other_terms(problem, &linear, &solved, (&terms, &taus), noise, spare_rows)?;
    let used = gate(&known, &solved, prior, spare_rows)?;
    let theta = known.theta(&solved);
    let whole: Vec<f64> = solved.levels.iter().chain(theta.iter().take(terms.len())).copied().collect();
    let residuals = Design::new(problem, &terms, &values(&taus)).residuals(&whole);
    let weighted: Vec<f64> = residuals.iter().zip(&problem.weight).map(|(r, w)| r * w.sqrt()).collect();
    let autocorrelation = lag_one(problem, &weighted);
    let degrees = (problem.len() - problem.levels().len()) as f64 - used.determined;
    let effective = degrees_of(problem, &linear, &solved, noise, stated);
    let sigma_dph = (weighted.iter().map(|r| r * r).sum::<f64>() / degrees.max(1.0)).sqrt();
    let used = PriorUse { residual_dph: Some(ln_of_residual(sigma_dph, autocorrelation).exp()), ..used };
    let used = residual_like_the_fleets(used, prior, problem.windows().shape.nominal_s, degrees)?;
    let fitted = Fitted {
        spec: spec.clone(),
        terms,
        taus,
        theta: whole,
        covariance: known.covariance_of_theta(problem.levels().len(), &solved),
        residuals,
        sigma_dph,
        autocorrelation,
        t_quantile_975: StudentsT::new(0.0, 1.0, effective.max(FEWEST_DEGREES)).map_or(1.96, |t| t.inverse_cdf(0.975)),
        conditioning: None,
    };
    Ok(WithPrior { fitted, noise, white_variance: solved.variance, used })
}

/// The slow noise of the test: that of the fleet, unless the test contradicts it. By restricted likelihood, next to the directions that
/// the test shows.
fn noise_of(problem: &LeastSquares<'_>, linear: &Linear, solved: &Solved, prior: &UnitPrior) -> SlowNoise {
    let rows = problem.len();
    let shown = shown(solved, SHOWN_TO_NOISE);
    let parameters = problem.levels().len() + shown.len();
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
    let measured = estimate(likelihood.nominal_s, criterion).best;
    if criterion(of_fleet) < criterion(measured) + PRIOR_CONTRADICTED { of_fleet } else { measured }
}

/// Degrees of freedom of the interval after Satterthwaite, as [`crate::fit::one_model::residual_noise`] has them.
fn degrees_of(
    problem: &LeastSquares<'_>,
    linear: &Linear,
    solved: &Solved,
    noise: SlowNoise,
    stated: Option<(SlowNoise, f64)>,
) -> f64 {
    let (n, levels) = (problem.len(), problem.levels().len());
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
