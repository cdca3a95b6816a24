//! Path-length control: keeps the cavity at the peak of its gain.
//!
//! ```text
//!                 ┌────────────────────── modulation ──────────────────────┐
//! intensity ─▶ synchronous detector ─▶ error ─▶ kp + ki Σ (limits) ─▶ (+) ─┴▶ actuator
//! ```
//!
//! Near the peak I = I₀(1 − c·x²), with x the error of the path in wavelengths. A modulation x = x₀ + a·sin gives the
//! in-phase sum −2·c·I₀·a·x₀·Σsin², whose sign gives the direction to the peak. The integrator moves once per period;
//! the modulation is added every tick.
//!
//! The path has a peak every wavelength. When the integrator comes near the end of the actuator's range, the loop
//! opens, moves by the whole number of wavelengths that brings it nearest to the middle, and locks again: a *mode
//! reset*. The limits are more than a wavelength apart, so the loop does not reset back at once.
//!
//! ```text
//! SWEEPING ─light▶ SETTLING ─▶ CLOSING ─small error, a peak▶ LOCKED ─near the end▶ RESETTING ─▶ SETTLING …
//!   ▲  └──none──▶ DARK ◀── too long, or no peak ──┘         └── error large, dark, or no peak ──┐
//!   └──────────────┘ ▲──────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! A small error is no evidence of a peak: a trough has none either, nor has a photodiode that is stuck. LOCKED therefore
//! needs two more things. The light repeats half of the brightest of the search, at the same current. And over the lock
//! time the second harmonic of the light has half of the size, relative to the light, that a peak gives it:
//!
//! ```text
//! I = I₀(1 − c(x₀ + a sin θ)²)      second harmonic  +I₀·c·a²/2·cos 2θ at a peak, − at a trough, 0 without an answer
//! ```
//!
//! A modulation beyond the resonance of a mirror answers in counterphase: the error changes its sign and the loop settles
//! on the trough. The second harmonic keeps its sign there, so such a loop never reads LOCKED; it reports NO_PEAK. A lock
//! whose second harmonic falls below a quarter for a loss time is lost. A period counts with twice its expected harmonic, or four times
//! its noise, at most, so that a spike of the photodiode does not end a lock. Without a search, a loop that found no peak begins
//! again half a wavelength aside: that is how it leaves a start on the trough.
//!
//! Off its peak a cavity may be dark although the discharge burns, so the search covers a whole wavelength even without
//! light. During the search the loop requests a constant current ([`PathLengthStatus::HOLD_LIGHT`]): an active intensity
//! loop would hide the peak, or switch the discharge off after too much dark time. After a search without light the loop
//! waits for twice the search time, so that the ignition can work.
//!
//! Counts are valid only while the loop is LOCKED; all other outputs have [`PathLengthStatus::INVALID`].
//!
//! Limits: a modulation that reaches the photodiode's amplifier by itself, with a second harmonic of 0.1 % of the light, looks like a peak
//! while the photodiode is stuck. [`PathLength::is_heard`] finds it at power-on, before the lamp burns. A resonance between one and two times the modulation turns the second harmonic too. Such a loop refuses to lock;
//! it cannot lock on a trough, because there the two turns cancel.

use crate::gain::{LoopGain, codes, held, q32};
use crate::lockin::{Detector, Reference, Sums};
use crate::status::status;

status! {
    /// Status of the path-length loop. Zero: locked, nothing to report.
    PathLengthStatus {
        /// Not locked: do not use the counts.
        INVALID = 0;
        /// Searching for a peak or approaching it.
        ACQUIRING = 1;
        /// Moving to another mode.
        RESETTING = 2;
        /// The light is too weak to see a peak.
        LOW_SIGNAL = 3;
        /// The actuator is at the end of its range.
        AT_LIMIT = 4;
        /// The lock was lost since power-on. Latched.
        WAS_LOST = 5;
        /// The path moves: keep the current constant ([`crate::Intensity::tick`] with `hold`).
        HOLD_LIGHT = 6;
        /// The last attempt found no peak: a stuck photodiode, or a modulation that the mirror answers in counterphase.
        /// Until the loop locks.
        NO_PEAK = 7;
    }
}

