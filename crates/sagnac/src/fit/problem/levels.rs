//! Columns before the terms: offsets of runs, the scale factor at T0, misalignment, drift in time and warm-up.
//!
//! They are part of the fit and never of the correction, but for a warm-up that is asked for.

use crate::calibration::SCALE_AT_REFERENCE;
use crate::rate_table::input::RateTableInput;

/// A column before the terms: part of the fit, never of the correction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Level {
    /// Constant of a run (index into `runs`), °/h.
    Run(usize),
    /// One constant for all runs, °/h.
    AllRuns,
    /// ε0: the scale factor at T0, ppm.
    Scale,
    /// Misalignment towards an axis, rad.
    Across(char),
    /// Drift in time of a run (index into `runs`) or of all, °/h per hour.
    Drift(Option<usize>),
    /// Warm-up of this τ, °/h at the first row of a run.
    WarmUp {
        /// s.
        tau_s: f64,
    },
}

impl Level {
    /// Its name in the covariance.
    pub(crate) fn name(self, runs: &[usize]) -> String {
        match self {
            Self::Run(index) => format!("offset {}", runs.get(index).copied().unwrap_or(index)),
            Self::AllRuns => "offset".to_owned(),
            Self::Scale => SCALE_AT_REFERENCE.to_owned(),
            Self::Across(letter) => format!("misalignment {letter}"),
            Self::Drift(None) => "drift in time".to_owned(),
            Self::Drift(Some(index)) => format!("drift in time {}", runs.get(index).copied().unwrap_or(index)),
            Self::WarmUp { .. } => "warm-up".to_owned(),
        }
    }

    /// τ of a warm-up, s; `None` for every other level.
    pub(crate) fn warm_up_s(self) -> Option<f64> {
        match self {
            Self::WarmUp { tau_s } => Some(tau_s),
            _ => None,
        }
    }

    /// Part of the fit that is neither drift over temperature nor a property of a run ([`crate::fit::selection::nuisance`]).
    pub(crate) fn is_nuisance(self) -> bool {
        matches!(self, Self::Drift(_) | Self::WarmUp { .. })
    }
}

/// The columns before the terms.
pub(crate) fn levels(turning: Option<&RateTableInput>, used: &[usize], run: &[usize], runs: usize) -> Vec<Level> {
    let Some(turning) = turning else { return (0..runs).map(Level::Run).collect() };
    let of_run = |index: usize| used.iter().zip(run).filter(move |(_, run)| **run == index).map(|(i, _)| *i);
    let along = turning.rates(used.iter().copied()).len() > 1;
    let each_tells = (0..runs).all(|index| turning.rates(of_run(index)).len() > 1);
    let mut levels: Vec<Level> =
        if each_tells || !along { (0..runs).map(Level::Run).collect() } else { vec![Level::AllRuns] };
    if along {
        levels.push(Level::Scale);
    }
    let mut across: Vec<char> = used
        .iter()
        .map(|i| turning.across_dph[*i])
        .filter(|(_, rate)| rate.is_finite() && *rate != 0.0)
        .map(|(letter, _)| letter)
        .collect();
    across.sort_unstable();
    across.dedup();
    levels.extend(across.into_iter().map(Level::Across));
    levels
}
