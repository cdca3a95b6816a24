//! The record of the fit of every axis.

use std::collections::BTreeMap;

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, Reason};
use sagnac_log::setup::{ModelConfig, PerAxis, Setup, Stages, TargetConfig, TestConfig};
use sagnac_noise::NoiseTerms;
use sagnac_units::{ARCSEC_RT_S_PER_DEG_RT_H, s_from_ns};

use crate::calibration::{
    AxisCalibration, AxisCorrection, Calibration, Collinearity, FORMAT, FitDiagnostics, Hysteresis, LogFile, LogUnit,
    MINOR_VERSION, Misalignment, NoiseFloor, PpmEstimate, Provenance, Residual, RunOffset, ScaleFactor, Target, Term,
    TimeEffect, TimeEffectKind, UNASSIGNED, VERSION, program,
};
use crate::diagnostics::{
    AxisReportData, Effect, Point, ReportData, hysteresis_of, offsets_hide_drift, points, ramp_rates_cpm, run_spans,
};
use crate::fit::Model;
use crate::fit::choose::{Chosen, choose};
use crate::fit::correction::{ImageCheck, recorded_inputs, terms};
use crate::fit::effects::Parts;
use crate::fit::entanglement::entangled;
use crate::fit::exclusions;
use crate::fit::known_rates::CommonRates;
use crate::fit::least_squares::{LeastSquares, Level, TermColumn};
use crate::fit::monomial::monomials;
use crate::fit::plateaus::repeatability;
use crate::fit::progress::Progress;
use crate::fit::rate_table_input::RateTableInput;
use crate::fit::robust::Loss;
use crate::fit::search::CONDITION_MAX;
use crate::fit::slow_noise::{Estimate, SlowNoise};
use crate::fit::soak::{Extension, soak};
use crate::fit::solution::Fitted;
use crate::fit::warm_up::estimate;
use crate::fit::with_prior::UnitPrior;
use crate::image::{Holder, rate_unit};
use crate::model::ActsOn;
use crate::model::input::Signal;
use crate::window::{WindowShape, Windows};

/// Windows of a leg that make a mean.
const LEAST_OF_LEG: usize = 10;
/// Scale terms of a larger uncertainty are refused: the runs do not separate them from bias.
const SCALE_SIGMA_MAX_PPM: f64 = 1000.0;

/// What to fit.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FitOptions {
    /// Model.
    pub model: Model,
    /// SOURCE_DATE_EPOCH if it is set.
    pub source_date_epoch: Option<i64>,
    /// Loss function of the recorded fit.
    pub loss: Loss,
    /// Whether a warm-up since power-on is a part of the correction, where the runs hold one; every run then begins at power-on.
    pub corrects_warm_up: bool,
    /// What is known of the unit before its test; its model takes the place of `model`.
    pub prior: Option<UnitPrior>,
    /// Told what the fit is doing.
    pub progress: Progress,
}

impl FitOptions {
    /// A model, by least squares.
    pub fn new(model: Model) -> Self {
        let progress = Progress::default();
        let loss = Loss::Squares;
        Self { model, source_date_epoch: None, loss, corrects_warm_up: false, prior: None, progress }
    }

    /// With the time of SOURCE_DATE_EPOCH in place of that of the newest input sample.
    #[must_use]
    pub fn source_date_epoch(self, epoch_s: Option<i64>) -> Self {
        Self { source_date_epoch: epoch_s, ..self }
    }

    /// With a warm-up in the correction, where the runs hold one. Every run must begin at power-on.
    #[must_use]
    pub fn correct_warm_up(self, corrects_warm_up: bool) -> Self {
        Self { corrects_warm_up, ..self }
    }

    /// With what is known of the unit before its test.
    #[must_use]
    pub fn prior(self, prior: Option<UnitPrior>) -> Self {
        Self { prior, ..self }
    }

    /// With somebody who is told what the fit is doing.
    #[must_use]
    pub fn progress(self, progress: Progress) -> Self {
        Self { progress, ..self }
    }

    /// With another loss.
    #[must_use]
    pub fn loss(self, loss: Loss) -> Self {
        Self { loss, ..self }
    }
}

