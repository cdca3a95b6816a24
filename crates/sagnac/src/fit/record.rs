//! The fit of every axis, written down.

use std::collections::BTreeMap;

use crate::calibration::{
    AxisCalibration, Calibration, Collinearity, Constant, FORMAT, Floor, HeatingLessCooling, Input as LogInput,
    LogUnit, Misalignment, Monomial, PpmEstimate, Provenance, Residual, ScaleFactor, Target, Term, TermKind,
    Thermometer, UNASSIGNED, VERSION, program,
};
use crate::diagnostics::{AxisEvidence, Effect, Evidence, Leg, Point, points, run_spans};
use crate::fit::ModelChoice;
use crate::fit::choose::choose;
use crate::fit::effects::Parts;
use crate::fit::further::further_inputs;
use crate::fit::path::CONDITION_MAX;
use crate::fit::plateaus::repeatability;
use crate::fit::problem::{Level, Problem, TermPlace};
use crate::fit::robust::Loss;
use crate::fit::soak::soak;
use crate::fit::solution::{Fitted, bootstrap_intervals};
use crate::fit::turning::Turning;
use crate::model::basis::Span;
use crate::model::input::{Source, zone};
use crate::model::powers::powers_from_series;
use crate::window::{WindowShape, Windows};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, Reason};
use sagnac_log::setup::Setup;
use sagnac_noise::NoiseTerms;
use sagnac_units::{ARCSEC_RT_S_PER_DEG_RT_H, s_from_ns};

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
/// [`sagnac_log::ErrorKind::Refused`] where the data cannot support the answer: no temperature, too small a
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
    check_aux(&windows.shape, setup)?;
    for i in 0..windows.len() {
        if windows.rows.mean_c[sensor][i].is_nan() {
            windows.exclude(i, Reason::NoTemperature);
        }
    }
    Turning::leave_out_unknown(&mut windows, setup)?;
    let runs = run_spans(&windows);
    let (mut axes, mut drawn) = (Vec::new(), Vec::new());
    for axis in 0..windows.shape.axes.len() {
        let (mut record, behind) =
            fit_axis(&windows, axis, sensor, setup, options).map_err(|e| of_file(e, &windows))?;
        let constant = |i: usize| {
            let run = windows.rows.run[i];
            record.constants.iter().find(|c| c.run == run).map_or(f64::NAN, |c| c.value_dph)
        };
        // What a table turns is no drift: known for every window that was used, unknown for the others.
        let shown = |i: usize| behind.windows.get(&i);
        let before = |i: usize| {
            if record.turned() {
                shown(i).map_or(f64::NAN, |shown| shown.before)
            } else {
                windows.rate_dph(axis, i) - constant(i)
            }
        };
        let after = |i: usize| shown(i).map_or(f64::NAN, |shown| shown.after);
        let mut points = points(&windows, &runs, Some(sensor), before, after);
        for (i, shown) in &behind.windows {
            points[*i].further_dph = shown.further;
        }
        record.heating_less_cooling = heating_less_cooling(&points, &record);
        drawn.push(AxisEvidence { axis: windows.shape.axes[axis], points, effects: behind.effects });
        axes.push(record);
    }
    let evidence = Evidence { runs, timed: windows.shape.timed, axes: drawn };
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

