//! Thermometers of a gyro next to each other.
//!
//! ```text
//! T_i = a + b·T_j + c·Ṫ_j + d·⟨Ṫ_j⟩₅ + e·⟨Ṫ_j⟩₃₀       ⟨⟩ over the last 5 and 30 min; least squares over the minutes so far, without forgetting
//! ```
//!
//! Two thermometers on one block differ by an offset, a gradient and a lag; all three are learned. One that departs from what the other one says by
//! more than half a degree and six times the scatter, for five minutes in a row, drifts or has come off the block. At temperatures
//! that no minute has shown, a slow drift and a gradient are one: then it is seen when the temperature comes again. Which of two it is cannot be known; of
//! three or more, it is the one that departs from most.

use nalgebra::{Matrix5, Vector5};

/// Minutes that are learned from before anything is said.
const LEARN: u32 = 60;
/// Least departure, °C, and in scatters.
const APART_C: f64 = 0.5;
/// Least scatter of a minute, °C.
const LEAST_SCATTER_C: f64 = 0.02;
const SCATTERS: f64 = 6.0;
/// Minutes in a row.
const LASTS: u32 = 5;
/// A minute is judged if those before it know its temperature and rates: xᵀ(XᵀX)⁻¹x below this.
const LEVERAGE: f64 = 0.1;
/// Times over which the rate is remembered, min: the lag of one thermometer behind another.
const MEMORY_MIN: [f64; 2] = [5.0, 30.0];

/// One thermometer as another one says it.
#[derive(Clone)]
struct Pair {
    of: usize,
    by: usize,
    information: Matrix5<f64>,
    right: Vector5<f64>,
    minutes: u32,
    squares: f64,
    /// Minutes that were judged.
    judged: u32,
    apart: u32,
    last: Option<f64>,
    memory: [f64; 2],
}

impl Pair {
    /// The departure, where it has lasted.
    fn push(&mut self, means: &[f64]) -> Option<f64> {
        let (own, other) = (*means.get(self.of)?, *means.get(self.by)?);
        if !own.is_finite() || !other.is_finite() {
            return None;
        }
        let rate = self.last.map_or(0.0, |last| other - last);
        self.last = Some(other);
        self.memory.iter_mut().zip(MEMORY_MIN).for_each(|(memory, minutes)| *memory += (rate - *memory) / minutes);
        let x = Vector5::new(1.0, other / 50.0, rate, self.memory[0], self.memory[1]);
        let covariance = self.information.cholesky().map(|root| root.inverse());
        let known = covariance.filter(|covariance| self.minutes >= LEARN && x.dot(&(covariance * x)) < LEVERAGE);
        if let Some(covariance) = known {
            let off = own - (covariance * self.right).dot(&x);
            let scatter = (self.squares / f64::from(self.judged.max(1))).sqrt();
            let limit = APART_C + SCATTERS * scatter;
            if off.abs() > limit {
                self.apart += 1;
                // What departs is not learned.
                return (self.apart >= LASTS).then_some(off);
            }
            // A departure that only begins must not make its own limit.
            let usual = off.abs().min(3.0 * scatter.max(LEAST_SCATTER_C));
            self.squares += usual * usual;
            self.judged += 1;
            if off.abs() > limit / 2.0 {
                self.apart = 0;
                return None;
            }
        }
        self.apart = 0;
        self.minutes += 1;
        self.information += x * x.transpose();
        self.right += x * own;
        None
    }
}

/// All pairs of the gyro's own thermometers.
pub(crate) struct Pairs {
    pairs: Vec<Pair>,
    own: usize,
}

impl Pairs {
    /// `own` says which thermometers are on the gyro.
    pub(crate) fn new(own: Vec<bool>) -> Self {
        let on: Vec<usize> = own.iter().enumerate().filter(|(_, own)| **own).map(|(at, _)| at).collect();
        let pair = |of: usize, by: usize| Pair {
            of,
            by,
            // So little that it only keeps the first minutes solvable.
            information: Matrix5::identity() * 1e-6,
            right: Vector5::zeros(),
            minutes: 0,
            squares: 0.0,
            apart: 0,
            judged: 0,
            last: None,
            memory: [0.0; 2],
        };
        let pairs = on.iter().flat_map(|of| on.iter().filter(move |by| *by != of).map(move |by| pair(*of, *by)));
        Self { pairs: pairs.collect(), own: on.len() }
    }

    /// Those that depart from more than half of the others, and by how much; of two, both do.
    pub(crate) fn push(&mut self, means: &[f64]) -> Vec<(usize, f64)> {
        let mut departs: Vec<(usize, f64, usize)> = Vec::new();
        for pair in &mut self.pairs {
            if let Some(off) = pair.push(means) {
                match departs.iter_mut().find(|(of, ..)| *of == pair.of) {
                    Some((_, most, from)) => {
                        *from += 1;
                        if off.abs() > most.abs() {
                            *most = off;
                        }
                    }
                    None => departs.push((pair.of, off, 1)),
                }
            }
        }
        let others = self.own.saturating_sub(1);
        departs.into_iter().filter(|(.., from)| 2 * from > others).map(|(of, off, _)| (of, off)).collect()
    }
}
