//! A stated flight: what the drift that was proven leaves of it.
//!
//! ```text
//! windows of the proof ─▶ b(T, Ṫ) = a₀ + Σ aₖTₖ(x) + c₀Ṫ + c₁ẋ·Ṫ (least squares, covariance) ─▶ b(T(t), Ṫ(t)) ─▶ strapdown ─▶ m
//! ```
//!
//! once of the raw windows and once of the corrected ones. Position is linear in the coefficients, so its σ follows from
//! their covariance: a position error within two of its σ is none that the proof can show. a₀ is the bias against that of the
//! calibration, which the navigator subtracts: the navigator does not know the mean of a retest. With a gyrocompass
//! alignment b counts from the drift at take-off, which is a heading error ε/(Ω·cos φ) instead. Never made of a peak to
//! peak, and never of noise: what angle random walk makes is reported next to it.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::diagnostics::WindowPoint;
use crate::model::{Span, chebyshev};
use crate::verify::flight::strapdown::{Channel, noise_m, positions_m};
use crate::verify::values::judged_windows::Estimate;
use crate::verify::values::repeatability::BiasRepeatability;
use sagnac_log::error::{Error, Result};
use sagnac_units::EARTH_RATE_DPH;

/// Order of the residual in T.
const ORDER: usize = 4;
/// Its columns: ORDER + 1 of T, Ṫ, x·Ṫ.
const COLUMNS: usize = ORDER + 3;
/// arcmin in a radian.
const ARCMIN_PER_RAD: f64 = 180.0 * 60.0 / std::f64::consts::PI;
/// Step of the navigator, s.
const STEP_S: f64 = 1.0;
/// A hole in the proof's temperatures that a flight may pass: a part of their span, or this much, °C.
const HOLE: f64 = 0.15;
const HOLE_C: f64 = 5.0;
/// A flight is no longer.
const MOST_MINUTES: f64 = 24.0 * 60.0;
/// Fewer windows tell no drift.
const FEWEST: usize = 4 * COLUMNS;
/// And its pace by this part and this much, °C/min.
const SLACK_OF_PACE: f64 = 1.1;
const SLACK_CPM: f64 = 0.05;
/// The flight may leave the proof's temperatures by this much, °C.
const SLACK_C: f64 = 0.5;

/// Which gyro of the navigator it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FlightAxis {
    /// Its axis lies level: Schuler's pendulum.
    #[default]
    Level,
    /// Its axis is vertical: the course bends.
    Azimuth,
}

/// A corner of the temperature profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Corner {
    /// Since take-off, min.
    pub minutes: f64,
    /// Of the thermometer, °C.
    pub temperature_c: f64,
}

/// A stated flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Flight {
    /// Which gyro of the navigator it is.
    #[serde(default)]
    pub axis: FlightAxis,
    /// Ground speed, m/s; needed by the azimuth.
    #[serde(default)]
    pub speed_m_s: Option<f64>,
    /// Heading found by gyrocompassing before take-off: the level gyro's drift at take-off is then a heading error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyrocompass: Option<Gyrocompass>,
    /// Temperature of the gyro's thermometer, straight between corners; at 0 the take-off.
    pub profile: Vec<Corner>,
}

/// An alignment by gyrocompassing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gyrocompass {
    /// Geodetic latitude of the alignment, degrees.
    pub latitude_deg: f64,
}

/// The heading error of a gyrocompass alignment and its distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct HeadingError {
    /// Drift of the east gyro at take-off over Ω·cos φ, arcmin.
    pub heading_arcmin: Estimate,
    /// Cross-track distance at the end of the flight, m.
    pub cross_track_m: Estimate,
}

/// What a flight comes to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PositionError {
    /// The flight as stated.
    pub stated: Flight,
    /// Length of the flight, min.
    pub minutes: f64,
    /// Position error at its end by the drift as logged, m.
    pub before_m: Estimate,
    /// By the drift as corrected, m.
    pub after_m: Estimate,
    /// Largest position error on the way by the drift as corrected, m.
    pub most_after_m: f64,
    /// Largest of error and two of its σ on the way, m: the value that a limit checks, for a retest cannot vouch for less.
    pub bound_after_m: f64,
    /// Null without a gyrocompass alignment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading: Option<HeadingError>,
    /// σ of the position at the end by the angle random walk alone, m; null where it is not known.
    pub noise_m: Option<f64>,
    /// Minutes of the curves.
    pub at_minutes: Vec<f64>,
    /// Position error as logged, m.
    pub curve_before_m: Vec<f64>,
    /// As corrected, m.
    pub curve_after_m: Vec<f64>,
}

