//! Comparison of calibrations of one unit: between cycles, turn-ons, months.
//!
//! ```text
//! d_i(T) ± σ_i(T), all zero at one T0      d̄ = Σ d_i/σ_i² / Σ 1/σ_i²      z_i = (d_i − d̄)/√(σ_i² − σ̄²),  σ̄² = 1/Σ 1/σ_i²
//! ```
//!
//! at temperatures that every record spans. |z| above three means that a record differs from the others by more than the
//! intervals explain. The spread beyond the intervals is the error to expect of a correction after the same time. The same
//! holds for the scale factor (with its value at T0, if every record has one), the rate effect, the lag and the fixed bias of
//! the last run (its rate where the input is unknown), all at the first record's T0. A record whose model lacks a term is not
//! compared in that term. Records made from the same log are reported. Besides, each record's curve less the first's, d_i − d_0 with
//! σ = √(σ_i² + σ_0²): what changed since the first, the most changed temperature first.
//!
//! With limits every pair of records is judged by the rule and in the words of `verify` ([`COMPARED`]).

mod changes;
mod limits;
mod triangle;

pub use changes::Change;
pub use limits::{COMPARED, ComparedLimit};

use sagnac_log::setup::RateUnit;
use serde::{Deserialize, Serialize};

use crate::calibration::{AxisCalibration, Calibration, CorrectionTerm, Lag};
use crate::compare::limits::ComparedRecords;
use crate::model::ActsOn;
use crate::verify::{Limits, LimitsSource, Verdict};
use sagnac_log::error::{Error, Result};
use sagnac_units::format::{celsius, significant, unit, with_sigma};

/// A deviation beyond this many σ is not chance.
const DISAGREE: f64 = 3.0;
/// Records that differ by less count as the same record.
const SAME: f64 = 1e-6;
/// Temperatures over the common span, ends included.
const TEMPERATURES: usize = 12;
/// Within this fraction of the span around T0 the drift is zero by definition and is not compared.
const NEAR_REFERENCE: f64 = 0.02;

/// A curve of every record at the common temperatures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ComparedCurve {
    /// `bias`, °/h, or `scale`, ppm.
    pub quantity: String,
    /// Unit of the values.
    pub unit: String,
    /// °C.
    pub temperatures_c: Vec<f64>,
    /// Per record: values.
    pub values: Vec<Vec<f64>>,
    /// Per record: σ.
    pub sigmas: Vec<Vec<f64>>,
    /// Weighted mean over the records.
    pub mean: Vec<f64>,
    /// Per record: distance from the mean in its σ; null at T0.
    pub z: Vec<Vec<Option<f64>>>,
    /// Spread of the records beyond their σ, at each temperature.
    pub beyond: Vec<f64>,
    /// Per record after the first: its values less the first record's, each with σ. Empty in records of earlier versions.
    #[serde(default)]
    pub differences: Vec<Vec<[f64; 2]>>,
    /// Records whose model has no such term; they take no part.
    pub without: Vec<usize>,
    /// Largest |z|, its record and temperature.
    pub worst: Option<Worst>,
}

impl Comparison {
    /// The same with rates in a unit, for people; a record keeps °/h.
    #[must_use]
    pub fn shown_in(&self, units: RateUnit) -> Self {
        let mut shown = self.clone();
        for axis in &mut shown.axes {
            for curve in &mut axis.curves {
                let (factor, unit) = units.shown(&curve.unit);
                curve.unit = unit;
                let of_record = [&mut curve.values, &mut curve.sigmas].into_iter().flatten();
                of_record.chain([&mut curve.mean, &mut curve.beyond]).flatten().for_each(|value| *value *= factor);
                curve.differences.iter_mut().flatten().flatten().for_each(|value| *value *= factor);
            }
            for number in &mut axis.numbers {
                let (factor, unit) = units.shown(&number.unit);
                number.unit = unit;
                number.values.iter_mut().flatten().flatten().for_each(|value| *value *= factor);
            }
        }
        shown
    }
}

