//! Conversions between the units of the field, and numbers as people read them.
//!
//! Every crate of the host computes in °/h, arcsec, s, ns and °C; [`mod@format`] writes results.

pub mod format;

/// 1 °/s in °/h. (1 °/h is 1 arcsec/s, so arcsec/s and °/h need no factor.)
pub const DPH_PER_DPS: f64 = 3600.0;
/// 1 rad/s in °/h.
pub const DPH_PER_RADPS: f64 = 180.0 / std::f64::consts::PI * 3600.0;
/// Nanoseconds per second.
pub const NS_PER_S: f64 = 1e9;
/// arcsec/√s in one °/√h: 1 °/√h = 3600 arcsec / √(3600 s).
pub const ARCSEC_RT_S_PER_DEG_RT_H: f64 = 60.0;
/// 0 °C in K (exact by definition of the Celsius scale).
pub const KELVIN_AT_0_C: f64 = 273.15;
/// Earth's rotation rate in °/h: 7.292 115e-5 rad/s (WGS 84, NIMA TR8350.2).
pub const EARTH_RATE_DPH: f64 = 7.292_115e-5 * DPH_PER_RADPS;

/// Seconds as whole nanoseconds, or `None` if not finite or beyond ±292 years.
pub fn ns_from_s(seconds: f64) -> Option<i64> {
    let ns = (seconds * NS_PER_S).round();
    (ns.abs() < 9.2e18).then_some(ns as i64)
}

/// Nanoseconds as seconds.
pub fn s_from_ns(ns: i64) -> f64 {
    ns as f64 / NS_PER_S
}
