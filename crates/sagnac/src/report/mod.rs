//! Reports: one HTML file that needs nothing else, for screen and paper.
//!
//! ```text
//! record (Calibration, Verification) + Evidence (windows) ─▶ Figure (data) ─▶ svg (paper), page's script (screen)
//!                                                       └──────────────────▶ tables, verdict, provenance
//! ```
//!
//! The same input gives the same bytes. Figures show at most a few thousand windows; where there are more,
//! every n-th is drawn and the caption says so. Results always count all.

#[cfg(feature = "report")]
mod acceptance;
#[cfg(feature = "report")]
mod charts;
#[cfg(feature = "report")]
mod compared;
mod evidence;
#[cfg(feature = "report")]
mod figure;
#[cfg(feature = "report")]
mod figures;
#[cfg(feature = "report")]
mod noise;
#[cfg(feature = "report")]
mod page;
#[cfg(feature = "report")]
mod svg;
mod terms;

#[cfg(feature = "report")]
pub use charts::{Band, Chart, ChartPage, Curve, PageTable, chart_report};
#[cfg(feature = "report")]
pub use compared::comparison_report;
pub use evidence::{AxisEvidence, Effect, EffectOf, Evidence, Leg, Point, RunSpan};
pub(crate) use evidence::{points, run_spans};
#[cfg(feature = "report")]
pub use noise::{noise_report, term_text};
#[cfg(feature = "report")]
pub use page::{calibration_report, verification_report};
