//! The shortest thermal test of a unit whose fleet is known.
//!
//! ```text
//! steps ─▶ windows ─▶ fit with the prior ─▶ Cov θ ─▶ error of the correction at temperatures and rates ─▶ P(all limits met)
//! shortest of all candidates with P ≥ what is asked; then soaks are shortened, at each step where I = mean Var δ(T, Ṫ) grows least
//! ```
//!
//! The covariance is that of the fit itself, on windows of the planned temperatures under the fleet's noise: what `calibrate --prior` will
//! state of the unit, for it does not depend on the rates that the unit shows. The error δ of the correction that a test ends with is
//! normal with it. A limit counts as met where δ alone is within a stated share of it, half by default: a unit at half of every limit passes a
//! retest against `navigation-grade` with 0.97 or more (docs/explanation/evidence.md).
//!
//! I is the criterion of I-optimal designs: the variance of the prediction, averaged over where the correction is used (Box and Draper
//! 1959). Candidates are sequences that a chamber can be told: towards both ends of the span, with or without plateaus on the way, at one of
//! its rates. Each rests in mid-span after heating and after cooling: a memory of the direction shows nowhere else, and no covariance has it.
//!
//! Fails for a unit that is not of the fleet, which the test itself refuses; for limits that a correction does not decide (noise,
//! repeatability); for fleets on a rate table, whose scale factor is not planned.

mod enough;
mod passes;
mod profile;
mod promise;

use rayon::prelude::*;
use serde::Serialize;

pub use enough::{Enough, EnoughRequest, NextStep, enough};
pub use profile::{Chamber, ProfileStep};
pub use promise::Expected;

use crate::calibration::AxisCalibration;
use crate::fit::{FitOptions, Model, UnitPrior, calibrate};
use crate::verify::Limits;
use crate::window::WindowBuilder;
use profile::Profile;
use promise::Promise;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::setup::{Noise, Setup, WindowSize};

/// Soaks of the candidates, min; each also at plateaus on the way, so many of them in each leg.
const SOAKS_MIN: [f64; 8] = [0.0, 15.0, 30.0, 60.0, 90.0, 120.0, 180.0, 240.0];
const PLATEAUS: [usize; 4] = [0, 1, 2, 4];
/// A soak is shortened by so much at a time, min.
const SHORTENED_MIN: f64 = 5.0;
/// Candidates that are looked at together.
const AT_ONCE: usize = 16;
/// What is known without a fleet: its scatter, so many times as wide.
const WITHOUT_PRIOR: f64 = 1e3;

/// What a test is planned for.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PlanRequest {
    /// What is known of the unit.
    pub prior: UnitPrior,
    /// Noise of the fleet's units.
    pub noise: Noise,
    /// What the unit is to meet.
    pub limits: Limits,
    /// What the chamber can do.
    pub chamber: Chamber,
    /// Probability with which it meets them.
    pub probability: f64,
    /// Part of each limit that the error of the correction may take.
    pub share: f64,
    /// Longest test, h.
    pub hours_max: f64,
    /// T0 of the calibration, °C; as `calibrate` chooses it without one.
    pub reference_c: Option<f64>,
    /// Window of the analysis, s.
    pub window_s: f64,
}

impl PlanRequest {
    /// With a probability of 0.97, half of each limit, a day at most, and windows of 100 s.
    pub fn new(prior: UnitPrior, noise: Noise, limits: Limits, chamber: Chamber) -> Self {
        let (probability, share, hours_max) = (0.97, 0.5, 24.0);
        Self { prior, noise, limits, chamber, probability, share, hours_max, reference_c: None, window_s: 100.0 }
    }
}

/// A test.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Plan {
    /// Its steps, from the chamber's start.
    pub steps: Vec<ProfileStep>,
    /// Its length, h.
    pub hours: f64,
    /// Probability that the error of the correction is within the share of all limits.
    pub probability: f64,
    /// Root mean square σ of the correction over temperatures and rates, °/h.
    pub sigma_dph: f64,
    /// Each limit that the test decides.
    pub expected: Vec<Expected>,
    /// Limits that are asked and that no calibration test decides.
    pub not_planned: Vec<String>,
    /// Length of the shortest test that meets them without a prior, h; null where none within the longest does.
    pub hours_without_prior: Option<f64>,
    /// Candidates that were looked at.
    pub candidates: usize,
}

/// A candidate with what it promises.
struct PromisedProfile {
    profile: Profile,
    promise: Promise,
}

/// Plans a test.
///
/// # Errors
/// [`sagnac_log::ErrorKind::Refused`] where no test that is short enough meets the limits; limits none of which a test decides.
pub fn plan(request: &PlanRequest) -> Result<Plan> {
    check(request)?;
    let (mut best, mut candidates) = (None, 0);
    let all = profile::candidates(&request.prior, &request.chamber, &SOAKS_MIN, &PLATEAUS, request.hours_max);
    let nearest = shortest(request, &all, &mut best, &mut candidates);
    let Some(best) = best else { return Err(none(request, nearest)) };
    let PromisedProfile { profile, promise } = shortened(request, best);
    let mut vague = request.clone();
    vague.prior.covariance.iter_mut().for_each(|value| *value *= WITHOUT_PRIOR);
    let mut without = None;
    shortest(&vague, &all, &mut without, &mut 0);
    Ok(Plan {
        hours: profile.hours(&request.chamber),
        steps: profile.steps,
        probability: promise.probability,
        sigma_dph: promise.sigma_dph,
        expected: promise.expected,
        not_planned: promise::not_planned(&request.limits),
        hours_without_prior: without.map(|promised| promised.profile.hours(&request.chamber)),
        candidates,
    })
}

