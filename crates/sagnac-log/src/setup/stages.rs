//! What each stage reads of a setup.
//!
//! ```text
//! bench.toml ─▶ Setup ─stages()─┬▶ ReadConfig     rows of a log        ┐ two setups with the same values here
//!                               ├▶ WindowConfig   windows of rows      ┘ give the same windows
//!                               ├▶ TestConfig     table, input rate, noise of the test
//!                               ├▶ ModelConfig    inputs of the fit and their limits
//!                               ├▶ TargetConfig   timing of the image
//!                               ├▶ BenchSetup     sources of a live test
//!                               └▶ Identity       words about the gyro and its test
//! ```
//!
//! [`Setup::stages`] names every key of the setup, so the code compiles only if every key belongs to a stage.

use std::collections::BTreeMap;

use super::{
    AuxSetup, BenchSetup, Counter, DEFAULT_TICK_NS, Noise, ONE_SECOND_NS, PerAxis, RunDivision, Setup, TableRun,
    ThermometerSetup, WindowSize,
};
use crate::error::{Error, Result};
use crate::memory::MemoryBudget;
use sagnac_units::ns_from_s;

/// How rows are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadConfig {
    /// Axis letter of a log whose headers name none.
    pub axis: Option<char>,
    /// Nominal scale factor S0, arcsec per count.
    pub arcsec_per_count: Option<f64>,
    /// Smallest step of the counts column, counts.
    pub quantum: Option<f64>,
    /// How the counts column counts.
    pub counter: Counter,
    /// The setup states it: counts that only rise are believed.
    pub counter_stated: bool,
    /// Width of a wrapping cumulative counter, bits.
    pub counter_bits: Option<u8>,
    /// Interval of a row, s.
    pub sample_interval_s: Option<f64>,
    /// Header of the log, header of Sagnac.
    pub columns: BTreeMap<String, String>,
    /// Number of the sensor to read from a PX4 log.
    pub instance: Option<u8>,
    /// Added to the time of temperatures, s.
    pub temperature_offset_s: f64,
    /// Valid ranges and codes of thermometers.
    pub thermometers: Vec<ThermometerSetup>,
    /// Valid ranges and codes of auxiliary columns.
    pub aux: Vec<AuxSetup>,
    /// What a file may take.
    pub memory: MemoryBudget,
}

impl ReadConfig {
    /// The thermometer of this name, with the defaults where the setup has none.
    pub(crate) fn thermometer(&self, name: &str) -> ThermometerSetup {
        ThermometerSetup::find(&self.thermometers, name)
    }

    /// The auxiliary column of this name, with the defaults where the setup has none.
    pub(crate) fn aux(&self, name: &str) -> AuxSetup {
        AuxSetup::find(&self.aux, name)
    }
}

/// Tick and temperature period of the target: windows record temperatures on this grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    tick_s: Option<f64>,
    temperature_period_s: Option<f64>,
}

impl Clock {
    /// Tick, ns; 100 µs by default.
    pub fn tick_ns(self) -> i64 {
        self.tick_s.and_then(ns_from_s).unwrap_or(DEFAULT_TICK_NS).max(1)
    }

    /// Temperature period Δt, ns: as given, else 1 s rounded up to whole ticks.
    ///
    /// # Errors
    /// A given period that is no whole number of ticks.
    pub fn period_ns(self) -> Result<i64> {
        let tick_ns = self.tick_ns();
        let Some(seconds) = self.temperature_period_s else {
            return Ok((ONE_SECOND_NS + tick_ns - 1) / tick_ns * tick_ns);
        };
        let period_ns = ns_from_s(seconds).unwrap_or(0);
        if period_ns < tick_ns || period_ns % tick_ns != 0 {
            let error = Error::input("must be a whole number of ticks").column("temperature_period_s");
            return Err(error.value(seconds.to_string()));
        }
        Ok(period_ns)
    }
}

/// How rows become windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowConfig {
    /// Length of a window.
    pub window: WindowSize,
    /// Not used at the start of each run, s.
    pub discard_initial_s: f64,
    /// Grid of the tracks.
    pub clock: Clock,
    /// Which files are one run.
    pub runs: RunDivision,
    /// What windows and tracks may take.
    pub memory: MemoryBudget,
}

/// What the gyro was subjected to.
#[derive(Clone, Debug, PartialEq)]
pub struct TestConfig {
    /// Known input rates, °/h: as given, else by site and attitude.
    pub input_rate_dph: Option<PerAxis<f64>>,
    /// Runs on a rate table.
    pub tables: Vec<TableRun>,
    /// Noise where it is known; measured from the log by default.
    pub noise: Option<Noise>,
    /// Largest accepted deviation of the scale factor from S0, ppm; 1000 by default.
    pub scale_factor_deviation_max_ppm: f64,
}

impl TestConfig {
    /// Input rate of an axis of a log with so many axes, °/h.
    pub fn input_rate_of(&self, axis: char, axes: usize) -> Option<f64> {
        self.input_rate_dph.as_ref()?.of(axis, axes)
    }

    /// Settings of the table for the run of a file: its own entry, otherwise the one for every run.
    pub fn table_of(&self, file: &str) -> Option<&TableRun> {
        let own = self.tables.iter().find(|table| table.file.as_deref() == Some(file));
        own.or_else(|| self.tables.iter().find(|table| table.file.is_none()))
    }
}

