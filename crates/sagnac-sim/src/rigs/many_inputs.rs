//! A gyro whose drift has several causes: its block, a gradient to its cavity, the path-length loop's voltage and mode.
//!
//! ```text
//! Ṫ_block = (T_chamber − T_block)/lag_block        Ṫ_cavity = (T_chamber + heat − T_cavity)/lag_cavity
//! V = (mode − 0.08·(T_block − 20))/0.012            a reset to the mode nearest to 0 V where |V| reaches 70 V
//! d = Σ aᵢuⁱ + knee·tanh((T_block − 20)/6) + r·Ṫ_block + r_c·Ṫ_cavity + g·(T_cavity − T_block) + v·V + steps[mode]
//! ε = s_T·(T_block − 20) + s_g·(T_cavity − T_block) + s_V·V
//! n = ∫ (Ω_table + Ω_input + d) dt / (S₀·(1 + ε·1e-6))
//! ```
//!
//! with u = (T_block − 20 °C)/30 °C; a heater at the cavity is on for 47 minutes of every 94. Which mode holds depends on the way there, so no function of temperature stands for
//! steps and voltage. A bystander, a walk that nothing depends on, is logged beside them. While the loop resets (2 s) the
//! rows are not valid.

use std::io::Write;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::rigs::counter::Counter;
use crate::thermal::{Leg, Profile};

const WAVES_PER_C: f64 = 0.08;
const WAVES_PER_V: f64 = 0.012;
const RESET_V: f64 = 70.0;
const RESET_S: u32 = 2;
const HEATED_S: u32 = 2820;
/// Time at each rate of the table, s.
const DWELL_S: u32 = 100;
/// Modes are counted from this one up.
const FIRST_MODE: i64 = -2;

/// Parameters of gyro, thermometers and chamber.
#[derive(Clone, Debug, PartialEq)]
pub struct ManyInputs {
    /// Chamber and gyro at the start, °C.
    pub start_c: f64,
    /// Profile.
    pub legs: Vec<Leg>,
    /// Time constants of block and cavity, s.
    pub lags_s: [f64; 2],
    /// Drift of the block: ascending powers of u, °/h.
    pub drift_dph: Vec<f64>,
    /// Knee at 20 °C, 6 °C wide, °/h.
    pub knee_dph: f64,
    /// Rate effects of block and cavity, °/h per °C/min.
    pub rate_effects: [f64; 2],
    /// Drift per °C of cavity less block, °/h.
    pub gradient_dph_per_c: f64,
    /// Drift per volt, °/h.
    pub voltage_dph_per_v: f64,
    /// Drift on each mode from −2 up, °/h; 0 beyond.
    pub steps_dph: Vec<f64>,
    /// Deviation of the scale factor, ppm per °C of the block, per °C of cavity less block, and per volt.
    pub scale_ppm_per: [f64; 3],
    /// Rates of a table below the gyro, °/s, each for 100 s, gone through again and again; none: it rests.
    pub rates_dps: Vec<f64>,
    /// By how much the heater at the cavity warms it in the end, °C.
    pub cavity_heat_c: f64,
    /// Noise of the thermometers, °C, and their step.
    pub thermometer_noise_c: f64,
    /// See `thermometer_noise_c`.
    pub thermometer_lsb_c: f64,
    /// Input rate, °/h.
    pub input_dph: f64,
    /// Angle random walk, °/√h.
    pub arw_deg_rt_h: f64,
    /// Scale factor, arcsec per count.
    pub arcsec_per_count: f64,
}

impl ManyInputs {
    /// Two cycles −10 … 50 °C at 1 °C/min with soaks of an hour; a cubic, a rate effect, and nothing else; navigation grade.
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

    /// The log of one run, as the bytes of a CSV file; with the reference rate where there is a table.
    pub fn csv(&self, seed: u64) -> Vec<u8> {
        let mut out =
            b"time_s,temperature_c_block,temperature_c_cavity,counts,valid,aux_path_length_v,aux_mode,aux_bystander"
                .to_vec();
        let turns = !self.rates_dps.is_empty();
        out.extend_from_slice(if turns { b",reference_rate_dps\n" } else { b"\n" });
        let profile = Profile::new(self.start_c, &self.legs, 1);
        let mut counter = Counter::new(seed, self.arw_deg_rt_h);
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x696e_7075_7473);
        let mut nodes_c = [self.start_c; 2];
        let (mut mode, mut reset_until, mut bystander) = (0, 0, 0.0);
        for second in 1..=profile.length_s() as u32 {
            let chamber_c = profile.at(f64::from(second));
            let before_c = nodes_c;
            let heat_c = if second / HEATED_S % 2 == 1 { self.cavity_heat_c } else { 0.0 };
            for ((node, lag_s), to_c) in nodes_c.iter_mut().zip(self.lags_s).zip([chamber_c, chamber_c + heat_c]) {
                *node = to_c + (*node - to_c) * libm::exp(-1.0 / lag_s);
            }
            let waves = WAVES_PER_C * (nodes_c[0] - 20.0);
            let mut volts = (mode as f64 - waves) / WAVES_PER_V;
            if volts.abs() >= RESET_V || second == 1 {
                mode = libm::round(waves) as i64;
                volts = (mode as f64 - waves) / WAVES_PER_V;
                reset_until = second + RESET_S;
            }
            let rates_cpm = [0, 1].map(|at| (nodes_c[at] - before_c[at]) * 60.0);
            let drift = self.drift(nodes_c, rates_cpm, volts, mode);
            let leg = ((second - 1) / DWELL_S) as usize % self.rates_dps.len().max(1);
            let table_dps = self.rates_dps.get(leg).copied().unwrap_or(0.0);
            let scale = self.arcsec_per_count * (1.0 + self.epsilon_ppm(nodes_c, volts) * 1e-6);
            let counts = counter.count(3600.0 * table_dps + self.input_dph + drift, 1.0, scale);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            bystander += 0.01 * normal();
            let readings = nodes_c.map(|node| {
                let lsb = self.thermometer_lsb_c;
                libm::round((node + self.thermometer_noise_c * normal()) / lsb) * lsb
            });
            let valid = u8::from(second >= reset_until);
            // A Vec takes every byte it is given.
            let _ = write!(
                out,
                "{second},{:.6},{:.6},{counts},{valid},{volts:.4},{mode},{bystander:.5}",
                readings[0], readings[1]
            );
            let _ = if turns { writeln!(out, ",{table_dps}") } else { writeln!(out) };
        }
        out
    }

    /// ε of block and cavity, °C, and of the loop's voltage, ppm.
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
