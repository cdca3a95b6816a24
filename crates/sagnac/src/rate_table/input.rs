//! Runs on a rate table: the rate of each axis.
//!
//! A run is turned where its log has a reference rate (or table angle) or the setup says `rate_dps` for its file. The
//! table's positive direction is that of the axis it turns; `[[table]] axis = "-z"` says it is the other one. The Earth's
//! rate is not in the reference: along a vertical table axis it is constant and part of the run offset.

use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, Reason};
use sagnac_log::setup::{Setup, TableRun};
use sagnac_units::DPH_PER_DPS;

/// Rates closer than this fraction of the largest are one rate; a rate below it is rest.
pub(crate) const SAME_RATE: f64 = 1e-3;
/// Bias that one rate alone cannot be distinguished from, °/h.
const LARGEST_BIAS_DPH: f64 = 100.0;

/// Rates of the table in the windows of one axis.
#[derive(Clone, Debug)]
pub(crate) struct RateTableInput {
    /// Per window of the whole set: rate along the axis, °/h; NaN where a run with a reference has none there.
    pub(crate) along_dph: Vec<f64>,
    /// Per window: rate about another axis of the gyro and that axis' letter, °/h; 0 where there is none.
    pub(crate) across_dph: Vec<(char, f64)>,
}

impl RateTableInput {
    /// `None` where neither log nor setup states that a table turned.
    ///
    /// # Errors
    /// A log of several axes without a statement of which one was turned.
    pub(crate) fn of(windows: &Windows, axis: usize, setup: &Setup) -> Result<Option<Self>> {
        let (rows, shape) = (&windows.rows, &windows.shape);
        let letter = shape.axes[axis];
        let mut letters = shape.axes.clone();
        letters.sort_unstable();
        letters.dedup();
        let turned_run = |run: usize| {
            let name = sagnac_units::format::file_name(windows.runs[run].file_at(windows.runs[run].start_ns));
            let table = setup.table_of(&name);
            let has_column =
                (0..windows.len()).any(|i| rows.run[i] as usize == run && rows.reference_dps[i].is_finite());
            (name, table, has_column)
        };
        let runs: Vec<_> = (0..windows.runs.len()).map(turned_run).collect();
        let turns = |(_, table, has_column): &(String, Option<&TableRun>, bool)| {
            *has_column || table.is_some_and(|table| table.rate_dps.is_some())
        };
        if !runs.iter().any(turns) {
            return Ok(None);
        }
        let mut out = Self { along_dph: vec![0.0; windows.len()], across_dph: vec![(letter, 0.0); windows.len()] };
        for (run, of_run) in runs.iter().enumerate().filter(|(_, run)| turns(run)) {
            let (name, table, has_column) = of_run;
            let (turned, sign) = match table.and_then(|table| table.axis.as_deref()) {
                Some(words) => axis_and_sign(words)?,
                None if letters.len() == 1 => (letter, 1.0),
                None => {
                    return Err(Error::input(
                        "this run was turned, and its gyro axis is not given",
                        "add [[table]] with file and axis (\"z\", or \"-z\" for the opposite direction) to the setup",
                    )
                    .file(name)
                    .column("table"));
                }
            };
            for i in (0..windows.len()).filter(|i| rows.run[*i] as usize == run) {
                let given = table.and_then(|table| table.rate_dps);
                let reference_dps = if *has_column { rows.reference_dps[i] } else { given.unwrap_or(f64::NAN) };
                let rate_dph = sign * reference_dps * DPH_PER_DPS;
                if turned == letter {
                    out.along_dph[i] = rate_dph;
                } else {
                    out.across_dph[i] = (turned, rate_dph);
                }
            }
        }
        // A column of zeros: nothing turned.
        let stands = |dph: &f64| *dph == 0.0;
        let still = out.along_dph.iter().all(stands) && out.across_dph.iter().all(|(_, dph)| stands(dph));
        Ok((!still).then_some(out))
    }

