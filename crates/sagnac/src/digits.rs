//! Numbers as people read them: no more digits than their uncertainty supports.

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
            format!("{value:.decimals$} ± {sigma:.decimals$}")
        }
        _ => significant(value, 6),
    }
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
        assert_eq!(with_sigma(-7.656e-9, Some(2.64e-10)), "(-7.66 ± 0.26)e-9");
        assert_eq!(with_sigma(1e-12, Some(2.6e-10)), "(0.0 ± 2.6)e-10");
        assert_eq!(with_sigma(2.5, None), "2.50000");
        assert_eq!(significant(0.000_123_456, 3), "0.000123");
        assert_eq!(significant(-6.547e-8, 3), "-6.55e-8");
        assert_eq!([celsius(-0.002), celsius(-39.95)], ["0.0", "-40.0"]);
    }
}