impl Flight {
    /// Refuses what is no flight.
    ///
    /// # Errors
    /// Fewer than two corners, times that do not rise from 0, values out of range, an azimuth without speed.
    pub fn check(&self) -> Result<()> {
        let bad = |what: &str| {
            Err(Error::input(what, "correct [flight] in the limits, docs/reference/limits.md shows one")
                .column("flight"))
        };
        let times: Vec<f64> = self.profile.iter().map(|corner| corner.minutes).collect();
        if times.len() < 2 || times[0] != 0.0 || !times.is_sorted_by(|a, b| a < b) {
            return bad("a profile has two corners or more, at minutes that rise from 0");
        }
        if times.iter().any(|t| !(0.0..=MOST_MINUTES).contains(t)) {
            return bad("a flight takes no longer than a day");
        }
        if self.profile.iter().any(|corner| !(-127.0..=127.0).contains(&corner.temperature_c)) {
            return bad("temperatures lie within -127 … 127 °C");
        }
        if let Some(Gyrocompass { latitude_deg }) = self.gyrocompass {
            if !(-80.0..=80.0).contains(&latitude_deg) {
                return bad("a gyrocompass works within 80 degrees of latitude");
            }
            if self.axis == FlightAxis::Azimuth || self.speed_m_s.is_none() {
                return bad("a gyrocompass alignment is of the level gyros and needs speed_m_s");
            }
        }
        match (self.axis, self.speed_m_s) {
            (FlightAxis::Azimuth, None) => {
                bad("the azimuth needs speed_m_s").map_err(|e| e.help("speed_m_s = 250.0, the ground speed"))
            }
            (_, Some(speed)) if !(0.0..=1e5).contains(&speed) => bad("speed_m_s lies within 0 … 100000"),
            _ => Ok(()),
        }
    }

    /// In words.
    pub fn described(&self) -> String {
        let gyro = match (self.axis, self.speed_m_s) {
            (FlightAxis::Level, _) => "a level gyro (Schuler)".to_owned(),
            (FlightAxis::Azimuth, speed) => format!("the azimuth gyro at {} m/s", speed.unwrap_or(0.0)),
        };
        let drift = match self.gyrocompass {
            Some(Gyrocompass { latitude_deg }) => format!("heading by gyrocompass at {latitude_deg}° latitude"),
            None => "drift against the calibration".to_owned(),
        };
        let corner = |corner: &Corner| format!("{} min {} °C", corner.minutes, corner.temperature_c);
        let profile: Vec<String> = self.profile.iter().map(corner).collect();
        format!("{gyro}, {drift}; {}", profile.join(", "))
    }

    fn channel(&self) -> Channel {
        match self.axis {
            FlightAxis::Level => Channel::Level,
            FlightAxis::Azimuth => Channel::Azimuth(self.speed_m_s.unwrap_or(0.0)),
        }
    }

    /// Temperature and its rate (°C/min) after so many minutes.
    fn at(&self, minutes: f64) -> (f64, f64) {
        let after = self.profile.partition_point(|corner| corner.minutes <= minutes).clamp(1, self.profile.len() - 1);
        let (from, to) = (self.profile[after - 1], self.profile[after]);
        let rate_cpm = (to.temperature_c - from.temperature_c) / (to.minutes - from.minutes);
        (from.temperature_c + rate_cpm * (minutes - from.minutes), rate_cpm)
    }

    fn minutes(&self) -> f64 {
        self.profile.last().map_or(0.0, |corner| corner.minutes)
    }

