//! Noise that is not white, as first-order processes, and its covariance between some columns.
//!
//! ```text
//! n(t) = white(σ²/w) + Σ_k flicker_k + walk + Markov        of a window; w its length over the nominal one
//! flicker_k  first-order Markov, τ_k two windows · 4^k up to the longest run, each of variance B²·ln 4/π
//! walk       n(t + Δ) − n(t) of variance K²·Δ               zero at the start of a run, whose offset is free
//! Markov     one of its own correlation time
//! Cov θ = (XᵀWX)⁻¹·XᵀW·V·WX·(XᵀWX)⁻¹                        V: this noise of the rows, W: the weights of the fit
//! ```
//!
//! The fit weights windows by their lengths: with weights by the noise, a drift that no term describes would be taken for
//! noise and corrected less. The covariance is that of these weights under this noise.
//!
//! Fails where a run is shorter than the slow noise: a drift in time over a single ramp and a drift over temperature are one.

use crate::calibration::SlowNoiseTerms;
use nalgebra::{DMatrix, DVector};
use sagnac_log::setup::Noise;

/// First-order processes at most.
pub(super) const STATES: usize = 10;
/// Steps of the ladder of correlation times.
const LADDER: f64 = 4.0;

/// Rows as noise runs through them: in the order of time within each run.
#[derive(Clone, Copy)]
pub(crate) struct NoiseRows<'a> {
    /// Rows of different runs have noise of their own.
    pub(crate) run: &'a [usize],
    /// Middle of each row's window since the start of its run, s.
    pub(crate) middle_s: &'a [f64],
    /// Length of the window over the nominal one.
    pub(crate) weight: &'a [f64],
    /// Length of the longest run, s.
    pub(crate) longest_s: f64,
    /// Nominal length of a window, s.
    pub(crate) nominal_s: f64,
}

impl NoiseRows<'_> {
    pub(crate) fn len(&self) -> usize {
        self.run.len()
    }

    /// Correlation times of the ladder, s.
    pub(super) fn ladder_s(&self) -> Vec<f64> {
        let first_s = 2.0 * self.nominal_s;
        (0..STATES as i32).map(|k| first_s * LADDER.powi(k)).take_while(|tau_s| *tau_s <= self.longest_s).collect()
    }
}

/// Variances as parts of the white variance of a window of nominal length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SlowNoise {
    /// Of each process of the ladder.
    pub(crate) flicker: f64,
    /// Of the walk in an hour.
    pub(crate) walk_per_h: f64,
    /// Variance, and correlation time in s.
    pub(crate) markov: Option<(f64, f64)>,
    /// Variance of the logarithm of the largest of these variances; 0 where they are stated.
    pub(crate) log_variance: f64,
}

impl SlowNoise {
    /// Its largest process as a part of the white variance.
    pub(crate) fn parts_of_white(&self) -> f64 {
        self.flicker.max(self.walk_per_h).max(self.markov.map_or(0.0, |(variance, _)| variance))
    }

    /// As a setup states it with a white variance, (°/h)²; `None` where it states neither B nor K.
    pub(crate) fn stated(noise: Noise, white_variance: f64) -> Option<Self> {
        if noise.b_dph.is_none() && noise.k_dph_rt_h.is_none() {
            return None;
        }
        let part = |value: Option<f64>| value.map_or(0.0, |value| value * value / white_variance);
        let flicker = part(noise.b_dph) * LADDER.ln() / std::f64::consts::PI;
        Some(Self { flicker, walk_per_h: part(noise.k_dph_rt_h), ..Self::default() })
    }

    /// All its variances by a factor.
    pub(crate) fn scaled(self, by: f64) -> Self {
        let markov = self.markov.map(|(variance, tau_s)| (by * variance, tau_s));
        Self { flicker: by * self.flicker, walk_per_h: by * self.walk_per_h, markov, ..self }
    }

    /// In the units of a record, the white σ given; `None` where it is white. B from the variance of each of the ladder.
    pub(crate) fn terms(self, white_dph: f64) -> Option<SlowNoiseTerms> {
        let root = |part: f64| (part > 0.0).then(|| white_dph * part.sqrt());
        (self != Self::default()).then(|| SlowNoiseTerms {
            white_dph,
            bias_instability_dph: root(self.flicker * std::f64::consts::PI / LADDER.ln()),
            rate_random_walk_dph_rt_h: root(self.walk_per_h),
            markov_sigma_dph: self.markov.and_then(|(variance, _)| root(variance)),
            markov_correlation_s: self.markov.map(|(_, tau_s)| tau_s),
        })
    }

    /// Variance and τ, s, of the ladder and of the Markov process.
    fn markov_processes(&self, rows: NoiseRows<'_>) -> Vec<(f64, f64)> {
        let rungs = rows.ladder_s().into_iter().take(STATES - 2).map(|tau_s| (self.flicker, tau_s));
        rungs.chain(self.markov).filter(|(variance, _)| *variance > 0.0).collect()
    }

