//! The noise of a record at rest, from its own raw rows.
//!
//! ```text
//! rows ─▶ Recorder (phase; stretches between gaps) ─▶ difference sums ─▶ curve ─▶ five terms ─▶ intervals ─▶ NoiseBudget
//!          overlap (in memory) or pyramid (any length)      [difference]  [budget]   [terms]  [freedom, bootstrap]
//! each window ─▶ ShortTau ─▶ N and Q at short τ ─▶ floor of every residual
//! ```
//!
//! Inside: °/h (which is arcsec/s), arcsec and seconds; terms come out in the field's units. `docs/explanation/noise.md` tells the
//! method, its sources and what it is held against.

mod bootstrap;
mod budget;
mod curve;
mod difference;
mod freedom;
mod overlap;
mod pyramid;
mod ramp;
mod read;
mod recorder;
mod short;
mod terms;

pub use budget::{AxisBudget, CONFIDENCE, CurvePoint, HadamardPoint, TermValue, Terms};
pub use curve::{BareCurve, budget_of_curves, is_curve, parse_curve, read_curve};
pub use difference::{Deviation, Difference, SquareSum};
pub use freedom::Stretches;
pub use overlap::{overlapping, phases};
pub use pyramid::FULL_OVERLAP;
pub use read::{HELD_PHASES, NoiseBudget, Request, Taus, budget_of_angles, noise_budget};
pub use recorder::{Recorded, Recorder};
pub use short::{NoiseTerms, ShortTau, ShortTauSums};
pub use terms::{FittedTerms, Point, Term, fit_terms};
