//! The fit of one model on all windows, with its covariance.
//!
//! For given τ the model is linear and solved by QR. τ is found by a grid over [Δt, run/4] and parabolas; two lags of one
//! input are found together ([`crate::fit::one_model::two_lags`]), those of several inputs in turn until they converge.
//!
//! ```text
//! Cov = s²·(JᵀWJ)⁻¹·(1 + ρ)/(1 − ρ)        ∂y/∂τ is a column of J; ρ: lag-one autocorrelation of the residuals (AR(1); Bartlett 1946)
//! ```
//!
//! Once the slow noise of the residuals is known, the covariance is that of these weights under that noise
//! ([`super::residual_noise`]).

use crate::calibration::Lag;
use crate::fit::one_model::design::{
    Design, FLAT_CHI_SQUARED, FactoredColumns, LN_TAU_TOLERANCE, Tau, lag_one, misfit,
};
use crate::fit::one_model::prepared::{Blocks, PreparedModel};
use crate::fit::one_model::two_lags::{LEAST_RATIO, LagPair, find_pair};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::model::spec::ModelSpec;
use crate::model::{ActsOn, TermShape};
use crate::noise_model::factor::Conditioning;
use crate::noise_model::minimum::minimum;
use crate::noise_model::whitening::Whitening;
use nalgebra::DMatrix;
use rayon::prelude::*;
use sagnac_log::error::{Error, Result};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Limit on the sweeps over several lags.
const MOST_SWEEPS: usize = 6;
/// Lags have converged when none moves by more than this fraction of itself.
const STILL: f64 = 1e-3;

/// A fitted model.
pub(crate) struct Fitted {
    pub(crate) spec: ModelSpec,
    pub(crate) terms: Vec<TermColumn>,
    /// One per input with rate terms.
    pub(crate) taus: Vec<Tau>,
    /// Levels, then the terms in their order.
    pub(crate) theta: Vec<f64>,
    /// Covariance of theta and the resolved τ in their order.
    pub(crate) covariance: DMatrix<f64>,
    /// y − model, °/h.
    pub(crate) residuals: Vec<f64>,
    /// Residual σ of a window of nominal length, °/h.
    pub(crate) sigma_dph: f64,
    /// Lag-one autocorrelation of the residuals.
    pub(crate) autocorrelation: f64,
    /// Half a 95 % interval in units of σ.
    pub(crate) t_quantile_975: f64,
    /// Condition of the terms; `None` without any.
    pub(crate) conditioning: Option<Conditioning>,
}

impl Fitted {
    pub(crate) fn sigma(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }

    /// τ of an input and its σ where it is resolved.
    pub(crate) fn lag(&self, input: usize) -> Option<(f64, Option<f64>)> {
        let tau = self.taus.iter().find(|tau| tau.input == input)?;
        let before = self.resolved().take_while(|other| other.input != input).count();
        Some((tau.value_s, tau.resolved.then(|| self.sigma(self.theta.len() + before))))
    }

    /// The same for a record.
    pub(crate) fn lag_of(&self, input: usize) -> Option<Lag> {
        self.lag(input).map(|(value, sigma)| Lag { value, sigma })
    }

    /// Parameters that the model is not linear in and that are resolved, as the covariance has them after the coefficients: input,
    /// name, value.
    pub(crate) fn nonlinear(&self) -> Vec<(usize, &'static str, f64)> {
        let lags = self.resolved().map(|tau| (tau.input, "lag_s", tau.value_s));
        let periods = fitted_periods(&self.spec, &self.terms).into_iter().map(|(cosine, period)| {
            let TermColumn { input, form } = self.terms[cosine];
            (input, form.acts_on.period_name(), period)
        });
        lags.chain(periods).collect()
    }

    /// Sum of squares of the residuals by their weights.
    pub(crate) fn misfit(&self, problem: &LeastSquares<'_>) -> f64 {
        self.residuals.iter().zip(&problem.weight).map(|(r, w)| w * r * r).sum()
    }

    /// The lags in the covariance.
    pub(crate) fn resolved(&self) -> impl Iterator<Item = &Tau> {
        self.taus.iter().filter(|tau| tau.resolved)
    }
}

