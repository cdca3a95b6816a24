//! Beat level: the phase of the light, tick by tick, through dither, lock-in, counter and stripping.
//!
//! ```text
//! swing θ(t) ─┐
//! input Ω ────┴▶ Φ = K(θ + ∫Ω) ─▶ ψ = Φ + χ ─▶ edges of two photodiodes ─▶ counts ─▶ whole dither periods
//!                                   ▲ backscatter: [adler] or [two_mode]
//! ```
//!
//! K = 2π/S, S the scale factor in arcsec per fringe. Counting is asynchronous: an edge at any time within a tick is
//! counted, as a counter in hardware does (`sagnac_loops::Quadrature` is that counter; a test holds the two together).
//! Stripping is that of `sagnac_loops::Stripper` on a pickoff of 1e-4 arcsec. Noise of the photodiodes is not
//! modelled: it makes edges tremble, which counts up and down and adds nothing.

mod adler;
mod swing;
mod two_mode;

use rand_chacha::ChaCha8Rng;
use sagnac_loops::{Stripped, Stripper};

use crate::TICK_S;
use crate::beat::adler::Adler;
use crate::beat::swing::Swing;
pub(crate) use crate::beat::two_mode::STEPS_PER_LIFETIME;
use crate::beat::two_mode::{TwoMode, TwoModeConstants};
use crate::noise::{Stream, generator, normal};
use crate::physics::free_spectral_range_hz;
use crate::scenario::Scenario;
use crate::scenario::tables::{BeatModel, Counting};

/// Codes of the dither pickoff per arcsec.
const PICKOFF_CODES_PER_ARCSEC: f64 = 1e4;

#[derive(Clone, Debug)]
enum Model {
    Adler(Adler),
    TwoMode(Box<TwoMode>),
}

/// The light of a gyro, its counter and its stripper.
#[derive(Clone, Debug)]
pub struct Beat {
    model: Model,
    swing: Swing,
    frequency_hz: f64,
    frequency_ppm_per_c: f64,
    stopped: bool,
    /// rad per arcsec.
    k: f64,
    /// K·∫Ω dt, rad, less whole fringes, which are counted apart.
    turned: f64,
    fringes: i64,
    counting: Counting,
    second_edge: f64,
    counted: i64,
    stripper: Option<Stripper>,
    pickoff_noise: f64,
    pickoff_rng: ChaCha8Rng,
}

fn model_of(scenario: &Scenario, k: f64) -> Model {
    // Any start will do; this one is no special place of the lock-in.
    let chi = 1.0;
    if scenario.run.beat_model == BeatModel::Adler {
        return Model::Adler(Adler::new(k * scenario.lock_in_dph(), chi));
    }
    let cavity = &scenario.cavity;
    let fsr = free_spectral_range_hz(scenario.geometry.perimeter_m);
    // In units of the intensity at rest: α = β + θ.
    let gain = scenario.intensity_rate();
    let own = gain / (1.0 + cavity.cross_saturation);
    let constants = TwoModeConstants {
        gain,
        own,
        cross: own * cavity.cross_saturation,
        backscatter: [cavity.backscatter_1_ppm, cavity.backscatter_2_ppm].map(|ppm| fsr * ppm * 1e-6),
        epsilon: [cavity.backscatter_phase_1_deg, cavity.backscatter_phase_2_deg].map(f64::to_radians),
    };
    Model::TwoMode(Box::new(TwoMode::new(constants, chi)))
}

/// What a tick gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BeatTick {
    /// Counts of the counter, dither and all.
    pub raw: i32,
    /// Counts of whole dither periods that ended in this tick; without dither the raw counts.
    pub stripped: i64,
    /// The dither shows no zeros: what was stripped still holds its swing.
    pub without_zero: bool,
}