fn check(request: &PlanRequest) -> Result<()> {
    request.chamber.check(request.prior.span_c)?;
    if request.prior.terms.iter().any(|term| term.starts_with("scale")) {
        return Err(Error::refused(
            "a test on a rate table cannot be planned: the prior has terms of the scale factor",
            "give a prior of chamber tests",
        ));
    }
    if promise::judged(&request.limits).is_empty() {
        return Err(Error::input(
            "the limits contain none that a calibration test decides",
            format!("set one of these: {}", Error::choices(&promise::NAMES.map(str::to_owned))),
        ));
    }
    for (name, value) in [("probability", request.probability), ("share", request.share)] {
        if !(value > 0.0 && value < 1.0) {
            return Err(Error::input("must be between 0 and 1", format!("set --{name} to a fraction, such as 0.9"))
                .column(name)
                .value(value.to_string()));
        }
    }
    if request.noise.n_deg_rt_h.is_nan() || request.noise.n_deg_rt_h <= 0.0 {
        return Err(Error::refused(
            "the noise of the units is unknown: the prior has no angle random walk",
            "give a --setup with [noise], or log the fleet with shorter rows",
        )
        .column("noise"));
    }
    Ok(())
}

/// No test that is short enough: how near the best comes, and what it is short of.
fn none(request: &PlanRequest, nearest: Option<Promise>) -> Error {
    let reached = nearest.map_or(String::new(), |promise| {
        let taken = |expected: &Expected| expected.value_95 / (request.share * expected.bound);
        let worst = promise.expected.iter().max_by(|a, b| taken(a).total_cmp(&taken(b)));
        let worst = worst.map_or(String::new(), |worst| {
            format!(
                ": its error takes up to {:.0} % of {}, and {:.0} % are allowed",
                100.0 * worst.value_95 / worst.bound,
                worst.limit,
                100.0 * request.share
            )
        });
        format!(". The best has a probability of {:.2}{worst}", promise.probability)
    });
    Error::refused(
        format!(
            "every test of up to {} h misses these limits at a probability of {}{reached}",
            request.hours_max, request.probability
        ),
        "allow more hours with --hours-max, a larger --share of the limits, or slower --ramps",
    )
}

/// The shortest candidate that does it; the nearest promise where none does. `all` are in the order of their lengths.
fn shortest(
    request: &PlanRequest,
    all: &[Profile],
    planned: &mut Option<PromisedProfile>,
    looked_at: &mut usize,
) -> Option<Promise> {
    let mut nearest: Option<Promise> = None;
    for some in all.chunks(AT_ONCE) {
        *looked_at += some.len();
        let promised = |profile: &Profile| {
            Some(PromisedProfile { promise: promised(request, profile)?, profile: profile.clone() })
        };
        let some: Vec<PromisedProfile> = some.par_iter().filter_map(promised).collect();
        let best = some.iter().map(|candidate| &candidate.promise).chain(&nearest);
        nearest = best.max_by(|a, b| a.probability.total_cmp(&b.probability)).cloned();
        let does = |candidate: &PromisedProfile| candidate.promise.probability >= request.probability;
        // Lengths within a chunk differ little: of those that do it the one that knows most.
        let sigma = |candidate: &PromisedProfile| candidate.promise.sigma_dph;
        *planned = some.into_iter().filter(does).min_by(|a, b| sigma(a).total_cmp(&sigma(b)));
        if planned.is_some() {
            break;
        }
    }
    nearest
}

/// The same with shorter soaks, as long as it does.
fn shortened(request: &PlanRequest, mut best: PromisedProfile) -> PromisedProfile {
    loop {
        let shorter = |step: usize| -> Option<PromisedProfile> {
            let profile = best.profile.shortened(step, SHORTENED_MIN)?;
            let promise = promised(request, &profile)?;
            (promise.probability >= request.probability).then_some(PromisedProfile { profile, promise })
        };
        let all: Vec<PromisedProfile> = (0..best.profile.steps.len()).into_par_iter().filter_map(shorter).collect();
        let next = all.into_iter().min_by(|a, b| a.promise.sigma_dph.total_cmp(&b.promise.sigma_dph));
        match next {
            Some(next) => best = next,
            None => return best,
        }
    }
}

/// What a test would promise; `None` where it could not be fitted.
fn promised(request: &PlanRequest, profile: &Profile) -> Option<Promise> {
    let setup = Setup {
        noise: Some(request.noise.slow(request.noise.b_dph.unwrap_or(0.0), request.noise.k_dph_rt_h.unwrap_or(0.0))),
        window: Some(WindowSize::Seconds(request.window_s)),
        reference_c: request.reference_c,
        ..Setup::default()
    };
    let log = profile.log(&request.prior, &request.chamber, request.window_s);
    let reader =
        LogReader::from_reader("plan.csv", Box::new(std::io::Cursor::new(log)), &setup, ReadMode::Bulk).ok()?;
    let windows = WindowBuilder::read_all(vec![reader], &setup).ok()?.finish();
    let options = FitOptions::new(Model::Auto).prior(Some(request.prior.clone()));
    let calibration = calibrate(windows, &setup, &options).ok()?;
    let axis = calibration.axes.first()?;
    Promise::of(axis, &request.limits, request.share, rate_of(axis, request))
}

/// The rate of the ramps that the unit will see, °C/min: the chamber's fastest, as far as the fleet's tests know it.
fn rate_of(axis: &AxisCalibration, request: &PlanRequest) -> f64 {
    let fleet = request.prior.rate_spans_cpm.first().map_or(0.0, |[lo, hi]| hi.abs().max(lo.abs()));
    let chamber = request.chamber.rates_cpm.iter().fold(0.0_f64, |most, rate| most.max(*rate));
    if axis.rate_effect(axis.reference_c()).is_some() { fleet.min(chamber) } else { 0.0 }
}
