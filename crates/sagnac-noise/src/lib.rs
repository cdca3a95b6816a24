//! Noise of a gyroscope at rest: Allan and Hadamard deviations, and the five terms behind them.
//!
//! ```text
//! angles ─▶ Screen ─▶ Recorder ─▶ sums of differences ─▶ curve ─▶ five terms ─▶ intervals ─▶ AxisBudget
//!           gaps,     phase, in memory     [difference]  [budget]  from the τ   [freedom,
//!           disturbed [overlap] or of any                without   on where the laws]
//!           rows      length [pyramid]                   [spectrum] [laws] hold
//! each window ─▶ WindowedDifferences ─▶ N and Q of the used windows ─▶ noise floor of every residual
//! ```
//!
//! Pure: numbers in, numbers out. No file, no gyro, no clock; work is shared among the threads of the caller's rayon
//! pool. Inside: °/h (which is arcsec/s), arcsec and seconds. The terms come out in the units of the field.
//! `docs/explanation/noise.md` has the method, its sources and the references it is checked against.
//!
//! ```
//! use sagnac_noise::{RecordUnit, Taus, budget_of_angles};
//!
//! // One hour of rows of 1 s: 15 °/h turns 15 arcsec in each of them.
//! let angles: Vec<f64> = (0..3600).map(|i| 15.0 + if i % 2 == 0 { 0.5 } else { -0.5 }).collect();
//! let budget = budget_of_angles(&angles, RecordUnit::Angle(1.0), 1.0, &Taus::Octaves)?;
//! assert_eq!(budget.curve[0].tau_s, 1.0);
//! # Ok::<(), sagnac_noise::TauError>(())
//! ```
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod bare;
mod budget;
mod difference;
mod freedom;
mod laws;
mod level;
mod model;
mod overlap;
mod pyramid;
mod recorder;
mod screen;
mod spectrum;
mod taus;
mod term_value;
mod vectors;
mod windowed;

pub use bare::{BareCurve, RecordLengthError, budget_of_curve};
pub use budget::{
    AxisBudget, CurvePoint, DisturbedRow, DisturbedRows, HadamardPoint, RecordUnit, budget, budget_of_angles,
    budget_of_screened, differences,
};
pub use difference::{Deviation, Difference, SquareSum};
pub use freedom::Stretches;
pub use laws::terms::{AllanTerm, FittedTerms, Point, fit_terms};
pub use model::LawRange;
pub use overlap::{overlapping, phases};
pub use pyramid::{FULL_OVERLAP, served};
pub use recorder::{HELD_PHASES, MOST_ROWS, Recorded, Recorder};
pub use screen::{Disturbed, MOST_DISTURBED_PART, MOST_LOST_PART, RowPlace, Screen, Screened};
pub use spectrum::periods::{Period, Series};
pub use spectrum::repeats::Repeat;
pub use spectrum::trace::{Trace, TraceWatch};
pub use taus::{MOST_TAUS, TauError, Taus};
pub use term_value::{CONFIDENCE, MeasuredNoise, NoiseTerms, TermValue, Terms};
pub use windowed::{FILLED, Hump, JudgedWindow, WindowSquares, WindowedCurve, WindowedDifferences};
