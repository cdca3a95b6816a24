//! The tests of `sagnac-loops` in one program: one compilation and one link for all of them.

mod any_code;
mod lock_evidence;
mod table;
