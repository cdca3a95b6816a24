//! A column of Arrow's types as what a row holds: numbers, times, flags, or text as a CSV of it would have it.
//!
//! `None` stands for a type that cannot be read so; [`has_values`] says beforehand which can.

use arrow_array::cast::AsArray;
use arrow_array::types::{
    DurationMicrosecondType, DurationMillisecondType, DurationNanosecondType, DurationSecondType, Float32Type,
    Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrowPrimitiveType};
use arrow_schema::{DataType, TimeUnit};

use crate::ingest::columns::number::{
    EXACT_POWERS, ISO_8601, SPREADSHEET_DAYS, is_missing, parse_flag, parse_time_ns, parse_value, spreadsheet_ns,
};
use crate::ingest::columns::raw::{Faults, NO_TIME};

/// Powers of ten of the units of Arrow's times to ns.
const UNITS: [(TimeUnit, u32); 4] =
    [(TimeUnit::Second, 9), (TimeUnit::Millisecond, 6), (TimeUnit::Microsecond, 3), (TimeUnit::Nanosecond, 0)];

/// True for a type of which some function here reads values; a column of any other is not decoded.
pub(crate) fn has_values(kind: &DataType) -> bool {
    let is_number = kind.is_integer() || matches!(kind, DataType::Float32 | DataType::Float64);
    is_number || is_text(kind) || matches!(kind, DataType::Boolean | DataType::Timestamp(..) | DataType::Duration(_))
}

fn is_text(kind: &DataType) -> bool {
    matches!(kind, DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View)
}

fn each<T: ArrowPrimitiveType>(column: &dyn Array, take: impl FnMut(Option<T::Native>)) -> Option<()> {
    column.as_primitive_opt::<T>()?.iter().for_each(take);
    Some(())
}

/// A primitive column as numbers.
fn all<T: ArrowPrimitiveType>(column: &dyn Array, number: impl Fn(T::Native) -> f64, out: &mut Vec<f64>) -> Option<()> {
    let column = column.as_primitive_opt::<T>()?;
    if column.null_count() == 0 {
        out.extend(column.values().iter().map(|value| number(*value)));
    } else {
        out.extend(column.iter().map(|value| value.map_or(f64::NAN, &number)));
    }
    Some(())
}

/// Numbers of any width, or text that holds them: NaN for null, NaN and a word for no value, `bad` for anything else but a finite number.
pub(crate) fn numbers(column: &dyn Array, bad: f64, out: &mut Vec<f64>) -> Option<()> {
    let finite = |value: f64| if value.is_infinite() { bad } else { value };
    match column.data_type() {
        DataType::Float64 => all::<Float64Type>(column, finite, out),
        DataType::Float32 => all::<Float32Type>(column, |v| finite(f64::from(v)), out),
        DataType::Int8 => all::<Int8Type>(column, f64::from, out),
        DataType::Int16 => all::<Int16Type>(column, f64::from, out),
        DataType::Int32 => all::<Int32Type>(column, f64::from, out),
        DataType::Int64 => all::<Int64Type>(column, |v| v as f64, out),
        DataType::UInt8 => all::<UInt8Type>(column, f64::from, out),
        DataType::UInt16 => all::<UInt16Type>(column, f64::from, out),
        DataType::UInt32 => all::<UInt32Type>(column, f64::from, out),
        DataType::UInt64 => all::<UInt64Type>(column, |v| v as f64, out),
        kind if is_text(kind) => each_text(column, |text| {
            let given = text.filter(|t| !t.is_empty() && !is_missing(t.trim().as_bytes()));
            out.push(given.map_or(f64::NAN, |t| parse_value(t.as_bytes(), false).unwrap_or(bad)));
        }),
        _ => None,
    }
}

/// Whole numbers exactly.
fn integers(column: &dyn Array, out: &mut dyn FnMut(Option<i128>)) -> Option<()> {
    match column.data_type() {
        DataType::Int8 => each::<Int8Type>(column, |v| out(v.map(i128::from))),
        DataType::Int16 => each::<Int16Type>(column, |v| out(v.map(i128::from))),
        DataType::Int32 => each::<Int32Type>(column, |v| out(v.map(i128::from))),
        DataType::Int64 => each::<Int64Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt8 => each::<UInt8Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt16 => each::<UInt16Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt32 => each::<UInt32Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt64 => each::<UInt64Type>(column, |v| out(v.map(i128::from))),
        _ => None,
    }
}

