//! The fit of one model on all windows, with its covariance.
//!
//! For given τ the model is linear and solved by QR; τ is found by a grid over [Δt, run/4] and a
//! golden section. Covariance: s²·(JᵀWJ)⁻¹ with ∂y/∂τ as a column of J, widened by
//! (1 + ρ)/(1 − ρ) for residuals of lag-one correlation ρ (AR(1); Bartlett 1946), which is what slow
//! misfit looks like to neighbouring windows.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::error::{Error, Result};
use crate::fit::bootstrap::Resampling;
use crate::fit::lag::RATE_COLUMNS;
use crate::fit::model::ModelSpec;
use crate::fit::problem::Problem;
use crate::fit::solve::{Factor, Reducer, Solution};
use crate::parallel::in_parallel;

/// τ is taken as resolved unless misfits this close to the least reach an end of the search.
const FLAT_MISFIT: f64 = 1.02;
const GOLDEN_STEPS: usize = 24;

/// τ of a rate term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tau {
    pub(crate) value_s: f64,
    pub(crate) resolved: bool,
}

/// A fitted model.
pub(crate) struct Fitted {
    pub(crate) spec: ModelSpec,
    pub(crate) tau: Option<Tau>,
    /// Constants of the runs, then b, c, e.
    pub(crate) theta: Vec<f64>,
    /// Covariance of theta and, where resolved, τ.
    pub(crate) covariance: DMatrix<f64>,
    /// y − model, °/h.
    pub(crate) residuals: Vec<f64>,
    /// Residual σ of a window of nominal length, °/h.
    pub(crate) sigma_dph: f64,
    /// Lag-one correlation of residuals.
    pub(crate) autocorrelation: f64,
    /// |value|/σ beyond which a coefficient differs from zero at 95 %.
    pub(crate) t95: f64,
}

impl Fitted {
    pub(crate) fn sigma(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }
}

/// Fits a model on all rows.
pub(crate) fn fit(problem: &Problem<'_>, spec: ModelSpec, taus_s: &[f64]) -> Result<Fitted> {
    let parameters = problem.levels.len() + spec.coefficients();
    if problem.len() < 3 * parameters {
        return Err(Error::refused(format!(
            "{} windows for {parameters} coefficients of `{spec}`; a fit needs three windows for each",
            problem.len()
        ))
        .help("give more data, a shorter --window or a smaller --model"));
    }
    let tau = spec.rate.map(|_| find_tau(problem, spec, taus_s)).transpose()?;
    let rates = rates_at(problem, tau.map(|t| t.value_s));
    let solution = solve(problem, spec, &rates).ok_or_else(|| dependent(problem, spec))?;
    let theta: Vec<f64> = solution.theta.iter().copied().collect();
    let residuals = residuals(problem, spec, &rates, &theta);
    let slope = tau.filter(|t| t.resolved).map(|t| tau_column(problem, spec, t.value_s, &theta));
    let covered = match &slope {
        Some(slope) => factor(problem, spec, &rates, Some(slope)).solve_all(),
        None => Some(solution),
    };
    let normal = covered.and_then(|s| s.inverse_normal()).ok_or_else(|| dependent(problem, spec))?;
    let degrees = (problem.len() - normal.nrows()) as f64;
    let ssr: f64 = residuals.iter().zip(&problem.weight).map(|(r, w)| w * r * r).sum();
    let variance = ssr / degrees;
    let autocorrelation = lag_one(problem, &residuals);
    let widening = (1.0 + autocorrelation) / (1.0 - autocorrelation);
    let effective = (problem.len() as f64 / widening - normal.nrows() as f64).max(1.0);
    let t95 = StudentsT::new(0.0, 1.0, effective).map_or(1.96, |t| t.inverse_cdf(0.975));
    let covariance = normal * (variance * widening);
    Ok(Fitted { spec, tau, theta, covariance, residuals, sigma_dph: variance.sqrt(), autocorrelation, t95 })
}

