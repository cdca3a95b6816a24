//! Every test that measures, on all of its records: `cargo test -p sagnac-noise --test studies`.

/// All records are made.
const IS_STUDY: bool = true;

mod measured;
