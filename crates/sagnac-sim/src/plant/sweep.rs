//! Open-loop gain of a running loop, measured without opening it.
//!
//! ```text
//! total = controller + injected          L(jω) = −controller(jω)/total(jω)
//! ```
//!
//! A small sine is added to the controller's output. Both sides of the addition are correlated with it over whole
//! periods, after the loop has settled. The plant runs without noise at 25 °C. A period of the sine is a whole number
//! of the loop's updates, so that the sampled controller sees the same phases in every period.
//!
//! The result is that of a linear loop only for small signals. A heater has another lag up than down: its measured
//! crossover lies between those of the two lags.

use std::f64::consts::TAU;

use sagnac_loops::{PiGains, Plant as LinearPlant, open_loop};

use crate::plant::running::TickConditions;
use crate::plant::{LoopAverages, LoopDesign, LoopState, PlantConditions};
use crate::scenario::{ScenarioError, TICK_S};

/// One of the two loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoopName {
    /// Path length.
    PathLength,
    /// Intensity.
    Intensity,
}

impl LoopName {
    /// Its name in text.
    pub fn name(self) -> &'static str {
        match self {
            Self::PathLength => "path length",
            Self::Intensity => "intensity",
        }
    }

    /// Its table in a scenario.
    fn table(self) -> &'static str {
        match self {
            Self::PathLength => "path_length",
            Self::Intensity => "intensity",
        }
    }
}

/// Open loop at one frequency, measured and as designed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
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

/// A frequency sweep of one loop.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Bode {
    /// The loop.
    pub which: LoopName,
    /// Points from low to high frequency.
    pub points: Vec<BodePoint>,
    /// Measured frequency of unity gain, Hz.
    pub crossover_hz: Option<f64>,
    /// Measured phase margin, degrees: 180° plus the phase at the crossover.
    pub phase_margin_deg: Option<f64>,
    /// Measured gain margin: the inverse of the gain where the phase is −180°, if the sweep reaches it.
    pub gain_margin: Option<f64>,
    /// Wanted crossover, Hz.
    pub design_crossover_hz: f64,
    /// Phase margin of the design, degrees.
    pub design_phase_margin_deg: f64,
}

/// Points of a sweep, from a tenth of the crossover to ten times it. It ends earlier where a period is shorter than
/// four updates.
const POINTS: i32 = 33;
/// Longest sweep, in seconds of the running loop: about half a minute of computing.
const LONGEST_S: f64 = 50_000.0;
/// Longest wait for a lock, s.
const LONGEST_LOCK_S: u32 = 3600;

/// The loop under test on a settled plant.
struct Bench<'a> {
    /// Without noise.
    design: &'a LoopDesign,
    settled: LoopState,
    which: LoopName,
    linear: LinearPlant,
    pi: PiGains,
    /// Ticks of an update of the loop.
    update_ticks: u32,
}

impl LoopDesign {
    /// Sweeps one running loop around its crossover `bandwidth_hz`.
    ///
    /// # Errors
    /// A loop that does not lock on a plant without noise, or is so slow that a sweep takes too long.
    pub fn sweep(&self, which: LoopName, bandwidth_hz: f64) -> Result<Bode, ScenarioError> {
        // Ten periods of each frequency, and the lag before each.
        let length_s = 700.0 / bandwidth_hz + 4.0 * self.plant.lag_s[1] * f64::from(POINTS + 8);
        if length_s > LONGEST_S {
            let message = format!(
                "is {bandwidth_hz}: a sweep would take {length_s:.0} s of the loop, and {LONGEST_S} s is the limit"
            );
            return Err(ScenarioError::new(&format!("{}.bandwidth_hz", which.table()), message));
        }
        let mut quiet = self.clone();
        quiet.plant.noise_code = 0.0;
        let bench = Bench::new(&quiet, which)?;
        let points = bench.points(bandwidth_hz);
        let unity = crossing(&points, |p| p.gain.ln(), |p| p.phase_deg);
        let reversal = crossing(&points, |p| p.phase_deg + 180.0, |p| p.gain);
        Ok(Bode {
            which,
            crossover_hz: unity.map(|(frequency_hz, _)| frequency_hz),
            phase_margin_deg: unity.map(|(_, phase_deg)| 180.0 + phase_deg),
            gain_margin: reversal.map(|(_, gain)| 1.0 / gain),
            design_crossover_hz: bandwidth_hz,
            design_phase_margin_deg: bench.pi.phase_margin_deg,
            points,
        })
    }

    /// Both loops locked at 25 °C.
    fn settled(&self) -> Result<LoopState, ScenarioError> {
        let mut state = self.start(0);
        let at_rest = PlantConditions::default();
        for _ in 0..LONGEST_LOCK_S {
            if self.advance(&mut state, 10_000, &at_rest).invalid_ticks == 0 {
                // More time for slow transients.
                let rest_s = (30.0 * self.plant.lag_s[1]).clamp(2.0, 600.0) as u32;
                self.advance(&mut state, rest_s * 10_000, &at_rest);
                return Ok(state);
            }
        }
        let message = format!("does not lock within {LONGEST_LOCK_S} s at 25 °C without noise");
        Err(ScenarioError::new("path_length", message))
    }
}

