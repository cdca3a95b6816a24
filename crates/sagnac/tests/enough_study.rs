//! Tests that end themselves, on two hundred units: run by `cargo xtask bless study`, compiled by CI.

use crate::hostile::stopped::{FULL_HOURS, STRICT, stopped, unit};
use crate::support::evidence::evidence;
use sagnac::Limits;

#[test]
#[ignore = "two hundred units, each fitted at every hour of its test, take minutes: cargo xtask bless study"]
fn two_hundred_tests_that_end_themselves() {
    const UNITS: u64 = 200;
    const FEWER: u64 = 60;
    let found = stopped(UNITS, &Limits::named_or_read("navigation-grade").unwrap(), 3, unit);
    println!("{found:#?}");
    let hours = found.hours / FULL_HOURS;
    evidence(
        "study, test that ends itself, `navigation-grade`: hours over those of the full test",
        hours,
        "≤ 0.72",
        UNITS,
    );
    evidence(
        "study, test that ends itself: `navigation-grade` accepts the unit in a retest",
        found.met,
        "≥ 0.95",
        UNITS,
    );
    evidence(
        "study, full test: `navigation-grade` accepts the unit in the same retest",
        found.met_full,
        "≥ 0.95",
        UNITS,
    );
    evidence(
        "study, test that ends itself, `navigation-grade`: units that meet the limits after the full test only",
        found.lost,
        "≤ 0.02",
        UNITS,
    );
    let found = stopped(FEWER, &Limits::parse(STRICT).unwrap(), 3, unit);
    println!("{found:#?}");
    let hours = found.hours / FULL_HOURS;
    evidence(
        "study, test that ends itself, two thirds of those limits: hours over those of the full test",
        hours,
        "≤ 0.9",
        FEWER,
    );
    evidence(
        "study, test that ends itself, two thirds of those limits: units that meet them after the full test only",
        found.lost,
        "≤ 0.02",
        FEWER,
    );
}