/// Fits every axis.
///
/// # Errors
/// [`sagnac_log::ErrorKind::Refused`] where the data cannot support the answer: no temperature, too small a
/// span, T0 outside it, too few windows, terms that cannot be separated.
pub fn calibrate(windows: Windows, setup: &Setup, options: &FitOptions) -> Result<Calibration> {
    calibrate_with_report_data(windows, setup, options).map(|(calibration, _)| calibration)
}

/// The same, with the points behind it for a report.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_with_report_data(
    mut windows: Windows,
    setup: &Setup,
    options: &FitOptions,
) -> Result<(Calibration, ReportData)> {
    check_with_prior(options)?;
    let mut stages = setup.stages();
    let rates = PerAxis::of_log(stages.test.input_rate_dph.as_ref(), None, &windows.shape.axes);
    stages.test.input_rate_dph = rates.map_err(|e| of_file(e, &windows))?;
    let sensor = sensor_of(&windows.shape, &stages.model).map_err(|e| of_file(e, &windows))?;
    check_aux(&windows.shape, &stages.model)?;
    for i in 0..windows.len() {
        if windows.rows.mean_c[sensor][i].is_nan() {
            windows.exclude(i, Reason::NoTemperature);
        }
    }
    exclusions::check(&windows)?;
    RateTableInput::leave_out_unknown(&mut windows, &stages.test)?;
    let runs = run_spans(&windows);
    let (mut axes, mut drawn) = (Vec::new(), Vec::new());
    for axis in 0..windows.shape.axes.len() {
        let (mut record, drawn_of) =
            fit_axis(&windows, axis, sensor, &stages, options).map_err(|e| of_file(e, &windows))?;
        let constant = |i: usize| {
            let run = windows.rows.run[i];
            record.run_offsets.iter().find(|offset| offset.run == run).map_or(f64::NAN, |c| c.value_dph)
        };
        // Rotation of a table is not drift: known for every used window, unknown for the others.
        let shown = |i: usize| drawn_of.windows.get(&i);
        let before = |i: usize| {
            if record.turned() {
                shown(i).map_or(f64::NAN, |shown| shown.before)
            } else {
                windows.rate_dph(axis, i) - constant(i)
            }
        };
        let after = |i: usize| shown(i).map_or(f64::NAN, |shown| shown.after);
        let mut points = points(&windows, &runs, Some(sensor), before, after);
        for (i, shown) in &drawn_of.windows {
            points[*i].inputs_dph = shown.inputs;
        }
        if let Some(fit) = &mut record.fit {
            fit.hysteresis = hysteresis(&points, &fit.residual);
            fit.ramp_rates_cpm = ramp_rates_cpm(&points);
            let offsets: Vec<f64> = record.run_offsets.iter().map(|offset| offset.value_dph).collect();
            fit.hidden_in_offsets_dph = offsets_hide_drift(&points).then(|| scatter(&offsets));
        }
        drawn.push(AxisReportData { axis: windows.shape.axes[axis], points, effects: drawn_of.effects });
        axes.push(record);
    }
    let report_data = ReportData { runs, timed: windows.shape.timed, axes: drawn };
    let shape = &windows.shape;
    let target = Target::from_config(stages.target)?;
    let unit = match count_of(&windows, &stages.target) {
        Some(unit) => unit,
        None => {
            let corrections: Vec<(char, &AxisCorrection)> = axes.iter().map(|a| (a.axis, &a.correction)).collect();
            rate_unit(target, &corrections)?
        }
    };
    let calibration = Calibration {
        format: FORMAT.to_owned(),
        version: VERSION,
        minor_version: MINOR_VERSION,
        serial: stages.identity.serial.unwrap_or_else(|| UNASSIGNED.to_owned()),
        unit,
        target,
        window: shape.window,
        window_s: shape.nominal_s,
        sample_interval_s: shape.sample_interval_s,
        axes,
        setup: setup.clone(),
        provenance: provenance(&windows, options),
    };
    Ok((calibration, report_data))
}