fn each_text<'a>(column: &'a dyn Array, take: impl FnMut(Option<&'a str>)) -> Option<()> {
    match column.data_type() {
        DataType::Utf8 => column.as_string_opt::<i32>()?.iter().for_each(take),
        DataType::Utf8View => column.as_string_view_opt()?.iter().for_each(take),
        _ => column.as_string_opt::<i64>()?.iter().for_each(take),
    }
    Some(())
}

/// Times in ns: numbers in the unit of the header, Arrow's own times in theirs.
pub(crate) fn times(column: &dyn Array, places: u32, out: &mut Vec<i64>) -> Option<()> {
    // Numbers are never dates, so their power of ten is not needed.
    let scale = |places: u32| 10_i128.pow(places.min(9));
    let whole =
        |value: Option<i128>, places: u32| value.and_then(|v| i64::try_from(v * scale(places)).ok()).unwrap_or(NO_TIME);
    let unit_places = |unit: TimeUnit| UNITS.iter().find(|(u, _)| *u == unit).map_or(0, |(_, places)| *places);
    match column.data_type() {
        DataType::Float64 => {
            let column = column.as_primitive_opt::<Float64Type>()?;
            let time = |value: f64| time_ns_of(value, places).unwrap_or(NO_TIME);
            if column.null_count() == 0 {
                out.extend(column.values().iter().map(|value| time(*value)));
            } else {
                out.extend(column.iter().map(|value| value.map_or(NO_TIME, time)));
            }
            Some(())
        }
        DataType::Float32 => each::<Float32Type>(column, |v| {
            out.push(v.and_then(|v| time_ns_of(f64::from(v), places)).unwrap_or(NO_TIME));
        }),
        kind if is_text(kind) => {
            let time = |text: &str| parse_time_ns(text.as_bytes(), places, false);
            each_text(column, |text| out.push(text.and_then(time).unwrap_or(NO_TIME)))
        }
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => {
            let (unit, own) = (*unit, unit_places(*unit));
            arrow_times(column, unit, &mut |value| out.push(whole(value.map(i128::from), own)))
        }
        _ if places == SPREADSHEET_DAYS => {
            integers(column, &mut |value| out.push(value.and_then(|v| time_ns_of(v as f64, places)).unwrap_or(NO_TIME)))
        }
        _ => integers(column, &mut |value| out.push(whole(value.filter(|_| places != ISO_8601), places))),
    }
}

/// The time of a number, ns: as if written in its shortest decimal form.
fn time_ns_of(value: f64, places: u32) -> Option<i64> {
    if places == SPREADSHEET_DAYS {
        return spreadsheet_ns(value);
    }
    let scaled = value * EXACT_POWERS.get(places as usize)?;
    // Below this the product is within half a nanosecond of the decimal.
    if scaled.abs() < (1_u64 << 50) as f64 {
        return Some((scaled + 0.5_f64.copysign(scaled)) as i64);
    }
    parse_time_ns(value.to_string().as_bytes(), places, false)
}

fn arrow_times(column: &dyn Array, unit: TimeUnit, out: &mut dyn FnMut(Option<i64>)) -> Option<()> {
    let duration = matches!(column.data_type(), DataType::Duration(_));
    match (unit, duration) {
        (TimeUnit::Second, false) => each::<TimestampSecondType>(column, out),
        (TimeUnit::Millisecond, false) => each::<TimestampMillisecondType>(column, out),
        (TimeUnit::Microsecond, false) => each::<TimestampMicrosecondType>(column, out),
        (TimeUnit::Nanosecond, false) => each::<TimestampNanosecondType>(column, out),
        (TimeUnit::Second, true) => each::<DurationSecondType>(column, out),
        (TimeUnit::Millisecond, true) => each::<DurationMillisecondType>(column, out),
        (TimeUnit::Microsecond, true) => each::<DurationMicrosecondType>(column, out),
        (TimeUnit::Nanosecond, true) => each::<DurationNanosecondType>(column, out),
    }
}

