//! `auto`: the best of the grid over the thermometer of the fit, then the [`super::search`] over all other inputs, zones and steps.
//!
//! Fails where inputs are known in different windows: the least known are excluded, and the record names them.

use crate::calibration::RejectedInput;
use crate::fit::problem::axis::Axis;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::selection::allowed_inputs::{candidate_inputs, count_steps};
use crate::fit::selection::folds::Trial;
use crate::fit::selection::grid::{Best, affordable, best_of_grid};
use crate::fit::selection::held_by_image::ImageCheck;
use crate::fit::selection::nuisance::justified;
use crate::fit::selection::prices::KNOWN_TOGETHER;
use crate::fit::selection::search::walk;
use crate::fit::selection::selected::{Selected, SelectionLog};
use crate::fit::selection::warm_up::refined;
use crate::model::input::Signal;
use sagnac_log::error::Result;

/// The best model of all inputs that the setup allows.
///
/// # Errors
/// No candidate that can be fitted.
pub(crate) fn auto<'a>(axis: &Axis<'a>, main: Signal, image: ImageCheck<'a>) -> Result<Selected<'a>> {
    let selected = with_or_without_time(axis, main, image)?;
    let problem = refined(selected.problem, &selected.spec, &selected.taus_s);
    Ok(Selected { problem, ..selected })
}

fn with_or_without_time<'a>(axis: &Axis<'a>, main: Signal, image: ImageCheck<'a>) -> Result<Selected<'a>> {
    let grid = LeastSquares::new(axis, &[main])?;
    let specs = affordable(&grid)?;
    let taus_s = grid.tau_grid();
    let nuisance = justified(&grid, &specs, &taus_s);
    let with_time = searched(axis, main, image, &nuisance, false)?;
    let corrected = image.corrects_warm_up && nuisance.iter().any(|level| level.warm_up_s().is_some());
    if nuisance.is_empty() || corrected || candidate_inputs(axis.windows, main, image.setup, &grid.used)?.0.is_empty() {
        return Ok(with_time);
    }
    // An input that follows what this fit puts down to time can be corrected, time cannot. No rate term may take the
    // place of either.
    let has_rate = with_time.spec.thermometer().rate.is_some();
    let without = searched(axis, main, image, &[], !has_rate)?;
    let follows = without.spec.inputs().len() > with_time.spec.inputs().len();
    Ok(if follows { without } else { with_time })
}

/// The model of a grid and a search, some nuisance columns next to its terms.
fn searched<'a>(
    axis: &Axis<'a>,
    main: Signal,
    image: ImageCheck<'a>,
    nuisance: &[Level],
    without_main_rate: bool,
) -> Result<Selected<'a>> {
    let make = |signals: &[Signal]| -> Result<LeastSquares<'a>> {
        let problem = LeastSquares::new(axis, signals)?.with_further(nuisance);
        Ok(if without_main_rate { problem.without_main_rate() } else { problem })
    };
    let grid = make(&[main])?;
    let taus_s = grid.tau_grid();
    let best = best_of_grid(&grid, affordable(&grid)?, &taus_s, &image)?;
    let setup = image.setup;
    let (further, mut aside) = candidate_inputs(axis.windows, main, setup, &grid.used)?;
    let all = known_together(main, further, setup.inputs.is_some(), grid, &make, &mut aside)?;
    let walked = walk(&all, &best.spec, &taus_s, &image);
    let Best { spec, mean_square, candidates, specs, not_held } = best;
    let selected = |problem, spec, mean_square, path| Selected {
        problem,
        spec,
        taus_s: taus_s.clone(),
        was_given: false,
        grid: specs,
        image,
        log: SelectionLog { mean_square, candidates, aside, path, not_held },
    };
    let Some(path) = walked else {
        return Ok(selected(make(&[main])?, spec, mean_square, Vec::new()));
    };
    let named =
        path.spec.inputs()[1..].iter().filter_map(|terms| all.input(&terms.input)).map(|at| all.inputs[at].signal);
    let needed: Vec<Signal> = std::iter::once(main).chain(named).collect();
    let (problem, mut spec) = (make(&needed)?, path.spec);
    count_steps(&problem, &mut spec)?;
    // On all windows of its fit, which may be more than those in which every candidate is known.
    let same = problem.used == all.used;
    let mean_square = if same { Some(path.mean_square) } else { Trial::new(&problem, &spec, &taus_s).held_out() };
    Ok(selected(problem, spec, mean_square, path.steps))
}

/// The problem of all other inputs on the windows in which they are known. Inputs that the setup does not name are excluded,
/// least known first, until nine tenths of the windows remain.
fn known_together<'a>(
    main: Signal,
    mut further: Vec<Signal>,
    named: bool,
    grid: LeastSquares<'a>,
    make: &impl Fn(&[Signal]) -> Result<LeastSquares<'a>>,
    aside: &mut Vec<RejectedInput>,
) -> Result<LeastSquares<'a>> {
    loop {
        if further.is_empty() {
            return Ok(grid);
        }
        let with_all: Vec<Signal> = std::iter::once(main).chain(further.iter().copied()).collect();
        let candidate = make(&with_all);
        let enough = |problem: &LeastSquares<'_>| problem.len() as f64 >= KNOWN_TOGETHER * grid.len() as f64;
        match candidate {
            Ok(problem) if named || enough(&problem) => return Ok(problem),
            Err(error) if named => {
                return Err(error.column("inputs").help("name inputs with values in the same windows"));
            }
            _ => {
                let known = |source: &Signal| {
                    grid.used.iter().filter(|i| source.in_window(grid.windows(), **i).0.is_finite()).count()
                };
                let least = (0..further.len()).min_by_key(|at| known(&further[*at])).unwrap_or(0);
                let name = further.remove(least).name(&grid.windows().shape);
                aside.push(RejectedInput {
                    input: name,
                    reason: "not known in the same windows as the others".to_owned(),
                });
            }
        }
    }
}
