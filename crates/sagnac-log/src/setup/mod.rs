//! `bench.toml`: the facts that a log does not contain.
//!
//! Every key is optional in the file. If a log needs a value that neither file nor flag gives, the error
//! names it. Unknown keys are refused. `docs/reference/cli.md` has the table of keys.

mod bench;
mod defaults;
mod input_rate;
mod interval;
mod rate_unit;

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use bench::{BenchSetup, LiveFormat, PollColumn, PollSetup, RegisterTable, RegisterType};
pub use defaults::Clock;
pub use input_rate::{Direction, Earth, PerAxis, input_rate_hint};
pub use rate_unit::{RATE_UNITS, RateUnit};

use crate::error::{Error, Result};
use crate::memory::MemoryBudget;
use crate::read::read_text;
use crate::setup::interval::{check_interval, interval, some_interval};
use sagnac_units::format::controls;

const DEFAULT_TICK_NS: i64 = 100_000;
const ONE_SECOND_NS: i64 = 1_000_000_000;

/// Meaning of a counts column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Counter {
    /// Counts of the row's own interval.
    #[default]
    Incremental,
    /// A running total; with `counter_bits` it wraps at that width.
    Cumulative,
}

/// Length of an analysis window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a window is a number of seconds, or the word \"row\"")]
pub enum WindowSize {
    /// Seconds, aligned to the start of the run.
    Seconds(f64),
    /// The word `row`: each row of the log is a window.
    Row(RowWord),
}

/// The word `row`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RowWord {
    /// One window per row.
    Row,
}

/// Which files are one run: a run has its own run offset, and the thermal lag filter continues within it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RunDivision {
    /// A file continues the run of the file before if its time starts within 1.5 row intervals of that file's end.
    #[default]
    Auto,
    /// All files are one run.
    One,
    /// Each file is a run.
    Files,
}

/// How often the gyro was switched on for the logs of a test. A file does not show it: a logger that starts a new one every hour switches
/// nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "turn-ons are a number, or the word \"files\"")]
pub enum TurnOnCount {
    /// So often.
    Number(u32),
    /// The word `files`: once for each run of the logs.
    Files(FilesWord),
}

/// The word `files`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FilesWord {
    /// One turn-on per run.
    Files,
}

impl TurnOnCount {
    /// One for each run.
    pub const FILES: Self = Self::Files(FilesWord::Files);

    /// Turn-ons of so many runs: no run has more than one.
    pub fn of_runs(self, runs: usize) -> usize {
        match self {
            Self::Number(number) => runs.min(number as usize),
            Self::Files(_) => runs,
        }
    }
}

impl WindowSize {
    /// One window per row.
    pub const ROW: Self = Self::Row(RowWord::Row);
    /// The design's default.
    pub const DEFAULT: Self = Self::Seconds(100.0);

    /// Seconds of a window, or `None` for one window per row.
    pub fn seconds(self) -> Option<f64> {
        match self {
            Self::Seconds(s) => Some(s),
            Self::Row(_) => None,
        }
    }
}

/// Noise given instead of measured. With B or K it is the noise of the fit's intervals, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Noise {
    /// Angle random walk, °/√h.
    pub n_deg_rt_h: f64,
    /// Quantization, arcsec.
    #[serde(default)]
    pub q_arcsec: f64,
    /// Bias instability B, °/h.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub b_dph: Option<f64>,
    /// Rate random walk K, °/h/√h.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub k_dph_rt_h: Option<f64>,
}

impl Noise {
    /// Of this angle random walk, °/√h, and nothing else.
    pub fn walk(n_deg_rt_h: f64) -> Self {
        Self { n_deg_rt_h, ..Self::default() }
    }

    /// With quantization, arcsec.
    #[must_use]
    pub fn quantized(self, q_arcsec: f64) -> Self {
        Self { q_arcsec, ..self }
    }

    /// With bias instability, °/h, and rate random walk, °/h/√h.
    #[must_use]
    pub fn slow(self, b_dph: f64, k_dph_rt_h: f64) -> Self {
        Self { b_dph: Some(b_dph), k_dph_rt_h: Some(k_dph_rt_h), ..self }
    }
}

