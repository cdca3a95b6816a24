//! Faults on demand: what a log looks like when something breaks.

use serde::Deserialize;

use crate::scenario::section::{REQUIRED, section};

/// What breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A thermometer keeps its reading.
    StuckThermometer,
    /// A thermometer's offset grows.
    DriftingThermometer,
    /// Rows are missing.
    DroppedSamples,
    /// The path-length loop has let go; counts carry a swinging error and are flagged.
    LockLoss,
    /// The dither stands still; inside the dead band nothing is counted.
    DitherFailure,
    /// The discharge or pump is off; no light, no counts, flagged.
    PumpFailure,
    /// The path-length loop resets again and again.
    ModeResetStorm,
    /// The counter stops at a limit.
    SaturatedCounter,
    /// The gyro's clock slows down against that of the log.
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

    /// The kind of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, known)| *known == name).map(|(kind, _)| *kind)
    }

    /// Its name in a file.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }

    /// How strong it is where nothing else is said.
    fn usual_size(self) -> f64 {
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

section! {
    /// A fault, from a time for a time.
    Fault "fault"
    numbers {
        /// When it begins.
        at_s = REQUIRED, 0.0 ..= 315360000.0, "s", "any";
        /// How long it lasts.
        for_s = REQUIRED, 0.0 ..= 315360000.0, "s", "any";
        /// How strong: drift in °C/h, part of dropped rows, seconds between resets, part of the mean count of a row that the counter stops at, ppm that the clock is slow by at the end. 0: as usual for the kind; other kinds have none.
        size = 0.0, 0.0 ..= 1000000.0, "", "[D]";
        /// Which thermometer, from 0, for faults of thermometers.
        sensor = 0.0, 0.0 ..= 31.0, "", "[D]";
    }
    words {
        /// What breaks.
        kind: FaultKind = FaultKind::StuckThermometer, "stuck_thermometer, drifting_thermometer, dropped_samples, lock_loss, dither_failure, pump_failure, mode_reset_storm, saturated_counter, clock_drift";
    }
}

impl Fault {
    /// A fault of a kind that begins after two fifths of a run and lasts a fifth of it.
    pub fn usual(kind: FaultKind, length_s: f64) -> Self {
        Self { kind, at_s: libm::round(0.4 * length_s), for_s: libm::round(0.2 * length_s), size: 0.0, sensor: 0.0 }
    }

    /// How strong it is.
    pub(crate) fn strength(&self) -> f64 {
        if self.size > 0.0 { self.size } else { self.kind.usual_size() }
    }

    /// Seconds since it began, while it lasts.
    pub(crate) fn since_s(&self, time_s: f64) -> Option<f64> {
        let since = time_s - self.at_s;
        (since > 0.0 && since <= self.for_s).then_some(since)
    }
}
