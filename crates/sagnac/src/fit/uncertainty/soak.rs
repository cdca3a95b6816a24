//! Gain of a longer soak: forecast of the uncertainty of the curve after additional hours.
//!
//! ```text
//! Cov' = s²·N'·(ZᵀVZ)'·N'        N' = (N⁻¹ + m·g·gᵀ)⁻¹ = N − N·g·gᵀ·N·m/(1 + m·gᵀ·N·g)      (Sherman and Morrison 1950)
//! ```
//!
//! with N = (JᵀWJ)⁻¹, Z = WJ, V the noise of the residuals, g the regressors of a window at rest at the soak's temperature and
//! m = hours·3600/τ_w windows, which carry the noise on from the end of the last run. s² is the white variance of a window, as the
//! covariance of the fit has it. The forecast assumes that the model is right: a longer
//! soak does not replace a missing term.

use crate::calibration::{Soak, SoakRow};
use crate::fit::one_model::curve::FittedCurve;
use crate::fit::one_model::solution::{Fitted, weighted_rows};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::noise_model::processes::{Continuation, SlowNoise};
use nalgebra::{DMatrix, DVector};

/// Hours that are forecast.
const HOURS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Temperatures over the span, ends included.
const TEMPERATURES: usize = 12;

/// What more windows at the end of a test would make of the covariance of its fit.
struct Extension {
    /// (JᵀWJ)⁻¹.
    normal: DMatrix<f64>,
    /// ZᵀVZ.
    between: DMatrix<f64>,
    continuation: Continuation,
    /// White variance of a window, (°/h)²: that with which these make the covariance of the fit.
    white: f64,
    window_s: f64,
}

impl Extension {
    /// Under the likeliest noise: in a mixture a walk that is hardly there would grow over the hours. `None` where the terms depend on
    /// each other.
    fn new(problem: &LeastSquares<'_>, fitted: &Fitted, noise: SlowNoise) -> Option<Self> {
        let (normal, z) = weighted_rows(problem, fitted, None)?;
        let (between, continuation) =
            (noise.between(problem.noise_rows(), &z), noise.continued(problem.noise_rows(), &z));
        let first = normal.column(0);
        let white = fitted.covariance[(0, 0)] / first.dot(&(&between * first));
        Some(Self { normal, between, continuation, white, window_s: problem.windows().shape.nominal_s })
    }

    /// σ of a combination `of` the parameters after hours of windows of the regressors `g`.
    fn sigma_after(&self, weights: &DVector<f64>, g: &DVector<f64>, hours: f64) -> f64 {
        let windows = hours * 3600.0 / self.window_s;
        let (moved, toward) = (&self.normal * weights, &self.normal * g);
        let u = &moved - &toward * (windows * g.dot(&moved) / (1.0 + windows * g.dot(&toward)));
        let known = u.dot(&(&self.between * &u));
        (self.white * (known + self.continuation.added(&u, g.dot(&u), windows))).max(0.0).sqrt()
    }
}

/// The forecast of a fit under its likeliest noise; `None` where there is no bias term.
pub(crate) fn soak(problem: &LeastSquares<'_>, fitted: &Fitted, noise: SlowNoise) -> Option<Soak> {
    let fitted_curve = FittedCurve::of(problem, fitted);
    if fitted_curve.is_empty() {
        return None;
    }
    let extension = Extension::new(problem, fitted, noise)?;
    let offset = problem.levels().iter().rposition(|level| matches!(level, Level::Run(_) | Level::AllRuns))?;
    let span = problem.span();
    let curve = |celsius: f64| {
        let mut g = DVector::zeros(fitted.covariance.nrows());
        fitted_curve.weights(celsius).iter().for_each(|(row, weight)| g[*row] = *weight);
        g
    };
    let sigma_after = |weights: &DVector<f64>, soaked_c: f64, hours: f64| {
        let mut g = curve(soaked_c);
        g[offset] = 1.0;
        extension.sigma_after(weights, &g, hours)
    };
    let width = (span.hi - span.lo) / (TEMPERATURES - 1) as f64;
    let temperatures: Vec<f64> = (0..TEMPERATURES).map(|i| span.lo + width * i as f64).collect();
    let table: Vec<SoakRow> = temperatures
        .iter()
        .map(|t| SoakRow {
            temperature_c: *t,
            sigma_dph: sigma_after(&curve(*t), *t, 0.0),
            after_dph: HOURS.map(|hours| sigma_after(&curve(*t), *t, hours)).to_vec(),
        })
        .collect();
    // The temperature at which an hour reduces the uncertainty of the whole curve most.
    let mean_square = |soaked_c: f64, hours: f64| -> f64 {
        temperatures.iter().map(|t| sigma_after(&curve(*t), soaked_c, hours).powi(2)).sum::<f64>() / TEMPERATURES as f64
    };
    let best =
        temperatures.iter().copied().min_by(|a, b| mean_square(*a, HOURS[0]).total_cmp(&mean_square(*b, HOURS[0])))?;
    Some(Soak {
        hours: HOURS.to_vec(),
        rows: table,
        best_c: best,
        mean_sigma_dph: mean_square(best, 0.0).sqrt(),
        mean_sigma_after_dph: mean_square(best, HOURS[0]).sqrt(),
    })
}
