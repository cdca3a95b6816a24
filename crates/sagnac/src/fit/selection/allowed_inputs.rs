//! The inputs that a model may read: those that it names, checked, or for `auto` those that the setup names or that the log has.
//!
//! Each refusal names the term or the input, and what to do: an image reads few inputs, a scale factor needs several input rates,
//! steps need whole numbers.

use crate::calibration::RejectedInput;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::model::input::{Signal, channels};
use crate::model::spec::ModelSpec;
use crate::rate_table::input::SAME_RATE;
use crate::window::{WindowShape, Windows};
use sagnac_log::error::{Error, Result};
use sagnac_log::setup::Setup;

/// The inputs that a model names, the thermometer of the fit first; their names as the log has them.
pub(crate) fn sources_of(spec: &mut ModelSpec, main: Signal, shape: &WindowShape) -> Result<Vec<Signal>> {
    let mut sources = vec![main];
    for of in spec.inputs_mut().iter_mut().skip(1) {
        let source = find_input(&of.input, main, shape).map_err(|e| e.column("--model"))?;
        of.input = source.name(shape);
        if sources.contains(&source) {
            return Err(Error::input("the same input under two names", "remove one of the two from --model")
                .column("--model")
                .value(&of.input));
        }
        sources.push(source);
    }
    Ok(sources)
}

/// Refuses more inputs than an image can read.
pub(crate) fn check_channels(spec: &ModelSpec, sources: &[Signal], shape: &WindowShape) -> Result<()> {
    let most = sagnac_core::MAX_INPUTS;
    let read = channels(sources[0], &sources[1..]);
    let count = read.len() + spec.repeats();
    if count <= most {
        return Ok(());
    }
    let names: Vec<String> = read.iter().map(|source| source.name(shape)).collect();
    let once_more = if spec.repeats() > 0 {
        format!(", {} of them once more for a slow rate", spec.repeats())
    } else {
        String::new()
    };
    let what = format!("`{spec}` reads {count} inputs ({}{once_more})", names.join(", "));
    Err(Error::refused(
        format!("{what}, and an image reads {most}"),
        "remove one input: a difference counts as two thermometers",
    )
    .column("--model"))
}

/// Refuses an input whose range is too small, relative to its value, for the codes of an image.
pub(crate) fn check_codes(problem: &LeastSquares<'_>) -> Result<()> {
    problem.others().iter().find(|input| !input.fits_codes()).map_or(Ok(()), |input| {
        Err(Error::refused(
            format!(
                "{} moves from {} to {}: too little of its size for the codes of an image",
                input.name, input.span.lo, input.span.hi
            ),
            "subtract its middle value in the log",
        )
        .column("--model"))
    })
}

/// Refuses scale terms at one input rate, where a scale factor is a bias.
pub(crate) fn check_scale_rates(problem: &LeastSquares<'_>, spec: &ModelSpec) -> Result<()> {
    let scaled = spec.inputs().iter().find(|terms| terms.scale > 0);
    let term = scaled.map(|terms| match terms.input.as_str() {
        "" => format!("scale {}", terms.scale),
        input => format!("scale({input})"),
    });
    term.filter(|_| !several_rates(problem)).map_or(Ok(()), |term| {
        let what = format!("{term} needs runs at several input rates: at one rate a scale factor is a bias");
        Err(Error::refused(what, "use bias(...) instead, or test on a rate table").column("--model"))
    })
}

/// True where the input rates of the runs separate scale factor and bias.
fn several_rates(problem: &LeastSquares<'_>) -> bool {
    let (lo, hi) = problem.run_rate.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), r| (l.min(*r), h.max(*r)));
    problem.column_of(Level::Scale).is_some() || hi - lo > SAME_RATE * lo.abs().max(hi.abs())
}

/// How many steps each stepped input has on these windows.
pub(crate) fn count_steps(problem: &LeastSquares<'_>, spec: &mut ModelSpec) -> Result<()> {
    for of in spec.inputs_mut().iter_mut().filter(|of| of.steps.is_some()) {
        let steps = problem.input(&of.input).map_or(0, |at| problem.inputs[at].thresholds().len());
        if steps == 0 {
            let what = "does not stand at one of 2 to 16 whole numbers in nine of ten windows";
            return Err(Error::refused(
                format!("`{}` {what}", of.input),
                "use a series instead, such as bias(...) 1, or set a --window in which the value is constant",
            )
            .column("--model"));
        }
        of.steps = u8::try_from(steps).ok();
    }
    Ok(())
}

fn find_input(name: &str, main: Signal, shape: &WindowShape) -> Result<Signal> {
    let signal = Signal::named(name, shape).ok_or_else(|| {
        let all: Vec<String> = Signal::others(shape, usize::MAX).into_iter().map(|s| s.name(shape)).collect();
        Error::input("the log has no input of this name", format!("choose one of these: {}", Error::choices(&all)))
            .value(name)
    })?;
    if signal == main {
        return Err(Error::input(
            "this is the thermometer of the fit",
            "write its terms without brackets, such as --model 'bias 3'",
        )
        .value(name));
    }
    if let Signal::Difference { of, less } = signal
        && of == less
    {
        return Err(
            Error::input("the thermometer is subtracted from itself", "name two different thermometers").value(name)
        );
    }
    Ok(signal)
}

/// Inputs other than the thermometer of the fit that `auto` may use: those named in the setup, otherwise all that vary and are
/// known in enough windows.
pub(crate) fn candidate_inputs(
    windows: &Windows,
    main: Signal,
    setup: &Setup,
    used: &[usize],
) -> Result<(Vec<Signal>, Vec<RejectedInput>)> {
    let shape = &windows.shape;
    if let Some(names) = &setup.inputs {
        let signals = names.iter().map(|name| find_input(name, main, shape).map_err(|e| e.column("inputs")));
        return Ok((signals.collect::<Result<_>>()?, Vec::new()));
    }
    let Signal::Thermometer(at) = main else { return Ok((Vec::new(), Vec::new())) };
    let (mut further, mut aside) = (Vec::new(), Vec::new());
    for source in Signal::others(shape, at) {
        match source.rejection(windows, used) {
            None => further.push(source),
            Some(reason) => aside.push(RejectedInput { input: source.name(shape), reason: reason.to_owned() }),
        }
    }
    Ok((further, aside))
}
