//! Five terms of a record with their 95 % intervals: white rate noise and quantization, made here.
//!
//! `cargo run --example noise_budget`

use sagnac_noise::{AllanTerm, RecordUnit, TauError, Taus, TermValue, budget_of_angles};

fn main() -> Result<(), TauError> {
    // 10,000 rows of 1 s. Angle random walk 0.003 °/√h is 0.18 arcsec/√s; counts of 0.5 arcsec.
    let mut state = 7_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut angle = 0.0;
    let mut counted = 0.0;
    let rows: Vec<f64> = (0..10_000)
        .map(|_| {
            angle += 15.0 + 0.18 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
            let before = counted;
            counted = (angle / 0.5).floor() * 0.5;
            counted - before
        })
        .collect();
    let budget = budget_of_angles(&rows, RecordUnit::Angle(1.0), 1.0, &Taus::Octaves)?;
    for term in AllanTerm::ALL {
        let (name, unit) = term.name();
        match budget.terms.get(term) {
            TermValue::Found { value, lower, upper } => {
                println!("{name}: {value:.5} {unit} ({lower:.5?} … {upper:.5?})")
            }
            TermValue::Unresolved { unresolved } => println!("{name}: {unresolved}"),
        }
    }
    let walk = budget.terms.get(AllanTerm::AngleRandomWalk);
    assert!(matches!(walk, TermValue::Found { lower: Some(lo), upper: Some(hi), .. } if (*lo..*hi).contains(&0.003)));
    Ok(())
}