/// 95 % intervals of every parameter by the block bootstrap.
pub(crate) fn bootstrap_intervals(problem: &Problem<'_>, fitted: &Fitted, draws: usize) -> Vec<[f64; 2]> {
    let (spec, theta) = (fitted.spec, &fitted.theta);
    let rates = rates_at(problem, fitted.tau.map(|t| t.value_s));
    let slope = fitted.tau.filter(|t| t.resolved).map(|t| tau_column(problem, spec, t.value_s, theta));
    let mut row = Vec::new();
    let mut rows = Vec::new();
    for (i, rate) in rates.iter().enumerate() {
        row.clear();
        regressor_row(problem, spec, i, rate, slope.as_deref(), &mut row);
        let root = problem.weight[i].sqrt();
        rows.extend(row.iter().map(|value| value * root));
    }
    let design = DMatrix::from_row_slice(problem.len(), row.len(), &rows);
    let Some(normal) = factor(problem, spec, &rates, slope.as_deref()).solve_all().and_then(|s| s.inverse_normal())
    else {
        return Vec::new();
    };
    let gain = normal * design.transpose();
    let residuals: Vec<f64> = fitted.residuals.iter().zip(&problem.weight).map(|(r, w)| r * w.sqrt()).collect();
    let resampling =
        Resampling { residuals: &residuals, run: &problem.run, gain: &gain, autocorrelation: fitted.autocorrelation };
    let tau = fitted.tau.filter(|t| t.resolved).map(|t| t.value_s);
    let theta: Vec<f64> = theta.iter().copied().chain(tau).collect();
    resampling.intervals(&theta, draws)
}

fn dependent(problem: &Problem<'_>, spec: ModelSpec) -> Error {
    let rates: Vec<String> = problem.run_rate.iter().map(|r| format!("{r:.3}")).collect();
    let what = if spec.scale > 0 {
        format!("scale-factor and bias terms of `{spec}` cannot be told apart by runs at {} °/h", rates.join(", "))
    } else {
        format!("the terms of `{spec}` are not independent on these data")
    };
    Error::refused(what)
        .help("test at more temperatures (or, for scale terms, at several input rates), or take a smaller --model")
}

/// The fitted values' regressors as a factor, with ∂y/∂τ as a last column if given.
fn factor(problem: &Problem<'_>, spec: ModelSpec, rates: &[[f64; RATE_COLUMNS]], slope: Option<&[f64]>) -> Columns {
    let mut row = Vec::new();
    let mut reducer: Option<Reducer> = None;
    let mut width = 0;
    for (i, rate) in rates.iter().enumerate() {
        row.clear();
        regressor_row(problem, spec, i, rate, slope, &mut row);
        row.push(problem.y[i]);
        width = row.len();
        let root = problem.weight[i].sqrt();
        row.iter_mut().for_each(|value| *value *= root);
        reducer.get_or_insert_with(|| Reducer::new(width)).push(&row);
    }
    Columns { factor: reducer.unwrap_or_else(|| Reducer::new(1)).finish(), count: width.saturating_sub(1) }
}

/// Levels, terms and ∂y/∂τ of a row.
fn regressor_row(
    problem: &Problem<'_>,
    spec: ModelSpec,
    row: usize,
    rate: &[f64; RATE_COLUMNS],
    slope: Option<&[f64]>,
    out: &mut Vec<f64>,
) {
    out.extend(problem.levels.iter().map(|level| problem.level(row, *level)));
    problem.regressors(spec, row, rate, out);
    out.extend(slope.map(|s| s[row]));
}

struct Columns {
    factor: Factor,
    count: usize,
}

impl Columns {
    fn solve_all(&self) -> Option<Solution> {
        self.factor.solve(&(0..self.count).collect::<Vec<_>>())
    }
}

fn solve(problem: &Problem<'_>, spec: ModelSpec, rates: &[[f64; RATE_COLUMNS]]) -> Option<Solution> {
    factor(problem, spec, rates, None).solve_all()
}

fn rates_at(problem: &Problem<'_>, tau_s: Option<f64>) -> Vec<[f64; RATE_COLUMNS]> {
    tau_s.map_or_else(|| vec![[0.0; RATE_COLUMNS]; problem.len()], |tau| problem.rate_columns(tau))
}

