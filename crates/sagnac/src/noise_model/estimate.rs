//! Which noise the rows show, and Student's t for an interval under a noise that is an estimate.
//!
//! ```text
//! variances of greatest restricted likelihood (Patterson and Thompson 1971), flicker first, a further process where it gains
//! 1/ν = 1/(n − p) + ½·(∂ln C/∂ln v)²·Var(ln v)        degrees of freedom after Satterthwaite; C a variance, v the slow noise
//! ```
//!
//! A plain likelihood would count as drift the part of the noise that the terms absorb. A test of hours rarely tells one kind of
//! slow noise from another, so that intervals go by all of them ([`NoiseEstimate::mixed`]).
//!
//! Fails with few rows ([`FEWEST_FOR_NOISE`]), and where a run is shorter than the slow noise.

use crate::noise_model::minimum::minimum;
use crate::noise_model::processes::SlowNoise;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Variances are searched between these parts of the white one.
const LEAST: f64 = 1e-5;
const MOST: f64 = 30.0;
/// ln of a variance is found to within this; rows tell it to 0.1 at best.
const LN_TOLERANCE: f64 = 0.01;
/// What a further process must gain in −2·ln(restricted likelihood).
const GAIN: f64 = 2.0;
/// Correlation times of the Markov process that are tried, windows.
const MARKOV_WINDOWS: [f64; 5] = [1.0, 2.0, 5.0, 15.0, 50.0];

/// Slow noise as the rows tell it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NoiseEstimate {
    /// The likeliest: flicker always, walk and Markov where they gain.
    pub(crate) best: SlowNoise,
    /// Each kind by its likelihood, for intervals. Noise that was taken for flicker and is another makes them too narrow.
    pub(crate) mixed: SlowNoise,
}

impl NoiseEstimate {
    /// A noise that is known.
    pub(crate) fn known(noise: SlowNoise) -> Self {
        Self { best: noise, mixed: noise }
    }
}

/// The noise by `criterion`, −2·ln of the restricted likelihood.
pub(crate) fn estimate(nominal_s: f64, criterion: impl Fn(SlowNoise) -> f64 + Sync) -> NoiseEstimate {
    let better = |a: (SlowNoise, f64), b: (SlowNoise, f64), gain: f64| if b.1 < a.1 - gain { b } else { a };
    // The best of each process next to what is there already, all at a time.
    let best_of_each = |base: SlowNoise, processes: &[Process]| -> Vec<(SlowNoise, f64)> {
        let best_of = |process: &Process| {
            let with = |log: f64| process.of_variance(base, log.exp());
            let lowest = minimum(LEAST.ln(), MOST.ln(), LN_TOLERANCE, |log| criterion(with(log)));
            (with(lowest.at), lowest.value)
        };
        processes.par_iter().map(best_of).collect()
    };
    let white = (SlowNoise::default(), criterion(SlowNoise::default()));
    let markov = MARKOV_WINDOWS.map(|windows| Process::Markov(windows * nominal_s));
    let first = best_of_each(white.0, &[&[Process::Flicker, Process::Walk][..], &markov].concat());
    let gain_of = |at: usize| if at == 0 { 0.0 } else { GAIN };
    let mut best = first.iter().enumerate().fold(white, |best, (at, tried)| better(best, *tried, gain_of(at)));
    let base = best.0;
    let open = [(Process::Flicker, base.flicker), (Process::Walk, base.walk_per_h)].into_iter();
    let second: Vec<Process> = open.filter(|(_, variance)| *variance == 0.0).map(|(process, _)| process).collect();
    best = best_of_each(base, &second).into_iter().fold(best, |best, tried| better(best, tried, GAIN));
    let log_variance = log_variance(best, criterion);
    let mixed = if best.0 == SlowNoise::default() { best.0 } else { mixture(best, &first) };
    NoiseEstimate { best: SlowNoise { log_variance, ..best.0 }, mixed: SlowNoise { log_variance, ..mixed } }
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
    let weighted = |(noise, criterion): &(SlowNoise, f64)| (*noise, (0.5 * (least - *criterion)).exp());
    let members: Vec<(SlowNoise, f64)> = first.iter().chain(&second).map(weighted).collect();
    let all: f64 = members.iter().map(|(_, weight)| weight).sum();
    let mean =
        |variance: &dyn Fn(SlowNoise) -> f64| members.iter().map(|(noise, w)| w * variance(*noise)).sum::<f64>() / all;
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

/// Windows that tell slow noise from none.
pub(crate) const FEWEST_FOR_NOISE: usize = 60;
/// Step of ln v for the slope of the covariance.
pub(crate) const SLOPE_STEP: f64 = 0.3;
/// Degrees of freedom at least: fewer make an interval that holds anything.
pub(crate) const FEWEST_DEGREES: f64 = 3.0;

/// Student's t for some degrees of freedom and a variance that goes with slow noise: `slope` is ∂ln C/∂ln v.
pub(crate) fn t_quantile_975(degrees: f64, slope: f64, noise: SlowNoise) -> f64 {
    let effective = (degrees.recip() + 0.5 * slope.powi(2) * noise.log_variance).recip().max(FEWEST_DEGREES);
    StudentsT::new(0.0, 1.0, effective).map_or(1.96, |t| t.inverse_cdf(0.975))
}