/// Rows whose flag is not set.
pub(crate) fn flags(column: &dyn Array, faults: &mut [Faults]) -> Option<()> {
    let mut slots = faults.iter_mut();
    let mut flag = |set: bool| {
        if let Some(fault) = slots.next() {
            *fault = fault.with(Faults::FLAGGED, !set);
        }
    };
    match column.data_type() {
        DataType::Boolean => column.as_boolean_opt()?.iter().for_each(|v| flag(v == Some(true))),
        kind if is_text(kind) => {
            each_text(column, |text| flag(text.and_then(|t| parse_flag(t.as_bytes())).unwrap_or(false)))?;
        }
        _ => {
            let mut values = Vec::new();
            numbers(column, f64::NAN, &mut values)?;
            values.iter().for_each(|value| flag(*value == 1.0));
        }
    }
    Some(())
}

/// A column of a table as times, ns, by the places of its header ([`crate::ingest::header::Role::Time`]); `None` for one that has none, and in the
/// place of a time that is none.
pub fn column_times(column: &dyn Array, places: u32) -> Option<Vec<Option<i64>>> {
    let mut out = Vec::new();
    times(column, places, &mut out)?;
    Some(out.into_iter().map(|time_ns| Some(time_ns).filter(|time_ns| *time_ns != NO_TIME)).collect())
}

/// A column of a table as numbers, NaN where there is none; `None` for one of a type without numbers.
pub fn column_numbers(column: &dyn Array) -> Option<Vec<f64>> {
    let mut out = Vec::new();
    numbers(column, f64::NAN, &mut out)?;
    Some(out)
}

/// A time as a plain decimal in units of 10^`places` ns, exactly; empty for none.
pub fn time_text(time_ns: i64, places: u32) -> String {
    if time_ns == NO_TIME {
        return String::new();
    }
    if places == ISO_8601 {
        return iso_text(time_ns);
    }
    let unit = 10_u64.pow(places);
    let (whole, rest) = (time_ns.unsigned_abs() / unit, time_ns.unsigned_abs() % unit);
    let sign = if time_ns < 0 { "-" } else { "" };
    let fraction = format!("{rest:0width$}", width = places as usize);
    let fraction = fraction.trim_end_matches('0');
    if rest == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") }
}

/// A time as ISO 8601 writes it, in UTC.
fn iso_text(time_ns: i64) -> String {
    chrono::DateTime::from_timestamp_nanos(time_ns).to_rfc3339_opts(chrono::SecondsFormat::AutoSi, true)
}

/// Bytes of text in each row of a column; none of another type.
pub(crate) fn text_bytes(column: &dyn Array) -> Vec<usize> {
    let mut bytes = Vec::new();
    if is_text(column.data_type()) {
        each_text(column, |text| bytes.push(text.map_or(0, str::len)));
    }
    bytes
}

/// Every row as text, empty for null.
pub(crate) fn texts(column: &dyn Array) -> Option<Vec<String>> {
    let mut out = Vec::with_capacity(column.len());
    match column.data_type() {
        kind if is_text(kind) => each_text(column, |text| out.push(text.unwrap_or("").to_owned()))?,
        DataType::Boolean => {
            let text = |v: Option<bool>| v.map_or(String::new(), |v| v.to_string());
            out.extend(column.as_boolean_opt()?.iter().map(text));
        }
        DataType::Float64 | DataType::Float32 => {
            let mut values = Vec::new();
            numbers(column, f64::INFINITY, &mut values)?;
            let text = |value: &f64| if value.is_nan() { String::new() } else { value.to_string() };
            out.extend(values.iter().map(text));
        }
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => {
            arrow_times(column, *unit, &mut |v| out.push(v.map_or(String::new(), |v| v.to_string())))?;
        }
        _ => integers(column, &mut |value| out.push(value.map_or(String::new(), |v| v.to_string())))?,
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_the_time_that_its_text_is() {
        for value in [0.01, 1234.56, -0.5, 2.0 / 3.0, 1_700_000_000.01, 4.2e6, 1e-9, 86_399.999_999] {
            let text: String = format!("{value}");
            assert_eq!(time_ns_of(value, 9), parse_time_ns(text.as_bytes(), 9, false), "{text}");
        }
        assert_eq!(time_ns_of(f64::NAN, 9), None);
        assert_eq!(time_ns_of(1e300, 9), None);
        assert_eq!(time_ns_of(45_292.0, SPREADSHEET_DAYS), parse_time_ns(b"2024-01-01T00:00:00Z", ISO_8601, false));
    }
}
