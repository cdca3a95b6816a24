//! The planned test: as many units pass as after the full test, in less than half of its hours.

use crate::hostile::STANDARD_HOURS;
use crate::hostile::planned::compared;
use crate::support::evidence::{Records, evidence, largest};

#[test]
fn a_planned_test_does_what_the_full_one_does() {
    measure("", Records::new(240).few(30));
}

/// All claims of a planned test, on so many units.
pub(crate) fn measure(study: &str, units: Records) {
    let found = compared(units);
    println!("{found:#?}");
    let hours = found.plan.hours / STANDARD_HOURS;
    let claim = format!("{study}planned test with the prior of a lot: hours over those of the full test");
    largest(&claim, hours, "≤ 0.5", units);
    let [least, mean] = [found.odd.into_iter().fold(1.0, f64::min), found.odd.iter().sum::<f64>() / 4.0];
    for (claim, measured, bound, units) in [
        ("planned test: `navigation-grade` accepts the unit in a full retest", found.planned, "≥ 0.95", units),
        ("full test, its model known: the same retest is accepted", found.full, "≥ 0.95", units),
        (
            "planned test: the correction's error is within half of its limits, 0.97 planned",
            found.within_half,
            "≥ 0.92",
            units,
        ),
        ("planned test: 95 % interval of the curve covers", found.covered, "0.93 … 0.97", units),
        ("planned test: units of the fleet that are refused and need the full test", found.refused, "≤ 0.06", units),
        ("planned test: units six σ odd in one of four parameters are refused", mean, "≥ 0.95", units),
        ("planned test: the same, the parameter it shows least", least, "≥ 0.9", units.part(4)),
    ] {
        evidence(&format!("{study}{claim}"), measured, bound, units);
    }
}