    /// How the noise of the last run goes on behind it.
    pub(crate) fn continued(&self, rows: NoiseRows<'_>, z: &DMatrix<f64>) -> Continuation {
        let last_run = rows.run.last().copied();
        let last: Vec<usize> = (0..rows.len()).filter(|row| Some(rows.run[*row]) == last_run).collect();
        let seconds_before =
            |at: usize| if at == 0 { 0.0 } else { rows.middle_s[last[at]] - rows.middle_s[last[at - 1]] };
        let decayed = |(variance, tau_s): (f64, f64)| {
            let mut sum = DVector::zeros(z.ncols());
            for (at, row) in last.iter().enumerate() {
                sum *= (-seconds_before(at) / tau_s).exp();
                sum += z.row(*row).transpose();
            }
            (variance, tau_s, sum)
        };
        let (mut behind, mut sum, mut hours) = (DVector::zeros(z.ncols()), DVector::zeros(z.ncols()), 0.0);
        for (at, row) in last.iter().enumerate().rev() {
            behind += z.row(*row).transpose();
            sum += &behind * (seconds_before(at) / 3600.0);
            hours += seconds_before(at) / 3600.0;
        }
        Continuation {
            markov: self.markov_processes(rows).into_iter().map(decayed).collect(),
            walk: (self.walk_per_h > 0.0).then_some((self.walk_per_h, sum, hours)),
            window_s: rows.nominal_s,
        }
    }

    /// Zᵀ·V·Z of some columns, one per parameter, in units of the white variance: V is this noise of the rows.
    pub(crate) fn between(&self, rows: NoiseRows<'_>, z: &DMatrix<f64>) -> DMatrix<f64> {
        let p = z.ncols();
        let mut sum = DMatrix::zeros(p, p);
        for row in 0..rows.len() {
            let here = z.row(row).transpose();
            sum.ger(1.0 / rows.weight[row], &here, &here, 1.0);
        }
        for (variance, tau_s) in self.markov_processes(rows) {
            add_markov(rows, z, variance, tau_s, &mut sum);
        }
        if self.walk_per_h > 0.0 {
            add_walk(rows, z, self.walk_per_h, &mut sum);
        }
        sum
    }
}

/// What rows of equal regressors behind the last one add to [`SlowNoise::between`].
pub(crate) struct Continuation {
    /// Of each Markov process: variance, τ in s, and the rows of the last run, as they have decayed to the last.
    markov: Vec<(f64, f64, DVector<f64>)>,
    /// Of the walk: variance in an hour, Σ Δt·(rows behind) over the last run in h, and its length in h.
    walk: Option<(f64, DVector<f64>, f64)>,
    window_s: f64,
}

impl Continuation {
    /// uᵀ·(ZᵀVZ)·u with so many windows more, less that without them; `along` is u times their regressors.
    pub(crate) fn added(&self, u: &DVector<f64>, along: f64, windows: f64) -> f64 {
        let mut sum = windows * along * along;
        for (variance, tau_s, decayed) in &self.markov {
            let q = (-self.window_s / tau_s).exp();
            let (less, all) = (1.0 - q, 1.0 - q.powf(windows));
            let across = q * all / less;
            let within = windows + 2.0 * q * (windows * less - all) / (less * less);
            sum += variance * (2.0 * across * along * decayed.dot(u) + within * along * along);
        }
        if let Some((per_h, behind, hours)) = &self.walk {
            let steps = self.window_s / 3600.0 * windows * (windows + 1.0) * (2.0 * windows + 1.0) / 6.0;
            let of_run = 2.0 * windows * behind.dot(u) * along + windows * windows * hours * along * along;
            sum += per_h * (of_run + steps * along * along);
        }
        sum
    }
}

/// Σᵢⱼ zᵢzⱼᵀ·v·exp(−|tᵢ − tⱼ|/τ) over rows of one run, by the running sum of those before.
fn add_markov(rows: NoiseRows<'_>, z: &DMatrix<f64>, variance: f64, tau_s: f64, sum: &mut DMatrix<f64>) {
    let mut before = DVector::zeros(z.ncols());
    let mut last = None;
    for row in 0..rows.len() {
        let at = (rows.run[row], rows.middle_s[row]);
        let keep = last.filter(|(run, _)| *run == at.0).map_or(0.0, |(_, s): (usize, f64)| (-(at.1 - s) / tau_s).exp());
        last = Some(at);
        before *= keep;
        let here = z.row(row).transpose();
        sum.ger(variance, &here, &before, 1.0);
        sum.ger(variance, &before, &here, 1.0);
        sum.ger(variance, &here, &here, 1.0);
        before += here;
    }
}

/// The same of a walk from the start of each run: every step is in all rows behind it.
fn add_walk(rows: NoiseRows<'_>, z: &DMatrix<f64>, per_h: f64, sum: &mut DMatrix<f64>) {
    let mut behind = DVector::zeros(z.ncols());
    for row in (0..rows.len()).rev() {
        let run = rows.run[row];
        if rows.run.get(row + 1).is_some_and(|next| *next != run) {
            behind.fill(0.0);
        }
        behind += z.row(row).transpose();
        let first = row.checked_sub(1).filter(|before| rows.run[*before] == run);
        let seconds = first.map_or(0.0, |before| rows.middle_s[row] - rows.middle_s[before]);
        sum.ger(per_h * seconds / 3600.0, &behind, &behind, 1.0);
    }
}
