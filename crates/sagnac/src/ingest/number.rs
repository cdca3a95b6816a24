//! Numbers as logs write them.

/// A finite number; a decimal comma is understood when `decimal_comma`. `None` for anything else.
pub(crate) fn parse_value(field: &[u8], decimal_comma: bool) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?.trim();
    let value: f64 =
        if decimal_comma && text.contains(',') { text.replacen(',', ".", 1).parse() } else { text.parse() }.ok()?;
    value.is_finite().then_some(value)
}

/// A time as whole nanoseconds, exact for decimals down to 1 ns (further places are cut off).
///
/// `places` is the power of ten from the column's unit to nanoseconds. Exponents go through `f64`.
pub(crate) fn parse_time_ns(field: &[u8], places: u32, decimal_comma: bool) -> Option<i64> {
    let text = std::str::from_utf8(field).ok()?.trim();
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
    for place in 0..places {
        let digit = fraction.as_bytes().get(place as usize).map_or(0, |b| i64::from(b - b'0'));
        ns = ns.checked_mul(10)?.checked_add(digit)?;
    }
    Some(if negative { -ns } else { ns })
}

/// `1`, `true`, `ok`, `yes` and their opposites; `None` for anything else.
pub(crate) fn parse_flag(field: &[u8]) -> Option<bool> {
    match std::str::from_utf8(field).ok()?.trim().to_ascii_lowercase().as_str() {
        "1" | "true" | "ok" | "yes" => Some(true),
        "0" | "false" | "no" => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
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
    fn values_are_finite_or_nothing() {
        assert_eq!(parse_value(b" 1,25", true), Some(1.25));
        for bad in ["", "nan", "inf", "1e309", "1,25", "0x1"] {
            assert_eq!(parse_value(bad.as_bytes(), false), None, "{bad}");
        }
    }
}
