//! Noise of a log, from its own raw samples.
//!
//! For now the two short-τ terms that the floor of a residual needs ([`ShortTau`]).

mod short;

pub use short::{NoiseTerms, ShortTau, ShortTauSums};
