//! Open-loop gain of a running loop, measured without opening it.
//!
//! ```text
//! total = controller + injected          L(jω) = −controller(jω)/total(jω)
//! ```
//!
//! A small sine is added to the controller's output; both sides of the addition are correlated with it over whole
//! periods after the loop has settled. The plant runs without noise at 25 °C. Sines last a whole number of the
//! loop's own updates, so that the sampled controller sees the same phases each time round.

use std::f64::consts::TAU;

use sagnac_loops::{Pi, Plant as Linear, open_loop};

use crate::TICK_S;
use crate::plant::{Design, Running, SecondOfLoops};
use crate::scenario::{Problem, problem};

/// Which loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoopName {
    /// Path length.
    PathLength,
    /// Intensity.
    Intensity,
}

impl LoopName {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::PathLength => "path length",
            Self::Intensity => "intensity",
        }
    }
}

/// Open loop at a frequency, measured and as designed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodePoint {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Measured gain.
    pub gain: f64,
    /// Measured phase, degrees.
    pub phase_deg: f64,
    /// Gain of the design.
    pub design_gain: f64,
    /// Phase of the design, degrees.
    pub design_phase_deg: f64,
}

/// A sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Bode {
    /// Which loop.
    pub which: LoopName,
    /// From low to high frequencies.
    pub points: Vec<BodePoint>,
    /// Where the measured gain is 1, Hz.
    pub crossover_hz: Option<f64>,
    /// 180° and the phase there, degrees.
    pub phase_margin_deg: Option<f64>,
    /// 1 over the gain where the phase is −180°, if it gets there.
    pub gain_margin: Option<f64>,
    /// Crossover asked for, Hz.
    pub design_crossover_hz: f64,
    /// Phase margin of the design, degrees.
    pub design_phase_margin_deg: f64,
}

/// Points of a sweep from a tenth of the crossover to ten times it, as far as four updates make a period.
const POINTS: i32 = 33;
/// Longest sweep, s of the running loop: half a minute or so.
const LONGEST_S: f64 = 50_000.0;

/// Sweeps a running loop.
///
/// # Errors
/// A loop that does not lock on a quiet plant.
pub fn measure(design: &Design, which: LoopName, bandwidth_hz: f64) -> Result<Bode, Problem> {
    let (linear, pi, updates) = match which {
        LoopName::PathLength => {
            (design.path_length.plant, design.path_length.pi, u32::from(design.path_length.integers.ticks_per_period()))
        }
        LoopName::Intensity => {
            (design.intensity.plant, design.intensity.pi, u32::from(design.intensity.integers.ticks_per_update()))
        }
    };
    let lag_s = design.plant.lag_s[1];
    // Ten periods of each frequency, and what the lag takes before each.
    let length_s = 700.0 / bandwidth_hz + 4.0 * lag_s * f64::from(POINTS + 8);
    if length_s > LONGEST_S {
        let table = if which == LoopName::PathLength { "path_length" } else { "intensity" };
        let what =
            format!("is {bandwidth_hz}: a sweep would take {length_s:.0} s of the loop, {LONGEST_S} s can be made");
        return Err(problem(&format!("{table}.bandwidth_hz"), what));
    }
    let settled = settled(design)?;
    let mut points: Vec<BodePoint> = Vec::new();
    for k in 0..POINTS {
        let wanted = bandwidth_hz * libm::pow(10.0, -1.0 + f64::from(k) / 16.0);
        let per_cycle = libm::round(1.0 / (wanted * TICK_S * f64::from(updates)));
        if per_cycle < 4.0 {
            break;
        }
        let frequency_hz = 1.0 / (per_cycle * TICK_S * f64::from(updates));
        if points.last().is_none_or(|p| frequency_hz > p.frequency_hz * 1.02) {
            points.push(point(&settled, design, which, (per_cycle as u32) * updates, &linear, &pi));
        }
    }
    let crossing = crossing(&points, |p| p.gain.ln(), |p| p.phase_deg);
    let over = crossing_at(&points, |p| p.phase_deg + 180.0);
    Ok(Bode {
        which,
        crossover_hz: crossing.map(|(f, _)| f),
        phase_margin_deg: crossing.map(|(_, phase)| 180.0 + phase),
        gain_margin: over.map(|gain| 1.0 / gain),
        design_crossover_hz: bandwidth_hz,
        design_phase_margin_deg: pi.phase_margin_deg,
        points,
    })
}