/// One thermometer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThermometerSetup {
    /// Name as in the header `temperature_c_<name>`; empty for a plain `temperature_c`.
    #[serde(default)]
    pub name: String,
    /// Valid range, °C; temperatures outside are treated as missing.
    #[serde(default = "default_valid_range", deserialize_with = "interval")]
    pub valid_range_c: [f64; 2],
    /// How long a correction is kept without a temperature before it is STALE, s.
    #[serde(default = "default_stale_after")]
    pub stale_after_s: f64,
    /// Largest step between two temperature periods that the target takes for a temperature at once, °C; 0 for any step. By default three
    /// times the largest of the logs.
    #[serde(default)]
    pub max_step_c: Option<f64>,
    /// Temperature at code 0, °C, where the target reads codes.
    #[serde(default)]
    pub offset_c: Option<f64>,
    /// °C per code, where the target reads codes.
    #[serde(default)]
    pub gain_c_per_code: Option<f64>,
}

fn default_valid_range() -> [f64; 2] {
    [-80.0, 125.0]
}

fn default_stale_after() -> f64 {
    10.0
}

impl ThermometerSetup {
    /// The defaults under a name.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            valid_range_c: default_valid_range(),
            stale_after_s: default_stale_after(),
            max_step_c: None,
            offset_c: None,
            gain_c_per_code: None,
        }
    }
}

/// One auxiliary column as an input of the correction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AuxSetup {
    /// Name as in the header `aux_<name>`.
    pub name: String,
    /// Valid range; values outside are treated as missing. By default the fit's span, widened by its own width on both sides.
    #[serde(default, deserialize_with = "some_interval")]
    pub valid_range: Option<[f64; 2]>,
    /// How long a correction is kept without a value before it is STALE, s.
    #[serde(default = "default_stale_after")]
    pub stale_after_s: f64,
    /// Largest step between two temperature periods that the target takes for a value at once; 0 for any step. By default 1.5 times the
    /// largest of the logs.
    #[serde(default)]
    pub max_step: Option<f64>,
    /// Value at code 0, where the target reads codes.
    #[serde(default)]
    pub offset: Option<f64>,
    /// Units per code, where the target reads codes.
    #[serde(default)]
    pub gain_per_code: Option<f64>,
}

impl AuxSetup {
    /// The defaults under a name.
    pub(crate) fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            valid_range: None,
            stale_after_s: default_stale_after(),
            max_step: None,
            offset: None,
            gain_per_code: None,
        }
    }

    fn check(&self) -> Result<()> {
        self.valid_range.map_or(Ok(()), |range| check_interval("aux.valid_range", range, [-1e12, 1e12]))?;
        in_range("aux.stale_after_s", Some(self.stale_after_s), 0.0, 1e6)?;
        in_range("aux.max_step", self.max_step, 0.0, 1e12)?;
        in_range("aux.offset", self.offset, -1e12, 1e12)?;
        in_range("aux.gain_per_code", self.gain_per_code.map(f64::abs), 1e-18, 1e12)?;
        if self.offset.is_some() != self.gain_per_code.is_some() {
            return Err(
                Error::input("offset and gain_per_code go together", "set both or neither under [[aux]]").column("aux")
            );
        }
        Ok(())
    }
}

/// Attitude and rate of the rate table in a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TableRun {
    /// File name of the run without its folder; every run without one.
    pub file: Option<String>,
    /// Axis of the gyro along the table's axis: "z", or "-z" where the table's positive direction is the gyro's negative
    /// one. Needed by logs of several axes.
    pub axis: Option<String>,
    /// Rate of the table, °/s, where the log has no column for it.
    pub rate_dps: Option<f64>,
}