impl ComparedNumber {
    /// A row for people: name, values ± σ, unit, how far apart.
    pub fn row(&self) -> Vec<String> {
        let text = |value: &Option<[f64; 2]>| value.map_or("-".to_owned(), |[v, s]| with_sigma(v, Some(s)));
        let mut row = vec![self.name.clone()];
        row.extend(self.values.iter().map(text));
        row.push(unit(&self.unit));
        row.push(self.sigmas.map_or("-".to_owned(), |s| significant(s, 2)));
        row
    }

    /// The disagreement in words; `None` where it agrees or is the only record.
    pub fn verdict(&self) -> Option<String> {
        let sigmas = self.sigmas.filter(|sigmas| *sigmas > DISAGREE)?;
        Some(format!("{}: the records disagree by {} σ", self.name, significant(sigmas, 2)))
    }
}

impl ComparedCurve {
    /// By more than chance.
    pub fn disagrees(&self) -> bool {
        self.worst.as_ref().is_some_and(|worst| worst.sigmas > DISAGREE)
    }

    /// Values ± σ of every record at one of the temperatures, the differences from the first, and the spread beyond them.
    pub fn row(&self, at: usize) -> Vec<String> {
        let text = |record: usize| with_sigma(self.values[record][at], Some(self.sigmas[record][at]));
        let less = self.differences.iter().map(|all| with_sigma(all[at][0], Some(all[at][1])));
        (0..self.values.len()).map(text).chain(less).chain([significant(self.beyond[at], 2)]).collect()
    }

    /// Titles of [`Self::row`].
    pub fn titles(&self, records: &[(String, f64)]) -> Vec<String> {
        let names = records.iter().map(|(name, _)| name.clone());
        let less = match records {
            [_, _] => vec!["difference".to_owned()],
            all => all.iter().skip(1).map(|(name, _)| format!("{name} less the first")).collect(),
        };
        names.chain(less).chain(["beyond their σ".to_owned()]).collect()
    }

    /// Places of the temperatures, the most changed first: by the largest difference in its σ.
    pub fn by_change(&self) -> Vec<usize> {
        let change = |at: &usize| {
            let ratios = self.differences.iter().map(|all| all[*at][0].abs() / all[*at][1]);
            ratios.filter(|ratio| ratio.is_finite()).fold(0.0, f64::max)
        };
        let mut places: Vec<usize> = (0..self.temperatures_c.len()).collect();
        places.sort_by(|a, b| change(b).total_cmp(&change(a)));
        places
    }

    /// The largest change since the first record in words; `None` where nothing changed.
    pub fn change(&self, records: &[(String, f64)]) -> Option<String> {
        let at = *self.by_change().first()?;
        let ratio = |all: &Vec<[f64; 2]>| all[at][0].abs() / all[at][1];
        let most = self.differences.iter().enumerate().filter(|(_, all)| ratio(all).is_finite());
        let (record, all) = most.max_by(|a, b| ratio(a.1).total_cmp(&ratio(b.1)))?;
        let (name, _) = records.get(record + 1)?;
        let [value, sigma] = all[at];
        (value != 0.0).then(|| {
            format!(
                "{}: most changed at {} °C, by {} {} in {name}",
                self.quantity,
                celsius(self.temperatures_c[at]),
                with_sigma(value, Some(sigma)),
                unit(&self.unit)
            )
        })
    }