    /// Flies it with the drift that the windows of a proof show; `Err` says in words why it cannot be told.
    pub(crate) fn fly(
        &self,
        points: &[WindowPoint],
        n_deg_rt_h: Option<f64>,
        bias: std::result::Result<&BiasRepeatability, &str>,
    ) -> std::result::Result<PositionError, String> {
        let bias = bias?.worst().ok_or("no run of the retest has a bias")?;
        let sound = |p: &&WindowPoint| {
            p.excluded.is_none() && p.temperature_c.is_finite() && p.rate_cpm.is_finite() && p.after_dph.is_finite()
        };
        let used: Vec<&WindowPoint> = points.iter().filter(sound).collect();
        if used.len() < FEWEST {
            return Err(format!("{} windows with a temperature rate; a flight needs {FEWEST}", used.len()));
        }
        let extremes = used
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| (lo.min(p.temperature_c), hi.max(p.temperature_c)));
        let outside = |corner: &&Corner| !(extremes.0 - SLACK_C..=extremes.1 + SLACK_C).contains(&corner.temperature_c);
        if let Some(corner) = self.profile.iter().find(outside) {
            return Err(format!(
                "the flight goes to {} °C, the proof from {:.1} to {:.1} °C",
                corner.temperature_c, extremes.0, extremes.1
            ));
        }
        self.check_holes(&used)?;
        let paces = self
            .profile
            .windows(2)
            .map(|leg| ((leg[1].temperature_c - leg[0].temperature_c) / (leg[1].minutes - leg[0].minutes)).abs());
        let (pace, known) = (largest(paces), used.iter().fold(0.0_f64, |most, p| most.max(p.rate_cpm.abs())));
        if pace > SLACK_OF_PACE * known + SLACK_CPM {
            return Err(format!("the flight changes by {pace:.2} °C/min, the proof by {known:.2} °C/min at most"));
        }
        let span = Span { lo: extremes.0, hi: extremes.1 };
        let unit = self.unit_positions(span);
        const UNDETERMINED: &str = "the windows do not determine a drift over temperature";
        let mut before = FlightDrift::of(&used, span, |p| p.before_dph).ok_or(UNDETERMINED)?;
        let mut after = FlightDrift::of(&used, span, |p| p.after_dph).ok_or(UNDETERMINED)?;
        before.shift(bias.raw_difference_dph, bias.difference_dph.sigma);
        after.shift(bias.difference_dph.value, bias.difference_dph.sigma);
        let heading = self.gyrocompass.map(|compass| self.heading(compass, &after, span));
        let steps = unit.nrows();
        let (curve_before, curve_after) = (&unit * &before.coefficients, &unit * &after.coefficients);
        let end = |drift: &FlightDrift| {
            let g = unit.row(steps - 1).transpose();
            let variance = (g.transpose() * &drift.covariance * &g)[(0, 0)];
            Estimate { value: g.dot(&drift.coefficients), sigma: variance.clamp(0.0, f64::INFINITY).sqrt() }
        };
        let every = (steps / 300).max(1);
        let shown: Vec<usize> = (0..steps).filter(|i| (i + 1) % every == 0 || *i == steps - 1).collect();
        let pick = |curve: &DVector<f64>| shown.iter().map(|i| curve[*i]).collect();
        Ok(PositionError {
            stated: self.clone(),
            minutes: self.minutes(),
            before_m: end(&before),
            after_m: end(&after),
            bound_after_m: bound_m(&unit, &after, &curve_after)
                .hypot(heading.map_or(0.0, |h| h.cross_track_m.value.abs() + 2.0 * h.cross_track_m.sigma)),
            heading,
            most_after_m: largest(curve_after.iter().map(|x| x.abs())),
            noise_m: n_deg_rt_h.map(|n| noise_m(self.channel(), n, 60.0 * self.minutes())),
            at_minutes: shown.iter().map(|i| (*i + 1) as f64 * STEP_S / 60.0).collect(),
            curve_before_m: pick(&curve_before),
            curve_after_m: pick(&curve_after),
        })
    }

    /// The drift at take-off as an error of the heading, ε/(Ω·cos φ), and what it is across the track at the end.
    fn heading(&self, compass: Gyrocompass, drift: &FlightDrift, span: Span) -> HeadingError {
        let (start_c, _) = self.at(0.0);
        let at_start = DVector::from_row_slice(&columns(span, start_c, 0.0));
        let value_dph = at_start.dot(&drift.coefficients);
        let variance = (at_start.transpose() * &drift.covariance * &at_start)[(0, 0)];
        let per_dph = 1.0 / (EARTH_RATE_DPH * compass.latitude_deg.to_radians().cos());
        let distance_m = self.speed_m_s.unwrap_or(0.0) * 60.0 * self.minutes();
        let rad = [value_dph, variance.clamp(0.0, f64::INFINITY).sqrt()].map(|dph| dph * per_dph);
        let estimate = |unit: f64| Estimate { value: unit * rad[0], sigma: unit * rad[1] };
        HeadingError { heading_arcmin: estimate(ARCMIN_PER_RAD), cross_track_m: estimate(distance_m) }
    }

    /// Temperatures of the flight that no window is near cannot be told by a curve through those next to them.
    fn check_holes(&self, used: &[&WindowPoint]) -> std::result::Result<(), String> {
        let of_flight = self.profile.iter().map(|corner| corner.temperature_c);
        let lo = of_flight.clone().fold(f64::INFINITY, f64::min);
        let hi = of_flight.fold(f64::NEG_INFINITY, f64::max);
        let mut known: Vec<f64> = used.iter().map(|p| p.temperature_c).collect();
        known.sort_by(f64::total_cmp);
        let most = (HOLE * (known[known.len() - 1] - known[0])).max(HOLE_C);
        let hole = known.windows(2).find(|pair| pair[1] - pair[0] > most && pair[1] > lo && pair[0] < hi);
        hole.map_or(Ok(()), |pair| {
            Err(format!("no window lies between {:.1} and {:.1} °C, where the flight goes", pair[0], pair[1]))
        })
    }

    /// Position over the flight, a row per step, of a drift that is one of the columns with coefficient 1.
    fn unit_positions(&self, span: Span) -> DMatrix<f64> {
        let steps = ((60.0 * self.minutes() / STEP_S).round() as usize).max(1);
        let row = |minutes: f64| {
            let (celsius, rate_cpm) = self.at(minutes);
            columns(span, celsius, rate_cpm)
        };
        // A gyrocompass turns the platform until the level drift on the ground, at rest, is balanced by the Earth's rate.
        let (start_c, _) = self.at(0.0);
        let known = if self.gyrocompass.is_some() { columns(span, start_c, 0.0) } else { [0.0; COLUMNS] };
        let mut drifts = vec![Vec::new(); COLUMNS];
        for step in 0..steps {
            let here = row((step as f64 + 0.5) * STEP_S / 60.0);
            drifts.iter_mut().enumerate().for_each(|(column, all)| all.push(here[column] - known[column]));
        }
        let flown: Vec<Vec<f64>> = drifts.iter().map(|drift| positions_m(self.channel(), drift, STEP_S)).collect();
        DMatrix::from_fn(steps, COLUMNS, |step, column| flown[column][step])
    }
}

