//! What a transform over a whole record shows: lines of a period, and rows that repeat earlier ones.

pub(crate) mod periods;
pub(crate) mod repeats;
pub(crate) mod trace;
