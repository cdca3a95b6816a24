//! One axis as rows and columns.

pub(crate) mod axis;
pub(crate) mod curve_points;
pub(crate) mod exclusions;
pub(crate) mod lag;
pub(crate) mod least_squares;
pub(crate) mod levels;
pub(crate) mod rate_columns;
pub(crate) mod rows;
pub(crate) mod unit_prior;
