//! The result of `survey` for a log, checked against `calibrate` and against faults that were put in, over hundreds of logs of a generator of its own.

use std::fmt::Write as _;

use sagnac::survey::{GoodFor, Survey, survey};
use sagnac::window::{WindowBuilder, Windows};
use sagnac::{ErrorKind, Model, Setup};
use sagnac_log::ingest::{LogReader, ReadMode};

/// A small generator: the tests share no random numbers with the program.
struct Dice(u64);

impl Dice {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + self.unit() * (hi - lo)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    /// Twelve uniform numbers: σ 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// One test in a chamber.
#[derive(Clone, Debug)]
struct Test {
    rows: usize,
    interval_s: f64,
    lo_c: f64,
    hi_c: f64,
    /// Ramps: up, down, up …
    legs: usize,
    soak_s: f64,
    lags_s: Vec<f64>,
    noise_c: f64,
    step_c: f64,
    slope_dph_per_c: f64,
}

impl Test {
    fn random(dice: &mut Dice) -> Self {
        let thermometers = 1 + dice.below(3);
        let lo_c = dice.between(-50.0, 30.0);
        Self {
            rows: 600 + dice.below(2500),
            interval_s: [1.0, 5.0, 10.0][dice.below(3)],
            lo_c,
            hi_c: lo_c + dice.between(15.0, 90.0),
            legs: 1 + dice.below(5),
            soak_s: dice.between(0.0, 4000.0),
            lags_s: (0..thermometers).map(|_| dice.between(10.0, 1500.0)).collect(),
            noise_c: 10_f64.powf(dice.between(-3.5, -1.5)),
            step_c: [0.0625, 0.01, 0.001][dice.below(3)],
            slope_dph_per_c: dice.between(-0.05, 0.05),
        }
    }

    /// Temperatures of the chamber, row by row: soak, ramp, soak, …
    fn chamber(&self) -> Vec<f64> {
        let whole_s = self.rows as f64 * self.interval_s;
        let leg_s =
            ((whole_s - self.soak_s * (self.legs + 1) as f64) / self.legs as f64).max(whole_s / 2.0 / self.legs as f64);
        let soak_s = (whole_s - leg_s * self.legs as f64) / (self.legs + 1) as f64;
        let at = |t: f64| {
            let period = soak_s + leg_s;
            let leg = ((t / period) as usize).min(self.legs);
            let within = ((t - leg as f64 * period - soak_s) / leg_s).clamp(0.0, 1.0);
            let (from, to) = if leg.is_multiple_of(2) { (self.lo_c, self.hi_c) } else { (self.hi_c, self.lo_c) };
            if leg == self.legs { from } else { from + (to - from) * within }
        };
        (0..self.rows).map(|row| at(row as f64 * self.interval_s)).collect()
    }

    /// Readings of each thermometer, then the log; `spoil` may change the readings.
    fn log(&self, dice: &mut Dice, spoil: impl Fn(&mut Vec<Vec<f64>>)) -> String {
        let chamber = self.chamber();
        let mut readings: Vec<Vec<f64>> = Vec::new();
        for lag_s in &self.lags_s {
            let (mut held, alpha) = (chamber[0], 1.0 - (-self.interval_s / lag_s).exp());
            let follow = chamber.iter().map(|c| {
                held += alpha * (c - held);
                ((held + self.noise_c * dice.normal()) / self.step_c).round() * self.step_c
            });
            readings.push(follow.collect());
        }
        spoil(&mut readings);
        let names: Vec<String> =
            (0..readings.len()).map(|i| format!("temperature_c_{}", ["block", "cavity", "case"][i])).collect();
        let mut text = format!("time_s,counts,{}\n", names.join(","));
        let (scale, mut carried) = (1.0, 0.0);
        for row in 0..self.rows {
            let dph = 10.0 + self.slope_dph_per_c * readings[0][row];
            let arcsec = (dph + 0.3 * dice.normal() / self.interval_s.sqrt()) * self.interval_s + carried;
            let counts = (arcsec / scale).floor();
            carried = arcsec - counts * scale;
            write!(text, "{},{counts}", (row + 1) as f64 * self.interval_s).unwrap();
            readings.iter().for_each(|one| write!(text, ",{:.4}", one[row]).unwrap());
            text.push('\n');
        }
        text
    }
}

fn windows_of(text: &str, setup: &Setup) -> Windows {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, text).unwrap();
    let log = LogReader::open(&path, setup, ReadMode::Bulk).unwrap();
    WindowBuilder::read_all(vec![log], setup).unwrap().finish()
}

