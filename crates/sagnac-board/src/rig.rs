//! A gyro for a board that has none: levels, pickoff and light from the rows of a log.
//!
//! ```text
//! row: counts over ticks ─▶ spread evenly ─┬─▶ quarter steps ─▶ A/B levels
//! dither: y = 4p(1 − 2|p|), p in turns ────┘         (a parabola in place of a sine; the pickoff shows y itself)
//! light = lamp(current)·(1 − c·d²) + noise           d: actuator's place off the peak, within a wavelength
//! ```
//!
//! Everything is integers, so that an emulated board and one on the host see the same to the bit. The rig is the
//! simulator's log with the readout and the loops' plant added, not the simulator: physics is in `sagnac-sim`.

use crate::board::{Commands, Sample};
use crate::message::{RigSettings, Row};

/// Steps of a tick are held to this: 40 MHz of counts.
const MOST_STEPS: i32 = 4096;

/// The stand-in.
#[derive(Clone, Copy, Debug)]
pub struct Rig {
    settings: RigSettings,
    row: Row,
    /// Ticks of the row to go.
    left: u32,
    /// Whole counts of a tick, and what is left of them in counts per row.
    whole: i32,
    part: u32,
    carried: u32,
    phase: u32,
    /// Counts of the swing so far.
    swing: i32,
    /// Place in the fringe, quarter steps.
    place: u8,
    light_q16: i64,
    at_q32: i64,
    noise: u32,
}

impl Rig {
    /// Levels before the first tick.
    pub const LEVELS: (bool, bool) = (false, false);

    /// At rest, in the dark.
    pub const fn new(settings: RigSettings) -> Self {
        Self {
            settings,
            row: Row { ticks: 0, counts: 0, present: 0, codes: [0; 4] },
            left: 0,
            whole: 0,
            part: 0,
            carried: 0,
            phase: 0,
            swing: 0,
            place: 0,
            light_q16: 0,
            at_q32: 0,
            noise: 1,
        }
    }

    /// Ticks of the row to go.
    pub const fn left(&self) -> u32 {
        self.left
    }

    /// Begins a row. What was left of the one before is lost, so wait for [`Rig::left`] to be 0.
    pub fn begin(&mut self, row: Row) {
        let counts = i64::from(row.counts);
        let ticks = i64::from(row.ticks);
        self.whole = counts.checked_div_euclid(ticks).unwrap_or(0) as i32;
        self.part = counts.checked_rem_euclid(ticks).unwrap_or(0) as u32;
        (self.row, self.left, self.carried) = (row, row.ticks, 0);
    }

    /// The levels and the sample of the next tick, after what the board set in the one before.
    pub fn tick(&mut self, commands: &Commands) -> (Levels, Sample) {
        self.left = self.left.saturating_sub(1);
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
        // Whatever a row says, a tick ends.
        steps = steps.saturating_add(swing).clamp(-MOST_STEPS, MOST_STEPS);
        let levels = Levels { place: self.place, left: steps };
        self.place = (i32::from(self.place).wrapping_add(steps) & 3) as u8;
        let light = self.light(commands);
        let mut codes = [None; 4];
        for (i, (slot, code)) in codes.iter_mut().zip(self.row.codes).enumerate() {
            *slot = (self.row.present >> i & 1 == 1).then_some(code);
        }
        (levels, Sample { codes, pickoff, light })
    }

    /// Counts that the swing adds in this tick, and its angle at the end.
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

    fn light(&mut self, commands: &Commands) -> i32 {
        let s = &self.settings;
        let lamp = i64::from(commands.current).wrapping_mul(i64::from(s.lamp_gain));
        self.light_q16 += (lamp - self.light_q16) >> s.lamp_lag.min(31);
        let wanted = i64::from(commands.actuator.wrapping_sub(commands.modulation)) << 32;
        self.at_q32 += (wanted - self.at_q32) >> s.actuator_lag.min(31);
        let warm = (i64::from(self.row.codes.first().copied().unwrap_or(0)) * i64::from(s.place_slope)) >> 40;
        let x = (self.at_q32 >> 32) + i64::from(commands.modulation) - i64::from(s.place) - warm;
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

/// The levels of a tick: as many steps forward or back as it counts.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    place: u8,
    left: i32,
}

impl Iterator for Levels {
    type Item = (bool, bool);

    #[inline]
    fn next(&mut self) -> Option<(bool, bool)> {
        let step = self.left.signum();
        if step == 0 {
            return None;
        }
        self.left -= step;
        self.place = (i32::from(self.place) + step) as u8 & 3;
        Some((matches!(self.place, 1 | 2), matches!(self.place, 2 | 3)))
    }
}
