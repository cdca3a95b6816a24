//! Gains from a wanted bandwidth and phase margin.
//!
//! ```text
//! plant       P(jω) = g·e^(−jω·delay)/(1 + jω·lag)                        error units per actuator code
//! controller  C(jω) = kp + ki/(1 − e^(−jωT)) = kp + ki/2 − j·(ki/2)·cot(ωT/2)     updated every T
//! at ω_c      C = e^(j(φ_m − π))/P     ⇒     ki = −2·Im C·tan(ω_c·T/2),   kp = Re C − ki/2
//! ```
//!
//! Two equations, two unknowns: the loop crosses 1 at the wanted frequency with the wanted margin. Where the
//! integrator alone has more margin than was wanted, kp would be negative; then kp = 0, the crossover is the wanted
//! one and the margin is what comes out, never less. Where even a proportional controller has less, the wish is
//! refused with what the plant allows. The hold of the output and the mean over a period belong to `delay`.
//!
//! It stops being true where the plant has more than one lag near ω_c (a piezo near its resonance).

use core::f64::consts::{PI, TAU};
use core::fmt;

/// What is controlled, as far as the gains need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Error units per actuator code, positive.
    pub gain: f64,
    /// First-order lag, s; 0 for none.
    pub lag_s: f64,
    /// All delays together, s: half a period of hold, half of averaging, and the ticks in between.
    pub delay_s: f64,
}

/// What is asked of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Crossover of the open loop, Hz.
    pub bandwidth_hz: f64,
    /// Phase margin there, degrees, at least.
    pub phase_margin_deg: f64,
}

/// A controller with one integrator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pi {
    /// Codes per error unit.
    pub kp: f64,
    /// Codes per error unit and update.
    pub ki: f64,
    /// Time between updates, s.
    pub period_s: f64,
    /// Margin at the wanted crossover, degrees.
    pub phase_margin_deg: f64,
}

/// Why a configuration cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DesignError {
    /// A value that is not finite or outside its range: its name, the value, the range.
    OutOfRange {
        /// Name as in the configuration.
        name: &'static str,
        /// What was given.
        value: f64,
        /// Smallest that can be.
        least: f64,
        /// Largest that can be.
        most: f64,
    },
    /// The margin cannot be had at that bandwidth, even without an integrator.
    Margin {
        /// What was wanted.
        wanted_deg: f64,
        /// What a proportional controller would have there.
        possible_deg: f64,
    },
    /// A range in which no mode reset can be made.
    ShortRange {
        /// What it holds besides the modulation, wavelengths.
        waves: f64,
    },
    /// A gain that the target's mantissa and shift cannot hold.
    Gain {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

impl fmt::Display for DesignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange { name, value, least, most } => {
                write!(f, "{name} is {}; it can be {} to {}", Short(*value), Short(*least), Short(*most))
            }
            Self::Margin { wanted_deg, possible_deg } => write!(
                f,
                "a phase margin of {wanted_deg}° is not to be had at this bandwidth: delay and lag leave {possible_deg:.1}° without an integrator; ask for less bandwidth"
            ),
            Self::ShortRange { waves } => write!(
                f,
                "the actuator's range holds {waves:.2} wavelengths; a mode reset needs one, twice the margin of a reset, and 0.04"
            ),
            Self::Gain { name, value } => write!(
                f,
                "{name} would be {value:.3e} codes per unit of error, which 30 bits and a shift of 0 to 62 cannot hold; change the converter's range or the modulation"
            ),
        }
    }
}

/// Five digits are enough to see what is wrong.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = libm::fabs(self.0);
        if size != 0.0 && !(1e-3..1e6).contains(&size) {
            return write!(f, "{:.4e}", self.0);
        }
        let rounded = libm::round(self.0 * 1e4) / 1e4;
        write!(f, "{rounded}")
    }
}

impl core::error::Error for DesignError {}

/// A value in its range, or the refusal.
pub(crate) fn within(name: &'static str, value: f64, least: f64, most: f64) -> Result<f64, DesignError> {
    if value >= least && value <= most { Ok(value) } else { Err(DesignError::OutOfRange { name, value, least, most }) }
}

impl Plant {
    /// Phase at ω without the gain, rad.
    fn phase(&self, omega: f64) -> f64 {
        -omega * self.delay_s - libm::atan(omega * self.lag_s)
    }

    fn size(&self, omega: f64) -> f64 {
        self.gain / libm::sqrt(1.0 + omega * self.lag_s * omega * self.lag_s)
    }
}