    /// Excludes windows without a rate of the table.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub(crate) fn leave_out_unknown(windows: &mut Windows, setup: &Setup) -> Result<()> {
        for axis in 0..windows.shape.axes.len() {
            let Some(turning) = Self::of(windows, axis, setup)? else { return Ok(()) };
            for (i, (along, (_, across))) in turning.along_dph.iter().zip(&turning.across_dph).enumerate() {
                if along.is_nan() || across.is_nan() {
                    windows.exclude(i, Reason::NoReference);
                }
            }
        }
        Ok(())
    }

    /// Refuses what is no small deviation of the scale factor: a reference of the other sign, a wrong scale. By the straight line of
    /// the measured rate over the table's; with one rate alone, through zero, and a bias of [`LARGEST_BIAS_DPH`] is allowed for.
    ///
    /// # Errors
    /// [`sagnac_log::ErrorKind::Refused`] beyond `most_ppm`.
    pub(crate) fn check_scale(&self, windows: &Windows, axis: usize, most_ppm: f64) -> Result<()> {
        let known = |i: &usize| windows.rows.excluded[*i].is_none() && self.along_dph[*i].is_finite();
        let used: Vec<usize> = (0..windows.len()).filter(known).collect();
        let several = self.rates(used.iter().copied()).len() > 1;
        let n = used.len() as f64;
        let mean =
            |value: &dyn Fn(usize) -> f64| if several { used.iter().map(|i| value(*i)).sum::<f64>() / n } else { 0.0 };
        let along = |i: usize| self.along_dph[i];
        let measured = |i: usize| windows.rate_dph(axis, i);
        let (mean_along, mean_measured) = (mean(&along), mean(&measured));
        let products: f64 = used.iter().map(|i| (along(*i) - mean_along) * (measured(*i) - mean_measured)).sum();
        let squares: f64 = used.iter().map(|i| (along(*i) - mean_along).powi(2)).sum();
        if squares == 0.0 {
            return Ok(());
        }
        let slope = products / squares;
        let slack = if several { 0.0 } else { LARGEST_BIAS_DPH / (squares / n).sqrt() };
        if (1.0 / slope - 1.0).abs() <= 1e-6 * most_ppm + slack {
            return Ok(());
        }
        let (letter, ppm) = (windows.shape.axes[axis], 1e6 * (1.0 / slope - 1.0));
        if !ppm.is_finite() {
            return Err(Error::refused(
                format!("axis {letter} does not follow the reference, so it has no scale factor"),
                "correct the axis under [[table]], or the column of the reference rate",
            )
            .column("scale_factor_deviation_max_ppm"));
        }
        // Rates have no count whose size could be wrong: cheap sensors are off by per cent.
        let remedy = match windows.shape.unit {
            AngleUnit::Quanta { .. } => format!(
                "correct arcsec_per_count, which seems wrong by a factor of {:.5}, or the unit of the reference",
                1.0 / slope
            ),
            AngleUnit::Arcsec => format!(
                "set scale_factor_deviation_max_ppm = {:.0} in the setup, or correct the unit of the rates or of the reference",
                1000.0 * (ppm.abs() * 1.2e-3).ceil()
            ),
        };
        let error = Error::refused(format!(
            "the scale factor of axis {letter} would deviate by {ppm:.0} ppm from its nominal value, and the limit is {most_ppm} ppm"
        ), remedy)
        .column("scale_factor_deviation_max_ppm");
        Err(match (slope + 1.0).abs() < 0.1 {
            true => error.help(format!(
                "reverse the reference with axis = \"-{letter}\" under [[table]]: counts and reference have opposite signs"
            )),
            false => error,
        })
    }

    /// Different rates along the axis among some windows, rising.
    pub(crate) fn rates(&self, members: impl Iterator<Item = usize>) -> Vec<f64> {
        let mut all: Vec<f64> = members.map(|i| self.along_dph[i]).filter(|rate| rate.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        let largest = all.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
        let mut rates: Vec<f64> = Vec::new();
        for rate in all {
            if rates.last().is_none_or(|last| rate - last > SAME_RATE * largest) {
                rates.push(rate);
            }
        }
        rates
    }
}

/// `z` or `-z`.
fn axis_and_sign(words: &str) -> Result<(char, f64)> {
    let (letter, sign) = match words.strip_prefix('-') {
        Some(rest) => (rest, -1.0),
        None => (words.strip_prefix('+').unwrap_or(words), 1.0),
    };
    let mut letters = letter.chars();
    match (letters.next(), letters.next()) {
        (Some(letter), None) if letter.is_ascii_alphanumeric() => Ok((letter, sign)),
        _ => Err(Error::input(
            "must be the letter of a gyro axis, with - for the opposite direction",
            "write it like axis = \"-z\"",
        )
        .column("table.axis")
        .value(words)),
    }
}
