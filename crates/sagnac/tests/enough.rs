//! A test that ends when it has told enough: its units pass a retest as often as after the full test, in fewer hours.

mod hostile;
mod support;

use hostile::stopped::{FULL_HOURS, STRICT, stopped};
use sagnac::Limits;
use support::evidence::evidence;

#[test]
fn a_test_that_ends_itself_does_what_the_full_one_does() {
    const UNITS: u64 = 30;
    let found = stopped(UNITS, &Limits::parse(STRICT).unwrap());
    println!("{found:#?}");
    let hours = found.hours / FULL_HOURS;
    evidence("test that ends itself, limits of two thirds: hours over those of the full test", hours, "≤ 0.7", UNITS);
    evidence(
        "test that ends itself, limits of two thirds: met less than after the full test",
        found.lost,
        "≤ 0.04",
        UNITS,
    );
}