/// A sinusoid a·cos + b·sin as (a, b): the phasor a − jb.
type Phasor = (f64, f64);

impl<'a> Bench<'a> {
    fn new(design: &'a LoopDesign, which: LoopName) -> Result<Self, ScenarioError> {
        let (path, light) = (&design.path_length, &design.intensity);
        let (linear, pi, update_ticks) = match which {
            LoopName::PathLength => (path.plant, path.pi, u32::from(path.integers.ticks_per_period())),
            LoopName::Intensity => (light.plant, light.pi, u32::from(light.integers.ticks_per_update())),
        };
        Ok(Self { design, settled: design.settled()?, which, linear, pi, update_ticks })
    }

    fn points(&self, bandwidth_hz: f64) -> Vec<BodePoint> {
        let mut points: Vec<BodePoint> = Vec::new();
        for k in 0..POINTS {
            let wanted_hz = bandwidth_hz * libm::pow(10.0, -1.0 + f64::from(k) / 16.0);
            let updates = libm::round(1.0 / (wanted_hz * TICK_S * f64::from(self.update_ticks)));
            if updates < 4.0 {
                break;
            }
            let frequency_hz = 1.0 / (updates * TICK_S * f64::from(self.update_ticks));
            if points.last().is_none_or(|p| frequency_hz > p.frequency_hz * 1.02) {
                points.push(self.point((updates as u32) * self.update_ticks));
            }
        }
        points
    }

    /// The open loop at a period in ticks.
    fn point(&self, period: u32) -> BodePoint {
        let frequency_hz = 1.0 / (f64::from(period) * TICK_S);
        let (controller, total) = self.response(period);
        let gain = libm::hypot(controller.0, controller.1) / libm::hypot(total.0, total.1);
        let angle = libm::atan2(-controller.1, controller.0) - libm::atan2(-total.1, total.0);
        // Into −360 … 0.
        let turned = angle.to_degrees() - 180.0;
        let phase_deg = turned - 360.0 * libm::ceil(turned / 360.0);
        let (design_gain, design_phase_deg) = open_loop(&self.linear, &self.pi, frequency_hz);
        BodePoint { frequency_hz, gain, phase_deg, design_gain, design_phase_deg }
    }

    /// Amplitude of the injected sine, codes: a five-hundredth of a wavelength at the path, or of the current. That is
    /// small against the curvature of the plant. Attenuation by the lag is made up for, within the actuator's range.
    fn amplitude(&self, frequency_hz: f64) -> f64 {
        let plant = &self.design.plant;
        let attenuation = libm::hypot(1.0, TAU * frequency_hz * plant.lag_s[0]);
        match self.which {
            LoopName::PathLength => (0.002 * attenuation).min(0.2) / plant.waves_per_unit * plant.codes_per_unit,
            LoopName::Intensity => 0.002 * plant.nominal_ma * plant.current_codes_per_ma,
        }
    }

    /// Controller and total at a period in ticks.
    fn response(&self, period: u32) -> (Phasor, Phasor) {
        let mut state = self.settled.clone();
        let index = match self.which {
            LoopName::PathLength => 0,
            LoopName::Intensity => 1,
        };
        let amplitude = self.amplitude(1.0 / (f64::from(period) * TICK_S));
        // An actuator with a lag takes some lags to reach its new mean, at any frequency.
        let lags = libm::ceil(4.0 * self.design.plant.lag_s[1] / (f64::from(period) * TICK_S)) as u32;
        let (settling, measured) = (lags.max(6), 4);
        let rest = state.outputs()[index];
        let mut sums = LoopAverages::default();
        let (mut controller, mut total) = ((0.0, 0.0), (0.0, 0.0));
        for tick in 0..period * (settling + measured) {
            let (sin, cos) = libm::sincos(TAU * f64::from(tick % period) / f64::from(period));
            let before = state.outputs()[index] - rest;
            let mut injected = [0.0; 2];
            injected[index] = amplitude * sin;
            let now = TickConditions { thermal_waves: 0.0, loss: 1.0, dark: false, injected };
            self.design.tick(&mut state, &now, &mut sums);
            if tick >= period * settling {
                let after = before + amplitude * sin;
                controller = (controller.0 + before * cos, controller.1 + before * sin);
                total = (total.0 + after * cos, total.1 + after * sin);
            }
        }
        (controller, total)
    }
}

/// Frequency and value where `level` falls through zero, interpolated over the logarithm of the frequency.
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
        let fraction = from / (from - to);
        let frequency_hz = a.frequency_hz * libm::pow(b.frequency_hz / a.frequency_hz, fraction);
        Some((frequency_hz, value(a) + (value(b) - value(a)) * fraction))
    })
}
