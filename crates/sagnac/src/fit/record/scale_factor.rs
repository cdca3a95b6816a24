//! The scale factor and the misalignment of the record, from runs on a rate table.

use crate::calibration::{CorrectionTerm, Misalignment, PpmEstimate, ScaleFactor};
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::model::ActsOn;
use crate::model::input::Signal;
use crate::noise_model::processes::SlowNoise;
use crate::rate_table::plateaus::{plateaus_of, repeatability};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::AngleUnit;

/// Scale terms of a larger uncertainty are refused: the runs do not separate them from bias.
const SCALE_SIGMA_MAX_PPM: f64 = 1000.0;
/// arcsec in one rad.
const ARCSEC_PER_RAD: f64 = 180.0 / std::f64::consts::PI * 3600.0;

/// Refuses a scale term that the input rates do not determine.
pub(crate) fn check_scale(terms: &[CorrectionTerm], letter: char) -> Result<()> {
    let vague =
        |t: &&CorrectionTerm| t.acts_on == ActsOn::ScaleFactor && t.sigma.is_some_and(|s| s > SCALE_SIGMA_MAX_PPM);
    terms.iter().find(vague).map_or(Ok(()), |vague| {
        Err(Error::refused(format!(
            "a scale-factor term of axis {letter} would be {:.0} ± {:.0} ppm: the runs' input rates do not separate it from bias",
            vague.value,
            vague.sigma.unwrap_or(f64::NAN)
        ), "test at several input rates, or remove the scale terms from --model"))
    })
}

/// The scale factor, from a rate table; `None` where the axis was not turned at several rates.
pub(crate) fn scale_factor(
    fitted: &Fitted,
    problem: &LeastSquares<'_>,
    axis: usize,
    stated: Option<(SlowNoise, f64)>,
) -> Option<ScaleFactor> {
    let column = problem.column_of(Level::Scale)?;
    let (windows, shape) = (problem.windows(), &problem.windows().shape);
    let Signal::Thermometer(sensor) = problem.inputs[0].signal else { return None };
    let plateaus = plateaus_of(windows, &problem.used, axis, sensor, problem.turning.as_ref()?, stated);
    let at_reference = PpmEstimate { ppm: fitted.theta[column], sigma_ppm: fitted.sigma(column) };
    let arcsec_per_count = match shape.unit {
        AngleUnit::Quanta { arcsec_per_count, .. } => Some(arcsec_per_count * (1.0 + at_reference.ppm * 1e-6)),
        AngleUnit::Arcsec => None,
    };
    Some(ScaleFactor { arcsec_per_count, at_reference, repeatability: repeatability(&plateaus), plateaus })
}

pub(crate) fn misalignment(fitted: &Fitted, problem: &LeastSquares<'_>) -> Vec<Misalignment> {
    let across = problem.levels().iter().enumerate().filter_map(|(place, level)| match level {
        Level::Across(letter) => Some(Misalignment {
            towards: *letter,
            arcsec: fitted.theta[place] * ARCSEC_PER_RAD,
            sigma_arcsec: fitted.sigma(place) * ARCSEC_PER_RAD,
        }),
        _ => None,
    });
    across.collect()
}
