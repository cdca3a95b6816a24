//! What runs on a target, built as by a user and checked against the vectors: C, Verilog, firmware, the closed loop.

mod c;
pub(crate) mod closed_loop;
pub(crate) mod conserve;
mod faults;
pub(crate) mod firmware;
mod fpga;
mod vector_files;

pub(crate) use self::c::c;
pub(crate) use self::fpga::fpga;
