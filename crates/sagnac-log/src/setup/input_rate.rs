//! What turned each axis during a test, °/h: stated, or the Earth by site and attitude.
//!
//! ```text
//! Ω sin φ up, −Ω sin φ down, Ω cos φ north, −Ω cos φ south, 0 east and west      φ the latitude, Ω = 15.041 °/h
//! ```
//!
//! A bare value is of the only axis of a log. Where a log has several, each needs its own: one direction cannot be that of all. A bare
//! 0 is of every axis: the gyro is at rest, and the Earth rate does not matter to it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use sagnac_units::EARTH_RATE_DPH;

/// A value of the only axis, or one of each axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "PerAxis_{T}")]
#[serde(
    untagged,
    expecting = "needs one value, or one of each axis as in { x = …, y = …, z = … }: rates are numbers, directions up, down, north, south, east or west"
)]
pub enum PerAxis<T> {
    /// Of a log with one axis.
    Only(T),
    /// Letters of the axes, and the value of each.
    Each(BTreeMap<char, T>),
}

impl PerAxis<f64> {
    /// The value of an axis of a log with so many axes; `None` where it has none.
    pub fn of(&self, axis: char, axes: usize) -> Option<f64> {
        match self {
            Self::Only(value) => (axes == 1 || *value == 0.0).then_some(*value),
            Self::Each(values) => values.get(&axis).copied(),
        }
    }
}

impl<T: Copy> PerAxis<T> {
    /// All of them.
    pub(super) fn values(&self) -> impl Iterator<Item = T> + '_ {
        let (only, each) = match self {
            Self::Only(value) => (Some(*value), None),
            Self::Each(values) => (None, Some(values.values().copied())),
        };
        only.into_iter().chain(each.into_iter().flatten())
    }

    /// It can be of a log with these axes.
    pub(super) fn check_log(&self, letters: &[char]) -> Result<()> {
        let have: Vec<String> = letters.iter().map(char::to_string).collect();
        let refused = |what: String| {
            let each: Vec<String> = have.iter().map(|axis| format!("{axis} = …")).collect();
            Err(Error::input(
                what,
                format!(
                    "give the rate of each known axis: input_rate_dph = {{ {} }}, 0 for all, or axis_direction in [earth]",
                    each.join(", ")
                ),
            )
            .column("input_rate_dph"))
        };
        match self {
            Self::Only(_) if letters.len() > 1 => {
                refused(format!("one input rate cannot be that of the axes {}", have.join(", ")))
            }
            // A setup may serve the logs of three axes, each of one; a log of several has every axis that it states.
            Self::Each(values) => {
                let unknown: Vec<String> =
                    values.keys().filter(|axis| !letters.contains(axis)).map(char::to_string).collect();
                if unknown.is_empty() || letters.len() == 1 && unknown.len() < values.len() {
                    return Ok(());
                }
                refused(format!("input rates of {}, but the log has {}", unknown.join(", "), have.join(", ")))
            }
            _ => Ok(()),
        }
    }

    fn map<U>(&self, convert: impl Fn(T) -> U) -> PerAxis<U> {
        match self {
            Self::Only(value) => PerAxis::Only(convert(*value)),
            Self::Each(values) => PerAxis::Each(values.iter().map(|(axis, value)| (*axis, convert(*value))).collect()),
        }
    }

    /// Axes are letters or digits, and there is one at least.
    pub(super) fn check(&self, key: &str) -> Result<()> {
        let Self::Each(values) = self else { return Ok(()) };
        if let Some(axis) = values.keys().find(|axis| !axis.is_ascii_alphanumeric()) {
            return Err(Error::input(
                "an axis is one letter or digit",
                "write it like input_rate_dph = { x = 7.5, y = 0 }",
            )
            .column(key)
            .value(axis.to_string()));
        }
        if values.is_empty() {
            return Err(Error::input("the table names no axis", format!("remove {key} if the values are not known"))
                .column(key));
        }
        Ok(())
    }
}

impl<T> From<T> for PerAxis<T> {
    fn from(only: T) -> Self {
        Self::Only(only)
    }
}

/// As on a command line: `4.498`, or `x=0,y=14.35,z=4.498`.
impl FromStr for PerAxis<f64> {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let number = |text: &str| {
            let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
            value
                .ok_or_else(|| Error::input(format!("{text:?} is not a rate in °/h"), "write one rate, or x=…,y=…,z=…"))
        };
        if !text.contains('=') {
            return number(text).map(Self::Only);
        }
        let mut values = BTreeMap::new();
        for part in text.split(',') {
            let named = part.split_once('=').and_then(|(axis, value)| Some((axis.trim().parse::<char>().ok()?, value)));
            let (axis, value) = named
                .ok_or_else(|| Error::input(format!("{part:?} names no axis"), "write one rate, or x=…,y=…,z=…"))?;
            if values.insert(axis, number(value)?).is_some() {
                return Err(Error::input("the same axis twice", "give each axis once").value(axis.to_string()));
            }
        }
        Ok(Self::Each(values))
    }
}

