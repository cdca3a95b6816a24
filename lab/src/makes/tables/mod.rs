//! Tables of the reference pages, each from the table that the program itself uses.

mod fields;
pub(crate) mod limits;
pub(crate) mod scenario_keys;
pub(crate) mod schema;
pub(crate) mod serial_line;
