//! Intensity control: the discharge current (or the pump) keeps the light constant.
//!
//! ```text
//! photodiode sum ─▶ mean of n ticks ─▶ error ─▶ kp + ki Σ (limits) ─▶ slew limit ─▶ current
//!
//! OFF ─▶ IGNITING ─light▶ RUNNING ─dark for long▶ RESTING ─▶ IGNITING …  ─after all tries▶ FAILED
//! ```
//!
//! n is a whole number of path-length modulation periods, so the modulation averages out of the error. The integrator
//! stops at the limits of the current and follows the slew limit, so it does not wind up. During ignition the current
//! is the ignition current; with light the integrator starts from that code.

use crate::MAX_CODE;
use crate::gain::{LoopGain, codes, held, q32};
use crate::status::status;

status! {
    /// Status of the intensity loop. Zero: regulated, nothing to report.
    IntensityStatus {
        /// Less light than the low limit.
        LOW_INTENSITY = 0;
        /// The current has been at an end of its range for too long.
        END_OF_RANGE = 1;
        /// Igniting, or waiting for the next try.
        IGNITING = 2;
        /// All ignition tries have failed.
        FAILED = 3;
        /// The error is larger than the limit for a settled loop.
        SETTLING = 4;
    }
}

/// Phase of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntensityPhase {
    /// Ignition current is on.
    Igniting {
        /// Remaining updates of this try.
        left: u32,
        /// Remaining tries after this one.
        tries: u8,
    },
    /// Current off before the next try.
    Resting {
        /// Remaining updates.
        left: u32,
        /// Remaining tries.
        tries: u8,
    },
    /// Regulating.
    Running {
        /// Consecutive updates without light.
        dark: u32,
        /// Consecutive updates at an end of the range.
        at_end: u32,
    },
    /// All ignition tries have failed; the current is off.
    Failed,
}

/// The loop as integers, as the target stores it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Intensity {
    /// Ticks per update.
    pub(crate) ticks: u16,
    /// Set point: sum of the codes of one update.
    pub(crate) set_point: i64,
    pub(crate) error_shift: u8,
    pub(crate) kp: LoopGain,
    pub(crate) ki: LoopGain,
    /// Current codes.
    pub(crate) least: i32,
    pub(crate) most: i32,
    /// Codes per update.
    pub(crate) slew: i32,
    pub(crate) ignition: i32,
    pub(crate) ignition_updates: u32,
    pub(crate) rest_updates: u32,
    pub(crate) tries: u8,
    /// Below this sum there is no light.
    pub(crate) dark_sum: i64,
    /// Below this sum the light is low.
    pub(crate) low_sum: i64,
    pub(crate) dark_updates: u32,
    pub(crate) end_updates: u32,
    pub(crate) settled_error: i32,
}

/// Memory of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntensityState {
    sum: i64,
    ticks: u16,
    phase: IntensityPhase,
    integral_q32: i64,
    current: i32,
    status: IntensityStatus,
}

/// Output of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntensityOutput {
    /// Code of the current.
    pub current: i32,
    /// Status.
    pub status: IntensityStatus,
}

impl IntensityState {
    /// The integrator, 2^-32 codes.
    pub const fn integral_q32(&self) -> i64 {
        self.integral_q32
    }

    /// Phase of the loop.
    pub const fn phase(&self) -> IntensityPhase {
        self.phase
    }
}

impl Intensity {
    /// A loop that starts to ignite.
    pub fn start(&self) -> IntensityState {
        IntensityState {
            sum: 0,
            ticks: 0,
            phase: IntensityPhase::Igniting { left: self.ignition_updates, tries: self.tries },
            integral_q32: q32(self.ignition),
            current: self.ignition,
            status: IntensityStatus::IGNITING | IntensityStatus::LOW_INTENSITY,
        }
    }

    /// Ticks per update.
    pub const fn ticks_per_update(&self) -> u16 {
        self.ticks
    }

