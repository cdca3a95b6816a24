//! What each column of a log is, from its header.

use std::collections::{BTreeMap, HashSet};

use crate::error::{Error, Result};
use crate::ingest::columns::number::{ISO_8601, SPREADSHEET_DAYS};
use crate::setup::RateUnit;
use sagnac_units::KELVIN_AT_0_C;
use sagnac_units::format::controls;

/// Header prefix of the program's own compensated output.
pub const COMPENSATED_PREFIX: &str = "compensated_";

/// First words of the comment that `sagnac compensate` puts above its output.
pub const COMPENSATED_STAMP: &str = "# sagnac compensated";

/// Recognised forms, for messages.
pub const RECOGNISED: &str = "time_s|_ms|_us|_ns, time or timestamp (ISO 8601), temperature_c|_k[_name], counts[_x|_y|_z], \
     rate_dph|_dps|_mdps|_radps[_x|_y|_z], reference_rate_dps or table_angle_deg or table_mark, valid, aux_name";

/// Every recognised header and what its column holds, for the manual.
pub const HEADERS: [(&str, &str); 11] = [
    (
        "time_s, time_ms, time_us, time_ns",
        "end of the row's interval; without it there is one window per row and no rate term",
    ),
    (
        "time, timestamp, datetime",
        "the same as a date of ISO 8601, such as 2024-02-29T12:00:05.5Z, or 29.02.2024 12:00:05; read where no column of the line above is there",
    ),
    ("time_excel", "the same in days since 1899-12-30, as spreadsheets store dates: 45351.5; to about 0.1 ms"),
    ("temperature_c[_name], temperature_k[_name]", "a thermometer, in °C or K"),
    ("counts[_x, _y, _z]", "counts of the row, or a running total with `counter = \"cumulative\"`"),
    ("rate_dph, rate_dps, rate_mdps, rate_radps [_x, _y, _z]", "mean rate of the row in °/h, °/s, m°/s or rad/s"),
    ("reference_rate_dps", "rate of the table under the gyro, °/s"),
    (
        "table_angle_deg",
        "angle of the table, °, instead of its rate; it may wrap at 360, and changes by less than 180 in a row",
    ),
    (
        "table_mark",
        "1 in the row in which the table completed a revolution, −1 for a backward one, otherwise 0, instead of its rate",
    ),
    ("valid", "1, true, ok, yes or 0, false, no: flagged rows are excluded"),
    ("aux_name", "any number that the correction may depend on: a voltage, a current, a mode"),
];

/// Columns that identify a table of windows, even if another program rewrote it.
const WINDOW_TABLE: [&str; 4] = ["run", "start_ns", "duration_ns", "first_line"];
/// Words that mark a header as a time.
const TIME_WORDS: [&str; 9] = ["time", "timestamp", "datetime", "date", "utc", "epoch", "clock", "gpstime", "unixtime"];
/// Words that may mark a time.
const MORE_TIME_WORDS: [&str; 8] = ["t", "s", "sec", "seconds", "elapsed", "hours", "minutes", "tow"];
/// Most thermometers of a log.
const MAX_THERMOMETERS: usize = 32;
/// Most auxiliary columns of a log.
const MAX_AUX: usize = 256;

/// Content of a column of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Whole nanoseconds.
    Nanoseconds,
    /// A number.
    Number,
    /// Anything.
    Text,
}

/// Quantity in the column of a rate table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableColumn {
    /// Its rate, °/s.
    Rate,
    /// Its angle, degrees.
    Angle,
    /// Completed revolutions.
    Mark,
}

/// What a column is.
#[derive(Clone, Debug, PartialEq)]
pub enum Role {
    /// Time; decimal places to nanoseconds (9 for seconds), `u32::MAX` for dates of ISO 8601.
    Time {
        /// Power of ten from the column's unit to ns.
        places: u32,
    },
    /// Temperature: °C = value − `zero`.
    Temperature {
        /// Name, empty if the header has none.
        name: String,
        /// 0 for °C, 273.15 for K.
        zero: f64,
    },
    /// Counts of an axis.
    Counts {
        /// Axis letter if the header has one.
        axis: Option<char>,
    },
    /// Rate of an axis.
    Rate {
        /// Axis letter if the header has one.
        axis: Option<char>,
        /// °/h per unit.
        dph_per_unit: f64,
    },
    /// Motion of the rate table.
    Reference(TableColumn),
    /// 1 or true: the row is good.
    Valid,
    /// Any number to be carried along.
    Aux {
        /// Its name.
        name: String,
    },
    /// Not read.
    Ignored,
}

