//! Rows judged: order of times, steps of counters, thermometers, the rate table. Knows no format; says what was rejected, and why.

pub(crate) mod align;
pub(crate) mod batch;
mod counter;
pub(crate) mod full_scale;
pub(crate) mod reason;
pub(crate) mod rows;
pub(crate) mod running_total;
pub(crate) mod sketch;
mod thermometer;
pub(crate) mod turntable;
