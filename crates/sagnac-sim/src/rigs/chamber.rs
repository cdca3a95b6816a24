//! A gyro block that follows a thermal chamber with a lag.
//!
//! ```text
//! Ṫ_block = (T_chamber − T_block)/lag        d = Σ aᵢuⁱ + c·Ṫ_block,   u = (T_block − 15 °C)/55 °C
//! ```
//!
//! The thermometer is on the block and reads in steps of its LSB. The drift is in powers of u, not in the fitter's
//! basis. Its rate is the true one of the block, not that of a filtered reading. No gradient within the block.

use crate::profile::{Leg, Profile};
use crate::rigs::Row;
use crate::rigs::counter::RigCounter;

/// Parameters of gyro, block and chamber.
#[derive(Clone, Debug, PartialEq)]
pub struct LaggedChamber {
    /// Temperature of chamber and block at the start, °C.
    pub start_c: f64,
    /// Temperature profile.
    pub legs: Vec<Leg>,
    /// Time constant of the block, s.
    pub block_lag_s: f64,
    /// Resolution of the thermometer, °C.
    pub thermometer_lsb_c: f64,
    /// Drift: ascending powers of u, °/h.
    pub drift_dph: Vec<f64>,
    /// Rate effect, °/h per °C/min of the block.
    pub rate_effect: f64,
    /// Input rate, °/h.
    pub input_dph: f64,
    /// Angle random walk, °/√h.
    pub arw_deg_rt_h: f64,
    /// Scale factor, arcsec per count.
    pub arcsec_per_count: f64,
    /// Interval of a row, s (whole seconds).
    pub row_s: u32,
}

impl LaggedChamber {
    /// The case of the domain notes §2: ±1 °C/min with soaks between −40 and +70 °C, block lag 20 min, a
    /// cubic and 0.05 °/h per °C/min, ARW 0.003 °/√h, thermometer steps of 0.0625 °C; counts of a 28 cm
    /// triangle (2.42 arcsec per fringe) interpolated by sixteen.
    pub fn domain_notes() -> Self {
        let soak = Leg::Soak(13_200.0);
        Self {
            start_c: -40.0,
            legs: vec![soak, Leg::Ramp(70.0, 1.0), soak, Leg::Ramp(-40.0, 1.0)],
            block_lag_s: 1200.0,
            thermometer_lsb_c: 0.0625,
            drift_dph: vec![0.01, 0.004, -0.012, 0.014],
            rate_effect: 0.05,
            input_dph: 4.498,
            arw_deg_rt_h: 0.003,
            arcsec_per_count: 0.151_25,
            row_s: 1,
        }
    }

    /// The same gyro on the standard profile of a retest, 14.8 h: at ±1 °C/min soaks of 1.5 h at −40, 25, 70, 25 and −40 °C, then to 70 and
    /// back to −40 °C without soaks. Only the soaks at 25 °C, after heating and after cooling, can show a memory of the direction.
    pub fn standard(self) -> Self {
        let soak = Leg::Soak(5400.0);
        let ramp = |to_c: f64| Leg::Ramp(to_c, 1.0);
        let soaked = [25.0, 70.0, 25.0, -40.0].into_iter().flat_map(|to_c| [ramp(to_c), soak]);
        let legs = std::iter::once(soak).chain(soaked).chain([ramp(70.0), ramp(-40.0)]).collect();
        Self { start_c: -40.0, legs, ..self }
    }

    /// Drift at a block temperature and rate, °/h.
    fn drift(&self, block_c: f64, rate_cpm: f64) -> f64 {
        let u = (block_c - 15.0) / 55.0;
        self.drift_dph.iter().rev().fold(0.0, |sum, a| sum * u + a) + self.rate_effect * rate_cpm
    }

    /// One run through the profile.
    pub fn run(&self, seed: u64) -> impl Iterator<Item = Row> + use<> {
        let gyro = self.clone();
        let profile = Profile::new(self.start_c, &self.legs, 1);
        let mut counter = RigCounter::new(seed, gyro.arw_deg_rt_h);
        let mut block_c = gyro.start_c;
        let keep = libm::exp(-1.0 / gyro.block_lag_s);
        let rows = profile.length_s() as u32 / gyro.row_s;
        (0..rows).map(move |row| {
            let first = row * gyro.row_s;
            let mut quanta = 0.0;
            for second in first + 1..=first + gyro.row_s {
                let chamber_c = profile.at(f64::from(second));
                let before_c = block_c;
                block_c = chamber_c + (block_c - chamber_c) * keep;
                let rate_cpm = (block_c - before_c) * 60.0;
                let rate_dph = gyro.input_dph + gyro.drift(f64::midpoint(before_c, block_c), rate_cpm);
                quanta += counter.count(rate_dph, 1.0, gyro.arcsec_per_count);
            }
            let temperature_c = libm::round(block_c / gyro.thermometer_lsb_c) * gyro.thermometer_lsb_c;
            Row { time_s: f64::from(first + gyro.row_s), temperature_c, counts: quanta }
        })
    }
}
