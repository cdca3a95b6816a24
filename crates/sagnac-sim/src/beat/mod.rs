//! Beat level: the phase of the beat, tick by tick, through dither, lock-in, counter and stripping.
//!
//! ```text
//! swing θ(t) ─┐
//! input Ω ────┴▶ Φ = K(θ + ∫Ω) ─▶ ψ = Φ + χ ─▶ edges of two photodiodes ─▶ counts ─▶ whole dither periods
//!                                   ▲ backscatter: Adler's equation, or both modes
//! ```
//!
//! K = 2π/S with S in arcsec per fringe. Equations and sources: `adler.rs` (Adler 1946) and `two_mode.rs` (Lamb,
//! Aronowitz); the scenario selects one.
//!
//! Counting is asynchronous, as in hardware: an edge at any time within a tick is counted. A test holds it to
//! `sagnac_loops::Quadrature`. Stripping is `sagnac_loops::Stripper` on a pickoff with a resolution of 1e-4 arcsec.
//!
//! Not modelled: noise of the photodiodes (it adds as many counts up as down); a change of backscatter with
//! temperature; detuning of the cavity by its loops.
//!
//! [`Beat::build`] makes the constants, [`BeatState`] is the memory, [`Beat::tick`] advances it by 100 µs.

mod adler;
mod swing;
mod two_mode;

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use sagnac_loops::{Stripped, Stripper};

use crate::beat::adler::Adler;
use crate::beat::swing::{Swing, SwingState};
use crate::beat::two_mode::{TwoMode, TwoModeState};
use crate::random::{Stream, generator, normal};
use crate::scenario::{BeatModel, CountsPerFringe, Scenario, ScenarioError, TICK_S};

/// Codes of the dither pickoff per arcsec.
const PICKOFF_CODES_PER_ARCSEC: f64 = 1e4;
/// χ at the start, rad. Any value is suitable; this one is not a special point of the lock-in.
const FIRST_CHI: f64 = 1.0;
/// Most fringes of a tick that the integration follows.
const MOST_FRINGES_PER_TICK: f64 = 500.0;
/// Most integration steps of a tick.
const MOST_STEPS_PER_TICK: f64 = 1000.0;

/// The optics of a gyro with its counter and stripper. Nothing in it changes during a run.
#[derive(Clone, Debug)]
pub struct Beat {
    model: BeatModel,
    adler: Adler,
    two_mode: TwoMode,
    swing: Swing,
    frequency_hz: f64,
    frequency_ppm_per_c: f64,
    /// rad per arcsec.
    k: f64,
    counting: CountsPerFringe,
    /// Phase of the second photodiode's first edge, fringes.
    second_edge: f64,
    /// Longest dither period of the stripper, ticks; `None` without dither.
    longest_period: Option<u16>,
    pickoff_noise_arcsec: f64,
}

/// Phase without the part known in closed form, by model.
#[derive(Clone, Debug)]
enum Light {
    /// χ, rad.
    Adler(f64),
    TwoMode(Box<TwoModeState>),
}

/// Memory of a beat: phase, dither, counter and stripper.
#[derive(Clone, Debug)]
pub struct BeatState {
    light: Light,
    swing: SwingState,
    stopped: bool,
    /// K·∫Ω dt, rad, minus the whole fringes, which are counted apart.
    turned: f64,
    fringes: i64,
    /// Edges counted so far.
    counted: i64,
    stripper: Option<Stripper>,
    pickoff_rng: ChaCha8Rng,
}

/// Counts of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct BeatTick {
    /// Counts of the counter, dither included.
    pub raw: i32,
    /// Counts of whole dither periods that ended in this tick; without dither the raw counts.
    pub stripped: i64,
    /// The pickoff had no zero crossing: the stripped counts still contain the dither.
    pub without_zero: bool,
}

impl Beat {
    /// The beat of a scenario.
    ///
    /// # Errors
    /// Rates or a dither so fast, or intensities that settle so fast, that a tick cannot be integrated.
    pub fn build(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let dither = &scenario.dither;
        let k = TAU / scenario.arcsec_per_fringe();
        let dithered = scenario.is_dithered();
        let amplitude_arcsec = if dithered { dither.amplitude_arcsec } else { 0.0 };
        let beat = Self {
            model: scenario.run.beat_model,
            adler: Adler { epsilon: k * scenario.lock_in_dph() },
            two_mode: TwoMode::build(scenario),
            swing: Swing { amplitude_arcsec, noise: dither.noise },
            frequency_hz: if dithered { dither.frequency_hz } else { 0.0 },
            frequency_ppm_per_c: dither.frequency_ppm_per_c,
            k,
            counting: scenario.readout.counting,
            second_edge: 0.25 + scenario.readout.phase_error_deg / 360.0,
            longest_period: dithered.then(|| libm::ceil(2.0 / (dither.frequency_hz * TICK_S)) as u16),
            pickoff_noise_arcsec: scenario.readout.pickoff_noise_arcsec,
        };
        check_fringes(scenario)?;
        beat.check_steps(scenario)?;
        Ok(beat)
    }

    fn check_steps(&self, scenario: &Scenario) -> Result<(), ScenarioError> {
        let steps = self.two_mode.least_steps(TICK_S);
        if self.model == BeatModel::Adler || steps <= MOST_STEPS_PER_TICK {
            return Ok(());
        }
        let message = format!(
            "is {}: the intensities settle so fast that a tick needs {steps:.0} steps, and {MOST_STEPS_PER_TICK} is the limit. Give less loss or gain_ratio, or run.beat_model = \"adler\"",
            scenario.cavity.loss_ppm
        );
        Err(ScenarioError::new("cavity.loss_ppm", message))
    }