/// The role of one header.
///
/// # Errors
/// A known quantity with an unknown unit or axis; a header of our own compensated output.
pub fn role_of(header: &str) -> Result<Role> {
    let lower = header.trim().to_ascii_lowercase();
    if lower.starts_with(COMPENSATED_PREFIX) {
        return Err(already_compensated().column(header));
    }
    let (quantity, rest) = lower.split_once('_').unwrap_or((&lower, ""));
    let role = match quantity {
        "time" => time_role(header, rest),
        // Other times may be of another clock or have another meaning.
        "timestamp" | "datetime" => Ok(time_role(header, rest).unwrap_or(Role::Ignored)),
        "temperature" => temperature_role(header, rest),
        "counts" => Ok(Role::Counts { axis: axis_of(header, rest)? }),
        "rate" => rate_role(header, rest),
        "reference" if rest == "rate_dps" => Ok(Role::Reference(TableColumn::Rate)),
        "table" if rest == "angle_deg" => Ok(Role::Reference(TableColumn::Angle)),
        "table" if rest == "mark" => Ok(Role::Reference(TableColumn::Mark)),
        "reference" => Err(unknown_unit(header, rest, "rate_dps")),
        "valid" if rest.is_empty() => Ok(Role::Valid),
        "aux" if !rest.is_empty() => Ok(Role::Aux { name: rest.to_owned() }),
        _ => Ok(Role::Ignored),
    };
    if lower.contains(controls) && !matches!(role, Ok(Role::Ignored)) {
        return Err(
            Error::input("a header contains control characters", "rename the column in the file").column(header)
        );
    }
    role
}

/// The error for a log that Sagnac has already corrected.
pub fn already_compensated() -> Error {
    Error::refused(
        "this log is already compensated, and correcting it twice would be wrong",
        "give the log before `sagnac compensate`",
    )
}

/// The error for a table of windows instead of a log.
pub fn table_of_windows() -> Error {
    Error::input(
        "this is a table of windows, not a log",
        "give the logs of this table: sagnac calibrate run1.csv -o unit.cal.json",
    )
}

fn time_role(header: &str, unit: &str) -> Result<Role> {
    let places = match unit {
        "s" => 9,
        "ms" => 6,
        "us" => 3,
        "ns" => 0,
        "" | "iso" | "iso8601" | "utc" => ISO_8601,
        "excel" => SPREADSHEET_DAYS,
        _ => return Err(unknown_unit(header, unit, "s, ms, us, ns, excel, or none for dates of ISO 8601")),
    };
    Ok(Role::Time { places })
}

fn temperature_role(header: &str, rest: &str) -> Result<Role> {
    let (unit, name) = rest.split_once('_').unwrap_or((rest, ""));
    let zero = match unit {
        "c" => 0.0,
        "k" => KELVIN_AT_0_C,
        _ => return Err(unknown_unit(header, unit, "c, k")),
    };
    Ok(Role::Temperature { name: name.to_owned(), zero })
}

fn rate_role(header: &str, rest: &str) -> Result<Role> {
    let (unit, axis) = rest.split_once('_').unwrap_or((rest, ""));
    let unit = RateUnit::of_ending(unit).ok_or_else(|| unknown_unit(header, unit, "dph, dps, mdps, radps"))?;
    Ok(Role::Rate { axis: axis_of(header, axis)?, dph_per_unit: unit.dph_per_unit() })
}

fn unknown_unit(header: &str, unit: &str, known: &str) -> Error {
    Error::input(
        format!("unknown unit {unit:?}, known units: {known}"),
        "rename the header, or map it under [columns] in the setup",
    )
    .column(header)
}

fn axis_of(header: &str, text: &str) -> Result<Option<char>> {
    let mut letters = text.chars();
    match (letters.next(), letters.next()) {
        (None, _) => Ok(None),
        (Some(axis), None) if axis.is_ascii_alphanumeric() => Ok(Some(axis)),
        _ => Err(Error::input(
            "the axis in a header must be one letter after the last underscore",
            "rename the header, such as counts_x",
        )
        .column(header)),
    }
}

