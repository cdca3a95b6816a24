//! What an image costs the processor at a slow update.
//!
//! ```text
//! 572 + 15·[any term] + 472·(inputs − 1) + 157·(lags) + 77·(terms) + 6·(zones) + 112·(cosines and sines)
//! ```
//!
//! in instructions of a Cortex-M4F, of the Rust code at `opt-level = 3`. `cargo xtask firmware` holds this form to within 2 % of what an
//! emulator counts for fourteen images, from none to many terms; the terms cost the same at any order, because the basis is made to
//! order 8 whatever is used of it. Instructions are not cycles, and another processor or compiler has other figures: measure one
//! image there and take the ratio. A tick costs 46 instructions whatever the image.

use crate::image::{Image, Shape};

const BASE: u32 = 572;
const SERIES: u32 = 15;
const INPUT: u32 = 472;
const LAG: u32 = 157;
const TERM: u32 = 77;

/// What a slow update has to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Thermometers, differences, columns, repeats and warm-ups.
    pub inputs: u32,
    /// Lag filters.
    pub lags: u32,
    /// Terms of any shape.
    pub terms: u32,
    /// Instructions that their shapes add ([`Shape::instructions`]).
    pub shapes: u32,
}

impl Work {
    /// Instructions of a slow update.
    pub const fn instructions(self) -> u32 {
        let others = INPUT.saturating_mul(self.inputs.saturating_sub(1));
        let series = if self.terms > 0 { SERIES } else { 0 };
        let rest = others.saturating_add(LAG.saturating_mul(self.lags)).saturating_add(TERM.saturating_mul(self.terms));
        rest.saturating_add(self.shapes).saturating_add(BASE + series)
    }
}

impl Shape {
    /// What a term of this shape costs beyond what every term costs, instructions.
    pub const fn instructions(self) -> u32 {
        match self {
            Self::Chebyshev(_) | Self::Step { .. } => 0,
            Self::Zone { .. } => 6,
            Self::Cosine { .. } | Self::Sine { .. } => 112,
        }
    }
}

impl Image {
    /// What its slow update has to do. At most 8,679 instructions: four inputs with a lag each and 32 harmonics.
    pub fn work(&self) -> Work {
        let (inputs, terms) = (self.inputs(), self.terms());
        Work {
            inputs: inputs.len() as u32,
            lags: inputs.iter().filter(|input| input.lag.is_used()).count() as u32,
            terms: terms.len() as u32,
            shapes: terms.iter().fold(0, |sum: u32, term| sum.saturating_add(term.shape.instructions())),
        }
    }
}