    /// The result in words.
    pub fn verdict(&self, records: &[(String, f64)]) -> String {
        let record_name = |record: &usize| records.get(*record).map_or("", |(name, _)| name.as_str());
        let lacking = match self.without.as_slice() {
            [] => String::new(),
            without => {
                let names: Vec<&str> = without.iter().map(record_name).collect();
                format!("; no such term in {}, which take no part", names.join(", "))
            }
        };
        let Some(worst) = &self.worst else { return format!("{}: nothing to compare{lacking}", self.quantity) };
        let name = record_name(&worst.record);
        let beyond = self.beyond.iter().fold(0.0_f64, |most, b| most.max(*b));
        let quantity = &self.quantity;
        if worst.sigmas < SAME {
            return format!("{quantity}: the records are the same{lacking}");
        }
        let farthest = format!(
            "{name} is farthest from the mean, {} σ at {:.1} °C",
            significant(worst.sigmas, 2),
            worst.temperature_c
        );
        if !self.disagrees() {
            return format!("{quantity}: the records agree within their intervals; {farthest}{lacking}");
        }
        let (beyond, unit) = (significant(beyond, 2), unit(&self.unit));
        format!(
            "{quantity}: the records disagree; {farthest}; beyond their σ they differ by up to {beyond} {unit}{lacking}"
        )
    }
}

/// Where records disagree most.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Worst {
    /// Record, from 0.
    pub record: usize,
    /// °C.
    pub temperature_c: f64,
    /// |z|.
    pub sigmas: f64,
}

/// A number that every record has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ComparedNumber {
    /// What it is.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Per record: value and σ; null where the record has none.
    pub values: Vec<Option<[f64; 2]>>,
    /// Largest distance between two of them, in the σ of their difference.
    pub sigmas: Option<f64>,
}

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ComparedAxis {
    /// Axis letter.
    pub axis: char,
    /// Bias, and the scale factor if every record has one.
    pub curves: Vec<ComparedCurve>,
    /// Constants, rate terms, lag; slopes and steps of further inputs.
    pub numbers: Vec<ComparedNumber>,
    /// Verdict of every limit; empty without limits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<Verdict>,
    /// A limit is asked, and every one that is asked is met; null without limits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pass: Option<bool>,
}

/// The result of `sagnac compare`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Comparison {
    /// Serial number that all share.
    pub serial: String,
    /// Per record: its name and the time of its newest sample, s.
    pub records: Vec<(String, f64)>,
    /// Differences of each record from the first, apart from its values: model, setup, data, program.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<Change>,
    /// Logs that more than one of them was made from: such records are not independent, and agree too well.
    pub shared_logs: Vec<String>,
    /// The axes that all have.
    pub axes: Vec<ComparedAxis>,
    /// Axes that some records have and others do not.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub untested_axes: Vec<char>,
    /// The limits of the comparison; null without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSource>,
}

impl Comparison {
    /// False when a limit is not met or none is asked, or where limits were checked with records of one log or of different axes.
    pub fn passed(&self) -> bool {
        let sound = self.shared_logs.is_empty() && self.untested_axes.is_empty();
        self.limits.is_none() || sound && self.axes.iter().all(|axis| axis.pass == Some(true))
    }
}

/// Compares calibrations of one unit, and holds what changed between them against limits where there are any.
///
/// # Errors
/// Fewer than two, other serials, no common axis or span, records without uncertainty.
pub fn compare(records: &[(String, Calibration)], limits: Option<&Limits>) -> Result<Comparison> {
    let [(first_name, first), others @ ..] = records else { return Err(few()) };
    if others.is_empty() {
        return Err(few());
    }
    for (name, other) in others {
        if other.serial != first.serial {
            let what = format!("the calibration is of {:?}, and {first_name} is of {:?}", other.serial, first.serial);
            return Err(Error::input(what, "compare calibrations of one unit").file(name).column("serial"));
        }
    }
    let of_axis = |letter: char| -> Option<Vec<&AxisCalibration>> {
        records.iter().map(|(_, record)| record.axes.iter().find(|axis| axis.axis == letter)).collect()
    };
    let shared: Vec<(char, Vec<&AxisCalibration>)> =
        first.axes.iter().filter_map(|axis| Some((axis.axis, of_axis(axis.axis)?))).collect();
    if shared.is_empty() {
        return Err(Error::input("the records have no axis in common", "compare calibrations of the same axes"));
    }
    let axes: Result<Vec<ComparedAxis>> =
        shared.iter().map(|(letter, axes)| compare_axis(*letter, axes, records, limits)).collect();
    let mut letters: Vec<char> = records.iter().flat_map(|(_, record)| &record.axes).map(|axis| axis.axis).collect();
    letters.sort_unstable();
    letters.dedup();
    letters.retain(|letter| shared.iter().all(|(other, _)| other != letter));
    let named = records.iter().map(|(name, record)| (name.clone(), record.provenance.time_s));
    Ok(Comparison {
        serial: first.serial.clone(),
        records: named.collect(),
        changes: changes::changes(records),
        shared_logs: shared_logs(records),
        axes: axes?,
        untested_axes: letters,
        limits: limits.map(|limits| limits.source.clone()),
    })
}

