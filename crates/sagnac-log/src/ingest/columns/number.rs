//! Reads the numbers of a log.

use crate::ingest::columns::iso::iso_ns;

/// A finite number; a decimal comma is understood when `decimal_comma`, and thousands that are set apart. `None` for anything else.
pub fn parse_value(field: &[u8], decimal_comma: bool) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?.trim();
    let plain = if decimal_comma && text.contains(',') { text.replacen(',', ".", 1).parse() } else { text.parse() };
    let value: f64 = plain.ok().or_else(|| without_thousands(text, decimal_comma)?.parse().ok())?;
    value.is_finite().then_some(value)
}

/// A number whose thousands are set apart, without what separates them and with a decimal point: `1.234.567,8`, `1,234.5`, `1 234`, `1'234`.
///
/// One group behind a point or a comma alone (`1.234`) may be decimals; it is none.
fn without_thousands(text: &str, decimal_comma: bool) -> Option<String> {
    let (own, point) = if decimal_comma { ('.', ',') } else { (',', '.') };
    let (whole, fraction) = text.split_once(point).unwrap_or((text, ""));
    let separator = whole.chars().find(|c| [own, ' ', '\'', '\u{a0}', '\u{202f}', '’'].contains(c))?;
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let (sign, unsigned) = whole.strip_prefix('-').map_or(("", whole), |rest| ("-", rest));
    let groups: Vec<&str> = unsigned.split(separator).collect();
    let (first, rest) = groups.split_first()?;
    let sound = digits(first) && first.len() <= 3 && rest.iter().all(|group| digits(group) && group.len() == 3);
    let certain = separator != own || rest.len() > 1 || text.contains(point);
    let decimals = fraction.is_empty() || digits(fraction);
    (sound && certain && decimals).then(|| format!("{sign}{}.{fraction}0", groups.concat()))
}

/// What spreadsheets and loggers write where there is no value.
pub(crate) fn is_missing(field: &[u8]) -> bool {
    const WORDS: [&[u8]; 9] = [b"-", b"--", b"nan", b"na", b"n/a", b"#n/a", b"null", b"none", b"#value!"];
    field.len() <= 7 && WORDS.iter().any(|word| field.eq_ignore_ascii_case(word))
}

/// Powers of ten that `f64` holds exactly.
pub(crate) const EXACT_POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];
const INTEGER_POWERS: [u64; 10] =
    [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000, 1_000_000_000];
/// Integers up to here are exact in `f64`.
const EXACT_INTEGER: u64 = 1 << 53;

/// A plain decimal, `-12.50`: its digits as one integer, and how many of them are after the point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Decimal {
    negative: bool,
    digits: u64,
    places: u32,
}

impl Decimal {
    /// The plain decimal at the start of `bytes` and its length; `None` for anything else, or more than 18 digits.
    #[inline]
    pub(crate) fn read(bytes: &[u8]) -> Option<(Self, usize)> {
        let negative = *bytes.first()? == b'-';
        let unsigned = &bytes[usize::from(negative)..];
        let (mut digits, whole) = run_of_digits(0, unsigned);
        let mut length = whole;
        let mut places = 0;
        if unsigned.get(whole) == Some(&b'.') {
            (digits, places) = run_of_digits(digits, &unsigned[whole + 1..]);
            length += 1 + places;
        }
        // More than 18 digits have wrapped.
        let decimal = Self { negative, digits, places: places as u32 };
        (1..=18).contains(&(whole + places)).then_some((decimal, usize::from(negative) + length))
    }

    /// The nearest `f64`: both parts are exact, so the division rounds once. `None` beyond 2^53.
    #[inline]
    pub(crate) fn value(self) -> Option<f64> {
        if self.digits > EXACT_INTEGER {
            return None;
        }
        let size = self.digits as f64;
        let size = if self.places == 0 { size } else { size / EXACT_POWERS.get(self.places as usize)? };
        // The sign bit by arithmetic, because a branch on random signs is slow.
        Some(f64::from_bits(size.to_bits() ^ (u64::from(self.negative) << 63)))
    }