/// What a prior does not go with.
fn check_with_prior(options: &FitOptions) -> Result<()> {
    let what = match options {
        FitOptions { prior: None, .. } => return Ok(()),
        FitOptions { loss: Loss::Huber, .. } => "--loss huber",
        FitOptions { corrects_warm_up: true, .. } => "--warm-up",
        FitOptions { model: Model::Fixed(_), .. } => "--model",
        FitOptions { .. } => return Ok(()),
    };
    Err(Error::input(format!("{what} does not go with a prior"))
        .column("--prior")
        .help("a prior has its own model, and its weights are those of Gaussian noise"))
}

/// Size of a count of the log; `None` for a rate log whose counts follow its correction.
fn count_of(windows: &Windows, config: &TargetConfig) -> Option<LogUnit> {
    match windows.shape.unit {
        AngleUnit::Quanta { arcsec_per_count, quantum } => Some(LogUnit::Counts { arcsec_per_count, quantum }),
        AngleUnit::Arcsec => config.rate_lsb_arcsec.map(|lsb_arcsec| LogUnit::Rates { lsb_arcsec }),
    }
}

fn sensor_of(shape: &WindowShape, config: &ModelConfig) -> Result<usize> {
    if shape.thermometers.is_empty() {
        return Err(Error::refused("the log has no temperature, so it holds no drift over temperature")
            .help("name a column temperature_c, or map one under [columns]"));
    }
    let Some(wanted) = &config.use_thermometer else {
        return Ok(0);
    };
    shape.thermometers.iter().position(|name| name == wanted).ok_or_else(|| {
        Error::input("the log has no thermometer of this name")
            .column("use_thermometer")
            .value(wanted)
            .help(format!("it has: {}", Error::choices(&shape.thermometers)))
    })
}

/// Refuses a setup for a missing column, which would otherwise have no effect silently.
fn check_aux(shape: &WindowShape, config: &ModelConfig) -> Result<()> {
    config.aux.iter().find(|aux| !shape.aux.contains(&aux.name)).map_or(Ok(()), |stray| {
        Err(Error::input("the log has no auxiliary column of this name")
            .column("aux.name")
            .value(&stray.name)
            .help(format!("it has: {}", Error::choices(&shape.aux))))
    })
}

fn provenance(windows: &Windows, options: &FitOptions) -> Provenance {
    let newest = windows.runs.iter().map(|run| run.end_ns).max().unwrap_or(0);
    let (time_s, time_source) = match options.source_date_epoch {
        Some(epoch) => (epoch as f64, "SOURCE_DATE_EPOCH"),
        None => (s_from_ns(newest), "newest input sample"),
    };
    Provenance { program: program(), time_s, time_source: time_source.to_owned(), inputs: log_files(windows) }
}

/// The logs behind some windows.
pub(crate) fn log_files(windows: &Windows) -> Vec<LogFile> {
    windows.runs.iter().flat_map(|run| &run.files).map(|file| LogFile::of(&file.summary)).collect()
}

/// N and Q of an axis: as given, otherwise measured; with their origin in words.
pub(crate) fn noise_of(windows: &Windows, axis: usize, test: &TestConfig) -> Option<(NoiseTerms, &'static str)> {
    windows.shape.window.seconds()?;
    if let Some(given) = test.noise {
        let n_arcsec_rt_s = given.n_deg_rt_h * ARCSEC_RT_S_PER_DEG_RT_H;
        return Some((NoiseTerms { n_arcsec_rt_s, q_arcsec: given.q_arcsec }, "setup"));
    }
    windows.measured_noise(axis).map(|terms| (terms, "short-tau Allan deviations of the log"))
}

/// The noise floor of a nominal window.
fn noise_floor_of(windows: &Windows, axis: usize, test: &TestConfig) -> Option<NoiseFloor> {
    let (terms, source) = noise_of(windows, axis, test)?;
    let value_dph = Some(terms.floor_dph(windows.shape.nominal_s)).filter(|value| value.is_finite() && *value > 0.0)?;
    Some(NoiseFloor { value_dph, n_deg_rt_h: terms.n_deg_rt_h(), q_arcsec: terms.q_arcsec, source: source.to_owned() })
}