fn shared_logs(records: &[(String, Calibration)]) -> Vec<String> {
    let logs = |index: usize| records[index].1.provenance.inputs.iter();
    let twice =
        |index: usize| logs(index).filter(move |log| (0..index).any(|before| logs(before).any(|l| l.overlaps(log))));
    let mut names: Vec<String> = (0..records.len()).flat_map(twice).map(|log| log.file.clone()).collect();
    names.sort();
    names.dedup();
    names
}

fn few() -> Error {
    Error::input(
        "a comparison needs two or more calibrations",
        "give two files: sagnac compare january.cal.json may.cal.json",
    )
}

fn compare_axis(
    letter: char,
    axes: &[&AxisCalibration],
    records: &[(String, Calibration)],
    limits: Option<&Limits>,
) -> Result<ComparedAxis> {
    for (axis, (name, _)) in axes.iter().zip(records) {
        if axis.fit.is_none() {
            return Err(Error::input(
                "the record has no uncertainty (imported, not fitted)",
                "calibrate from the logs: sagnac calibrate run1.csv -o unit.cal.json",
            )
            .file(name));
        }
    }
    let lo_c = axes.iter().map(|axis| axis.span_c()[0]).fold(f64::NEG_INFINITY, f64::max);
    let hi_c = axes.iter().map(|axis| axis.span_c()[1]).fold(f64::INFINITY, f64::min);
    let reference_c = axes[0].reference_c();
    if !(lo_c..=hi_c).contains(&reference_c) || hi_c - lo_c <= 0.0 {
        return Err(Error::refused(
            format!(
                "axis {letter}: the records share {lo_c:.1} … {hi_c:.1} °C, without the reference {reference_c} °C"
            ),
            "calibrate with a reference_c that all tests cover",
        ));
    }
    let width = (hi_c - lo_c) / (TEMPERATURES - 1) as f64;
    let temperatures: Vec<f64> = (0..TEMPERATURES).map(|i| lo_c + width * i as f64).collect();
    let mut curves = vec![curve(axes, ActsOn::Bias, &temperatures, reference_c)];
    if axes.iter().all(|axis| axis.fit.as_ref().is_some_and(|fit| fit.scale_factor.is_some())) {
        curves.push(curve(axes, ActsOn::ScaleFactor, &temperatures, reference_c));
    }
    let windows_h = |(axis, (_, record)): (&&AxisCalibration, &(String, Calibration))| {
        axis.residual().map_or(0.0, |residual| residual.n as f64 * record.window_s / 3600.0)
    };
    let compared = ComparedRecords {
        axes,
        names: records.iter().map(|(name, _)| name.as_str()).collect(),
        turn_ons: records.iter().map(|(_, record)| record.setup.turn_ons).collect(),
        temperatures_c: &temperatures,
        reference_c,
        hours: axes.iter().zip(records).map(windows_h).sum(),
    };
    let verdicts = limits.map_or_else(Vec::new, |limits| compared.judge(limits));
    let met = verdicts.iter().any(|verdict| verdict.pass == Some(true));
    let pass = limits.map(|_| met && verdicts.iter().all(|verdict| verdict.pass != Some(false)));
    Ok(ComparedAxis { axis: letter, curves, numbers: numbers(axes, reference_c), limits: verdicts, pass })
}

