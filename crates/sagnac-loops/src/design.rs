//! Controller gains from a bandwidth and a phase margin.
//!
//! ```text
//! plant       P(jω) = g·e^(−jω·delay)/(1 + jω·lag)                        error units per actuator code
//! controller  C(jω) = kp + ki/(1 − e^(−jωT)) = kp + ki/2 − j·(ki/2)·cot(ωT/2)     updated every T
//! at ω_c      C = e^(j(φ_m − π))/P     ⇒     ki = −2·Im C·tan(ω_c·T/2),   kp = Re C − ki/2
//! ```
//!
//! Two equations determine the two gains: the loop gain is 1 at the given frequency, with the given phase margin. If an
//! integrator by itself has more margin, kp would be negative. Then kp = 0, the crossover is unchanged and the margin is
//! larger than required. If even a proportional controller has less margin, the goal is refused with the margin that the
//! plant allows. The hold of the output and the mean over a period are part of `delay`.
//!
//! Not valid if the plant has more than one lag near ω_c (a piezo near its resonance).

use core::f64::consts::{PI, TAU};
use core::fmt;

/// The controlled plant: gain, one lag, one delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Error units per actuator code, positive.
    pub gain: f64,
    /// First-order lag, s; 0 for none.
    pub lag_s: f64,
    /// Sum of all delays, s: half a period of hold, half a period of averaging, and the ticks in between.
    pub delay_s: f64,
}

/// Design goal of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopGoal {
    /// Crossover of the open loop, Hz.
    pub bandwidth_hz: f64,
    /// Smallest phase margin at the crossover, degrees.
    pub phase_margin_deg: f64,
}

/// Gains of a proportional-integral controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PiGains {
    /// Codes per error unit.
    pub kp: f64,
    /// Codes per error unit and update.
    pub ki: f64,
    /// Time between updates, s.
    pub period_s: f64,
    /// Phase margin at the crossover, degrees.
    pub phase_margin_deg: f64,
}

/// Why a configuration cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DesignError {
    /// A value is not finite or outside its range.
    OutOfRange {
        /// Name as in the configuration.
        name: &'static str,
        /// Given value.
        value: f64,
        /// Smallest allowed value.
        least: f64,
        /// Largest allowed value.
        most: f64,
    },
    /// The phase margin is not possible at this bandwidth, even without an integrator.
    Margin {
        /// Required margin, degrees.
        wanted_deg: f64,
        /// Margin of a proportional controller, degrees.
        possible_deg: f64,
    },
    /// The range of the actuator is too short for a mode reset.
    ShortRange {
        /// The range without the modulation, wavelengths.
        waves: f64,
    },
    /// The modulation curves the light of a peak too little to show that it is one.
    Faint {
        /// Second harmonic of the light, codes of the photodiode.
        codes: f64,
        /// Modulation that would suffice, wavelengths.
        least_waves: f64,
    },
    /// A gain does not fit the mantissa and shift of the target.
    Gain {
        /// Name of the gain.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

impl fmt::Display for DesignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange { name, value, least, most } => {
                write!(f, "{name} is {}: give {} to {}", Short(*value), Short(*least), Short(*most))
            }
            Self::Margin { wanted_deg, possible_deg } => write!(
                f,
                "a phase margin of {wanted_deg}° is not possible at this bandwidth: delay and lag leave {possible_deg:.1}° without an integrator; ask for less bandwidth"
            ),
            Self::ShortRange { waves } => write!(
                f,
                "the actuator's range holds {waves:.2} wavelengths; a mode reset needs one, twice the margin of a reset, and 0.04"
            ),
            Self::Faint { codes, least_waves } => write!(
                f,
                "a peak makes a second harmonic of {:.2e} codes of the photodiode and a lock needs half a code of it: modulate by {} wavelengths, or give a photodiode of more bits or an actuator of less lag",
                codes,
                Short(*least_waves)
            ),
            Self::Gain { name, value } => write!(
                f,
                "{name} would be {value:.3e} codes per unit of error, which 30 bits and a shift of 0 to 62 cannot hold; change the converter's range or the modulation"
            ),
        }
    }
}

/// Five digits.
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

/// The value, if it is in its range.
pub(crate) fn within(name: &'static str, value: f64, least: f64, most: f64) -> Result<f64, DesignError> {
    if value >= least && value <= most { Ok(value) } else { Err(DesignError::OutOfRange { name, value, least, most }) }
}

