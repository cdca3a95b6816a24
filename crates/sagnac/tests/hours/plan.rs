//! The planned test on two thousand units: compiled with the studies, run by name.

use crate::measured::fit::plan::measure;
use crate::support::evidence::Records;

#[test]
#[ignore = "two thousand units with their tests take minutes: cargo test -p sagnac --test studies hours::plan -- --ignored"]
fn two_thousand_planned_tests() {
    measure("study, ", Records::new(2000));
}
