//! The compensator driven by records.
//!
//! | operation | inputs | outputs |
//! |---|---|---|
//! | 0 power on | | 0 |
//! | 1 slow update | bits of the inputs that have a sample, four codes | error, status, k, target increment |
//! | 2 run | ticks, seed, base, bits | Σ counts, hash of (counts, status), remainder, increment, last status + error·2¹⁶ |
//! | 3 advance | raw, ticks | error, counts, status, remainder, increment |
//! | 4 skip | ticks | error, ticks to the update, 0, remainder, increment |
//! | 5 migrate the state (to the same image) | | 0, 0, status, remainder, increment |
//! | 6 clear an overflow | | 0, 0, status, remainder, increment |
//!
//! Each tick of a run has raw = base + noise of the given number of bits. 64-bit values are two words, the lower first.
//! Errors: 1 update due, 2 update not due, 3 raw out of range, 4 number of codes.

use sagnac_core::{Compensator, Image, Misuse, State};

use crate::stimulus::{Hash, Noise, halves};
use crate::{INPUTS, OUTPUTS};

/// The machine of this module.
#[derive(Clone, Copy, Debug)]
pub struct CompensatorMachine {
    gyro: Compensator,
    state: State,
    ticks: u64,
}

impl CompensatorMachine {
    /// A machine with this image; `None` if the image is refused.
    pub fn new(image: &[u8]) -> Option<Self> {
        let gyro = Compensator::new(Image::decode(image).ok()?);
        Some(Self { gyro, state: State::new(), ticks: 0 })
    }

    /// Number of ticks so far.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Runs one record; `None` if there is no such operation.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        let [a, b, c, d, e, ..] = *inputs;
        match operation {
            0 => {
                self.state = State::new();
                Some([0; OUTPUTS])
            }
            1 => Some(self.update(a, [b, c, d, e])),
            2 => Some(self.run(a, b, c as i32, d)),
            3 => Some(self.advance(a as i32, b)),
            4 => {
                let error = self.gyro.skip(&mut self.state, a).map_or_else(code, |()| 0);
                Some(self.with_state([error, self.state.ticks_to_update(), 0]))
            }
            5 => {
                self.state = self.gyro.migrate_state(&self.state);
                Some(self.with_state([0, 0, self.state.status().bits().into()]))
            }
            6 => {
                self.state.clear_overflow();
                Some(self.with_state([0, 0, self.state.status().bits().into()]))
            }
            _ => None,
        }
    }

    fn update(&mut self, present: u32, codes: [u32; 4]) -> [u32; OUTPUTS] {
        let mut samples = [None; 4];
        for (i, (slot, code)) in samples.iter_mut().zip(codes).enumerate() {
            *slot = (present >> i & 1 == 1).then_some(code as i32);
        }
        let wanted = self.gyro.image().inputs().len();
        let result = self.gyro.update(&mut self.state, samples.get(..wanted).unwrap_or(&[]));
        let (error, status) = result.map_or_else(|misuse| (code(misuse), 0), |status| (0, status.bits().into()));
        let ([k0, k1], [t0, t1]) = (halves(self.state.k_q32()), halves(self.state.target_increment()));
        [error, status, k0, k1, t0, t1, 0]
    }

    fn run(&mut self, ticks: u32, seed: u32, base: i32, bits: u32) -> [u32; OUTPUTS] {
        let (mut noise, mut hash) = (Noise::new(seed), Hash::new());
        let (mut sum, mut last) = (0_u32, 0_u32);
        for _ in 0..ticks {
            let raw = base.wrapping_add(noise.about_zero(bits));
            match self.gyro.tick(&mut self.state, raw) {
                Ok(output) => {
                    sum = sum.wrapping_add(output.counts as u32);
                    last = output.status.bits().into();
                    hash.add(output.counts as u32);
                    hash.add(last);
                }
                Err(misuse) => {
                    last = code(misuse) << 16;
                    break;
                }
            }
        }
        self.ticks += u64::from(ticks);
        let [_, _, _, r0, r1, i0, i1] = self.with_state([0; 3]);
        [sum, hash.value(), r0, r1, i0, i1, last]
    }

    fn advance(&mut self, raw: i32, ticks: u32) -> [u32; OUTPUTS] {
        match self.gyro.advance(&mut self.state, raw, ticks) {
            Ok(output) => {
                self.ticks += u64::from(ticks);
                self.with_state([0, output.counts as u32, output.status.bits().into()])
            }
            Err(misuse) => self.with_state([code(misuse), 0, 0]),
        }
    }

    fn with_state(&self, first: [u32; 3]) -> [u32; OUTPUTS] {
        let ([r0, r1], [i0, i1]) = (halves(self.state.remainder()), halves(self.state.increment()));
        let [a, b, c] = first;
        [a, b, c, r0, r1, i0, i1]
    }
}

const fn code(misuse: Misuse) -> u32 {
    match misuse {
        Misuse::UpdateDue { .. } => 1,
        Misuse::UpdateNotDue { .. } => 2,
        Misuse::RawOutOfRange => 3,
        Misuse::InputCount => 4,
        Misuse::Outdated => 5,
    }
}