fn setup() -> Setup {
    Setup::parse("arcsec_per_count = 1.0\n").unwrap()
}

fn surveyed(text: &str) -> (Survey, Windows) {
    let windows = windows_of(text, &setup());
    (survey(&windows, &setup()).unwrap(), windows)
}

/// 200 healthy tests: `good for calibration` exactly where `calibrate` makes one, and no thermometer is named.
#[test]
fn healthy_tests_are_good_where_calibrate_makes_a_calibration() {
    let mut dice = Dice(11);
    let (mut good, mut refused) = (0, 0);
    for at in 0..200 {
        let mut test = Test::random(&mut dice);
        if at % 4 == 0 {
            // A chamber that hardly moves.
            test.hi_c = test.lo_c + dice.between(0.0, 2.0);
        }
        let (found, windows) = surveyed(&test.log(&mut dice, |_| {}));
        let middle = f64::midpoint(found.thermometers[0].min_c.unwrap(), found.thermometers[0].max_c.unwrap());
        let setup = Setup { reference_c: Some(middle), ..setup() };
        let made = sagnac::fit::calibrate(windows, &setup, &sagnac::fit::FitOptions::new(Model::Auto));
        let makes = match &made {
            Ok(_) => true,
            Err(error) => {
                assert_eq!(error.kind, ErrorKind::Refused, "{error}");
                false
            }
        };
        assert_eq!(found.good_for == GoodFor::Calibration, makes, "{test:?}\n{found:?}\n{:?}", made.err());
        assert!(found.thermometers.iter().all(|t| t.faults.is_empty()), "{test:?}\n{found:?}");
        (good, refused) = (good + u32::from(makes), refused + u32::from(!makes));
    }
    assert!(good > 100 && refused > 30, "{good} {refused}");
}

/// 100 tests at one temperature with a wrong stretch of 20 °C: single readings are no span, and some minutes are named.
#[test]
fn a_wrong_stretch_is_no_span() {
    let mut dice = Dice(5);
    for case in 0..100_u32 {
        let mut test = Test { noise_c: 0.001, interval_s: 5.0, rows: 3000, ..Test::random(&mut dice) };
        test.hi_c = test.lo_c + 0.5;
        let at = 200 + dice.below(test.rows - 400);
        let rows = if case.is_multiple_of(2) { 1 + dice.below(3) } else { 20 + dice.below(60) };
        let spoil = |readings: &mut Vec<Vec<f64>>| readings[0][at..at + rows].iter_mut().for_each(|c| *c += 20.0);
        let (found, _) = surveyed(&test.log(&mut dice, spoil));
        let named = found.cautions.iter().any(|caution| caution.contains("third of the span"));
        assert!(found.good_for != GoodFor::Calibration || named, "{rows} rows: {found:?}");
    }
}

/// 100 tests in which one of two thermometers stops: it is named in at least 95, and the other one never.
#[test]
fn a_thermometer_that_stops_beside_another_is_named() {
    let mut dice = Dice(7);
    let mut named = 0;
    for _ in 0..100 {
        let lo_c = dice.between(-40.0, 0.0);
        let test = Test {
            lags_s: vec![dice.between(100.0, 900.0), dice.between(100.0, 900.0)],
            hi_c: lo_c + dice.between(50.0, 90.0),
            lo_c,
            rows: 4000,
            interval_s: 5.0,
            legs: 2 + dice.below(3),
            ..Test::random(&mut dice)
        };
        // It stops at a plausible value, and keeps its noise: in the first ramp.
        let from = 300 + dice.below(500);
        let (stuck, noise_c) = (dice.below(2), 0.01);
        let mut own = Dice(1 + dice.below(1 << 40) as u64);
        let noise: Vec<f64> = (0..test.rows).map(|_| noise_c * own.normal()).collect();
        let (found, _) = surveyed(&test.log(&mut dice, |readings| {
            let value = readings[stuck][from];
            for row in from..readings[stuck].len() {
                readings[stuck][row] = value + noise[row];
            }
        }));
        let still = |t: usize| found.thermometers[t].faults.iter().any(|fault| fault.contains("is stuck at"));
        named += u32::from(still(stuck));
        assert!(!still(1 - stuck), "{found:?}");
    }
    assert!(named >= 95, "{named} of 100");
}

