//! What a fit cannot separate from its curve, because it moved together with temperature, and what that adds to the uncertainty.
//!
//! ```text
//! r  = Ṫ at some lag, or t          a column that the model does not have, and that temperature explains
//! β  = (XᵀX)⁻¹Xᵀr                   the curve's coefficients that do its work
//! ĉ  = r̃ᵀy/|r̃|², r̃ = r − Xβ         its coefficient if it were fitted with them, with variance s²/|r̃|²
//! σ²(T) = (w(T)ᵀβ)²·(s²/|r̃|² + ĉ²)  added to the curve, w its weights at T less those at T0
//! ```
//!
//! That is the variance of the curve with the column in the fit, and the square of the distance to that curve. It is added only
//! where [`crate::diagnostics::profile`] says that the two moved together: elsewhere the selection has judged the column. At most
//! the whole curve is the work of something else: its largest distance from zero bounds what is added.

use crate::calibration::{CurveSpread, Entanglement, MovedTogether};
use crate::diagnostics::WindowPoint;
use crate::diagnostics::profile::{TOGETHER, rate_explained, time_explained};
use crate::fit::one_model::curve::FittedCurve;
use crate::fit::one_model::solution::{Fitted, added_column};
use crate::fit::problem::curve_points::{POINTS, temperature};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;

/// Lags of the rate that are looked at, s: a fast one, a block's, a chamber's.
const LAGS_S: [f64; 3] = [1.0, 300.0, 1500.0];

/// What moved together with temperature, and what that adds to the curve; `noise` is the slow noise with its white variance.
pub(crate) fn entangled(
    problem: &LeastSquares<'_>,
    noise: (SlowNoise, f64),
    fitted: &Fitted,
    points: &[WindowPoint],
) -> Vec<Entanglement> {
    let has_rate = problem.rated(&fitted.spec).contains(&0);
    let has_time = problem.levels().iter().any(|level| matches!(level, Level::Drift(_)));
    let sources = [
        (MovedTogether::TemperatureRate, rate_explained(points), has_rate),
        (MovedTogether::Time, time_explained(points), has_time),
    ];
    let entanglement = |(with, explained, is_fitted): (MovedTogether, Option<f64>, bool)| {
        let explained_fraction = explained.filter(|part| *part > TOGETHER)?;
        let spread = (!is_fitted).then(|| added(problem, noise, fitted, with));
        let sigma_dph = spread.as_ref().map(|spread| spread.sigma_dph.iter().copied().fold(0.0, f64::max));
        Some(Entanglement { with, explained_fraction, sigma_dph, spread })
    };
    sources.into_iter().filter_map(entanglement).collect()
}

/// σ that a column adds to the curve at every point of the span: the largest of its lags.
fn added(
    problem: &LeastSquares<'_>,
    (noise, variance): (SlowNoise, f64),
    fitted: &Fitted,
    with: MovedTogether,
) -> CurveSpread {
    let columns: Vec<Vec<f64>> = match with {
        MovedTogether::TemperatureRate => {
            let of_lag = |tau_s: &f64| problem.rate_columns(0, tau_s.max(problem.period_s()));
            LAGS_S.iter().map(|tau_s| of_lag(tau_s).iter().map(|means| means[0]).collect()).collect()
        }
        MovedTogether::Time => {
            vec![(0..problem.len()).map(|row| problem.level(row, Level::Drift(None))).collect()]
        }
    };
    let whitening = Whitening::new(problem.noise_rows(), noise);
    let (curve, levels) = (FittedCurve::of(problem, fitted), problem.levels().len());
    let whole = (0..POINTS).map(|point| curve.at(temperature(problem, point)).0.abs()).fold(0.0, f64::max);
    let mut most = vec![0.0_f64; POINTS];
    for column in &columns {
        let Some(solution) = added_column(problem, fitted, &whitening, column) else { continue };
        let scale = (variance / solution.misfit + solution.coefficient.powi(2)).sqrt();
        for (point, most) in most.iter_mut().enumerate() {
            let weights = curve.weights(temperature(problem, point)).into_iter();
            let explained: f64 = weights.map(|(row, weight)| solution.of_terms[row - levels] * weight).sum();
            *most = most.max((scale * explained.abs()).min(whole));
        }
    }
    CurveSpread { temperature_c: (0..POINTS).map(|point| temperature(problem, point)).collect(), sigma_dph: most }
}
