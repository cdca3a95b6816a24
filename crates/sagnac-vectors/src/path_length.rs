//! The path-length loop driven by records, closed over a small plant of integers.
//!
//! * Operation 0, start: no inputs; output 0.
//! * Operation 1, run:
//!   inputs: ticks, seed, position of the peak (2⁻³² codes, two words), its drift (2⁻¹⁶ codes per tick), light at the peak,
//!   curvature, flags;
//!   outputs: hash of (actuator, modulation, and after the last tick of a
//!   period the low word of its second harmonic), hash of (status, phase), phase + status·2⁸ + modes·2¹⁶, error, held code,
//!   integrator (two words).
//!
//! Flags: number of noise bits in the lowest eight bits; 256: the loop is closed or locked during the whole run; 512: there
//! is light; the lag of the actuator, a right shift of 0 to 31, in the upper 16 bits. The plant is advanced before each
//! tick, from the last actuator and modulation codes, with w the wavelength:
//!
//! ```text
//! place += drift·2¹⁶            at += ⌊(actuator·2³² − at)·2^−lag⌋             x = ⌊at·2⁻³²⌋ + modulation
//! d = (x − ⌊place·2⁻³²⌋) mod w, reduced to (w/2 − w, w/2]
//! code = max(0, light − ⌊d²·curvature·2⁻³²⌋) + noise                (without light: only noise)
//! ```
//!
//! Phases: 0 dark, 1 sweeping, 2 settling, 3 closing, 4 locked, 5 resetting.

use sagnac_loops::{LoopTable, PathLength, PathLengthPhase, PathLengthState};

use crate::stimulus::{Hash, Noise, halves};
use crate::{INPUTS, OUTPUTS};

/// Flag: the loop is closed or locked during the whole run.
const CLOSED: u32 = 1 << 8;
/// Flag: there is light.
const LIGHT: u32 = 1 << 9;

/// The machine of this module.
#[derive(Clone, Copy, Debug)]
pub struct PathLengthMachine {
    table: PathLength,
    state: PathLengthState,
    /// Last codes of the actuator and the modulation.
    actuator: i32,
    modulation: i32,
    /// Position of the actuator, 2^-32 codes.
    at_q32: i64,
    was_closed: bool,
    ticks: u64,
}

/// The plant of one run.
struct Plant {
    place_q32: i64,
    drift_q32: i64,
    light: i64,
    curvature: i64,
    wavelength: i64,
}

impl Plant {
    fn code(&mut self, x: i32) -> i32 {
        self.place_q32 = self.place_q32.wrapping_add(self.drift_q32);
        let from = (i64::from(x) - (self.place_q32 >> 32)).checked_rem_euclid(self.wavelength).unwrap_or(0);
        let d = if from > self.wavelength / 2 { from - self.wavelength } else { from };
        let loss = (d * d).saturating_mul(self.curvature) >> 32;
        (self.light - loss).max(0) as i32
    }
}

impl PathLengthMachine {
    /// A machine with this table of the loops; `None` if the table is refused.
    pub fn new(table: &[u8]) -> Option<Self> {
        let table = LoopTable::decode(table).ok()?.path_length;
        let state = table.start();
        let actuator = state.held();
        let at_q32 = i64::from(actuator) << 32;
        Some(Self { table, state, actuator, modulation: 0, at_q32, was_closed: false, ticks: 0 })
    }

    /// Number of ticks so far.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// True if the loop is closed or locked.
    pub const fn is_closed(&self) -> bool {
        matches!(self.state.phase(), PathLengthPhase::Closing { .. } | PathLengthPhase::Locked { .. })
    }

    /// True if it was closed or locked in every tick of the last run.
    pub const fn was_closed(&self) -> bool {
        self.was_closed
    }

    /// Runs one record; `None` if there is no such operation.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        match operation {
            0 => {
                self.state = self.table.start();
                (self.actuator, self.modulation) = (self.state.held(), 0);
                self.at_q32 = i64::from(self.actuator) << 32;
                Some([0; OUTPUTS])
            }
            1 => Some(self.run(inputs)),
            _ => None,
        }
    }

    fn run(&mut self, inputs: &[u32; INPUTS]) -> [u32; OUTPUTS] {
        let [ticks, seed, place_lo, place_hi, drift, light, curvature, flags] = *inputs;
        let mut plant = Plant {
            place_q32: (i64::from(place_hi as i32) << 32) | i64::from(place_lo),
            drift_q32: i64::from(drift as i32) << 16,
            light: if flags & LIGHT == 0 { 0 } else { i64::from(light) },
            curvature: i64::from(curvature),
            wavelength: self.table.wavelength().into(),
        };
        let (mut noise, mut actuated, mut reported) = (Noise::new(seed), Hash::new(), Hash::new());
        self.was_closed = ticks > 0;
        for _ in 0..ticks {
            self.at_q32 += ((i64::from(self.actuator) << 32) - self.at_q32) >> (flags >> 16).min(31);
            let x = ((self.at_q32 >> 32) as i32).wrapping_add(self.modulation);
            let code = plant.code(x).wrapping_add(noise.about_zero(flags & 0xff));
            let out = self.table.tick(&mut self.state, code);
            (self.actuator, self.modulation) = (out.actuator, out.modulation);
            actuated.add(out.actuator as u32);
            actuated.add(out.modulation as u32);
            if self.state.begins_period() {
                actuated.add(self.state.second_harmonic() as u32);
            }
            reported.add(out.status.bits().into());
            reported.add(phase(self.state.phase()));
            self.was_closed &= self.is_closed();
        }
        self.ticks += u64::from(ticks);
        let [i0, i1] = halves(self.state.integral_q32());
        let modes = (self.state.modes() as u32) << 16;
        let word = phase(self.state.phase()) | u32::from(self.state.status().bits()) << 8 | modes;
        // A wrong flag changes the hash.
        let reported = if flags & CLOSED != 0 && !self.was_closed { !reported.value() } else { reported.value() };
        [actuated.value(), reported, word, self.state.error() as u32, self.state.held() as u32, i0, i1]
    }
}

const fn phase(phase: PathLengthPhase) -> u32 {
    match phase {
        PathLengthPhase::Dark { .. } => 0,
        PathLengthPhase::Sweeping { .. } => 1,
        PathLengthPhase::Settling { .. } => 2,
        PathLengthPhase::Closing { .. } => 3,
        PathLengthPhase::Locked { .. } => 4,
        PathLengthPhase::Resetting { .. } => 5,
    }
}
