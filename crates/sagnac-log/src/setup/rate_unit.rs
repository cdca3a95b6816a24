//! The unit in which people read rates: °/h, °/s, m°/s or rad/s.
//!
//! ```text
//! shown = °/h ÷ dph_per_unit      N: 1 °/√h = 1/60 °/s/√Hz      K: 1 °/h/√h = 1/(3600 · 60) °/s/√s
//! ```
//!
//! Records, setups, limits and JSON keep °/h. Only text, plots and reports are converted.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use crate::error::Error;
use sagnac_units::format::{significant, unit, with_sigma};
use sagnac_units::{DPH_PER_DPS, DPH_PER_RADPS};

/// A unit of rates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum RateUnit {
    /// °/h.
    #[default]
    DegPerHour,
    /// °/s.
    DegPerSecond,
    /// 0.001 °/s.
    MilliDegPerSecond,
    /// rad/s.
    RadPerSecond,
}

/// What belongs to a unit.
struct Row {
    unit: RateUnit,
    /// As people write it, in small letters, and the ending of its headers.
    spellings: (&'static [&'static str], &'static str),
    /// For people.
    name: &'static str,
    dph_per_unit: f64,
    /// The unit of its angle random walk.
    walk: &'static str,
}

/// In the order of [`RateUnit`].
const ROWS: [Row; 4] = [
    Row {
        unit: RateUnit::DegPerHour,
        spellings: (&["°/h", "deg/h", "deg/hr", "dph", "°/hr"], "dph"),
        name: "°/h",
        dph_per_unit: 1.0,
        walk: "°/√h",
    },
    Row {
        unit: RateUnit::DegPerSecond,
        spellings: (&["°/s", "deg/s", "dps", "deg/sec", "°/sec"], "dps"),
        name: "°/s",
        dph_per_unit: DPH_PER_DPS,
        walk: "°/s/√Hz",
    },
    Row {
        unit: RateUnit::MilliDegPerSecond,
        spellings: (&["m°/s", "mdeg/s", "mdps", "mdeg/sec"], "mdps"),
        name: "m°/s",
        dph_per_unit: DPH_PER_DPS / 1000.0,
        walk: "m°/s/√Hz",
    },
    Row {
        unit: RateUnit::RadPerSecond,
        spellings: (&["rad/s", "radps", "rad/sec"], "radps"),
        name: "rad/s",
        dph_per_unit: DPH_PER_RADPS,
        walk: "rad/s/√Hz",
    },
];

/// As people write them, and the ending of the headers.
pub const RATE_UNITS: &[(&[&str], &str)] =
    &[ROWS[0].spellings, ROWS[1].spellings, ROWS[2].spellings, ROWS[3].spellings];

impl RateUnit {
    fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }

    /// The unit of headers with this ending, such as `dps`.
    pub fn of_ending(ending: &str) -> Option<Self> {
        ROWS.iter().find(|row| row.spellings.1 == ending).map(|row| row.unit)
    }

    /// The ending of headers and attributes: `dph`, `dps`, `mdps` or `radps`.
    pub fn ending(self) -> &'static str {
        self.row().spellings.1
    }

    /// For people: `°/s`.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// °/h in one of this unit.
    pub fn dph_per_unit(self) -> f64 {
        self.row().dph_per_unit
    }

    /// A rate in this unit.
    pub fn of_dph(self, dph: f64) -> f64 {
        dph / self.dph_per_unit()
    }

    /// A rate of so many significant digits, without its unit.
    pub fn number(self, dph: f64, digits: i32) -> String {
        significant(self.of_dph(dph), digits)
    }

    /// The same with its unit.
    pub fn text(self, dph: f64, digits: i32) -> String {
        format!("{} {}", self.number(dph, digits), self.name())
    }

    /// Value and σ, without their unit.
    pub fn with_sigma(self, dph: f64, sigma_dph: Option<f64>) -> String {
        with_sigma(self.of_dph(dph), sigma_dph.map(|sigma| self.of_dph(sigma)))
    }

    /// The factor and the unit in which a value with the unit of a record or a limit is read: `deg/h per degC`, `deg/rt h`, `°/h/√h`.
    /// Values that are no rates keep theirs.
    pub fn shown(self, of_record: &str) -> (f64, String) {
        let (own, per_unit) = (unit(of_record), self.dph_per_unit());
        match (self, own.strip_prefix("°/h")) {
            (Self::DegPerHour, _) => (1.0, own),
            (_, Some("/√h")) => (1.0 / (60.0 * per_unit), format!("{}/√s", self.name())),
            (_, Some(rest)) => (1.0 / per_unit, format!("{}{rest}", self.name())),
            (_, None) if own == "°/√h" => (60.0 / per_unit, self.row().walk.to_owned()),
            _ => (1.0, own),
        }
    }
}

impl fmt::Display for RateUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.ending())
    }
}

impl FromStr for RateUnit {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let lower = text.trim().to_lowercase();
        let known = ROWS.iter().find(|row| row.spellings.0.contains(&lower.as_str()));
        known.map(|row| row.unit).ok_or_else(|| {
            Error::input("not a unit of rates", "give one of dph, dps, mdps, radps, or °/h, °/s, m°/s, rad/s")
                .value(text)
        })
    }
}

impl TryFrom<String> for RateUnit {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse().map_err(|error: Error| format!("{text:?} is {}: {}", error.what, error.help))
    }
}

impl From<RateUnit> for String {
    fn from(unit: RateUnit) -> Self {
        unit.ending().to_owned()
    }
}

impl JsonSchema for RateUnit {
    fn schema_name() -> Cow<'static, str> {
        "RateUnit".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schemars::json_schema!({
            "type": "string",
            "description": "`dph` (°/h), `dps` (°/s), `mdps` (m°/s) or `radps` (rad/s)."
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed forms: 1 °/s = 3600 °/h, 1 rad = 180/π °, √h = 60 √s.
    #[test]
    fn rates_and_random_walks_convert() {
        let parsed = |text: &str| text.parse::<RateUnit>().unwrap();
        for (text, unit) in [
            ("deg/s", RateUnit::DegPerSecond),
            ("°/s", RateUnit::DegPerSecond),
            ("mdps", RateUnit::MilliDegPerSecond),
            ("rad/s", RateUnit::RadPerSecond),
            ("dph", RateUnit::DegPerHour),
        ] {
            assert_eq!(parsed(text), unit);
            assert_eq!(parsed(unit.ending()), unit);
        }
        assert!("furlong".parse::<RateUnit>().is_err());
        let dps = RateUnit::DegPerSecond;
        assert_eq!(dps.text(1800.0, 3), "0.500 °/s");
        assert_eq!(dps.with_sigma(3600.0, Some(36.0)), "1.000 ± 0.010");
        let close = |(factor, name): (f64, String), value: f64, wanted: &str| {
            assert!((factor / value - 1.0).abs() < 1e-12 && name == wanted, "{factor} {name}");
        };
        close(dps.shown("deg/h per degC/min"), 1.0 / 3600.0, "°/s per °C/min");
        close(dps.shown("deg/rt h"), 1.0 / 60.0, "°/s/√Hz");
        close(dps.shown("°/h/√h"), 1.0 / 216_000.0, "°/s/√s");
        close(RateUnit::RadPerSecond.shown("deg/rt h"), std::f64::consts::PI / 180.0 / 60.0, "rad/s/√Hz");
        close(dps.shown("ppm"), 1.0, "ppm");
        close(RateUnit::DegPerHour.shown("deg/rt h"), 1.0, "°/√h");
    }
}
