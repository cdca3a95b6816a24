//! Faults on demand: what a log looks like when something breaks.
//!
//! A [`Fault`] begins at a time and lasts for a time. If several faults of one kind overlap, the latest one applies;
//! two thermometers can fail independently.

use std::str::FromStr;

use serde::Deserialize;

use crate::scenario::error::ScenarioError;
use crate::scenario::section::{REQUIRED, section};

/// What fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A thermometer repeats its last reading.
    StuckThermometer,
    /// The offset of a thermometer grows.
    DriftingThermometer,
    /// Rows are missing.
    DroppedSamples,
    /// The path-length loop has lost its lock; counts carry a swinging error and are flagged.
    LockLoss,
    /// The dither stops; inside the dead band nothing is counted.
    DitherFailure,
    /// The discharge or pump is off: no light, no counts, rows flagged.
    PumpFailure,
    /// The path-length loop resets again and again.
    ModeResetStorm,
    /// The counter saturates at a limit.
    SaturatedCounter,
    /// The gyro's clock slows down relative to that of the log.
    ClockDrift,
}

impl FaultKind {
    /// Every kind with its name in a file.
    pub const ALL: [(Self, &'static str); 9] = [
        (Self::StuckThermometer, "stuck_thermometer"),
        (Self::DriftingThermometer, "drifting_thermometer"),
        (Self::DroppedSamples, "dropped_samples"),
        (Self::LockLoss, "lock_loss"),
        (Self::DitherFailure, "dither_failure"),
        (Self::PumpFailure, "pump_failure"),
        (Self::ModeResetStorm, "mode_reset_storm"),
        (Self::SaturatedCounter, "saturated_counter"),
        (Self::ClockDrift, "clock_drift"),
    ];

    /// Its name in a file.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }

    /// Size where the scenario gives none.
    fn default_size(self) -> f64 {
        match self {
            Self::DriftingThermometer => 10.0,
            Self::DroppedSamples => 0.3,
            Self::ModeResetStorm => 20.0,
            Self::ClockDrift => 5000.0,
            Self::SaturatedCounter => 0.999,
            Self::StuckThermometer | Self::LockLoss | Self::DitherFailure | Self::PumpFailure => 0.0,
        }
    }
}

impl FromStr for FaultKind {
    type Err = ScenarioError;

    fn from_str(name: &str) -> Result<Self, ScenarioError> {
        let known = Self::ALL.iter().find(|(_, known)| *known == name).map(|(kind, _)| *kind);
        known.ok_or_else(|| {
            let names = Self::ALL.map(|(_, name)| name).join(", ");
            ScenarioError::new("fault.kind", format!("is `{name}`: give one of {names}"))
        })
    }
}

impl std::fmt::Display for FaultKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

section! {
    /// A fault, from a start time and for a duration.
    Fault "fault"
    numbers {
        /// Start.
        at_s = REQUIRED, 0.0 ..= 315360000.0, "s", "any";
        /// Duration.
        for_s = REQUIRED, 0.0 ..= 315360000.0, "s", "any";
        /// Size, by kind: drift in °C/h, fraction of dropped rows, seconds between resets, saturation limit as a fraction of the
        /// mean count of a row, clock error in ppm (slow) at the end. 0: default of the kind; other kinds have none.
        size = 0.0, 0.0 ..= 1000000.0, "", "[D]";
        /// Which thermometer, counted from 0; for faults of thermometers.
        sensor = 0.0, 0.0 ..= 31.0, "", "[D]";
    }
    words {
        /// What fails.
        kind: FaultKind = FaultKind::StuckThermometer, "stuck_thermometer, drifting_thermometer, dropped_samples, lock_loss, dither_failure, pump_failure, mode_reset_storm, saturated_counter, clock_drift";
    }
}

impl Fault {
    /// A fault of default size that begins after two fifths of a run and lasts a fifth of it.
    pub fn of_kind(kind: FaultKind, run_length_s: f64) -> Self {
        let (at_s, for_s) = (libm::round(0.4 * run_length_s), libm::round(0.2 * run_length_s));
        Self { kind, at_s, for_s, size: 0.0, sensor: 0.0 }
    }

    /// The size, or the default of the kind.
    pub(crate) fn effective_size(&self) -> f64 {
        if self.size > 0.0 { self.size } else { self.kind.default_size() }
    }

    /// Seconds since it began, while it lasts.
    pub(crate) fn since_s(&self, time_s: f64) -> Option<f64> {
        let since = time_s - self.at_s;
        (since > 0.0 && since <= self.for_s).then_some(since)
    }
}
