//! Noise that is not white: what it makes of the uncertainty of a fit, and rows made independent of it.
//!
//! ```text
//! n(t) = white(σ²/w) + Σ_k flicker_k + walk + Markov        of a window; w its length over the nominal one
//! flicker_k  first-order Markov, τ_k two windows · 4^k up to the longest run, each of variance B²·ln 4/π
//! walk       n(t + Δ) − n(t) of variance K²·Δ               zero at the start of a run, whose offset is free
//! Markov     one of its own correlation time
//! ```
//!
//! The fit itself weights windows by their lengths: with weights by the noise, a drift that no term describes would be taken for
//! noise and corrected less. Its covariance is that of these weights under this noise,
//!
//! ```text
//! Cov θ = (XᵀWX)⁻¹·XᵀW·V·WX·(XᵀWX)⁻¹
//! ```
//!
//! All are first-order processes, so a Kalman filter with one state each turns rows into innovations. Every column of the
//! design and y go through the same filter (generalized least squares, for grades and likelihoods), run by run, over gaps of any
//! length, in memory that does not grow with the rows.
//! The variances are those of greatest restricted likelihood (Patterson and Thompson 1971): a plain likelihood would count as
//! drift what the terms absorb of the noise. A test of hours rarely tells one kind of slow noise from another, so that intervals go by
//! all of them ([`Estimate::mixed`]).
//!
//! Fails where a run is shorter than what is slow: a drift in time over a single ramp and a drift over temperature are one.

use crate::calibration::SlowNoiseTerms;
use crate::fit::minimum::minimum;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sagnac_log::setup::Noise;

/// First-order processes at most.
const STATES: usize = 10;
/// Steps of the ladder of correlation times.
const LADDER: f64 = 4.0;
/// Variances are searched between these parts of the white one.
const LEAST: f64 = 1e-5;
const MOST: f64 = 30.0;
/// ln of a variance is found to within this; rows tell it to 0.1 at best.
const LN_TOLERANCE: f64 = 0.01;
/// What a further process must gain in −2·ln(restricted likelihood).
const GAIN: f64 = 2.0;
/// Correlation times of the Markov process that are tried, windows.
const MARKOV_WINDOWS: [f64; 5] = [1.0, 2.0, 5.0, 15.0, 50.0];

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
    fn ladder_s(&self) -> Vec<f64> {
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

    /// As a setup states it beside a white variance, (°/h)²; `None` where it states neither B nor K.
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

/// What to do with a row.
#[derive(Clone, Copy, Debug)]
struct Step {
    keep: [f64; STATES],
    gain: [f64; STATES],
    /// 1/√ of the innovation's variance.
    inverse_root: f64,
}

/// The filter of all rows.
#[derive(Clone, Debug)]
pub(crate) struct Whitening {
    steps: Vec<Step>,
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
        self.steps.push(Step { keep, gain, inverse_root: variance.sqrt().recip() });
    }

    /// For rows of so many numbers, from the first row on.
    pub(crate) fn filter(&self, columns: usize) -> Filter<'_> {
        Filter { whitening: self, columns, state: vec![0.0; self.states * columns], news: vec![0.0; columns] }
    }
}

impl Filter<'_> {
    /// Rows in their order; `row` becomes its innovation at unit white variance.
    pub(crate) fn push(&mut self, index: usize, row: &mut [f64]) {
        let Step { keep, gain, inverse_root } = &self.whitening.steps[index];
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

/// Slow noise as the rows tell it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Estimate {
    /// The likeliest: flicker always, walk and Markov where they gain.
    pub(crate) best: SlowNoise,
    /// Each kind by its likelihood, for intervals. Noise that was taken for flicker and is another makes them too narrow.
    pub(crate) mixed: SlowNoise,
}

impl Estimate {
    /// A noise that is known.
    pub(crate) fn known(noise: SlowNoise) -> Self {
        Self { best: noise, mixed: noise }
    }
}

/// The noise by `criterion`, −2·ln of the restricted likelihood.
pub(crate) fn estimate(nominal_s: f64, criterion: impl Fn(SlowNoise) -> f64 + Sync) -> Estimate {
    let better = |a: (SlowNoise, f64), b: (SlowNoise, f64), gain: f64| if b.1 < a.1 - gain { b } else { a };
    // The best of each process beside what is there already, all at a time.
    let best_of_each = |base: SlowNoise, processes: &[Process]| -> Vec<(SlowNoise, f64)> {
        let best_of = |process: &Process| {
            let with = |log: f64| process.of_variance(base, log.exp());
            let found = minimum(LEAST.ln(), MOST.ln(), LN_TOLERANCE, |log| criterion(with(log)));
            (with(found.at), found.value)
        };
        processes.par_iter().map(best_of).collect()
    };
    let white = (SlowNoise::default(), criterion(SlowNoise::default()));
    let markov = MARKOV_WINDOWS.map(|windows| Process::Markov(windows * nominal_s));
    let first = best_of_each(white.0, &[&[Process::Flicker, Process::Walk][..], &markov].concat());
    let gain_of = |at: usize| if at == 0 { 0.0 } else { GAIN };
    let mut best = first.iter().enumerate().fold(white, |best, (at, found)| better(best, *found, gain_of(at)));
    let base = best.0;
    let open = [(Process::Flicker, base.flicker), (Process::Walk, base.walk_per_h)].into_iter();
    let second: Vec<Process> = open.filter(|(_, variance)| *variance == 0.0).map(|(process, _)| process).collect();
    best = best_of_each(base, &second).into_iter().fold(best, |best, found| better(best, found, GAIN));
    let log_variance = log_variance(best, criterion);
    let mixed = if best.0 == SlowNoise::default() { best.0 } else { mixture(best, &first) };
    Estimate { best: SlowNoise { log_variance, ..best.0 }, mixed: SlowNoise { log_variance, ..mixed } }
}

