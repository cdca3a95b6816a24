//! The quadrature counter driven by records.
//!
//! | operation | inputs | outputs |
//! |---|---|---|
//! | 0 start | counts per fringe: 1, 2 or 4 | 0 |
//! | 1 run | pairs of levels, seed, three limits | Σ counts, lost steps, hash of the counts, quarter, 0 … |
//!
//! Before each pair the quarter moves by the word of the generator: one forward if it is below the first limit, one back if
//! below the second, two if below the third; otherwise it stays. A is high in quarters 1 and 2, B in 2 and 3.

use sagnac_loops::{Counting, Quadrature, QuadratureState};

use crate::stimulus::{Hash, Noise};
use crate::{INPUTS, OUTPUTS};

/// The machine of this module.
#[derive(Clone, Copy, Debug)]
pub struct QuadratureMachine {
    counter: Quadrature,
    state: QuadratureState,
    quarter: u32,
    ticks: u64,
}

impl Default for QuadratureMachine {
    fn default() -> Self {
        Self::new()
    }
}

impl QuadratureMachine {
    /// A counter with four counts per fringe.
    pub const fn new() -> Self {
        let counter = Quadrature { counting: Counting::X4 };
        Self { counter, state: QuadratureState::new(), quarter: 0, ticks: 0 }
    }

    /// Number of pairs of levels so far.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Runs one record; `None` if there is no such operation.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        match operation {
            0 => {
                let counting = match inputs.first()? {
                    1 => Counting::X1,
                    2 => Counting::X2,
                    4 => Counting::X4,
                    _ => return None,
                };
                *self = Self { counter: Quadrature { counting }, ticks: self.ticks, ..Self::new() };
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
            self.quarter = (self.quarter + step) & 3;
            let (a, b) = (matches!(self.quarter, 1 | 2), matches!(self.quarter, 2 | 3));
            let count = self.counter.update(&mut self.state, a, b);
            sum = sum.wrapping_add(count as u32);
            hash.add(count as u32);
        }
        self.ticks += u64::from(pairs);
        [sum, self.state.lost, hash.value(), self.quarter, 0, 0, 0]
    }
}
