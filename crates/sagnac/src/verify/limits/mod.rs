//! Limits: the table of all, the file that states some, and the verdict on a retest.

pub(crate) mod file;
pub(crate) mod judge;
pub(crate) mod source;
pub(crate) mod table;
pub(crate) mod unanswered;
pub(crate) mod verdict;