/// A log's columns by role, with the index of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// Headers as in the log.
    pub headers: Vec<String>,
    /// Column and decimal places of the time (`u32::MAX`: dates of ISO 8601), if there is one.
    pub time: Option<(usize, u32)>,
    /// Column, name and zero of each thermometer.
    pub temperatures: Vec<(usize, String, f64)>,
    /// Column, axis letter and °/h per unit (`None`: counts) of each axis.
    pub axes: Vec<(usize, char, Option<f64>)>,
    /// Column of the reference rate.
    pub reference: Option<(usize, TableColumn)>,
    /// Column of the validity flag.
    pub valid: Option<usize>,
    /// Column and name of auxiliary numbers.
    pub aux: Vec<(usize, String)>,
    /// Headers that are not read.
    pub ignored: Vec<String>,
}

impl Layout {
    /// Gives every header its role, through the setup's `[columns]`.
    ///
    /// # Errors
    /// Duplicate headers or roles, unknown units, a mapped header that is not there, no axis.
    pub fn new(headers: Vec<String>, columns: &BTreeMap<String, String>, axis: Option<char>) -> Result<Self> {
        let mut layout = Self { headers, ..Self::default() };
        if WINDOW_TABLE.iter().all(|name| layout.headers.iter().any(|header| header == name)) {
            return Err(table_of_windows());
        }
        if let Some(missing) = columns.keys().find(|name| !layout.headers.contains(name)) {
            return Err(Error::input(
                format!("[columns] maps {missing:?}, and the log has no such header"),
                format!("correct the name. The log has: {}", layout.headers.join(", ")),
            ));
        }
        let mut seen = HashSet::new();
        for (index, header) in layout.headers.clone().iter().enumerate() {
            // A column without a name is not read, and there may be several.
            if !header.is_empty() && !seen.insert(header.as_str()) {
                return Err(
                    Error::input("duplicate column", "rename or remove one of the two in the file").column(header)
                );
            }
            let role = match columns.get(header) {
                Some(name) => match role_of(name)? {
                    Role::Ignored if name != "ignore" => {
                        return Err(Error::input(
                            format!("[columns] maps this column to an unknown header, {name:?}"),
                            format!("map it to one of these: {RECOGNISED}, ignore"),
                        )
                        .column(header));
                    }
                    role => role,
                },
                None => role_of(header)?,
            };
            layout.place(index, header, role, axis.unwrap_or('x'))?;
        }
        layout.check()?;
        Ok(layout)
    }

    fn place(&mut self, index: usize, header: &str, role: Role, default_axis: char) -> Result<()> {
        let twice = || {
            Error::input(
                "a second column of the same kind",
                format!("map one of them under [columns]: {header:?} = \"ignore\""),
            )
            .column(header)
        };
        match role {
            Role::Time { places } => self.place_time(index, header, places).ok_or_else(twice)?,
            Role::Reference(column) if self.reference.is_none() => self.reference = Some((index, column)),
            Role::Valid if self.valid.is_none() => self.valid = Some(index),
            Role::Reference(_) | Role::Valid => return Err(twice()),
            Role::Temperature { name, zero } => {
                if self.temperatures.iter().any(|(_, other, _)| *other == name) {
                    return Err(twice());
                }
                self.temperatures.push((index, name, zero));
            }
            Role::Counts { axis } => self.place_axis(index, axis.unwrap_or(default_axis), None).ok_or_else(twice)?,
            Role::Rate { axis, dph_per_unit } => {
                self.place_axis(index, axis.unwrap_or(default_axis), Some(dph_per_unit)).ok_or_else(twice)?;
            }
            Role::Aux { name } => self.aux.push((index, name)),
            // Nothing to name, and nothing to map.
            Role::Ignored if header.is_empty() => {}
            Role::Ignored => self.ignored.push(header.to_owned()),
        }
        Ok(())
    }

    /// Of a column of numbers and one of dates the numbers are read.
    fn place_time(&mut self, index: usize, header: &str, places: u32) -> Option<()> {
        match self.time {
            None => self.time = Some((index, places)),
            Some((_, known)) if known != ISO_8601 && places == ISO_8601 => self.ignored.push(header.to_owned()),
            Some((dates, ISO_8601)) if places != ISO_8601 => {
                self.ignored.push(self.headers[dates].clone());
                self.time = Some((index, places));
            }
            Some(_) => return None,
        }
        Some(())
    }

    /// True where the time column holds dates of ISO 8601.
    pub fn has_dates(&self) -> bool {
        self.time.is_some_and(|(_, places)| places == ISO_8601)
    }

