//! Reports: one HTML file that needs nothing else, for screen and paper.
//!
//! ```text
//! record (Calibration, Verification) + ReportData (windows) ─▶ Figure (data) ─▶ svg (paper, files), page's script (screen)
//!                                                       └──────────────────▶ tables, verdict, provenance
//! ```
//!
//! The same input gives the same bytes. Figures show at most a few thousand windows; where there are more,
//! every n-th is drawn and the caption says so. Results always count all.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod acceptance;
mod charts;
mod compared;
mod figure;
mod figures;
mod fleet;
mod noise;
mod page;
mod prose;
mod report;
mod sheet;
mod survey;
mod svg;
mod terms;

pub use charts::{Band, Chart, ChartPage, Curve, PageTable, chart_report};
pub use compared::comparison_report;
pub use fleet::fleet_report;
pub use noise::{noise_report, reason_text, row_notes, term_text};
pub use page::{STYLE, UPLOT_CSS, UPLOT_JS, UPLOT_LICENCE, calibration_report, verification_report};
pub use report::Report;
pub use sheet::Sheet;
pub use survey::survey_report;
