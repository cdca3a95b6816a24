//! The record of the fit of one axis.

use crate::calibration::{
    AxisCalibration, AxisCorrection, Collinearity, CorrectionNoise, CurveSpread, Entanglement, FitDiagnostics,
    FitResidual, FixedBias, Hysteresis, LackOfFit, LogUnit, MemoryAtRest, PriorUse, RunOffset, Soak, Target,
    TimeEffect, TimeEffectKind, WholeNoise,
};
use crate::diagnostics::{
    AxisReportData, WindowPoint, hysteresis_of, offsets_hide_drift, points, ramp_rates_cpm, run_spans,
};
use crate::fit::one_model::curve::FittedCurve;
use crate::fit::one_model::effects::Parts;
use crate::fit::one_model::recorded::{recorded_inputs, terms};
use crate::fit::one_model::residual_noise::FitResidualNoise;
use crate::fit::one_model::solution::Fitted;
use crate::fit::one_model::warm_up::estimate;
use crate::fit::options::{FitOptions, Model};
use crate::fit::prior::with_prior::{WithPrior, fit_with_prior};
use crate::fit::problem::axis::Axis;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::problem::rate_columns::CommonRates;
use crate::fit::record::drawn::drawn;
use crate::fit::record::monomial::monomials;
use crate::fit::record::scale_factor::{check_scale, misalignment, scale_factor};
use crate::fit::selection::auto::auto;
use crate::fit::selection::given::given;
use crate::fit::selection::held_by_image::ImageCheck;
use crate::fit::selection::prices::CONDITION_MAX;
use crate::fit::selection::selected::Selected;
use crate::fit::uncertainty::entanglement::entangled;
use crate::fit::uncertainty::memory::{LEAST_OF_LEG, memory_at_rest};
use crate::fit::uncertainty::other_curves::spread_and_lack_of_fit;
use crate::fit::uncertainty::rate_left::rate_left;
use crate::fit::uncertainty::soak::soak;
use crate::fit::uncertainty::whole_noise::whole_noise;
use crate::image::Holder;
use crate::model::input::Signal;
use crate::noise_model::estimate::NoiseEstimate;
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::stated::{noise_floor_of, stated_noise};
use crate::rate_table::input::RateTableInput;
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::AngleUnit;
use sagnac_log::setup::{Setup, input_rate_hint};

/// Size of a count of the log; `None` for a rate log whose counts follow its correction.
pub(crate) fn count_of(windows: &Windows, setup: &Setup) -> Option<LogUnit> {
    match windows.shape.unit {
        AngleUnit::Quanta { arcsec_per_count, quantum } => Some(LogUnit::Counts { arcsec_per_count, quantum }),
        AngleUnit::Arcsec => setup.rate_lsb_arcsec.map(|lsb_arcsec| LogUnit::Rates { lsb_arcsec }),
    }
}

