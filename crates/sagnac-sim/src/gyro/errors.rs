//! Where the bias comes from, source by source.
//!
//! ```text
//! temperature   slope·(T − 25) + knee·tanh((T − knee_c)/width)        T: block, not a thermometer
//! rate          r·Ṫ_block
//! gradient      g·(T_anode − T_block − heat)
//! hysteresis    ±h: a play of the given width follows T and sticks
//! mode step     ±step/2 by even and odd mode: a reset by one changes it, the next takes it back
//! ripple        a·sin(π·u), u the actuator's path in wavelengths: periodic over two modes (US5438410)
//! warm-up       a₁e^(−t/τ₁) + a₂e^(−t/τ₂) after a cold start
//! null shift    s·(imbalance of the current, which grows with it)
//! uncounted     what lock-in (without dither) or darkness keeps from the counter: √(Ω²−Ω_L²) − Ω, or −Ω
//! ```
//!
//! Sizes and forms of temperature, rate, gradient, hysteresis and warm-up are phenomenological.

use crate::plant::REFERENCE_C;
use crate::scenario::Scenario;
use crate::scenario::tables::{Bias, Cavity};
use crate::thermal::Temperatures;

/// Names of the sources, in the order of [`super::Second::errors_dph`].
pub const SOURCES: [&str; 14] = [
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

/// Sources that remember.
#[derive(Clone, Debug)]
pub(crate) struct Sources {
    bias: Bias,
    null_shift_dph_per_ma: f64,
    imbalance_part: f64,
    cold_start: bool,
    /// Middle of the play, °C.
    play_c: f64,
}

/// What the sources see of a second.
pub(crate) struct Causes {
    pub(crate) end_s: f64,
    pub(crate) temperatures: Temperatures,
    /// Path that the actuator makes, wavelengths.
    pub(crate) actuator_waves: f64,
    pub(crate) mode: i64,
    pub(crate) current_ma: f64,
    /// Flicker, rate random walk, ramp.
    pub(crate) slow: [f64; 3],
    pub(crate) unlocked_dph: f64,
}

impl Sources {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let cavity: &Cavity = &scenario.cavity;
        Self {
            bias: scenario.bias.clone(),
            null_shift_dph_per_ma: cavity.null_shift_dph_per_ma,
            imbalance_part: cavity.current_imbalance_ma / scenario.intensity.nominal_ma,
            cold_start: scenario.chamber.cold_start,
            play_c: scenario.chamber.start_c,
        }
    }

    /// Every source over a second, °/h.
    pub(crate) fn second(&mut self, causes: &Causes) -> [f64; SOURCES.len()] {
        let b = &self.bias;
        let t = &causes.temperatures;
        let half = 0.5 * b.hysteresis_width_c;
        self.play_c = self.play_c.clamp(t.block_c - half, t.block_c + half);
        let warm_up = if self.cold_start {
            b.warm_up_1_dph * libm::exp(-causes.end_s / b.warm_up_1_s)
                + b.warm_up_2_dph * libm::exp(-causes.end_s / b.warm_up_2_s)
        } else {
            0.0
        };
        let [flicker, walk, ramp] = causes.slow;
        [
            b.fixed_dph,
            b.slope_dph_per_c * (t.block_c - REFERENCE_C)
                + b.knee_dph * libm::tanh((t.block_c - b.knee_c) / b.knee_width_c),
            b.rate_dph_per_cpm * t.block_cpm,
            b.gradient_dph_per_c * t.gradient_c,
            b.hysteresis_dph * (t.block_c - self.play_c) / half,
            b.mode_step_dph * if causes.mode.rem_euclid(2) == 0 { 0.5 } else { -0.5 },
            b.ripple_dph * libm::sin(std::f64::consts::PI * causes.actuator_waves),
            warm_up,
            self.null_shift_dph_per_ma * self.imbalance_part * causes.current_ma,
            flicker,
            walk,
            ramp,
            causes.unlocked_dph,
            // Found once the others are known.
            0.0,
        ]
    }
}