impl Plant {
    /// Phase at ω, rad.
    fn phase(&self, omega: f64) -> f64 {
        -omega * self.delay_s - libm::atan(omega * self.lag_s)
    }

    /// Magnitude at ω.
    fn size(&self, omega: f64) -> f64 {
        self.gain / libm::sqrt(1.0 + omega * self.lag_s * omega * self.lag_s)
    }
}

/// Gains of a PI controller updated every `period_s`.
///
/// # Errors
/// A plant, period or goal out of range; a margin that is not possible.
pub fn pi_gains(plant: Plant, period_s: f64, goal: LoopGoal) -> Result<PiGains, DesignError> {
    within("plant gain", plant.gain, f64::MIN_POSITIVE, 1e30)?;
    within("lag_s", plant.lag_s, 0.0, 1e6)?;
    within("delay_s", plant.delay_s, 0.0, 1e6)?;
    within("period_s", period_s, 1e-9, 1e6)?;
    // At most a tenth of the update rate: above that the update period dominates the loop.
    within("bandwidth_hz", goal.bandwidth_hz, 1e-9, 0.1 / period_s)?;
    within("phase_margin_deg", goal.phase_margin_deg, 20.0, 120.0)?;
    let omega = TAU * goal.bandwidth_hz;
    let half = omega * period_s / 2.0;
    let (size, phase) = (1.0 / plant.size(omega), plant.phase(omega));
    let angle = goal.phase_margin_deg.to_radians() - PI - phase;
    let ki = -2.0 * size * libm::sin(angle) * libm::tan(half);
    let kp = size * libm::cos(angle) - ki / 2.0;
    if angle >= 0.0 {
        return Err(DesignError::Margin { wanted_deg: goal.phase_margin_deg, possible_deg: (PI + phase).to_degrees() });
    }
    if kp < 0.0 {
        // ki/(1 − e^(−jωT)) has the size ki/(2 sin(ωT/2)) and the phase ωT/2 − π/2.
        let margin = PI + half - PI / 2.0 + phase;
        let ki = 2.0 * size * libm::sin(half);
        return Ok(PiGains { kp: 0.0, ki, period_s, phase_margin_deg: margin.to_degrees() });
    }
    Ok(PiGains { kp, ki, period_s, phase_margin_deg: goal.phase_margin_deg })
}

/// Open loop gain (1 = 0 dB) and phase (degrees) at a frequency.
pub fn open_loop(plant: &Plant, pi: &PiGains, frequency_hz: f64) -> (f64, f64) {
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
        /// The closed form and the open loop agree: gain 1 at the crossover, at least the phase margin of the goal.
        #[test]
        fn the_loop_crosses_where_it_was_asked_to(
            gain in 1e-6_f64..1e6,
            lag_s in 0.0_f64..10.0,
            part in 0.0005_f64..0.05,
            phase_margin_deg in 30.0_f64..80.0,
        ) {
            let period_s = 8e-4;
            let plant = Plant { gain, lag_s, delay_s: 1.1 * period_s };
            let goal = LoopGoal { bandwidth_hz: part / period_s, phase_margin_deg };
            if let Ok(pi) = pi_gains(plant, period_s, goal) {
                let (size, phase) = open_loop(&plant, &pi, goal.bandwidth_hz);
                prop_assert!((size - 1.0).abs() < 1e-9, "gain {size}");
                prop_assert!(180.0 + phase > phase_margin_deg - 1e-6, "margin {}", 180.0 + phase);
                prop_assert!((180.0 + phase - pi.phase_margin_deg).abs() < 1e-6);
                prop_assert!(pi.kp >= 0.0 && pi.ki > 0.0);
            }
        }
    }

    #[test]
    fn an_impossible_margin_is_refused_with_the_possible_one() {
        let plant = Plant { gain: 1.0, lag_s: 0.0, delay_s: 0.01 };
        let goal = LoopGoal { bandwidth_hz: 20.0, phase_margin_deg: 110.0 };
        let error = pi_gains(plant, 1e-3, goal).unwrap_err();
        // 180° − 360°·20 Hz·10 ms.
        assert!(matches!(error, DesignError::Margin { possible_deg, .. } if (possible_deg - 108.0).abs() < 1e-9));
        assert!(pi_gains(plant, 1e-3, LoopGoal { bandwidth_hz: f64::NAN, ..goal }).is_err());
    }
}
