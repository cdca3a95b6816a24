//! A model that was asked for, checked against the log and the image.

use crate::fit::problem::axis::Axis;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::selection::allowed_inputs::{check_channels, check_codes, check_scale_rates, count_steps, sources_of};
use crate::fit::selection::folds::Trial;
use crate::fit::selection::grid::affordable;
use crate::fit::selection::held_by_image::ImageCheck;
use crate::fit::selection::nuisance::justified;
use crate::fit::selection::period::settle_periods;
use crate::fit::selection::search::fits_image;
use crate::fit::selection::selected::{Selected, SelectionLog};
use crate::fit::selection::warm_up::refined;
use crate::model::input::Signal;
use crate::model::spec::ModelSpec;
use sagnac_log::error::{Error, Result};

/// A requested model.
///
/// # Errors
/// Inputs that the log does not have; more terms than an image holds; terms that the log cannot support.
pub(crate) fn given<'a>(
    axis: &Axis<'a>,
    main: Signal,
    spec: &ModelSpec,
    image: ImageCheck<'a>,
) -> Result<Selected<'a>> {
    let shape = &axis.windows.shape;
    let mut spec = spec.clone();
    let sources = sources_of(&mut spec, main, shape)?;
    check_channels(&spec, &sources, shape)?;
    let mut problem = LeastSquares::new(axis, &sources)?;
    check_codes(&problem)?;
    check_scale_rates(&problem, &spec)?;
    count_steps(&problem, &mut spec)?;
    if !fits_image(&problem, &spec) {
        let most = sagnac_core::MAX_TERMS;
        return Err(Error::refused(
            format!("`{spec}` has more terms than an image holds ({most})"),
            "lower the orders in --model",
        )
        .column("--model"));
    }
    if spec.lags() > 0 && !problem.has_rate() {
        return Err(Error::refused(
            "a rate term needs times, and the log has none",
            "remove rate from --model, or give a log with time_s",
        )
        .column("--model"));
    }
    let taus_s = problem.tau_grid();
    if image.corrects_warm_up {
        let specs = affordable(&problem)?;
        problem = problem.with_further(&justified(&problem, &specs, &taus_s));
    }
    settle_periods(&problem, &mut spec, &taus_s)?;
    // What is held out of a short test says nothing of a fit that the prior holds together.
    let held_out = || Trial::new(&problem, &spec, &taus_s).held_out();
    let mean_square = if problem.has_prior() { None } else { held_out() };
    let problem = refined(problem, &spec, &taus_s);
    Ok(Selected {
        problem,
        grid: vec![spec.clone()],
        spec,
        taus_s,
        was_given: true,
        image,
        log: SelectionLog { mean_square, ..SelectionLog::default() },
    })
}
