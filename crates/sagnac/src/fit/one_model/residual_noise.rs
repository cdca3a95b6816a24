//! The noise of a fit's residuals, and the covariance under it.
//!
//! ```text
//! Cov θ = (XᵀWX)⁻¹·XᵀW·V·WX·(XᵀWX)⁻¹        V: as the setup states it, unless the log shows more
//! ```
//!
//! Fails with few windows, or where the model explains everything: then the residuals count as white.

use crate::fit::one_model::design::Design;
use crate::fit::one_model::solution::{Fitted, values, weighted_rows, whitened_misfit};
use crate::fit::problem::least_squares::LeastSquares;
use crate::noise_model::estimate::{
    FEWEST_FOR_NOISE, NoiseEstimate, NoiseFit, SLOPE_STEP, estimate, restricted, t_quantile_975,
};
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;

/// The noise of the residuals.
#[derive(Clone, Copy)]
pub(crate) struct FitResidualNoise {
    pub(crate) estimate: NoiseEstimate,
    /// As the setup states it, or a fit with a prior found it, with the white variance of a nominal window, (°/h)².
    pub(crate) stated: Option<(SlowNoise, f64)>,
    /// The log shows more noise than the setup states.
    pub(crate) exceeds_setup: bool,
}

impl FitResidualNoise {
    /// A noise that is known, with a white variance.
    pub(crate) fn known(noise: SlowNoise, white: f64) -> Self {
        Self { estimate: NoiseEstimate::known(noise), stated: Some((noise, white)), exceeds_setup: false }
    }

    /// As the setup states it, unless the log shows more.
    pub(crate) fn of(problem: &LeastSquares<'_>, fitted: &Fitted, stated: Option<(SlowNoise, f64)>) -> Self {
        let shown = noise_of(problem, fitted);
        match stated {
            Some(stated) if !shows_more_than(problem, fitted, stated, shown.mixed) => Self::known(stated.0, stated.1),
            _ => Self { estimate: shown, stated: None, exceeds_setup: stated.is_some() },
        }
    }

    /// White variance of a nominal window, (°/h)²: stated, else that of the fit next to this slow noise.
    pub(crate) fn white_variance(&self, problem: &LeastSquares<'_>, fitted: &Fitted, noise: SlowNoise) -> f64 {
        self.stated.map_or_else(|| white_variance(problem, fitted, noise), |(_, white)| white)
    }

    /// A fit by weights, with its covariance under this noise.
    pub(crate) fn beneath(&self, problem: &LeastSquares<'_>, fitted: Fitted) -> Fitted {
        if self.stated.is_none() && self.estimate.best == SlowNoise::default() {
            return fitted;
        }
        let white = self.white_variance(problem, &fitted, self.estimate.mixed);
        with_slow_noise(problem, fitted, self.estimate.mixed, white)
    }
}

/// The slow noise of a model's residuals, by restricted likelihood; white without time, with too few windows, or where the model
/// explains everything.
pub(crate) fn noise_of(problem: &LeastSquares<'_>, fitted: &Fitted) -> NoiseEstimate {
    let rows = problem.len();
    let parameters = problem.levels().len() + fitted.terms.len();
    let scale: f64 = problem.y.iter().map(|y| y * y).sum();
    let square: f64 = fitted.residuals.iter().map(|r| r * r).sum();
    if !problem.has_rate() || rows < FEWEST_FOR_NOISE || rows < 2 * parameters || square < 1e-18 * scale {
        return NoiseEstimate::default();
    }
    let design = Design::new(problem, &fitted.terms, &values(&fitted.taus));
    let Some(likelihood) = design.likelihood(&[]) else { return NoiseEstimate::default() };
    estimate(likelihood.nominal_s, |noise| likelihood.criterion(noise))
}

/// True where the residuals show more noise than the setup states, slow noise and white variance.
fn shows_more_than(problem: &LeastSquares<'_>, fitted: &Fitted, stated: (SlowNoise, f64), shown: SlowNoise) -> bool {
    let parameters = problem.levels().len() + fitted.terms.len();
    let Some((normal, z)) = weighted_rows(problem, fitted, None).filter(|_| problem.len() > parameters) else {
        return false;
    };
    let degrees = (problem.len() - parameters) as f64;
    let noise_fit = |noise: SlowNoise, white: Option<f64>| {
        let whitening = Whitening::new(problem.noise_rows(), noise);
        let mut design = Design::new(problem, &fitted.terms, &values(&fitted.taus));
        design.whitening = Some(&whitening);
        let solution = design.factor(&[]).solve_all()?;
        let determinants = whitening.log_determinant + solution.log_determinant();
        let covariance = &normal * noise.between(problem.noise_rows(), &z) * &normal;
        let of_terms: f64 = covariance.diagonal().iter().skip(problem.levels().len()).sum();
        let variance = of_terms * white.unwrap_or(solution.ssr / degrees);
        Some(NoiseFit { criterion: restricted(solution.ssr, degrees, determinants, white), variance })
    };
    noise_fit(shown, None)
        .zip(noise_fit(stated.0, Some(stated.1)))
        .is_some_and(|(shown, stated)| shown.exceeds(&stated))
}

/// The fit with the covariance C that its weights have under this noise, with a white variance. The variances of slow noise are
/// themselves uncertain: degrees of freedom after Satterthwaite,
///
/// ```text
/// 1/ν = 1/(n − p) + ½·(∂ln C/∂ln v)²·Var(ln v)      v the variances of slow noise over the white one, which follows them
/// ```
fn with_slow_noise(problem: &LeastSquares<'_>, fitted: Fitted, noise: SlowNoise, white: f64) -> Fitted {
    let Some((normal, z)) = weighted_rows(problem, &fitted, None) else { return fitted };
    let (n, p) = (problem.len(), normal.nrows());
    let under = |noise: SlowNoise, white: f64| &normal * noise.between(problem.noise_rows(), &z) * &normal * white;
    let covariance = under(noise, white);
    let mut steepest = 0.0;
    if noise.log_variance > 0.0 {
        let [more, less] = [SLOPE_STEP, -SLOPE_STEP].map(|step| {
            let noise = noise.scaled(step.exp());
            under(noise, white_variance(problem, &fitted, noise))
        });
        let slope = |at: usize| (more[(at, at)] / less[(at, at)]).ln() / (2.0 * SLOPE_STEP);
        steepest = (problem.levels().len()..p).map(slope).fold(0.0_f64, |most, slope| most.max(slope.abs()));
    }
    let t_quantile_975 = t_quantile_975((n - p).max(1) as f64, steepest, noise);
    Fitted { covariance, t_quantile_975, ..fitted }
}

/// White variance of a nominal window under this noise: mean square of the innovations of generalized least squares.
fn white_variance(problem: &LeastSquares<'_>, fitted: &Fitted, noise: SlowNoise) -> f64 {
    let whitening = Whitening::new(problem.noise_rows(), noise);
    let degrees = (problem.len() as f64 - (problem.levels().len() + fitted.terms.len()) as f64).max(1.0);
    whitened_misfit(problem, fitted, &whitening).map_or(f64::NAN, |misfit| misfit / degrees)
}
