//! Detects a temperature ramp during a record, and removes the drift that it causes.
//!
//! An Allan deviation over a temperature ramp shows the thermal drift as rate ramp and rate random walk. The record is
//! divided into blocks of ten minutes. A ramp is a change of at least 1 °C between block means, with a block that moves by
//! 0.02 °C/min or more (the rate at which a soak counts as reached), or a change of 3 °C at any rate. On demand the drift is
//! removed first: the curve that `calibrate` fits over temperature and its rate, interpolated between the middles of windows.

use crate::fit::{FitOptions, Model, calibrate_with_report_data};
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::Batch;
use sagnac_log::setup::Setup;
use sagnac_units::format::significant;
use sagnac_units::{NS_PER_S, s_from_ns};

/// Length of a block, s.
const BLOCK_S: f64 = 600.0;
/// Temperature change of a ramp, °C, and the rate within it, °C/min.
const RAMP_C: f64 = 1.0;
const RAMP_CPM: f64 = 0.02;
/// Movement over which a drift can be fitted, °C.
const LEAST_SPAN_C: f64 = 0.5;
/// Temperature change that is a ramp at any rate, °C.
const SLOW_RAMP_C: f64 = 3.0;

/// One thermometer of one record, block by block.
#[derive(Clone, Debug, Default)]
pub(crate) struct RampWatch {
    block: Option<(i64, f64, f64)>,
    last: Option<(i64, f64)>,
    lo_c: f64,
    hi_c: f64,
    pace_cpm: f64,
    begun: bool,
}

impl RampWatch {
    /// The rows of a batch.
    pub(crate) fn push(&mut self, batch: &Batch, sensor: usize) {
        for (end_ns, celsius) in batch.end_ns.iter().zip(&batch.temperature_c[sensor]) {
            if !celsius.is_nan() {
                self.add(*end_ns, *celsius);
            }
        }
    }

    fn add(&mut self, time_ns: i64, celsius: f64) {
        let number = time_ns.div_euclid((BLOCK_S * NS_PER_S) as i64);
        match &mut self.block {
            Some((at, sum, count)) if *at == number => {
                *sum += celsius;
                *count += 1.0;
            }
            _ => {
                self.close();
                self.block = Some((number, celsius, 1.0));
            }
        }
    }

    fn close(&mut self) {
        let Some((at, sum, count)) = self.block.take() else { return };
        let mean_c = sum / count;
        if let Some((before, before_c)) = self.last {
            let minutes = (at - before) as f64 * BLOCK_S / 60.0;
            self.pace_cpm = self.pace_cpm.max(((mean_c - before_c) / minutes).abs());
        }
        if !self.begun {
            (self.lo_c, self.hi_c, self.begun) = (mean_c, mean_c, true);
        }
        (self.lo_c, self.hi_c) = (self.lo_c.min(mean_c), self.hi_c.max(mean_c));
        self.last = Some((at, mean_c));
    }

    /// Ends the record; describes the change if it is a ramp.
    pub(crate) fn verdict(mut self) -> Option<String> {
        self.close();
        let moved_c = self.hi_c - self.lo_c;
        let ramps = (moved_c >= RAMP_C && self.pace_cpm >= RAMP_CPM) || moved_c >= SLOW_RAMP_C;
        ramps.then(|| {
            format!(
                "the temperature moved by {moved_c:.1} °C in this record ({} °C/min at its fastest): its drift shows as rate ramp, rate \
                 random walk and bias instability (`--detrend temperature` takes it out)",
                significant(self.pace_cpm, 2)
            )
        })
    }
}

/// A record at rest is seldom a thermal test: a movement of half a degree will do, and the curve is zero in the middle of it,
/// which differences do not see.
fn for_a_room(setup: &Setup, windows: &Windows) -> Setup {
    let wanted = setup.use_thermometer.as_deref();
    let named = windows.shape.thermometers.iter().position(|name| Some(name.as_str()) == wanted);
    let means = windows.rows.mean_c.get(named.unwrap_or(0)).into_iter().flatten().zip(&windows.rows.excluded);
    let mut means: Vec<f64> =
        means.filter(|(mean_c, out)| mean_c.is_finite() && out.is_none()).map(|(mean_c, _)| *mean_c).collect();
    means.sort_unstable_by(f64::total_cmp);
    Setup {
        min_span_c: Some(setup.min_span_c.unwrap_or(LEAST_SPAN_C)),
        reference_c: means.get(means.len() / 2).copied().or(setup.reference_c),
        ..setup.clone()
    }
}

