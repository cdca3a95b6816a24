//! What the profile of a test adds to a calibration: effects of time next to those of temperature, and what it cannot separate.

use sagnac_log::setup::RateUnit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::input::Lag;
use crate::calibration::uncertainty::CurveSpread;

/// A drift with time, fitted next to the terms so that none of them takes its place. Never part of the correction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct TimeEffect {
    /// What it is.
    pub kind: TimeEffectKind,
    /// Index of its run; null where it is common to all runs.
    pub run: Option<u32>,
    /// Drift in °/h per hour, or the warm-up at the first row of a run in °/h.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Unit of both: `deg/h/h` or `deg/h`.
    pub unit: String,
    /// Time constant of a warm-up, s; null for a drift.
    pub tau_s: Option<f64>,
}

impl TimeEffect {
    /// `drift in time of run 2: 0.0100 ± 0.0004 °/h per hour`.
    pub fn words(&self, units: RateUnit) -> String {
        let of_run = self.run.map_or(String::new(), |run| format!(" of run {run}"));
        let value = format!("{} {}", units.with_sigma(self.value, Some(self.sigma)), units.name());
        match self.tau_s {
            None => format!("drift in time{of_run}: {value} per hour"),
            Some(tau_s) => format!("warm-up{of_run}: {value} at the start, time constant {tau_s:.0} s"),
        }
    }
}

/// A warm-up since power-on that the target corrects, a·e^(−t/τ). Every run of the fit began at power-on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WarmUp {
    /// a, its size at power-on, °/h.
    pub value_dph: f64,
    /// Standard deviation of a, next to that of τ; null where nothing was fitted here.
    pub sigma_dph: Option<f64>,
    /// τ, s.
    pub tau_s: Lag,
}

impl WarmUp {
    /// `0.100 ± 0.004 °/h at power-on, time constant 2510 ± 90 s`.
    pub fn words(&self, units: RateUnit) -> String {
        let size = units.with_sigma(self.value_dph, self.sigma_dph);
        let tau = sagnac_units::format::with_sigma(self.tau_s.value, self.tau_s.sigma);
        format!("{size} {} at power-on, time constant {tau} s", units.name())
    }
}

/// How an effect goes with time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum TimeEffectKind {
    /// In proportion to the time since the middle of the run.
    Drift,
    /// a·e^(−t/τ) from the first row of each run.
    WarmUp,
}

/// What moved together with temperature in the runs of a fit, so that its effect cannot be separated from the curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Entanglement {
    /// What moved.
    pub with: MovedTogether,
    /// Part of its variation that temperature explains, 0.8 to 1.
    pub explained_fraction: f64,
    /// The largest σ that it adds to the curve over the span, °/h; null where the fit has a term for it, whose σ carries it.
    pub sigma_dph: Option<f64>,
    /// That σ over the temperatures. It is common to tests of one profile, so a comparison of such tests does not have it.
    pub spread: Option<CurveSpread>,
}

/// What can move together with temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum MovedTogether {
    /// The rate of the temperature.
    TemperatureRate,
    /// The time since the start of a run.
    Time,
}

impl MovedTogether {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::TemperatureRate => "temperature rate",
            Self::Time => "time",
        }
    }
}

impl Entanglement {
    /// What it means for the use of a calibration.
    pub fn note(&self, units: RateUnit) -> String {
        let profile = match self.with {
            MovedTogether::TemperatureRate => "of the same rates at the same temperatures",
            MovedTogether::Time => "of the same length",
        };
        let part = 100.0 * self.explained_fraction;
        let sigma = self
            .sigma_dph
            .map_or(String::new(), |sigma| format!("; this adds up to {} (σ) to the curve", units.text(sigma, 2)));
        format!(
            "temperature and {} moved together in these runs ({part:.0} %): the correction holds for profiles {profile}{sigma}",
            self.with.words()
        )
    }
}
