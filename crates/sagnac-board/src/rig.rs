//! A replacement for the gyro: levels, pickoff and light from the rows of a log.
//!
//! ```text
//! row: counts over ticks ─▶ spread evenly ─┬─▶ quarter steps ─▶ A/B levels
//! dither: y = 4p(1 − 2|p|), p in turns ────┘         (a parabola instead of a sine; the pickoff measures y)
//! light = lamp(current)·(1 − c·d²) + noise           d: distance of the path from the peak, within a wavelength
//! ```
//!
//! Everything is in integers, so an emulated board and one on the host see the same to the bit. The rig adds the
//! readout and the plant of the loops to a log; it is not the simulator. The physics is in `sagnac-sim`.

use crate::board::{ActuatorCodes, Sample};
use crate::message::{RigSettings, Row};

/// Most quarter steps of a tick: 40 MHz of counts.
const MOST_STEPS: i32 = 4096;

/// The rig: see [`RigSettings`] for its parameters.
#[derive(Clone, Copy, Debug)]
pub struct Rig {
    settings: RigSettings,
    row: Row,
    /// Remaining ticks of the row.
    ticks_left: u32,
    /// Whole counts of a tick, and the remainder in counts per row.
    whole: i32,
    part: u32,
    carried: u32,
    phase: u32,
    /// Counts of the dither so far.
    swing: i32,
    /// Position in the fringe, quarter steps.
    quarter: u8,
    light_q16: i64,
    at_q32: i64,
    noise: u32,
}

impl Rig {
    /// Levels before the first tick.
    pub const LEVELS: (bool, bool) = (false, false);

    /// A rig at rest, without light.
    pub const fn new(settings: RigSettings) -> Self {
        Self {
            settings,
            row: Row { ticks: 0, counts: 0, present: 0, codes: [0; 4] },
            ticks_left: 0,
            whole: 0,
            part: 0,
            carried: 0,
            phase: 0,
            swing: 0,
            quarter: 0,
            light_q16: 0,
            at_q32: 0,
            noise: 1,
        }
    }

    /// Remaining ticks of the row.
    pub const fn ticks_left(&self) -> u32 {
        self.ticks_left
    }

    /// Starts a row. The rest of the row before is dropped: wait until [`Rig::ticks_left`] is 0.
    pub fn start_row(&mut self, row: Row) {
        let counts = i64::from(row.counts);
        let ticks = i64::from(row.ticks);
        self.whole = counts.checked_div_euclid(ticks).unwrap_or(0) as i32;
        self.part = counts.checked_rem_euclid(ticks).unwrap_or(0) as u32;
        (self.row, self.ticks_left, self.carried) = (row, row.ticks, 0);
    }

    /// The levels and the sample of the next tick, with the actuators as the board set them in the tick before.
    pub fn tick(&mut self, actuators: &ActuatorCodes) -> (Levels, Sample) {
        self.ticks_left = self.ticks_left.saturating_sub(1);
        let mut steps = self.whole;
        // Both are below the row's ticks.
        let carried = u64::from(self.carried) + u64::from(self.part);
        if self.row.ticks > 0 && carried >= u64::from(self.row.ticks) {
            self.carried = (carried - u64::from(self.row.ticks)) as u32;
            steps = steps.wrapping_add(1);
        } else {
            self.carried = carried as u32;
        }
        let (swing, pickoff) = self.dither();
        // A tick ends for every row, even a damaged one.
        steps = steps.saturating_add(swing).clamp(-MOST_STEPS, MOST_STEPS);
        let levels = Levels { quarter: self.quarter, steps_left: steps };
        self.quarter = (i32::from(self.quarter).wrapping_add(steps) & 3) as u8;
        let light = self.light(actuators);
        let mut codes = [None; 4];
        for (i, (slot, code)) in codes.iter_mut().zip(self.row.codes).enumerate() {
            *slot = (self.row.present >> i & 1 == 1).then_some(code);
        }
        (levels, Sample { codes, pickoff, light, ..Sample::default() })
    }

    /// Counts that the dither adds in this tick, and its angle at the end.
    fn dither(&mut self) -> (i32, i32) {
        if self.settings.dither_counts == 0 {
            return (0, 0);
        }
        self.phase = self.phase.wrapping_add(self.settings.dither_step);
        let p = i64::from(self.phase as i32);
        // 4p(1 − 2|p|) with p in 2^-32 turns: Q30, at most 1/2.
        let y = (p * ((1 << 31) - p.abs())) >> 31;
        let swing = ((i64::from(self.settings.dither_counts) * y) >> 29) as i32;
        let moved = swing.wrapping_sub(self.swing);
        self.swing = swing;
        (moved, (y >> 4) as i32)
    }

    fn light(&mut self, actuators: &ActuatorCodes) -> i32 {
        let s = &self.settings;
        let lamp = i64::from(actuators.current).wrapping_mul(i64::from(s.lamp_gain));
        self.light_q16 += (lamp - self.light_q16) >> s.lamp_lag.min(31);
        let wanted = i64::from(actuators.actuator.wrapping_sub(actuators.modulation)) << 32;
        self.at_q32 += (wanted - self.at_q32) >> s.actuator_lag.min(31);
        let warm = (i64::from(self.row.codes.first().copied().unwrap_or(0)) * i64::from(s.peak_slope)) >> 40;
        let x = (self.at_q32 >> 32) + i64::from(actuators.modulation) - i64::from(s.peak) - warm;
        let wave = i64::from(s.wavelength.max(1));
        let d = x.checked_rem_euclid(wave).unwrap_or(0);
        let d = if d > wave / 2 { d - wave } else { d };
        let lost_q16 = ((d * d).saturating_mul(i64::from(s.curvature)) >> 32).min(1 << 16);
        let light = (self.light_q16 >> 16).clamp(0, 1 << 24);
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = match s.noise_bits.min(20) {
            0 => 0,
            bits => i64::from(self.noise >> (32 - bits)) - (1 << (bits - 1)),
        };
        (((light * ((1 << 16) - lost_q16)) >> 16) + noise) as i32
    }
}

/// The levels of a tick: one item for each quarter step, forward or back.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    quarter: u8,
    steps_left: i32,
}

impl Iterator for Levels {
    type Item = (bool, bool);

    #[inline]
    fn next(&mut self) -> Option<(bool, bool)> {
        let step = self.steps_left.signum();
        if step == 0 {
            return None;
        }
        self.steps_left -= step;
        self.quarter = (i32::from(self.quarter) + step) as u8 & 3;
        Some((matches!(self.quarter, 1 | 2), matches!(self.quarter, 2 | 3)))
    }
}