/// The record of one axis, and what a report draws of it.
pub(crate) fn fit_axis(
    windows: &Windows,
    axis: usize,
    sensor: usize,
    setup: &Setup,
    options: &FitOptions,
) -> Result<(AxisCalibration, AxisReportData)> {
    let letter = windows.shape.axes[axis];
    let reference_c = setup.reference_c();
    let turning = RateTableInput::of(windows, axis, setup)?;
    if let Some(turning) = &turning {
        turning.check_scale(windows, axis, setup.scale_factor_deviation_max_ppm())?;
    }
    let axis_of = Axis {
        windows,
        index: axis,
        reference_c,
        min_span_c: setup.min_span_c(),
        turning,
        prior: options.prior.as_ref(),
        progress: options.progress.of_axis(letter),
        common: CommonRates::default(),
    };
    let holder = Holder {
        unit: count_of(windows, setup),
        target: Target::of(setup)?,
        most_instructions: setup.slow_update_instructions_max,
    };
    let corrects_warm_up = options.corrects_warm_up;
    let image = ImageCheck { windows, setup, sensor, axis: letter, holder, corrects_warm_up };
    let main = Signal::Thermometer(sensor);
    let noise_floor = noise_floor_of(windows, axis, setup);
    let raw_n = noise_floor.as_ref().map(|floor| floor.n_deg_rt_h);
    let stated = stated_noise(windows, axis, setup);
    let one = one_fit(&axis_of, main, image, &options.model, raw_n, stated)?;
    let OneFit { selected, fitted, noise, .. } = &one;
    let problem = &selected.problem;
    let NoiseEstimate { best, mixed } = noise.estimate;
    let white_variance = |slow| noise.white_variance(problem, fitted, slow);
    let parts = Parts::new(fitted, problem);
    let inputs = recorded_inputs(fitted, Some(&parts), problem, windows, setup, sensor);
    let terms = terms(fitted, problem, &inputs);
    check_scale(&terms, letter)?;
    let warm_up = corrects_warm_up.then(|| estimate(problem, fitted, mixed, white_variance(mixed))).flatten();
    let (monomial, zones) = monomials(fitted, problem, &windows.shape, reference_c);
    let run_offsets = run_offsets(fitted, problem, setup.input_rate_of(letter, windows.shape.axes.len()));
    let fixed_bias = FixedBias::of(&run_offsets).filter(|_| options.removes_bias);
    if options.removes_bias && fixed_bias.is_none() {
        return Err(unknown_input(letter, windows.shape.axes.len()));
    }
    let report_data = drawn(fitted, problem, &parts, &run_offsets, [axis, sensor]);
    let points = &report_data.points;
    let residual = residual(fitted);
    // A prior's uncertainty is in its covariance.
    let test_alone = if options.prior.is_some() { OfTest::default() } else { OfTest::of(&one, points, sensor, stated) };
    let diagnostics = FitDiagnostics {
        hysteresis: hysteresis(points, &residual),
        ramp_rates_cpm: ramp_rates_cpm(points),
        hidden_in_offsets_dph: offsets_hide_drift(points).then(|| scatter(&run_offsets)),
        residual,
        noise_floor,
        cross_validation: selected.cross_validation(),
        collinearity: fitted
            .conditioning
            .as_ref()
            .map(|conditioning| Collinearity { condition: conditioning.condition, limit: CONDITION_MAX }),
        correction_noise: (!fitted.terms.is_empty()).then(|| one.correction_noise.clone()),
        whole_noise: test_alone.whole_noise,
        memory: test_alone.memory,
        rate_left_dph_per_cpm: test_alone.rate_left_dph_per_cpm,
        curve_spread: test_alone.curve_spread,
        lack_of_fit: test_alone.lack_of_fit,
        slow_noise: best.terms(white_variance(best).sqrt()),
        noise_exceeds_setup: noise.exceeds_setup,
        time_effects: time_effects(fitted, problem, corrects_warm_up),
        entanglement: test_alone.entanglement,
        prior: one.prior.clone(),
        soak: test_alone.soak,
        scale_factor: scale_factor(fitted, problem, axis, noise.stated),
        misalignment: misalignment(fitted, problem),
        candidates: selected.candidates(),
        model_search: selected.log.path.clone(),
        rejected_inputs: selected.log.aside.clone(),
        rejected_models: selected.log.not_held.clone(),
        excluded: windows.tallies.list(),
        covariance: fitted.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        covariance_of: covariance_of(fitted, problem),
    };
    let record = AxisCalibration {
        axis: letter,
        correction: AxisCorrection { model: fitted.spec.to_string(), inputs, terms, warm_up, fixed_bias },
        run_offsets,
        monomial,
        zones,
        fit: Some(diagnostics),
    };
    Ok((record, report_data))
}

/// A log at rest holds bias and input rate in one number.
fn unknown_input(axis: char, axes: usize) -> Error {
    let what = format!("the fixed bias of axis {axis} is unknown, because its input rate is");
    Error::input(what, format!("give the input rate: {}", input_rate_hint(axis, axes))).column("--remove-bias")
}

/// What other models, more soaking and what moved together make of the curve: of the test alone.
#[derive(Default)]
struct OfTest {
    memory: Option<MemoryAtRest>,
    rate_left_dph_per_cpm: Option<f64>,
    soak: Option<Soak>,
    curve_spread: Option<CurveSpread>,
    lack_of_fit: Option<LackOfFit>,
    entanglement: Vec<Entanglement>,
    whole_noise: Option<WholeNoise>,
}

impl OfTest {
    fn of(one: &OneFit<'_>, drawn: &[WindowPoint], sensor: usize, stated: Option<(SlowNoise, f64)>) -> Self {
        let OneFit { selected, fitted, noise, .. } = one;
        let (problem, slow) = (&selected.problem, noise.estimate.best);
        let curve = FittedCurve::of(problem, fitted);
        let (curve_spread, lack_of_fit) = spread_and_lack_of_fit(selected, fitted, slow, |celsius| curve.at(celsius));
        let windows = problem.windows();
        let profile = points(windows, &run_spans(windows), Some(sensor), |_| 0.0, |_| 0.0);
        let white = noise.white_variance(problem, fitted, slow);
        Self {
            memory: memory_at_rest(problem, drawn, &residual(fitted), |celsius| curve.at(celsius).0),
            rate_left_dph_per_cpm: rate_left(problem, fitted, slow, white),
            soak: soak(problem, fitted, slow),
            curve_spread,
            lack_of_fit,
            entanglement: entangled(problem, (slow, white), fitted, &profile),
            whole_noise: whole_noise(problem, fitted, &profile, stated),
        }
    }
}

/// A model on its axis, fitted.
struct OneFit<'a> {
    selected: Selected<'a>,
    fitted: Fitted,
    noise: FitResidualNoise,
    correction_noise: CorrectionNoise,
    prior: Option<PriorUse>,
}

