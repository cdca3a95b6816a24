//! A gyro whose drift has several causes: its block, a gradient to its cavity, the path-length loop's voltage and mode.
//!
//! ```text
//! Ṫ_block = (T_chamber − T_block)/lag_block        Ṫ_cavity = (T_chamber + heat − T_cavity)/lag_cavity
//! V = (mode − 0.08·(T_block − 20))/0.012            reset to the mode nearest to 0 V where |V| reaches 70 V
//! d = Σ aᵢuⁱ + knee·tanh((T_block − 20)/6) + r·Ṫ_block + r_c·Ṫ_cavity + g·(T_cavity − T_block) + v·V + steps[mode]
//! ε = s_T·(T_block − 20) + s_g·(T_cavity − T_block) + s_V·V
//! n = ∫ (Ω_table + Ω_input + d) dt / (S₀·(1 + ε·1e-6))
//! ```
//!
//! with u = (T_block − 20 °C)/30 °C. A heater at the cavity is on for 47 minutes of every 94. The mode in use depends on
//! the history, so no function of temperature replaces steps and voltage. A bystander, a random walk without any
//! effect, is logged as well. During a reset (2 s) rows are invalid.

use std::io::Write;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::profile::{Leg, Profile};
use crate::rigs::counter::RigCounter;

/// Growth of the path with block temperature, wavelengths per °C.
const WAVES_PER_C: f64 = 0.08;
/// Path change of the mirror, wavelengths per V.
const WAVES_PER_V: f64 = 0.012;
/// Voltage at which the loop resets.
const RESET_V: f64 = 70.0;
/// Length of a reset, s.
const RESET_S: u32 = 2;
/// Half a period of the heater, s.
const HEATED_S: u32 = 2820;
/// Time at each rate of the table, s.
const DWELL_S: u32 = 100;
/// Mode of the first entry of `steps_dph`.
const FIRST_MODE: i64 = -2;

/// Parameters of gyro, thermometers and chamber.
#[derive(Clone, Debug, PartialEq)]
pub struct ManyInputs {
    /// Temperature of chamber and gyro at the start, °C.
    pub start_c: f64,
    /// Temperature profile.
    pub legs: Vec<Leg>,
    /// Time constants of block and cavity, s.
    pub lags_s: [f64; 2],
    /// Drift of the block: ascending powers of u, °/h.
    pub drift_dph: Vec<f64>,
    /// Knee at 20 °C, 6 °C wide, °/h.
    pub knee_dph: f64,
    /// Rate effects of block and cavity, °/h per °C/min.
    pub rate_effects: [f64; 2],
    /// Drift per °C of cavity minus block, °/h.
    pub gradient_dph_per_c: f64,
    /// Drift per volt, °/h.
    pub voltage_dph_per_v: f64,
    /// Drift on each mode from −2 up, °/h; 0 beyond.
    pub steps_dph: Vec<f64>,
    /// Deviation of the scale factor, ppm per °C of the block, per °C of cavity minus block, and per volt.
    pub scale_ppm_per: [f64; 3],
    /// Rates of a rate table, °/s, each for 100 s, repeated; empty for a gyro at rest.
    pub rates_dps: Vec<f64>,
    /// Steady temperature rise of the cavity by its heater, °C.
    pub cavity_heat_c: f64,
    /// Noise of the thermometers, standard deviation, °C.
    pub thermometer_noise_c: f64,
    /// Resolution of the thermometers, °C.
    pub thermometer_lsb_c: f64,
    /// Input rate, °/h.
    pub input_dph: f64,
    /// Angle random walk, °/√h.
    pub arw_deg_rt_h: f64,
    /// Scale factor, arcsec per count.
    pub arcsec_per_count: f64,
}

impl ManyInputs {
    /// Two cycles −10 … 50 °C at 1 °C/min with soaks of an hour. A cubic and a rate effect only; navigation grade.
    pub fn plain() -> Self {
        let soak = Leg::Soak(3600.0);
        let cycle = [soak, Leg::Ramp(50.0, 1.0), soak, Leg::Ramp(-10.0, 1.0)];
        Self {
            start_c: -10.0,
            legs: [cycle, cycle].concat(),
            lags_s: [900.0, 200.0],
            drift_dph: vec![0.0, 0.01, -0.008, 0.006],
            knee_dph: 0.0,
            rate_effects: [0.02, 0.0],
            gradient_dph_per_c: 0.0,
            voltage_dph_per_v: 0.0,
            steps_dph: Vec::new(),
            scale_ppm_per: [0.0; 3],
            rates_dps: Vec::new(),
            cavity_heat_c: 0.0,
            thermometer_noise_c: 0.005,
            thermometer_lsb_c: 0.01,
            input_dph: 4.498,
            arw_deg_rt_h: 0.002,
            arcsec_per_count: 0.05,
        }
    }