/// Phase of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathLengthPhase {
    /// No light: waiting before the next search.
    Dark {
        /// Periods to go.
        left: u32,
    },
    /// Moving through one wavelength and recording the brightest position.
    Sweeping {
        /// Periods to go.
        left: u32,
        /// Brightest sum so far.
        best: i64,
        /// Its position, 2^-32 codes.
        at_q32: i64,
    },
    /// Waiting for the actuator to settle.
    Settling {
        /// Periods to go.
        left: u32,
    },
    /// The loop is closed but not yet near the peak.
    Closing {
        /// Consecutive periods with a small error and light.
        good: u32,
        /// Periods since the loop closed.
        since: u32,
    },
    /// On the peak.
    Locked {
        /// Consecutive periods with a large error.
        bad: u32,
        /// Periods of the present check of the second harmonic.
        checked: u32,
    },
    /// Moving to another mode.
    Resetting {
        /// Target position, 2^-32 codes.
        to_q32: i64,
    },
}

/// The loop as integers, as the target stores it; checked when built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathLength {
    pub(crate) reference: Reference,
    /// Amplitude of the modulation, codes.
    pub(crate) modulation: i32,
    /// Right shift from in-phase sums to errors of at most 2^30.
    pub(crate) error_shift: u8,
    pub(crate) kp: LoopGain,
    pub(crate) ki: LoopGain,
    /// Range of the actuator without the room for the modulation, codes.
    pub(crate) low: i32,
    pub(crate) high: i32,
    /// A mode reset starts beyond these, codes.
    pub(crate) reset_low: i32,
    pub(crate) reset_high: i32,
    /// One wavelength, codes.
    pub(crate) wavelength: i32,
    /// 2^-32 codes per period while sweeping and resetting.
    pub(crate) sweep_step_q32: i64,
    pub(crate) reset_step_q32: i64,
    /// Periods.
    pub(crate) sweep_periods: u32,
    pub(crate) settle_periods: u32,
    pub(crate) lock_periods: u32,
    pub(crate) lost_periods: u32,
    pub(crate) give_up_periods: u32,
    /// Errors.
    pub(crate) lock_error: i32,
    pub(crate) lost_error: i32,
    /// Smallest second harmonic of a peak, 2^-23 of the light.
    pub(crate) least_curvature_q8: u16,
    /// Largest that a single period counts with, 2^-23 of the light.
    pub(crate) most_curvature_q8: u32,
    /// Below this sum of a period there is no light.
    pub(crate) dark_sum: i64,
}

/// Largest `most_curvature_q8`: its product with the light of a period stays below 2^59.
pub(crate) const MOST_CURVATURE_Q8: u32 = 1 << 30;

/// Longest lock and loss time, periods: 2^44 of a period's second harmonic still add up below 2^63.
pub(crate) const MAX_EVIDENCE: u32 = 1 << 17;

/// Sums of the light over a lock or loss time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Evidence {
    second: i64,
    plain: i64,
}

impl Evidence {
    /// Adds a period. Its harmonic counts with `most_q8` of the light at most: what a single spike of the photodiode adds is no evidence,
    /// and a spike in a quarter of the periods does not end a lock.
    fn add(&mut self, sums: &Sums, most_q8: u32) {
        // plain ≤ 2^29 and most_q8 ≤ 2^30; at most MAX_EVIDENCE periods, so that the sums cannot saturate.
        let most = sums.plain.max(0).saturating_mul(i64::from(most_q8)) >> 8;
        // Not `clamp`, whose check of its bounds is a panic path.
        self.second = self.second.saturating_add(sums.second.max(-most).min(most));
        self.plain = self.plain.saturating_add(sums.plain);
    }

    /// The light curves as on a peak. Never true for a light that does not answer: its second harmonic is zero.
    fn shows_peak(&self, least_q8: u16) -> bool {
        self.second >= (self.plain.saturating_mul(i64::from(least_q8)) >> 8).max(1)
    }
}

/// Memory of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathLengthState {
    detector: Detector,
    phase: PathLengthPhase,
    /// Integrator, 2^-32 codes.
    integral_q32: i64,
    /// Code of the actuator in this period.
    held: i32,
    /// Error of the last period.
    error: i32,
    /// Second harmonic of the last period.
    second: i64,
    /// Sums of the present check of the second harmonic.
    evidence: Evidence,
    /// Brightest sum of the search before this settling; 0 without one.
    brightest: i64,
    /// Without a search: the last start was half a wavelength from the middle.
    aside: bool,
    /// Wavelengths that mode resets have moved the path by.
    modes: i32,
    status: PathLengthStatus,
}

