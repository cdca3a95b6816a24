//! Gain of a longer soak: forecast of the uncertainty of the curve after additional hours.
//!
//! ```text
//! Cov' = (Cov⁻¹ + m·g·gᵀ/s²)⁻¹ = Cov − Cov·g·gᵀ·Cov·m/(s² + m·gᵀ·Cov·g)      (Sherman and Morrison 1950)
//! ```
//!
//! with g the regressors of a window at rest at the soak's temperature in the last run, m = hours·3600/τ_w windows and s²
//! the variance of a window, widened by the residuals' correlation as in the fit. Under slow noise the added windows carry that noise
//! on from the end of the last run ([`Extension`]). The forecast assumes that the model is right: a longer soak does not replace
//! a missing term.

use nalgebra::{DMatrix, DVector};

use crate::calibration::{AxisCalibration, Soak, SoakRow};
use crate::fit::solution::Extension;

/// Hours that are forecast.
const HOURS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Temperatures over the span, ends included.
const TEMPERATURES: usize = 12;

/// The forecast of one axis; `None` where nothing was fitted or there is no bias term.
pub(crate) fn soak(axis: &AxisCalibration, extension: Option<&Extension>, window_s: f64) -> Option<Soak> {
    let fit = axis.fit.as_ref()?;
    let residual = fit.residual;
    let size = fit.covariance.len();
    let covariance = DMatrix::from_fn(size, size, |i, j| fit.covariance[i].get(j).copied().unwrap_or(0.0));
    let offset = fit.covariance_of.iter().rposition(|name| name.starts_with("offset"))?;
    let reference_c = axis.reference_c();
    let span = axis.span();
    let curve = |celsius: f64| {
        let mut g = DVector::zeros(size);
        axis.drift_weights(celsius, reference_c).iter().for_each(|(row, weight)| g[*row] = *weight);
        g
    };
    if axis.drift_weights(span.hi, span.lo).is_empty() {
        return None;
    }
    let widening = (1.0 + residual.lag1_autocorrelation) / (1.0 - residual.lag1_autocorrelation);
    let window_variance = residual.sigma_dph.powi(2) * widening;
    let sigma_after = |of: &DVector<f64>, soaked_c: f64, hours: f64| {
        let mut g = curve(soaked_c);
        g[offset] = 1.0;
        let windows = hours * 3600.0 / window_s;
        if let Some(extension) = extension {
            return extension.variance_after(of, &g, windows).max(0.0).sqrt();
        }
        let moved = &covariance * &g;
        let known = (of.transpose() * &covariance * of)[(0, 0)];
        let gained = of.dot(&moved).powi(2) * windows / (window_variance + windows * g.dot(&moved));
        (known - gained).max(0.0).sqrt()
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
