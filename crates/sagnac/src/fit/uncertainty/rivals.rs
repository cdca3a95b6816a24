//! Other curves than a series: zones, a bend, and curves that follow nothing but their rows.
//!
//! ```text
//! zones    d(T) = Σ bᵢ·Tᵢ(x) + Σ zⱼ·square above knot j            orders 1 … 3, zones 2, 3, 4, 6
//! a bend   d(T) = b₁·x + h·max(0, x − ξ)                           ξ: one of the 23 bounds of 24 segments
//! free     d(T) = b₁·x + Σ hⱼ·max(0, x − ξⱼ)                       each next segment rises by N(0, λ·s²), whatever the one before did
//!          θ = (XᵀX + PᵀP)⁻¹·Xᵀy, variance s²·(XᵀX + PᵀP)⁻¹        P·θ: the rises over √λ (Wahba 1983)
//! −2·ln w  = SSR/s² + 2.5·k + 2·ln(members of the kind)             and 2·e of a free curve, e = 24 − tr P·(XᵀX + PᵀP)⁻¹·Pᵀ
//! ```
//!
//! with k the columns without a prior and e the effective number of rises, at Akaike's price. A free curve is a random walk over temperature; its λ
//! goes up a ladder to where one rise may be as large as the whole curve. All count in the average of [`super::curve_spread`], and judge the fitted model
//! ([`lack_of_fit`]); none is selected here. Over a kink, or a curve that saturates, every series is wrong somewhere by more than the spread
//! among series shows.
//!
//! Fails where a curve bends sharply in a few places and hardly elsewhere: one λ for the whole span is too small there, and the interval at a
//! bend too narrow.

use crate::calibration::LackOfFit;
use crate::fit::one_model::reduce::{Weighting, reduce};
use crate::fit::one_model::solution::{Fitted, whitened_misfit};
use crate::fit::problem::curve_points::{POINTS, temperature};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::fit::selection::prices::{CONTRADICTED_BY, RISE_PRICE, WEIGHT_PRICE, ZONES};
use crate::fit::uncertainty::curve_spread::Rival;
use crate::model::TermShape;
use crate::model::input::knots;
use crate::model::spec::ModelSpec;
use crate::noise_model::factor::{Factor, Solution};
use crate::noise_model::whitening::Whitening;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ops::Range;

/// Orders of the series next to zones.
const ORDERS: usize = 3;
/// Segments of the span between bends.
const SEGMENTS: usize = 24;
/// Ladder of λ: the least, in parts of the variance that the rows of a segment have together; the ratio of two steps; the most steps.
const LEAST: f64 = 0.01;
const RATIO: f64 = 10.0;
const MOST_STEPS: usize = 12;

/// How rows are weighted.
#[derive(Clone, Copy)]
pub(crate) struct OfRows<'a> {
    pub(crate) whitening: &'a Whitening,
    /// Of a row.
    pub(crate) variance: f64,
    /// Lags of the grid, of which a fitted one is one.
    pub(crate) taus: usize,
}

impl OfRows<'_> {
    fn price_of(self, lags: usize) -> f64 {
        lags as f64 * 2.0 * (self.taus as f64).ln()
    }
}

/// Where another curve is decisively better than the fitted one.
pub(crate) fn lack_of_fit(
    problem: &LeastSquares<'_>,
    fitted: &Fitted,
    of_rows: OfRows<'_>,
    rivals: &[&Rival],
    curve: &impl Fn(f64) -> (f64, f64),
) -> Option<LackOfFit> {
    let coefficients = (fitted.spec.coefficients() - fitted.taus.len()) as f64;
    let own = whitened_misfit(problem, fitted, of_rows.whitening)? / of_rows.variance
        + of_rows.price_of(fitted.taus.len())
        + WEIGHT_PRICE * coefficients;
    let best = rivals.iter().min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
    let chi_squared = own - best.criterion;
    let apart = |point: usize| {
        let celsius = temperature(problem, point);
        (celsius, best.curve[point].0 - curve(celsius).0)
    };
    let farthest = (0..POINTS).map(apart).max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()))?;
    let (temperature_c, difference_dph) = farthest;
    let better = best.name.clone();
    (chi_squared > CONTRADICTED_BY).then_some(LackOfFit { better, chi_squared, temperature_c, difference_dph })
}

