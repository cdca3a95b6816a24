//! The program of a gyro's board: one tick after the other, and the messages on its serial line.
//!
//! ```text
//! A/B levels ─▶ counter ─▶ (dither stripping) ─▶ compensator ─┐
//! input codes ── once per Δt ────────────────────▲            ├─▶ output frame ─▶ serial line
//! light ─▶ path-length loop ─▶ actuator, modulation ──────────┤
//!       └▶ intensity loop ─▶ current ─────────────────────────┘
//! serial line ─▶ messages: rows of a rig, a new image in pieces, commit, roll back ─▶ flash banks
//! ```
//!
//! * [`Board`] runs one tick in a fixed order: slow update if due, pulses, stripping, compensation, loops, frame.
//! * `Rig` (feature `rig`) replaces the gyro where there is none. It turns the rows of a log into levels, pickoff and light, in integers, so
//!   a board in an emulator and one on the host see the same.
//! * `TickHandler` is the part for the tick's interrupt on such a board, `CommandHandler` the part for its main loop; `run` runs
//!   both on the host. A gyro's own firmware has neither, nor their messages: it calls [`Board`] and [`Upload`].
//! * [`Axis`] runs a [`Board`] on hardware behind three traits (counter, clock, converters), [`Line`] the serial line of its main loop over
//!   `embedded-io`; `firmware/stm32f407` is a whole board of this kind.
//! * [`Upload`] receives an image over the line, checks its signature if the board has a key, and commits it to the flash banks.
//! * [`frame`] is the format of the line: `docs/reference/serial-line.md`.
//!
//! There is no allocation, no floating point, no `unsafe` and no panic path (`cargo xtask no-panic` checks that at link
//! time). The crate touches no register; that is the firmware's part (`firmware/gyro`).
//!
//! Two examples to copy from are in `examples/`: `one_board` runs a board tick by tick; `upload_image` sends a new
//! image over the serial line.
#![no_std]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod board;
pub mod frame;
mod frame_angle;
#[cfg(feature = "rig")]
mod handler;
mod hardware;
mod line;
mod memory_flash;
mod message;
#[cfg(feature = "rig")]
mod rig;
mod upload;

pub use board::{ActuatorCodes, Board, BoardSetup, FRAME_TICKS, LONGEST_PAUSE_TICKS, Sample, StartCause, WatchSetup};
#[cfg(feature = "rig")]
pub use handler::{Action, CommandHandler, TickHandler, run};
pub use hardware::{Axis, Converters, FringeCounter, PwmOutput, SpiDac, TickClock};
pub use line::Line;
pub use memory_flash::{MemoryFlash, MemoryFlashError};
pub use message::{
    Change, Commit, Direction, KINDS, Message, MessageKind, OUTPUT_LEN, OutputFrame, POWER_ON, Piece, Reply, ReplyCode,
};
#[cfg(feature = "rig")]
pub use message::{RigSettings, Row};
#[cfg(feature = "rig")]
pub use rig::Rig;
pub use upload::{Handled, SERVICE_S, Upload};