/// A setup for a column that is not there would do nothing without a word.
fn check_aux(shape: &WindowShape, setup: &Setup) -> Result<()> {
    setup.aux.iter().find(|aux| !shape.aux.contains(&aux.name)).map_or(Ok(()), |stray| {
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
    Provenance { program: program(), time_s, time_source: time_source.to_owned(), inputs: inputs(windows) }
}

/// The logs behind some windows.
pub(crate) fn inputs(windows: &Windows) -> Vec<LogInput> {
    windows.runs.iter().map(|run| LogInput::of(&run.summary)).collect()
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

/// A used window, °/h.
#[derive(Clone, Copy)]
struct Shown {
    /// Without its levels; on a table without what the scale factor's change makes of the rate, either: neither is drift.
    before: f64,
    /// What the fit lays to further inputs.
    further: f64,
    /// What the fit leaves.
    after: f64,
}

/// What a report draws of a fit.
struct Behind {
    windows: BTreeMap<usize, Shown>,
    effects: Vec<Effect>,
}

impl Behind {
    fn of(fitted: &Fitted, problem: &Problem<'_>, parts: &Parts<'_>) -> Self {
        let level = |row: usize| -> f64 {
            problem.levels.iter().zip(&fitted.theta).map(|(level, value)| problem.level(row, *level) * value).sum()
        };
        let scaled = parts.made(|term| problem.turning.is_some() && term.kind == TermKind::Scale);
        let further = parts.made(|term| term.input > 0 && term.kind != TermKind::Scale);
        let shown = |row: usize| Shown {
            before: problem.y[row] - level(row) - scaled[row],
            further: further[row],
            after: fitted.residuals[row],
        };
        let windows = (0..problem.len()).map(|row| (problem.used[row], shown(row))).collect();
        Self { windows, effects: parts.effects() }
    }
}

/// The record of one axis, and what stands behind it.
fn fit_axis(
    windows: &Windows,
    axis: usize,
    sensor: usize,
    setup: &Setup,
    options: &FitOptions,
) -> Result<(AxisCalibration, Behind)> {
    let letter = windows.shape.axes[axis];
    let reference_c = setup.reference_c();
    let min_span_c = setup.min_span_c.unwrap_or(DEFAULT_MIN_SPAN_C);
    let turning = Turning::of(windows, axis, setup)?;
    let make = |sources: &[Source]| Problem::new(windows, axis, sources, reference_c, min_span_c, turning.clone());
    let mut chosen = choose(windows, Source::Thermometer(sensor), setup, &options.model, &make)?;
    let floor = floor_of(windows, axis, setup);
    let is_given = options.model != ModelChoice::Auto;
    let (fitted, noise) = chosen.fit(is_given, floor.as_ref().map(|floor| floor.n_deg_rt_h), options.loss)?;
    let problem = &chosen.problem;
    let mut terms = terms(&fitted, problem, &windows.shape.thermometers[sensor]);
    if let Some(draws) = options.bootstrap {
        let intervals = bootstrap_intervals(problem, &fitted, draws);
        terms.iter_mut().zip(intervals.into_iter().skip(problem.levels.len())).for_each(|(term, interval)| {
            term.bootstrap = Some(interval);
        });
    }
    check_scale(&terms, letter)?;
    let parts = Parts::new(&fitted, problem);
    let behind = Behind::of(&fitted, problem, &parts);
    let (monomial, zones) = monomials(&fitted, problem, &windows.shape, reference_c);
    let mut record = AxisCalibration {
        axis: letter,
        model: fitted.spec.to_string(),
        lag_s: fitted.lag_of(0),
        reference_c,
        span_c: [problem.span().lo_c, problem.span().hi_c],
        rate_span_cpm: fitted.lag(0).map(|(tau_s, _)| problem.rate_span(0, tau_s)),
        constants: constants(&fitted, problem, setup, windows.shape.axes.len()),
        monomial,
        zones,
        inputs: further_inputs(&fitted, &parts, problem, windows, setup, sensor),
        collinearity: fitted
            .nearness
            .as_ref()
            .map(|near| Collinearity { condition: near.condition, limit: CONDITION_MAX }),
        correction_noise: (!fitted.terms.is_empty()).then_some(noise),
        scale_factor: scale_factor(&fitted, problem, axis, &windows.shape),
        misalignment: misalignment(&fitted, problem),
        residual: Some(residual(&fitted)),
        floor,
        heating_less_cooling: None,
        soak: None,
        cross_validation: chosen.cross_validation(),
        candidates: chosen.candidates(),
        inputs_aside: chosen.aside.clone(),
        path: chosen.path.clone(),
        excluded: windows.tallies.list(),
        covariance: fitted.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        covariance_of: covariance_of(&fitted, problem, &terms),
        terms,
    };
    record.soak = soak(&record, windows.shape.nominal_s);
    Ok((record, behind))
}

/// A scale term that the input rates do not tell is refused.
fn check_scale(terms: &[Term], letter: char) -> Result<()> {
    let vague = |t: &&Term| t.kind == TermKind::Scale && t.sigma.is_some_and(|s| s > SCALE_SIGMA_MAX_PPM);
    terms.iter().find(vague).map_or(Ok(()), |vague| {
        Err(Error::refused(format!(
            "a scale-factor term of axis {letter} would be {:.0} ± {:.0} ppm: the runs' input rates do not separate it from bias",
            vague.value,
            vague.sigma.unwrap_or(f64::NAN)
        ))
        .help("test at several input rates, or leave the scale terms out of --model"))
    })
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

fn terms(fitted: &Fitted, problem: &Problem<'_>, sensor: &str) -> Vec<Term> {
    let inflation = |at: usize| fitted.nearness.as_ref().and_then(|near| *near.inflation.get(at)?);
    let levels = problem.levels.len();
    let of = |(at, place): (usize, &TermPlace)| {
        let (value, sigma) = (fitted.theta[levels + at], fitted.sigma(levels + at));
        let input = &problem.inputs[place.input];
        let begins = |at: f64| {
            if place.kind == TermKind::Zone { input.span.at(at) } else { at }
        };
        Term {
            kind: place.kind,
            sensor: if place.input == 0 { sensor.to_owned() } else { input.name.clone() },
            order: place.order,
            at: place.at.map(begins),
            value,
            sigma: Some(sigma),
            unit: if input.source.in_celsius() { place.kind.unit() } else { place.kind.unit_over_column() }.to_owned(),
            significant: Some(value.abs() > fitted.t95 * sigma),
            inflation: inflation(at),
            bootstrap: None,
        }
    };
    fitted.terms.iter().enumerate().map(of).collect()
}

fn covariance_of(fitted: &Fitted, problem: &Problem<'_>, terms: &[Term]) -> Vec<String> {
    let runs = problem.levels.iter().map(|level| level.name(&problem.runs));
    let terms = terms.iter().zip(&fitted.terms).map(|(term, place)| term.name(place.input == 0));
    let lags = fitted.resolved().map(|tau| match tau.input {
        0 => "lag_s".to_owned(),
        input => format!("lag_s({})", problem.inputs[input].name),
    });
    runs.chain(terms).chain(lags).collect()
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

/// Powers of °C with the first run's constant, in the zone of T0 and zone by zone; scale terms linearised at that run's
/// rate, further inputs at their references.
fn monomials(
    fitted: &Fitted,
    problem: &Problem<'_>,
    shape: &WindowShape,
    reference_c: f64,
) -> (Monomial, Vec<Monomial>) {
    let span = problem.span();
    let knots: Vec<f64> = fitted.terms.iter().filter_map(|t| t.at.filter(|_| t.kind == TermKind::Zone)).collect();
    if knots.is_empty() {
        return (monomial(fitted, problem, shape, reference_c, None), Vec::new());
    }
    let mut borders = vec![-1.0];
    borders.extend(&knots);
    borders.push(1.0);
    let zones: Vec<Monomial> =
        borders.windows(2).map(|z| monomial(fitted, problem, shape, reference_c, Some([z[0], z[1]]))).collect();
    let at = knots.iter().filter(|knot| span.x(reference_c) >= **knot).count();
    (zones[at].clone(), zones)
}

/// Powers of °C between two values of x.
fn monomial(
    fitted: &Fitted,
    problem: &Problem<'_>,
    shape: &WindowShape,
    reference_c: f64,
    from_to: Option<[f64; 2]>,
) -> Monomial {
    let (span, levels) = (problem.span(), problem.levels.len());
    let main = || fitted.terms.iter().enumerate().filter(|(_, term)| term.input == 0 && term.kind != TermKind::Rate);
    let order = main().map(|(_, term)| usize::from(term.order)).max().unwrap_or(0);
    let rows = powers_from_series(span, reference_c, order);
    let (factor, unit) = monomial_unit(shape.unit, shape.nominal_s);
    // On a table the curve is that of a gyro that is not turned.
    let omega = if problem.turning.is_some() { 0.0 } else { -problem.run_rate[0] * 1e-6 };
    // One linear map from all parameters to each power.
    let map_of = |power: usize| {
        let mut map = vec![0.0; fitted.covariance.nrows()];
        map[0] = factor * rows[power][0];
        for (at, term) in main() {
            map[levels + at] = factor
                * match (term.kind, term.at) {
                    (TermKind::Scale, _) => omega * rows[power][usize::from(term.order)],
                    (TermKind::Zone, Some(knot)) => {
                        zone_power(span, knot, reference_c, from_to.is_some_and(|[from, _]| from >= knot), power)
                    }
                    _ => rows[power][usize::from(term.order)],
                };
        }
        map
    };
    let maps: Vec<Vec<f64>> = (0..=order).map(map_of).collect();
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
        from_to_c: from_to.map(|[from, to]| [span.at(from), span.at(to)]),
    }
}

/// Coefficient of T^power in ((x − ξ)/(1 − ξ))² where the knot is below, less its value at T0.
fn zone_power(span: Span, knot: f64, reference_c: f64, above: bool, power: usize) -> f64 {
    let (knot_c, wide_c) = (span.at(knot), span.hi_c - span.at(knot));
    let square = [knot_c * knot_c, -2.0 * knot_c, 1.0].get(power).map_or(0.0, |c| c / (wide_c * wide_c));
    let zero = if power == 0 { zone(span.x(reference_c), knot) } else { 0.0 };
    (if above { square } else { 0.0 }) - zero
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