/// Output of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathLengthOutput {
    /// Code of the actuator, without the modulation.
    pub actuator: i32,
    /// Code of the modulation: add it for a mirror, or send it to a separate modulator next to a heater.
    pub modulation: i32,
    /// Status of the counts of this tick.
    pub status: PathLengthStatus,
}

impl PathLengthState {
    /// Whole wavelengths that mode resets have moved the path by since power-on.
    pub const fn modes(&self) -> i32 {
        self.modes
    }

    /// Phase of the loop.
    pub const fn phase(&self) -> PathLengthPhase {
        self.phase
    }

    /// Error of the last period, in units of the detector.
    pub const fn error(&self) -> i32 {
        self.error
    }

    /// True after the last tick of a period: the error and the second harmonic are new.
    pub const fn begins_period(&self) -> bool {
        self.detector.index() == 0
    }

    /// Second harmonic of the light of the last period, 2^-15 codes: positive at a peak.
    pub const fn second_harmonic(&self) -> i64 {
        self.second
    }

    /// Status of the counts of this tick.
    pub const fn status(&self) -> PathLengthStatus {
        self.status
    }

    /// The integrator, 2^-32 codes.
    pub const fn integral_q32(&self) -> i64 {
        self.integral_q32
    }

    /// Code of the actuator, without the modulation.
    pub const fn held(&self) -> i32 {
        self.held
    }
}

impl PathLength {
    /// A loop at power-on: no light yet, the actuator in the middle of its range.
    pub fn start(&self) -> PathLengthState {
        let middle = self.middle_q32();
        let mut state = PathLengthState {
            detector: Detector::default(),
            phase: PathLengthPhase::Dark { left: 0 },
            integral_q32: middle,
            held: codes(middle),
            error: 0,
            second: 0,
            evidence: Evidence::default(),
            brightest: 0,
            aside: false,
            modes: 0,
            status: PathLengthStatus::INVALID | PathLengthStatus::ACQUIRING | PathLengthStatus::HOLD_LIGHT,
        };
        state.phase = self.begin(&mut state);
        state
    }

    /// With the lamp off: the modulation reaches the photodiode's code by itself, and could pass for a peak.
    ///
    /// `second_sum`: the sum of [`PathLengthState::second_harmonic`] over so many `periods`, at least [`Self::hearing_periods`], in which this
    /// loop's ticks drove the modulation. A peak at the least light that the loop takes for light would give twice as much.
    pub fn is_heard(&self, second_sum: i64, periods: u32) -> bool {
        let least = self.dark_sum.saturating_mul(i64::from(self.least_curvature_q8)) >> 9;
        second_sum.saturating_abs() >= least.saturating_mul(i64::from(periods)).max(1)
    }

    /// Periods after which the photodiode's noise is no crosstalk: 16 lock times.
    pub const fn hearing_periods(&self) -> u32 {
        self.lock_periods.saturating_mul(16)
    }

    pub(crate) fn middle_q32(&self) -> i64 {
        (q32(self.low) + q32(self.high)) / 2
    }

    /// One wavelength, codes.
    pub const fn wavelength(&self) -> i32 {
        self.wavelength
    }

    /// Ticks per period; the integrator moves once per period.
    pub const fn ticks_per_period(&self) -> u8 {
        self.reference.ticks()
    }

    /// One tick: the code of the photodiode in, the code of the actuator out.
    #[inline]
    pub fn tick(&self, state: &mut PathLengthState, detector: i32) -> PathLengthOutput {
        if let Some(sums) = state.detector.update(&self.reference, detector) {
            self.period(state, &sums);
        }
        let sine = i64::from(self.reference.sine_q15(state.detector.index()));
        let modulation = (i64::from(self.modulation) * sine + (1 << 14)) >> 15;
        // The limits leave room for the modulation, so the sum stays in the range.
        PathLengthOutput { actuator: state.held, modulation: modulation as i32, status: state.status }
    }