    /// In a log without a time column: an unread, unmapped header that looks like one. Names such as `t_s` count only if
    /// `nothing_else` gives the length of a row.
    pub(crate) fn unread_time(&self, columns: &BTreeMap<String, String>, nothing_else: bool) -> Option<&str> {
        let looks = |header: &&String| {
            let lower = header.to_ascii_lowercase();
            let mut words = lower.split(|c: char| !c.is_ascii_alphabetic()).filter(|word| !word.is_empty());
            let first = words.clone().next().unwrap_or_default();
            words.any(|word| TIME_WORDS.contains(&word)) || (nothing_else && MORE_TIME_WORDS.contains(&first))
        };
        let open = |header: &&String| self.time.is_none() && !columns.contains_key(*header);
        self.ignored.iter().filter(open).find(looks).map(String::as_str)
    }

    fn place_axis(&mut self, index: usize, axis: char, dph_per_unit: Option<f64>) -> Option<()> {
        if self.axes.iter().any(|(_, other, _)| *other == axis) {
            return None;
        }
        self.axes.push((index, axis, dph_per_unit));
        Some(())
    }

    fn check(&self) -> Result<()> {
        if self.temperatures.len() > MAX_THERMOMETERS || self.aux.len() > MAX_AUX {
            return Err(Error::input(
                format!("more than {MAX_THERMOMETERS} thermometers or {MAX_AUX} auxiliary columns"),
                "map unneeded columns to \"ignore\" under [columns]",
            ));
        }
        if self.axes.is_empty() {
            return Err(Error::input(
                "no column of counts or rates",
                format!(
                    "run `sagnac init LOG -o bench.toml`, and map its columns under [columns]. The log has: {}. Known headers: {RECOGNISED}",
                    self.headers.join(", ")
                ),
            ));
        }
        if self.axes.iter().any(|a| a.2.is_none()) && self.axes.iter().any(|a| a.2.is_some()) {
            return Err(Error::input(
                "the log contains both counts and rates",
                "map one of them to \"ignore\" under [columns]",
            ));
        }
        Ok(())
    }

    /// Columns that are read, in the order of the file.
    pub fn columns_read(&self) -> Vec<usize> {
        let time = self.time.iter().map(|(index, _)| *index);
        let temperatures = self.temperatures.iter().map(|(index, ..)| *index);
        let axes = self.axes.iter().map(|(index, ..)| *index);
        let others = self.reference.iter().map(|(index, _)| *index).chain(self.valid);
        let mut all: Vec<usize> = time
            .chain(temperatures)
            .chain(axes)
            .chain(others)
            .chain(self.aux.iter().map(|(index, _)| *index))
            .collect();
        all.sort_unstable();
        all
    }

    /// Content of a column.
    pub fn content_of(&self, index: usize) -> Content {
        let read = self.columns_read().contains(&index) && self.valid != Some(index);
        match self.time {
            Some((time, 0)) if time == index => Content::Nanoseconds,
            Some((time, _)) if time == index && self.has_dates() => Content::Text,
            _ if read => Content::Number,
            _ => Content::Text,
        }
    }

    /// True for counts, false for rates.
    pub fn is_count_log(&self) -> bool {
        self.axes.iter().all(|(_, _, unit)| unit.is_none())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(headers: &[&str]) -> Result<Layout> {
        Layout::new(headers.iter().map(ToString::to_string).collect(), &BTreeMap::new(), None)
    }

    #[test]
    fn recognises_the_documented_headers() {
        let l = layout(&["time_ms", "Temperature_C_block", "temperature_k", "counts_y", "valid", "aux_volts", "note"])
            .unwrap();
        assert_eq!(l.time, Some((0, 6)));
        assert_eq!(l.temperatures, [(1, "block".to_owned(), 0.0), (2, String::new(), 273.15)]);
        assert_eq!(l.axes, [(3, 'y', None)]);
        assert_eq!((l.valid, l.aux, l.ignored), (Some(4), vec![(5, "volts".to_owned())], vec!["note".to_owned()]));
    }

    #[test]
    fn refuses_unknown_units_duplicates_and_mixtures() {
        for headers in [
            ["temperature_f", "counts"],
            ["counts", "counts"],
            ["counts", "rate_dps"],
            ["time_s", "time_ms"],
            ["a", "b"],
        ] {
            assert!(layout(&headers).is_err(), "{headers:?}");
        }
        assert_eq!(layout(&["compensated_counts", "time_s"]).unwrap_err().kind, crate::ErrorKind::Refused);
    }
}
