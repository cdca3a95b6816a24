//! The tests of `sagnac` in one program: one compilation and one link for all of them. Those in `measured` make few records here; the
//! program `studies` makes all of them.

/// A few records are made of each kind.
const IS_STUDY: bool = false;

mod acceptance;
mod allan;
mod any_bytes;
mod clocks;
mod compare_limits;
mod copies;
mod counts;
mod coverage;
mod entanglement;
mod fixed_bias;
mod formats;
mod harmonics;
mod hostile;
mod how_sure;
mod image_ranges;
mod inputs;
mod many_files;
mod measured;
mod pipeline;
mod prior;
mod profiles;
mod rate_table;
mod real_chamber;
mod recordings;
mod replay;
mod rest;
mod selection;
mod simulated_chamber;
mod support;
mod survey;
mod target_precision;
mod turned;
mod two_lags;
mod ulog_writer;
mod warm_up;
