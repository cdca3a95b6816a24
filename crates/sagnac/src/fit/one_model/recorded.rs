//! A fitted model as the record has it: inputs in the order of the image (the thermometer of the fit, everything else with a
//! code of its own, the differences, then the repeats for second lags), and terms.

use crate::calibration::{CorrectionTerm, Input};
use crate::fit::one_model::effects::Parts;
use crate::fit::one_model::movement::with_movement;
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::model::input::{SampledInput, Signal, channels};
use crate::window::Windows;
use sagnac_log::setup::Setup;

/// Inputs that the target must read; without `parts`, what each of them makes is not known.
pub(crate) fn recorded_inputs(
    fitted: &Fitted,
    parts: Option<&Parts<'_>>,
    problem: &LeastSquares<'_>,
    windows: &Windows,
    setup: &Setup,
    sensor: usize,
) -> Vec<Input> {
    // An input without terms is not read.
    let has_terms = |at: &usize| fitted.terms.iter().any(|term| term.input == *at);
    let named: Vec<Signal> =
        (1..=problem.others().len()).filter(has_terms).map(|at| problem.inputs[at].signal).collect();
    let fitted_with = |at: usize, input: Input| Input {
        lag_s: fitted.lag_of(at),
        rate_span_per_min: fitted.lag(at).map(|(tau_s, _)| problem.rate_span(at, tau_s)),
        rms_dph: parts.map(|parts| parts.rms_of(at)),
        ..input
    };
    let input_of = |signal: Signal| {
        let own = problem.inputs.iter().position(|input| input.signal == signal);
        // A thermometer that only a difference needs has no terms, but it has a span.
        let bare = own.is_none().then(|| SampledInput::new(signal, windows, &problem.used, setup.reference_c()));
        let sampled = own.map(|at| &problem.inputs[at]).or(bare.as_ref())?;
        let input = as_set_up(sampled, windows, setup);
        Some(match own {
            Some(at) => fitted_with(at, input),
            None => Input { rms_dph: parts.map(|_| 0.0), ..input },
        })
    };
    let slow = (0..problem.inputs.len()).filter(has_terms).filter_map(|at| {
        let repeated = &problem.inputs[problem.inputs[at].repeats?];
        let input = as_set_up(repeated, windows, setup).repeat(problem.inputs[at].name.clone());
        Some(fitted_with(at, input))
    });
    channels(Signal::Thermometer(sensor), &named).into_iter().filter_map(input_of).chain(slow).collect()
}

/// Terms over those inputs.
pub(crate) fn terms(fitted: &Fitted, problem: &LeastSquares<'_>, inputs: &[Input]) -> Vec<CorrectionTerm> {
    let levels = problem.levels().len();
    let vif = |at: usize| fitted.conditioning.as_ref().and_then(|conditioning| *conditioning.vif.get(at)?);
    let term = |(at, column): (usize, &TermColumn)| {
        let (value, sigma) = (fitted.theta[levels + at], fitted.sigma(levels + at));
        let sampled = &problem.inputs[column.input];
        // The thermometer of the fit goes by the name that the record gives it.
        let input = if column.input == 0 { inputs.first().map(|main| main.name.clone()) } else { None };
        CorrectionTerm {
            acts_on: column.form.acts_on,
            input: input.unwrap_or_else(|| sampled.name.clone()),
            shape: column.form.shape,
            times_rate: column.form.times_rate,
            value,
            sigma: Some(sigma),
            unit: column.form.unit(sampled.signal.in_celsius()).to_owned(),
            significant: Some(value.abs() > fitted.t_quantile_975 * sigma),
            vif: vif(at),
        }
    };
    fitted.terms.iter().enumerate().map(term).collect()
}

fn as_set_up(sampled: &SampledInput, windows: &Windows, setup: &Setup) -> Input {
    let (span, reference, name) = (sampled.span, sampled.reference, sampled.name.clone());
    let shape = &windows.shape;
    let thermometer = |at: usize| setup.thermometer(shape.thermometers.get(at).map_or("", String::as_str));
    match sampled.signal {
        Signal::Thermometer(at) => {
            let stated = thermometer(at).max_step_c;
            with_movement(Input::thermometer(thermometer(at), span, reference), windows, at, stated)
        }
        Signal::Difference { of, less } => Input::difference(name, [of, less].map(thermometer), span, reference),
        Signal::Column(at) => {
            let column = setup.aux(shape.aux.get(at).map_or("", String::as_str));
            let stated = column.max_step;
            let input = Input::column(name, column, span, reference);
            with_movement(input, windows, shape.thermometers.len() + at, stated)
        }
    }
}
