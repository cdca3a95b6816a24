//! Every test that measures, on all of its records: `cargo test -p sagnac --test studies`.

/// All records are made.
const IS_STUDY: bool = true;

mod hostile;
mod hours;
mod measured;
mod support;
