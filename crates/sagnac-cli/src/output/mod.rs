//! Words, tables and progress for the terminal. It knows no verb and opens no file.

pub(crate) mod calibration;
pub(crate) mod console;
pub(crate) mod progress;
pub(crate) mod shell;
pub(crate) mod tables;
pub(crate) mod terminal;