/// The facts that a log does not contain. Flags of the same names override the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Setup {
    /// Serial number of the gyro, up to 32 bytes.
    pub serial: Option<String>,
    /// Axis letter of a log whose headers name none.
    pub axis: Option<char>,
    /// What the sensor is, in words.
    pub sensor: Option<String>,
    /// Test equipment, in words: chamber, table, site.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rig: Option<String>,
    /// Unit of rates in text, plots and reports, `dph`, `dps`, `mdps` or `radps`; °/h by default. Records, limits and JSON keep °/h.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units: Option<RateUnit>,
    /// Nominal scale factor S0, arcsec per count. Needed by count logs, never guessed.
    pub arcsec_per_count: Option<f64>,
    /// Smallest step of the counts column, counts; 1 by default.
    pub quantum: Option<f64>,
    /// Meaning of the counts column; incremental by default. A log whose counts only rise is refused unless this states it.
    pub counter: Option<Counter>,
    /// Width of a wrapping cumulative counter, bits.
    pub counter_bits: Option<u8>,
    /// Interval of a row, s; that of the first rows by default. Refused if it differs by over 2 % from the time column's.
    pub sample_interval_s: Option<f64>,
    /// Maps a header of the log (left) to a header of Sagnac (right): `"imu.gyro.x" = "rate_radps_x"`.
    pub columns: BTreeMap<String, String>,
    /// Number of the sensor to read from a PX4 log, from 0; 0 by default.
    pub instance: Option<u8>,
    /// Added to the time of temperatures to bring them to the time of the counts, s.
    pub temperature_offset_s: f64,
    /// Input rate along the axis during the test, °/h, if known; of a log with several axes one each, `{ x = 0.0, z = 4.498 }`, or 0 for all.
    pub input_rate_dph: Option<PerAxis<f64>>,
    /// Site and attitude, from which the input rate of a static test follows.
    pub earth: Option<Earth>,
    /// Analysis window: seconds or "row"; 100 s by default.
    pub window: Option<WindowSize>,
    /// Which files are one run: `auto` (files with continuing time), `one` (all files), or `files` (each file).
    #[serde(skip_serializing_if = "is_default")]
    pub runs: RunDivision,
    /// How often the gyro was switched on for these logs: a number, or `files` for once per run. No log shows it, and without it the scatter
    /// from turn-on to turn-on is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_ons: Option<TurnOnCount>,
    /// Temperature T0 at which the correction is zero, °C; 25 by default.
    pub reference_c: Option<f64>,
    /// Time at the start of each run that is excluded from the fit, s.
    pub discard_initial_s: f64,
    /// Smallest temperature span of a fit, °C; 10 by default.
    pub min_span_c: Option<f64>,
    /// Noise if known; measured from the log by default.
    pub noise: Option<Noise>,
    /// Largest accepted deviation of the scale factor from its nominal value on a rate table, ppm; 1000 by default. It detects
    /// a reference rate of the wrong sign and a wrong nominal scale factor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_factor_deviation_max_ppm: Option<f64>,
    /// Tick of the target, s; 100 µs by default.
    pub tick_s: Option<f64>,
    /// Temperature period Δt of the target, s; 1 s by default.
    pub temperature_period_s: Option<f64>,
    /// Ticks over which a new correction is approached; 100 by default.
    pub slew_ticks: Option<u32>,
    /// Most instructions that a slow update of the target may have, in the measure of `slow_update_instructions`; any number by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slow_update_instructions_max: Option<u32>,
    /// Virtual LSB with which a rate log is replayed, arcsec; by default the finest decade from 1e-4 on in which the correction
    /// fits an image with a margin of 4.
    pub rate_lsb_arcsec: Option<f64>,
    /// Name of the thermometer that the model uses, if the log has several; the first by default.
    pub use_thermometer: Option<String>,
    /// Other inputs that `auto` may use (thermometers, "one - another", auxiliary columns); all of the log by default. They also
    /// name the inputs of an image that is used without its record: those with a code, in the image's order.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inputs: Option<Vec<String>>,
    /// Runs on a rate table.
    #[serde(rename = "table", skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<TableRun>,
    /// Thermometers that differ from the defaults.
    #[serde(rename = "thermometer")]
    pub thermometers: Vec<ThermometerSetup>,
    /// Auxiliary columns that differ from the defaults.
    #[serde(rename = "aux", skip_serializing_if = "Vec::is_empty")]
    pub aux: Vec<AuxSetup>,
    /// How a live test is recorded (`sagnac bench`): no fact of a log, so not in a record.
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub bench: BenchSetup,
    /// What the data of one run may take (`--memory`): a fact of the machine, so neither in the file nor in a record.
    #[serde(skip)]
    pub memory: MemoryBudget,
}

