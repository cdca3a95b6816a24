//! A gyro on a rate table inside a thermal chamber: soaks at several temperatures, all rates at each.
//!
//! ```text
//! n = ∫ (Ω_table + Ω_Earth + d(T)) dt / (S₀·(1 + ε(T)·1e-6))       d, ε: powers of u = (T − 15 °C)/55 °C
//! ```
//!
//! The gyro has the temperature of the chamber, without a lag; the table changes its rate at once.

use std::io::Write;

use crate::profile::{Leg, Profile};
use crate::rigs::counter::RigCounter;

/// Parameters of gyro, table and chamber.
#[derive(Clone, Debug, PartialEq)]
pub struct RateTable {
    /// Temperatures of the soaks, °C.
    pub plateaus_c: Vec<f64>,
    /// Length of each soak, s; the chamber ramps at 1 °C/min between them.
    pub soak_s: f64,
    /// Rates of the table, °/s, each for `dwell_s`, repeated.
    pub rates_dps: Vec<f64>,
    /// Time at each rate, s (whole seconds).
    pub dwell_s: u32,
    /// Earth rate along the axis, °/h.
    pub earth_dph: f64,
    /// Drift: ascending powers of u, °/h.
    pub drift_dph: Vec<f64>,
    /// Deviation of the scale factor: ascending powers of u, ppm.
    pub scale_ppm: Vec<f64>,
    /// Angle random walk, °/√h.
    pub arw_deg_rt_h: f64,
    /// Nominal scale factor S₀, arcsec per count.
    pub arcsec_per_count: f64,
}

impl RateTable {
    /// −40 … +70 °C in steps of ten, 25 minutes each; ±10 °/s, ±5 °/s and rest; a navigation-grade gyro.
    pub fn domain_notes() -> Self {
        Self {
            plateaus_c: (0..12).map(|i| -40.0 + 10.0 * f64::from(i)).collect(),
            soak_s: 1500.0,
            rates_dps: vec![10.0, -10.0, 5.0, -5.0, 0.0],
            dwell_s: 100,
            earth_dph: 4.498,
            drift_dph: vec![0.01, 0.02, -0.015],
            scale_ppm: vec![120.0, -18.0, 9.0],
            arw_deg_rt_h: 0.003,
            arcsec_per_count: 1.059,
        }
    }

    /// ε at a temperature, ppm.
    pub fn epsilon_ppm(&self, celsius: f64) -> f64 {
        powers(&self.scale_ppm, celsius)
    }

    /// d at a temperature, °/h.
    pub fn bias_dph(&self, celsius: f64) -> f64 {
        powers(&self.drift_dph, celsius)
    }

    /// One run as the bytes of a CSV file; with the reference rate if `with_reference`.
    pub fn csv(&self, seed: u64, with_reference: bool) -> Vec<u8> {
        let mut legs = Vec::new();
        for celsius in &self.plateaus_c {
            legs.extend([Leg::Ramp(*celsius, 1.0), Leg::Soak(self.soak_s)]);
        }
        let start_c = self.plateaus_c.first().copied().unwrap_or(25.0);
        let profile = Profile::new(start_c, &legs, 1);
        let mut counter = RigCounter::new(seed, self.arw_deg_rt_h);
        let mut out = Vec::new();
        let reference = if with_reference { ",reference_rate_dps" } else { "" };
        // Writing to a Vec cannot fail.
        let _ = writeln!(out, "time_s,temperature_c,counts{reference}");
        for second in 1..=profile.length_s() as u32 {
            let celsius = profile.at(f64::from(second) - 0.5);
            let leg = ((second - 1) / self.dwell_s) as usize % self.rates_dps.len().max(1);
            let table_dps = self.rates_dps.get(leg).copied().unwrap_or(0.0);
            let rate_dph = 3600.0 * table_dps + self.earth_dph + self.bias_dph(celsius);
            let scale = self.arcsec_per_count * (1.0 + self.epsilon_ppm(celsius) * 1e-6);
            let counts = counter.count(rate_dph, 1.0, scale);
            let _ = write!(out, "{second},{celsius:.4},{counts}");
            let _ = if with_reference { writeln!(out, ",{table_dps}") } else { writeln!(out) };
        }
        out
    }
}

fn powers(coefficients: &[f64], celsius: f64) -> f64 {
    let u = (celsius - 15.0) / 55.0;
    coefficients.iter().rev().fold(0.0, |sum, a| sum * u + a)
}
