//! The record of a unit: its axes, the quantity of its log, the timing of its target.

use sagnac_log::error::{Error, Result};
use sagnac_log::setup::{Setup, WindowSize};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::axis::AxisCalibration;
use crate::calibration::input::InputSource;
use crate::calibration::provenance::Provenance;

/// Value of `Calibration::format`.
pub const FORMAT: &str = "sagnac-calibration";
/// Value of `Calibration::version`: a change of meaning or a field less raises it.
pub const VERSION: u32 = 2;
/// Value of `Calibration::minor_version`: a field or a shape more raises it.
pub const MINOR_VERSION: u32 = 5;
/// Serial of a calibration whose gyro was not named.
pub const UNASSIGNED: &str = "unassigned";

/// A calibration of one unit, one entry per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Calibration {
    /// Always `sagnac-calibration`.
    pub format: String,
    /// Version of this schema. A reader refuses another one.
    pub version: u32,
    /// Minor version. A reader ignores the fields that a newer one adds.
    pub minor_version: u32,
    /// Serial number of the gyro, or `unassigned`.
    pub serial: String,
    /// Quantity of the log.
    pub unit: LogUnit,
    /// Timing of the target that the calibration was made for.
    pub target: Target,
    /// Analysis window.
    pub window: WindowSize,
    /// Length to which sums per window are scaled, s.
    pub window_s: f64,
    /// Interval of a row of the log, s.
    pub sample_interval_s: f64,
    /// One entry per axis.
    pub axes: Vec<AxisCalibration>,
    /// How the log was read; `verify` and `compensate` read theirs the same way.
    pub setup: Setup,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// Quantity and scale of a log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "quantity", rename_all = "snake_case")]
pub enum LogUnit {
    /// Counts.
    Counts {
        /// Nominal scale factor S0.
        arcsec_per_count: f64,
        /// Smallest step of the counts, counts; one output count of the image.
        quantum: f64,
    },
    /// Rates, replayed with a virtual LSB.
    Rates {
        /// One output count of the image, arcsec.
        lsb_arcsec: f64,
    },
}

impl LogUnit {
    /// arcsec per output count of the image.
    pub fn arcsec_per_lsb(&self) -> f64 {
        match self {
            Self::Counts { arcsec_per_count, quantum } => arcsec_per_count * quantum,
            Self::Rates { lsb_arcsec } => *lsb_arcsec,
        }
    }
}

/// Timing of the target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Target {
    /// Tick, ns.
    pub tick_ns: u32,
    /// Ticks per temperature period Δt.
    pub period_ticks: u32,
    /// Ticks over which a new correction is approached.
    pub slew_ticks: u32,
}

/// Default slew, ticks.
const DEFAULT_SLEW_TICKS: u32 = 100;
/// The target counts a temperature period up to here.
const MAX_PERIOD_TICKS: u32 = 1 << 24;

impl Target {
    /// As set up, checked against what the target can count.
    pub(crate) fn of(setup: &Setup) -> Result<Self> {
        let (clock, slew_ticks) = (setup.clock(), setup.slew_ticks);
        let (tick_ns, ticks) = (clock.tick_ns(), clock.period_ns()? / clock.tick_ns());
        let out_of_range = || {
            Error::input(
                format!("the temperature period has {ticks} ticks, and the target counts to {MAX_PERIOD_TICKS}"),
                "give a shorter temperature_period_s or a longer tick_s in the setup",
            )
            .column("temperature_period_s")
        };
        let period_ticks = u32::try_from(ticks).ok().filter(|t| (1..=MAX_PERIOD_TICKS).contains(t));
        let period_ticks = period_ticks.ok_or_else(out_of_range)?;
        let tick_ns =
            u32::try_from(tick_ns).map_err(|_| Error::input("too long", "set tick_s below 4 s").column("tick_s"))?;
        let slew_ticks = slew_ticks.unwrap_or(DEFAULT_SLEW_TICKS.min(period_ticks));
        if slew_ticks > period_ticks {
            let what = format!("the slew is longer than the temperature period of {period_ticks} ticks");
            return Err(Error::input(what, "set slew_ticks to at most the temperature period")
                .column("slew_ticks")
                .value(slew_ticks.to_string()));
        }
        Ok(Self { tick_ns, period_ticks, slew_ticks })
    }

    /// Δt, s.
    pub fn period_s(&self) -> f64 {
        f64::from(self.tick_ns) * f64::from(self.period_ticks) * 1e-9
    }

    /// Tick, s.
    pub fn tick_s(&self) -> f64 {
        f64::from(self.tick_ns) * 1e-9
    }
}

impl Calibration {
    /// Name of the thermometer of the fit in the log's header; empty for a plain `temperature_c`.
    pub fn thermometer_name(&self) -> Option<&str> {
        match &self.axes.first()?.correction.inputs.first()?.source {
            InputSource::Thermometer(name) => Some(name),
            InputSource::Difference(..) | InputSource::Column(_) | InputSource::Repeat(_) => None,
        }
    }

    /// Of each axis the fixed bias that its correction takes out, °/h; `None` where it stays.
    pub fn removed_dph(&self) -> Vec<Option<f64>> {
        let of_axis = |axis: &AxisCalibration| axis.correction.fixed_bias.map(|bias| bias.value_dph);
        self.axes.iter().map(of_axis).collect()
    }
}
