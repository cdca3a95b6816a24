//! What every format gives: columns by role, numbers and times, and rows that are parsed and not judged. Knows no format.

pub(crate) mod feed;
pub mod header;
pub(crate) mod iso;
pub(crate) mod log_shape;
pub mod names;
pub(crate) mod number;
pub(crate) mod raw;
pub(crate) mod words;
