//! What a drift does to a position: one channel of a strapdown navigator.
//!
//! ```text
//! level axis    ψ̇ = b − v/R,  v̇ = g·ψ,  ẋ = v          constant b:  x = b·R·(t − sin ω_s t/ω_s),  ω_s = √(g/R)
//! azimuth       ψ̇ = b,        ẏ = V·ψ                   constant b:  y = V·b·t²/2
//! ```
//!
//! Schuler's pendulum swings once in 84.4 minutes. Each step holds b and is integrated exactly, so that the step's length
//! changes nothing but the shape of b. Noise is no drift: white rate noise of N leaves √(N²·∫h²dt) for the same channel,
//! h its response to an impulse of angle, and stands apart.
//!
//! What it leaves out: coupling between channels, the turning Earth, a vehicle that turns, aiding.

/// Radius of a sphere of the Earth's volume, m (IUGG mean radius R₃).
pub(crate) const EARTH_RADIUS_M: f64 = 6_371_000.8;
/// Standard gravity, m/s² (CGPM 1901).
pub(crate) const GRAVITY_M_S2: f64 = 9.806_65;
/// rad/s of one °/h.
const RAD_S_PER_DPH: f64 = std::f64::consts::PI / 180.0 / 3600.0;

/// Which gyro it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Channel {
    /// Its axis lies level.
    Level,
    /// Its axis is vertical; the ground speed, m/s.
    Azimuth(f64),
}

/// Tilt, velocity and position error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strapdown {
    /// Tilt or heading error, rad.
    psi: f64,
    /// Velocity error, m/s.
    v_m_s: f64,
    /// Position error, m.
    x_m: f64,
}

impl Strapdown {
    /// Position error, m.
    pub fn position_m(&self) -> f64 {
        self.x_m
    }

    /// Goes on by a step over which the drift is held.
    pub fn step(&mut self, channel: Channel, drift_dph: f64, dt_s: f64) {
        let b = drift_dph * RAD_S_PER_DPH;
        match channel {
            Channel::Level => {
                let omega = (GRAVITY_M_S2 / EARTH_RADIUS_M).sqrt();
                let (sin, cos) = (omega * dt_s).sin_cos();
                // About the velocity at which the tilt stands still, v = b·R, everything is a swing.
                let rest = b * EARTH_RADIUS_M;
                let (swing, tilt) = (self.v_m_s - rest, self.psi * GRAVITY_M_S2 / omega);
                self.x_m += rest * dt_s + (swing * sin + tilt * (1.0 - cos)) / omega;
                self.v_m_s = rest + swing * cos + tilt * sin;
                self.psi = (tilt * cos - swing * sin) * omega / GRAVITY_M_S2;
            }
            Channel::Azimuth(speed_m_s) => {
                self.x_m += speed_m_s * (self.psi * dt_s + 0.5 * b * dt_s * dt_s);
                self.psi += b * dt_s;
            }
        }
    }
}

/// Position error of a drift that is held over each step, m; one value after each step.
pub fn positions_m(channel: Channel, drift_dph: &[f64], dt_s: f64) -> Vec<f64> {
    let mut state = Strapdown::default();
    let one = |b: &f64| {
        state.step(channel, *b, dt_s);
        state.position_m()
    };
    drift_dph.iter().map(one).collect()
}

/// σ of the position that angle random walk alone leaves after so long, m.
pub fn noise_m(channel: Channel, n_deg_rt_h: f64, seconds: f64) -> f64 {
    // N in rad/√s; ∫h² in closed form: h = R·(1 − cos ω_s t) per rad, or V·t.
    let n = n_deg_rt_h / 60.0 * std::f64::consts::PI / 180.0;
    let square = match channel {
        Channel::Level => {
            let omega = (GRAVITY_M_S2 / EARTH_RADIUS_M).sqrt();
            let angle = omega * seconds;
            let integral = 1.5 * seconds - 2.0 * angle.sin() / omega + (2.0 * angle).sin() / (4.0 * omega);
            EARTH_RADIUS_M.powi(2) * integral.clamp(0.0, f64::INFINITY)
        }
        Channel::Azimuth(speed_m_s) => speed_m_s.powi(2) * seconds.powi(3) / 3.0,
    };
    n * square.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(channel: Channel, drift_dph: f64, seconds: usize) -> f64 {
        positions_m(channel, &vec![drift_dph; seconds], 1.0)[seconds - 1]
    }

    /// The closed form, and the table of the domain notes §6 to its digits.
    #[test]
    fn constant_drift_is_the_closed_form() {
        let omega = (GRAVITY_M_S2 / EARTH_RADIUS_M).sqrt();
        assert!((omega / 1.2407e-3 - 1.0).abs() < 1e-4, "{omega}");
        for (b, minutes, wanted, within) in [
            (0.01, 10, 16.6, 0.05),
            (0.01, 60, 1350.0, 5.0),
            (0.095, 10, 159.0, 1.5),
            (0.095, 60, 12_900.0, 50.0),
            (0.749, 10, 1250.0, 5.0),
            (0.749, 60, 101_000.0, 500.0),
        ] {
            let t = f64::from(minutes) * 60.0;
            let closed = b * RAD_S_PER_DPH * EARTH_RADIUS_M * (t - (omega * t).sin() / omega);
            let got = after(Channel::Level, b, minutes as usize * 60);
            assert!((got / closed - 1.0).abs() < 1e-9, "{got} for {closed}");
            assert!((got - wanted).abs() <= within, "{b} °/h, {minutes} min: {got} m for {wanted}");
        }
    }

    /// Short term g·b·t³/6; over whole swings 0.600 nautical miles an hour for 0.01 °/h.
    #[test]
    fn short_and_secular_terms() {
        let t: f64 = 60.0;
        let short = GRAVITY_M_S2 * 0.01 * RAD_S_PER_DPH * t.powi(3) / 6.0;
        assert!((after(Channel::Level, 0.01, 60) / short - 1.0).abs() < 1e-3);
        let swing_s = std::f64::consts::TAU / (GRAVITY_M_S2 / EARTH_RADIUS_M).sqrt();
        let drift = vec![0.01; 100_000];
        let nautical_miles = positions_m(Channel::Level, &drift, swing_s / 100_000.0)[99_999] / 1852.0;
        assert!((nautical_miles / (swing_s / 3600.0) - 0.600).abs() < 1e-3, "{nautical_miles}");
    }

    #[test]
    fn an_azimuth_drift_bends_the_course() {
        let wanted = 250.0 * 0.01 * RAD_S_PER_DPH * 3600.0_f64.powi(2) / 2.0;
        assert!((after(Channel::Azimuth(250.0), 0.01, 3600) / wanted - 1.0).abs() < 1e-9);
    }

    /// White noise through the steps, 400 times, against the closed form of its σ.
    #[test]
    fn noise_leaves_what_the_closed_form_says() {
        let mut state = 88_172_645_463_325_252_u64;
        let mut normal = || {
            let mut uniform = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        for channel in [Channel::Level, Channel::Azimuth(200.0)] {
            // 0.003 °/√h is 0.18 °/h·√s: σ of a second's mean rate.
            let squares: f64 = (0..400)
                .map(|_| {
                    let drift: Vec<f64> = (0..3600).map(|_| 0.18 * normal()).collect();
                    positions_m(channel, &drift, 1.0)[3599].powi(2)
                })
                .sum();
            let ratio = (squares / 400.0).sqrt() / noise_m(channel, 0.003, 3600.0);
            assert!((ratio - 1.0).abs() < 0.12, "{channel:?}: {ratio}");
        }
    }
}
