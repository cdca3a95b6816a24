//! The fit of every axis, written down.

use std::collections::BTreeMap;

use crate::allan::NoiseTerms;
use crate::calibration::{
    AxisCalibration, Calibration, Candidate, Constant, CrossValidation, FORMAT, Floor, HeatingLessCooling, Input, Lag,
    LogUnit, Misalignment, Monomial, PpmEstimate, Provenance, Residual, ScaleFactor, Target, Term, TermKind,
    Thermometer, UNASSIGNED, VERSION,
};
use crate::error::{Error, Result};
use crate::fit::plateaus::repeatability;
use crate::fit::problem::{Level, Problem};
use crate::fit::robust::{Loss, robust_fit};
use crate::fit::soak::soak;
use crate::fit::solution::{Fitted, bootstrap_intervals, fit};
use crate::fit::turning::Turning;
use crate::fit::{ModelChoice, Selection, powers_from_series, select, slow_update_instructions};
use crate::ingest::{AngleUnit, Reason};
use crate::report::{AxisEvidence, Evidence, Leg, Point, points, run_spans};
use crate::setup::Setup;
use crate::units::{ARCSEC_RT_S_PER_DEG_RT_H, s_from_ns};
use crate::window::{WindowShape, Windows};

/// Scale terms less certain than this cannot be told from bias.
const SCALE_SIGMA_MAX_PPM: f64 = 1000.0;
const DEFAULT_MIN_SPAN_C: f64 = 10.0;
const DEFAULT_RATE_LSB_ARCSEC: f64 = 1e-4;

/// What to fit.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// Model.
    pub model: ModelChoice,
    /// SOURCE_DATE_EPOCH if it is set.
    pub source_date_epoch: Option<i64>,
    /// Draws of the block bootstrap, if intervals by it are wanted.
    pub bootstrap: Option<usize>,
    /// What misfit costs in the fit that is written down.
    pub loss: Loss,
}

impl FitOptions {
    /// A model, and nothing else asked for.
    pub fn new(model: ModelChoice) -> Self {
        Self { model, source_date_epoch: None, bootstrap: None, loss: Loss::Squares }
    }
}

/// Fits every axis.
///
/// # Errors
/// [`crate::ErrorKind::Refused`] where the data cannot support the answer: no temperature, too small a
/// span, T0 outside it, too few windows, terms that cannot be told apart.
pub fn calibrate(windows: Windows, setup: &Setup, options: &FitOptions) -> Result<Calibration> {
    calibrate_with_evidence(windows, setup, options).map(|(calibration, _)| calibration)
}

/// The same, with the points behind it for a report.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_with_evidence(
    mut windows: Windows,
    setup: &Setup,
    options: &FitOptions,
) -> Result<(Calibration, Evidence)> {
    let sensor = sensor_of(&windows.shape, setup).map_err(|e| of_file(e, &windows))?;
    for i in 0..windows.len() {
        if windows.rows.mean_c[sensor][i].is_nan() {
            windows.exclude(i, Reason::NoTemperature);
        }
    }
    Turning::leave_out_unknown(&mut windows, setup)?;
    let runs = run_spans(&windows);
    let (mut axes, mut shown) = (Vec::new(), Vec::new());
    for axis in 0..windows.shape.axes.len() {
        let (mut record, left) = fit_axis(&windows, axis, sensor, setup, options).map_err(|e| of_file(e, &windows))?;
        let constant = |i: usize| {
            let run = windows.rows.run[i];
            record.constants.iter().find(|c| c.run == run).map_or(f64::NAN, |c| c.value_dph)
        };
        // What a table turns is no drift: known for every window that was used, unknown for the others.
        let fitted = |i: usize| left.get(&i).copied().unwrap_or((f64::NAN, f64::NAN));
        let before = |i: usize| {
            if record.turned() { fitted(i).0 } else { windows.rate_dph(axis, i) - constant(i) }
        };
        let after = |i: usize| fitted(i).1;
        let points = points(&windows, &runs, Some(sensor), before, after);
        record.heating_less_cooling = heating_less_cooling(&points, &record);
        shown.push(AxisEvidence { axis: windows.shape.axes[axis], points });
        axes.push(record);
    }
    let evidence = Evidence { runs, timed: windows.shape.timed, axes: shown };
    let shape = &windows.shape;
    let calibration = Calibration {
        format: FORMAT.to_owned(),
        version: VERSION,
        serial: setup.serial.clone().unwrap_or_else(|| UNASSIGNED.to_owned()),
        unit: match shape.unit {
            AngleUnit::Quanta { arcsec_per_count, quantum } => LogUnit::Counts { arcsec_per_count, quantum },
            AngleUnit::Arcsec => {
                LogUnit::Rates { lsb_arcsec: setup.rate_lsb_arcsec.unwrap_or(DEFAULT_RATE_LSB_ARCSEC) }
            }
        },
        target: Target::from_setup(setup)?,
        thermometer: Thermometer::from_setup(setup.thermometer(&shape.thermometers[sensor])),
        window: shape.window,
        window_s: shape.nominal_s,
        sample_interval_s: shape.sample_interval_s,
        axes,
        setup: setup.clone(),
        provenance: provenance(&windows, options),
    };
    Ok((calibration, evidence))
}

