//! The noise of an axis as its setup states it, otherwise as the Allan deviations of the log show it.
//!
//! Fails for rows without times: they have neither a floor nor slow noise.

use crate::calibration::NoiseFloor;
use crate::noise_model::processes::SlowNoise;
use crate::window::Windows;
use sagnac_log::setup::Setup;
use sagnac_noise::{MeasuredNoise, NoiseTerms};
use sagnac_units::ARCSEC_RT_S_PER_DEG_RT_H;

/// The noise of an axis: as given, otherwise measured; with its origin in words.
pub(crate) fn noise_of(windows: &Windows, axis: usize, setup: &Setup) -> Option<(MeasuredNoise, &'static str)> {
    windows.shape.window.seconds()?;
    if let Some(given) = setup.noise {
        let n_arcsec_rt_s = given.n_deg_rt_h * ARCSEC_RT_S_PER_DEG_RT_H;
        let given = NoiseTerms { n_arcsec_rt_s, q_arcsec: given.q_arcsec };
        return Some((MeasuredNoise::stated(given), "setup"));
    }
    windows.measured_noise(axis).map(|noise| (noise, "Allan deviations of the log"))
}

/// The noise floor of a nominal window.
pub(crate) fn noise_floor_of(windows: &Windows, axis: usize, setup: &Setup) -> Option<NoiseFloor> {
    let (MeasuredNoise { terms, filter_hz, .. }, source) = noise_of(windows, axis, setup)?;
    let value_dph = Some(terms.floor_dph(windows.shape.nominal_s)).filter(|value| value.is_finite() && *value > 0.0)?;
    let (n_deg_rt_h, q_arcsec, source) = (terms.n_deg_rt_h(), terms.q_arcsec, source.to_owned());
    let second_over_first = windows.second_over_first(axis);
    let row_s = windows.shape.timed.then_some(windows.shape.sample_interval_s);
    Some(NoiseFloor { value_dph, n_deg_rt_h, q_arcsec, source, filter_hz, second_over_first, row_s })
}

/// The slow noise that a setup states, and the white variance of a nominal window next to it, (°/h)².
pub(crate) fn stated_noise(windows: &Windows, axis: usize, setup: &Setup) -> Option<(SlowNoise, f64)> {
    let white = noise_floor_of(windows, axis, setup)?.value_dph.powi(2);
    Some((SlowNoise::stated(setup.noise?, white)?, white))
}
