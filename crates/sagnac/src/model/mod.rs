//! What a correction can consist of: inputs, shapes over them, and the models made of both.
//!
//! ```text
//! input (thermometer, difference, column; span and reference) ─┐
//! basis (Chebyshev polynomials on the scaled span) ────────────┼▶ spec (which terms a model has) ─▶ price (instructions)
//! powers (the same curve in powers of °C) ─────────────────────┘
//! ```

pub(crate) mod basis;
pub(crate) mod input;
pub(crate) mod powers;
pub(crate) mod price;
pub(crate) mod spec;

pub use basis::{BASIS_LEN, Span, chebyshev};
pub use price::{TICK_INSTRUCTIONS, WITHIN as PRICED_WITHIN, Work};
pub use spec::{MAX_RATE_ORDER, ModelSpec};