fn sensor_of(shape: &WindowShape, setup: &Setup) -> Result<usize> {
    if shape.thermometers.is_empty() {
        return Err(Error::refused("the log has no temperature, so nothing can be said of drift over temperature")
            .help("name a column temperature_c, or map one under [columns]"));
    }
    let Some(wanted) = &setup.use_thermometer else {
        return Ok(0);
    };
    shape.thermometers.iter().position(|name| name == wanted).ok_or_else(|| {
        Error::input("the log has no thermometer of this name")
            .column("use_thermometer")
            .value(wanted)
            .help(format!("it has: {}", Error::choices(&shape.thermometers)))
    })
}

fn provenance(windows: &Windows, options: &FitOptions) -> Provenance {
    let newest = windows.runs.iter().map(|run| run.end_ns).max().unwrap_or(0);
    let (time_s, time_source) = match options.source_date_epoch {
        Some(epoch) => (epoch as f64, "SOURCE_DATE_EPOCH"),
        None => (s_from_ns(newest), "newest input sample"),
    };
    Provenance { program: program(), time_s, time_source: time_source.to_owned(), inputs: inputs(windows) }
}

/// The logs behind some windows.
pub(crate) fn inputs(windows: &Windows) -> Vec<Input> {
    windows.runs.iter().map(|run| Input::of(&run.summary)).collect()
}

/// Name and version of this program.
pub(crate) fn program() -> String {
    format!("sagnac {}", env!("CARGO_PKG_VERSION"))
}

/// N and Q of an axis: as given, else measured; with words for where they come from.
pub(crate) fn noise_of(windows: &Windows, axis: usize, setup: &Setup) -> Option<(NoiseTerms, &'static str)> {
    windows.shape.window.seconds()?;
    if let Some(given) = setup.noise {
        let n_arcsec_rt_s = given.n_deg_rt_h * ARCSEC_RT_S_PER_DEG_RT_H;
        return Some((NoiseTerms { n_arcsec_rt_s, q_arcsec: given.q_arcsec }, "setup"));
    }
    windows.measured_noise(axis).map(|terms| (terms, "short-tau Allan deviations of the log"))
}

/// The floor of a nominal window.
fn floor_of(windows: &Windows, axis: usize, setup: &Setup) -> Option<Floor> {
    let (terms, source) = noise_of(windows, axis, setup)?;
    Some(Floor {
        value_dph: terms.floor_dph(windows.shape.nominal_s),
        n_deg_rt_h: terms.n_deg_rt_h(),
        q_arcsec: terms.q_arcsec,
        source: source.to_owned(),
    })
}

/// Names the log, where there is only one.
fn of_file(error: Error, windows: &Windows) -> Error {
    match windows.runs.as_slice() {
        [run] => error.file(&run.summary.file),
        _ => error,
    }
}

/// Of each used window: what it shows without its levels, and after the fit, °/h.
type Left = BTreeMap<usize, (f64, f64)>;

