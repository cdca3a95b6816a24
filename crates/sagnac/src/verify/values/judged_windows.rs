//! The judged windows of an axis in their order: which follow each other, how they scatter and correlate, a series over their temperature.
//!
//! ```text
//! spread   √(Σ(r − m)²/n)                   r a window's residual after correction
//! lag one  Σ rᵢ·rᵢ₊₁/(n·σ²) ± 1/√n          over neighbours without a break
//! series   T₀ … T_k of the temperature, k at most 16, five windows for each order
//! ```

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::diagnostics::WindowPoint;
use crate::model::Span;

/// Fewer windows show nothing.
pub(crate) const FEWEST: usize = 20;
/// Part of a window between two neighbours that is a gap.
const GAP: f64 = 0.005;
/// Order of the smooth residual: half-waves of a tenth of the span. Less where windows are few: five for each order.
const SMOOTH_ORDER: usize = 16;
const WINDOWS_PER_ORDER: usize = 5;

/// A value with its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub sigma: f64,
}

/// The windows that values are of.
pub(crate) fn judged(points: &[WindowPoint]) -> Vec<&WindowPoint> {
    points.iter().filter(|p| p.excluded.is_none() && p.after_dph.is_finite()).collect()
}

pub(crate) fn mean(points: &[&WindowPoint]) -> f64 {
    points.iter().map(|p| p.after_dph).sum::<f64>() / points.len() as f64
}

pub(crate) fn spread(points: &[&WindowPoint]) -> f64 {
    let mean = mean(points);
    (points.iter().map(|p| (p.after_dph - mean).powi(2)).sum::<f64>() / points.len() as f64).sqrt()
}

/// Two windows follow each other without a break.
pub(crate) fn joined(a: &WindowPoint, b: &WindowPoint) -> bool {
    let between = (b.hours - 0.5 * b.length_h) - (a.hours + 0.5 * a.length_h);
    a.run == b.run && between < GAP * a.length_h.min(b.length_h)
}

pub(crate) fn lag1_autocorrelation(used: &[&WindowPoint], sigma: f64) -> Option<Estimate> {
    let pairs: Vec<f64> =
        used.windows(2).filter(|w| joined(w[0], w[1])).map(|w| w[0].after_dph * w[1].after_dph).collect();
    let n = pairs.len() as f64;
    let value = pairs.iter().sum::<f64>() / n / (sigma * sigma);
    (pairs.len() >= FEWEST && sigma > 0.0).then(|| Estimate { value, sigma: 1.0 / n.sqrt() })
}

/// Order of the series over temperature for so many windows.
pub(crate) fn smooth_order(windows: usize) -> usize {
    (windows / WINDOWS_PER_ORDER).min(SMOOTH_ORDER)
}

/// T₀ … of an order over a span.
pub(crate) fn smooth_columns(rows: usize, order: usize, span: Span, celsius: impl Fn(usize) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(rows, order + 1, |i, k| (k as f64 * span.x(celsius(i)).clamp(-1.0, 1.0).acos()).cos())
}
