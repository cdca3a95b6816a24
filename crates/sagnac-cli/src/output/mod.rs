//! Words, tables and progress for the terminal. It knows no verb and opens no file.

pub(crate) mod brief;
pub(crate) mod calibration;
pub(crate) mod calibration_brief;
pub(crate) mod comparison_brief;
pub(crate) mod console;
pub(crate) mod noise_brief;
pub(crate) mod progress;
pub(crate) mod shell;
pub(crate) mod tables;
pub(crate) mod terminal;
pub(crate) mod verification_brief;