/// Fits a model on all rows.
pub(crate) fn fit(problem: &LeastSquares<'_>, spec: &ModelSpec, taus_s: &[f64]) -> Result<Fitted> {
    let parameters = problem.levels().len() + spec.coefficients();
    if problem.len() < 3 * parameters {
        return Err(Error::refused(
            format!(
                "{} windows are too few for {parameters} coefficients of `{spec}`: a fit needs three windows for each",
                problem.len()
            ),
            "give more data, or set a shorter --window or a smaller --model",
        ));
    }
    let terms = problem.terms(spec);
    let taus = find_taus(problem, spec, &terms, taus_s)?;
    let design = Design::new(problem, &terms, &values(&taus));
    let solution = design.factor(&[]).solve_all().ok_or_else(|| dependent(problem, spec))?;
    let theta: Vec<f64> = solution.theta.iter().copied().collect();
    let residuals = design.residuals(&theta);
    let conditioning = solution.conditioning(problem.levels().len(), &together(&terms));
    let slopes = nonlinear_columns(&design, spec, &taus, &theta);
    let covered = if slopes.is_empty() { Some(solution) } else { design.factor(&slopes).solve_all() };
    let normal = covered.and_then(|s| s.inverse_normal()).ok_or_else(|| dependent(problem, spec))?;
    let degrees = (problem.len() - normal.nrows()) as f64;
    let ssr: f64 = residuals.iter().zip(&problem.weight).map(|(r, w)| w * r * r).sum();
    let variance = ssr / degrees;
    let weighted: Vec<f64> = residuals.iter().zip(&problem.weight).map(|(r, w)| r * w.sqrt()).collect();
    let autocorrelation = lag_one(problem, &weighted);
    let widening = (1.0 + autocorrelation) / (1.0 - autocorrelation);
    let effective = (problem.len() as f64 / widening - normal.nrows() as f64).max(1.0);
    let t_quantile_975 = StudentsT::new(0.0, 1.0, effective).map_or(1.96, |t| t.inverse_cdf(0.975));
    let (covariance, sigma_dph) = (normal * (variance * widening), variance.sqrt());
    let spec = spec.clone();
    Ok(Fitted {
        spec,
        terms,
        taus,
        theta,
        covariance,
        residuals,
        sigma_dph,
        autocorrelation,
        t_quantile_975,
        conditioning,
    })
}

/// (JᵀWJ)⁻¹ and the rows of WJ, with a further column behind those of the fit.
pub(crate) fn weighted_rows(
    problem: &LeastSquares<'_>,
    fitted: &Fitted,
    further: Option<Vec<f64>>,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let design = Design::new(problem, &fitted.terms, &values(&fitted.taus));
    let mut slopes = nonlinear_columns(&design, &fitted.spec, &fitted.taus, &fitted.theta);
    slopes.extend(further);
    let normal = design.factor(&slopes).solve_all()?.inverse_normal()?;
    let mut row = Vec::with_capacity(normal.nrows());
    let mut z = DMatrix::zeros(problem.len(), normal.nrows());
    for i in 0..problem.len() {
        design.row(i, &slopes, &mut row);
        row.iter().enumerate().for_each(|(j, value)| z[(i, j)] = problem.weight[i] * value);
    }
    Some((normal, z))
}

/// Sum of squares of whitened rows that the terms of a fit do not explain, at its lags and whatever their coefficients; `None` where they
/// depend on each other.
pub(crate) fn whitened_misfit(problem: &LeastSquares<'_>, fitted: &Fitted, whitening: &Whitening) -> Option<f64> {
    let mut design = Design::new(problem, &fitted.terms, &values(&fitted.taus));
    design.whitening = Some(whitening);
    design.factor(&[]).solve_all().map(|solution| solution.ssr)
}

/// A column that a fit does not have, next to its levels and terms.
pub(crate) struct AddedColumn {
    /// Coefficients of the terms that make the column as far as they can.
    pub(crate) of_terms: Vec<f64>,
    /// Sum of squares of the column that they cannot make, in whitened rows.
    pub(crate) misfit: f64,
    /// Its coefficient, fitted with them.
    pub(crate) coefficient: f64,
}

/// Least part of a column that counts as its own: less is rounding.
const OWN_PART: f64 = 1e-12;

/// How a column relates to the fit; `None` where the terms depend on each other.
pub(crate) fn added_column(
    problem: &LeastSquares<'_>,
    fitted: &Fitted,
    whitening: &Whitening,
    column: &[f64],
) -> Option<AddedColumn> {
    let mut design = Design::new(problem, &fitted.terms, &values(&fitted.taus));
    design.whitening = Some(whitening);
    let FactoredColumns { factor, count } = design.factor(&[column.to_vec()]);
    let others: Vec<usize> = (0..count - 1).collect();
    let regression = factor.regress(count - 1, &others)?;
    let misfit = regression.ssr.max(OWN_PART * factor.norm_squared(count - 1));
    let with = factor.solve(&(0..count).collect::<Vec<_>>());
    let coefficient = with.map_or(0.0, |solution| solution.theta[count - 1]);
    let of_terms = regression.theta.iter().copied().skip(problem.levels().len()).collect();
    Some(AddedColumn { of_terms, misfit, coefficient })
}

