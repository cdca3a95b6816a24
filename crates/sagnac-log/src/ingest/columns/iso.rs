//! Times as ISO 8601 writes them: `2024-02-29T12:00:00.5Z`, `2024-02-29 12:00:00+01:00`, `20240229T120000`.
//!
//! A time without an offset is read as UTC: only differences within a log matter. A leap second is read as the second after it.

use chrono::{NaiveDate, NaiveTime};

/// With points the day comes first. With slashes only the year tells the order: 03/04/2024 has two meanings and is none.
const DATES: [&str; 4] = ["%Y-%m-%d", "%Y%m%d", "%Y/%m/%d", "%d.%m.%Y"];
const TIMES: [&str; 3] = ["%H:%M:%S%.f", "%H:%M", "%H%M%S%.f"];

/// A date with a time as ns since 1970, to the nanosecond; `None` for anything else.
pub(crate) fn iso_ns(text: &str) -> Option<i64> {
    let (date, clock) = text.trim().split_once(['T', 't', ' '])?;
    let (clock, offset_s) = with_offset(clock.trim_start())?;
    let date = DATES.iter().find_map(|format| NaiveDate::parse_from_str(date, format).ok())?;
    let clock = clock.replace(',', ".");
    let clock = TIMES.iter().find_map(|format| NaiveTime::parse_from_str(&clock, format).ok())?;
    let ns = date.and_time(clock).and_utc().timestamp_nanos_opt()?;
    ns.checked_sub(offset_s.checked_mul(1_000_000_000)?)
}

/// The clock without its offset, and the offset, s: `Z`, `+hh`, `+hhmm` or `+hh:mm`.
fn with_offset(text: &str) -> Option<(&str, i64)> {
    if let Some(clock) = text.strip_suffix(['Z', 'z']) {
        return Some((clock.trim_end(), 0));
    }
    let Some(at) = text.rfind(['+', '-']) else { return Some((text, 0)) };
    let digits: String = text[at + 1..].chars().filter(|c| *c != ':').collect();
    let number: i64 = digits.parse().ok().filter(|_| digits.bytes().all(|byte| byte.is_ascii_digit()))?;
    let (hours, minutes) = match digits.len() {
        2 => (number, 0),
        4 => (number / 100, number % 100),
        _ => return None,
    };
    let seconds = 3600 * hours + 60 * minutes;
    let sound = hours < 24 && minutes < 60;
    sound.then_some((text[..at].trim_end(), if text[at..].starts_with('-') { -seconds } else { seconds }))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NOON_OF_29_FEBRUARY_2024: i64 = 1_709_208_000_000_000_000;

    #[test]
    fn every_way_to_write_it() {
        for text in [
            "2024-02-29T12:00:00Z",
            "2024-02-29t12:00:00z",
            "2024-02-29 12:00:00",
            "2024-02-29 12:00",
            " 2024-02-29T12:00:00.000000000Z ",
            "2024-02-29T13:30:00+01:30",
            "2024-02-29T13:30:00.0+0130",
            "2024-02-29 04:00:00 -08",
            "20240229T120000Z",
            "2024-03-01T00:30:00,000+12:30",
            "29.02.2024 12:00:00",
            "2024/02/29 12:00:00",
        ] {
            assert_eq!(iso_ns(text), Some(NOON_OF_29_FEBRUARY_2024), "{text}");
        }
        assert_eq!(iso_ns("2024-02-29T12:00:00.000000001"), Some(NOON_OF_29_FEBRUARY_2024 + 1));
        assert_eq!(iso_ns("1970-01-01T00:00:00Z"), Some(0));
        // The leap second at the end of 2016, and the second after it.
        assert_eq!(iso_ns("2016-12-31T23:59:60Z"), iso_ns("2017-01-01T00:00:00Z"));
        for bad in [
            "",
            "noon",
            "12:00:00",
            "2024-02-29",
            "2023-02-29T12:00:00",
            "2024-13-01T12:00:00",
            "2024-02-29T25:00:00",
            "2024-02-29T12:00:00+1",
            "2024-02-29T12:00:00+24:00",
            "02/29/2024 12:00:00",
            "5",
            "T",
            "2024-02-29T12:00:00+é",
        ] {
            assert_eq!(iso_ns(bad), None, "{bad}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_a_time_or_none(text in "\\PC{0,40}", ns in -4_000_000_000_000_000_000..4_000_000_000_000_000_000_i64) {
            iso_ns(&text);
            prop_assert_eq!(iso_ns(&chrono::DateTime::from_timestamp_nanos(ns).to_rfc3339()), Some(ns));
        }
    }
}
