//! What a correction can consist of: inputs, shapes over them, and the models made of both.
//!
//! ```text
//! basis (Chebyshev polynomials on a scaled span) ─▶ powers (the same in powers of °C) ─▶ shape (functions of one input)
//! shape, powers ─▶ common_basis (series of several spans on one)
//! shape ─▶ input (thermometer, difference, column on the rows of a fit)
//! spec ─▶ words (a model as people name it)
//! shape ─▶ spec (which terms a model has, in the words of `--model`) ─▶ price (instructions on the target)
//! ```

pub(crate) mod basis;
pub(crate) mod common_basis;
pub(crate) mod input;
pub(crate) mod powers;
pub(crate) mod price;
pub(crate) mod shape;
pub(crate) mod spec;
mod words;

pub use basis::{BASIS_LEN, Span, chebyshev};
pub use common_basis::COMMON_SPAN;
pub use price::{TICK_INSTRUCTIONS, WITHIN as PRICED_WITHIN, work_of};
pub use shape::{ActsOn, Form, TermShape};
pub use spec::{InputTerms, MAX_RATE_ORDER, ModelSpec};
