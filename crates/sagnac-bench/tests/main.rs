//! The tests of `sagnac-bench` in one program: one compilation and one link for all of them.

mod page;
mod sources;
mod warnings;
