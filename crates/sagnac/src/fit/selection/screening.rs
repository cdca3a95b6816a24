//! What further terms could gain at most on a model without a lag, before any model with them is fitted.
//!
//! ```text
//! base:     [ levels | terms ] = Q·R,   y' = y − QQᵀy
//! further:  V' = V − QQᵀV,   misfit = |y'|² − bᵀG⁻¹b              G = V'ᵀV', b = V'ᵀy'
//! ```
//!
//! V are the columns of the further terms. Where these have a lag, the least misfit over the lags of the grid counts; of two lags, over
//! all pairs. Between two lags of the grid a misfit may be lower, so the search asks for half of the gain that is needed, as a
//! logarithm ([`super::search`]).
//!
//! A base with a lag is not screened: a further term may let that lag go elsewhere, and gain ten times what it gains where the lag stands
//! (a gradient beside a lag that stands for it). Fails where no lag of the grid is near one that gains.

use crate::fit::one_model::prepared::{Blocks, MOST_VALUES, Prepared, dot, project};
use crate::fit::one_model::two_lags::pairs;
use crate::fit::problem::lag::RATE_COLUMNS;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::{Rates, TermColumn};
use crate::fit::selection::prices::{CONDITION_MAX, MOST_RATE};
use crate::model::spec::ModelSpec;
use nalgebra::{DMatrix, DVector};
use std::sync::OnceLock;

/// A column whose part beyond the base and the columns before it has less than this fraction of its square adds nothing.
const DEPENDENT: f64 = 1e-12;
/// A column whose part beyond the base has less than this fraction of its square, offsets aside, makes a condition beyond the limit: the
/// least singular value of columns at unit length is at most the distance of one from the others.
const COLLINEAR: f64 = 1.0 / (CONDITION_MAX * CONDITION_MAX);

/// What a model can be at best.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    /// Its misfit is no less.
    pub(crate) least_misfit: f64,
    /// Its terms are nearly combinations of each other, for certain.
    pub(crate) is_collinear: bool,
}

/// What a base does not explain, ready for further terms.
pub(crate) struct Screen<'a> {
    problem: &'a LeastSquares<'a>,
    prepared: Prepared<'a>,
    base: Vec<TermColumn>,
    taus_s: &'a [f64],
    basis: Vec<Vec<f64>>,
    rest: Vec<f64>,
    /// Per input: its rate columns at all lags.
    rates: Vec<OnceLock<Products>>,
}

/// Scalar products of columns beyond the base, with each other and with y.
struct Products {
    gram: DMatrix<f64>,
    with_rest: DVector<f64>,
    /// Squares of the whole columns.
    squares: Vec<f64>,
    /// Columns of a lag.
    orders: usize,
}

impl<'a> Screen<'a> {
    /// Of a model; `None` where it has a lag, or for too many rows.
    pub(crate) fn new(problem: &'a LeastSquares<'a>, spec: &ModelSpec, taus_s: &'a [f64]) -> Option<Self> {
        let base = problem.terms(spec);
        if !problem.rated(spec).is_empty() {
            return None;
        }
        let prepared = Prepared::new(problem, &base, taus_s, Blocks::of_all(problem))?;
        let basis = prepared.fixed_basis();
        let mut rest = prepared.column(|row| problem.y[row]);
        project(&basis, &mut rest);
        let rates = problem.inputs.iter().map(|_| OnceLock::new()).collect();
        Some(Self { problem, prepared, base, taus_s, basis, rest, rates })
    }

    /// What a model of the base's terms and further ones can be at best; `None` where that cannot be said so simply.
    pub(crate) fn bound(&self, spec: &ModelSpec) -> Option<Bound> {
        let terms = self.problem.terms(spec);
        let (rated, fixed): (Vec<TermColumn>, Vec<TermColumn>) =
            terms.iter().filter(|term| !self.base.contains(term)).partition(|term| term.form.times_rate);
        let (explained, is_collinear) = match (fixed.is_empty(), rated.first()) {
            (_, None) => self.explained_by(&fixed),
            (true, Some(first)) => (self.explained_at_best_lags(&terms, first.input)?, false),
            (false, Some(_)) => return None,
        };
        Some(Bound { least_misfit: dot(&self.rest, &self.rest) - explained, is_collinear })
    }

    fn explained_by(&self, further: &[TermColumn]) -> (f64, bool) {
        let none = Rates::new();
        let column = |term| self.prepared.column(|row| self.problem.regressor(term, row, &none));
        let columns: Vec<Vec<f64>> = further.iter().map(column).collect();
        let levels = self.basis.len().min(self.problem.run_columns().shared.len());
        let beyond_levels = |mut column: Vec<f64>| {
            project(&self.basis[..levels], &mut column);
            dot(&column, &column)
        };
        let whole: Vec<f64> = columns.iter().cloned().map(beyond_levels).collect();
        let products = self.products(columns, further.len());
        let is_collinear = whole.iter().enumerate().any(|(at, whole)| products.gram[(at, at)] < COLLINEAR * whole);
        (products.explained(&(0..further.len()).collect::<Vec<_>>()), is_collinear)
    }