/// The drift of the axes of one run over its time, °/h.
#[derive(Clone, Debug)]
pub(crate) struct RampDrift {
    /// Middles of windows, ns.
    middle_ns: Vec<i64>,
    /// Per axis, at the middles.
    dph: Vec<Vec<f64>>,
}

impl RampDrift {
    /// Fits each run's drift over temperature.
    ///
    /// # Errors
    /// What fitting says: a record without a temperature, or with too little of a span.
    pub(crate) fn of(windows: Windows, setup: &Setup) -> Result<Vec<Self>> {
        let axes = windows.shape.axes.clone();
        let setup = &for_a_room(setup, &windows);
        let rows = windows.rows.clone();
        let runs = windows.runs.len();
        let options = FitOptions::new(Model::Auto);
        let (_, report_data) = calibrate_with_report_data(windows, setup, &options)
            .map_err(|e| e.help("remove --detrend to use the record as it is"))?;
        let mut drifts = vec![Self { middle_ns: Vec::new(), dph: vec![Vec::new(); axes.len()] }; runs];
        let index_of = |letter: char| report_data.axes.iter().find(|axis| axis.axis == letter);
        for i in 0..rows.run.len() {
            let fitted: Option<Vec<f64>> = axes
                .iter()
                .map(|letter| {
                    let point = index_of(*letter)?.points.get(i)?;
                    let drift = point.before_dph - point.after_dph;
                    drift.is_finite().then_some(drift)
                })
                .collect();
            let (Some(fitted), Some(run)) = (fitted, drifts.get_mut(rows.run[i] as usize)) else { continue };
            run.middle_ns.push(rows.start_ns[i] / 2 + rows.end_ns[i] / 2);
            run.dph.iter_mut().zip(fitted).for_each(|(column, value)| column.push(value));
        }
        if drifts.iter().any(|drift| drift.middle_ns.len() < 2) {
            return Err(Error::refused(
                "a run has fewer than two windows to remove a drift from",
                "remove --detrend, or set a shorter --window",
            ));
        }
        Ok(drifts)
    }

    /// Subtracts the drift from a batch's angles, `arcsec` per unit.
    pub(crate) fn take_from(&self, batch: &Batch, angles: &mut [Vec<f64>], arcsec: f64) {
        let mut one = vec![0.0; angles.len()];
        for row in 0..batch.len() {
            one.iter_mut().zip(&*angles).for_each(|(one, column)| *one = column[row]);
            self.take_from_one(batch.start_ns[row], batch.end_ns[row], &mut one, arcsec);
            angles.iter_mut().zip(&one).for_each(|(column, one)| column[row] = *one);
        }
    }

    /// Takes the drift over (start, end] out of the angles of all axes.
    pub(crate) fn take_from_one(&self, start_ns: i64, end_ns: i64, angles: &mut [f64], arcsec: f64) {
        let middle_ns = start_ns / 2 + end_ns / 2;
        let after = self.middle_ns.partition_point(|m| *m <= middle_ns).clamp(1, self.middle_ns.len() - 1);
        let (from, to) = (self.middle_ns[after - 1], self.middle_ns[after]);
        let part = ((middle_ns - from) as f64 / (to - from) as f64).clamp(0.0, 1.0);
        let seconds = s_from_ns(end_ns - start_ns);
        for (angle, drift) in angles.iter_mut().zip(&self.dph) {
            let dph = drift[after - 1] + part * (drift[after] - drift[after - 1]);
            *angle -= dph * seconds / arcsec;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// °C of every ten seconds of a day.
    fn verdict(celsius: impl Fn(f64) -> f64) -> Option<String> {
        let mut watch = RampWatch::default();
        (0..8640).for_each(|i| watch.add(i64::from(i) * 10_000_000_000, celsius(f64::from(i) / 360.0)));
        watch.verdict()
    }

    #[test]
    fn ramps_are_distinguished_from_soaks() {
        assert!(verdict(|hours| 20.0 + hours).is_some(), "24 °C at 0.017 °C/min");
        assert!(verdict(|hours| 20.0 + (hours - 12.0).clamp(0.0, 1.0) * 2.0).is_some(), "2 °C within an hour");
        assert_eq!(verdict(|hours| 20.0 + 0.05 * hours), None, "1.2 °C in a day");
        assert_eq!(verdict(|hours| 20.0 + 0.4 * hours.sin()), None, "a room");
    }
}
