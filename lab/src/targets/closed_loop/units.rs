//! Ticks, codes and windows of the circle.

/// Ticks of a frame: a second of the chamber, as the setup's tick is 10 ms.
pub(super) const FRAME_TICKS: u32 = sagnac_board::FRAME_TICKS as u32;
/// Codes of 2⁻²⁴ °C, as the setup says.
pub(super) const CODES_PER_C: f64 = 16_777_216.0;
/// A window, of the picture as of the program by default, s.
pub(super) const WINDOW: usize = 100;