    /// One tick: the code of the photodiode in, the code of the current out.
    ///
    /// With `hold` the current stays constant and dark time does not count. Use it while the path-length loop moves
    /// ([`crate::PathLengthStatus::HOLD_LIGHT`]), when the cavity may be dark.
    #[inline]
    pub fn tick(&self, state: &mut IntensityState, photodiode: i32, hold: bool) -> IntensityOutput {
        state.sum += i64::from(photodiode.clamp(-MAX_CODE, MAX_CODE));
        state.ticks += 1;
        if state.ticks >= self.ticks {
            let sum = core::mem::take(&mut state.sum);
            state.ticks = 0;
            self.update(state, sum, hold);
        }
        IntensityOutput { current: state.current, status: state.status }
    }

    fn update(&self, state: &mut IntensityState, sum: i64, hold: bool) {
        // |sum| ≤ 2^23·2^16; the shift fits the set point.
        let error = ((self.set_point - sum) >> self.error_shift.min(63)).clamp(-(1 << 30), 1 << 30) as i32;
        let dark = sum < self.dark_sum;
        state.phase = self.next_phase(state.phase, dark, state.current, hold);
        match state.phase {
            IntensityPhase::Running { .. } if hold => {}
            IntensityPhase::Running { .. } => self.control(state, error),
            IntensityPhase::Igniting { .. } => {
                state.current = self.ignition;
                state.integral_q32 = q32(self.ignition);
            }
            IntensityPhase::Resting { .. } | IntensityPhase::Failed => state.current = 0,
        }
        state.status = self.status(state.phase, sum, error);
    }

    fn control(&self, state: &mut IntensityState, error: i32) {
        let limits = (q32(self.least), q32(self.most));
        let proportional = self.kp.times(error);
        let integral = held(state.integral_q32 + self.ki.times(error), limits.0, limits.1);
        let wanted = held(integral + proportional, limits.0, limits.1);
        let (slew, now) = (q32(self.slew), q32(state.current));
        let given = held(wanted, now - slew, now + slew);
        // The integrator does not keep what the slew limit cut off.
        state.integral_q32 = if given == wanted { integral } else { held(given - proportional, limits.0, limits.1) };
        state.current = codes(given);
    }

    fn next_phase(&self, phase: IntensityPhase, dark: bool, current: i32, hold: bool) -> IntensityPhase {
        use IntensityPhase::{Failed, Igniting, Resting, Running};
        match phase {
            Igniting { .. } if !dark => Running { dark: 0, at_end: 0 },
            Igniting { .. } | Running { .. } if hold => phase,
            Igniting { left: 0, tries: 0 } => Failed,
            Igniting { left: 0, tries } => Resting { left: self.rest_updates, tries },
            Igniting { left, tries } => Igniting { left: left - 1, tries },
            Resting { left: 0, tries } => Igniting { left: self.ignition_updates, tries: tries.saturating_sub(1) },
            Resting { left, tries } => Resting { left: left - 1, tries },
            Running { dark: so_far, .. } if dark && so_far >= self.dark_updates => {
                Resting { left: self.rest_updates, tries: self.tries.saturating_add(1) }
            }
            Running { dark: so_far, at_end } => {
                let at_limit = current <= self.least || current >= self.most;
                let at_end = if at_limit { at_end.saturating_add(1) } else { 0 };
                Running { dark: if dark { so_far + 1 } else { 0 }, at_end }
            }
            Failed => Failed,
        }
    }

    fn status(&self, phase: IntensityPhase, sum: i64, error: i32) -> IntensityStatus {
        let mut status = match phase {
            IntensityPhase::Igniting { .. } | IntensityPhase::Resting { .. } => IntensityStatus::IGNITING,
            IntensityPhase::Failed => IntensityStatus::FAILED,
            IntensityPhase::Running { at_end, .. } if at_end >= self.end_updates => IntensityStatus::END_OF_RANGE,
            IntensityPhase::Running { .. } => IntensityStatus::OK,
        };
        if sum < self.low_sum {
            status |= IntensityStatus::LOW_INTENSITY;
        }
        if error.unsigned_abs() > self.settled_error.unsigned_abs() {
            status |= IntensityStatus::SETTLING;
        }
        status
    }
}

#[cfg(feature = "design")]
pub use build::{IntensityConfig, IntensityDesign};

#[cfg(feature = "design")]
mod build;