/// The slow noise that a setup states, and the white variance of a nominal window beside it, (°/h)².
pub(crate) fn stated_noise(windows: &Windows, axis: usize, test: &TestConfig) -> Option<(SlowNoise, f64)> {
    let white = noise_floor_of(windows, axis, test)?.value_dph.powi(2);
    Some((SlowNoise::stated(test.noise?, white)?, white))
}

/// Names the log, where there is only one.
fn of_file(error: Error, windows: &Windows) -> Error {
    match windows.runs.as_slice() {
        [run] if run.files.len() == 1 => error.file(run.name()),
        _ => error,
    }
}

/// A used window, °/h.
#[derive(Clone, Copy)]
struct Shown {
    /// Minus its run offset; on a table also minus the effect of the scale factor on the rate. Neither is drift.
    before: f64,
    /// What the fit assigns to inputs other than the thermometer of the fit.
    inputs: f64,
    /// Residual of the fit.
    after: f64,
}

/// What a report draws of a fit.
struct Drawn {
    windows: BTreeMap<usize, Shown>,
    effects: Vec<Effect>,
}

impl Drawn {
    fn of(fitted: &Fitted, problem: &LeastSquares<'_>, parts: &Parts<'_>) -> Self {
        let level = |row: usize| -> f64 {
            problem.levels.iter().zip(&fitted.theta).map(|(level, value)| problem.level(row, *level) * value).sum()
        };
        let of_scale = |term: &TermColumn| term.form.acts_on == ActsOn::ScaleFactor;
        let scaled = parts.made(|term| problem.turning.is_some() && of_scale(term));
        let inputs = parts.made(|term| !problem.is_main(term.input) && !of_scale(term));
        let shown = |row: usize| Shown {
            before: problem.y[row] - level(row) - scaled[row],
            inputs: inputs[row],
            after: fitted.residuals[row],
        };
        let windows = (0..problem.len()).map(|row| (problem.used[row], shown(row))).collect();
        Self { windows, effects: parts.effects() }
    }
}

