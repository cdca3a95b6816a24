//! What makes the generated files: one module per kind, each with a function `make`.

pub(crate) mod chamber;
pub(crate) mod circle;
pub(crate) mod errors;
pub(crate) mod faults;
pub(crate) mod first_bytes;
pub(crate) mod glossary;
pub(crate) mod good_log;
pub(crate) mod image;
pub(crate) mod making;
pub(crate) mod manual;
pub(crate) mod pages;
pub(crate) mod requirements;
pub(crate) mod tables;
pub(crate) mod vectors;

/// The ready scenarios whose bytes and figures are tested.
pub(crate) const READY: [&str; 4] = ["paper", "square-28cm", "prism-heater-loop", "triangle-28cm-dithered"];