    /// Units of the last place by which it is above another of the same sign and places.
    pub(crate) fn less(self, other: Self) -> Option<u64> {
        let alike = self.places == other.places && !self.negative && !other.negative;
        self.digits.checked_sub(other.digits).filter(|_| alike)
    }

    /// In units of 10^-`places`, exactly; `None` where digits remain or it overflows.
    #[inline]
    pub(crate) fn scaled(self, places: u32) -> Option<i64> {
        let power = INTEGER_POWERS.get(places.checked_sub(self.places)? as usize)?;
        let size = i64::try_from(self.digits.checked_mul(*power)?).ok()?;
        Some(if self.negative { -size } else { size })
    }
}

/// Appends the digits at the start of `bytes` to `digits`; returns their number.
#[inline]
fn run_of_digits(mut digits: u64, bytes: &[u8]) -> (u64, usize) {
    for (at, byte) in bytes.iter().enumerate() {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            return (digits, at);
        }
        digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
    }
    (digits, bytes.len())
}

/// A whole number of up to six digits at the start of `bytes` and its length, without a branch on its digits, of which a count of noise
/// has now one and now two. `None` for anything else, which [`Decimal::read`] may still read.
#[inline(always)]
pub(crate) fn short_whole(bytes: &[u8]) -> Option<(f64, usize)> {
    const ZEROS: u64 = 0x3030_3030_3030_3030;
    /// Added to a digit's value, sets the highest bit of its byte from ten on.
    const ABOVE_NINE: u64 = 0x7676_7676_7676_7676;
    const HIGHEST: u64 = 0x8080_8080_8080_8080;
    let word = u64::from_le_bytes(*bytes.first_chunk()?);
    let negative = u64::from(word as u8 == b'-');
    // What is shifted in is no digit.
    let word = word >> (8 * negative);
    let values = word ^ ZEROS;
    // The lowest byte that is no digit; carries reach only those above it.
    let ends = (values.wrapping_add(ABOVE_NINE) | values) & HIGHEST;
    let digits = ends.trailing_zeros() / 8;
    if !(1..=6).contains(&digits) || (word >> (8 * digits)) as u8 == b'.' {
        return None;
    }
    // The last digit in the highest byte, zeros before the first; then pairs, fours and eights of digits.
    let values = values << (64 - 8 * digits);
    let pairs = (10 * values + (values >> 8)) & 0x00ff_00ff_00ff_00ff;
    let fours = (100 * pairs + (pairs >> 16)) & 0x0000_ffff_0000_ffff;
    let whole = (10_000 * fours + (fours >> 32)) & 0xffff_ffff;
    Some((f64::from_bits((whole as f64).to_bits() ^ (negative << 63)), (u64::from(digits) + negative) as usize))
}

/// Used instead of a time's decimal places if the column holds dates.
pub(crate) const ISO_8601: u32 = u32::MAX;

/// Used instead of a time's decimal places if the column holds days since 1899-12-30, as spreadsheets store dates.
pub(crate) const SPREADSHEET_DAYS: u32 = u32::MAX - 1;
/// 1970-01-01 in those days.
const EPOCH_DAYS: f64 = 25_569.0;
const S_PER_DAY: f64 = 86_400.0;

/// Days of a spreadsheet as ns since 1970, to the microsecond: a double has no more of them.
pub(crate) fn spreadsheet_ns(days: f64) -> Option<i64> {
    let us = ((days - EPOCH_DAYS) * S_PER_DAY * 1e6).round();
    (us.abs() < 9.2e15).then(|| us as i64 * 1000)
}

