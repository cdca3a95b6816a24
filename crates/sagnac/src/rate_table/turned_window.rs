//! A window of a rate-table test, and what is known of its noise.

use crate::noise_model::processes::SlowNoise;

/// A window with what the plateaus need of it.
#[derive(Clone, Copy)]
pub(crate) struct TurnedWindow {
    pub(crate) run: usize,
    /// Since the start of its run, s.
    pub(crate) middle_s: f64,
    pub(crate) temperature_c: f64,
    /// Rate of the table along the axis, °/h.
    pub(crate) along_dph: f64,
    /// Rate as measured, °/h.
    pub(crate) measured_dph: f64,
    pub(crate) weight: f64,
}

impl TurnedWindow {
    /// What was measured beyond the table, °/h: few digits of a large rate are lost.
    pub(crate) fn beyond_dph(&self) -> f64 {
        self.measured_dph - self.along_dph
    }
}

/// What is known of the windows' noise next to their own scatter.
#[derive(Clone, Copy)]
pub(crate) struct KnownNoise {
    /// As a setup states it, with a white variance, (°/h)².
    pub(crate) stated: Option<(SlowNoise, f64)>,
    /// Nominal length of a window, s; `None` for rows without time.
    pub(crate) nominal_s: Option<f64>,
}
