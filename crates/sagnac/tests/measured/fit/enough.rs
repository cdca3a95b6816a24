//! A test that ends when it is complete: its units pass a retest as often as after the full test, in fewer hours.

use crate::hostile::stopped::{growing_memory, stopped, unit};
use crate::support::evidence::{Records, evidence};
use sagnac::Limits;

#[test]
fn a_test_that_ends_itself_does_what_the_full_one_does() {
    const UNITS: Records = Records::new(40);
    let found = stopped(UNITS, &Limits::named_or_read("navigation-grade").unwrap(), 3, unit);
    let claim = "test that ends itself, `navigation-grade`: hours over those of the full test";
    found.assert_hours(claim, ["≤ 0.72", "≤ 0.9"], UNITS);
    // One unit in 40 more since the bias has the slow noise of its test: its guard band is wider after a short one.
    evidence(
        "test that ends itself, `navigation-grade`: units that meet the limits after the full test only",
        found.part(|one| one.met_full && !one.met),
        "≤ 0.06",
        UNITS,
    );
}

/// Fewer passes end a test sooner, where a change from one cycle to the next need not be seen.
#[test]
fn two_passes_end_a_test_sooner() {
    const UNITS: Records = Records::new(40);
    let found = stopped(UNITS, &Limits::named_or_read("navigation-grade").unwrap(), 2, unit);
    let claim = "test that ends itself, `navigation-grade`, two passes: hours over those of the full test";
    found.assert_hours(claim, ["≤ 0.6", "≤ 0.85"], UNITS);
}

/// An adversary's unit: with a pass each way 7 of 10 such tests ended at nine hours, and no unit met its retest.
#[test]
fn a_memory_that_grows_from_cycle_to_cycle_is_seen_in_the_second() {
    const UNITS: Records = Records::new(20);
    let found = stopped(UNITS, &Limits::named_or_read("navigation-grade").unwrap(), 3, growing_memory);
    evidence(
        "test that ends itself, memory of the direction that grows from cycle to cycle: tests that end before the full one",
        found.part(|one| one.ended),
        "≤ 0.05",
        UNITS,
    );
}
