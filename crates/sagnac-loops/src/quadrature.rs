//! Two photodiodes a quarter fringe apart, counted.
//!
//! ```text
//! A B   00 ─▶ 10 ─▶ 11 ─▶ 01 ─▶ 00     one fringe forward: the phase ψ grows by 2π
//! ```
//!
//! A leads B by a quarter when ψ grows. ×4 counts each step, ×2 each change of A, ×1 each rise of A with B low (down when A falls with B
//! low), so that trembling on an edge counts up and down and adds nothing. Two steps at once cannot be told in
//! direction: they are counted as lost and reported.

/// Counts of a fringe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Multiplier {
    /// One.
    X1,
    /// Two.
    X2,
    /// Four.
    X4,
}

impl Multiplier {
    /// Counts of a fringe.
    pub const fn counts_per_fringe(self) -> i32 {
        match self {
            Self::X1 => 1,
            Self::X2 => 2,
            Self::X4 => 4,
        }
    }
}

/// A quadrature counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quadrature {
    /// What is counted.
    pub multiplier: Multiplier,
}

/// What a counter remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuadratureState {
    /// Place in the circle, 0 to 3; `None` before the first sample.
    place: Option<u8>,
    /// Double steps seen: fringes came faster than samples.
    pub lost: u32,
}

impl QuadratureState {
    /// Before the first sample.
    pub const fn new() -> Self {
        Self { place: None, lost: 0 }
    }
}

impl Quadrature {
    /// The counts that one pair of comparator levels adds: −1, 0 or 1 (0 for the first pair and a lost step).
    pub fn take(&self, state: &mut QuadratureState, a: bool, b: bool) -> i32 {
        let place = match (a, b) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3_u8,
        };
        let Some(before) = state.place.replace(place) else { return 0 };
        match place.wrapping_sub(before) & 3 {
            1 => self.counted(place),
            3 => -self.counted(before),
            2 => {
                state.lost = state.lost.saturating_add(1);
                0
            }
            _ => 0,
        }
    }

    /// Whether the step onto a place, going forward, is counted.
    fn counted(&self, onto: u8) -> i32 {
        i32::from(match self.multiplier {
            Multiplier::X4 => true,
            Multiplier::X2 => onto % 2 == 1,
            Multiplier::X1 => onto == 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Comparator levels at a phase in quarter fringes.
    fn levels(quarters: i64) -> (bool, bool) {
        let place = quarters.rem_euclid(4);
        (place == 1 || place == 2, place == 2 || place == 3)
    }

    proptest! {
        /// However the phase wanders, the count is where it stands: nothing adds up on the way.
        #[test]
        fn the_count_is_a_function_of_the_phase(steps in prop::collection::vec(-1_i64..=1, 1..400)) {
            for multiplier in [Multiplier::X1, Multiplier::X2, Multiplier::X4] {
                let counter = Quadrature { multiplier };
                let (mut state, mut phase, mut count) = (QuadratureState::default(), 0_i64, 0_i64);
                counter.take(&mut state, false, false);
                for step in &steps {
                    phase += step;
                    let (a, b) = levels(phase);
                    count += i64::from(counter.take(&mut state, a, b));
                    let per_step = 4 / i64::from(multiplier.counts_per_fringe());
                    // The first edge counted is the one onto place 1.
                    prop_assert_eq!(count, (phase + per_step - 1).div_euclid(per_step));
                }
                prop_assert_eq!(state.lost, 0);
            }
        }
    }

    #[test]
    fn a_double_step_is_reported_not_guessed() {
        let counter = Quadrature { multiplier: Multiplier::X4 };
        let mut state = QuadratureState::default();
        counter.take(&mut state, false, false);
        assert_eq!(counter.take(&mut state, true, true), 0);
        assert_eq!(state.lost, 1);
    }
}
