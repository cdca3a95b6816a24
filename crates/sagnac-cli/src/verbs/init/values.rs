//! Units by the values of the columns, where neither name nor header states one.
//!
//! ```text
//! rates:  scatter of neighbouring rows × √(row interval) = angle random walk in each unit ─▶ the units in which a gyro has such a walk
//! ```
//!
//! All axes decide together: a triad has one unit. A gyro of any kind has between [`LEAST_WALK`] and [`MOST_WALK`] °/√h. A walk that is
//! possible in two units is decided by who writes such headers, else not at all.
//!
//! Fails where a gyro is better or worse than that, or where a filter took the scatter away: so each unit from values is marked as a guess.

use sagnac_log::setup::RateUnit;
use sagnac_units::format::significant;

/// Angle random walk of the best and of the worst gyros, °/√h: a navigation grade ring laser, a toy.
const LEAST_WALK: f64 = 1e-3;
const MOST_WALK: f64 = 5.0;
/// Units in which people write rates without saying so.
const UNITS: [RateUnit; 3] = [RateUnit::DegPerHour, RateUnit::DegPerSecond, RateUnit::RadPerSecond];
/// The median of the size of a normal value, by its σ.
const MEDIAN_OF_SIZE: f64 = 0.6745;

/// The unit of a triad.
#[derive(Debug, PartialEq)]
pub(super) enum TriadUnit {
    /// One, and why.
    One(RateUnit, String),
    /// Not known, and why.
    Open(String),
}

/// The unit of rates by the values of all axes. `usual` is the unit of those who write such headers.
pub(super) fn of_rates(axes: &[Vec<f64>], row_s: Option<f64>, usual: Option<RateUnit>) -> TriadUnit {
    let all = || axes.iter().flatten();
    if all().all(|rate| rate.fract() == 0.0) {
        return TriadUnit::Open("whole numbers may be codes of a converter".to_owned());
    }
    let mut walks: Vec<f64> = axes.iter().filter_map(|axis| scatter(axis)).collect();
    walks.sort_by(f64::total_cmp);
    let middle = walks.get(walks.len() / 2).copied().zip(row_s);
    let Some(walk) = middle.map(|(sigma, row_s)| sigma * (row_s / 3600.0).sqrt()).filter(|walk| *walk > 0.0) else {
        let why = "without a time, or without scatter, values show no unit".to_owned();
        return usual.map_or(TriadUnit::Open(why), by_usage);
    };
    let text = |unit: &RateUnit| format!("{} °/√h in {}", significant(walk * unit.dph_per_unit(), 2), unit.name());
    let is_possible = |unit: &RateUnit| (LEAST_WALK..=MOST_WALK).contains(&(walk * unit.dph_per_unit()));
    let possible: Vec<RateUnit> = UNITS.into_iter().filter(is_possible).collect();
    match (&possible[..], usual) {
        ([unit], _) => TriadUnit::One(*unit, format!("the unit, from an angle random walk of {}", text(unit))),
        ([], _) => TriadUnit::Open(format!("no gyro has an angle random walk of {}", each(&UNITS, text))),
        (some, Some(usual)) if some.contains(&usual) => by_usage(usual),
        (some, _) => TriadUnit::Open(format!("the angle random walk would be {}", each(some, text))),
    }
}

fn each(units: &[RateUnit], text: impl Fn(&RateUnit) -> String) -> String {
    units.iter().map(text).collect::<Vec<_>>().join(" or ")
}

fn by_usage(unit: RateUnit) -> TriadUnit {
    TriadUnit::One(unit, format!("the unit, as programs that write such headers have {}", unit.name()))
}

/// σ of the noise between neighbouring rows; of coarse steps the mean square, because most steps are none.
fn scatter(values: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    steps.sort_by(f64::total_cmp);
    let middle = steps.get(steps.len() / 2)? / MEDIAN_OF_SIZE;
    let mean_square = steps.iter().map(|step| step * step).sum::<f64>() / steps.len() as f64;
    Some(if middle > 0.0 { middle } else { mean_square.sqrt() } / 2_f64.sqrt())
}

/// The unit of a temperature, as the ending of its header; else why its values are none in °C or K.
pub(super) fn of_temperature(values: &[f64]) -> Result<&'static str, String> {
    let (lo, hi) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), value| (lo.min(*value), hi.max(*value)));
    let is_whole = values.iter().all(|value| value.fract() == 0.0);
    let within = |least: f64, most: f64| values.is_empty() || lo >= least && hi <= most;
    // Whole numbers of a hundred and more are tenths of a degree as well.
    if within(-90.0, if is_whole { 90.0 } else { 150.0 }) {
        Ok("c")
    } else if !is_whole && within(180.0, 430.0) {
        Ok("k")
    } else if lo < -273.15 {
        Err(format!("{lo} … {hi} is below absolute zero, so it holds codes of a converter"))
    } else {
        Err(format!("{lo} … {hi} may be tenths of a degree or codes of a converter"))
    }
}

