//! Tests that end themselves, on two hundred units: compiled with the studies, run by name.

use crate::hostile::stopped::{stopped, unit};
use crate::support::evidence::{Records, evidence};
use sagnac::Limits;

/// Limits of two thirds of those of `navigation-grade`: for some units the length of a test decides.
const STRICT: &str = "base = \"navigation-grade\"
temperature_residual_dph_max = 0.008
plateau_offset_dph_max = 0.025
drift_dph_per_cpm_max = 0.014
hysteresis_dph_max = 0.014
";

#[test]
#[ignore = "two hundred units, each fitted at every hour of its test, take minutes: cargo test -p sagnac --test studies hours::enough -- --ignored"]
fn two_hundred_tests_that_end_themselves() {
    const UNITS: Records = Records::new(200);
    const FEWER: Records = Records::new(60);
    let found = stopped(UNITS, &Limits::named_or_read("navigation-grade").unwrap(), 3, unit);
    let claim = "study, test that ends itself, `navigation-grade`: hours over those of the full test";
    found.assert_hours(claim, "≤ 0.72", UNITS);
    evidence(
        "study, test that ends itself: `navigation-grade` accepts the unit in a retest",
        found.part(|one| one.met),
        "≥ 0.95",
        UNITS,
    );
    evidence(
        "study, full test: `navigation-grade` accepts the unit in the same retest",
        found.part(|one| one.met_full),
        "≥ 0.95",
        UNITS,
    );
    evidence(
        "study, test that ends itself, `navigation-grade`: units that meet the limits after the full test only",
        found.part(|one| one.met_full && !one.met),
        "≤ 0.02",
        UNITS,
    );
    let found = stopped(FEWER, &Limits::parse(STRICT).unwrap(), 3, unit);
    let claim = "study, test that ends itself, two thirds of those limits: hours over those of the full test";
    found.assert_hours(claim, "≤ 0.9", FEWER);
    evidence(
        "study, test that ends itself, two thirds of those limits: units that meet them after the full test only",
        found.part(|one| one.met_full && !one.met),
        "≤ 0.02",
        FEWER,
    );
}