/// Gains of a PI controller updated every `period_s`.
///
/// # Errors
/// A plant, period or wish out of range; a margin that cannot be had.
pub fn pi_gains(plant: Plant, period_s: f64, wanted: Wanted) -> Result<Pi, DesignError> {
    within("plant gain", plant.gain, f64::MIN_POSITIVE, 1e30)?;
    within("lag_s", plant.lag_s, 0.0, 1e6)?;
    within("delay_s", plant.delay_s, 0.0, 1e6)?;
    within("period_s", period_s, 1e-9, 1e6)?;
    // A tenth of the update rate: beyond it the controller's own period is the loop.
    within("bandwidth_hz", wanted.bandwidth_hz, 1e-9, 0.1 / period_s)?;
    within("phase_margin_deg", wanted.phase_margin_deg, 20.0, 120.0)?;
    let omega = TAU * wanted.bandwidth_hz;
    let half = omega * period_s / 2.0;
    let (size, phase) = (1.0 / plant.size(omega), plant.phase(omega));
    let angle = wanted.phase_margin_deg.to_radians() - PI - phase;
    let ki = -2.0 * size * libm::sin(angle) * libm::tan(half);
    let kp = size * libm::cos(angle) - ki / 2.0;
    if angle >= 0.0 {
        return Err(DesignError::Margin {
            wanted_deg: wanted.phase_margin_deg,
            possible_deg: (PI + phase).to_degrees(),
        });
    }
    if kp < 0.0 {
        // ki/(1 − e^(−jωT)) has the size ki/(2 sin(ωT/2)) and the phase ωT/2 − π/2.
        let margin = PI + half - PI / 2.0 + phase;
        let ki = 2.0 * size * libm::sin(half);
        return Ok(Pi { kp: 0.0, ki, period_s, phase_margin_deg: margin.to_degrees() });
    }
    Ok(Pi { kp, ki, period_s, phase_margin_deg: wanted.phase_margin_deg })
}

/// Open loop gain (1 = 0 dB) and phase (degrees) at a frequency.
pub fn open_loop(plant: &Plant, pi: &Pi, frequency_hz: f64) -> (f64, f64) {
    let omega = TAU * frequency_hz;
    let half = omega * pi.period_s / 2.0;
    let (re, im) = (pi.kp + pi.ki / 2.0, -pi.ki / 2.0 / libm::tan(half));
    let phase = libm::atan2(im, re) + plant.phase(omega);
    (libm::hypot(re, im) * plant.size(omega), phase.to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The closed form and the open loop agree: gain 1 at the wanted frequency, at least the wanted margin.
        #[test]
        fn the_loop_crosses_where_it_was_asked_to(
            gain in 1e-6_f64..1e6,
            lag_s in 0.0_f64..10.0,
            part in 0.0005_f64..0.05,
            phase_margin_deg in 30.0_f64..80.0,
        ) {
            let period_s = 8e-4;
            let plant = Plant { gain, lag_s, delay_s: 1.1 * period_s };
            let wanted = Wanted { bandwidth_hz: part / period_s, phase_margin_deg };
            if let Ok(pi) = pi_gains(plant, period_s, wanted) {
                let (size, phase) = open_loop(&plant, &pi, wanted.bandwidth_hz);
                prop_assert!((size - 1.0).abs() < 1e-9, "gain {size}");
                prop_assert!(180.0 + phase > phase_margin_deg - 1e-6, "margin {}", 180.0 + phase);
                prop_assert!((180.0 + phase - pi.phase_margin_deg).abs() < 1e-6);
                prop_assert!(pi.kp >= 0.0 && pi.ki > 0.0);
            }
        }
    }

    #[test]
    fn a_wish_that_cannot_be_is_refused_with_what_can() {
        let plant = Plant { gain: 1.0, lag_s: 0.0, delay_s: 0.01 };
        let wanted = Wanted { bandwidth_hz: 20.0, phase_margin_deg: 110.0 };
        let error = pi_gains(plant, 1e-3, wanted).unwrap_err();
        // 180° − 360°·20 Hz·10 ms.
        assert!(matches!(error, DesignError::Margin { possible_deg, .. } if (possible_deg - 108.0).abs() < 1e-9));
        assert!(pi_gains(plant, 1e-3, Wanted { bandwidth_hz: f64::NAN, ..wanted }).is_err());
    }
}
