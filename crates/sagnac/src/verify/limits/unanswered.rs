//! What a log could not show if it were a retest: every limit, asked of the log next to itself.
//!
//! The values are those of a verification whose corrected side is the raw side. Their sizes say nothing of a correction and are dropped;
//! whether a value can be had, and why not, is the same for every correction.

use sagnac_core::Status;

use crate::verify::limits::table::{Applies, EXCLUDED, LimitSpec, POSITION_ERROR, SPECS};
use crate::verify::limits::verdict::DecisionRule;
use crate::verify::replay::clocks::Clocks;
use crate::verify::replay::paired::PairedWindows;
use crate::verify::values::of_axis::{Against, Retest};
use crate::verify::{AxisVerification, Correction};
use crate::window::Windows;
use sagnac_log::error::Result;
use sagnac_log::setup::Setup;
use serde::Serialize;

/// Limits that a log has no value for, with the reason that they share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Unanswered {
    /// What is missing.
    pub why: String,
    /// Keys of the limits.
    pub limits: Vec<&'static str>,
}

/// Per axis, the limits of which windows of a log have no value against this correction.
///
/// # Errors
/// Too few windows for any value.
pub fn unanswered(windows: &Windows, correction: &Correction, setup: &Setup) -> Result<Vec<(char, Vec<Unanswered>)>> {
    let mut pair = PairedWindows {
        raw: windows.clone(),
        corrected: windows.clone(),
        status: vec![vec![Status::OK; windows.len()]; windows.shape.axes.len()],
        flagged_off: Vec::new(),
        clocks: Clocks::default(),
    };
    pair.leave_out_unknown(setup)?;
    let name = correction.calibration.as_ref().and_then(|calibration| calibration.thermometer_name());
    let sensor = name.and_then(|name| windows.shape.thermometers.iter().position(|other| other == name));
    let (axes, _) = Against { correction, setup, sensor }.values(&Retest::all(&pair))?;
    Ok(axes.iter().map(|axis| (axis.axis, of_axis(axis))).collect())
}

fn of_axis(axis: &AxisVerification) -> Vec<Unanswered> {
    let mut all: Vec<Unanswered> = Vec::new();
    // What was excluded on request, a flight that is stated and the rates of a fit are of the verification, not of the log.
    let of_log =
        |spec: &&LimitSpec| ![EXCLUDED, POSITION_ERROR].contains(&spec.key) && spec.applies != Applies::WithRate;
    for spec in SPECS.iter().filter(of_log) {
        let verdict = spec.judge(1.0, axis, DecisionRule::default());
        let Some(why) = verdict.why.filter(|_| verdict.value.is_none()) else { continue };
        match all.iter_mut().find(|known| known.why == why) {
            Some(known) => known.limits.push(spec.key),
            None => all.push(Unanswered { why, limits: vec![spec.key] }),
        }
    }
    all
}