/// Value and σ of a record's curve at a temperature: the drift is zero at the common reference, the scale factor has its value
/// at the record's own T0.
fn value(axis: &AxisCalibration, quantity: ActsOn, celsius: f64, reference_c: f64) -> (f64, f64) {
    match quantity {
        ActsOn::Bias => drift(axis, celsius, reference_c),
        ActsOn::ScaleFactor => axis.scale_deviation(celsius).into(),
    }
}

/// The drift at rest between two temperatures and its σ.
fn drift(axis: &AxisCalibration, celsius: f64, from_c: f64) -> (f64, f64) {
    (axis.drift(celsius, from_c), axis.variance_of(&axis.drift_weights(celsius, from_c)).sqrt())
}

fn curve(axes: &[&AxisCalibration], quantity: ActsOn, temperatures: &[f64], reference_c: f64) -> ComparedCurve {
    let width = temperatures[temperatures.len() - 1] - temperatures[0];
    let (mut values, mut sigmas) = (Vec::new(), Vec::new());
    for axis in axes {
        let (v, s): (Vec<f64>, Vec<f64>) = temperatures.iter().map(|t| value(axis, quantity, *t, reference_c)).unzip();
        values.push(v);
        sigmas.push(s);
    }
    let has_terms = |record: &usize| {
        let axis = axes[*record];
        let of_curve =
            |term: &CorrectionTerm| term.acts_on == quantity && !term.times_rate && axis.is_over_thermometer(term);
        quantity == ActsOn::ScaleFactor || axis.correction.terms.iter().any(of_curve)
    };
    let (with, without): (Vec<usize>, Vec<usize>) = (0..axes.len()).partition(has_terms);
    let (mut mean, mut beyond) = (Vec::new(), Vec::new());
    let mut z = vec![vec![None; temperatures.len()]; axes.len()];
    let mut worst: Option<Worst> = None;
    for (at, temperature_c) in temperatures.iter().enumerate() {
        let column: Vec<(f64, f64)> = with.iter().map(|record| (values[*record][at], sigmas[*record][at])).collect();
        if column.len() < 2 {
            mean.push(column.first().map_or(0.0, |(value, _)| *value));
            beyond.push(0.0);
            continue;
        }
        let tells = quantity == ActsOn::ScaleFactor || (temperature_c - reference_c).abs() > NEAR_REFERENCE * width;
        let tells = tells && column.iter().all(|(_, sigma)| *sigma > 0.0);
        let information: f64 = column.iter().map(|(_, sigma)| sigma.powi(-2)).sum();
        let centre = if tells {
            column.iter().map(|(value, sigma)| value / sigma.powi(2)).sum::<f64>() / information
        } else {
            column.iter().map(|(value, _)| value).sum::<f64>() / column.len() as f64
        };
        mean.push(centre);
        let n = column.len() as f64;
        let spread = column.iter().map(|(value, _)| (value - centre).powi(2)).sum::<f64>() / (n - 1.0);
        let explained = column.iter().map(|(_, sigma)| sigma.powi(2)).sum::<f64>() / n;
        beyond.push((spread - explained).clamp(0.0, f64::INFINITY).sqrt());
        for (record, (value, sigma)) in with.iter().copied().zip(&column) {
            let own = (sigma.powi(2) - information.recip()).clamp(0.0, f64::INFINITY).sqrt();
            let away = (tells && own > 0.0).then(|| (value - centre) / own);
            z[record][at] = away;
            if let Some(sigmas) = away.map(f64::abs)
                && worst.as_ref().is_none_or(|worst| sigmas > worst.sigmas)
            {
                worst = Some(Worst { record, temperature_c: *temperature_c, sigmas });
            }
        }
    }
    let (name, unit) = match quantity {
        ActsOn::Bias => ("bias", "deg/h"),
        ActsOn::ScaleFactor => ("scale", "ppm"),
    };
    let less = |record: usize| {
        let at = |at: usize| [values[record][at] - values[0][at], f64::hypot(sigmas[record][at], sigmas[0][at])];
        (0..temperatures.len()).map(at).collect()
    };
    let differences = (1..axes.len()).map(less).collect();
    ComparedCurve {
        quantity: name.to_owned(),
        unit: unit.to_owned(),
        temperatures_c: temperatures.to_vec(),
        values,
        sigmas,
        mean,
        z,
        beyond,
        differences,
        without,
        worst,
    }
}