/// Rivals of a fitted series, without those that its rows do not determine; `curve` is the fitted one.
pub(crate) fn rivals_of_shape(
    problem: &LeastSquares<'_>,
    fitted: &Fitted,
    of_rows: OfRows<'_>,
    curve: &impl Fn(f64) -> (f64, f64),
) -> Vec<Rival> {
    let (all, variance) = (RivalColumns::new(problem, fitted, of_rows), of_rows.variance);
    let values = (0..POINTS).map(|point| curve(temperature(problem, point)).0);
    let (lowest, highest) = values.fold((0.0_f64, 0.0_f64), |(lo, hi), value| (lo.min(value), hi.max(value)));
    let ladder = ladder((highest - lowest).powi(2) / variance, problem.len() as f64 / SEGMENTS as f64);
    let mut rivals: Vec<Rival> = ladder.par_iter().filter_map(|lambda| all.free_curve(*lambda, ladder.len())).collect();
    let zones: Vec<(usize, usize)> =
        (1..=ORDERS).flat_map(|order| (0..ZONES.len()).map(move |at| (order, at))).collect();
    rivals.par_extend(zones.par_iter().filter_map(|(order, at)| all.with_zones(*order, *at, zones.len())));
    // The first bend is that of a straight line.
    let bends: Vec<usize> = all.bends().skip(1).collect();
    rivals.par_extend(bends.par_iter().filter_map(|bend| all.bent(*bend, bends.len())));
    rivals
}

/// Values of λ up to the largest that is asked for.
fn ladder(largest: f64, rows_of_a_segment: f64) -> Vec<f64> {
    let step = |step: usize| LEAST / rows_of_a_segment * RATIO.powi(step as i32);
    let first_beyond = (0..MOST_STEPS).find(|at| step(*at) >= largest).unwrap_or(MOST_STEPS - 1);
    (0..=first_beyond).map(step).collect()
}

/// A function of the input that a column is made of.
#[derive(Clone, Copy)]
enum Function {
    Shape(TermShape),
    /// max(0, x − ξ), ξ the lower end of a segment.
    Bend(usize),
}

impl Function {
    fn value(self, problem: &LeastSquares<'_>, celsius: f64) -> f64 {
        match self {
            Self::Shape(shape) => shape.value(problem.span(), celsius),
            Self::Bend(segment) => bend(problem.span().x(celsius), segment),
        }
    }

    /// Its mean over a window; that of a bend is its value at the mean temperature.
    fn mean(self, problem: &LeastSquares<'_>, row: usize) -> f64 {
        match self {
            Self::Shape(shape) => problem.inputs[0].mean(shape, row),
            Self::Bend(segment) => bend(problem.inputs[0].x[row], segment),
        }
    }
}

/// Width of a segment in x.
const WIDTH: f64 = 2.0 / SEGMENTS as f64;

fn bend(x: f64, segment: usize) -> f64 {
    (x + 1.0 - WIDTH * segment as f64).max(0.0)
}

/// All whitened rows as one factor: levels and the terms of the fit that are no curve at rest, then the functions.
struct RivalColumns<'a> {
    problem: &'a LeastSquares<'a>,
    /// Of the fit, without its curve at rest.
    spec: ModelSpec,
    factor: Factor,
    /// Columns that all rivals have, levels among them, and what those next to the levels cost.
    common: usize,
    price: f64,
    functions: Vec<Function>,
    /// Places of the zones among the functions.
    zones: Vec<Range<usize>>,
    variance: f64,
}

