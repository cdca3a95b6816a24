//! The planned test on two thousand units: compiled with the studies, run by name.

use crate::hostile::planned::{FULL_HOURS, compared};
use crate::support::evidence::{Records, evidence, largest};

#[test]
#[ignore = "two thousand units with their tests take minutes: cargo test -p sagnac --test studies hours::plan -- --ignored"]
fn two_thousand_planned_tests() {
    const UNITS: Records = Records::new(2000);
    let found = compared(UNITS);
    println!("{found:#?}");
    let hours = found.plan.hours / FULL_HOURS;
    largest("study, planned test with the prior of a lot: hours over those of the full test", hours, "≤ 0.5", UNITS);
    evidence(
        "study, planned test: `navigation-grade` accepts the unit in a full retest",
        found.planned,
        "≥ 0.95",
        UNITS,
    );
    evidence("study, full test, its model known: the same retest is accepted", found.full, "≥ 0.95", UNITS);
    evidence(
        "study, planned test: the correction's error is within half of its limits, 0.95 planned",
        found.within_half,
        "≥ 0.92",
        UNITS,
    );
    evidence("study, planned test: 95 % interval of the curve covers", found.covered, "0.93 … 0.97", UNITS);
    evidence(
        "study, planned test: units of the fleet that are refused and need the full test",
        found.refused,
        "≤ 0.06",
        UNITS,
    );
    let [least, mean] = [found.odd.into_iter().fold(1.0, f64::min), found.odd.iter().sum::<f64>() / 4.0];
    evidence("study, planned test: units six σ odd in one of four parameters are refused", mean, "≥ 0.95", UNITS);
    evidence("study, planned test: the same, the parameter it shows least", least, "≥ 0.9", 500);
}
