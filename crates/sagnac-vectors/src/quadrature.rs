//! The quadrature counter driven by records.
//!
//! | operation | inputs | outputs |
//! |---|---|---|
//! | 0 start | counts per fringe: 1, 2 or 4 | 0 |
//! | 1 run | pairs of levels, seed, three limits | Σ counts, lost steps, hash of the counts, place, 0 … |
//!
//! Before each pair the place in the circle moves by what the generator's word is below of: the first limit one
//! forward, the second one back, the third two; else it stays. A is up in places 1 and 2, B in 2 and 3.

use sagnac_loops::{Multiplier, Quadrature, QuadratureState};

use crate::stimulus::{Hash, Noise};
use crate::{INPUTS, OUTPUTS};

/// See the module.
#[derive(Clone, Copy, Debug)]
pub struct QuadratureMachine {
    counter: Quadrature,
    state: QuadratureState,
    place: u32,
    ticks: u64,
}

impl Default for QuadratureMachine {
    fn default() -> Self {
        Self::new()
    }
}

impl QuadratureMachine {
    /// A counter of four per fringe.
    pub const fn new() -> Self {
        let counter = Quadrature { multiplier: Multiplier::X4 };
        Self { counter, state: QuadratureState::new(), place: 0, ticks: 0 }
    }

    /// Pairs of levels so far.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// One record.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        match operation {
            0 => {
                let multiplier = match inputs.first()? {
                    1 => Multiplier::X1,
                    2 => Multiplier::X2,
                    4 => Multiplier::X4,
                    _ => return None,
                };
                *self = Self { counter: Quadrature { multiplier }, ticks: self.ticks, ..Self::new() };
                Some([0; OUTPUTS])
            }
            1 => Some(self.run(inputs)),
            _ => None,
        }
    }

    fn run(&mut self, inputs: &[u32; INPUTS]) -> [u32; OUTPUTS] {
        let [pairs, seed, forward, back, double, ..] = *inputs;
        let (mut noise, mut hash, mut sum) = (Noise::new(seed), Hash::new(), 0_u32);
        for _ in 0..pairs {
            let word = noise.word();
            let step = if word < forward {
                1
            } else if word < back {
                3
            } else if word < double {
                2
            } else {
                0
            };
            self.place = (self.place + step) & 3;
            let (a, b) = (matches!(self.place, 1 | 2), matches!(self.place, 2 | 3));
            let count = self.counter.take(&mut self.state, a, b);
            sum = sum.wrapping_add(count as u32);
            hash.take(count as u32);
        }
        self.ticks += u64::from(pairs);
        [sum, self.state.lost, hash.value(), self.place, 0, 0, 0]
    }
}