/// A time as whole nanoseconds, to the nearest; exact for decimals down to 1 ns.
///
/// `places` is the power of ten from the column's unit to nanoseconds, or what a header of dates or of days has in its place ([`crate::ingest::header::Role::Time`]).
/// Exponents go through `f64`.
pub fn parse_time_ns(field: &[u8], places: u32, decimal_comma: bool) -> Option<i64> {
    let text = std::str::from_utf8(field).ok()?.trim();
    if places == ISO_8601 {
        return iso_ns(text);
    }
    if places == SPREADSHEET_DAYS {
        return spreadsheet_ns(parse_value(field, decimal_comma)?);
    }
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let point = if decimal_comma { &['.', ','][..] } else { &['.'][..] };
    let (whole, fraction) = digits.split_once(point).unwrap_or((digits, ""));
    let plain = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    if !plain(whole) || !plain(fraction) || (whole.is_empty() && fraction.is_empty()) {
        let scaled = parse_value(field, decimal_comma)? * 10_f64.powi(i32::try_from(places).ok()?);
        return (scaled.abs() < 9.2e18).then_some(scaled.round() as i64);
    }
    let mut ns = 0_i64;
    for digit in whole.bytes() {
        ns = ns.checked_mul(10)?.checked_add(i64::from(digit - b'0'))?;
    }
    let place = |place: u32| fraction.as_bytes().get(place as usize).map_or(0, |b| i64::from(b - b'0'));
    for digit in (0..places).map(place) {
        ns = ns.checked_mul(10)?.checked_add(digit)?;
    }
    ns = ns.checked_add(i64::from(place(places) >= 5))?;
    Some(if negative { -ns } else { ns })
}