    fn period(&self, state: &mut PathLengthState, sums: &Sums) {
        // |sum| ≤ 2^23·2^15·64 = 2^44. The shift fits full scale; the clamp is for noise beyond it.
        let error = (sums.in_phase >> self.error_shift.min(63)).clamp(-(1 << 30), 1 << 30) as i32;
        (state.error, state.second) = (error, sums.second);
        let dark = sums.plain < self.dark_sum;
        let next = self.next_phase(state, error, sums, dark);
        if matches!(next, PathLengthPhase::Closing { .. } | PathLengthPhase::Locked { .. }) {
            self.control(state, error);
        } else {
            state.integral_q32 = held(state.integral_q32, q32(self.low), q32(self.high));
            state.held = codes(state.integral_q32);
        }
        if matches!(state.phase, PathLengthPhase::Locked { .. }) && self.lost(next) {
            state.status |= PathLengthStatus::WAS_LOST;
        }
        state.phase = next;
        state.status = self.status(state, dark);
    }

    fn lost(&self, next: PathLengthPhase) -> bool {
        !matches!(next, PathLengthPhase::Locked { .. } | PathLengthPhase::Resetting { .. })
    }

    /// Proportional part and integrator. The integrator stops at the limits, so it does not wind up.
    fn control(&self, state: &mut PathLengthState, error: i32) {
        let limits = (q32(self.low), q32(self.high));
        state.integral_q32 = held(state.integral_q32 + self.ki.times(error), limits.0, limits.1);
        let output = held(state.integral_q32 + self.kp.times(error), limits.0, limits.1);
        state.held = codes(output);
    }

    fn next_phase(&self, state: &mut PathLengthState, error: i32, sums: &Sums, dark: bool) -> PathLengthPhase {
        use PathLengthPhase::{Closing, Dark, Locked, Resetting, Settling, Sweeping};
        match state.phase {
            Dark { left } if left > 0 => Dark { left: left - 1 },
            // Without a search, wait for light.
            Dark { .. } if self.sweep_periods == 0 && dark => Dark { left: 0 },
            Dark { .. } => self.begin(state),
            Sweeping { left, best, at_q32 } => self.sweep(state, left, best, at_q32, sums.plain),
            Settling { left: 0 } => self.close(state, sums.plain),
            Settling { left } => Settling { left: left - 1 },
            Closing { since, .. } if since >= self.give_up_periods => self.wait(),
            Closing { good, since } => {
                let small = error.unsigned_abs() < self.lock_error.unsigned_abs() && !dark;
                self.lock(state, if small { good + 1 } else { 0 }, since, sums)
            }
            Locked { bad, checked } => {
                let bad = if error.unsigned_abs() > self.lost_error.unsigned_abs() || dark { bad + 1 } else { 0 };
                if bad >= self.lost_periods { self.wait() } else { self.stay_or_reset(state, bad, checked + 1, sums) }
            }
            Resetting { to_q32 } => {
                let step = self.reset_step_q32;
                let distance = to_q32 - state.integral_q32;
                state.integral_q32 += held(distance, -step, step);
                if distance == 0 { Settling { left: self.settle_periods } } else { Resetting { to_q32 } }
            }
        }
    }

    /// Waits for the time of two searches, so that the ignition can work in between.
    fn wait(&self) -> PathLengthPhase {
        PathLengthPhase::Dark { left: self.sweep_periods.saturating_mul(2) }
    }

    /// Starts a search through one wavelength about the middle, or closes the loop if no search is configured.
    fn begin(&self, state: &mut PathLengthState) -> PathLengthPhase {
        state.integral_q32 = self.middle_q32();
        state.brightest = 0;
        if self.sweep_periods == 0 {
            state.aside = state.status.contains(PathLengthStatus::NO_PEAK) && !state.aside;
            state.integral_q32 += if state.aside { q32(self.wavelength) / 2 } else { 0 };
            return PathLengthPhase::Settling { left: self.settle_periods };
        }
        // The build limits it to the range, so nothing overflows and nothing is clamped.
        let half = self.sweep_step_q32.saturating_mul(i64::from(self.sweep_periods)) / 2;
        state.integral_q32 = held(state.integral_q32 - half, q32(self.low), q32(self.high));
        PathLengthPhase::Sweeping { left: self.sweep_periods, best: 0, at_q32: self.middle_q32() }
    }

