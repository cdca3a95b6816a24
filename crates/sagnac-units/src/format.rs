//! Numbers as people read them: no more digits than their uncertainty supports.

use std::borrow::Cow;

/// A number of things: `1 row`, `3 rows`.
pub fn counted(number: usize, one: &str, more: &str) -> String {
    if number == 1 { format!("1 {one}") } else { format!("{number} {more}") }
}

/// The last part of a path, as provenance names it.
pub fn file_name(path: &str) -> String {
    std::path::Path::new(path).file_name().map_or_else(|| path.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// A number with as many decimals as two digits of its uncertainty need.
pub fn with_sigma(value: f64, sigma: Option<f64>) -> String {
    match sigma {
        Some(sigma) if sigma > 0.0 && sigma.is_finite() => {
            let decimals = (1.0 - sigma.log10().floor()).clamp(0.0, 17.0) as usize;
            if decimals > 9 {
                // One power of ten for both: the value's, or sigma's where that is larger.
                let power = value.abs().max(sigma).log10().floor();
                let decimals = (1.0 + power - sigma.log10().floor()).max(1.0) as usize;
                let scale = 10.0_f64.powf(-power);
                return format!("({:.decimals$} ± {:.decimals$})e{power}", value * scale, sigma * scale);
            }
            let text = format!("{value:.decimals$}");
            // A value within half a digit of zero has no sign.
            let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
            format!("{} ± {sigma:.decimals$}", if is_zero { text.trim_start_matches('-') } else { &text })
        }
        _ => significant(value, 6),
    }
}

/// Text for a terminal, a line of a file or a message: what would control a terminal or turn the direction of writing is written as its
/// number, `\u{1b}`. Line ends stay; [`one_line`] writes them as numbers too.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && controls(c), |c| format!("\\u{{{:x}}}", u32::from(c)))
}

/// The same in one line.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, controls, |c| format!("\\u{{{:x}}}", u32::from(c)))
}

/// The same of JSON, in which such characters stand within strings alone, as JSON's own escapes.
pub fn printable_json(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && controls(c), |c| format!("\\u{:04x}", u32::from(c)))
}

/// Control characters (C0, DEL, C1), and those that turn the direction of writing (Unicode's bidirectional controls).
pub fn controls(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(text: &str, is: impl Fn(char) -> bool, by: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.contains(&is) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is(c) {
            out.push_str(&by(c));
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// How many times, for people: two digits below ten, else three.
pub fn times_text(times: f64) -> String {
    significant(times, if times < 10.0 { 2 } else { 3 })
}

/// A number to so many significant digits.
pub fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-5..=8).contains(&magnitude) {
        return format!("{value:.*e}", (digits - 1).max(0) as usize);
    }
    format!("{value:.*}", (digits - 1 - magnitude).max(0) as usize)
}

/// A unit as people read it: records and limits write `deg/h per degC/min`, people °/h per °C/min.
pub fn unit(of_record: &str) -> String {
    of_record.replace("degC", "°C").replace("deg/h", "°/h").replace("deg/rt h", "°/√h")
}

/// A setting as it was meant: no more than nine significant digits, and no zeros behind them.
pub fn plain(value: f64) -> String {
    significant(value, 9).parse::<f64>().map_or(String::new(), |value| value.to_string())
}

/// A value no finer than a ten-thousandth of a width, without zeros behind it.
pub fn on_scale(value: f64, width: f64) -> String {
    let decimals = (4.0 - width.abs().log10()).ceil().clamp(0.0, 12.0) as usize;
    format!("{value:.decimals$}").parse::<f64>().map_or(String::new(), |value| (value + 0.0).to_string())
}

/// A temperature to a tenth, without a minus before zero.
pub fn celsius(value: f64) -> String {
    format!("{:.1}", (10.0 * value).round() / 10.0 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_carry_the_digits_their_uncertainty_supports() {
        assert_eq!(with_sigma(0.123_456, Some(0.0123)), "0.123 ± 0.012");
        assert_eq!(with_sigma(1043.39, Some(12.0)), "1043 ± 12");
        assert_eq!(with_sigma(-0.000_01, Some(0.0011)), "0.0000 ± 0.0011");
        assert_eq!(unit("deg/h per degC/min"), "°/h per °C/min");
        assert_eq!(with_sigma(-7.656e-9, Some(2.64e-10)), "(-7.66 ± 0.26)e-9");
        assert_eq!(with_sigma(1e-12, Some(2.6e-10)), "(0.0 ± 2.6)e-10");
        assert_eq!(with_sigma(2.5, None), "2.50000");
        assert_eq!(significant(0.000_123_456, 3), "0.000123");
        assert_eq!(significant(-6.547e-8, 3), "-6.55e-8");
        assert_eq!([plain(0.5), plain(0.653_137_508_981_430_6), plain(100.0)], ["0.5", "0.653137509", "100"]);
        assert_eq!([on_scale(-5.9e-18, 4.0), on_scale(-0.0474, 4.0), on_scale(21.0, 0.0)], ["0", "-0.0474", "21"]);
        assert_eq!([celsius(-0.002), celsius(-39.95)], ["0.0", "-40.0"]);
    }
}
