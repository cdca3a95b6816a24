//! Groups of flags that several verbs share.

pub(crate) mod report;
pub(crate) mod setup;
pub(crate) mod signature;
pub(crate) mod units;
