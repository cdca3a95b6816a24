//! Vectors of the path-length and intensity loops of a scenario.

use anyhow::{Context, Result};
use sagnac_loops::LoopTable;
use sagnac_sim::physics::free_spectral_range_hz;
use sagnac_sim::{LoopDesign, Scenario};
use sagnac_vectors::{Machine, Module};
use xtask::shell::root;

use crate::makes::making::Making;

const LIGHT: u32 = 1 << 9;
const CLOSED: u32 = 1 << 8;
const HOLD: u32 = 1 << 8;

/// The loops of a scenario, and their plant.
pub(super) struct Loops {
    pub(super) table: Vec<u8>,
    /// Photodiode code at the peak.
    peak: u32,
    /// Curvature of the vectors' plant, 2^-32 codes of light per code of actuator squared.
    curvature: u32,
    /// Lag of the actuator as a right shift of ticks.
    lag: u32,
}

pub(super) fn loops(scenario: &str, searches: bool) -> Result<Loops> {
    let text = std::fs::read_to_string(root().join(format!("scenarios/{scenario}/{scenario}.toml")))?;
    let mut scenario = Scenario::from_toml(&text)?;
    if !searches {
        // Without a search, which takes a heater a minute of ticks.
        scenario.path_length.sweep_s = 0.0;
    }
    let design = LoopDesign::build(&scenario)?;
    let (path_length, intensity) = (design.path_length.integers, design.intensity.integers);
    let table = LoopTable { tick_ns: 100_000, path_length, intensity };
    let (light, cavity) = (&scenario.intensity, &scenario.cavity);
    let peak = light.part_of_range * (light.photodiode_bits - 1.0).exp2();
    let detuning = free_spectral_range_hz(scenario.geometry.perimeter_m) / (cavity.gain_width_mhz * 1e6);
    let per_wave = cavity.gain_ratio / (cavity.gain_ratio - 1.0) * 4.0 * std::f64::consts::LN_2 * detuning * detuning;
    let wavelength = f64::from(path_length.wavelength());
    let curvature = (peak * per_wave / (wavelength * wavelength) * 32_f64.exp2()) as u32;
    let lag_ticks = scenario.path_length.rising_lag_s / sagnac_sim::TICK_S;
    let lag = lag_ticks.max(1.0).log2().round() as u32;
    Ok(Loops { table: table.encode().to_vec(), peak: peak as u32, curvature, lag })
}

/// Search, lock, drift through mode resets, noise, darkness, a jump that loses the lock.
pub(super) fn path_length(of: &Loops, longer: u32, runs: u32) -> Result<Making> {
    let about = "path-length loop: search, lock, drift through mode resets, noise, darkness, jumps";
    let path_length = LoopTable::decode(&of.table)?.path_length;
    let period = u32::from(path_length.ticks_per_period());
    let wavelength = path_length.wavelength();
    let mut making = Making::new(Module::PathLength, of.table.clone(), about)?;
    making.step(0, &[])?;
    let (mut place_q32, mut closed) = (i64::from(wavelength / 5) << 32, 0);
    for run in 0..runs {
        let dice = run.wrapping_mul(2_654_435_761) >> 8;
        let drift = match run / 60 % 6 {
            0 => 0,
            1 => wavelength * 20,
            2 => -wavelength * 40,
            3 => wavelength * 3,
            4 => wavelength * 90,
            _ => -wavelength * 90,
        } / (8 * longer as i32);
        if run % 170 == 169 {
            place_q32 += i64::from(wavelength) << 31;
        }
        let dark = run % 250 > 242 && run % 250 < 248;
        let ticks = period * (1 + dice % 24) * longer;
        // From none to a 512th of the light, and for a while to a sixteenth, in which no peak shows.
        let less = if run % 700 < 12 { [8, 4, 0] } else { [99, 8, 5] }[(dice / 64 % 3) as usize];
        let bits = (of.peak.ilog2() - 4).saturating_sub(less);
        let flags = bits | if dark { 0 } else { LIGHT } | of.lag << 16;
        let [low, high] = [place_q32 as u32, (place_q32 >> 32) as u32];
        let inputs = [ticks, dice, low, high, drift as u32, of.peak, of.curvature, flags];
        // A trial run determines whether the loop is closed during the whole run.
        let mut tried = making.machine;
        tried.step(1, &inputs).context("run")?;
        let Machine::PathLength(path) = &tried else { anyhow::bail!("not a path-length machine") };
        let mut with = inputs;
        with[7] |= if path.was_closed() { CLOSED } else { 0 };
        closed += u32::from(path.was_closed());
        making.step(1, &with)?;
        place_q32 += (i64::from(drift) << 16) * i64::from(ticks);
    }
    // The Verilog is checked on these alone.
    anyhow::ensure!(5 * closed > 2 * runs, "closed in {closed} of {runs} runs alone");
    Ok(making)
}

/// Ignition with and without light, regulation, dimming, hold, the end of the range, failure.
pub(super) fn intensity(table: &[u8]) -> Result<Making> {
    let about = "intensity loop: ignition, regulation, dimming lamp, hold, end of range, failure";
    let loops = LoopTable::decode(table)?;
    let fields = loops.intensity.fields();
    let field = |wanted: &str| fields.iter().find(|(name, _)| *name == wanted).map(|(_, value)| *value as f64);
    let (set, most) = (field("set_point").context("set_point")?, field("most").context("most")?);
    let ticks = f64::from(loops.intensity.ticks_per_update());
    // The set point at 60 % of the largest current.
    let gain = set / ticks / (0.6 * most) * 65_536.0;
    let mut making = Making::new(Module::Intensity, table.to_vec(), about)?;
    making.step(0, &[])?;
    for run in 0..600_u32 {
        let dice = run.wrapping_mul(2_654_435_761) >> 8;
        let dim = 1.0 - 0.45 * f64::from(run % 150) / 150.0;
        let burns = !matches!(run, 0..=3 | 200..=230 | 400..=420) && run < 560;
        let bits = [0, 6, 12, 16][(dice % 4) as usize];
        let flags = bits | if burns { LIGHT } else { 0 } | if dice % 9 == 0 { HOLD } else { 0 };
        let length = if (200..=230).contains(&run) || run >= 560 { 30_000 } else { 97 + dice % 500 };
        making.step(1, &[length, dice, (gain * dim) as u32, 2 + dice % 5, flags])?;
    }
    Ok(making)
}