/// The record of one axis, and what each used window shows without its levels and after the fit, °/h.
fn fit_axis(
    windows: &Windows,
    axis: usize,
    sensor: usize,
    setup: &Setup,
    options: &FitOptions,
) -> Result<(AxisCalibration, Left)> {
    let letter = windows.shape.axes[axis];
    let reference_c = setup.reference_c();
    let min_span_c = setup.min_span_c.unwrap_or(DEFAULT_MIN_SPAN_C);
    let turning = Turning::of(windows, axis, setup)?;
    let mut problem = Problem::new(windows, axis, sensor, reference_c, min_span_c, turning)?;
    if let ModelChoice::Fixed(spec) = options.model
        && spec.rate.is_some()
        && !problem.has_rate()
    {
        return Err(Error::refused("a rate term needs times, and the log has none").column("--model"));
    }
    let taus_s = problem.tau_grid();
    let selection = select(&problem, options.model, &taus_s)?;
    let spec = selection.specs[selection.chosen];
    let fitted = match options.loss {
        Loss::Squares => fit(&problem, spec, &taus_s)?,
        Loss::Huber => robust_fit(&mut problem, spec, &taus_s)?,
    };
    let mut terms = terms(&fitted, problem.levels.len(), &windows.shape.thermometers[sensor]);
    if let Some(draws) = options.bootstrap {
        let intervals = bootstrap_intervals(&problem, &fitted, draws);
        terms.iter_mut().zip(intervals.into_iter().skip(problem.levels.len())).for_each(|(term, interval)| {
            term.bootstrap = Some(interval);
        });
    }
    if let Some(vague) =
        terms.iter().find(|t| t.kind == TermKind::Scale && t.sigma.is_some_and(|s| s > SCALE_SIGMA_MAX_PPM))
    {
        return Err(Error::refused(format!(
            "a scale-factor term of axis {letter} would be {:.0} ± {:.0} ppm: the runs' input rates do not separate it from bias",
            vague.value,
            vague.sigma.unwrap_or(f64::NAN)
        ))
        .help("test at several input rates, or leave the scale terms out of --model"));
    }
    let level = |row: usize| -> f64 {
        problem.levels.iter().zip(&fitted.theta).map(|(level, value)| problem.level(row, *level) * value).sum()
    };
    // On a table the scale factor's change, times the rate, is no drift either.
    let scale_at = problem.levels.len() + fitted.spec.coefficients_before_scale();
    let scaled = |row: usize| -> f64 {
        let orders = if problem.turning.is_some() { usize::from(fitted.spec.scale) } else { 0 };
        (1..=orders).map(|k| problem.scale_column(row, k) * fitted.theta[scale_at + k - 1]).sum()
    };
    let before = |row: usize| problem.y[row] - level(row) - scaled(row);
    let left = (0..problem.len()).map(|row| (problem.used[row], (before(row), fitted.residuals[row])));
    let left = left.collect();
    let mut record = AxisCalibration {
        axis: letter,
        model: fitted.spec.to_string(),
        lag_s: fitted
            .tau
            .map(|tau| Lag { value: tau.value_s, sigma: tau.resolved.then(|| fitted.sigma(fitted.theta.len())) }),
        reference_c,
        span_c: [problem.span.lo_c, problem.span.hi_c],
        rate_span_cpm: fitted.tau.map(|tau| problem.rate_span(tau.value_s)),
        constants: constants(&fitted, &problem, setup, windows.shape.axes.len()),
        monomial: monomial(&fitted, &problem, &windows.shape, reference_c),
        scale_factor: scale_factor(&fitted, &problem, axis, &windows.shape),
        misalignment: misalignment(&fitted, &problem),
        residual: Some(residual(&fitted)),
        floor: floor_of(windows, axis, setup),
        heating_less_cooling: None,
        soak: None,
        cross_validation: cross_validation(&selection),
        candidates: candidates(&selection),
        excluded: windows.tallies.list(),
        covariance: fitted.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        covariance_of: covariance_of(&fitted, &problem, &terms),
        terms,
    };
    record.soak = soak(&record, windows.shape.nominal_s);
    Ok((record, left))
}