    /// The beat at rest; the dither begins a half cycle.
    pub fn start(&self, seed: u64) -> BeatState {
        let light = match self.model {
            BeatModel::Adler => Light::Adler(FIRST_CHI),
            BeatModel::TwoMode => Light::TwoMode(Box::new(self.two_mode.start(FIRST_CHI))),
        };
        let mut state = BeatState {
            light,
            swing: self.swing.start(self.frequency_hz, generator(seed, Stream::Dither)),
            stopped: false,
            turned: 0.0,
            fringes: 0,
            counted: 0,
            stripper: self.longest_period.map(|longest| Stripper::new(longest, 0)),
            pickoff_rng: generator(seed, Stream::Pickoff),
        };
        state.counted = self.edges(&state);
        state
    }

    /// Dither frequency at a block temperature relative to 25 °C; `stopped` if the dither has failed.
    pub(crate) fn tune(&self, state: &mut BeatState, from_reference_c: f64, stopped: bool) {
        if stopped && !state.stopped {
            state.swing.stop();
        }
        if !stopped {
            if state.stopped {
                self.swing.restart(&mut state.swing);
            }
            state.swing.tune(self.frequency_hz * (1.0 + self.frequency_ppm_per_c * 1e-6 * from_reference_c));
        }
        state.stopped = stopped;
    }

    /// A tick at a mean rate, °/h.
    pub fn tick(&self, state: &mut BeatState, rate_dph: f64) -> BeatTick {
        let mut remaining_s = TICK_S;
        while remaining_s > 0.0 {
            let stretch = self.swing.stretch(&mut state.swing, remaining_s, self.k, rate_dph);
            match &mut state.light {
                Light::Adler(chi) => self.adler.advance(chi, &stretch, state.turned),
                Light::TwoMode(modes) => self.two_mode.advance(modes, &stretch, state.turned),
            }
            state.turned += stretch.rate * stretch.length_s;
            remaining_s -= stretch.length_s;
            if remaining_s < 1e-15 {
                break;
            }
        }
        let whole = libm::floor(state.turned / TAU);
        state.turned -= whole * TAU;
        state.fringes += whole as i64;
        let edges = self.edges(state);
        let raw = (edges - state.counted) as i32;
        state.counted = edges;
        match self.strip(state, raw) {
            Some(out) => BeatTick { raw, stripped: out.counts, without_zero: out.without_zero },
            None => BeatTick { raw, stripped: 0, without_zero: false },
        }
    }

    fn strip(&self, state: &mut BeatState, raw: i32) -> Option<Stripped> {
        let Some(stripper) = &mut state.stripper else {
            return Some(Stripped { counts: i64::from(raw), ticks: 1, without_zero: false });
        };
        let sigma_arcsec = self.pickoff_noise_arcsec;
        let noise = if sigma_arcsec > 0.0 { sigma_arcsec * normal(&mut state.pickoff_rng) } else { 0.0 };
        let pickoff = (state.swing.angle_arcsec() + noise) * PICKOFF_CODES_PER_ARCSEC;
        stripper.update(raw, libm::round(pickoff) as i32)
    }

    /// Phase of the beat since the start, fringes; the dither included.
    pub fn phase_fringes(&self, state: &BeatState) -> f64 {
        state.fringes as f64 + self.fraction(state)
    }

    /// Phase since the start without the dither, fringes: the input as lock-in has changed it.
    pub fn drift_fringes(&self, state: &BeatState) -> f64 {
        state.fringes as f64 + (state.turned + state.chi()) / TAU
    }

    /// Phase without the whole fringes of the input, fringes.
    fn fraction(&self, state: &BeatState) -> f64 {
        (state.turned + self.k * state.swing.angle_arcsec() + state.chi()) / TAU
    }

    /// Edges passed since phase 0.
    fn edges(&self, state: &BeatState) -> i64 {
        let fraction = self.fraction(state);
        let whole = libm::floor(fraction);
        let fringes = state.fringes + whole as i64;
        let within = fraction - whole;
        let passed = |edge: f64| i64::from(within >= edge);
        match self.counting {
            CountsPerFringe::X1 => fringes,
            CountsPerFringe::X2 => 2 * fringes + passed(0.5),
            CountsPerFringe::X4 => {
                4 * fringes + passed(self.second_edge) + passed(0.5) + passed(0.5 + self.second_edge)
            }
        }
    }
}

impl BeatState {
    fn chi(&self) -> f64 {
        match &self.light {
            Light::Adler(chi) => *chi,
            Light::TwoMode(modes) => modes.chi(),
        }
    }

    /// Intensities of both modes, 1 at rest; `None` for Adler's equation.
    pub fn intensities(&self) -> Option<[f64; 2]> {
        match &self.light {
            Light::Adler(_) => None,
            Light::TwoMode(modes) => Some(modes.intensities()),
        }
    }
}

/// The fastest beat of a scenario must fit a tick.
fn check_fringes(scenario: &Scenario) -> Result<(), ScenarioError> {
    let table_dph = scenario.input.table.iter().map(|leg| leg.rate_dps.abs() * 3600.0).fold(0.0, f64::max);
    let swing_dph = TAU * scenario.dither.frequency_hz * scenario.dither.amplitude_arcsec;
    let rate_dph = scenario.input_dph().abs() + table_dph + swing_dph;
    let fringes = rate_dph / scenario.arcsec_per_fringe() * TICK_S;
    if fringes <= MOST_FRINGES_PER_TICK {
        return Ok(());
    }
    let message = format!(
        "beat: up to {fringes:.0} fringes in a tick of 100 µs, {MOST_FRINGES_PER_TICK} can be followed. Lower the rates or the dither"
    );
    Err(ScenarioError::new("run.fidelity", message))
}
