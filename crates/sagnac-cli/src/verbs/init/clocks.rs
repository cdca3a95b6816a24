//! Times that Sagnac does not read, and the command that makes one of them that it reads.
//!
//! A clock `08:15:00` without a date becomes seconds, past midnight too. A date next to a clock, and a date with the month first, become a
//! date of ISO 8601. Where no row tells whether day or month comes first, the command takes the month, and says so.
//!
//! Fails where cells have quotes around a separator: the command splits a line at each of them.

use sagnac_log::ingest::names::{HeaderQuantity, Named};
use sagnac_log::ingest::{Sample, SampleColumn};

/// Columns of a time that is not read.
pub(super) struct MendedClock {
    /// Their places.
    pub(super) columns: Vec<usize>,
    /// What they are, and the command.
    pub(super) mended: String,
}

/// A date as people write it without a clock.
#[derive(Clone, Copy, PartialEq)]
enum DateForm {
    /// 2024-02-29, or 29.02.2024: with a clock behind it, read as it is.
    Plain,
    /// 02/29/2024, or 29/02/2024.
    Slashes,
}

impl MendedClock {
    /// Of a log without a time that is read; `None` where there is none.
    pub(super) fn of(sample: &Sample) -> Option<Self> {
        let columns = &sample.columns;
        let find = |is: &dyn Fn(&SampleColumn) -> bool| columns.iter().position(is);
        if find(&|column| column.is_dates()).is_some() || columns.iter().any(is_time_in_numbers) {
            return None;
        }
        let together = find(&|column| all(column, |cell| slashes(cell).is_some_and(|(_, clock)| is_clock(clock))));
        let clock = find(&is_of_clocks);
        let date = find(&|column| date_form(column).is_some());
        let (places, what, program) = match (together, clock, date) {
            (Some(at), ..) => {
                let (order, open_order) = order_of(&columns[at]);
                let split = format!("split(${0},d,\"[/ ]+\");${0}={order}\"T\"d[4]", at + 1);
                (vec![at], format!("dates with slashes{open_order}"), guarded(at, "/", &split))
            }
            (None, Some(clock), Some(date)) => {
                let (c, d) = (clock + 1, date + 1);
                let (join, open_order) = match date_form(&columns[date]) {
                    Some(DateForm::Slashes) => {
                        let (order, open_order) = order_of(&columns[date]);
                        (format!("split(${d},d,\"/\");${c}={order}\"T\"${c}"), open_order)
                    }
                    _ => (format!("${c}=${d}\" \"${c}"), ""),
                };
                (
                    vec![clock, date],
                    format!("a date and a clock in two columns{open_order}"),
                    guarded(clock, ":", &join),
                )
            }
            (None, Some(clock), None) => {
                let c = clock + 1;
                let seconds = format!(
                    "gsub(\",\",\".\",${c});split(${c},c,\":\");t=c[1]*3600+c[2]*60+c[3];if(t<p-43200)n+=86400;p=t;${c}=sprintf(\"%.6f\",t+n)"
                );
                (vec![clock], "a clock without a date".to_owned(), guarded(clock, ":", &seconds))
            }
            (None, None, _) => return None,
        };
        let names: Vec<String> = places.iter().map(|at| format!("{:?}", columns[*at].header)).collect();
        let separator = match sample.delimiter {
            b'\t' => "\\t".to_owned(),
            other => char::from(other).to_string(),
        };
        let command = format!("awk -F'{separator}' -v OFS='{separator}' '{program}1' 'IN' > 'OUT'");
        Some(Self {
            columns: places,
            mended: format!(
                "{} is {what}. This makes a time of it, then run `sagnac init` again:\n#   {command}",
                names.join(" with ")
            ),
        })
    }
}

/// A column whose cells are all clocks.
pub(super) fn is_of_clocks(column: &SampleColumn) -> bool {
    all(column, is_clock)
}

/// A column that is a time as it is.
fn is_time_in_numbers(column: &SampleColumn) -> bool {
    let named = Named::of(&column.header, column.unit.as_deref());
    let is_time =
        named.is_some_and(|named| named.quantity == HeaderQuantity::Time) || column.header.starts_with("time_");
    is_time && column.numbers().len() > 1
}

fn all(column: &SampleColumn, is: impl Fn(&str) -> bool) -> bool {
    let mut known = column.cells.iter().filter(|cell| !cell.is_empty()).peekable();
    known.peek().is_some() && known.all(|cell| is(cell))
}

/// Runs a program in the rows alone: their cell begins with a digit, and has this mark.
fn guarded(at: usize, mark: &str, program: &str) -> String {
    let mark = if mark == "/" { "\\/" } else { mark };
    format!("${}~/^[0-9]+{mark}/{{{program}}}", at + 1)
}

/// `8:15`, `08:15:00`, `08:15:00.250`, `08:15:00,250`.
fn is_clock(cell: &str) -> bool {
    let parts: Vec<&str> = cell.split(':').collect();
    let is_whole = |part: &&str| (1..=2).contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_digit());
    let is_second = |part: &str| {
        let (whole, fraction) = part.split_once(['.', ',']).unwrap_or((part, ""));
        is_whole(&whole) && fraction.bytes().all(|byte| byte.is_ascii_digit())
    };
    match &parts[..] {
        [hour, minute] => is_whole(hour) && is_whole(minute),
        [hour, minute, second] => is_whole(hour) && is_whole(minute) && is_second(second),
        _ => false,
    }
}

/// The first two numbers of `02/29/2024`, and what is behind it.
fn slashes(cell: &str) -> Option<([u32; 2], &str)> {
    let (date, rest) = cell.split_once(' ').unwrap_or((cell, ""));
    let numbers: Vec<u32> = date.split('/').map(|part| part.parse().ok()).collect::<Option<_>>()?;
    match numbers[..] {
        [first @ 1..=31, second @ 1..=31, 1900..=2200] => Some(([first, second], rest.trim())),
        _ => None,
    }
}

fn date_form(column: &SampleColumn) -> Option<DateForm> {
    let is_plain = |cell: &str| {
        let count = |mark: char| cell.matches(mark).count() == 2;
        cell.len() >= 8 && cell.chars().all(|c| c.is_ascii_digit() || "-.".contains(c)) && (count('-') || count('.'))
    };
    let is_of_slashes = |cell: &str| slashes(cell).is_some_and(|(_, rest)| rest.is_empty());
    if all(column, is_of_slashes) {
        return Some(DateForm::Slashes);
    }
    all(column, is_plain).then_some(DateForm::Plain)
}

/// Year, month and day in the words of the command, and a note where no row shows their order.
fn order_of(column: &SampleColumn) -> (&'static str, &'static str) {
    let dates = || column.cells.iter().filter_map(|cell| slashes(cell)).map(|(numbers, _)| numbers);
    let (month_first, day_first) = ("d[3]\"-\"d[1]\"-\"d[2]", "d[3]\"-\"d[2]\"-\"d[1]");
    if dates().any(|[first, _]| first > 12) {
        (day_first, "")
    } else if dates().any(|[_, second]| second > 12) {
        (month_first, "")
    } else {
        (month_first, ", taken with the month first (swap d[1] and d[2] if it is the day)")
    }
}