    fn sweep(&self, state: &mut PathLengthState, left: u32, best: i64, at_q32: i64, sum: i64) -> PathLengthPhase {
        let (best, at_q32) = if sum > best { (sum, state.integral_q32) } else { (best, at_q32) };
        if left == 0 && best < self.dark_sum {
            return self.wait();
        }
        if left == 0 {
            state.integral_q32 = at_q32;
            state.brightest = best;
            return PathLengthPhase::Settling { left: self.settle_periods };
        }
        state.integral_q32 += self.sweep_step_q32;
        PathLengthPhase::Sweeping { left: left - 1, best, at_q32 }
    }

    /// After the settling time: closes the loop if the light repeats what the search found, at the same current.
    fn close(&self, state: &mut PathLengthState, sum: i64) -> PathLengthPhase {
        let repeated = sum.saturating_mul(2) >= state.brightest;
        state.brightest = 0;
        state.evidence = Evidence::default();
        if repeated { PathLengthPhase::Closing { good: 0, since: 0 } } else { self.without_peak(state) }
    }

    /// Locks after a lock time of small errors whose light curves as on a peak.
    fn lock(&self, state: &mut PathLengthState, good: u32, since: u32, sums: &Sums) -> PathLengthPhase {
        if good <= 1 {
            state.evidence = Evidence::default();
        }
        state.evidence.add(sums, self.most_curvature_q8);
        if good < self.lock_periods {
            return PathLengthPhase::Closing { good, since: since + 1 };
        }
        let peak = state.evidence.shows_peak(self.least_curvature_q8);
        state.evidence = Evidence::default();
        if peak { PathLengthPhase::Locked { bad: 0, checked: 0 } } else { self.without_peak(state) }
    }

    /// No peak was found here: reported, and begun again.
    fn without_peak(&self, state: &mut PathLengthState) -> PathLengthPhase {
        state.status |= PathLengthStatus::NO_PEAK;
        self.wait()
    }

    fn stay_or_reset(&self, state: &mut PathLengthState, bad: u32, checked: u32, sums: &Sums) -> PathLengthPhase {
        state.evidence.add(sums, self.most_curvature_q8);
        let mut checked = checked;
        if checked >= self.lost_periods {
            if !state.evidence.shows_peak(self.least_curvature_q8 / 2) {
                return self.without_peak(state);
            }
            (state.evidence, checked) = (Evidence::default(), 0);
        }
        let at = codes(state.integral_q32);
        if at > self.reset_low && at < self.reset_high {
            return PathLengthPhase::Locked { bad, checked };
        }
        let away = at - codes(self.middle_q32());
        let nearest = (away.abs() + self.wavelength / 2).checked_div(self.wavelength).unwrap_or(1).max(1);
        let waves = if away > 0 { -nearest } else { nearest };
        let to = i64::from(at) + i64::from(waves) * i64::from(self.wavelength);
        let to_q32 = held(to << 32, q32(self.low), q32(self.high));
        state.modes = state.modes.saturating_add(waves);
        PathLengthPhase::Resetting { to_q32 }
    }

    fn status(&self, state: &PathLengthState, dark: bool) -> PathLengthStatus {
        use PathLengthPhase::{Locked, Resetting, Settling, Sweeping};
        let mut status = match state.phase {
            Locked { .. } => PathLengthStatus::OK,
            Sweeping { .. } => PathLengthStatus::INVALID | PathLengthStatus::ACQUIRING | PathLengthStatus::HOLD_LIGHT,
            Settling { .. } if state.brightest > 0 => {
                PathLengthStatus::INVALID | PathLengthStatus::ACQUIRING | PathLengthStatus::HOLD_LIGHT
            }
            Resetting { .. } => PathLengthStatus::INVALID | PathLengthStatus::RESETTING | PathLengthStatus::HOLD_LIGHT,
            _ => PathLengthStatus::INVALID | PathLengthStatus::ACQUIRING,
        };
        if dark {
            status |= PathLengthStatus::LOW_SIGNAL | PathLengthStatus::INVALID;
        }
        if state.held <= self.low || state.held >= self.high {
            status |= PathLengthStatus::AT_LIMIT;
        }
        if state.status.contains(PathLengthStatus::WAS_LOST) {
            status |= PathLengthStatus::WAS_LOST;
        }
        if state.status.contains(PathLengthStatus::NO_PEAK) && !matches!(state.phase, Locked { .. }) {
            status |= PathLengthStatus::NO_PEAK;
        }
        status
    }
}

#[cfg(feature = "design")]
pub use build::{PathLengthConfig, PathLengthDesign};

#[cfg(feature = "design")]
mod build;
