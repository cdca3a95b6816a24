//! A retest that repeats the profile of its calibration.

use crate::hostile::{Bench, Now};
use crate::support;
use crate::support::fit;

/// A retest of the same profile proves nothing for others, and says so; one that cools as well does not say it.
#[test]
fn a_retest_of_the_same_profile_says_so() {
    let truth = |now: Now| 0.05 * now.u() + 0.03 * now.lagged_cpm;
    let log = |seed: u64, minutes: Option<f64>| {
        let mut bench = Bench::new(seed, &truth);
        (bench.cycles, bench.row_s, bench.hours) = (1, 20.0, minutes.map(|minutes| minutes / 60.0));
        bench.log()
    };
    let setup = Bench::setup();
    let heated = fit(vec![log(1, Some(290.0)), log(2, Some(290.0))], &setup, "bias 2").unwrap();
    let cycled = fit(vec![log(3, None), log(4, None)], &setup, "bias 2").unwrap();
    let repeats = |calibration, minutes| support::retest(calibration, log(9, minutes), &setup).axes[0].repeats_profile;
    assert!(repeats(&heated, Some(290.0)), "heating alone, twice");
    assert!(!repeats(&heated, None), "a cycle shows what heating alone could not");
    assert!(!repeats(&cycled, Some(290.0)), "the calibration separated them");
}