/// Whether a column of a name that says little is a time: it rises, or rises and begins again with a second run.
pub(super) fn is_clock(values: &[f64]) -> bool {
    let steps = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let Some(first) = values.first().filter(|_| values.len() > 1) else { return false };
    let longest = steps().fold(0.0, f64::max);
    let begins_again = values.windows(2).filter(|pair| pair[1] <= pair[0]).all(|pair| pair[1] <= first + longest);
    let falls = steps().filter(|step| *step <= 0.0).count();
    begins_again && 4 * falls < values.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of 0 to 1, and normal ones.
    struct Random(u64);

    impl Random {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
        }

        /// Between two numbers, even in its logarithm.
        fn between(&mut self, lo: f64, hi: f64) -> f64 {
            lo * (hi / lo).powf(self.uniform())
        }
    }

    /// Three axes of a gyro of some angle random walk, °/√h, with biases, °/h, in a unit and with so many digits.
    fn triad(random: &mut Random, unit: RateUnit, [walk, bias]: [f64; 2], row_s: f64) -> Vec<Vec<f64>> {
        let sigma = walk * (3600.0 / row_s).sqrt();
        let axis = |_| {
            let mean = bias * random.normal();
            // Whole numbers have a test of their own.
            let digits = 10_f64.powf((unit.of_dph(sigma) / 30.0).log10().floor()).min(0.1);
            (0..1000).map(|_| (unit.of_dph(mean + sigma * random.normal()) / digits).round() * digits).collect()
        };
        (0..3).map(axis).collect()
    }

    /// Gyros of each grade in the units that such are logged in: never a wrong unit, and mostly the right one.
    #[test]
    fn a_triad_has_its_own_unit_or_none() {
        // The unit, least and most walk, °/√h, the bias, °/h, and the part of them that is decided.
        let grades = [
            (RateUnit::DegPerSecond, [0.1, 2.0], 5000.0, 1.0),
            (RateUnit::DegPerHour, [0.002, 0.5], 20.0, 1.0),
            (RateUnit::RadPerSecond, [0.1, 2.0], 5000.0, 0.0),
        ];
        for (unit, [lo, hi], bias, least) in grades {
            let (mut right, mut named) = (0, 0);
            for seed in 1..=90 {
                let mut random = Random(seed * 7919);
                let (walk, row_s) = (random.between(lo, hi), random.between(0.0025, 1.0));
                let axes = triad(&mut random, unit, [walk, bias], row_s);
                match of_rates(&axes, Some(row_s), None) {
                    TriadUnit::One(found, _) => {
                        assert_eq!(found, unit, "{walk} °/√h, rows of {row_s} s");
                        right += 1;
                    }
                    TriadUnit::Open(why) => assert!(why.contains(unit.name()), "{why}"),
                }
                let by_name = of_rates(&axes, Some(row_s), Some(unit));
                named += i32::from(matches!(by_name, TriadUnit::One(found, _) if found == unit));
            }
            assert!(f64::from(right) >= 90.0 * least && named == 90, "{unit}: {right} and {named} of 90");
        }
    }

    /// Codes, rates without noise or time, and values of no gyro have no unit; a dead axis does not matter.
    #[test]
    fn what_shows_no_unit_has_none() {
        let mut random = Random(5);
        let is_open = |axes: &[Vec<f64>], row_s| matches!(of_rates(axes, row_s, None), TriadUnit::Open(_));
        for _ in 0..60 {
            let raw: Vec<f64> = (0..500).map(|_| (40.0 * random.normal()).round()).collect();
            assert!(is_open(&[raw], Some(0.01)));
            let mut axes = triad(&mut random, RateUnit::DegPerSecond, [0.3, 3000.0], 0.01);
            assert!(is_open(&axes, None));
            axes[1] = vec![0.0; 1000];
            assert!(matches!(of_rates(&axes, Some(0.01), None), TriadUnit::One(RateUnit::DegPerSecond, _)));
            let loud: Vec<f64> = axes[0].iter().map(|rate| rate * 1e5).collect();
            assert!(is_open(&[loud], Some(0.01)));
        }
        assert!(is_open(&[vec![0.5; 100]], Some(1.0)) && is_open(&[], None) && is_open(&[vec![]], Some(1.0)));
    }

    #[test]
    fn a_temperature_is_above_absolute_zero_and_not_in_tenths() {
        for seed in 1..=90 {
            let mut random = Random(seed * 104_729);
            let start = -40.0 + 100.0 * random.uniform();
            let celsius: Vec<f64> = (0..1000).map(|at| start + 0.02 * f64::from(at) + 0.05 * random.normal()).collect();
            let scaled = |scale: f64, zero: f64, digits: f64| -> Vec<f64> {
                celsius.iter().map(|celsius| ((celsius * scale + zero) / digits).round() * digits).collect()
            };
            assert_eq!(of_temperature(&scaled(1.0, 0.0, 0.01)), Ok("c"));
            assert_eq!(of_temperature(&scaled(1.0, 273.15, 0.01)), Ok("k"));
            // Codes of an MPU6050, and tenths: over 20 K they leave the range of whole degrees.
            assert!(of_temperature(&scaled(340.0, -12_420.0, 1.0)).is_err(), "{start}");
            assert!(of_temperature(&scaled(10.0, 0.0, 1.0)).is_err(), "{start}");
        }
        assert_eq!(of_temperature(&[-40.0, -39.0, 85.0]), Ok("c"));
        assert!(of_temperature(&[250.0, 400.0]).unwrap_err().contains("tenths"));
        assert!(of_temperature(&[-3920.0, -3900.0]).unwrap_err().contains("below absolute zero"));
    }

    #[test]
    fn a_time_may_begin_again_and_a_temperature_is_none() {
        for seed in 1..=60 {
            let mut random = Random(seed * 15_485_863);
            let step = random.between(0.001, 10.0);
            let once = |runs: usize| -> Vec<f64> {
                (0..runs).flat_map(|_| (0..300).map(|row| f64::from(row) * step)).collect()
            };
            assert!(is_clock(&once(1)) && is_clock(&once(2)) && is_clock(&once(3)));
            let warm: Vec<f64> = (0..600).map(|at| 20.0 + 0.01 * f64::from(at) + 0.02 * random.normal()).collect();
            assert!(!is_clock(&warm));
        }
        assert!(!is_clock(&[]) && !is_clock(&[1.0]) && !is_clock(&[1.0; 20]));
    }
}
