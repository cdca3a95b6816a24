//! What the target must read besides the thermometer of the fit, written down.

use crate::calibration::{CODE_C, FurtherInput, InputSource, Thermometer};
use crate::fit::effects::Parts;
use crate::fit::problem::Problem;
use crate::fit::solution::Fitted;
use crate::model::input::{Input, Source, channels, plausible_about, unit_exponent};
use crate::window::{WindowShape, Windows};
use sagnac_log::setup::Setup;

/// What the target must read besides the thermometer of the fit, in the order of the image.
pub(crate) fn further_inputs(
    fitted: &Fitted,
    parts: &Parts<'_>,
    problem: &Problem<'_>,
    windows: &Windows,
    setup: &Setup,
    sensor: usize,
) -> Vec<FurtherInput> {
    let shape = &windows.shape;
    // One whose terms were all left out is read no more.
    let has_terms = |at: &usize| fitted.terms.iter().any(|term| term.input == *at);
    let named: Vec<Source> = (1..problem.inputs.len()).filter(has_terms).map(|at| problem.inputs[at].source).collect();
    let needed = channels(Source::Thermometer(sensor), &named).into_iter().skip(1);
    let of = |source: Source| {
        let name = source.name(shape);
        let own = problem.inputs.iter().position(|input| input.source == source);
        // A thermometer that only a difference needs has no terms, but a span to be within.
        let bare = own.is_none().then(|| Input::new(source, windows, &problem.used, setup.reference_c()));
        let input = own.map(|at| &problem.inputs[at]).or(bare.as_ref())?;
        let (span, reference) = ([input.span.lo_c, input.span.hi_c], input.reference);
        let (lag_s, rate_span_per_min) = own.map_or((None, None), |at| {
            (fitted.lag_of(at), fitted.lag(at).map(|(tau_s, _)| problem.rate_span(at, tau_s)))
        });
        let reading = Reading::of(source, shape, setup, span);
        let Reading { from, offset, gain_per_code, plausible, hold_s } = reading;
        Some(FurtherInput {
            name,
            source: from,
            reference,
            span,
            lag_s,
            rate_span_per_min,
            offset,
            gain_per_code,
            plausible,
            rms_dph: own.map_or(0.0, |at| parts.rms_of(at)),
            hold_s,
        })
    };
    needed.filter_map(of).collect()
}

/// How the target reads an input.
struct Reading {
    from: InputSource,
    offset: f64,
    gain_per_code: f64,
    plausible: [f64; 2],
    hold_s: f64,
}

impl Reading {
    fn of(source: Source, shape: &WindowShape, setup: &Setup, span: [f64; 2]) -> Self {
        let thermometer = |at: usize| shape.thermometers.get(at).cloned().unwrap_or_default();
        match source {
            Source::Thermometer(at) => {
                let t = Thermometer::from_setup(setup.thermometer(&thermometer(at)));
                Self {
                    from: InputSource::Thermometer(t.name),
                    offset: t.offset_c,
                    gain_per_code: t.gain_c_per_code,
                    plausible: t.plausible_c,
                    hold_s: t.hold_s,
                }
            }
            Source::Difference { of, less } => Self {
                from: InputSource::Difference(thermometer(of), thermometer(less)),
                offset: 0.0,
                gain_per_code: CODE_C,
                plausible: [-127.0, 127.0],
                hold_s: [of, less].map(|at| setup.thermometer(&thermometer(at)).hold_s).into_iter().fold(0.0, f64::max),
            },
            Source::Column(at) => {
                let name = shape.aux.get(at).cloned().unwrap_or_default();
                let aux = setup.aux(&name);
                let plausible = aux.plausible.unwrap_or_else(|| plausible_about(span));
                let code = CODE_C * 2.0_f64.powi(unit_exponent(plausible).into());
                Self {
                    from: InputSource::Column(name),
                    offset: aux.offset.unwrap_or(0.0),
                    gain_per_code: aux.gain_per_code.unwrap_or(code),
                    plausible,
                    hold_s: aux.hold_s,
                }
            }
        }
    }
}