impl Setup {
    /// Reads and checks a setup file.
    ///
    /// # Errors
    /// Unreadable, not TOML, an unknown key, or a value outside its range (key and value named).
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let text = read_text(path, "read the setup", 1 << 20)?;
        Self::parse(&text).map_err(|e| e.file(path.display().to_string()))
    }

    /// Parses and checks the text of a setup file.
    ///
    /// # Errors
    /// As [`Setup::read`].
    pub fn parse(text: &str) -> Result<Self> {
        let setup: Self = toml::from_str(text)
            .map_err(|e| Error::toml("setup", text, &e, "correct the key: docs/reference/cli.md lists all of them"))?;
        setup.check()?;
        Ok(setup)
    }

    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value outside its range, by name.
    pub fn check(&self) -> Result<()> {
        let positive = [
            ("arcsec_per_count", self.arcsec_per_count, 1e-9, 1e4),
            ("quantum", self.quantum, 1e-6, 1e6),
            ("sample_interval_s", self.sample_interval_s, 1e-6, 1e5),
            ("min_span_c", self.min_span_c, 0.1, 200.0),
            ("scale_factor_deviation_max_ppm", self.scale_factor_deviation_max_ppm, 1.0, 1e6),
            ("tick_s", self.tick_s, 1e-7, 1.0),
            ("temperature_period_s", self.temperature_period_s, 1e-3, 3600.0),
            ("rate_lsb_arcsec", self.rate_lsb_arcsec, 1e-9, 1e3),
            ("window", self.window.and_then(WindowSize::seconds), 1e-3, 1e6),
        ];
        for (name, value, lo, hi) in positive {
            in_range(name, value, lo, hi)?;
        }
        in_range("reference_c", self.reference_c, -127.0, 127.0)?;
        in_range("discard_initial_s", Some(self.discard_initial_s), 0.0, 1e7)?;
        in_range("temperature_offset_s", Some(self.temperature_offset_s), -3600.0, 3600.0)?;
        for rate_dph in self.input_rate_dph.iter().flat_map(PerAxis::values) {
            in_range("input_rate_dph", Some(rate_dph), -1e8, 1e8)?;
        }
        self.input_rate_dph.as_ref().map_or(Ok(()), |rates| rates.check("input_rate_dph"))?;
        in_range("noise.n_deg_rt_h", self.noise.map(|n| n.n_deg_rt_h), 0.0, 1e3)?;
        in_range("noise.q_arcsec", self.noise.map(|n| n.q_arcsec), 0.0, 1e4)?;
        in_range("noise.b_dph", self.noise.and_then(|n| n.b_dph), 0.0, 1e5)?;
        in_range("noise.k_dph_rt_h", self.noise.and_then(|n| n.k_dph_rt_h), 0.0, 1e5)?;
        if let Some(earth) = &self.earth {
            in_range("earth.latitude_deg", Some(earth.latitude_deg), -90.0, 90.0)?;
            earth.axis_direction.check("earth.axis_direction")?;
        }
        in_range("counter_bits", self.counter_bits.map(f64::from), 4.0, 52.0)?;
        for (name, value) in
            self.noise.iter().flat_map(|n| [("noise.n_deg_rt_h", n.n_deg_rt_h), ("noise.q_arcsec", n.q_arcsec)])
        {
            // Zero stands for none; the quietest ring lasers have about 1e-8 °/√h.
            in_range(name, Some(value).filter(|value| *value != 0.0), 1e-12, 1e4)?;
        }
        if self.noise.is_some_and(|n| n.n_deg_rt_h == 0.0 && n.q_arcsec == 0.0) {
            return Err(Error::input(
                "a noise floor of zero is impossible",
                "remove [noise], and the program measures the floor",
            )
            .column("noise"));
        }
        for table in &self.tables {
            in_range("table.rate_dps", table.rate_dps, -1e4, 1e4)?;
        }
        self.check_words()?;
        self.bench.check()?;
        self.thermometers.iter().try_for_each(check_thermometer)?;
        for (at, aux) in self.aux.iter().enumerate() {
            aux.check()?;
            if self.aux[..at].iter().any(|other| other.name == aux.name) {
                return Err(Error::input("the same auxiliary column twice", "remove one of the two [[aux]]")
                    .column("aux.name")
                    .value(&aux.name));
            }
        }
        Ok(())
    }

    fn check_words(&self) -> Result<()> {
        if let Some(serial) = self.serial.as_deref()
            && !is_serial(serial)
        {
            return Err(not_a_serial(serial));
        }
        let names =
            self.thermometers.iter().map(|t| t.name.as_str()).chain(self.aux.iter().map(|aux| aux.name.as_str()));
        if let Some(name) = names.into_iter().find(|name| name.contains(controls)) {
            return Err(Error::input("a name contains control characters", "rename it").column("name").value(name));
        }
        if let Some(axis) = self.axis
            && !axis.is_ascii_alphanumeric()
        {
            return Err(Error::input("an axis is one letter or digit", "write it like axis = \"x\"")
                .column("axis")
                .value(axis.to_string()));
        }
        if self.input_rate_dph.is_some() && self.earth.is_some() {
            return Err(Error::input(
                "input_rate_dph and [earth] both give the input rate",
                "remove one of them from the setup",
            )
            .column("earth"));
        }
        if self.counter_bits.is_some() && self.counter != Some(Counter::Cumulative) {
            return Err(Error::input(
                "only a cumulative counter wraps",
                "set counter = \"cumulative\", or remove counter_bits",
            )
            .column("counter_bits"));
        }
        Ok(())
    }
}

