//! The dither stripper driven by records.
//!
//! | operation | inputs | outputs |
//! |---|---|---|
//! | 0 start | longest period, least swing | 0 |
//! | 1 run | ticks, seed, counts, bits, amplitude, step, bits of the pickoff, place of the pickoff | hash, Σ stripped (two words), pending (two words), dither found, periods |
//!
//! Each tick has counts plus noise, and a pickoff of place + amplitude·y + noise, held to 32 bits: y is a parabola instead of a sine, of
//! the phase that grows by the step. The hash is over counts, length and completeness of each period, and over each tick's verdict.

use sagnac_loops::Stripper;

use crate::stimulus::{Hash, Noise, halves};
use crate::{INPUTS, OUTPUTS};

/// The machine of this module.
#[derive(Clone, Copy, Debug)]
pub struct StripperMachine {
    stripper: Stripper,
    phase: u32,
    ticks: u64,
}

impl Default for StripperMachine {
    fn default() -> Self {
        Self::new()
    }
}

impl StripperMachine {
    /// A stripper for periods of one tick.
    pub const fn new() -> Self {
        Self { stripper: Stripper::new(1, 0), phase: 0, ticks: 0 }
    }

    /// Number of ticks so far.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Runs one record; `None` if there is no such operation.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        match operation {
            0 => {
                let [longest, least_swing, ..] = *inputs;
                let longest = u16::try_from(longest).unwrap_or(u16::MAX);
                *self = Self { stripper: Stripper::new(longest, least_swing), phase: 0, ticks: self.ticks };
                Some([0; OUTPUTS])
            }
            1 => Some(self.run(inputs)),
            _ => None,
        }
    }

    fn run(&mut self, inputs: &[u32; INPUTS]) -> [u32; OUTPUTS] {
        let [ticks, seed, counts, bits, amplitude, step, pickoff_bits, place] = *inputs;
        let (mut noise, mut hash, mut sum, mut periods) = (Noise::new(seed), Hash::new(), 0_i64, 0_u32);
        for _ in 0..ticks {
            let counts = counts.cast_signed().wrapping_add(noise.about_zero(bits));
            self.phase = self.phase.wrapping_add(step);
            let p = i64::from(self.phase.cast_signed());
            let y = (p * ((1 << 31) - p.abs())) >> 31;
            let swing = (i64::from(amplitude) * y) >> 29;
            let wanted = i64::from(place.cast_signed()) + swing + i64::from(noise.about_zero(pickoff_bits));
            let pickoff = wanted.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
            if let Some(out) = self.stripper.update(counts, pickoff) {
                let [low, high] = halves(out.counts);
                [low, high, u32::from(out.ticks), u32::from(out.without_zero)]
                    .into_iter()
                    .for_each(|word| hash.add(word));
                sum = sum.wrapping_add(out.counts);
                periods += 1;
            }
            hash.add(u32::from(self.stripper.has_dither()));
        }
        self.ticks += u64::from(ticks);
        let ([low, high], [pending, above]) = (halves(sum), halves(self.stripper.pending()));
        [hash.value(), low, high, pending, above, u32::from(self.stripper.has_dither()), periods]
    }
}