impl<'a> RivalColumns<'a> {
    fn new(problem: &'a LeastSquares<'a>, fitted: &Fitted, of_rows: OfRows<'_>) -> Self {
        let mut spec = fitted.spec.clone();
        (spec.thermometer_mut().bias, spec.thermometer_mut().zones) = (0, 0);
        let terms = problem.terms(&spec);
        let lags: Vec<(usize, f64)> = fitted.taus.iter().map(|tau| (tau.input, tau.value_s)).collect();
        let mut functions: Vec<Function> =
            (1..=ORDERS as u8).map(|order| Function::Shape(TermShape::Chebyshev { order })).collect();
        let mut zones = Vec::new();
        for count in ZONES {
            let first = functions.len();
            let knots = knots(count, problem.span());
            functions.extend(knots.into_iter().map(|knot| Function::Shape(TermShape::Zone { knot })));
            zones.push(first..functions.len());
        }
        functions.extend((0..SEGMENTS).map(Function::Bend));
        let (levels, factor) = factor(problem, of_rows.whitening, &terms, &lags, &functions);
        let price = of_rows.price_of(lags.len()) + WEIGHT_PRICE * terms.len() as f64;
        let variance = of_rows.variance;
        Self { problem, spec, factor, common: levels + terms.len(), price, functions, zones, variance }
    }

    /// Places of the bends among the functions.
    fn bends(&self) -> Range<usize> {
        self.functions.len() - SEGMENTS..self.functions.len()
    }

    /// The common columns, then some functions.
    fn columns(&self, functions: &[usize]) -> Vec<usize> {
        (0..self.common).chain(functions.iter().map(|at| self.common + at)).collect()
    }

    fn with_zones(&self, order: usize, at: usize, members: usize) -> Option<Rival> {
        let functions: Vec<usize> = (0..order).chain(self.zones[at].clone()).collect();
        let mut spec = self.spec.clone();
        (spec.thermometer_mut().bias, spec.thermometer_mut().zones) = (order as u8, ZONES[at]);
        self.fitted(format!("`{spec}`"), &functions, members)
    }

    fn bent(&self, at: usize, members: usize) -> Option<Rival> {
        let x = WIDTH * (at - self.bends().start) as f64 - 1.0;
        self.fitted(format!("a line that bends at {:.1} °C", self.problem.span().at(x)), &[0, at], members)
    }

    /// A curve of these functions by least squares, one of so many.
    fn fitted(&self, name: String, functions: &[usize], members: usize) -> Option<Rival> {
        let columns = self.columns(functions);
        if self.problem.len() < 3 * (self.problem.levels().len() + columns.len()) {
            return None;
        }
        let solution = self.factor.solve(&columns)?;
        let price = WEIGHT_PRICE * functions.len() as f64 + 2.0 * (members as f64).ln();
        let criterion = solution.ssr / self.variance + self.price + price;
        Some(Rival { name, criterion, curve: self.curve(&solution, &solution.inverse_normal()?, functions) })
    }

    fn free_curve(&self, lambda: f64, members: usize) -> Option<Rival> {
        let functions: Vec<usize> = std::iter::once(0).chain(self.bends()).collect();
        let columns = self.columns(&functions);
        let first = self.common + 1;
        // A segment rises by its width times the sum of all bends up to it.
        let prior = DMatrix::from_fn(SEGMENTS, columns.len(), |segment, at| {
            if at >= first && at - first <= segment { WIDTH / lambda.sqrt() } else { 0.0 }
        });
        let mut rows = DMatrix::zeros(SEGMENTS, self.common + self.functions.len() + 1);
        columns.iter().enumerate().for_each(|(at, column)| rows.set_column(*column, &prior.column(at)));
        let solution = Factor::join([&self.factor, &Factor::of(rows)].into_iter())?.solve(&columns)?;
        let normal = solution.inverse_normal()?;
        let held = (&prior * &normal * prior.transpose()).trace();
        let price = WEIGHT_PRICE + RISE_PRICE * (SEGMENTS as f64 - held) + 2.0 * (members as f64).ln();
        let ssr = self.factor.ssr(&columns, &solution.theta, &[]);
        let criterion = ssr / self.variance + self.price + price;
        let name = "a curve that is neither a series nor zones".to_owned();
        Some(Rival { name, criterion, curve: self.curve(&solution, &normal, &functions) })
    }

