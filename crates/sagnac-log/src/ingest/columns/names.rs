//! Headers as people write them: `Gyro X (deg/s)` is `rate_dps_x`, `Chip temp [°C]` is `temperature_c_chip`.
//!
//! A header is recognised where its words name a quantity and a unit is stated: in brackets, in a line of units, or as a word (`gyro_x_dps`).
//! A quantity that one column names as Sagnac does is not looked for in the others. Of two columns that may be the same thermometer
//! neither is recognised; where two may be one rate, no rate is. Words are English, German, French and Spanish.

use std::collections::BTreeMap;

use crate::ingest::columns::header::{Role, role_of};
use crate::ingest::columns::iso::iso_ns;
pub use crate::setup::RATE_UNITS;

/// Words for a time.
pub const TIME: [&str; 10] =
    ["time", "zeit", "temps", "tiempo", "timestamp", "elapsed", "clock", "datetime", "date", "datum"];
/// Words for a thermometer.
pub const TEMPERATURE: [&str; 10] =
    ["temperature", "temp", "temperatur", "température", "temperatura", "tmp", "thermo", "thermometer", "rtd", "pt100"];
/// Words for a rate.
pub const RATE: [&str; 8] = ["rate", "gyro", "omega", "drehrate", "gyr", "angrate", "vitesse", "velocidad"];
/// Words that make a rate one of a table or a command.
const NO_GYRO: [&str; 9] = ["table", "tisch", "reference", "ref", "input", "command", "cmd", "target", "setpoint"];
/// Letters of axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Units as people write them, and the ending of Sagnac's header.
pub type UnitSpellings = [(&'static [&'static str], &'static str)];
/// Of a time.
pub const TIME_UNITS: &UnitSpellings = &[
    (&["s", "sec", "secs", "second", "seconds", "sek", "sekunden"], "s"),
    (&["ms", "msec", "millisecond", "milliseconds"], "ms"),
    (&["us", "µs", "μs", "usec", "microseconds"], "us"),
    (&["ns", "nsec", "nanoseconds"], "ns"),
];
/// Of a temperature.
pub const TEMPERATURE_UNITS: &UnitSpellings =
    &[(&["c", "°c", "degc", "deg c", "deg. c", "celsius", "grad c"], "c"), (&["k", "kelvin"], "k")];
/// Of counts.
pub(crate) const COUNT_UNITS: &UnitSpellings = &[(&["counts", "count", "cts", "pulses", "pulse", "1", "-", ""], "")];

/// The words of a header in small letters, and the unit in its brackets.
pub fn words_of(header: &str) -> (Vec<String>, Option<String>) {
    let (name, rest) = header.split_once(['(', '[']).unwrap_or((header, ""));
    let unit = rest.trim_end_matches([')', ']']).trim();
    let lower = name.to_lowercase();
    let words = lower.split(|c: char| !c.is_alphanumeric() && c != '°').filter(|word| !word.is_empty());
    (words.map(str::to_owned).collect(), (!unit.is_empty()).then(|| unit.to_owned()))
}

/// The unit as it is stated in brackets, a line of units or a word of the name, by a table of spellings.
pub fn stated(unit: Option<&str>, words: &[String], known: &UnitSpellings) -> Option<&'static str> {
    let find = |text: &str| ending_of(text, known);
    // A stated unit that is not known is not overruled by a word of the name.
    match unit {
        Some(unit) => find(unit),
        None => words.iter().skip(1).find_map(|word| find(word)),
    }
}

/// The ending of Sagnac's header for a unit.
pub(crate) fn ending_of(unit: &str, known: &UnitSpellings) -> Option<&'static str> {
    let unit = bare(unit);
    known.iter().find(|(names, _)| names.contains(&unit.as_str())).map(|(_, ending)| *ending)
}

/// A unit as it is compared: without brackets, in small letters.
pub(crate) fn bare(unit: &str) -> String {
    unit.to_lowercase().trim_matches(['[', ']', '(', ')']).trim().to_owned()
}