/// Selects a model and fits it: with the prior of the axis, else the given one or the best.
fn one_fit<'a>(
    axis: &Axis<'a>,
    main: Signal,
    image: ImageCheck<'a>,
    model: &Model,
    raw_n_deg_rt_h: Option<f64>,
    stated: Option<(SlowNoise, f64)>,
) -> Result<OneFit<'a>> {
    if let Some(prior) = axis.prior {
        let selected = given(axis, main, &prior.model, image)?;
        let WithPrior { fitted, noise, white_variance, used } =
            fit_with_prior(&selected.problem, &selected.spec, prior, stated)?;
        let correction_noise = selected.check(&fitted, raw_n_deg_rt_h)?;
        let noise = FitResidualNoise::known(noise, white_variance);
        return Ok(OneFit { selected, fitted, noise, correction_noise, prior: Some(used) });
    }
    let mut selected = match model {
        Model::Fixed(spec) => given(axis, main, spec, image)?,
        Model::Auto => auto(axis, main, image)?,
    };
    let (fitted, correction_noise) = selected.settle(raw_n_deg_rt_h)?;
    let noise = FitResidualNoise::of(&selected.problem, &fitted, stated);
    let fitted = noise.beneath(&selected.problem, fitted);
    Ok(OneFit { selected, fitted, noise, correction_noise, prior: None })
}

/// σ of offsets about their mean, °/h.
fn scatter(offsets: &[RunOffset]) -> f64 {
    let values: Vec<f64> = offsets.iter().map(|offset| offset.value_dph).collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt()
}

/// Hysteresis before and after the fit; the standard error of both is that of the residuals, widened by their
/// correlation.
fn hysteresis(points: &[WindowPoint], residual: &FitResidual) -> Option<Hysteresis> {
    let before = hysteresis_of(points, LEAST_OF_LEG, |p| p.before_dph)?;
    let after = hysteresis_of(points, LEAST_OF_LEG, |p| p.after_dph)?;
    Some(Hysteresis {
        before_dph: before.difference_dph,
        after_dph: after.difference_dph,
        sigma_dph: residual.widened_sigma_dph() * after.per_sigma,
    })
}

fn covariance_of(fitted: &Fitted, problem: &LeastSquares<'_>) -> Vec<String> {
    let named = |input: usize, name: &dyn Fn(Option<&str>) -> String| {
        let input_name = |input: usize| (input > 0).then(|| problem.inputs[input].name.as_str());
        match problem.inputs[input].repeats {
            Some(repeated) => format!("slow {}", name(input_name(repeated))),
            None => name(input_name(input)),
        }
    };
    let runs = problem.levels().iter().map(|level| level.name(&problem.runs));
    let terms = fitted.terms.iter().map(|term| named(term.input, &|input| term.form.name(input)));
    let others = fitted
        .nonlinear()
        .into_iter()
        .map(|(input, name, _)| named(input, &|of| of.map_or(name.to_owned(), |of| format!("{name}({of})"))));
    runs.chain(terms).chain(others).collect()
}

fn run_offsets(fitted: &Fitted, problem: &LeastSquares<'_>, input_dph: Option<f64>) -> Vec<RunOffset> {
    let rows = problem.runs.iter().enumerate().filter_map(|(index, run)| {
        let column = problem.column_of(Level::Run(index)).or_else(|| problem.column_of(Level::AllRuns))?;
        Some(RunOffset {
            run: *run as u32,
            value_dph: fitted.theta[column],
            sigma_dph: Some(fitted.sigma(column)),
            fixed_bias_dph: input_dph.map(|input| fitted.theta[column] - input),
        })
    });
    rows.collect()
}

/// Drift in time and warm-up next to the terms; without the warm-up where it is corrected.
fn time_effects(fitted: &Fitted, problem: &LeastSquares<'_>, corrects_warm_up: bool) -> Vec<TimeEffect> {
    let effect = |(place, level): (usize, &Level)| {
        let (kind, run, unit, tau_s) = match *level {
            Level::Drift(run) => (TimeEffectKind::Drift, run.map(|index| problem.runs[index] as u32), "deg/h/h", None),
            Level::WarmUp { .. } if corrects_warm_up => return None,
            Level::WarmUp { tau_s } => (TimeEffectKind::WarmUp, None, "deg/h", Some(tau_s)),
            Level::Run(_) | Level::AllRuns | Level::Scale | Level::Across(_) => return None,
        };
        let (value, sigma) = (fitted.theta[place], fitted.sigma(place));
        Some(TimeEffect { kind, run, value, sigma, unit: unit.to_owned(), tau_s })
    };
    problem.levels().iter().enumerate().filter_map(effect).collect()
}

fn residual(fitted: &Fitted) -> FitResidual {
    let (lo, hi) =
        fitted.residuals.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), r| (r.min(lo), r.max(hi)));
    FitResidual {
        n: fitted.residuals.len(),
        sigma_dph: fitted.sigma_dph,
        peak_to_peak_dph: hi - lo,
        lag1_autocorrelation: fitted.autocorrelation,
        t_quantile_975: fitted.t_quantile_975,
    }
}