    /// The curve of the functions behind the common columns.
    fn curve(&self, solution: &Solution, normal: &DMatrix<f64>, functions: &[usize]) -> Vec<(f64, f64)> {
        let at = |point: usize| {
            let celsius = temperature(self.problem, point);
            let reference = self.problem.inputs[0].reference;
            let change = |at: &usize| {
                let function = self.functions[*at];
                function.value(self.problem, celsius) - function.value(self.problem, reference)
            };
            let weights: Vec<f64> = functions.iter().map(change).collect();
            let value: f64 = weights.iter().zip(self.common..).map(|(weight, at)| weight * solution.theta[at]).sum();
            let mut square = 0.0;
            for (i, a) in weights.iter().enumerate() {
                for (j, b) in weights.iter().enumerate() {
                    square += a * b * normal[(self.common + i, self.common + j)];
                }
            }
            (value, self.variance * square)
        };
        (0..POINTS).map(at).collect()
    }
}

/// Shared levels, terms, functions and y of all whitened rows, and how many these levels are; what a run has for itself is projected out.
fn factor(
    problem: &LeastSquares<'_>,
    whitening: &Whitening,
    terms: &[TermColumn],
    lags: &[(usize, f64)],
    functions: &[Function],
) -> (usize, Factor) {
    let (columns, rates) = (problem.run_columns(), problem.rates(lags));
    let add = |i: usize, row: &mut Vec<f64>| {
        row.extend(terms.iter().map(|term| problem.regressor(term, i, &rates)));
        row.extend(functions.iter().map(|function| function.mean(problem, i)));
        row.push(problem.y[i]);
    };
    let further = terms.len() + functions.len();
    let whole = reduce(problem, &columns, further, Weighting::Whitened(whitening), None, add).swap_remove(0);
    (columns.shared.len(), whole.finish_shared())
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::io::Cursor;

    use nalgebra::DVector;
    use sagnac_log::ingest::{LogReader, ReadMode};
    use sagnac_log::setup::Setup;

    use super::*;
    use crate::fit::one_model::solution::fit;
    use crate::fit::problem::axis::Axis;
    use crate::model::input::Signal;
    use crate::noise_model::processes::SlowNoise;
    use crate::window::{WindowBuilder, Windows};

    /// A ramp up and down over 24 h, a slope that begins at 40 °C, °/h per °C.
    fn windows(slope: f64) -> Windows {
        const ROWS: usize = 4320;
        let mut csv = String::from("time_s,temperature_c,counts\n");
        for n in 0..ROWS {
            let celsius = 60.0 - 80.0 * (2.0 * n as f64 / ROWS as f64 - 1.0).abs();
            let noise = ((n * 7919) % 1009) as f64 / 1009.0 - 0.5;
            let dph = 10.0 + slope * (celsius - 40.0).max(0.0) + noise;
            writeln!(csv, "{},{celsius:.4},{}", 20 * (n + 1), (dph * 20_000.0).round()).unwrap();
        }
        let setup = Setup { arcsec_per_count: Some(0.001), ..Setup::default() };
        let log = LogReader::from_reader("made.csv", Box::new(Cursor::new(csv.into_bytes())), &setup, ReadMode::Bulk);
        WindowBuilder::read_all(vec![log.unwrap()], &setup).unwrap().finish()
    }

    /// A free curve is universal kriging (Cressie 1993): a flat prior on the offset and the slope, and covariances of the curve
    /// v·Σ ramp(a)·ramp(b), with the rows' covariance as a whole matrix.
    #[test]
    fn a_free_curve_is_that_of_universal_kriging() {
        let windows = windows(0.02);
        let problem = LeastSquares::new(&Axis::at_rest(&windows), &[Signal::Thermometer(0)]).unwrap();
        let fitted = fit(&problem, &"bias 1".parse().unwrap(), &problem.tau_grid()).unwrap();
        let whitening = Whitening::new(problem.noise_rows(), SlowNoise::default());
        let variance = 1e-4;
        let all = RivalColumns::new(&problem, &fitted, OfRows { whitening: &whitening, variance, taus: 1 });
        let x = &problem.inputs[0].x;
        let ramp = |x: f64, segment: usize| ((x + 1.0) / WIDTH - segment as f64).clamp(0.0, 1.0);
        for lambda in [1e-3, 1.0, 1e3] {
            let between = |a: &dyn Fn(usize) -> f64, b: &dyn Fn(usize) -> f64| -> f64 {
                lambda * variance * (0..SEGMENTS).map(|segment| a(segment) * b(segment)).sum::<f64>()
            };
            let n = problem.len();
            let of_row = |i: usize| move |segment: usize| ramp(x[i], segment);
            let rows =
                DMatrix::from_fn(n, n, |i, j| between(&of_row(i), &of_row(j)) + f64::from(u8::from(i == j)) * variance);
            let inverse = rows.try_inverse().unwrap();
            let trend = DMatrix::from_fn(n, 2, |i, j| if j == 0 { 1.0 } else { x[i] });
            let normal = (trend.transpose() * &inverse * &trend).try_inverse().unwrap();
            let y = DVector::from_column_slice(&problem.y);
            let of_trend = &normal * trend.transpose() * &inverse * &y;
            let found = all.free_curve(lambda, 1).unwrap();
            for point in [0, 7, 19, POINTS - 1] {
                let (here, there) = (problem.span().x(temperature(&problem, point)), problem.span().x(25.0));
                let apart = |segment: usize| ramp(here, segment) - ramp(there, segment);
                let to_rows = DVector::from_fn(n, |i, _| between(&of_row(i), &apart));
                let slope = DVector::from_column_slice(&[0.0, here - there]);
                let value = slope.dot(&of_trend) + to_rows.dot(&(&inverse * (&y - &trend * &of_trend)));
                let rest = &slope - trend.transpose() * &inverse * &to_rows;
                let own = between(&apart, &apart) - to_rows.dot(&(&inverse * &to_rows)) + rest.dot(&(&normal * &rest));
                let (value_found, own_found) = found.curve[point];
                assert!((value_found - value).abs() < 1e-6, "{lambda}, {point}: {value_found} {value}");
                assert!(
                    (own_found / own - 1.0).abs() < 1e-4 || own.abs() < 1e-12,
                    "{lambda}, {point}: {own_found} {own}"
                );
            }
        }
    }

    /// A straight line is contradicted where the drift bends, and not where it is one.
    #[test]
    fn a_bend_contradicts_a_line() {
        let lack = |slope: f64| {
            let windows = windows(slope);
            let problem = LeastSquares::new(&Axis::at_rest(&windows), &[Signal::Thermometer(0)]).unwrap();
            let whitening = Whitening::new(problem.noise_rows(), SlowNoise::default());
            let fitted = fit(&problem, &"bias 1".parse().unwrap(), &problem.tau_grid()).unwrap();
            let of_rows = OfRows { whitening: &whitening, variance: fitted.sigma_dph.powi(2), taus: 1 };
            let b1 = fitted.theta[problem.levels().len()];
            let curve = |celsius: f64| (b1 * (problem.span().x(celsius) - problem.span().x(25.0)), 0.0);
            let rivals = rivals_of_shape(&problem, &fitted, of_rows, &curve);
            lack_of_fit(&problem, &fitted, of_rows, &rivals.iter().collect::<Vec<_>>(), &curve)
        };
        let found = lack(0.02).unwrap();
        // From 25 to 60 °C the drift rises by 0.4 °/h; a line over −20 … 60 °C makes less than half of it.
        assert!(found.chi_squared > 100.0 && found.temperature_c > 55.0, "{found:?}");
        assert!((0.15..0.45).contains(&found.difference_dph), "{found:?}");
        assert_eq!(lack(0.0), None);
    }
}