/// Whether the first word is `gx` or `wx` in a unit of rates, which makes it a rate (without the unit it may be an acceleration), and the
/// axis of a rate or a count among the words of its header, as the ending `_x`; empty where there is none.
pub fn axis_of(unit: Option<&str>, words: &[String]) -> (bool, String) {
    let first = words.first().map_or("", String::as_str);
    let by_letter = first.strip_prefix(['g', 'w']).filter(|axis| AXES.contains(axis));
    let by_letter = by_letter.filter(|_| stated(unit, words, RATE_UNITS).is_some());
    let axis = by_letter.or_else(|| words.iter().map(String::as_str).find(|word| AXES.contains(word)));
    (by_letter.is_some(), axis.map_or(String::new(), |axis| format!("_{axis}")))
}

/// The name of a thermometer: the words that are neither a quantity nor a unit, as the ending `_chamber`.
pub fn thermometer_of(words: &[String]) -> String {
    let is_plain = |word: &&String| {
        word.as_str() != "t"
            && !TEMPERATURE.contains(&word.as_str())
            && !TEMPERATURE_UNITS.iter().any(|(names, _)| names.contains(&word.as_str()))
    };
    let name: Vec<&str> = words.iter().filter(is_plain).map(String::as_str).collect();
    if name.is_empty() { String::new() } else { format!("_{}", name.join("_")) }
}

/// Sagnac's header for a column whose header states quantity and unit, or whose first cell is a date.
fn certain(header: &str, unit: Option<&str>, cell: Option<&str>) -> Option<String> {
    let (words, bracket) = words_of(header);
    let unit = unit.map(str::to_owned).or(bracket);
    let unit = unit.as_deref();
    let has = |names: &[&str]| words.iter().any(|word| names.contains(&word.as_str()));
    let is_t = words.first().is_some_and(|word| word == "t");
    let time = stated(unit, &words, TIME_UNITS);
    if has(&TIME) || is_t && time.is_some() {
        let is_date = cell.is_some_and(|cell| iso_ns(cell).is_some());
        return if is_date { Some("time".to_owned()) } else { Some(format!("time_{}", time?)) };
    }
    if has(&TEMPERATURE) || is_t {
        let ending = stated(unit, &words, TEMPERATURE_UNITS)?;
        return Some(format!("temperature_{ending}{}", thermometer_of(&words)));
    }
    let (by_letter, axis) = axis_of(unit, &words);
    let is_gyro = (has(&RATE) || by_letter) && !has(&NO_GYRO);
    let ending = stated(unit, &words, RATE_UNITS).filter(|_| is_gyro)?;
    Some(format!("rate_{ending}{axis}"))
}

/// Quantities of which a log may have named a column already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    Time,
    Thermometer,
    Axis,
}

fn quantity_of(header: &str) -> Option<Quantity> {
    match role_of(header).ok()? {
        Role::Time { .. } => Some(Quantity::Time),
        Role::Temperature { .. } => Some(Quantity::Thermometer),
        Role::Counts { .. } | Role::Rate { .. } => Some(Quantity::Axis),
        _ => None,
    }
}

/// True for a header whose words state an axis and the unit of its rate.
pub(crate) fn is_rate(header: &str) -> bool {
    certain(header, None, None).is_some_and(|role| quantity_of(&role) == Some(Quantity::Axis))
}

