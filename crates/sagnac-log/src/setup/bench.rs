//! `[bench]`: where a live test gets its bytes from.
//!
//! ```toml
//! [bench]
//! source = "serial:/dev/ttyUSB0?baud=115200"
//!
//! [[bench.poll]]                       # the chamber's own controller
//! source = "scpi://192.168.1.30:5025"
//! columns = [{ name = "temperature_c_chamber", query = "MEAS:TEMP?" }, { name = "set_point_c", query = "SOUR:TEMP?" }]
//! ```
//!
//! The table says how a test is recorded, not what its log means: no record holds it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::in_range;
use super::interval::{check_interval, some_interval};
use crate::error::{Error, Result};
use sagnac_units::format::controls;

/// Most columns that are polled.
const MAX_POLLED: usize = 64;

/// How the bytes of a source become rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LiveFormat {
    /// Lines of delimited text.
    #[default]
    Text,
    /// Frames of a gyro's serial line (docs/reference/serial-line.md).
    Frames,
}

/// A live test.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BenchSetup {
    /// Where the gyro's bytes come from: `-`, `file:PATH`, `tcp://HOST:PORT`, `udp://HOST:PORT` (the address to listen on),
    /// `serial:DEVICE?baud=115200` or `replay:LOG?speed=10`.
    pub source: Option<String>,
    /// How they become rows.
    pub format: LiveFormat,
    /// Line of headers, where the source sends none.
    pub headers: Option<String>,
    /// A source is silent after this time without a byte, s; 3 by default, and at least three rows.
    pub silent_after_s: Option<f64>,
    /// Limits that the unit is to meet: a file of `verify`, or one of its sets by name.
    pub limits: Option<String>,
    /// Temperatures that the calibration is to cover, °C; asked before a test may end itself.
    #[serde(deserialize_with = "some_interval")]
    pub span_c: Option<[f64; 2]>,
    /// Rate of the chamber's ramps, °C/min; that of the record by default.
    pub ramp_cpm: Option<f64>,
    /// Part of each limit that the error of the correction may take; 0.5 by default.
    pub share: Option<f64>,
    /// Probability with which it does; 0.95 by default.
    pub probability: Option<f64>,
    /// How often each temperature is to be passed, up or down, before a test may end itself; 3 by default: a cycle and a half.
    pub passes: Option<u32>,
    /// Instruments that are asked for values.
    #[serde(rename = "poll")]
    pub polls: Vec<PollSetup>,
}

/// An instrument that is asked for values, such as the controller of a chamber.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PollSetup {
    /// `scpi://HOST:PORT` or `modbus://HOST:PORT?unit=1`.
    pub source: String,
    /// Time between two questions, s; 1 by default.
    #[serde(default = "one_second")]
    pub every_s: f64,
    /// Its columns of the log.
    pub columns: Vec<PollColumn>,
}

fn one_second() -> f64 {
    1.0
}

/// Type of a value in Modbus registers, the high word first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RegisterType {
    /// One register, signed.
    #[default]
    I16,
    /// One register.
    U16,
    /// Two registers, signed.
    I32,
    /// Two registers.
    U32,
    /// Two registers, IEEE 754.
    F32,
}

impl RegisterType {
    /// Registers of a value.
    pub fn registers(self) -> u16 {
        match self {
            Self::I16 | Self::U16 => 1,
            Self::I32 | Self::U32 | Self::F32 => 2,
        }
    }

    /// The value in the bytes of its registers; `None` for another number of bytes.
    pub fn value(self, bytes: &[u8]) -> Option<f64> {
        let two = || Some([*bytes.first()?, *bytes.get(1)?]).filter(|_| bytes.len() == 2);
        let four = || <[u8; 4]>::try_from(bytes).ok();
        Some(match self {
            Self::I16 => i16::from_be_bytes(two()?).into(),
            Self::U16 => u16::from_be_bytes(two()?).into(),
            Self::I32 => i32::from_be_bytes(four()?).into(),
            Self::U32 => u32::from_be_bytes(four()?).into(),
            Self::F32 => f32::from_be_bytes(four()?).into(),
        })
    }
}

/// Which registers of Modbus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RegisterTable {
    /// Holding registers (function 3).
    #[default]
    Holding,
    /// Input registers (function 4).
    Input,
}

/// A column that is polled.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PollColumn {
    /// Header of the column: `temperature_c_chamber` is a thermometer, `set_point_c` is carried along.
    pub name: String,
    /// SCPI: the question.
    pub query: Option<String>,
    /// Modbus: address of the first register, from 0.
    pub register: Option<u16>,
    /// Modbus: which registers.
    pub table: RegisterTable,
    /// Modbus: type of the value.
    #[serde(rename = "type")]
    pub kind: RegisterType,
    /// The column is the value times this; 1 by default.
    pub scale: Option<f64>,
}

impl BenchSetup {
    pub(super) fn check(&self) -> Result<()> {
        in_range("bench.silent_after_s", self.silent_after_s, 0.1, 1e5)?;
        in_range("bench.ramp_cpm", self.ramp_cpm, 0.01, 100.0)?;
        in_range("bench.share", self.share, 0.01, 0.99)?;
        in_range("bench.probability", self.probability, 0.5, 0.9999)?;
        in_range("bench.passes", self.passes.map(f64::from), 1.0, 100.0)?;
        self.span_c.map_or(Ok(()), |span_c| check_interval("bench.span_c", span_c, [-127.0, 127.0]))?;
        let mut names: Vec<&str> = Vec::new();
        for poll in &self.polls {
            in_range("bench.poll.every_s", Some(poll.every_s), 0.01, 3600.0)?;
            if poll.columns.is_empty() {
                return Err(Error::input(
                    "the instrument has no columns",
                    "add columns = [{ name = \"…\", query = \"…\" }] to its [[bench.poll]]",
                )
                .column("bench.poll")
                .value(&poll.source));
            }
            for column in &poll.columns {
                column.check()?;
                if names.contains(&column.name.as_str()) {
                    return Err(Error::input("two polled columns have the same name", "give each column its own name")
                        .column("name")
                        .value(&column.name));
                }
                names.push(&column.name);
            }
        }
        if names.len() > MAX_POLLED {
            return Err(Error::input(
                format!("more than {MAX_POLLED} polled columns"),
                "remove columns from [[bench.poll]]",
            )
            .column("bench.poll"));
        }
        Ok(())
    }
}

impl PollColumn {
    fn check(&self) -> Result<()> {
        in_range("bench.poll.scale", self.scale.map(f64::abs), 1e-12, 1e12)?;
        let bad = |what: &str, help: &str| Err(Error::input(what, help).column("bench.poll.columns").value(&self.name));
        if self.name.is_empty() || self.name.contains(controls) || self.name.contains([',', ';', '"']) {
            return bad(
                "the column has no name, or one with separators, quotes or control characters",
                "write it like name = \"oven_c\"",
            );
        }
        match (&self.query, self.register) {
            (Some(query), None) if query.trim().is_empty() || query.contains(controls) => {
                bad("a query must be one line of text", "write it like query = \"MEAS:TEMP?\"")
            }
            (Some(_), None) | (None, Some(_)) => Ok(()),
            _ => bad("the column needs a `query` (SCPI) or a `register` (Modbus)", "set one of the two"),
        }
    }
}