    /// The log of one run as the bytes of a CSV file; with the reference rate if there is a rate table.
    pub fn csv(&self, seed: u64) -> Vec<u8> {
        let mut out =
            b"time_s,temperature_c_block,temperature_c_cavity,counts,valid,aux_path_length_v,aux_mode,aux_bystander"
                .to_vec();
        let has_table = !self.rates_dps.is_empty();
        out.extend_from_slice(if has_table { b",reference_rate_dps\n" } else { b"\n" });
        let profile = Profile::new(self.start_c, &self.legs, 1);
        let mut state = State::start(self, seed);
        for second in 1..=profile.length_s() as u32 {
            let row = self.second(&mut state, second, profile.at(f64::from(second)));
            let valid = u8::from(second >= state.reset_until);
            // Writing to a Vec cannot fail.
            let _ = write!(
                out,
                "{second},{:.6},{:.6},{},{valid},{:.4},{},{:.5}",
                row.readings_c[0], row.readings_c[1], row.counts, row.volts, state.mode, state.bystander
            );
            let _ = if has_table { writeln!(out, ",{}", row.table_dps) } else { writeln!(out) };
        }
        out
    }

    /// Advances by a second at a temperature of the chamber.
    fn second(&self, state: &mut State, second: u32, chamber_c: f64) -> SecondRow {
        let before_c = state.nodes_c;
        let heat_c = if second / HEATED_S % 2 == 1 { self.cavity_heat_c } else { 0.0 };
        let targets_c = [chamber_c, chamber_c + heat_c];
        for ((node, lag_s), to_c) in state.nodes_c.iter_mut().zip(self.lags_s).zip(targets_c) {
            *node = to_c + (*node - to_c) * libm::exp(-1.0 / lag_s);
        }
        let nodes_c = state.nodes_c;
        let volts = state.volts(second);
        let rates_cpm = [0, 1].map(|at| (nodes_c[at] - before_c[at]) * 60.0);
        let drift = self.drift(nodes_c, rates_cpm, volts, state.mode);
        let leg = ((second - 1) / DWELL_S) as usize % self.rates_dps.len().max(1);
        let table_dps = self.rates_dps.get(leg).copied().unwrap_or(0.0);
        let scale = self.arcsec_per_count * (1.0 + self.epsilon_ppm(nodes_c, volts) * 1e-6);
        let counts = state.counter.count(3600.0 * table_dps + self.input_dph + drift, 1.0, scale);
        let mut normal = || -> f64 { StandardNormal.sample(&mut state.rng) };
        state.bystander += 0.01 * normal();
        let readings_c = nodes_c.map(|node| {
            let lsb = self.thermometer_lsb_c;
            libm::round((node + self.thermometer_noise_c * normal()) / lsb) * lsb
        });
        SecondRow { readings_c, counts, volts, table_dps }
    }

    /// ε at temperatures of block and cavity, °C, and a voltage of the loop; ppm.
    pub fn epsilon_ppm(&self, [block_c, cavity_c]: [f64; 2], volts: f64) -> f64 {
        let causes = [block_c - 20.0, cavity_c - block_c, volts];
        self.scale_ppm_per.iter().zip(causes).map(|(per, cause)| per * cause).sum()
    }

    fn drift(&self, [block_c, cavity_c]: [f64; 2], rates_cpm: [f64; 2], volts: f64, mode: i64) -> f64 {
        let u = (block_c - 20.0) / 30.0;
        let step = usize::try_from(mode - FIRST_MODE).ok().and_then(|at| self.steps_dph.get(at));
        self.drift_dph.iter().rev().fold(0.0, |sum, a| sum * u + a)
            + self.knee_dph * libm::tanh((block_c - 20.0) / 6.0)
            + self.rate_effects[0] * rates_cpm[0]
            + self.rate_effects[1] * rates_cpm[1]
            + self.gradient_dph_per_c * (cavity_c - block_c)
            + self.voltage_dph_per_v * volts
            + step.copied().unwrap_or(0.0)
    }
}

/// Memory of a run.
struct State {
    counter: RigCounter,
    rng: ChaCha8Rng,
    /// Temperatures of block and cavity.
    nodes_c: [f64; 2],
    mode: i64,
    /// The second from which rows are valid again.
    reset_until: u32,
    bystander: f64,
}

/// Values of a row next to the state.
struct SecondRow {
    readings_c: [f64; 2],
    counts: f64,
    volts: f64,
    table_dps: f64,
}

impl State {
    fn start(rig: &ManyInputs, seed: u64) -> Self {
        Self {
            counter: RigCounter::new(seed, rig.arw_deg_rt_h),
            rng: ChaCha8Rng::seed_from_u64(seed ^ 0x696e_7075_7473),
            nodes_c: [rig.start_c; 2],
            mode: 0,
            reset_until: 0,
            bystander: 0.0,
        }
    }

    /// Voltage of the mirror at the block's temperature, after a reset if one is due.
    fn volts(&mut self, second: u32) -> f64 {
        let waves = WAVES_PER_C * (self.nodes_c[0] - 20.0);
        let volts = (self.mode as f64 - waves) / WAVES_PER_V;
        if volts.abs() < RESET_V && second != 1 {
            return volts;
        }
        self.mode = libm::round(waves) as i64;
        self.reset_until = second + RESET_S;
        (self.mode as f64 - waves) / WAVES_PER_V
    }
}