/// True for a serial number that an image and a report can hold: 1 to 32 bytes, none of them a control character.
pub fn is_serial(serial: &str) -> bool {
    (1..=32).contains(&serial.len()) && !serial.contains(controls)
}

/// The refusal of any other.
pub fn not_a_serial(serial: &str) -> Error {
    Error::input("a serial has 1 to 32 bytes and no control characters", "shorten it, such as --serial IMU-0042")
        .column("serial")
        .value(serial)
}

fn is_default(runs: &RunDivision) -> bool {
    *runs == RunDivision::default()
}

/// Checks a thermometer against its ranges.
///
/// # Errors
/// The first value outside its range, by name.
pub fn check_thermometer(t: &ThermometerSetup) -> Result<()> {
    check_interval("thermometer.valid_range_c", t.valid_range_c, [-127.0, 127.0])?;
    in_range("thermometer.stale_after_s", Some(t.stale_after_s), 0.0, 1e6)?;
    in_range("thermometer.max_step_c", t.max_step_c, 0.0, 250.0)?;
    in_range("thermometer.offset_c", t.offset_c, -127.0, 127.0)?;
    in_range("thermometer.gain_c_per_code", t.gain_c_per_code.map(f64::abs), 1e-8, 100.0)?;
    if t.offset_c.is_some() != t.gain_c_per_code.is_some() {
        return Err(Error::input(
            "offset_c and gain_c_per_code go together",
            "set both or neither under [[thermometer]]",
        )
        .column("thermometer"));
    }
    Ok(())
}

fn in_range(name: &str, value: Option<f64>, lo: f64, hi: f64) -> Result<()> {
    match value {
        Some(v) if !(lo..=hi).contains(&v) => Err(Error::input(
            format!("must be within {lo} … {hi}"),
            format!("set {name} to a value between {lo} and {hi}"),
        )
        .column(name)
        .value(v.to_string())),
        _ => Ok(()),
    }
}

impl std::str::FromStr for Setup {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::parse(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_keys_and_absurd_values_are_named() {
        let error = Setup::parse("serial = \"a\"\narcsec_per_cuont = 1.0\n").unwrap_err();
        assert_eq!(error.place.line, Some(2));
        assert!(error.what.contains("arcsec_per_cuont"), "{error}");
        let error = Setup::parse("arcsec_per_count = -1.0").unwrap_err();
        assert_eq!(error.place.column.as_deref(), Some("arcsec_per_count"));
    }

    #[test]
    fn window_is_seconds_or_the_word_row() {
        assert_eq!(Setup::parse("window = \"row\"").unwrap().window, Some(WindowSize::ROW));
        assert_eq!(Setup::parse("window = 50").unwrap().window, Some(WindowSize::Seconds(50.0)));
        assert!(Setup::parse("window = \"hour\"").is_err());
    }
}
