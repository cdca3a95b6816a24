//! A test that ends when it has told enough: its units pass a retest as often as after the full test, in fewer hours.

mod hostile;
mod support;

use hostile::stopped::{FULL_HOURS, stopped};
use sagnac::Limits;
use support::evidence::evidence;

#[test]
fn a_test_that_ends_itself_does_what_the_full_one_does() {
    const UNITS: u64 = 40;
    let found = stopped(UNITS, &Limits::named_or_read("navigation-grade").unwrap());
    println!("{found:#?}");
    let hours = found.hours / FULL_HOURS;
    evidence("test that ends itself, `navigation-grade`: hours over those of the full test", hours, "≤ 0.6", UNITS);
    evidence(
        "test that ends itself, `navigation-grade`: units that meet the limits after the full test only",
        found.lost,
        "≤ 0.03",
        UNITS,
    );
}
