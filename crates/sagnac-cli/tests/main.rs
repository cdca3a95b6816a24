//! The tests of `sagnac-cli` in one program: one compilation and one link for all of them.

mod acceptance;
mod allan;
mod bench;
mod brief;
mod cli;
mod compare;
mod controls;
mod fleet;
mod generated;
mod inputs;
mod interrupted;
mod machines;
mod odd_logs;
mod overwrite;
mod report;
mod signature;
mod simulate;
mod target;
mod terminal;
mod world;
