//! The tests of `sagnac-board` in one program: one compilation and one link for all of them.

mod counts;
mod given;
mod hardware;
mod line;
mod signed;
