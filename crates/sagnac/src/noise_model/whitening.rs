//! The Kalman filter that makes rows of such noise independent.
//!
//! All processes are of first order, so a filter with one state each turns rows into innovations. Every column of the design and
//! y go through the same filter (generalized least squares, for grades and likelihoods), run by run, over gaps of any length, in
//! memory that does not grow with the rows.
//!
//! Fails where rows are not in the order of time within their run.

use crate::noise_model::processes::{NoiseRows, STATES, SlowNoise};

/// What to do with a row.
#[derive(Clone, Copy, Debug)]
struct WhiteningStep {
    keep: [f64; STATES],
    gain: [f64; STATES],
    /// 1/√ of the innovation's variance.
    inverse_root: f64,
}

/// The filter of all rows.
#[derive(Clone, Debug)]
pub(crate) struct Whitening {
    steps: Vec<WhiteningStep>,
    states: usize,
    /// Σ ln of the variances of the innovations.
    pub(crate) log_determinant: f64,
}

/// Rows of some columns on their way through it.
pub(crate) struct Filter<'a> {
    whitening: &'a Whitening,
    columns: usize,
    /// State by state, a number for each column.
    state: Vec<f64>,
    /// Of a row: what the states expect, then what they did not.
    news: Vec<f64>,
}

impl Whitening {
    pub(crate) fn new(rows: NoiseRows<'_>, noise: SlowNoise) -> Self {
        let taus_s = rows.ladder_s();
        let rungs = if noise.flicker > 0.0 { taus_s.len().min(STATES - 2) } else { 0 };
        let markov = noise.markov.filter(|(variance, _)| *variance > 0.0);
        let states = rungs + usize::from(noise.walk_per_h > 0.0) + usize::from(markov.is_some());
        let mut out = Self { steps: Vec::with_capacity(rows.len()), states, log_determinant: 0.0 };
        let mut covariance = [[0.0; STATES]; STATES];
        let (mut before, mut keep, mut kept_for) = (None, [0.0; STATES], None);
        for row in 0..rows.len() {
            let here = (rows.run[row], rows.middle_s[row]);
            let seconds = before.filter(|(run, _)| *run == here.0).map(|(_, at_s)| here.1 - at_s);
            before = Some(here);
            let process = |k: usize| -> (f64, f64) {
                if k < rungs {
                    (noise.flicker, taus_s[k])
                } else if k == rungs && noise.walk_per_h > 0.0 {
                    (f64::NAN, f64::INFINITY)
                } else {
                    markov.unwrap_or((0.0, 1.0))
                }
            };
            for k in 0..states {
                let (variance, tau_s) = process(k);
                match seconds {
                    None => {
                        covariance[k] = [0.0; STATES];
                        covariance[k][k] = if variance.is_nan() { 0.0 } else { variance };
                    }
                    // Rows follow each other at equal times, mostly.
                    Some(seconds) if kept_for != Some(seconds) => keep[k] = (-seconds / tau_s).exp(),
                    Some(_) => (),
                }
            }
            kept_for = seconds.or(kept_for);
            if let Some(seconds) = seconds {
                for i in 0..states {
                    for j in 0..states {
                        covariance[i][j] *= keep[i] * keep[j];
                    }
                    let (variance, _) = process(i);
                    covariance[i][i] += if variance.is_nan() {
                        noise.walk_per_h * seconds / 3600.0
                    } else {
                        variance * (1.0 - keep[i] * keep[i])
                    };
                }
            }
            let kept = if seconds.is_some() { keep } else { [0.0; STATES] };
            out.step(&mut covariance, kept, rows.weight[row]);
        }
        out
    }

    /// The gain of a row of this weight, and what the row leaves of the states' covariance.
    fn step(&mut self, covariance: &mut [[f64; STATES]; STATES], keep: [f64; STATES], weight: f64) {
        let states = self.states;
        let mut across = [0.0; STATES];
        for (across, row) in across.iter_mut().zip(covariance.iter()).take(states) {
            *across = row[..states].iter().sum();
        }
        let variance = 1.0 / weight.max(f64::MIN_POSITIVE) + across[..states].iter().sum::<f64>();
        let gain = across.map(|across| across / variance);
        for i in 0..states {
            for j in 0..states {
                covariance[i][j] -= gain[i] * across[j];
            }
        }
        self.log_determinant += variance.ln();
        self.steps.push(WhiteningStep { keep, gain, inverse_root: variance.sqrt().recip() });
    }

    /// For rows of so many numbers, from the first row on.
    pub(crate) fn filter(&self, columns: usize) -> Filter<'_> {
        Filter { whitening: self, columns, state: vec![0.0; self.states * columns], news: vec![0.0; columns] }
    }
}

impl Filter<'_> {
    /// Rows in their order; `row` becomes its innovation at unit white variance.
    pub(crate) fn push(&mut self, index: usize, row: &mut [f64]) {
        let WhiteningStep { keep, gain, inverse_root } = &self.whitening.steps[index];
        let news = &mut self.news[..row.len()];
        news.fill(0.0);
        for (state, keep) in self.state.chunks_mut(self.columns).zip(keep) {
            for (state, known) in state.iter_mut().zip(news.iter_mut()) {
                *state *= keep;
                *known += *state;
            }
        }
        for (value, known) in row.iter_mut().zip(news.iter_mut()) {
            *known = *value - *known;
            *value = *known * inverse_root;
        }
        for (state, gain) in self.state.chunks_mut(self.columns).zip(gain) {
            state.iter_mut().zip(news.iter()).for_each(|(state, news)| *state += gain * news);
        }
    }
}