    /// By all rate terms of an input, at the lags of the grid where they explain most.
    fn explained_at_best_lags(&self, terms: &[TermColumn], input: usize) -> Option<f64> {
        let fast = self.problem.inputs[input].repeats.unwrap_or(input);
        let slow = self.problem.repeat_of(fast);
        let orders_of = |input: Option<usize>| -> usize {
            terms.iter().filter(|term| term.form.times_rate && Some(term.input) == input).count()
        };
        let (of_fast, of_slow) = (orders_of(Some(fast)), orders_of(slow));
        let products = self.rates_of(fast, slow).filter(|products| of_fast.max(of_slow) <= products.orders)?;
        let at = |place: usize, orders: usize| (0..orders).map(move |j| place * products.orders + j);
        let from = self.problem.tau_from()[fast];
        let most =
            |all: &mut dyn Iterator<Item = Vec<usize>>| all.map(|of| products.explained(&of)).fold(0.0, f64::max);
        Some(match slow.filter(|_| of_slow > 0) {
            None => most(&mut (from..self.taus_s.len()).map(|place| at(place, of_fast).collect())),
            Some(slow) => {
                let pairs = pairs(self.taus_s, [from, self.problem.tau_from()[slow]]);
                most(&mut pairs.into_iter().map(|pair| at(pair[0], of_fast).chain(at(pair[1], of_slow)).collect()))
            }
        })
    }

    /// Of the rate columns of an input at every lag; `None` for too many rows.
    fn rates_of(&self, fast: usize, slow: Option<usize>) -> Option<&Products> {
        let orders = if fast == 0 { RATE_COLUMNS } else { usize::from(MOST_RATE) + 1 };
        if self.problem.len().saturating_mul(orders * self.taus_s.len()) > MOST_VALUES {
            return None;
        }
        let from = slow.map_or(0, |slow| self.problem.tau_from()[slow]).min(self.problem.tau_from()[fast]);
        let made = || {
            let columns = self.taus_s.iter().enumerate().flat_map(|(place, tau_s)| {
                // A lag that is not tried costs nothing.
                let rates = if place >= from { self.problem.rate_columns(fast, *tau_s) } else { Default::default() };
                let value =
                    move |order: usize| self.prepared.column(|row| rates.get(row).map_or(0.0, |means| means[order]));
                (0..orders).map(value).collect::<Vec<_>>()
            });
            self.products(columns.collect(), orders)
        };
        Some(self.rates[fast].get_or_init(made))
    }

    fn products(&self, mut columns: Vec<Vec<f64>>, orders: usize) -> Products {
        let squares = columns.iter().map(|column| dot(column, column)).collect();
        columns.iter_mut().for_each(|column| {
            project(&self.basis, column);
        });
        let n = columns.len();
        let mut gram = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let product = dot(&columns[i], &columns[j]);
                (gram[(i, j)], gram[(j, i)]) = (product, product);
            }
        }
        let with_rest = DVector::from_iterator(n, columns.iter().map(|column| dot(column, &self.rest)));
        Products { gram, with_rest, squares, orders }
    }
}

