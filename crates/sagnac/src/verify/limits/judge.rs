//! A verification held against limits: all runs together, each run alone, and what was excluded on request beside.
//!
//! ```text
//! figures of all runs ─▶ verdicts ◀─ the worse of each run alone (limits of the form *at most*)
//! ```
//!
//! Refused where no limit can be asked of an axis, and in windows of another length than the calibration's.

use sagnac_log::error::{Error, Result};
use sagnac_units::format::{file_name, significant};

use crate::diagnostics::{Point, ReportData};
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
    /// Figures of every window, where some were excluded on request.
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
    pub fn limits(mut self, limits: &Limits) -> Result<Self> {
        self.check_window()?;
        for (axis, drawn) in self.verification.axes.iter_mut().zip(&self.report_data.axes) {
            axis.judge(limits, &drawn.points)?;
        }
        for (name, axes) in &self.each_run {
            for (run, axis) in axes.iter().zip(&mut self.verification.axes) {
                axis.take_worse(name, limits.judge_run(run));
            }
        }
        if let Some((axes, report_data)) = &mut self.every_row {
            for ((whole, drawn), axis) in axes.iter_mut().zip(&report_data.axes).zip(&mut self.verification.axes) {
                whole.judge(limits, &drawn.points)?;
                for verdict in &mut axis.limits {
                    let same = whole.limits.iter().find(|other| other.name == verdict.name);
                    verdict.value_of_every_row = same.and_then(|other| other.value);
                }
            }
        }
        self.verification.limits = Some(limits.source.clone());
        Ok(self)
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
            "the retest is in windows of {window_s} s, the calibration in windows of {record_s} s: limits are not held against another window"
        );
        Err(Error::refused(what).column("window").help("leave --window out, or calibrate with the same one"))
    }
}

impl AxisVerification {
    /// Verdicts of a run alone, where they are worse than those of all together.
    fn take_worse(&mut self, run: &str, of_run: Vec<Verdict>) {
        for verdict in of_run {
            let is_worse = |all: &&mut Verdict| all.name == verdict.name && verdict.is_worse_than(all);
            if let Some(all) = self.limits.iter_mut().find(is_worse) {
                *all = Verdict { run: Some(file_name(run)), ..verdict };
            }
        }
        if self.pass.is_some() {
            self.pass = Some(self.limits.iter().all(|verdict| verdict.pass != Some(false)));
        }
    }

    /// The bias against the calibration, where that of every run is known; else why not.
    pub(crate) fn bias_of_every_run(&self) -> std::result::Result<&BiasRepeatability, &str> {
        match &self.bias_repeatability {
            Some(found) if found.unknown.is_none() => Ok(found),
            Some(_) => Err(RUN_WITHOUT_BIAS),
            None => Err(self.bias_repeatability_unavailable.as_deref().unwrap_or_default()),
        }
    }

    fn judge(&mut self, limits: &Limits, points: &[Point]) -> Result<()> {
        if let Some(flight) = &limits.flight {
            let n = self.residual.random_walk.map(|walk| walk.after_deg_rt_h);
            match flight.fly(points, n, self.bias_of_every_run()) {
                Ok(flown) => self.flight = Some(flown),
                Err(why) => self.flight_unavailable = Some(why),
            }
        }
        self.limits = limits.judge(self);
        if limits.asks() && self.limits.iter().all(|verdict| verdict.pass.is_none()) {
            let mut reasons: Vec<&str> = self.limits.iter().filter_map(|verdict| verdict.why.as_deref()).collect();
            reasons.sort_unstable();
            reasons.dedup();
            let what =
                format!("none of the limits can be asked of axis {} of this retest: {}", self.axis, reasons.join("; "));
            return Err(Error::refused(what).help("docs/reference/limits.md says which limits ask for which test"));
        }
        self.pass = limits.asks().then(|| self.limits.iter().all(|verdict| verdict.pass != Some(false)));
        Ok(())
    }
}
