//! The values of a setup with their defaults, for the stages that use them.
//!
//! ```text
//! rows of a log      counter, thermometer, aux            windows of rows   window, clock
//! test               input rates, table, largest deviation of the scale factor
//! model              T0, smallest span, thermometer, aux  target            clock
//! ```
//!
//! A key without a default is read as the field that it is.

use std::collections::BTreeMap;

use super::{
    AuxSetup, Counter, DEFAULT_TICK_NS, ONE_SECOND_NS, PerAxis, Setup, TableRun, ThermometerSetup, WindowSize,
};
use crate::error::{Error, Result};
use sagnac_units::ns_from_s;

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
            let error = Error::input(
                "must be a whole number of ticks",
                format!("set temperature_period_s to a multiple of {} s", tick_ns as f64 / 1e9),
            )
            .column("temperature_period_s");
            return Err(error.value(seconds.to_string()));
        }
        Ok(period_ns)
    }
}

impl Setup {
    /// How the counts column counts; incremental by default.
    pub fn counter(&self) -> Counter {
        self.counter.unwrap_or_default()
    }

    /// Rows without times follow one another: their interval is given, and many make a window. A row as long as a window may be of
    /// any time.
    pub(crate) fn has_even_rows(&self) -> bool {
        let window_s = self.window().seconds();
        self.sample_interval_s.zip(window_s).is_some_and(|(interval_s, window_s)| interval_s < window_s)
    }

    /// Length of a window; 100 s by default.
    pub fn window(&self) -> WindowSize {
        self.window.unwrap_or(WindowSize::DEFAULT)
    }

    /// Tick and temperature period of the target.
    pub fn clock(&self) -> Clock {
        Clock { tick_s: self.tick_s, temperature_period_s: self.temperature_period_s }
    }

    /// T0 at which the correction is zero, °C; 25 by default.
    pub fn reference_c(&self) -> f64 {
        self.reference_c.unwrap_or(25.0)
    }

    /// Smallest temperature span of a fit, °C; 10 by default.
    pub fn min_span_c(&self) -> f64 {
        self.min_span_c.unwrap_or(10.0)
    }

    /// Largest accepted deviation of the scale factor from S0, ppm; 1000 by default.
    pub fn scale_factor_deviation_max_ppm(&self) -> f64 {
        self.scale_factor_deviation_max_ppm.unwrap_or(1000.0)
    }

    /// Known input rates, °/h: as given, else by site and attitude.
    pub fn input_rates_dph(&self) -> Option<PerAxis<f64>> {
        self.input_rate_dph.clone().or_else(|| self.earth.as_ref().map(|earth| earth.rate_dph()))
    }

    /// Known input rates of the axes of a log, °/h: as stated here, else by another.
    ///
    /// # Errors
    /// One value other than 0, or one direction, for several axes; axes of which the log has none.
    pub fn input_rates_of_log(&self, else_by: Option<&PerAxis<f64>>, letters: &[char]) -> Result<Option<PerAxis<f64>>> {
        match (&self.input_rate_dph, &self.earth) {
            (Some(PerAxis::Only(0.0)), _) | (None, None) => {}
            (Some(stated), _) => stated.check_log(letters)?,
            (None, Some(earth)) => earth.axis_direction.check_log(letters)?,
        }
        let stated = self.input_rates_dph();
        let value = |axis: char| {
            let own = |all: Option<&PerAxis<f64>>| all.and_then(|all| all.of(axis, letters.len()));
            own(stated.as_ref()).or_else(|| own(else_by))
        };
        let values: BTreeMap<char, f64> = letters.iter().filter_map(|axis| Some((*axis, value(*axis)?))).collect();
        Ok((!values.is_empty()).then_some(PerAxis::Each(values)))
    }

    /// Input rate of an axis of a log with so many axes, °/h.
    pub fn input_rate_of(&self, axis: char, axes: usize) -> Option<f64> {
        self.input_rates_dph()?.of(axis, axes)
    }

    /// Settings of the table for the run of a file: its own entry, otherwise the one for every run.
    pub fn table_of(&self, file: &str) -> Option<&TableRun> {
        let own = self.tables.iter().find(|table| table.file.as_deref() == Some(file));
        own.or_else(|| self.tables.iter().find(|table| table.file.is_none()))
    }

    /// The thermometer of this name, with the defaults where the setup has none.
    pub fn thermometer(&self, name: &str) -> ThermometerSetup {
        self.thermometers.iter().find(|t| t.name == name).cloned().unwrap_or_else(|| ThermometerSetup::named(name))
    }

    /// The auxiliary column of this name, with the defaults where the setup has none.
    pub fn aux(&self, name: &str) -> AuxSetup {
        self.aux.iter().find(|aux| aux.name == name).cloned().unwrap_or_else(|| AuxSetup::named(name))
    }

    /// True where both setups make the same windows of a log: they differ in words, test, model, target and bench alone.
    pub fn makes_the_windows_of(&self, other: &Self) -> bool {
        let of_windows = |setup: &Self| Self {
            counter: Some(setup.counter()),
            window: Some(setup.window()),
            serial: None,
            sensor: None,
            rig: None,
            units: None,
            input_rate_dph: None,
            earth: None,
            reference_c: None,
            min_span_c: None,
            noise: None,
            scale_factor_deviation_max_ppm: None,
            slew_ticks: None,
            slow_update_instructions_max: None,
            rate_lsb_arcsec: None,
            use_thermometer: None,
            inputs: None,
            tables: Vec::new(),
            bench: super::BenchSetup::default(),
            memory: self.memory,
            ..setup.clone()
        };
        of_windows(self) == of_windows(other)
    }
}

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