impl Products {
    /// bᵀG⁻¹b of some columns, by Cholesky's factor column by column; dependent ones add nothing.
    fn explained(&self, columns: &[usize]) -> f64 {
        let n = columns.len();
        let (mut l, mut z, mut sum) = (DMatrix::<f64>::zeros(n, n), vec![0.0; n], 0.0);
        for (i, column) in columns.iter().enumerate() {
            for j in 0..i {
                let before: f64 = (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum();
                let product = self.gram[(*column, columns[j])] - before;
                l[(i, j)] = if l[(j, j)] > 0.0 { product / l[(j, j)] } else { 0.0 };
            }
            let own = self.gram[(*column, *column)] - (0..i).map(|k| l[(i, k)].powi(2)).sum::<f64>();
            if own > DEPENDENT * self.squares[*column] {
                l[(i, i)] = own.sqrt();
                z[i] = (self.with_rest[*column] - (0..i).map(|k| l[(i, k)] * z[k]).sum::<f64>()) / l[(i, i)];
                sum += z[i] * z[i];
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::io::Cursor;

    use sagnac_log::ingest::{LogReader, ReadMode};
    use sagnac_log::setup::Setup;

    use super::*;
    use crate::fit::one_model::solution::fit;
    use crate::fit::problem::axis::Axis;
    use crate::fit::selection::criterion::needed_gain;
    use crate::fit::selection::search::grown;
    use crate::model::input::Signal;
    use crate::window::{WindowBuilder, Windows};

    /// The minimal standard generator of Park and Miller (1988).
    struct Random(u64);

    impl Random {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0 * 48_271 % 2_147_483_647;
            self.0 as f64 / 2_147_483_647.0
        }

        fn normal(&mut self) -> f64 {
            (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
        }
    }

    const ROWS: usize = 900;
    const INTERVAL_S: f64 = 20.0;

    /// What follows the rate of a quantity through a lag, per °C/min.
    fn lagged(values: &[f64], tau_s: f64) -> Vec<f64> {
        let alpha = -(-INTERVAL_S / tau_s).exp_m1();
        let mut lag = values[0];
        let step = |value: &f64| {
            let step = alpha * (value - lag);
            lag += step;
            60.0 * step / INTERVAL_S
        };
        values.iter().map(step).collect()
    }

    /// Two runs with a block and two columns. Each of seven effects is there in one record of two, from lost in the noise to plain.
    fn record(random: &mut Random) -> Windows {
        let mut strength = || if random.uniform() < 0.5 { 0.0 } else { 0.02 * 30.0_f64.powf(random.uniform()) };
        let [square, rate, slow, voltage, of_rate, cubic, second] = std::array::from_fn(|_| strength());
        let (tau_s, slow_s) = (20.0 * 60.0_f64.powf(random.uniform()), 3000.0);
        let logs = (0..2).map(|run| {
            let phase = 3.0 * random.uniform();
            let wave =
                |n: usize, period_s: f64| (std::f64::consts::TAU * n as f64 * INTERVAL_S / period_s + phase).sin();
            let block: Vec<f64> = (0..ROWS).map(|n| 25.0 + 40.0 * wave(n, 16_000.0) + 3.0 * wave(n, 2_900.0)).collect();
            let columns =
                [1_700.0, 5_100.0].map(|period_s| -> Vec<f64> { (0..ROWS).map(|n| 8.0 * wave(n, period_s)).collect() });
            let (fast, late, other) = (lagged(&block, tau_s), lagged(&block, slow_s), lagged(&columns[0], tau_s));
            let mut csv = String::from("time_s,temperature_c,counts,aux_v0,aux_v1\n");
            for n in 0..ROWS {
                let (x, v, w) = ((block[n] - 25.0) / 40.0, columns[0][n] / 8.0, columns[1][n] / 8.0);
                let dph = 10.0 + square * x * x + cubic * x * x * x + rate * fast[n] + slow * late[n];
                let dph = dph + voltage * v + of_rate * other[n] + second * w * w + 0.3 * random.normal();
                let counts = (dph * INTERVAL_S * 1000.0).round();
                let time_s = (run * 100_000) as f64 + (n + 1) as f64 * INTERVAL_S;
                writeln!(csv, "{time_s},{:.4},{counts},{:.4},{:.4}", block[n], columns[0][n], columns[1][n]).unwrap();
            }
            csv
        });
        let setup = Setup { arcsec_per_count: Some(0.001), ..Setup::default() };
        let open = |csv: String| {
            LogReader::from_reader("made.csv", Box::new(Cursor::new(csv.into_bytes())), &setup, ReadMode::Bulk).unwrap()
        };
        WindowBuilder::read_all(logs.map(open).collect::<Vec<_>>(), &setup).unwrap().finish()
    }

    /// No model whose residual falls as far as the search asks is refused by its bound; most of the others are.
    #[test]
    fn no_model_that_gains_enough_is_screened_out() {
        let mut random = Random(20_261_123);
        let (mut passed, mut useless, mut screened) = (0, 0, 0);
        for _ in 0..40 {
            let windows = record(&mut random);
            let signals = [Signal::Thermometer(0), Signal::Column(0), Signal::Column(1)];
            let problem = LeastSquares::new(&Axis::at_rest(&windows), &signals).unwrap();
            let taus_s = problem.tau_grid();
            // Beside a lag, which may go elsewhere, nothing is refused unfitted.
            assert!(Screen::new(&problem, &"bias 2, rate 0".parse().unwrap(), &taus_s).is_none());
            for from in ["bias 0", "bias 2", "bias 3, bias(v0) 1"] {
                let fitted = fit(&problem, &from.parse().unwrap(), &taus_s).unwrap();
                let misfit = fitted.misfit(&problem);
                let screen = Screen::new(&problem, &fitted.spec, &taus_s).unwrap();
                let all = grown(&problem, &fitted.spec);
                for spec in &all {
                    let Ok(there) = fit(&problem, spec, &taus_s) else { continue };
                    let needed = needed_gain(problem.len() as f64, 1, all.len());
                    let least = screen.bound(spec).unwrap().least_misfit;
                    let is_screened = least * needed.sqrt() >= misfit;
                    let gains = there.misfit(&problem) * needed < misfit;
                    assert!(!(gains && is_screened), "{from} → {spec}: {misfit} → {}, {least}", there.misfit(&problem));
                    passed += usize::from(gains);
                    useless += usize::from(!gains);
                    screened += usize::from(is_screened);
                }
            }
        }
        assert!(
            passed > 150 && 10 * screened > 7 * useless,
            "{passed} gain, {screened} of {useless} others are screened out"
        );
    }
}
