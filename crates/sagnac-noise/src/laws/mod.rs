//! The five laws of a curve: their fit, where they begin, whether the curve has their slopes, and the intervals of their terms.

pub(crate) mod bootstrap;
pub(crate) mod law_range;
pub(crate) mod slope;
pub(crate) mod terms;