/// Series and zones of the bias over the thermometer of the fit, where there are zones: squares above their knots look alike
/// however well the curve is known.
fn together(terms: &[TermColumn]) -> Vec<usize> {
    let of_curve = |term: &TermColumn| {
        term.input == 0 && !term.form.times_rate && term.form.acts_on == ActsOn::Bias && term.form.shape.joins_series()
    };
    let zoned = terms.iter().any(|term| matches!(term.form.shape, TermShape::Zone { .. }));
    (0..terms.len()).filter(|at| zoned && of_curve(&terms[*at])).collect()
}

pub(crate) fn values(taus: &[Tau]) -> Vec<(usize, f64)> {
    taus.iter().map(|tau| (tau.input, tau.value_s)).collect()
}

fn dependent(problem: &LeastSquares<'_>, spec: &ModelSpec) -> Error {
    let rates: Vec<String> = problem.run_rate.iter().map(|r| format!("{r:.3}")).collect();
    let what = if spec.thermometer().scale > 0 {
        format!("scale-factor and bias terms of `{spec}` are not separated by runs at {} °/h", rates.join(", "))
    } else {
        format!("the terms of `{spec}` are not independent on these data")
    };
    Error::refused(what, "test at more temperatures (scale terms: at several input rates), or choose a smaller --model")
}

/// The lags of least misfit, one after the other until they stand.
fn find_taus(problem: &LeastSquares<'_>, spec: &ModelSpec, terms: &[TermColumn], taus_s: &[f64]) -> Result<Vec<Tau>> {
    let middle = taus_s.get(taus_s.len() / 2).copied().unwrap_or(1.0);
    let rated = problem.rated(spec);
    let prepared = PreparedModel::new(problem, terms, taus_s, Blocks::of_all(problem)).filter(|_| !rated.is_empty());
    let misfit = |lags_s: &[(usize, f64)]| match &prepared {
        Some(prepared) => prepared.misfit(lags_s),
        None => misfit(problem, terms, lags_s),
    };
    let mut taus: Vec<Tau> =
        rated.iter().map(|input| Tau { input: *input, value_s: middle, resolved: false }).collect();
    for _ in 0..MOST_SWEEPS {
        let before = taus.clone();
        for at in 0..taus.len() {
            if is_slow(problem, &taus, at) {
                continue;
            }
            if is_slow(problem, &taus, at + 1) {
                match find_pair(problem, terms, &taus, at, taus_s, &misfit) {
                    LagPair::Pair(pair) => {
                        for (tau, lag) in taus[at..].iter_mut().zip(pair) {
                            (tau.value_s, tau.resolved) = lag;
                        }
                    }
                    LagPair::NotSeparated => return Err(not_separated(problem, spec, taus[at].input)),
                    LagPair::Nothing => return Err(dependent(problem, spec)),
                }
                continue;
            }
            let with = |tau_s: f64| -> Vec<(usize, f64)> {
                let tau_of = |(other, tau): (usize, &Tau)| (tau.input, if other == at { tau_s } else { tau.value_s });
                taus.iter().enumerate().map(tau_of).collect()
            };
            let grid = taus_s.get(problem.tau_from()[taus[at].input]..).unwrap_or(&[]);
            let degrees = (problem.len() as f64 - (problem.levels().len() + terms.len()) as f64).max(1.0);
            let lag = find_tau(grid, degrees, |tau_s| misfit(&with(tau_s)));
            (taus[at].value_s, taus[at].resolved) = lag.ok_or_else(|| dependent(problem, spec))?;
        }
        let moved = taus.iter().zip(&before).any(|(a, b)| (a.value_s / b.value_s - 1.0).abs() > STILL);
        if taus.len() < 2 || !moved {
            break;
        }
    }
    Ok(taus)
}

/// The lag at this place is the slow one next to that before it.
fn is_slow(problem: &LeastSquares<'_>, taus: &[Tau], at: usize) -> bool {
    taus.get(at).is_some_and(|tau| problem.inputs[tau.input].repeats.is_some())
}