/// What a model may use.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelConfig {
    /// T0 at which the correction is zero, °C; 25 by default.
    pub reference_c: f64,
    /// Smallest temperature span of a fit, °C; 10 by default.
    pub min_span_c: f64,
    /// Thermometer of the fit, where the log has several.
    pub use_thermometer: Option<String>,
    /// Inputs besides the thermometer of the fit; all of the log by default.
    pub inputs: Option<Vec<String>>,
    /// Thermometers that differ from the defaults.
    pub thermometers: Vec<ThermometerSetup>,
    /// Auxiliary columns that differ from the defaults.
    pub aux: Vec<AuxSetup>,
}

impl ModelConfig {
    /// The thermometer of this name, with the defaults where the setup has none.
    pub fn thermometer(&self, name: &str) -> ThermometerSetup {
        ThermometerSetup::find(&self.thermometers, name)
    }

    /// The auxiliary column of this name, with the defaults where the setup has none.
    pub fn aux(&self, name: &str) -> AuxSetup {
        AuxSetup::find(&self.aux, name)
    }
}

/// How the target runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetConfig {
    /// Tick and temperature period.
    pub clock: Clock,
    /// Ticks over which a new correction is approached.
    pub slew_ticks: Option<u32>,
    /// Most instructions of a slow update.
    pub slow_update_instructions_max: Option<u32>,
    /// Virtual LSB of a rate log, arcsec; it follows the calibration by default.
    pub rate_lsb_arcsec: Option<f64>,
}

/// Words about the gyro and its test.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Serial number of the gyro.
    pub serial: Option<String>,
    /// What the sensor is.
    pub sensor: Option<String>,
    /// Chamber, table, site.
    pub rig: Option<String>,
}

/// A setup, stage by stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Stages {
    /// Rows of a log.
    pub read: ReadConfig,
    /// Windows of rows.
    pub window: WindowConfig,
    /// The test.
    pub test: TestConfig,
    /// The model.
    pub model: ModelConfig,
    /// The target.
    pub target: TargetConfig,
    /// Names.
    pub identity: Identity,
    /// How a live test is recorded.
    pub bench: BenchSetup,
}

impl Setup {
    /// The configuration of each stage, with defaults filled in.
    pub fn stages(&self) -> Stages {
        let Self {
            serial,
            axis,
            sensor,
            rig,
            arcsec_per_count,
            quantum,
            counter,
            counter_bits,
            sample_interval_s,
            columns,
            instance,
            temperature_offset_s,
            input_rate_dph,
            earth,
            window,
            runs,
            reference_c,
            discard_initial_s,
            min_span_c,
            noise,
            scale_factor_deviation_max_ppm,
            tick_s,
            temperature_period_s,
            slew_ticks,
            slow_update_instructions_max,
            rate_lsb_arcsec,
            use_thermometer,
            inputs,
            tables,
            thermometers,
            aux,
            bench,
            memory,
        } = self.clone();
        let clock = Clock { tick_s, temperature_period_s };
        Stages {
            read: ReadConfig {
                axis,
                arcsec_per_count,
                quantum,
                counter: counter.unwrap_or_default(),
                counter_stated: counter.is_some(),
                counter_bits,
                sample_interval_s,
                columns,
                instance,
                temperature_offset_s,
                thermometers: thermometers.clone(),
                aux: aux.clone(),
                memory,
            },
            window: WindowConfig {
                window: window.unwrap_or(WindowSize::DEFAULT),
                discard_initial_s,
                clock,
                runs,
                memory,
            },
            test: TestConfig {
                input_rate_dph: input_rate_dph.or(earth.map(|e| e.rate_dph())),
                tables,
                noise,
                scale_factor_deviation_max_ppm: scale_factor_deviation_max_ppm.unwrap_or(DEFAULT_SCALE_DEVIATION_PPM),
            },
            model: ModelConfig {
                reference_c: reference_c.unwrap_or(DEFAULT_REFERENCE_C),
                min_span_c: min_span_c.unwrap_or(DEFAULT_MIN_SPAN_C),
                use_thermometer,
                inputs,
                thermometers,
                aux,
            },
            target: TargetConfig { clock, slew_ticks, slow_update_instructions_max, rate_lsb_arcsec },
            identity: Identity { serial, sensor, rig },
            bench,
        }
    }

    /// True where both setups make the same windows of a log.
    pub fn makes_the_windows_of(&self, other: &Self) -> bool {
        let stated = |setup: &Self| Some(setup.counter.unwrap_or_default());
        let a = Self { counter: stated(self), ..self.clone() }.stages();
        let b = Self { memory: self.memory, counter: stated(other), ..other.clone() }.stages();
        a.read == b.read && a.window == b.window
    }
}

/// Deviation of the scale factor, ppm.
const DEFAULT_SCALE_DEVIATION_PPM: f64 = 1000.0;
/// T0, °C.
const DEFAULT_REFERENCE_C: f64 = 25.0;
/// Smallest temperature span of a fit, °C.
const DEFAULT_MIN_SPAN_C: f64 = 10.0;

#[cfg(test)]
mod tests {
    use super::*;

    /// Descriptions of the bench change no window; settings for reading rows do.
    #[test]
    fn windows_depend_on_how_rows_are_read() {
        let plain = Setup::default();
        let words = Setup { rig: Some("chamber 3".into()), sensor: Some("RLG".into()), ..Setup::default() };
        assert!(words.makes_the_windows_of(&plain));
        assert!(!Setup { discard_initial_s: 60.0, ..Setup::default() }.makes_the_windows_of(&plain));
        assert!(!Setup { axis: Some('x'), ..Setup::default() }.makes_the_windows_of(&plain));
        // A default that is written out is the same default.
        assert!(Setup { window: Some(WindowSize::DEFAULT), ..Setup::default() }.makes_the_windows_of(&plain));
    }
}