/// The record of one axis, and what a report draws of it.
fn fit_axis(
    windows: &Windows,
    axis: usize,
    sensor: usize,
    stages: &Stages,
    options: &FitOptions,
) -> Result<(AxisCalibration, Drawn)> {
    let letter = windows.shape.axes[axis];
    let ModelConfig { reference_c, min_span_c, .. } = stages.model;
    let turning = RateTableInput::of(windows, axis, &stages.test)?;
    if let Some(turning) = &turning {
        turning.check_scale(windows, axis, stages.test.scale_factor_deviation_max_ppm)?;
    }
    let progress = options.progress.of_axis(letter);
    let common = CommonRates::default();
    let make = |signals: &[Signal]| {
        let prior = options.prior.as_ref();
        let mut problem = LeastSquares::new(windows, axis, signals, reference_c, min_span_c, turning.clone(), prior)?;
        problem.progress = progress.clone();
        common.join(&mut problem);
        Ok(problem)
    };
    let holder = Holder {
        unit: count_of(windows, &stages.target),
        target: Target::from_config(stages.target)?,
        most_instructions: stages.target.slow_update_instructions_max,
    };
    let corrects_warm_up = options.corrects_warm_up;
    let image = ImageCheck { windows, config: &stages.model, sensor, axis: letter, holder, corrects_warm_up };
    let of_prior = options.prior.as_ref().map(|prior| Model::Fixed(prior.model.clone()));
    let model = of_prior.as_ref().unwrap_or(&options.model);
    let mut chosen = choose(windows, Signal::Thermometer(sensor), image, model, &make)?;
    let noise_floor = noise_floor_of(windows, axis, &stages.test);
    let is_given = *model != Model::Auto;
    let raw_n = noise_floor.as_ref().map(|floor| floor.n_deg_rt_h);
    chosen.stated = stated_noise(windows, axis, &stages.test);
    let (fitted, noise, prior) = match &options.prior {
        Some(prior) => chosen.fit_with_prior(prior, raw_n).map(|(fitted, noise, used)| (fitted, noise, Some(used)))?,
        None => chosen.fit(is_given, raw_n, options.loss).map(|(fitted, noise)| (fitted, noise, None))?,
    };
    let problem = &chosen.problem;
    let Estimate { best, mixed } = chosen.noise;
    let parts = Parts::new(&fitted, problem);
    let inputs = recorded_inputs(&fitted, Some(&parts), problem, windows, &stages.model, sensor);
    let terms = terms(&fitted, problem, &inputs);
    check_scale(&terms, letter)?;
    let drawn = Drawn::of(&fitted, problem, &parts);
    let warm_up =
        corrects_warm_up.then(|| estimate(problem, &fitted, mixed, chosen.white_variance(&fitted, mixed))).flatten();
    let (monomial, zones) = monomials(&fitted, problem, &windows.shape, reference_c);
    let diagnostics = FitDiagnostics {
        residual: residual(&fitted),
        noise_floor,
        cross_validation: chosen.cross_validation(),
        collinearity: fitted
            .conditioning
            .as_ref()
            .map(|found| Collinearity { condition: found.condition, limit: CONDITION_MAX }),
        correction_noise: (!fitted.terms.is_empty()).then_some(noise),
        hysteresis: None,
        ramp_rates_cpm: None,
        curve_spread: None,
        lack_of_fit: None,
        slow_noise: best.terms(chosen.white_variance(&fitted, best).sqrt()),
        noise_exceeds_setup: chosen.noise_exceeds_setup,
        time_effects: time_effects(&fitted, problem, corrects_warm_up),
        entanglement: Vec::new(),
        prior,
        hidden_in_offsets_dph: None,
        soak: None,
        scale_factor: scale_factor(&fitted, &chosen, axis, &windows.shape),
        misalignment: misalignment(&fitted, problem),
        candidates: chosen.candidates(),
        model_search: chosen.path.clone(),
        rejected_inputs: chosen.aside.clone(),
        rejected_models: chosen.not_held.clone(),
        excluded: windows.tallies.list(),
        covariance: fitted.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        covariance_of: covariance_of(&fitted, problem),
    };
    let mut record = AxisCalibration {
        axis: letter,
        correction: AxisCorrection { model: fitted.spec.to_string(), inputs, terms, warm_up },
        run_offsets: run_offsets(&fitted, problem, stages.test.input_rate_of(letter, windows.shape.axes.len())),
        monomial,
        zones,
        fit: Some(diagnostics),
    };
    if options.prior.is_some() {
        return Ok((record, drawn));
    }
    // What other models, more soaking and what moved together make of the curve: of the test alone.
    let forecast = Extension::new(problem, &fitted, best).and_then(|extension| soak(&record, &extension));
    let curve = |celsius: f64| {
        let variance = record.variance_of(&record.drift_weights(celsius, reference_c));
        (record.drift(celsius, reference_c), variance)
    };
    let (spread, lack_of_fit) = chosen.beside_curve(&fitted, curve);
    let profile = points(windows, &run_spans(windows), Some(sensor), |_| 0.0, |_| 0.0);
    let entanglement = entangled(&chosen, &fitted, &profile);
    if let Some(fit) = &mut record.fit {
        fit.soak = forecast;
        (fit.curve_spread, fit.lack_of_fit) = (spread, lack_of_fit);
        fit.entanglement = entanglement;
    }
    Ok((record, drawn))
}

/// σ of some values about their mean.
fn scatter(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt()
}

/// Refuses a scale term that the input rates do not determine.
fn check_scale(terms: &[Term], letter: char) -> Result<()> {
    let vague = |t: &&Term| t.acts_on == ActsOn::ScaleFactor && t.sigma.is_some_and(|s| s > SCALE_SIGMA_MAX_PPM);
    terms.iter().find(vague).map_or(Ok(()), |vague| {
        Err(Error::refused(format!(
            "a scale-factor term of axis {letter} would be {:.0} ± {:.0} ppm: the runs' input rates do not separate it from bias",
            vague.value,
            vague.sigma.unwrap_or(f64::NAN)
        ))
        .help("test at several input rates, or leave the scale terms out of --model"))
    })
}