/// Both loops locked on a plant without noise.
fn settled(design: &Design) -> Result<Running, Problem> {
    let mut quiet = design.clone();
    quiet.plant.noise_code = 0.0;
    let mut running = Running::new(&quiet, 0);
    const MOST_S: u32 = 3600;
    for _ in 0..MOST_S {
        let second = running.stretch(10_000, [0.0; 2], [1.0; 2], false);
        if second.invalid_ticks == 0 {
            // Some more time for what is slow.
            let rest = (30.0 * design.plant.lag_s[1]).clamp(2.0, 600.0) as u32;
            running.stretch(rest * 10_000, [0.0; 2], [1.0; 2], false);
            return Ok(running);
        }
    }
    Err(problem("path_length", format!("does not lock within {MOST_S} s on a plant at rest without noise")))
}

fn point(settled: &Running, design: &Design, which: LoopName, cycle: u32, linear: &Linear, pi: &Pi) -> BodePoint {
    let frequency_hz = 1.0 / (f64::from(cycle) * TICK_S);
    let (controller, total) = answer(settled.clone(), design, which, cycle);
    let gain = libm::hypot(controller.0, controller.1) / libm::hypot(total.0, total.1);
    let angle = libm::atan2(-controller.1, controller.0) - libm::atan2(-total.1, total.0);
    // Into −360 … 0.
    let turned = angle.to_degrees() - 180.0;
    let phase_deg = turned - 360.0 * libm::ceil(turned / 360.0);
    let (design_gain, design_phase_deg) = open_loop(linear, pi, frequency_hz);
    BodePoint { frequency_hz, gain, phase_deg, design_gain, design_phase_deg }
}

/// Size of the injected sine, codes: a five-hundredth of a wavelength where the path answers, or of the current, small
/// against every curve of the plant. What a lag swallows is given more, as far as the actuator's range goes.
fn amplitude(design: &Design, which: LoopName, frequency_hz: f64) -> f64 {
    let plant = &design.plant;
    let swallowed = libm::hypot(1.0, TAU * frequency_hz * plant.lag_s[0]);
    match which {
        LoopName::PathLength => (0.002 * swallowed).min(0.2) / plant.waves_per_unit * plant.codes_per_unit,
        LoopName::Intensity => 0.002 * plant.nominal_ma * plant.current_codes_per_ma,
    }
}

/// Controller and total as a·cos + b·sin, (a, b): the phasor a − jb.
fn answer(mut running: Running, design: &Design, which: LoopName, cycle: u32) -> ((f64, f64), (f64, f64)) {
    let index = usize::from(which == LoopName::Intensity);
    let amplitude = amplitude(design, which, 1.0 / (f64::from(cycle) * TICK_S));
    // An actuator with a lag takes some lags to find its new mean, however fast the sine is.
    let lags = libm::ceil(4.0 * design.plant.lag_s[1] / (f64::from(cycle) * TICK_S)) as u32;
    let (to_settle, measured) = (lags.max(6), 4);
    let rest = running.outputs()[index];
    let mut sums = SecondOfLoops::default();
    let (mut controller, mut total) = ((0.0, 0.0), (0.0, 0.0));
    for tick in 0..cycle * (to_settle + measured) {
        let (sin, cos) = libm::sincos(TAU * f64::from(tick % cycle) / f64::from(cycle));
        let before = running.outputs()[index] - rest;
        running.injected[index] = amplitude * sin;
        running.tick(0.0, 1.0, false, &mut sums);
        if tick >= cycle * to_settle {
            let after = before + amplitude * sin;
            controller = (controller.0 + before * cos, controller.1 + before * sin);
            total = (total.0 + after * cos, total.1 + after * sin);
        }
    }
    (controller, total)
}

/// Frequency and value where `level` falls through zero, between two points on a logarithmic scale.
fn crossing(
    points: &[BodePoint],
    level: impl Fn(&BodePoint) -> f64,
    value: impl Fn(&BodePoint) -> f64,
) -> Option<(f64, f64)> {
    points.windows(2).find_map(|pair| {
        let [a, b] = pair else { return None };
        let (from, to) = (level(a), level(b));
        if !(from >= 0.0 && to < 0.0) {
            return None;
        }
        let part = from / (from - to);
        let frequency = a.frequency_hz * libm::pow(b.frequency_hz / a.frequency_hz, part);
        Some((frequency, value(a) + (value(b) - value(a)) * part))
    })
}

fn crossing_at(points: &[BodePoint], level: impl Fn(&BodePoint) -> f64) -> Option<f64> {
    crossing(points, level, |p| p.gain).map(|(_, gain)| gain)
}