/// Windows of a leg that are enough for a mean.
const LEAST_OF_LEG: usize = 10;

fn heating_less_cooling(points: &[Point], record: &AxisCalibration) -> Option<HeatingLessCooling> {
    let of = |leg: Leg| -> Vec<&Point> {
        points.iter().filter(|p| p.leg() == leg && p.excluded.is_none() && p.after_dph.is_finite()).collect()
    };
    let (heating, cooling) = (of(Leg::Heating), of(Leg::Cooling));
    let residual = record.residual?;
    if heating.len() < LEAST_OF_LEG || cooling.len() < LEAST_OF_LEG {
        return None;
    }
    let mean =
        |points: &[&Point], of: fn(&Point) -> f64| points.iter().map(|p| of(p)).sum::<f64>() / points.len() as f64;
    let apart = |of: fn(&Point) -> f64| mean(&heating, of) - mean(&cooling, of);
    let widening = (1.0 + residual.autocorrelation) / (1.0 - residual.autocorrelation);
    let parts = 1.0 / heating.len() as f64 + 1.0 / cooling.len() as f64;
    Some(HeatingLessCooling {
        before_dph: apart(|p| p.before_dph),
        after_dph: apart(|p| p.after_dph),
        sigma_dph: residual.sigma_dph * (widening * parts).sqrt(),
    })
}

fn terms(fitted: &Fitted, levels: usize, sensor: &str) -> Vec<Term> {
    let spec = fitted.spec;
    let bias = (1..=spec.bias).map(|order| (TermKind::Bias, order));
    let rate = (0..spec.rate.map_or(0, |r| r + 1)).map(|order| (TermKind::Rate, order));
    let scale = (1..=spec.scale).map(|order| (TermKind::Scale, order));
    let kinds = bias.chain(rate).chain(scale).zip(levels..);
    kinds
        .map(|((kind, order), index)| {
            let (value, sigma) = (fitted.theta[index], fitted.sigma(index));
            Term {
                kind,
                sensor: sensor.to_owned(),
                order,
                value,
                sigma: Some(sigma),
                unit: kind.unit().to_owned(),
                significant: Some(value.abs() > fitted.t95 * sigma),
                bootstrap: None,
            }
        })
        .collect()
}

fn covariance_of(fitted: &Fitted, problem: &Problem<'_>, terms: &[Term]) -> Vec<String> {
    let runs = problem.levels.iter().map(|level| level.name(&problem.runs));
    let terms = terms.iter().map(|term| {
        let kind = match term.kind {
            TermKind::Bias => "bias",
            TermKind::Rate => "rate",
            TermKind::Scale => "scale",
        };
        format!("{kind} {}", term.order)
    });
    let lag = fitted.tau.filter(|tau| tau.resolved).map(|_| "lag_s".to_owned());
    runs.chain(terms).chain(lag).collect()
}

fn constants(fitted: &Fitted, problem: &Problem<'_>, setup: &Setup, axes: usize) -> Vec<Constant> {
    // One direction cannot be that of several axes.
    let input_dph = setup.known_input_rate_dph().filter(|_| axes == 1);
    let rows = problem.runs.iter().enumerate().filter_map(|(index, run)| {
        let place = problem.place_of(Level::Run(index)).or_else(|| problem.place_of(Level::AllRuns))?;
        Some(Constant {
            run: *run as u32,
            value_dph: fitted.theta[place],
            sigma_dph: Some(fitted.sigma(place)),
            fixed_bias_dph: input_dph.map(|input| fitted.theta[place] - input),
        })
    });
    rows.collect()
}

/// What a table tells of the scale factor; `None` where the axis was not turned at several rates.
fn scale_factor(fitted: &Fitted, problem: &Problem<'_>, axis: usize, shape: &WindowShape) -> Option<ScaleFactor> {
    let place = problem.place_of(Level::Scale)?;
    let plateaus = problem.plateaus(axis)?;
    let at_reference = PpmEstimate { ppm: fitted.theta[place], sigma_ppm: fitted.sigma(place) };
    let arcsec_per_count = match shape.unit {
        AngleUnit::Quanta { arcsec_per_count, .. } => Some(arcsec_per_count * (1.0 + at_reference.ppm * 1e-6)),
        AngleUnit::Arcsec => None,
    };
    Some(ScaleFactor { arcsec_per_count, at_reference, repeatability: repeatability(&plateaus), plateaus })
}

