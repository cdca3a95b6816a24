//! The fit so far, and what it is worth.
//!
//! The windows are those that `calibrate` would make of the log, added to as rows come; the fit is the one of `calibrate`. Only a search for a model
//! takes long, so it is made again when the record has grown by a tenth, and in between the model found last is fitted.

use std::time::{Duration, Instant};

use sagnac::allan::NoiseBudget;
use sagnac::calibration::{AxisCalibration, Calibration};
use sagnac::fit::{FitOptions, Model, calibrate_with_report_data};
use sagnac::plan::{Enough, EnoughRequest, enough};
use sagnac::window::Windows;
use sagnac_log::setup::Setup;
use serde::Serialize;

/// A search is made when the record has grown by this part.
const GROWN: f64 = 0.1;
/// A test is complete after this length of the record without a break, s.
const HELD_S: f64 = 1800.0;
/// Temperatures of a curve.
const CURVE: usize = 49;
/// Residuals that are shown.
const MOST_POINTS: usize = 2000;

/// A window as it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ResidualAt {
    /// Middle of the window, h since the first row.
    pub hours: f64,
    /// Mean temperature, °C.
    pub temperature_c: f64,
    /// Drift about the run's offset, °/h.
    pub before_dph: f64,
    /// The same less the fit, °/h.
    pub after_dph: f64,
}

/// The curve of an axis at a temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurveAt {
    /// °C.
    pub temperature_c: f64,
    /// Drift at rest, °/h.
    pub drift_dph: f64,
    /// Half of its 95 % interval, °/h.
    pub half_dph: f64,
}

/// One axis of the fit so far.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyAxis {
    /// Its letter.
    pub axis: char,
    /// The model.
    pub model: String,
    /// σ of the residual, °/h.
    pub residual_dph: f64,
    /// The noise floor, °/h.
    pub floor_dph: Option<f64>,
    /// Temperatures of the fit, °C.
    pub span_c: [f64; 2],
    /// The curve with its uncertainty.
    pub curve: Vec<CurveAt>,
    /// Windows.
    pub residuals: Vec<ResidualAt>,
}

/// A deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DeviationAt {
    /// τ, s.
    pub tau_s: f64,
    /// Overlapping Allan deviation, °/h.
    pub adev_dph: f64,
}

/// What is known of a test so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Study {
    /// Length of the record, s.
    pub recorded_s: f64,
    /// Time of the newest row when the fit began, s since the first row.
    pub at_s: f64,
    /// Why there is no fit, if there is none.
    pub refused: Option<String>,
    /// The fit, axis by axis.
    pub axes: Vec<StudyAxis>,
    /// Whether the test is complete; `None` without limits.
    pub enough: Option<Enough>,
    /// Letter and Allan deviations of each axis, drift over temperature included.
    pub allan: Vec<(char, Vec<DeviationAt>)>,
    /// It is complete for half an hour of the record without a break, and a search for the model confirms it.
    pub confirmed: bool,
}

/// Makes studies of a growing record.
pub(crate) struct Studies {
    setup: Setup,
    model: Model,
    request: Option<EnoughRequest>,
    /// The model found last, where it is that of all axes, and the record's length then.
    found: Option<(Option<Model>, f64)>,
    /// Length of the record since which it is complete without a break, s.
    met_since_s: Option<f64>,
}

impl Studies {
    pub(crate) fn new(setup: Setup, model: Model, request: Option<EnoughRequest>) -> Self {
        Self { setup, model, request, found: None, met_since_s: None }
    }

