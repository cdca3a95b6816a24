//! The picture of the page: drift over time in both cycles, as counted and as the target corrected it.

use anyhow::{Context, Result};
use sagnac_report::{Chart, ChartPage, Curve, chart_report};

use super::record::Record;
use super::units::WINDOW;

/// Width in which the uploads are drawn: how long they take is of no matter.
const UPLOADS_H: f64 = 0.1;

/// Rate less its mean, °/h, of windows.
pub(super) struct Drift {
    hours: Vec<f64>,
    dph: Vec<f64>,
}

impl Drift {
    /// Of counts of a second each.
    pub(super) fn of(counts: &[f64], arcsec_per_count: f64) -> Self {
        let whole = counts.chunks_exact(WINDOW);
        // An arcsecond in a second is a degree in an hour.
        let rates: Vec<f64> = whole.map(|w| w.iter().sum::<f64>() * arcsec_per_count / WINDOW as f64).collect();
        let mean = rates.iter().sum::<f64>() / rates.len().max(1) as f64;
        let hours = (0..rates.len()).map(|at| (at as f64 + 0.5) * WINDOW as f64 / 3600.0).collect();
        Self { hours, dph: rates.iter().map(|rate| rate - mean).collect() }
    }

    /// Standard deviation, °/h.
    pub(super) fn sigma_dph(&self) -> f64 {
        (self.dph.iter().map(|dph| dph * dph).sum::<f64>() / self.dph.len().max(1) as f64).sqrt()
    }

    fn curve(self, label: &str, after_h: f64) -> Curve {
        let x = self.hours.iter().map(|hours| hours + after_h).collect();
        Curve { label: label.to_owned(), x, y: self.dph, dashed: false }
    }
}

/// The picture, of both cycles.
pub(super) fn picture(first: &Record, second: &Record, arcsec_per_count: f64) -> Result<String> {
    let drift = |counts: &[f64]| Drift::of(counts, arcsec_per_count);
    let end_h = first.counts.len() as f64 / 3600.0;
    let begin_h = end_h + UPLOADS_H;
    let chart = Chart {
        id: "closed-loop".to_owned(),
        title: "Drift before and after the upload".to_owned(),
        x_label: "hours of the chamber".to_owned(),
        y_label: "rate less its mean, °/h".to_owned(),
        curves: vec![
            drift(&second.target).curve("cycle 2, corrected by the target", begin_h),
            drift(&first.counts).curve("cycle 1, as counted", 0.0),
            drift(&second.counts).curve("cycle 2, as counted", begin_h),
        ],
        shades: vec![("uploads (not to scale)".to_owned(), vec![[end_h, begin_h]])],
        ..Chart::default()
    };
    let report = chart_report(&ChartPage { charts: vec![chart], ..ChartPage::default() })?;
    let (_, svg) = report.figures().next().context("the picture could not be drawn")?;
    Ok(svg)
}
