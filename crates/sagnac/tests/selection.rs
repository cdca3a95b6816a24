//! Why `auto` takes orders one by one, and zones apart: the selection alone, on exact estimates. `docs/explanation/evidence.md` quotes these.

use crate::hostile;
use crate::hostile::curves::AT_C;
use crate::hostile::{Bench, Dice, WHITE_100_S_DPH};
use nalgebra::{DMatrix, DVector};

/// Temperatures of a nominal run's windows of 100 s, scaled to −1 … 1: the block of [`Bench`] behind its lag.
fn u_of_windows() -> Vec<f64> {
    let bench = Bench { cycles: 1, row_s: 20.0, ..Bench::new(1, &hostile::none) };
    let mut u = Vec::new();
    bench.run(|_, now, _| u.push(now.u()));
    u.chunks(5).map(|window| window.iter().sum::<f64>() / 5.0).collect()
}

/// Orders 1 to 3 of a curve as independent estimates in units of their σ: the true ones of `powers`, and what they make of the curve at
/// the temperatures of the study, °/h.
fn independent_orders(runs: usize, powers: [f64; 3]) -> (DVector<f64>, DMatrix<f64>) {
    let u = u_of_windows();
    let column = |order: i32| {
        let mean = u.iter().map(|u| u.powi(order)).sum::<f64>() / u.len() as f64;
        u.iter().map(move |u| u.powi(order) - mean).collect::<Vec<_>>()
    };
    let root = (runs as f64).sqrt();
    let columns = DMatrix::from_iterator(u.len(), 3, (1..=3).flat_map(column)) * root;
    let r = columns.qr().unpack_r();
    let at = |celsius: f64, order: i32| ((celsius - 15.0) / 55.0).powi(order) - (10.0_f64 / 55.0).powi(order);
    let curve = DMatrix::from_fn(AT_C.len(), 3, |i, j| at(AT_C[i], j as i32 + 1));
    let true_orders = &r * DVector::from_row_slice(&powers) / WHITE_100_S_DPH;
    (true_orders, curve * r.try_inverse().unwrap() * WHITE_100_S_DPH)
}

/// A selection of the orders 2 and 3 of three estimates: how many are kept next to the first.
type Selects = fn([f64; 3]) -> usize;

fn one_by_one([_, second, third]: [f64; 3]) -> usize {
    let grades = [second * second + third * third, third * third + 5.0, 10.0];
    (0..3).min_by(|a, b| grades[*a].total_cmp(&grades[*b])).unwrap()
}

fn in_pairs([_, second, third]: [f64; 3]) -> usize {
    if second * second + third * third > 6.5 { 2 } else { 0 }
}

/// Error of the curve over that of the true orders alone, and how often there is an order too many.
fn of_selection(runs: usize, powers: [f64; 3], selects: Selects) -> (f64, f64) {
    let (truth, curve) = independent_orders(runs, powers);
    let needed = powers.iter().rposition(|power| *power != 0.0).unwrap();
    let mut dice = Dice::new(5);
    let (mut found, mut best, mut useless) = (0.0, 0.0, 0.0);
    const DRAWS: usize = 100_000;
    for _ in 0..DRAWS {
        let drawn: [f64; 3] = std::array::from_fn(|order| truth[order] + dice.normal());
        let kept = selects(drawn);
        useless += f64::from(u8::from(kept > needed)) / DRAWS as f64;
        for (square, count) in [(&mut found, kept), (&mut best, needed)] {
            let error = DVector::from_fn(3, |i, _| if i <= count { drawn[i] } else { 0.0 } - truth[i]);
            *square += (&curve * error).norm_squared();
        }
    }
    ((found / best).sqrt(), useless)
}

/// Why `auto` takes orders one by one, although the second and third together would hold the error of a weak cubic within 1.15: a curve of
/// first or second order would pay for it. The selection alone, on exact estimates; `docs/explanation/evidence.md` quotes these.
#[test]
fn orders_in_pairs_hold_a_cubic_and_lose_the_others() {
    let (linear, quadratic, cubic) = ([0.02, 0.0, 0.0], [0.02, -0.008, 0.0], [0.02, -0.008, 0.01]);
    let expected = [
        (1, linear, [(1.24, 0.03), (1.38, 0.04)]),
        (1, quadratic, [(1.56, 0.02), (1.80, 0.62)]),
        (1, cubic, [(1.38, 0.0), (1.15, 0.0)]),
        (2, linear, [(1.24, 0.03), (1.38, 0.04)]),
        (2, quadratic, [(1.27, 0.02), (1.60, 0.91)]),
        (2, cubic, [(1.43, 0.0), (1.03, 0.0)]),
        (4, quadratic, [(1.09, 0.03), (1.41, 1.0)]),
        (4, cubic, [(1.32, 0.0), (1.00, 0.0)]),
    ];
    for (runs, powers, both) in expected {
        let measured = [one_by_one as Selects, in_pairs].map(|selects| of_selection(runs, powers, selects));
        println!("{runs} runs, {powers:?}: {measured:.3?}");
        for ((error, useless), (ratio, part)) in measured.into_iter().zip(both) {
            assert!(
                (error - ratio).abs() < 0.02 && (useless - part).abs() < 0.01,
                "{runs} runs, {powers:?}: {error}, {useless}"
            );
        }
    }
}

/// A series with zones next to it on exact windows: its columns orthonormal, and what their estimates make of the curve.
struct Exact {
    q: DMatrix<f64>,
    curve: DMatrix<f64>,
}