/// Hysteresis before and after the fit; the standard error of both is that of the residuals, widened by their
/// correlation.
fn hysteresis(points: &[Point], residual: &Residual) -> Option<Hysteresis> {
    let rho = residual.lag1_autocorrelation;
    let sigma_dph = residual.sigma_dph * ((1.0 + rho) / (1.0 - rho)).sqrt();
    let before = hysteresis_of(points, LEAST_OF_LEG, |p| p.before_dph)?;
    let after = hysteresis_of(points, LEAST_OF_LEG, |p| p.after_dph)?;
    Some(Hysteresis {
        before_dph: before.difference_dph,
        after_dph: after.difference_dph,
        sigma_dph: sigma_dph * after.per_sigma,
    })
}

fn covariance_of(fitted: &Fitted, problem: &LeastSquares<'_>) -> Vec<String> {
    let named = |input: usize, name: &dyn Fn(Option<&str>) -> String| {
        let of = |input: usize| (input > 0).then(|| problem.inputs[input].name.as_str());
        match problem.inputs[input].repeats {
            Some(repeated) => format!("slow {}", name(of(repeated))),
            None => name(of(input)),
        }
    };
    let runs = problem.levels.iter().map(|level| level.name(&problem.runs));
    let terms = fitted.terms.iter().map(|term| named(term.input, &|of| term.form.name(of)));
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

/// The scale factor, from a rate table; `None` where the axis was not turned at several rates.
fn scale_factor(fitted: &Fitted, chosen: &Chosen<'_>, axis: usize, shape: &WindowShape) -> Option<ScaleFactor> {
    let column = chosen.problem.column_of(Level::Scale)?;
    let plateaus = chosen.problem.plateaus(axis, chosen.stated)?;
    let at_reference = PpmEstimate { ppm: fitted.theta[column], sigma_ppm: fitted.sigma(column) };
    let arcsec_per_count = match shape.unit {
        AngleUnit::Quanta { arcsec_per_count, .. } => Some(arcsec_per_count * (1.0 + at_reference.ppm * 1e-6)),
        AngleUnit::Arcsec => None,
    };
    Some(ScaleFactor { arcsec_per_count, at_reference, repeatability: repeatability(&plateaus), plateaus })
}

/// arcsec in one rad.
const ARCSEC_PER_RAD: f64 = 180.0 / std::f64::consts::PI * 3600.0;

fn misalignment(fitted: &Fitted, problem: &LeastSquares<'_>) -> Vec<Misalignment> {
    let across = problem.levels.iter().enumerate().filter_map(|(place, level)| match level {
        Level::Across(letter) => Some(Misalignment {
            towards: *letter,
            arcsec: fitted.theta[place] * ARCSEC_PER_RAD,
            sigma_arcsec: fitted.sigma(place) * ARCSEC_PER_RAD,
        }),
        _ => None,
    });
    across.collect()
}

/// Drift in time and warm-up beside the terms; without the warm-up where it is corrected.
fn time_effects(fitted: &Fitted, problem: &LeastSquares<'_>, corrects_warm_up: bool) -> Vec<TimeEffect> {
    let of = |(place, level): (usize, &Level)| {
        let (kind, run, unit, tau_s) = match *level {
            Level::Drift(run) => (TimeEffectKind::Drift, run.map(|index| problem.runs[index] as u32), "deg/h/h", None),
            Level::WarmUp { .. } if corrects_warm_up => return None,
            Level::WarmUp { tau_s } => (TimeEffectKind::WarmUp, None, "deg/h", Some(tau_s)),
            Level::Run(_) | Level::AllRuns | Level::Scale | Level::Across(_) => return None,
        };
        let (value, sigma) = (fitted.theta[place], fitted.sigma(place));
        Some(TimeEffect { kind, run, value, sigma, unit: unit.to_owned(), tau_s })
    };
    problem.levels.iter().enumerate().filter_map(of).collect()
}

fn residual(fitted: &Fitted) -> Residual {
    let (lo, hi) =
        fitted.residuals.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), r| (r.min(lo), r.max(hi)));
    Residual {
        n: fitted.residuals.len(),
        sigma_dph: fitted.sigma_dph,
        peak_to_peak_dph: hi - lo,
        lag1_autocorrelation: fitted.autocorrelation,
        t_quantile_975: fitted.t_quantile_975,
    }
}
