//! The terms of a few records of each kind; the program `studies` has all of them.

/// A few records are made of each kind.
const IS_STUDY: bool = false;

mod measured;
