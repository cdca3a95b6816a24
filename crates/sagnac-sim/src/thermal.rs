//! Temperatures of the gyro: chamber, block, anode region and thermometers.
//!
//! ```text
//! Ṫ_block = (T_chamber − T_block)/lag         Ṫ_anode = (T_chamber + heat − T_anode)/lag_anode
//! reading = LSB·round((T_lagged + offset + noise)/LSB)
//! ```
//!
//! Advanced in steps of one second. Each node decays exactly, e^(−1 s/lag), towards the chamber's temperature at the
//! end of the second; that is accurate to half a second against lags of minutes.
//!
//! Each region is one lump: there is no gradient within the block, and the block does not heat itself.

use rand_chacha::ChaCha8Rng;

use crate::profile::Profile;
use crate::random::{Stream, generator, normal};
use crate::scenario::{Scenario, ScenarioError, SensorLocation};

/// Temperatures over one second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Temperatures {
    /// Air of the chamber at the end of the second, °C.
    pub chamber_c: f64,
    /// Mean of the block, °C.
    pub block_c: f64,
    /// Temperature rate of the block, °C/min.
    pub block_cpm: f64,
    /// Region near the anode at the end of the second, °C.
    pub anode_c: f64,
    /// Anode minus block, minus its steady value, °C.
    pub gradient_c: f64,
}

/// A first-order lag in steps of one second.
#[derive(Clone, Copy, Debug)]
struct Lag {
    /// e^(−1 s/lag).
    keep: f64,
}

impl Lag {
    fn new(lag_s: f64) -> Self {
        Self { keep: if lag_s > 0.0 { libm::exp(-1.0 / lag_s) } else { 0.0 } }
    }

    fn follow(self, value: &mut f64, target: f64) {
        *value = target + (*value - target) * self.keep;
    }
}

/// Lags and thermometers as built, and the profile they follow.
#[derive(Clone, Debug)]
pub(crate) struct Thermal {
    profile: Profile,
    start_c: f64,
    block: Lag,
    anode: Lag,
    /// Temperature rise near the anode, °C: at the start, and in the steady state.
    anode_heat_c: [f64; 2],
    sensors: Vec<Sensor>,
}

#[derive(Clone, Debug)]
struct Sensor {
    location: SensorLocation,
    lag: Lag,
    noise_c: f64,
    lsb_c: f64,
    offset_c: f64,
}

/// Temperatures at the present second.
#[derive(Clone, Debug)]
pub(crate) struct ThermalState {
    block_c: f64,
    anode_c: f64,
    /// Lagged temperature of each thermometer.
    sensors_c: Vec<f64>,
    rng: ChaCha8Rng,
}

impl Thermal {
    pub(crate) fn build(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let heat_c = scenario.block.anode_heat_c;
        let sensors = scenario.thermometer.iter().map(|t| Sensor {
            location: t.at,
            lag: Lag::new(t.lag_s),
            noise_c: t.noise_c,
            lsb_c: t.lsb_c,
            offset_c: t.offset_c,
        });
        Ok(Self {
            profile: scenario.profile()?,
            start_c: scenario.chamber.start_c,
            block: Lag::new(scenario.block.lag_s),
            anode: Lag::new(scenario.block.anode_lag_s),
            // The anode of a warm gyro is warm; after a cold start it warms up.
            anode_heat_c: [if scenario.chamber.cold_start { 0.0 } else { heat_c }, heat_c],
            sensors: sensors.collect(),
        })
    }

    /// Length of the profile, s.
    pub(crate) fn length_s(&self) -> f64 {
        self.profile.length_s()
    }

    /// The gyro at rest at the start temperature.
    pub(crate) fn start(&self, seed: u64) -> ThermalState {
        let anode_c = self.start_c + self.anode_heat_c[0];
        let start_c = |sensor: &Sensor| match sensor.location {
            SensorLocation::Anode => anode_c,
            SensorLocation::Block | SensorLocation::Chamber => self.start_c,
        };
        ThermalState {
            block_c: self.start_c,
            anode_c,
            sensors_c: self.sensors.iter().map(start_c).collect(),
            rng: generator(seed, Stream::Thermometer),
        }
    }

    /// Advances by the second that ends at `end_s`; the readings at its end go to `readings_c`.
    pub(crate) fn second(&self, state: &mut ThermalState, end_s: f64, readings_c: &mut Vec<f64>) -> Temperatures {
        let chamber_c = self.profile.at(end_s);
        let before_c = state.block_c;
        let [_, heat_c] = self.anode_heat_c;
        self.block.follow(&mut state.block_c, chamber_c);
        self.anode.follow(&mut state.anode_c, chamber_c + heat_c);
        let (block_c, anode_c) = (state.block_c, state.anode_c);
        readings_c.clear();
        for (sensor, lagged_c) in self.sensors.iter().zip(&mut state.sensors_c) {
            let target_c = match sensor.location {
                SensorLocation::Block => block_c,
                SensorLocation::Anode => anode_c,
                SensorLocation::Chamber => chamber_c,
            };
            sensor.lag.follow(lagged_c, target_c);
            let noise = if sensor.noise_c > 0.0 { normal(&mut state.rng) } else { 0.0 };
            readings_c.push(sensor.round(*lagged_c + sensor.offset_c + sensor.noise_c * noise));
        }
        Temperatures {
            chamber_c,
            block_c: f64::midpoint(before_c, block_c),
            block_cpm: (block_c - before_c) * 60.0,
            anode_c,
            gradient_c: anode_c - block_c - heat_c,
        }
    }

    /// A temperature in steps of a thermometer's LSB.
    pub(crate) fn round(&self, sensor: usize, celsius: f64) -> f64 {
        self.sensors.get(sensor).map_or(celsius, |sensor| sensor.round(celsius))
    }
}

impl Sensor {
    fn round(&self, celsius: f64) -> f64 {
        if self.lsb_c > 0.0 { libm::round(celsius / self.lsb_c) * self.lsb_c } else { celsius }
    }
}