/// 100 tests with one thermometer whose noise exceeds its resolution: frozen for an hour it is named, in every one.
#[test]
fn a_lone_thermometer_that_loses_its_noise_is_named() {
    let mut dice = Dice(9);
    for _ in 0..100 {
        let test = Test {
            noise_c: dice.between(0.01, 0.05),
            step_c: 0.01,
            lags_s: vec![dice.between(10.0, 900.0)],
            rows: 4000,
            interval_s: 5.0,
            ..Test::random(&mut dice)
        };
        let from = dice.below(test.rows - 800);
        let frozen = |readings: &mut Vec<Vec<f64>>| {
            let value = readings[0][from];
            readings[0][from..from + 720].fill(value);
        };
        let (found, _) = surveyed(&test.log(&mut dice, frozen));
        assert!(found.thermometers[0].faults.iter().any(|fault| fault.contains("is stuck at")), "{test:?}\n{found:?}");
    }
}

/// What no fit and no noise term can use.
#[test]
fn short_and_silent_logs_are_good_for_nothing() {
    let rows = |n: usize, counts: fn(usize) -> usize| {
        let lines = (1..=n).map(|row| format!("{row},{},20.0\n", counts(row)));
        format!("time_s,counts,temperature_c\n{}", lines.collect::<String>())
    };
    for text in [rows(50, |row| 100 + row * 7919 % 13), rows(5000, |_| 0), rows(5000, |_| 100)] {
        let (found, _) = surveyed(&text);
        assert_eq!(found.good_for, GoodFor::Nothing, "{found:?}");
        assert!(found.reason.is_some());
    }
    let (found, _) = surveyed(&rows(5000, |row| 100 + row * row % 7919 * row % 13));
    assert_eq!(found.good_for, GoodFor::Noise, "{found:?}");
    assert!(found.axes[0].arw_deg_rt_h.is_some());
}

/// What a profile lacks is said: one that only heats, one without a soak, and limits that need what the log has not.
#[test]
fn what_a_profile_lacks_is_said() {
    let whole = Test {
        rows: 6000,
        interval_s: 5.0,
        lo_c: -40.0,
        hi_c: 60.0,
        legs: 2,
        soak_s: 3000.0,
        lags_s: vec![300.0],
        noise_c: 0.005,
        step_c: 0.001,
        slope_dph_per_c: 0.02,
    };
    let mut dice = Dice(3);
    let cautions = |test: &Test, dice: &mut Dice| surveyed(&test.log(dice, |_| {})).0.cautions.join("\n");
    assert_eq!(cautions(&whole, &mut dice), "");
    let [slope, sigma] = surveyed(&whole.log(&mut dice, |_| {})).0.axes[0].slope_dph_per_c.unwrap();
    assert!(
        (slope - whole.slope_dph_per_c).abs() < 5.0 * sigma && sigma < 0.1 * whole.slope_dph_per_c,
        "{slope} ± {sigma}"
    );
    let heats = Test { legs: 1, ..whole.clone() };
    assert!(cautions(&heats, &mut dice).contains("never cools"));
    let ramps = Test { soak_s: 0.0, ..whole.clone() };
    assert!(cautions(&ramps, &mut dice).contains("no soak"));
    let few = Test { rows: 180, interval_s: 10.0, soak_s: 300.0, hi_c: -22.0, ..whole.clone() };
    let said = surveyed(&few.log(&mut dice, |_| {})).0;
    assert!(said.cautions.iter().any(|caution| caution.contains("coefficients")), "{said:?}");
    let keys = |test: &Test, dice: &mut Dice| {
        let found = surveyed(&test.log(dice, |_| {})).0;
        let all = found.axes[0].unanswered.clone().unwrap();
        all.into_iter().flat_map(|one| one.limits).collect::<Vec<_>>()
    };
    let (with_both, with_one) = (keys(&whole, &mut dice), keys(&heats, &mut dice));
    assert!(!with_both.contains(&"hysteresis_dph_max") && with_one.contains(&"hysteresis_dph_max"));
    assert!(with_both.contains(&"scale_factor_ppm_max") && !with_both.contains(&"plateau_sigma_dph_max"));
    assert!(keys(&ramps, &mut dice).contains(&"plateau_sigma_dph_max"));
}
