//! Fleets of lots with heavy tails, and what they say of the next unit.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use sagnac::fit::UnitPrior;
use sagnac::fleet::{FleetWork, Prior, PriorFile, Recipe, Unit, calibrate, results_in};

use super::{Bench, Dice, Now};
use crate::support::rows::Rows;

/// A gyro: coefficients of u, u², u³ and of Ṫ, Ṫ·u, °/h and °/h per °C/min, and the lag of Ṫ, s.
#[derive(Clone, Copy)]
pub(crate) struct Gyro {
    pub(crate) curve: [f64; 3],
    pub(crate) rate: [f64; 2],
    pub(crate) lag_s: f64,
}

pub(crate) const MODEL: &str = "bias 3, rate 1";
/// Mean of all, scatter of lots, and of units within their lot.
pub(crate) const MEAN: [f64; 6] = [0.25, -0.08, 0.04, 0.12, 0.02, 600.0];
pub(crate) const OF_LOTS: [f64; 6] = [0.04, 0.02, 0.01, 0.02, 0.005, 20.0];
pub(crate) const OF_UNITS: [f64; 6] = [0.06, 0.03, 0.02, 0.03, 0.01, 40.0];

/// Student's t of five degrees at unit variance: heavy tails.
pub(crate) fn heavy(dice: &mut Dice) -> f64 {
    let chi: f64 = (0..5).map(|_| dice.normal().powi(2)).sum();
    dice.normal() / (chi / 5.0).sqrt() * 0.6_f64.sqrt()
}

pub(crate) fn lot(dice: &mut Dice) -> [f64; 6] {
    std::array::from_fn(|k| MEAN[k] + OF_LOTS[k] * dice.normal())
}

pub(crate) fn gyro(of: [f64; 6], dice: &mut Dice) -> Gyro {
    let [a, b, c, r, s, lag_s] = std::array::from_fn(|k| of[k] + OF_UNITS[k] * heavy(dice));
    Gyro { curve: [a, b, c], rate: [r, s], lag_s: lag_s.max(60.0) }
}

impl Gyro {
    pub(crate) fn curve(self, celsius: f64) -> f64 {
        let u = (celsius - 15.0) / 55.0;
        self.curve[0] * u + self.curve[1] * u * u + self.curve[2] * u * u * u
    }

    pub(crate) fn drift(self, now: Now) -> f64 {
        self.curve(now.celsius) + (self.rate[0] + self.rate[1] * now.u()) * now.lagged_cpm
    }

    pub(crate) fn log(self, seed: u64, change: impl Fn(&mut Bench<'_>)) -> Rows<3> {
        let drift = |now: Now| self.drift(now);
        let mut bench = Bench::new(seed, &drift);
        (bench.rate_lag_s, bench.row_s) = (self.lag_s, 20.0);
        change(&mut bench);
        bench.log()
    }
}

/// A fleet of known lots, and what it says of the next unit.
pub(crate) struct Fleet {
    pub(crate) lots: Vec<[f64; 6]>,
    pub(crate) prior: PriorFile,
}

impl Fleet {
    /// Made by the full test of 22 units of each of three lots, or of 8 of each of twelve.
    pub(crate) fn new(seed: u64, lots: usize, noise: fn(&mut Bench<'_>)) -> Self {
        Self::of(seed, lots, noise, gyro)
    }

    /// Three lots whose units scatter by so much in the third order.
    pub(crate) fn alike_in_third(seed: u64, sigma: f64) -> Self {
        let alike = move |of: [f64; 6], dice: &mut Dice| {
            let mut one = gyro(of, dice);
            one.curve[2] = of[2] + sigma * heavy(dice);
            one
        };
        Self::of(seed, 3, |_| (), alike)
    }

    fn of(seed: u64, lots: usize, noise: fn(&mut Bench<'_>), next: impl Fn([f64; 6], &mut Dice) -> Gyro) -> Self {
        let mut dice = Dice::new(seed);
        let units = if lots < 10 { 22 } else { 8 };
        let lots: Vec<[f64; 6]> = (0..lots).map(|_| lot(&mut dice)).collect();
        // Several tests make the same fleet at a time.
        static FOLDERS: AtomicUsize = AtomicUsize::new(0);
        let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("sagnac-prior-{}-{number}", std::process::id()));
        let gyros: Vec<Gyro> = (0..units * lots.len()).map(|at| next(lots[at % lots.len()], &mut dice)).collect();
        std::fs::create_dir_all(&folder).unwrap();
        let unit = |(at, gyro): (usize, &Gyro)| {
            let path = folder.join(format!("{at}.csv"));
            std::fs::write(&path, gyro.log(seed * 10_000 + at as u64, noise).csv()).unwrap();
            let mut unit = Unit::default();
            (unit.name, unit.lot, unit.runs) = (format!("RLG-{at}"), format!("lot {}", at % lots.len()), vec![path]);
            unit
        };
        let units: Vec<Unit> = gyros.par_iter().enumerate().map(unit).collect();
        let recipe = Recipe::new(Bench::setup(), MODEL.parse().unwrap());
        let work = FleetWork { recipe: &recipe, threads: 2, again: false };
        calibrate(&units, &work, &folder, &|_| ()).unwrap();
        let prior = Prior::learned(&results_in(&folder).unwrap(), None).unwrap();
        let path = folder.join("fleet.prior.json");
        std::fs::write(&path, prior.to_json().unwrap()).unwrap();
        let prior = PriorFile::read(&path).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        Self { lots, prior }
    }

    pub(crate) fn of_lot(&self) -> UnitPrior {
        self.prior.of_unit(Some("lot 1")).unwrap()
    }
}