/// Where an input axis points, for the Earth rate it sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Away from the Earth's centre.
    Up,
    /// Towards it.
    Down,
    /// Along the horizon to true north.
    North,
    /// Along the horizon to true south.
    South,
    /// Along the horizon to the east: sees no Earth rate.
    East,
    /// Along the horizon to the west: sees no Earth rate.
    West,
}

/// Site and attitude of a static test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Earth {
    /// Geodetic latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Where the input axis points; of a log with several axes, where each does: `{ x = "north", y = "west", z = "up" }`.
    pub axis_direction: PerAxis<Direction>,
}

impl Earth {
    /// Input rate of each axis in °/h: Ω sin φ up, Ω cos φ north.
    pub fn rate_dph(&self) -> PerAxis<f64> {
        let (sin, cos) = self.latitude_deg.to_radians().sin_cos();
        self.axis_direction.map(|direction| {
            EARTH_RATE_DPH
                * match direction {
                    Direction::Up => sin,
                    Direction::Down => -sin,
                    Direction::North => cos,
                    Direction::South => -cos,
                    Direction::East | Direction::West => 0.0,
                }
        })
    }
}

/// What to write into a setup so that an axis has an input rate.
pub fn input_rate_hint(axis: char, axes: usize) -> String {
    let mut hint = String::from("give input_rate_dph or [earth] in the setup");
    if axes > 1 {
        let _ = write!(hint, ", of each axis: input_rate_dph = {{ {axis} = … }}");
    }
    hint
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::Setup;

    /// Domain notes §1: 4.498 °/h on a vertical axis at 17.4° N.
    #[test]
    fn earth_rate_is_that_of_the_paper() {
        let earth = Earth { latitude_deg: 17.4, axis_direction: Direction::Up.into() };
        let rate = earth.rate_dph();
        assert!((rate.of('x', 1).unwrap() - 4.498).abs() < 5e-4);
        assert_eq!(rate.of('x', 3), None, "one direction is not that of three axes");
    }

    #[test]
    fn each_axis_has_its_own() {
        let toml = "latitude_deg = 17.4\naxis_direction = { x = \"north\", y = \"west\", z = \"down\" }";
        let rate = toml::from_str::<Earth>(toml).unwrap().rate_dph();
        let of = |axis| rate.of(axis, 3).unwrap();
        assert!((of('x') - 14.353).abs() < 5e-4 && of('y') == 0.0 && (of('z') + 4.498).abs() < 5e-4);
        assert_eq!(rate.of('w', 3), None);
        let wrong = toml::from_str::<Earth>("latitude_deg = 1.0\naxis_direction = { x = 3 }").unwrap_err().to_string();
        assert!(wrong.contains("one of each axis"), "{wrong}");
    }

    #[test]
    fn a_log_has_what_is_stated_of_its_axes() {
        let each = |text: &str| text.parse::<PerAxis<f64>>().unwrap();
        let of_log = |stated: &str, else_by: &str, letters: &[char]| {
            let setup = Setup { input_rate_dph: Some(each(stated)), ..Setup::default() };
            setup.input_rates_of_log(Some(&each(else_by)), letters)
        };
        // What a retest does not state is as the calibration had it.
        assert_eq!(of_log("x=1,y=2", "2", &['x']).unwrap(), Some(each("x=1")));
        assert_eq!(of_log("x=1", "x=2,y=3,z=4", &['x', 'y']).unwrap(), Some(each("x=1,y=3")));
        assert_eq!(of_log("1", "2", &['z']).unwrap(), Some(each("z=1")));
        assert_eq!(of_log("x=1", "2", &['x', 'y']).unwrap(), Some(each("x=1")));
        assert_eq!(of_log("0", "2", &['x', 'y']).unwrap(), Some(each("x=0,y=0")));
        let east = Earth { latitude_deg: 17.4, axis_direction: Direction::East.into() };
        let setup = Setup { earth: Some(east), ..Setup::default() };
        assert!(setup.input_rates_of_log(None, &['x', 'y']).is_err(), "two axes of a triad do not both look east");
        for (stated, letters, word) in
            [("1", "xy", "cannot be that of"), ("q=1", "x", "log has x"), ("x=1,Y=1", "xyz", "rates of Y")]
        {
            let letters: Vec<char> = letters.chars().collect();
            assert!(of_log(stated, "2", &letters).unwrap_err().to_string().contains(word), "{stated}");
        }
    }

    #[test]
    fn the_command_line_names_axes() {
        assert_eq!("-4.5".parse::<PerAxis<f64>>().unwrap(), PerAxis::Only(-4.5));
        let each: PerAxis<f64> = "x=0, z=-4.5".parse().unwrap();
        assert_eq!((each.of('x', 2), each.of('z', 2), each.of('y', 3)), (Some(0.0), Some(-4.5), None));
        for wrong in ["", "up", "nan", "x=", "xy=1", "x=1,x=2", "x=1,2"] {
            assert!(wrong.parse::<PerAxis<f64>>().is_err(), "{wrong}");
        }
    }
}
