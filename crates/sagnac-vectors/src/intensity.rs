//! The intensity loop driven by records, closed over a lamp of integers.
//!
//! * Operation 0, start: no inputs; output 0.
//! * Operation 1, run:
//!   inputs: ticks, seed, light per current code (2⁻¹⁶), lag (a right shift, at most 31), flags;
//!   outputs: hash of (current, status), phase + status·2⁸, current, integrator (two words), light (two words).
//!
//! Flags: number of noise bits in the lowest eight bits; 256: hold; 512: the discharge burns. The lamp is advanced before
//! each tick:
//!
//! ```text
//! light += ⌊(current·gain − light)·2^−lag⌋  (2⁻¹⁶ codes)        code = ⌊light·2⁻¹⁶⌋ + noise
//! ```
//!
//! Phases: 0 igniting, 1 resting, 2 running, 3 failed.

use sagnac_loops::{Intensity, IntensityPhase, IntensityState, LoopTable};

use crate::stimulus::{Hash, Noise, halves};
use crate::{INPUTS, OUTPUTS};

/// The machine of this module.
#[derive(Clone, Copy, Debug)]
pub struct IntensityMachine {
    table: Intensity,
    state: IntensityState,
    /// Last current, code.
    current: i32,
    light_q16: i64,
    ticks: u64,
}

impl IntensityMachine {
    /// A machine with this table of the loops; `None` if the table is refused.
    pub fn new(table: &[u8]) -> Option<Self> {
        let table = LoopTable::decode(table).ok()?.intensity;
        Some(Self { table, state: table.start(), current: 0, light_q16: 0, ticks: 0 })
    }

    /// Number of ticks so far.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Runs one record; `None` if there is no such operation.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        match operation {
            0 => {
                (self.state, self.current, self.light_q16) = (self.table.start(), 0, 0);
                Some([0; OUTPUTS])
            }
            1 => Some(self.run(inputs)),
            _ => None,
        }
    }

    fn run(&mut self, inputs: &[u32; INPUTS]) -> [u32; OUTPUTS] {
        let [ticks, seed, gain, lag, flags, ..] = *inputs;
        let gain = if flags & (1 << 9) == 0 { 0 } else { i64::from(gain) };
        let (mut noise, mut hash) = (Noise::new(seed), Hash::new());
        let mut status = 0_u32;
        for _ in 0..ticks {
            // |current·gain| ≤ 2^23·2^32.
            self.light_q16 += (i64::from(self.current) * gain - self.light_q16) >> lag.min(31);
            let code = ((self.light_q16 >> 16) as i32).wrapping_add(noise.about_zero(flags & 0xff));
            let out = self.table.tick(&mut self.state, code, flags & (1 << 8) != 0);
            (self.current, status) = (out.current, out.status.bits().into());
            hash.add(self.current as u32);
            hash.add(status);
        }
        self.ticks += u64::from(ticks);
        let ([i0, i1], [l0, l1]) = (halves(self.state.integral_q32()), halves(self.light_q16));
        [hash.value(), phase(self.state.phase()) | status << 8, self.current as u32, i0, i1, l0, l1]
    }
}

const fn phase(phase: IntensityPhase) -> u32 {
    match phase {
        IntensityPhase::Igniting { .. } => 0,
        IntensityPhase::Resting { .. } => 1,
        IntensityPhase::Running { .. } => 2,
        IntensityPhase::Failed => 3,
    }
}