    /// Of the windows so far; how long it took. The last one is what `calibrate` finds in the log.
    pub(crate) fn next(&mut self, windows: Windows, noise: Option<&NoiseBudget>, is_last: bool) -> (Study, Duration) {
        let begun = Instant::now();
        let recorded_s: f64 = windows.runs.iter().map(sagnac::window::Run::length_s).sum();
        let is_grown = self.found.as_ref().is_none_or(|(_, at_s)| recorded_s > (1.0 + GROWN) * at_s);
        let searches = is_last || is_grown;
        // What a model found before says may not be what a search would say now: only a search confirms.
        let may_confirm = self.met_since_s.is_some_and(|since_s| recorded_s - since_s >= HELD_S);
        let mut study = self.fitted(windows, recorded_s, searches || may_confirm);
        study.confirmed = may_confirm && self.met_since_s.is_some();
        study.allan = noise.map(deviations).unwrap_or_default();
        (study, begun.elapsed())
    }

    /// A fit, by a search for the model or with the one found last.
    fn fitted(&mut self, windows: Windows, recorded_s: f64, searches: bool) -> Study {
        let mut study = Study { recorded_s, ..Study::default() };
        let known = self.found.as_ref().filter(|_| !searches).and_then(|(model, _)| model.clone());
        let model = known.unwrap_or_else(|| self.model.clone());
        match calibrate_with_report_data(windows, &self.setup, &FitOptions::new(model)) {
            Ok((calibration, drawn)) => {
                if searches {
                    self.found = Some((found_model(&calibration), recorded_s));
                }
                let points = |axis: &AxisCalibration| {
                    let own = drawn.axes.iter().find(|of| of.axis == axis.axis);
                    residuals(own.map_or(&[][..], |of| &of.points))
                };
                study.axes = calibration.axes.iter().map(|axis| study_axis(axis, points(axis))).collect();
                study.enough = self.request.as_ref().map(|request| enough(&calibration, &drawn, request));
            }
            Err(refusal) => study.refused = Some(refusal.what),
        }
        let met = study.enough.as_ref().is_some_and(|enough| enough.met);
        self.met_since_s = self.met_since_s.or(Some(recorded_s)).filter(|_| met);
        study
    }
}

/// The model of a calibration, where all axes have the same.
fn found_model(calibration: &Calibration) -> Option<Model> {
    let mut models = calibration.axes.iter().map(|axis| &axis.correction.model);
    let first = models.next()?;
    if models.any(|model| model != first) {
        return None;
    }
    first.parse().ok()
}

fn study_axis(axis: &AxisCalibration, residuals: Vec<ResidualAt>) -> StudyAxis {
    let [lo, hi] = axis.span_c();
    let at = |i: usize| lo + (hi - lo) * i as f64 / (CURVE - 1) as f64;
    let curve = (0..CURVE).filter_map(|i| {
        let predicted = axis.predict(at(i))?;
        Some(CurveAt { temperature_c: at(i), drift_dph: predicted.drift_dph, half_dph: predicted.curve_dph })
    });
    StudyAxis {
        axis: axis.axis,
        model: axis.correction.model.clone(),
        residual_dph: axis.residual().map_or(f64::NAN, |residual| residual.sigma_dph),
        floor_dph: axis.noise_floor().map(|floor| floor.value_dph),
        span_c: axis.span_c(),
        curve: curve.collect(),
        residuals,
    }
}

fn residuals(points: &[sagnac::diagnostics::WindowPoint]) -> Vec<ResidualAt> {
    let known =
        |point: &&sagnac::diagnostics::WindowPoint| point.after_dph.is_finite() && point.temperature_c.is_finite();
    let all = points.iter().filter(known).map(|point| ResidualAt {
        hours: point.hours,
        temperature_c: point.temperature_c,
        before_dph: point.before_dph,
        after_dph: point.after_dph,
    });
    let all: Vec<ResidualAt> = all.collect();
    let every = all.len().div_ceil(MOST_POINTS).max(1);
    all.into_iter().step_by(every).collect()
}

fn deviations(noise: &NoiseBudget) -> Vec<(char, Vec<DeviationAt>)> {
    let deviation_at = |point: &sagnac_noise::CurvePoint| DeviationAt { tau_s: point.tau_s, adev_dph: point.adev_dph };
    noise.axes.iter().map(|axis| (axis.axis, axis.curve.iter().map(deviation_at).collect())).collect()
}
