//! A verification judged by limits: all runs together, each run alone, and what was excluded on request next to it.
//!
//! ```text
//! values of all runs ─▶ verdicts ◀─ the worse of each run alone (limits of the form *at most*)
//! ```
//!
//! Refused where no limit can be asked of an axis, and in windows of another length than the calibration's.

use sagnac_log::error::{Error, Result};
use sagnac_units::format::{file_name, significant};

use crate::diagnostics::{ReportData, WindowPoint};
use crate::verify::reservations::of_limits;
use crate::verify::values::repeatability::RUN_WITHOUT_BIAS;
use crate::verify::{AxisVerification, BiasRepeatability, Limits, Verdict, Verification};

/// A verification and the windows behind it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Proof {
    /// The result.
    pub verification: Verification,
    /// The windows behind it, for a report.
    pub report_data: ReportData,
    /// Values of every window, where some were excluded on request.
    pub(crate) every_row: Option<(Vec<AxisVerification>, ReportData)>,
    /// Each run alone, where there are several: a good run does not make up for a bad one.
    pub(crate) each_run: Vec<(String, Vec<AxisVerification>)>,
    /// Windows of the calibration, s.
    pub(crate) record_window_s: Option<f64>,
}

/// Windows of a retest whose length is within this part of the calibration's are alike.
const ALIKE: f64 = 0.1;

impl Proof {
    /// Judges every axis by limits, and flies the flight that they state.
    ///
    /// # Errors
    /// [`sagnac_log::ErrorKind::Refused`] where none of the limits applies to such a retest.
    pub fn limits(self, limits: &Limits) -> Result<Self> {
        self.check_window()?;
        let all = judged(self.verification.axes, &self.report_data, limits)?;
        let every_row = match self.every_row {
            Some((axes, drawn)) => Some((judged(axes, &drawn, limits)?, drawn)),
            None => None,
        };
        let at_worst = |(at, axis): (usize, AxisVerification)| {
            let runs = self.each_run.iter().map(|(name, axes)| (name.as_str(), limits.judge_run(&axes[at])));
            let whole = every_row.as_ref().map(|(axes, _)| &axes[at]);
            axis.with_runs(runs).with_every_row(whole)
        };
        let axes = all.into_iter().enumerate().map(at_worst).collect();
        let overrides = [self.verification.overrides, of_limits(limits)].concat();
        let verification = Verification { axes, overrides, limits: Some(limits.source.clone()), ..self.verification };
        Ok(Self { verification, every_row, ..self })
    }

    /// False when a limit is not met, or where limits were applied to a log that the fit has seen.
    pub fn passed(&self) -> bool {
        self.verification.passed()
    }

    /// What is periodic averages out in a window of its period: the length is not to be chosen by the retest.
    fn check_window(&self) -> Result<()> {
        let window_s = self.verification.window_s;
        let Some(record_s) = self.record_window_s.filter(|record_s| (window_s / record_s - 1.0).abs() > ALIKE) else {
            return Ok(());
        };
        let [window_s, record_s] = [window_s, record_s].map(|seconds| significant(seconds, 4));
        let what = format!(
            "the retest has windows of {window_s} s, the calibration has {record_s} s: limits need the same windows"
        );
        Err(Error::refused(what, "remove --window, or calibrate with the same one").column("window"))
    }
}

/// Axes judged by limits, each with its own points.
fn judged(axes: Vec<AxisVerification>, drawn: &ReportData, limits: &Limits) -> Result<Vec<AxisVerification>> {
    axes.into_iter().zip(&drawn.axes).map(|(axis, drawn)| axis.judged(limits, &drawn.points)).collect()
}

impl AxisVerification {
    /// Verdicts of a run alone in the place of those of all runs together, where they are worse.
    fn with_runs<'a>(self, runs: impl Iterator<Item = (&'a str, Vec<Verdict>)>) -> Self {
        let mut limits = self.limits;
        for (run, verdict) in runs.flat_map(|(run, verdicts)| verdicts.into_iter().map(move |verdict| (run, verdict))) {
            let is_worse = |all: &&mut Verdict| all.name == verdict.name && verdict.is_worse_than(all);
            if let Some(all) = limits.iter_mut().find(is_worse) {
                *all = Verdict { run: Some(file_name(run)), ..verdict };
            }
        }
        let pass = self.pass.map(|_| all_met(&limits));
        Self { limits, pass, ..self }
    }

    /// Next to each value that of every row, where some were excluded on request.
    fn with_every_row(self, whole: Option<&Self>) -> Self {
        let Some(whole) = whole else { return self };
        let value_of = |name: &str| whole.limits.iter().find(|other| other.name == name)?.value;
        let beside = |verdict: Verdict| Verdict { value_of_every_row: value_of(&verdict.name), ..verdict };
        Self { limits: self.limits.into_iter().map(beside).collect(), ..self }
    }

    /// The bias against the calibration, where that of every run is known; else why not.
    pub(crate) fn bias_of_every_run(&self) -> std::result::Result<&BiasRepeatability, &str> {
        match &self.bias_repeatability {
            Some(bias) if bias.unknown.is_none() => Ok(bias),
            Some(_) => Err(RUN_WITHOUT_BIAS),
            None => Err(self.bias_repeatability_unavailable.as_deref().unwrap_or_default()),
        }
    }

    fn judged(self, limits: &Limits, points: &[WindowPoint]) -> Result<Self> {
        let n = self.residual.random_walk.map(|walk| walk.after_deg_rt_h);
        let flown = limits.flight.as_ref().map(|flight| flight.fly(points, n, self.bias_of_every_run()));
        let (flight, flight_unavailable) = match flown {
            Some(Ok(flight)) => (Some(flight), None),
            Some(Err(why)) => (None, Some(why)),
            None => (None, None),
        };
        let axis = Self { flight, flight_unavailable, ..self };
        let verdicts = limits.judge(&axis);
        if limits.asks() && verdicts.iter().all(|verdict| verdict.pass.is_none()) {
            let mut reasons: Vec<&str> = verdicts.iter().filter_map(|verdict| verdict.why.as_deref()).collect();
            reasons.sort_unstable();
            reasons.dedup();
            let what = format!(
                "axis {} of this retest can be checked against none of the limits: {}",
                axis.axis,
                reasons.join("; ")
            );
            return Err(Error::refused(
                what,
                "choose limits for this test: docs/reference/limits.md lists the test of each",
            ));
        }
        let pass = limits.asks().then(|| all_met(&verdicts));
        Ok(Self { limits: verdicts, pass, ..axis })
    }
}

/// No verdict that was asked is other than met.
fn all_met(verdicts: &[Verdict]) -> bool {
    verdicts.iter().all(|verdict| verdict.pass != Some(false))
}