/// arcsec in one rad.
const ARCSEC_PER_RAD: f64 = 180.0 / std::f64::consts::PI * 3600.0;

fn misalignment(fitted: &Fitted, problem: &Problem<'_>) -> Vec<Misalignment> {
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

/// Factor from °/h to the monomial's unit, and the unit's name.
pub(crate) fn monomial_unit(unit: AngleUnit, window_s: f64) -> (f64, &'static str) {
    match unit {
        AngleUnit::Quanta { arcsec_per_count, .. } => (window_s / arcsec_per_count, "counts per window"),
        AngleUnit::Arcsec => (1.0, "deg/h"),
    }
}

/// Powers of °C with the first run's constant; scale terms linearised at that run's rate.
fn monomial(fitted: &Fitted, problem: &Problem<'_>, shape: &WindowShape, reference_c: f64) -> Monomial {
    let spec = fitted.spec;
    let (bias, scale) = (usize::from(spec.bias), usize::from(spec.scale));
    let order = bias.max(scale);
    let levels = problem.levels.len();
    let rates = spec.rate.map_or(0, |r| usize::from(r) + 1);
    let rows = powers_from_series(problem.span, reference_c, order);
    let (factor, unit) = monomial_unit(shape.unit, shape.nominal_s);
    // One linear map from all parameters to each power.
    let maps: Vec<Vec<f64>> = rows
        .iter()
        .map(|row| {
            let mut map = vec![0.0; fitted.covariance.nrows()];
            map[0] = factor * row[0];
            map[levels..levels + bias].iter_mut().zip(&row[1..]).for_each(|(m, value)| *m = factor * value);
            let at = levels + bias + rates;
            // On a table the curve is that of a gyro that is not turned.
            let omega = if problem.turning.is_some() { 0.0 } else { -problem.run_rate[0] * 1e-6 };
            map[at..at + scale].iter_mut().zip(&row[1..]).for_each(|(m, value)| *m = factor * omega * value);
            map
        })
        .collect();
    let coefficients = maps.iter().map(|map| map.iter().zip(&fitted.theta).map(|(m, t)| m * t).sum());
    let sigma = maps.iter().map(|map| {
        let map = nalgebra::DVector::from_column_slice(map);
        (map.transpose() * &fitted.covariance * &map)[(0, 0)].max(0.0).sqrt()
    });
    Monomial {
        run: problem.runs[0] as u32,
        unit: unit.to_owned(),
        window_s: shape.nominal_s,
        coefficients: coefficients.collect(),
        sigma: Some(sigma.collect()),
    }
}

fn residual(fitted: &Fitted) -> Residual {
    let (lo, hi) =
        fitted.residuals.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), r| (r.min(lo), r.max(hi)));
    Residual {
        n: fitted.residuals.len(),
        sigma_dph: fitted.sigma_dph,
        peak_to_peak_dph: hi - lo,
        autocorrelation: fitted.autocorrelation,
        t95: fitted.t95,
    }
}

fn cross_validation(selection: &Selection) -> Option<CrossValidation> {
    let mean_square = selection.mean_square[selection.chosen]?;
    let scheme = selection.scheme.to_owned();
    Some(CrossValidation { scheme, folds: selection.folds, sigma_dph: mean_square.sqrt() })
}

fn candidates(selection: &Selection) -> Vec<Candidate> {
    let rows =
        selection.specs.iter().zip(&selection.mean_square).enumerate().map(|(i, (spec, mean_square))| Candidate {
            model: spec.to_string(),
            coefficients: spec.coefficients(),
            held_out_dph: mean_square.map(f64::sqrt),
            slow_update_instructions: Some(slow_update_instructions(*spec)),
            chosen: i == selection.chosen,
        });
    rows.collect()
}
