//! Comparisons that are refused.

use crate::measured::fit::how_sure::{by_rows, log};
use crate::support::fit;
use sagnac::compare::compare;

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let unit = fit(vec![log(300, 0, 0.0, 1)], &by_rows(), "bias 3").unwrap();
    let mut other = unit.clone();
    other.serial = "ANOTHER".into();
    let alone = compare(&[("a".to_owned(), unit.clone())], None).unwrap_err();
    assert!(alone.what.contains("two or more calibrations"), "{alone}");
    let foreign = compare(&[("a".to_owned(), unit), ("b".to_owned(), other)], None).unwrap_err();
    assert_eq!(foreign.place.file.as_deref(), Some("b"));
}
