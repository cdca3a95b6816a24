//! Windows at one temperature.
//!
//! ```text
//! a stretch goes on while the next window is within 1 °C of the mean of its windows so far
//! ```
//!
//! Fails on a ramp so slow that the mean follows it.

/// Largest distance of a plateau's windows from its mean, °C.
pub(crate) const REACH_C: f64 = 1.0;

/// Stretches of one run whose temperature stays within reach of its own mean so far, as ranges of the windows.
pub(crate) fn level_stretches(places: impl Iterator<Item = (usize, f64)>) -> Vec<std::ops::Range<usize>> {
    let mut stretches: Vec<std::ops::Range<usize>> = Vec::new();
    let (mut of_run, mut sum) = (0, 0.0);
    for (index, (run, celsius)) in places.enumerate() {
        let joins =
            stretches.last().is_some_and(|last| of_run == run && (sum / last.len() as f64 - celsius).abs() <= REACH_C);
        match stretches.last_mut().filter(|_| joins) {
            Some(last) => last.end = index + 1,
            None => {
                stretches.push(index..index + 1);
                sum = 0.0;
            }
        }
        (of_run, sum) = (run, sum + celsius);
    }
    stretches
}
