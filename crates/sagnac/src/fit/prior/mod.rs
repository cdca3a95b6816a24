//! The fit of a unit whose fleet says something of it.

mod gate;
mod posterior;
pub(crate) mod with_prior;