/// One as a number in any form, `true`, `ok`, `yes` and their opposites; `None` for anything else.
pub(crate) fn parse_flag(field: &[u8]) -> Option<bool> {
    match std::str::from_utf8(field).ok()?.trim().to_ascii_lowercase().as_str() {
        "true" | "ok" | "yes" => Some(true),
        "false" | "no" => Some(false),
        _ => parse_value(field, true).filter(|flag| [0.0, 1.0].contains(flag)).map(|flag| flag == 1.0),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn times_are_exact_to_the_nanosecond() {
        assert_eq!(parse_time_ns(b"1700000000.123456789", 9, false), Some(1_700_000_000_123_456_789));
        assert_eq!(parse_time_ns(b" -0.5", 9, false), Some(-500_000_000));
        assert_eq!(parse_time_ns(b"256551281491968", 3, false), Some(256_551_281_491_968_000));
        assert_eq!(parse_time_ns(b"1,5", 6, true), Some(1_500_000));
        assert_eq!(parse_time_ns(b"1e3", 9, false), Some(1_000_000_000_000));
        for bad in ["", ".", "x", "nan", "1e308", "99999999999999999999", "1.2.3"] {
            assert_eq!(parse_time_ns(bad.as_bytes(), 9, false), None, "{bad}");
        }
    }

    #[test]
    fn plain_decimals_are_what_the_standard_library_reads() {
        for text in ["0", "-0", "12.50", "-.5", "3.", "9007199254740992", "0.0000000001", "123456789.123456789"] {
            let (decimal, length) = Decimal::read(format!("{text},7").as_bytes()).unwrap();
            let expected: f64 = text.parse().unwrap();
            if let Some(value) = decimal.value() {
                assert_eq!(value.to_bits(), expected.to_bits(), "{text}");
            }
            assert_eq!(length, text.len());
            if let Some(ns) = decimal.scaled(9) {
                assert_eq!(Some(ns), parse_time_ns(text.as_bytes(), 9, false), "{text}");
            }
        }
        for other in ["", "-", ".", "x", "+1", "\"1\"", "1234567890123456789"] {
            assert_eq!(Decimal::read(other.as_bytes()), None, "{other}");
        }
        assert_eq!(Decimal::read(b"1.2.3").map(|(_, length)| length), Some(3));
    }

    proptest! {
        /// Whatever the short way reads, the long way reads.
        #[test]
        fn short_whole_numbers_are_decimals(text in "-?[0-9]{0,8}[-.,;0-9e\\r\\n]{0,9}", bytes in any::<[u8; 9]>()) {
            for bytes in [text.as_bytes(), &bytes] {
                if let Some((value, length)) = short_whole(bytes) {
                    let (decimal, expected) = Decimal::read(bytes).unwrap();
                    prop_assert_eq!((value.to_bits(), length), (decimal.value().unwrap().to_bits(), expected));
                }
            }
        }
    }

    #[test]
    fn short_whole_numbers_are_read_up_to_six_digits() {
        for whole in (-1200..1200).chain([-999_999, -100_000, 100_000, 999_999]) {
            let (value, length) = short_whole(format!("{whole}\n0.01,2").as_bytes()).unwrap();
            assert_eq!((value, length), (f64::from(whole), whole.to_string().len()));
        }
        for other in ["1000000,2", "-1000000,", "12.5,000", "-,000000", ",0000000", "--100000", "1\n"] {
            assert_eq!(short_whole(other.as_bytes()), None, "{other}");
        }
    }

    #[test]
    fn a_flag_is_one_in_any_form() {
        for yes in ["1", "1.0", "1.000000", "1,000", "1e0", "+1", " 1 ", "TRUE", "ok", "Yes"] {
            assert_eq!(parse_flag(yes.as_bytes()), Some(true), "{yes}");
        }
        for no in ["0", "0.000000", "0,0", "-0", "0e0", "false", "No"] {
            assert_eq!(parse_flag(no.as_bytes()), Some(false), "{no}");
        }
        for bad in ["", "2", "0.5", "1.000001", "nan", "-1", "1 000", "y"] {
            assert_eq!(parse_flag(bad.as_bytes()), None, "{bad}");
        }
    }

    #[test]
    fn thousands_are_set_apart_without_a_guess() {
        for (text, comma, value) in [
            ("1.234.567,8", true, 1_234_567.8),
            ("-1.234,5", true, -1234.5),
            ("1,234.5", false, 1234.5),
            ("1,234,567", false, 1_234_567.0),
            ("1 234", true, 1234.0),
            ("1\u{a0}234,25", true, 1234.25),
            ("1'234'567", false, 1_234_567.0),
            ("-12\u{202f}345.5", false, -12_345.5),
        ] {
            assert_eq!(parse_value(text.as_bytes(), comma), Some(value), "{text}");
        }
        // One group may be decimals: as a decimal comma it is one, else nothing.
        assert_eq!(parse_value(b"1.234", true), Some(1.234));
        assert_eq!(parse_value(b"1,234", true), Some(1.234));
        assert_eq!(parse_value(b"1,234", false), None);
        for bad in ["12.34.567,8", "1.2345,6", "1..234,5", "1 23", "1 234 5", "1.234,5,6", "a 234", ".234.567,1"] {
            assert_eq!(parse_value(bad.as_bytes(), true), None, "{bad}");
        }
    }

    /// Days of Excel: 2024-02-29 12:00 is 45351.5 (Microsoft's documentation counts 2024-01-01 as 45292).
    #[test]
    fn days_of_a_spreadsheet_are_dates() {
        let noon = crate::ingest::columns::iso::iso_ns("2024-02-29T12:00:00Z");
        assert_eq!(parse_time_ns(b"45351.5", SPREADSHEET_DAYS, false), noon);
        assert_eq!(parse_time_ns(b"45351,5", SPREADSHEET_DAYS, true), noon);
        assert_eq!(parse_time_ns(b"1e300", SPREADSHEET_DAYS, false), None);
        let second = parse_time_ns(b"45351.500011574", SPREADSHEET_DAYS, false).unwrap() - noon.unwrap();
        assert!((second - 1_000_000_000).abs() < 50_000, "{second}");
    }

    #[test]
    fn values_are_finite_or_nothing() {
        assert_eq!(parse_value(b" 1,25", true), Some(1.25));
        for bad in ["", "nan", "inf", "1e309", "1,25", "0x1"] {
            assert_eq!(parse_value(bad.as_bytes(), false), None, "{bad}");
        }
    }
}