/// The largest of some values from zero on, and NaN if one is: `f64::max` would pass over it, and a limit would be met by what is not
/// known.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, value| if value.is_nan() || value > most { value } else { most })
}

/// Largest |x| + 2σ over the flight, looked at every minute and at its end.
fn bound_m(unit: &DMatrix<f64>, drift: &FlightDrift, curve: &DVector<f64>) -> f64 {
    let last = unit.nrows() - 1;
    let looks = (0..=last).filter(|step| step % 60 == 59 || *step == last);
    let bound = |step: usize| {
        let g = unit.row(step).transpose();
        let variance = (g.transpose() * &drift.covariance * &g)[(0, 0)];
        curve[step].abs() + 2.0 * variance.clamp(0.0, f64::INFINITY).sqrt()
    };
    largest(looks.map(bound))
}

fn columns(span: Span, celsius: f64, rate_cpm: f64) -> [f64; COLUMNS] {
    let x = span.x(celsius);
    let series = chebyshev(x);
    std::array::from_fn(|column| match column {
        0..=ORDER => series[column],
        _ if column == ORDER + 1 => rate_cpm,
        _ => rate_cpm * x,
    })
}

/// A drift over T and Ṫ with its covariance.
struct FlightDrift {
    coefficients: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl FlightDrift {
    /// Adds a constant with its σ.
    fn shift(&mut self, value: f64, sigma: f64) {
        self.coefficients[0] += value;
        self.covariance[(0, 0)] += sigma * sigma;
    }

    fn of(points: &[&WindowPoint], span: Span, value: impl Fn(&WindowPoint) -> f64) -> Option<Self> {
        let design = DMatrix::from_row_iterator(
            points.len(),
            COLUMNS,
            points.iter().flat_map(|p| columns(span, p.temperature_c, p.rate_cpm)),
        );
        let right = DVector::from_iterator(points.len(), points.iter().map(|p| value(p)));
        // Columns that do not vary (no ramps in the test) take no part.
        let svd = design.clone().svd(true, true);
        let cut = 1e-9 * svd.singular_values.max();
        let coefficients = svd.solve(&right, cut).ok()?;
        let inverse = svd.pseudo_inverse(cut).ok()?;
        let degrees = points.len().checked_sub(COLUMNS).filter(|degrees| *degrees > 0)? as f64;
        let left = &right - &design * &coefficients;
        let variance = left.norm_squared() / degrees;
        // Neighbours hang together where something slow is left.
        let product: f64 = left.iter().zip(left.iter().skip(1)).map(|(a, b)| a * b).sum();
        let rho = (product / left.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 0.99);
        let widening = (1.0 + rho) / (1.0 - rho);
        let covariance = &inverse * inverse.transpose() * (variance * widening);
        Some(Self { coefficients, covariance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::RunBias;
    use crate::verify::tests::noise;

    /// A value that is not known is not the smallest.
    #[test]
    fn the_largest_of_what_is_not_known_is_not_known() {
        assert_eq!(largest([1.0, 3.0, 2.0].into_iter()), 3.0);
        for unknown in [[f64::NAN, 1.0, 2.0], [1.0, f64::NAN, 2.0], [1.0, 2.0, f64::NAN]] {
            assert!(largest(unknown.into_iter()).is_nan());
        }
    }

    fn points(before: impl Fn(f64, f64) -> f64, after: impl Fn(f64, f64) -> f64) -> Vec<WindowPoint> {
        let one = |i: usize| {
            let phase = i as f64 / 100.0;
            let up = phase % 2.0 < 1.0;
            let celsius = if up { 110.0 * (phase % 1.0) - 40.0 } else { 70.0 - 110.0 * (phase % 1.0) };
            let rate = if up { 1.0 } else { -1.0 };
            let noise = 0.02 * noise(i);
            WindowPoint {
                run: 0,
                hours: i as f64 / 36.0,
                length_h: 1.0 / 36.0,
                temperature_c: celsius,
                rate_cpm: rate,
                before_dph: before(celsius, rate) + noise,
                inputs_dph: 0.0,
                after_dph: after(celsius, rate) + noise,
                excluded: None,
            }
        };
        (0..400).map(one).collect()
    }

    fn flight(profile: &[(f64, f64)], gyrocompass: bool) -> Flight {
        let corner =
            |(minutes, temperature_c): &(f64, f64)| Corner { minutes: *minutes, temperature_c: *temperature_c };
        let gyrocompass = gyrocompass.then_some(Gyrocompass { latitude_deg: 60.0 });
        let profile = profile.iter().map(corner).collect();
        Flight { axis: FlightAxis::Level, speed_m_s: Some(250.0), gyrocompass, profile }
    }

    /// A retest this far from its calibration.
    fn off_by(dph: f64) -> BiasRepeatability {
        let exact = |value: f64| Estimate { value, sigma: 0.0 };
        let run =
            RunBias { file: String::new(), bias_dph: exact(dph), difference_dph: exact(dph), raw_difference_dph: dph };
        BiasRepeatability {
            input_rate_dph: 0.0,
            calibration_input_rate_dph: 0.0,
            calibration_dph: exact(0.0),
            runs: vec![run],
            turn_ons: None,
            unknown: None,
        }
    }

    /// A drift of 0.001 °/h per °C over a ramp of an hour, by the closed form of a ramp: b = β·t gives
    /// x = β·R·(t²/2 − (1 − cos ω_s t)/ω_s²).
    #[test]
    fn a_ramp_of_drift_is_flown_as_the_closed_form_says() {
        let said = flight(&[(0.0, 0.0), (60.0, 60.0)], true)
            .fly(&points(|t, _| 0.001 * t, |_, _| 0.0), Some(0.003), Ok(&off_by(0.0)))
            .unwrap();
        let (r, g) = (super::super::strapdown::EARTH_RADIUS_M, super::super::strapdown::GRAVITY_M_S2);
        let (t, omega) = (3600.0_f64, (g / r).sqrt());
        let beta = 0.001 / 60.0 * std::f64::consts::PI / 180.0 / 3600.0;
        let wanted = beta * r * (t * t / 2.0 - (1.0 - (omega * t).cos()) / (omega * omega));
        assert!((said.before_m.value - wanted).abs() < 4.0 * said.before_m.sigma, "{:?} for {wanted}", said.before_m);
        assert!(said.before_m.sigma < 0.1 * wanted, "{:?}", said.before_m);
        assert!(said.after_m.value.abs() < 4.0 * said.after_m.sigma, "noise is no distance: {:?}", said.after_m);
        assert!((said.noise_m.unwrap() / noise_m(Channel::Level, 0.003, t) - 1.0).abs() < 1e-12);
        assert!((said.curve_before_m.last().unwrap() - said.before_m.value).abs() < 1e-6 * wanted);
    }

    /// The closed form of a constant b: x = b·R·(t − sin ω_s t/ω_s): 0.3 °/h off its calibration over two hours and a half, some
    /// tens of kilometres; with a gyrocompass the same is a heading error of b/(Ω·cos φ).
    #[test]
    fn a_bias_off_its_calibration_flies_along() {
        let still = [(0.0, 20.0), (150.0, 20.0)];
        let nothing = points(|_, _| 0.0, |_, _| 0.0);
        let (r, g) = (super::super::strapdown::EARTH_RADIUS_M, super::super::strapdown::GRAVITY_M_S2);
        let (t, omega) = (9000.0_f64, (g / r).sqrt());
        let b = 0.3 * std::f64::consts::PI / 180.0 / 3600.0;
        let wanted = b * r * (t - (omega * t).sin() / omega);
        let flown = flight(&still, false).fly(&nothing, None, Ok(&off_by(0.3))).unwrap();
        assert!((flown.after_m.value / wanted - 1.0).abs() < 0.02, "{:?} for {wanted}", flown.after_m);
        assert!(flown.bound_after_m > 0.95 * wanted);
        let aligned = flight(&still, true).fly(&nothing, None, Ok(&off_by(0.3))).unwrap();
        let heading = aligned.heading.unwrap();
        let rad = 0.3 / (EARTH_RATE_DPH * 60.0_f64.to_radians().cos());
        assert!((heading.cross_track_m.value / (rad * 250.0 * t) - 1.0).abs() < 0.02, "{heading:?}");
        assert!((heading.heading_arcmin.value / (rad * ARCMIN_PER_RAD) - 1.0).abs() < 0.02);
        assert!(aligned.after_m.value.abs() < 1e-6 && aligned.bound_after_m > 0.95 * heading.cross_track_m.value);
        let unknown = flight(&still, false).fly(&nothing, None, Err("the input rate is not known"));
        assert!(unknown.unwrap_err().contains("input rate"));
    }

    #[test]
    fn a_flight_beyond_the_proof_cannot_be_told() {
        let said =
            flight(&[(0.0, 0.0), (60.0, 90.0)], true).fly(&points(|_, _| 0.0, |_, _| 0.0), None, Ok(&off_by(0.0)));
        assert!(said.unwrap_err().contains("90 °C"));
        let fast =
            flight(&[(0.0, -30.0), (1.0, 60.0)], true).fly(&points(|_, _| 0.0, |_, _| 0.0), None, Ok(&off_by(0.0)));
        assert!(fast.unwrap_err().contains("90.00 °C/min"));
        for bad in
            [vec![(0.0, 1.0)], vec![(1.0, 1.0), (2.0, 1.0)], vec![(0.0, 1.0), (0.0, 1.0)], vec![(0.0, 1.0), (9e9, 1.0)]]
        {
            assert!(flight(&bad, true).check().is_err(), "{bad:?}");
        }
    }
}