impl Exact {
    fn new(runs: usize, [orders, zones]: [usize; 2]) -> Self {
        let u = u_of_windows();
        let value = |u: f64, at: usize| {
            let knot = |k: usize| 2.0 * k as f64 / zones as f64 - 1.0;
            if at < orders { u.powi(at as i32 + 1) } else { (u - knot(at - orders + 1)).max(0.0).powi(2) }
        };
        let count = orders + zones.max(1) - 1;
        let mut columns = DMatrix::from_fn(u.len(), count, |i, at| value(u[i], at)) * (runs as f64).sqrt();
        columns.column_iter_mut().for_each(|mut column| column.add_scalar_mut(-column.mean()));
        let scaled = |celsius: f64| (celsius - 15.0) / 55.0;
        let at = |celsius: f64, at: usize| value(scaled(celsius), at) - value(scaled(25.0), at);
        let curve = DMatrix::from_fn(AT_C.len(), count, |i, j| at(AT_C[i], j));
        let (q, r) = columns.qr().unpack();
        Self { curve: curve * r.try_inverse().unwrap(), q }
    }

    /// What it explains of some rows, in squares of σ, at a price; and its curve, °/h.
    fn of(&self, rows: &DVector<f64>, price: f64) -> (f64, DVector<f64>) {
        let estimates = self.q.transpose() * rows;
        (estimates.norm_squared() - price * self.q.ncols() as f64, &self.curve * estimates * WHITE_100_S_DPH)
    }
}

/// Error of the curve over that of the true model, and how often zones are selected, where series and zones are graded together and
/// zones must be better by a handicap; no rate term is tried.
fn with_handicap(runs: usize, truth: fn(f64) -> f64, true_model: [usize; 2], handicap: f64) -> (f64, f64) {
    let u = u_of_windows();
    let price = ((runs * u.len()) as f64).ln() - 2.0;
    let series: Vec<Exact> = (1..=8).map(|orders| Exact::new(runs, [orders, 0])).collect();
    let zoned = [2, 3, 4, 6].into_iter().flat_map(|zones| [1, 2, 3].map(|orders| Exact::new(runs, [orders, zones])));
    let zoned: Vec<Exact> = zoned.collect();
    let best = Exact::new(runs, true_model);
    let at = |celsius: f64| truth((celsius - 15.0) / 55.0) - truth(10.0 / 55.0);
    let expected = DVector::from_iterator(AT_C.len(), AT_C.iter().map(|celsius| at(*celsius)));
    let drift = DVector::from_iterator(u.len(), u.iter().map(|u| truth(*u))) * ((runs as f64).sqrt() / WHITE_100_S_DPH);
    let mut dice = Dice::new(6);
    let (mut found, mut least, mut zones) = (0.0, 0.0, 0.0);
    const DRAWS: usize = 400;
    for _ in 0..DRAWS {
        let mut rows = &drift + DVector::from_fn(u.len(), |_, _| dice.normal());
        rows.add_scalar_mut(-rows.mean());
        let best_of = |of: &[Exact]| {
            let all = of.iter().map(|model| model.of(&rows, price.max(5.0)));
            all.max_by(|(a, _), (b, _)| a.total_cmp(b)).unwrap()
        };
        let (one, other) = (best_of(&series), best_of(&zoned));
        let is_zoned = other.0 - handicap > one.0;
        zones += f64::from(u8::from(is_zoned)) / DRAWS as f64;
        found += (if is_zoned { other.1 } else { one.1 } - &expected).norm_squared();
        least += (best.of(&rows, 0.0).1 - &expected).norm_squared();
    }
    ((found / least).sqrt(), zones)
}

/// Runs, truth over u, the orders and zones of its model; error and how often, without zones and at the handicaps 0, 3 and 6.
type Case = (usize, fn(f64) -> f64, [usize; 2], [(f64, f64); 4]);

/// Why `auto` does not grade zones with the orders: what a curve with a knot gains, curves of an order lose, at every handicap. The selection
/// alone, on exact windows; `docs/explanation/evidence.md` quotes these.
#[test]
fn zones_among_the_orders_hold_a_knot_and_lose_the_others() {
    let knot = |u: f64| 0.03 * u + 0.05 * u.max(0.0).powi(2);
    let weak = |u: f64| 0.02 * u - 0.008 * u * u + 0.01 * u.powi(3);
    let expected: [Case; 6] = [
        (1, knot, [1, 2], [(1.90, 0.0), (1.33, 0.88), (1.59, 0.68), (1.89, 0.02)]),
        (16, knot, [1, 2], [(2.31, 0.0), (1.10, 0.99), (1.21, 0.92), (1.64, 0.65)]),
        (2, weak, [3, 0], [(1.44, 0.0), (1.56, 0.27), (1.46, 0.02), (1.44, 0.0)]),
        (4, weak, [3, 0], [(1.36, 0.0), (1.55, 0.34), (1.41, 0.02), (1.36, 0.0)]),
        (1, |u| 0.1 * u.powi(3), [3, 0], [(1.09, 0.0), (1.35, 0.15), (1.16, 0.04), (1.10, 0.0)]),
        (2, |u| 0.1 * u.powi(5), [5, 0], [(1.09, 0.0), (1.34, 0.60), (1.26, 0.30), (1.18, 0.09)]),
    ];
    for (runs, truth, true_model, of_handicap) in expected {
        let measured = [f64::INFINITY, 0.0, 3.0, 6.0].map(|handicap| with_handicap(runs, truth, true_model, handicap));
        println!("{runs} runs, {true_model:?}: {measured:.2?}");
        for ((error, zones), (ratio, part)) in measured.into_iter().zip(of_handicap) {
            let near = (error - ratio).abs() < 0.02 && (zones - part).abs() < 0.02;
            assert!(near, "{runs} runs, {true_model:?}: {error}, {zones}");
        }
    }
}