/// By how much −2·ln of the likelihood of measured noise must be less than that of stated noise: odds of 400 to 1.
const DECISIVE: f64 = 12.0;

/// −2·ln of the restricted likelihood of rows with this sum of squares, degrees of freedom and Σ ln of determinants, all whitened by
/// slow noise; the white variance is stated, or the likeliest.
pub(crate) fn restricted(ssr: f64, degrees: f64, determinants: f64, white: Option<f64>) -> f64 {
    let white = white.unwrap_or(ssr / degrees);
    ssr / white + degrees * white.ln() + determinants
}

/// How a noise fits some rows: [`restricted`], and the variance that it makes of what they are to tell.
pub(crate) struct NoiseFit {
    pub(crate) criterion: f64,
    pub(crate) variance: f64,
}

impl NoiseFit {
    /// True where this noise, which rows show, is decisively likelier than a stated one, and larger.
    pub(crate) fn exceeds(&self, stated: &Self) -> bool {
        stated.criterion - self.criterion > DECISIVE && self.variance > stated.variance
    }
}

/// The variances of several noises by their likelihoods, e^(−criterion/2), each alike before. Their covariances add, so that the
/// mixture is a noise again; of the Markov processes the likeliest stands for all.
fn mixture(best: (SlowNoise, f64), first: &[(SlowNoise, f64)]) -> SlowNoise {
    let second = (!first.contains(&best)).then_some((best.0, best.1 + GAIN));
    let least = first.iter().chain(&second).map(|(_, criterion)| *criterion).fold(f64::INFINITY, f64::min);
    let weighted = |(noise, criterion): &(SlowNoise, f64)| (*noise, (0.5 * (least - criterion)).exp());
    let members: Vec<(SlowNoise, f64)> = first.iter().chain(&second).map(weighted).collect();
    let all: f64 = members.iter().map(|(_, weight)| weight).sum();
    let mean = |of: &dyn Fn(SlowNoise) -> f64| members.iter().map(|(noise, w)| w * of(*noise)).sum::<f64>() / all;
    let markov = mean(&|noise| noise.markov.map_or(0.0, |(variance, _)| variance));
    let likeliest = members.iter().filter(|(noise, _)| noise.markov.is_some()).max_by(|a, b| a.1.total_cmp(&b.1));
    SlowNoise {
        flicker: mean(&|noise| noise.flicker),
        walk_per_h: mean(&|noise| noise.walk_per_h),
        markov: likeliest.and_then(|(noise, _)| noise.markov).map(|(_, tau_s)| (markov, tau_s)),
        log_variance: 0.0,
    }
}

/// A process whose variance is searched for.
#[derive(Clone, Copy)]
enum Process {
    Flicker,
    Walk,
    /// Of this correlation time, s.
    Markov(f64),
}

impl Process {
    /// Some noise with this process of a variance.
    fn of_variance(self, base: SlowNoise, variance: f64) -> SlowNoise {
        match self {
            Self::Flicker => SlowNoise { flicker: variance, ..base },
            Self::Walk => SlowNoise { walk_per_h: variance, ..base },
            Self::Markov(tau_s) => SlowNoise { markov: Some((variance, tau_s)), ..base },
        }
    }
}

/// Step of ln variance for its curvature, and the variance where the likelihood has none.
const LOG_STEP: f64 = 0.5;
const MOST_LOG_VARIANCE: f64 = 1.0;

/// Variance of ln of the variances together: two over the curvature of −2·ln of the likelihood.
fn log_variance((noise, least): (SlowNoise, f64), criterion: impl Fn(SlowNoise) -> f64) -> f64 {
    if noise == SlowNoise::default() {
        return 0.0;
    }
    let beside = [LOG_STEP, -LOG_STEP].map(|step: f64| criterion(noise.scaled(step.exp())));
    let curvature = (beside[0] + beside[1] - 2.0 * least) / LOG_STEP.powi(2);
    if curvature > 0.0 { (2.0 / curvature).min(MOST_LOG_VARIANCE) } else { MOST_LOG_VARIANCE }
}