/// Single numbers of the records, all at the first record's T0.
fn numbers(axes: &[&AxisCalibration], reference_c: f64) -> Vec<ComparedNumber> {
    let all_known = axes.iter().all(|axis| axis.run_offsets.last().is_some_and(|last| last.fixed_bias_dph.is_some()));
    let constant = |axis: &AxisCalibration| {
        let last = axis.run_offsets.last()?;
        let shift = axis.drift(reference_c, axis.reference_c());
        let name = format!("offset {}", last.run);
        let row = axis.fit.as_ref()?.covariance_of.iter().position(|n| *n == name || n == "offset")?;
        let bias = axis.drift_weights(reference_c, axis.reference_c());
        let weights: Vec<(usize, f64)> = std::iter::once((row, 1.0)).chain(bias).collect();
        let value = if all_known { last.fixed_bias_dph? } else { last.value_dph };
        Some([value + shift, axis.variance_of(&weights).sqrt()])
    };
    let rate = |axis: &AxisCalibration| axis.rate_effect(reference_c);
    let known = |lag: Lag| Some([lag.value, lag.sigma?]);
    let lag = |axis: &AxisCalibration| axis.lag_s().and_then(known);
    let slow_lag = |axis: &AxisCalibration| axis.slow_lag_s().and_then(known);
    let what = if all_known { "fixed bias" } else { "rate" };
    let all = [
        number(&format!("{what} at {reference_c} °C, last run"), "deg/h", axes, constant),
        number(&format!("rate effect at {reference_c} °C"), "deg/h per degC/min", axes, rate),
        number("lag", "s", axes, lag),
        number("slow lag", "s", axes, slow_lag),
    ];
    all.into_iter().flatten().chain(of_inputs(axes)).collect()
}

/// Effects of other inputs: the slope of each at its zero, and every step.
fn of_inputs(axes: &[&AxisCalibration]) -> Vec<ComparedNumber> {
    let mut names: Vec<&str> =
        axes.iter().flat_map(|axis| axis.other_signals()).map(|input| input.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let slopes = names.iter().filter_map(|name| {
        let slope = |axis: &AxisCalibration| axis.slope_of_input(name);
        number(&format!("drift per unit of {name} at its zero"), "deg/h per unit", axes, slope)
    });
    let own = |axis: &AxisCalibration, term: &CorrectionTerm| term.shape.jump().is_some().then(|| axis.name_of(term));
    let mut steps: Vec<String> =
        axes.iter().flat_map(|axis| axis.correction.terms.iter().filter_map(move |term| own(axis, term))).collect();
    steps.sort();
    steps.dedup();
    let steps = steps.iter().filter_map(|name| {
        let height = |axis: &AxisCalibration| {
            let term = axis.correction.terms.iter().find(|term| axis.name_of(term) == *name)?;
            Some([term.value, term.sigma?])
        };
        number(name, "deg/h", axes, height)
    });
    slopes.chain(steps).collect()
}

fn number(
    name: &str,
    unit: &str,
    axes: &[&AxisCalibration],
    value: impl Fn(&AxisCalibration) -> Option<[f64; 2]>,
) -> Option<ComparedNumber> {
    let values: Vec<Option<[f64; 2]>> = axes.iter().map(|axis| value(axis)).collect();
    let known: Vec<[f64; 2]> = values.iter().flatten().copied().collect();
    let apart = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).abs() / a[1].hypot(b[1]);
    let pairs = known.iter().enumerate().flat_map(|(i, a)| known[i + 1..].iter().map(move |b| apart(a, b)));
    let sigmas = pairs.filter(|s| s.is_finite()).reduce(f64::max);
    (!known.is_empty()).then(|| ComparedNumber { name: name.to_owned(), unit: unit.to_owned(), values, sigmas })
}
