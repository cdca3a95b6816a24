//! Figures of coverage, power and risk: asserted here, printed for `docs/explanation/evidence.md`.

/// Asserts that a measured figure keeps its bound, and prints the line that `cargo xtask bless evidence` collects. A bound is
/// `≥ 0.97`, `≤ 0.05` or `0.92 … 0.98`. Claim and bound are literals of the test, or its formats, where `bless --check` looks for them.
#[track_caller]
pub(crate) fn evidence(claim: &str, measured: f64, bound: &str, records: u64) {
    let file = std::panic::Location::caller().file();
    println!("\nevidence: {claim} | {measured} | {bound} | {records} | {file}");
    assert!(is_within(measured, bound), "{claim}: {measured}, not {bound}");
}

fn is_within(measured: f64, bound: &str) -> bool {
    let number = |text: &str| text.trim().parse::<f64>().unwrap();
    if let Some(least) = bound.strip_prefix('≥') {
        measured >= number(least)
    } else if let Some(most) = bound.strip_prefix('≤') {
        measured <= number(most)
    } else {
        let (least, most) = bound.split_once('…').unwrap();
        (number(least)..=number(most)).contains(&measured)
    }
}
