//! The minimum of a function of one variable, by golden section (Kiefer 1953).
//!
//! Fails where there is more than one valley: it ends in one of them. Callers bracket the lowest place of a grid.

const GOLDEN_STEPS: usize = 24;

/// Minimum of a function with one valley between `lo` and `hi`.
pub(crate) fn golden_section(mut lo: f64, mut hi: f64, f: impl Fn(f64) -> f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let (mut left, mut right) = (hi - RATIO * (hi - lo), lo + RATIO * (hi - lo));
    let (mut at_left, mut at_right) = (f(left), f(right));
    for _ in 0..GOLDEN_STEPS {
        if at_left < at_right {
            (hi, right, at_right) = (right, left, at_left);
            left = hi - RATIO * (hi - lo);
            at_left = f(left);
        } else {
            (lo, left, at_left) = (left, right, at_right);
            right = lo + RATIO * (hi - lo);
            at_right = f(right);
        }
    }
    f64::midpoint(lo, hi)
}
