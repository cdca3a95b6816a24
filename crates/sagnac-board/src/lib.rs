//! What a gyro's board does, tick by tick, and what it says on its serial line.
//!
//! ```text
//! A/B levels ─▶ counter ─▶ (dither stripping) ─▶ compensator ─┐
//! thermometer codes ── once per Δt ──────────────▲            ├─▶ output frame ─▶ serial line
//! light ─▶ path-length loop ─▶ actuator, modulation ──────────┤
//!       └▶ intensity loop ─▶ current ─────────────────────────┘
//! serial line ─▶ messages: rows of a rig, a new image in pieces, commit, roll back ─▶ flash banks
//! ```
//!
//! * [`Board`] is one tick in its order: slow update if due, pulses, stripping, compensation, loops, frame.
//! * [`Rig`] stands in for the gyro where there is none: it turns the rows of a log into levels, pickoff and light, in
//!   integers, so that a board in an emulator and one on the host see the same.
//! * [`Desk`] and [`Line`] are the main loop's and the interrupt's halves of the whole; [`run`] is both on this machine.
//! * [`Upload`] takes an image from the line and commits it to the flash banks.
//! * [`frame`] is the line's format: `docs/reference/serial-line.md`.
//!
//! No allocation, no floating point, no `unsafe`, no panic path: the firmware that links this with a panic handler that
//! does not exist links. What it does not do: touch a register; that is the firmware's (`firmware/gyro`).
#![no_std]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod board;
mod desk;
pub mod frame;
mod memory_flash;
mod message;
mod rig;
mod upload;

pub use board::{Board, Commands, FRAME_TICKS, Sample};
pub use desk::{Asked, Desk, Line, run};
pub use memory_flash::{MemoryFlash, NotAllowed};
pub use message::{
    COMMIT, Message, OUTPUT_LEN, Output, PIECE, POWER_ON, ROLL_BACK, Reply, ReplyCode, RigSettings, Row,
};
pub use rig::Rig;
pub use upload::Upload;