fn not_separated(problem: &LeastSquares<'_>, spec: &ModelSpec, input: usize) -> Error {
    let name = &problem.inputs[input].name;
    Error::refused(format!(
        "the data do not separate the two lags of {name} in `{spec}`: a ratio below {LEAST_RATIO}, or a slow lag of a \
         quarter of the longest run, fits equally well"
    ), "remove the slow rate from --model, or test with ramps and soaks of several lengths")
    .column("--model")
}

/// The τ of least misfit and whether it is resolved; where the misfit is flat to an end of the search, the smallest
/// within [`FLAT_CHI_SQUARED`]. `None` where nothing could be fitted.
fn find_tau(taus_s: &[f64], degrees: f64, misfit: impl Fn(f64) -> f64 + Sync) -> Option<(f64, bool)> {
    let misfits: Vec<f64> = taus_s.par_iter().map(|tau| misfit(*tau)).collect();
    let (best, least) = misfits.iter().copied().enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    if !least.is_finite() {
        return None;
    }
    let near = |m: &f64| *m <= least * (1.0 + FLAT_CHI_SQUARED / degrees);
    let ends_are_far = misfits.first().is_some_and(|m| !near(m)) && misfits.last().is_some_and(|m| !near(m));
    if !ends_are_far {
        let smallest = misfits.iter().position(near).unwrap_or(best);
        return Some((taus_s[smallest], false));
    }
    let lowest = minimum(taus_s[best - 1].ln(), taus_s[best + 1].ln(), LN_TAU_TOLERANCE, |log| misfit(log.exp()));
    Some((lowest.at.exp(), true))
}

/// ∂y of every parameter of [`Fitted::nonlinear`], in its order.
fn nonlinear_columns(design: &Design<'_>, spec: &ModelSpec, taus: &[Tau], theta: &[f64]) -> Vec<Vec<f64>> {
    let mut columns = tau_columns(design, taus, theta);
    columns.extend(period_columns(design, spec, theta));
    columns
}

/// ∂y/∂τ of every resolved lag.
fn tau_columns(design: &Design<'_>, taus: &[Tau], theta: &[f64]) -> Vec<Vec<f64>> {
    taus.iter()
        .filter(|tau| tau.resolved)
        .map(|tau| design.slope_of_lag(tau, &theta[design.problem.levels().len()..]))
        .collect()
}

/// Index of the cosine and the period of every harmonic whose period is a parameter of the fit.
fn fitted_periods(spec: &ModelSpec, terms: &[TermColumn]) -> Vec<(usize, f64)> {
    let harmonics = spec.inputs().iter().flat_map(|terms| &terms.harmonics);
    let fitted: Vec<f64> = harmonics.filter(|wave| wave.is_fitted).filter_map(|wave| wave.period).collect();
    let cosine = |(at, term): (usize, &TermColumn)| match term.form.shape {
        TermShape::Cosine { period } if fitted.contains(&period) => Some((at, period)),
        TermShape::Cosine { .. } | TermShape::Sine { .. } => None,
        TermShape::Chebyshev { .. } | TermShape::Zone { .. } | TermShape::Step { .. } => None,
    };
    terms.iter().enumerate().filter_map(cosine).collect()
}

/// ∂y/∂P of every fitted period by central difference over ± a thousandth of a turn over the span.
fn period_columns(design: &Design<'_>, spec: &ModelSpec, theta: &[f64]) -> Vec<Vec<f64>> {
    const STEP_TURNS: f64 = 1e-3;
    let problem = design.problem;
    let column = |(cosine, period): (usize, f64)| {
        let span = problem.inputs[design.terms[cosine].input].span;
        let step = STEP_TURNS * period * period / (span.hi - span.lo);
        let wave = |by: f64, row: usize| -> f64 {
            let period = period + by;
            let shapes = [TermShape::Cosine { period }, TermShape::Sine { period }];
            let value = |(at, shape): (usize, TermShape)| {
                let mut term = design.terms[cosine + at];
                term.form.shape = shape;
                theta[problem.levels().len() + cosine + at] * problem.regressor(&term, row, &design.rates)
            };
            shapes.into_iter().enumerate().map(value).sum()
        };
        (0..problem.len()).map(|row| (wave(step, row) - wave(-step, row)) / (2.0 * step)).collect()
    };
    fitted_periods(spec, design.terms).into_iter().map(column).collect()
}

/// Misfit of a model at given lags.
pub(crate) fn misfit_at(problem: &LeastSquares<'_>, spec: &ModelSpec, lags_s: &[(usize, f64)]) -> f64 {
    misfit(problem, &problem.terms(spec), lags_s)
}
