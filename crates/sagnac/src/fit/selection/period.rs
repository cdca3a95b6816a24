//! The period of a harmonic, where the model does not state it.
//!
//! ```text
//! P̂ = argmin over P of the least misfit of the whole model with cos(2πv/P) and sin(2πv/P)        Lomb 1976, Scargle 1982
//! ```
//!
//! A grid of an eighth of a turn over the span, from half a turn to as many as the windows resolve, then parabolas about the
//! best point. Lags are fitted without the harmonics first, and again with them by the fit itself.
//!
//! A grid of so many periods always finds one that fits the noise. So the harmonic must lower the held-out mean square by the
//! criterion of the model search ([`super::criterion`]), with as many tries as there are independent periods (two per turn);
//! else the model is refused. ∂y/∂P is a column of the Jacobian, so that every interval includes the uncertainty of the period.
//!
//! Fails where the input moves by more than half a period within a window: the harmonic is averaged out.

use crate::fit::one_model::design::effective_windows;
use crate::fit::one_model::solution::{fit, misfit_at};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::selection::criterion::needed_gain;
use crate::fit::selection::folds::Trial;
use crate::model::shape::period_on_grid;
use crate::model::{ModelSpec, Span};
use crate::noise_model::minimum::minimum;
use rayon::prelude::*;
use sagnac_log::error::{Error, Result};

/// Turns over the span between points of the grid.
const STEP: f64 = 0.125;
/// Fewest turns over the span.
const FEWEST: f64 = 0.5;
/// Most turns over the span that are tried.
const MOST: f64 = 60.0;
/// Windows per turn that resolve a period.
const WINDOWS_PER_TURN: f64 = 8.0;
/// Turns are found to within this.
const TOLERANCE: f64 = 1e-6;

/// Puts stated periods on the grid of the image and finds the others.
///
/// # Errors
/// [`sagnac_log::ErrorKind::Refused`] where a fitted period improves the fit no more than chance.
pub(crate) fn settle_periods(problem: &LeastSquares<'_>, spec: &mut ModelSpec, taus_s: &[f64]) -> Result<()> {
    for at in 0..spec.inputs().len() {
        let Some(input) = problem.index_of(&spec.inputs()[at]) else { continue };
        let span = problem.inputs[input].span;
        for wave in 0..spec.inputs()[at].harmonics.len() {
            let period = match spec.inputs()[at].harmonics[wave].period {
                Some(stated) => stated,
                None => search(problem, spec, [at, wave], span, taus_s)?,
            };
            spec.inputs_mut()[at].harmonics[wave].period = Some(period_on_grid(span, period));
        }
    }
    Ok(())
}

/// The period of least misfit; [at, wave] is the harmonic.
fn search(
    problem: &LeastSquares<'_>,
    spec: &ModelSpec,
    [at, wave]: [usize; 2],
    span: Span,
    taus_s: &[f64],
) -> Result<f64> {
    let mut without = spec.clone();
    without.inputs_mut()[at].harmonics.remove(wave);
    let base = fit(problem, &without, taus_s)?;
    let lags: Vec<(usize, f64)> = base.taus.iter().map(|tau| (tau.input, tau.value_s)).collect();
    let width = span.hi - span.lo;
    let with = |turns: f64| {
        let mut tried = spec.clone();
        tried.inputs_mut()[at].harmonics[wave].period = Some(period_on_grid(span, width / turns));
        tried
    };
    let misfit = |turns: f64| misfit_at(problem, &with(turns), &lags);
    let most = MOST.min(problem.len() as f64 / WINDOWS_PER_TURN).max(2.0 * FEWEST);
    let grid: Vec<f64> = (0..=((most - FEWEST) / STEP) as usize).map(|i| FEWEST + STEP * i as f64).collect();
    let misfits: Vec<f64> = grid.par_iter().map(|turns| misfit(*turns)).collect();
    let best = (0..grid.len()).min_by(|a, b| misfits[*a].total_cmp(&misfits[*b])).unwrap_or(0);
    let turns = minimum((grid[best] - STEP).max(FEWEST), grid[best] + STEP, TOLERANCE, misfit).at;
    let with_period = with(turns);
    let gain = needed_gain(effective_windows(problem.len(), base.autocorrelation), 3, (2.0 * most) as usize);
    let held_out = |spec: &ModelSpec| Trial::new(problem, spec, taus_s).held_out();
    let (before, after) = (held_out(&without), held_out(&with_period));
    match (before, after) {
        (Some(before), Some(after)) if after * gain < before => Ok(width / turns),
        _ => Err(Error::refused(
            format!(
                "no period of {} explains more than chance: the best, {:.4}, takes the held-out σ from {} to {} °/h",
                problem.inputs.get(problem.index_of(&spec.inputs()[at]).unwrap_or(0)).map_or("", |input| &input.name),
                width / turns,
                words(before),
                words(after)
            ),
            "give the period, remove the harmonic from --model, or test over several periods of the input",
        )
        .column("--model")),
    }
}

fn words(mean_square: Option<f64>) -> String {
    mean_square.map_or("-".to_owned(), |square| sagnac_units::format::significant(square.sqrt(), 4))
}
