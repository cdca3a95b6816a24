//! Thermometers of a gyro beside each other.
//!
//! ```text
//! T_i = a + b·T_j + c·Ṫ_j + d·(Ṫ_j over the last 15 min)       least squares over the minutes so far, without forgetting
//! ```
//!
//! Two thermometers on one block differ by an offset, a gradient and a lag; all three are learned. One that departs from what the other one says by
//! more than a degree and six times the scatter, for five minutes in a row, drifts or has come off the block. Which of two it is cannot be known; of
//! three or more, it is the one that departs from most.

use nalgebra::{Matrix4, Vector4};

/// Minutes that are learned from before anything is said.
const LEARN: u32 = 60;
/// Least departure, °C, and in scatters.
const APART_C: f64 = 1.0;
const SCATTERS: f64 = 6.0;
/// Minutes in a row.
const LASTS: u32 = 5;
/// Temperatures that were seen reach so far beyond, °C: farther off nothing is said.
const BEYOND_C: f64 = 3.0;
/// Time over which the rate is remembered, min: the lag of one thermometer behind another.
const MEMORY_MIN: f64 = 15.0;

/// One thermometer as another one says it.
#[derive(Clone)]
struct Pair {
    of: usize,
    by: usize,
    information: Matrix4<f64>,
    right: Vector4<f64>,
    minutes: u32,
    squares: f64,
    apart: u32,
    /// Temperatures and rates of the other that were learned from.
    seen_c: [f64; 2],
    seen_cpm: [f64; 2],
    last: Option<f64>,
    memory: f64,
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
        self.memory += (rate - self.memory) / MEMORY_MIN;
        let x = Vector4::new(1.0, other / 50.0, rate, self.memory);
        let known = self.minutes >= LEARN
            && (self.seen_c[0] - BEYOND_C..=self.seen_c[1] + BEYOND_C).contains(&other)
            && (self.seen_cpm[0] - 0.2..=self.seen_cpm[1] + 0.2).contains(&rate);
        if known {
            let theta = self.information.lu().solve(&self.right)?;
            let off = own - theta.dot(&x);
            let scatter = (self.squares / f64::from(self.minutes)).sqrt();
            if off.abs() > APART_C + SCATTERS * scatter {
                self.apart += 1;
                // What departs is not learned.
                return (self.apart >= LASTS).then_some(off);
            }
            self.squares += off * off;
        }
        self.apart = 0;
        self.minutes += 1;
        self.seen_c = [self.seen_c[0].min(other), self.seen_c[1].max(other)];
        self.seen_cpm = [self.seen_cpm[0].min(rate), self.seen_cpm[1].max(rate)];
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
            information: Matrix4::identity() * 1e-6,
            right: Vector4::zeros(),
            minutes: 0,
            squares: 0.0,
            apart: 0,
            seen_c: [f64::INFINITY, f64::NEG_INFINITY],
            seen_cpm: [f64::INFINITY, f64::NEG_INFINITY],
            last: None,
            memory: 0.0,
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