fn misfit(problem: &Problem<'_>, spec: ModelSpec, tau_s: f64) -> f64 {
    solve(problem, spec, &problem.rate_columns(tau_s)).map_or(f64::INFINITY, |s| s.ssr)
}

/// The τ of least misfit; where the misfit is flat to an end of the search, the smallest within 2 %.
fn find_tau(problem: &Problem<'_>, spec: ModelSpec, taus_s: &[f64]) -> Result<Tau> {
    let misfits: Vec<f64> = in_parallel(taus_s, |tau| misfit(problem, spec, *tau));
    let best = misfits.iter().enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(i, _)| i);
    let least = misfits[best];
    if !least.is_finite() {
        return Err(dependent(problem, spec));
    }
    let near = |m: &f64| *m <= FLAT_MISFIT * least;
    let ends_are_far = misfits.first().is_some_and(|m| !near(m)) && misfits.last().is_some_and(|m| !near(m));
    if !ends_are_far {
        let smallest = misfits.iter().position(near).unwrap_or(best);
        return Ok(Tau { value_s: taus_s[smallest], resolved: false });
    }
    let value_s =
        golden_section(taus_s[best - 1].ln(), taus_s[best + 1].ln(), |log| misfit(problem, spec, log.exp())).exp();
    Ok(Tau { value_s, resolved: true })
}

/// Minimum of a function with one valley between `lo` and `hi`.
fn golden_section(mut lo: f64, mut hi: f64, f: impl Fn(f64) -> f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let (mut left, mut right) = (hi - RATIO * (hi - lo), lo + RATIO * (hi - lo));
    let (mut at_left, mut at_right) = (f(left), f(right));
    for _ in 0..GOLDEN_STEPS {
        if at_left < at_right {
            (hi, right, at_right) = (right, left, at_left);
            left = hi - RATIO * (hi - lo);
            at_left = f(left);
        } else {
            (lo, left, at_left) = (left, right, at_right);
            right = lo + RATIO * (hi - lo);
            at_right = f(right);
        }
    }
    f64::midpoint(lo, hi)
}

fn model_at(problem: &Problem<'_>, spec: ModelSpec, row: usize, rate: &[f64; RATE_COLUMNS], theta: &[f64]) -> f64 {
    let mut regressors = Vec::new();
    regressor_row(problem, spec, row, rate, None, &mut regressors);
    regressors.iter().zip(theta).map(|(a, b)| a * b).sum::<f64>()
}

fn residuals(problem: &Problem<'_>, spec: ModelSpec, rates: &[[f64; RATE_COLUMNS]], theta: &[f64]) -> Vec<f64> {
    (0..problem.len()).map(|i| problem.y[i] - model_at(problem, spec, i, &rates[i], theta)).collect()
}

/// ∂y/∂τ by central difference over ±1 %.
fn tau_column(problem: &Problem<'_>, spec: ModelSpec, tau_s: f64, theta: &[f64]) -> Vec<f64> {
    let step = 0.01 * tau_s;
    let (above, below) = (problem.rate_columns(tau_s + step), problem.rate_columns(tau_s - step));
    let difference =
        |i: usize| model_at(problem, spec, i, &above[i], theta) - model_at(problem, spec, i, &below[i], theta);
    (0..problem.len()).map(|i| difference(i) / (2.0 * step)).collect()
}

/// Lag-one correlation of neighbouring residuals of a run, with Kendall's (1954) correction for the
/// small-sample bias; within 0 … 0.99.
fn lag_one(problem: &Problem<'_>, residuals: &[f64]) -> f64 {
    let scaled: Vec<f64> = residuals.iter().zip(&problem.weight).map(|(r, w)| r * w.sqrt()).collect();
    let square: f64 = scaled.iter().map(|r| r * r).sum();
    let product: f64 =
        (1..scaled.len()).filter(|i| problem.run[*i] == problem.run[i - 1]).map(|i| scaled[i] * scaled[i - 1]).sum();
    if square == 0.0 {
        return 0.0;
    }
    let raw = product / square;
    (raw + (1.0 + 3.0 * raw.max(0.0)) / residuals.len() as f64).clamp(0.0, 0.99)
}
