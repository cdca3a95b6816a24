//! The log summed into analysis windows: all that fits, folds and reports ever see.
//!
//! A window is 100 s unless told, aligned to the start of its run, and ends early at a gap or when a
//! temperature has moved by more than 2 °C within it. Next to the windows stands one temperature
//! track per run and thermometer on the grid of the target's temperature period, so that the lag
//! filter can be run for any τ without the log.

mod build;
mod level;
mod outliers;
mod rest;
mod row_trace;
mod still;
mod sums;
mod table;
mod tracks;
mod windows;

pub(crate) use crate::window::build::SeenLogs;
pub use crate::window::build::WindowBuilder;
pub(crate) use crate::window::level::{REACH_C, level_stretches};
pub(crate) use crate::window::outliers::{holds_whole_numbers, is_whole, mark as mark_outliers, suspected};
pub(crate) use crate::window::rest::RestWatch;
pub use crate::window::rest::{Rest, RestSpan};
pub(crate) use crate::window::still::{refuse_still, still_text};
pub use crate::window::table::{table_columns, table_row};
pub(crate) use crate::window::tracks::SAME_VALUE;
pub use crate::window::windows::{Run, RunFile, WindowRows, WindowShape, Windows};
