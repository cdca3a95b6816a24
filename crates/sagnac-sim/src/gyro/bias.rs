//! Bias by cause, and the errors of the counted rate.
//!
//! ```text
//! temperature   slope·(T − 25) + knee·tanh((T − knee_c)/width)        T: block, not a thermometer
//! rate          r·Ṫ_block
//! gradient      g·(T_anode − T_block − heat)
//! hysteresis    ±h: a play of the given width that follows T
//! mode step     ±step/2 for even and odd modes: a reset by one changes the sign, the next one restores it
//! ripple        a·sin(π·u), u the actuator's path in wavelengths: period of two modes (US5438410)
//! warm-up       a₁e^(−t/τ₁) + a₂e^(−t/τ₂) after a cold start
//! null shift    s·(imbalance of the arm currents, proportional to the current)
//! uncounted     √(Ω²−Ω_L²) − Ω by lock-in without dither; −Ω without light
//! ```
//!
//! All in °/h, positive in the direction of a positive input rate. Forms and sizes of temperature, rate, gradient,
//! hysteresis and warm-up are phenomenological.

use crate::scenario::{BiasConfig, REFERENCE_C, Scenario};
use crate::thermal::Temperatures;

/// Names of the errors, in the order of [`super::Second::errors_dph`].
pub const ERROR_SOURCES: [&str; 14] = [
    "fixed",
    "temperature",
    "rate",
    "gradient",
    "hysteresis",
    "mode_step",
    "ripple",
    "warm_up",
    "null_shift",
    "flicker",
    "rate_random_walk",
    "rate_ramp",
    "unlocked",
    "uncounted",
];

/// Coefficients of the bias.
#[derive(Clone, Debug)]
pub(crate) struct Bias {
    config: BiasConfig,
    null_shift_dph_per_ma: f64,
    /// Difference of the arm currents relative to the current.
    imbalance: f64,
    cold_start: bool,
    start_c: f64,
}

/// Memory of the hysteresis.
#[derive(Clone, Debug)]
pub(crate) struct BiasState {
    /// Centre of the play, °C.
    play_c: f64,
}

/// What the bias of a second depends on.
pub(crate) struct BiasInputs {
    pub(crate) end_s: f64,
    pub(crate) temperatures: Temperatures,
    /// Path made by the actuator, wavelengths.
    pub(crate) actuator_waves: f64,
    pub(crate) mode: i64,
    pub(crate) current_ma: f64,
    /// Flicker, rate random walk, ramp.
    pub(crate) slow: [f64; 3],
    pub(crate) unlocked_dph: f64,
}

impl Bias {
    pub(crate) fn build(scenario: &Scenario) -> Self {
        Self {
            config: scenario.bias.clone(),
            null_shift_dph_per_ma: scenario.cavity.null_shift_dph_per_ma,
            imbalance: scenario.cavity.current_imbalance_ma / scenario.intensity.nominal_ma,
            cold_start: scenario.chamber.cold_start,
            start_c: scenario.chamber.start_c,
        }
    }

    pub(crate) fn start(&self) -> BiasState {
        BiasState { play_c: self.start_c }
    }

    /// Every error over a second, °/h; the last one, `uncounted`, is 0 here.
    pub(crate) fn second(&self, state: &mut BiasState, now: &BiasInputs) -> [f64; ERROR_SOURCES.len()] {
        let b = &self.config;
        let t = &now.temperatures;
        let half = 0.5 * b.hysteresis_width_c;
        state.play_c = state.play_c.clamp(t.block_c - half, t.block_c + half);
        let warm_up = if self.cold_start {
            b.warm_up_1_dph * libm::exp(-now.end_s / b.warm_up_1_s)
                + b.warm_up_2_dph * libm::exp(-now.end_s / b.warm_up_2_s)
        } else {
            0.0
        };
        let [flicker, walk, ramp] = now.slow;
        [
            b.fixed_dph,
            b.slope_dph_per_c * (t.block_c - REFERENCE_C)
                + b.knee_dph * libm::tanh((t.block_c - b.knee_c) / b.knee_width_c),
            b.rate_dph_per_cpm * t.block_cpm,
            b.gradient_dph_per_c * t.gradient_c,
            b.hysteresis_dph * (t.block_c - state.play_c) / half,
            b.mode_step_dph * if now.mode.rem_euclid(2) == 0 { 0.5 } else { -0.5 },
            b.ripple_dph * libm::sin(std::f64::consts::PI * now.actuator_waves),
            warm_up,
            self.null_shift_dph_per_ma * self.imbalance * now.current_ma,
            flicker,
            walk,
            ramp,
            now.unlocked_dph,
            // Depends on the sum of the others.
            0.0,
        ]
    }
}
