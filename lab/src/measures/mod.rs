//! What is measured: speed next to peers, formats of other programs, pictures, and the answers of another build.

pub(crate) mod bench;
pub(crate) mod compare;
pub(crate) mod formats;
pub(crate) mod pictures;
pub(crate) mod same;
