//! Counts the fringes that two photodiodes see a quarter fringe apart.
//!
//! ```text
//! A B   00 ─▶ 10 ─▶ 11 ─▶ 01 ─▶ 00     one fringe forward: the phase ψ grows by 2π
//! ```
//!
//! A leads B by a quarter when ψ grows. ×4 counts each step, ×2 each change of A, ×1 each rise of A with B low (down
//! when A falls with B low). So jitter on an edge counts up and down and adds nothing. A double step has no known
//! direction: it adds no count and is reported as lost.

/// Counts per fringe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counting {
    /// One.
    X1,
    /// Two.
    X2,
    /// Four.
    X4,
}

impl Counting {
    /// The number of counts per fringe.
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
    /// Counts per fringe.
    pub counting: Counting,
}

/// Memory of a counter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuadratureState {
    /// Quarter of the fringe, 0 to 3; `None` before the first sample.
    quarter: Option<u8>,
    /// Number of double steps: the fringes were faster than the samples.
    pub lost: u32,
}

impl QuadratureState {
    /// Before the first sample.
    pub const fn new() -> Self {
        Self { quarter: None, lost: 0 }
    }
}

impl Quadrature {
    /// Takes one pair of comparator levels; returns the counts that it adds: −1, 0 or 1 (0 for the first pair and for a
    /// lost step).
    pub fn update(&self, state: &mut QuadratureState, a: bool, b: bool) -> i32 {
        let quarter = match (a, b) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3_u8,
        };
        let Some(before) = state.quarter.replace(quarter) else { return 0 };
        match quarter.wrapping_sub(before) & 3 {
            1 => self.counted(quarter),
            3 => -self.counted(before),
            2 => {
                state.lost = state.lost.saturating_add(1);
                0
            }
            _ => 0,
        }
    }

    /// 1 if the forward step onto this quarter counts, else 0.
    fn counted(&self, onto: u8) -> i32 {
        i32::from(match self.counting {
            Counting::X4 => true,
            Counting::X2 => onto % 2 == 1,
            Counting::X1 => onto == 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Comparator levels at a phase in quarter fringes.
    fn levels(quarters: i64) -> (bool, bool) {
        let quarter = quarters.rem_euclid(4);
        (quarter == 1 || quarter == 2, quarter == 2 || quarter == 3)
    }

    proptest! {
        /// The count depends on the phase alone, for any path to it.
        #[test]
        fn the_count_is_a_function_of_the_phase(steps in prop::collection::vec(-1_i64..=1, 1..400)) {
            for counting in [Counting::X1, Counting::X2, Counting::X4] {
                let counter = Quadrature { counting };
                let (mut state, mut phase, mut count) = (QuadratureState::default(), 0_i64, 0_i64);
                counter.update(&mut state, false, false);
                for step in &steps {
                    phase += step;
                    let (a, b) = levels(phase);
                    count += i64::from(counter.update(&mut state, a, b));
                    let per_step = 4 / i64::from(counting.counts_per_fringe());
                    // The first edge that counts is the one onto quarter 1.
                    prop_assert_eq!(count, (phase + per_step - 1).div_euclid(per_step));
                }
                prop_assert_eq!(state.lost, 0);
            }
        }
    }

    #[test]
    fn a_double_step_is_reported_not_guessed() {
        let counter = Quadrature { counting: Counting::X4 };
        let mut state = QuadratureState::default();
        counter.update(&mut state, false, false);
        assert_eq!(counter.update(&mut state, true, true), 0);
        assert_eq!(state.lost, 1);
    }
}