/// Sagnac's header of each column that is recognised. `units` and `cells` are the line of units and the first row, empty where there is none;
/// `columns` is the setup's map.
pub fn recognised(
    headers: &[String],
    units: &[String],
    cells: &[String],
    columns: &BTreeMap<String, String>,
) -> Vec<Option<String>> {
    let named = |header: &String| quantity_of(columns.get(header).unwrap_or(header));
    let known: Vec<Quantity> = headers.iter().filter_map(named).collect();
    let is_free = |header: &str| {
        !columns.contains_key(header) && matches!(role_of(header), Ok(Role::Ignored)) && !header.is_empty()
    };
    let one = |(at, header): (usize, &String)| {
        let unit = units.get(at).map(String::as_str).filter(|unit| !unit.is_empty());
        let role = is_free(header).then(|| certain(header, unit, cells.get(at).map(String::as_str)))??;
        // An ending that is no letter of an axis, or a control character, is no header of ours.
        quantity_of(&role).is_some_and(|quantity| !known.contains(&quantity)).then_some(role)
    };
    let all: Vec<Option<String>> = headers.iter().enumerate().map(one).collect();
    // Of several times the first is read; which of two rates or thermometers is meant, no header says.
    let is_first_time = |at: usize| !all[..at].iter().flatten().any(|role| quantity_of(role) == Some(Quantity::Time));
    let is_alone = |role: &String| all.iter().flatten().filter(|other| same_place(other, role)).count() == 1;
    // A log read without one of its axes would look whole: where one is open, all are.
    let is_rate = |role: &&String| quantity_of(role) == Some(Quantity::Axis);
    let are_rates_clear = all.iter().flatten().filter(is_rate).all(is_alone);
    let keep = |(at, role): (usize, &Option<String>)| {
        let role = role.clone()?;
        let is_kept = match quantity_of(&role)? {
            Quantity::Time => is_first_time(at),
            Quantity::Thermometer => is_alone(&role),
            Quantity::Axis => are_rates_clear,
        };
        is_kept.then_some(role)
    };
    all.iter().enumerate().map(keep).collect()
}

/// The setup's map of columns with the recognised headers, and those as `Gyro X (deg/s) as rate_dps_x`.
pub(crate) fn mapped(
    headers: &[String],
    units: &[String],
    cells: &[String],
    columns: &BTreeMap<String, String>,
) -> (BTreeMap<String, String>, Vec<String>) {
    let all = headers.iter().zip(recognised(headers, units, cells, columns));
    let known: Vec<(&String, String)> = all.filter_map(|(header, known)| Some((header, known?))).collect();
    let said = known.iter().map(|(header, known)| format!("{header} as {known}")).collect();
    let recognised = known.into_iter().map(|(header, known)| (header.clone(), known));
    (columns.clone().into_iter().chain(recognised).collect(), said)
}

/// Whether two headers would be one axis or one thermometer.
fn same_place(one: &str, other: &str) -> bool {
    match (role_of(one), role_of(other)) {
        (Ok(Role::Rate { axis: a, .. }), Ok(Role::Rate { axis: b, .. })) => a == b,
        (Ok(Role::Temperature { name: a, .. }), Ok(Role::Temperature { name: b, .. })) => a == b,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(headers: &[&str]) -> Vec<Option<String>> {
        let headers: Vec<String> = headers.iter().map(ToString::to_string).collect();
        recognised(&headers, &[], &[], &BTreeMap::new())
    }

    fn some(roles: &[&str]) -> Vec<Option<String>> {
        roles.iter().map(|role| (!role.is_empty()).then(|| (*role).to_owned())).collect()
    }

    #[test]
    fn quantity_and_unit_make_a_header() {
        assert_eq!(
            read(&["Time (ms)", "Chip temp [°C]", "Gyro X (deg/s)", "gyro_y_dps", "gz_radps", "Accel X (m/s²)"]),
            some(&["time_ms", "temperature_c_chip", "rate_dps_x", "rate_dps_y", "rate_radps_z", ""])
        );
        assert_eq!(read(&["t_s", "T [K]", "Drehrate z [°/h]"]), some(&["time_s", "temperature_k", "rate_dph_z"]));
    }

    #[test]
    fn a_missing_unit_a_table_and_doubles_are_not_recognised() {
        let free = read(&["Gyro X", "Temp", "Time (min)", "Table rate (deg/s)", "Gyro A X (dps)", "Gyro B X (dps)"]);
        assert_eq!(free, some(&["", "", "", "", "", ""]));
        // Without x the log would look like one of y and z.
        assert_eq!(read(&["Gyro X (dps)", "Gyro X raw (dps)", "Gyro Y (dps)"]), some(&["", "", ""]));
        assert_eq!(read(&["Time (s)", "GPS time (s)"]), some(&["time_s", ""]));
    }

    #[test]
    fn a_quantity_with_a_header_of_ours_is_not_looked_for() {
        let all = read(&["time_s", "counts", "gyro_dps", "board_temp_c", "Elapsed (s)"]);
        assert_eq!(all, some(&["", "", "", "temperature_c_board", ""]));
    }
}