impl Beat {
    /// A beat of a scenario that was checked.
    pub fn new(scenario: &Scenario, seed: u64) -> Self {
        let dither = &scenario.dither;
        let k = std::f64::consts::TAU / scenario.arcsec_per_fringe();
        let model = model_of(scenario, k);
        let dithered = scenario.is_dithered();
        let longest = if dithered { libm::ceil(2.0 / (dither.frequency_hz * TICK_S)) as u16 } else { 1 };
        let frequency_hz = if dithered { dither.frequency_hz } else { 0.0 };
        let amplitude = if dithered { dither.amplitude_arcsec } else { 0.0 };
        let mut beat = Self {
            model,
            swing: Swing::new(frequency_hz, amplitude, dither.noise, generator(seed, Stream::Dither)),
            frequency_hz,
            frequency_ppm_per_c: dither.frequency_ppm_per_c,
            stopped: false,
            k,
            turned: 0.0,
            fringes: 0,
            counting: scenario.readout.counting,
            second_edge: 0.25 + scenario.readout.phase_error_deg / 360.0,
            counted: 0,
            stripper: dithered.then(|| Stripper::new(longest)),
            pickoff_noise: scenario.readout.pickoff_noise_arcsec,
            pickoff_rng: generator(seed, Stream::Pickoff),
        };
        beat.counted = beat.edges();
        beat
    }

    /// Dither frequency at a block temperature; `stopped` where it has failed.
    pub(crate) fn tune(&mut self, from_reference_c: f64, stopped: bool) {
        if stopped && !self.stopped {
            self.swing.stop();
        }
        if !stopped {
            if self.stopped {
                self.swing.restart();
            }
            self.swing.tune(self.frequency_hz * (1.0 + self.frequency_ppm_per_c * 1e-6 * from_reference_c));
        }
        self.stopped = stopped;
    }

    /// A tick under a mean rate, °/h.
    pub fn tick(&mut self, rate_dph: f64) -> BeatTick {
        let mut left_s = TICK_S;
        while left_s > 0.0 {
            let stretch = self.swing.stretch(left_s, self.k, rate_dph);
            match &mut self.model {
                Model::Adler(adler) => adler.go(&stretch, self.turned),
                Model::TwoMode(modes) => modes.go(&stretch, self.turned),
            }
            self.turned += stretch.rate * stretch.length_s;
            left_s -= stretch.length_s;
            if left_s < 1e-15 {
                break;
            }
        }
        let whole = libm::floor(self.turned / std::f64::consts::TAU);
        self.turned -= whole * std::f64::consts::TAU;
        self.fringes += whole as i64;
        let edges = self.edges();
        let raw = (edges - self.counted) as i32;
        self.counted = edges;
        let Some(out) = self.strip(raw) else { return BeatTick { raw, stripped: 0, without_zero: false } };
        BeatTick { raw, stripped: out.counts, without_zero: out.without_zero }
    }

    fn strip(&mut self, raw: i32) -> Option<Stripped> {
        let Some(stripper) = &mut self.stripper else {
            return Some(Stripped { counts: i64::from(raw), ticks: 1, without_zero: false });
        };
        let noise = if self.pickoff_noise > 0.0 { self.pickoff_noise * normal(&mut self.pickoff_rng) } else { 0.0 };
        let pickoff = (self.swing.angle_arcsec() + noise) * PICKOFF_CODES_PER_ARCSEC;
        stripper.take(raw, libm::round(pickoff) as i32)
    }

    /// Phase of the beat from the start, fringes; the swing of the dither included.
    pub fn phase_fringes(&self) -> f64 {
        self.fringes as f64 + self.part()
    }

    /// Phase without the dither's own part, fringes: input and what lock-in made of it.
    pub fn drift_fringes(&self) -> f64 {
        self.fringes as f64 + (self.turned + self.chi()) / std::f64::consts::TAU
    }

    fn chi(&self) -> f64 {
        match &self.model {
            Model::Adler(adler) => adler.chi(),
            Model::TwoMode(modes) => modes.chi(),
        }
    }

    /// Intensities of both modes, 1 at rest; `None` in the reduced form.
    pub fn intensities(&self) -> Option<[f64; 2]> {
        match &self.model {
            Model::Adler(_) => None,
            Model::TwoMode(modes) => Some(modes.intensities()),
        }
    }

    /// Phase besides the whole fringes of the input, fringes.
    fn part(&self) -> f64 {
        (self.turned + self.k * self.swing.angle_arcsec() + self.chi()) / std::f64::consts::TAU
    }

    /// Edges passed since phase 0.
    fn edges(&self) -> i64 {
        let part = self.part();
        let whole = libm::floor(part);
        let fringes = self.fringes + whole as i64;
        let within = part - whole;
        let passed = |edge: f64| i64::from(within >= edge);
        match self.counting {
            Counting::X1 => fringes,
            Counting::X2 => 2 * fringes + passed(0.5),
            Counting::X4 => 4 * fringes + passed(self.second_edge) + passed(0.5) + passed(0.5 + self.second_edge),
        }
    }
}
