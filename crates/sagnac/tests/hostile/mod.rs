//! A test engineer's own generator of thermal tests. It shares no code with the fit or with the simulator: profile, block,
//! noise and counter are written out here.
//!
//! ```text
//! chamber: −40 … +70 °C at 1 °C/min with soaks, a triangle or the standard profile ─first-order lag─▶ block = thermometer
//! rate   = input + bias + drift(T, Ṫ) + disturbance + N (white) + B (flicker) + K (walk) + slow (AR(1))      °/h
//! counts = floor(angle/quantum) differences: quantization is that of a counter
//! ```

pub(crate) mod curves;
pub(crate) mod lots;
pub(crate) mod planned;
pub(crate) mod stopped;
pub(crate) mod table;

use sagnac_log::setup::Setup;

use crate::support::evidence::Records;
use crate::support::rows::{Rows, to_decimals};

/// Angle of a count, arcsec.
pub(crate) const QUANTUM_ARCSEC: f64 = 0.15125;
/// Angle random walk, °/√h.
pub(crate) const N_DEG_RT_H: f64 = 0.003;
/// White noise of a 100 s window by that walk, °/h.
pub(crate) const WHITE_100_S_DPH: f64 = 0.018;

/// Length of the standard profile, h.
pub(crate) const STANDARD_HOURS: f64 = 890.0 / 60.0;

/// Own random numbers: SplitMix64 and Box–Muller.
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) + 1) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// Slow noise of a gyro.
#[derive(Clone, Copy, Default)]
pub(crate) struct Slow {
    pub(crate) b_dph: f64,
    /// Rate random walk, °/h/√h.
    pub(crate) k_dph_rt_h: f64,
    /// Correlation time, s, and σ, °/h, of a first-order Markov process.
    pub(crate) markov: Option<(f64, f64)>,
}

/// The same on its way. Flicker: Markov processes two octaves apart, from 10 s to 11 h; each has σ² = B²·ln 4/π. What is slower than
/// the test is its bias.
pub(crate) struct SlowNow {
    slow: Slow,
    flicker: [f64; 7],
    markov: f64,
    walk: f64,
}

impl Slow {
    pub(crate) fn begin(self, dice: &mut Dice) -> SlowNow {
        SlowNow { slow: self, flicker: std::array::from_fn(|_| dice.normal()), markov: dice.normal(), walk: 0.0 }
    }
}

impl SlowNow {
    /// °/h of the next row.
    pub(crate) fn next(&mut self, row_s: f64, dice: &mut Dice) -> f64 {
        let Slow { b_dph, k_dph_rt_h, markov } = self.slow;
        let step = |state: f64, tau_s: f64, dice: &mut Dice| {
            let keep = (-row_s / tau_s).exp();
            keep * state + (1.0 - keep * keep).sqrt() * dice.normal()
        };
        for (k, state) in self.flicker.iter_mut().enumerate().filter(|_| b_dph > 0.0) {
            *state = step(*state, 10.0 * 4.0_f64.powi(k as i32), dice);
        }
        self.walk += k_dph_rt_h * (row_s / 3600.0).sqrt() * dice.normal();
        let mut of_markov = 0.0;
        if let Some((tau_s, sigma)) = markov {
            self.markov = step(self.markov, tau_s, dice);
            of_markov = sigma * self.markov;
        }
        b_dph * (4.0_f64.ln() / std::f64::consts::PI).sqrt() * self.flicker.iter().sum::<f64>() + self.walk + of_markov
    }
}

/// What the drift is a function of.
#[derive(Clone, Copy)]
pub(crate) struct Now {
    /// Temperature of the block, °C.
    pub(crate) celsius: f64,
    /// Its rate, °C/min.
    pub(crate) cpm: f64,
    /// Its rate behind a first-order lag of [`Bench::rate_lag_s`], °C/min.
    pub(crate) lagged_cpm: f64,
    /// Its rate behind a second lag, of [`Bench::slow_lag_s`], °C/min.
    pub(crate) slow_cpm: f64,
    /// Since the start of the test, h.
    pub(crate) hours: f64,
}

impl Now {
    /// Temperature scaled to −1 … 1 over −40 … +70 °C.
    pub(crate) fn u(self) -> f64 {
        (self.celsius - 15.0) / 55.0
    }
}

/// One thermal test of one gyro.
#[derive(Clone)]
pub(crate) struct Bench<'a> {
    pub(crate) seed: u64,
    /// Cycles −40 → +70 → −40 °C with soaks of an hour and a half: at their ends the block stands still.
    pub(crate) cycles: usize,
    /// Only the first so many hours, if given.
    pub(crate) hours: Option<f64>,
    pub(crate) block_lag_s: f64,
    pub(crate) rate_lag_s: f64,
    pub(crate) slow_lag_s: f64,
    pub(crate) thermometer_step_c: f64,
    /// Input rate and fixed bias, °/h.
    pub(crate) input_dph: f64,
    pub(crate) bias_dph: f64,
    /// Deviation of the scale factor, ppm.
    pub(crate) scale_ppm: f64,
    pub(crate) drift: &'a dyn Fn(Now) -> f64,
    pub(crate) n_deg_rt_h: f64,
    pub(crate) b_dph: f64,
    /// Rate random walk, °/h/√h.
    pub(crate) k_dph_rt_h: f64,
    /// Correlation time, s, and σ, °/h, of a first-order Markov process.
    pub(crate) markov: Option<(f64, f64)>,
    /// Time of the first row's start, s.
    pub(crate) start_s: f64,
    /// Angle of a count, arcsec.
    pub(crate) quantum_arcsec: f64,
    /// The phase at which a count is taken is uniform, as behind a dither.
    pub(crate) is_dithered: bool,
    /// Interval of a row, s.
    pub(crate) row_s: f64,
    /// Temperature of the chamber, °C, after so many minutes.
    pub(crate) chamber_c: fn(f64) -> f64,
}

/// A gyro with a weak cubic and a rate term, as most are.
pub(crate) fn usual(now: Now) -> f64 {
    0.02 * now.u() - 0.008 * now.u().powi(2) + 0.01 * now.u().powi(3) + 0.05 * now.cpm
}

/// No drift.
pub(crate) fn none(_: Now) -> f64 {
    0.0
}

impl<'a> Bench<'a> {
    pub(crate) fn new(seed: u64, drift: &'a dyn Fn(Now) -> f64) -> Self {
        Self {
            seed,
            cycles: 2,
            hours: None,
            block_lag_s: 1200.0,
            rate_lag_s: 1.0,
            slow_lag_s: 1.0,
            thermometer_step_c: 0.0,
            input_dph: 4.5,
            bias_dph: 0.0,
            scale_ppm: 0.0,
            drift,
            n_deg_rt_h: N_DEG_RT_H,
            b_dph: 0.0,
            k_dph_rt_h: 0.0,
            markov: None,
            start_s: 0.0,
            quantum_arcsec: QUANTUM_ARCSEC,
            is_dithered: false,
            row_s: 5.0,
            chamber_c: Self::triangle_c,
        }
    }

    /// The standard retest of a gyro.
    pub(crate) fn retest(seed: u64, drift: &'a dyn Fn(Now) -> f64) -> Self {
        Self::new(seed, drift).standard()
    }

    /// The same gyro on the standard profile.
    pub(crate) fn standard(self) -> Self {
        Self { chamber_c: Self::standard_c, hours: Some(STANDARD_HOURS), ..self }
    }

    /// How its logs are read.
    pub(crate) fn setup() -> Setup {
        Self::setup_of(QUANTUM_ARCSEC)
    }

    /// The same with counts of another size.
    pub(crate) fn setup_of(quantum_arcsec: f64) -> Setup {
        Setup { arcsec_per_count: Some(quantum_arcsec), input_rate_dph: Some(4.5.into()), ..Setup::default() }
    }

    /// Chamber temperature after so many minutes: soak cold, up, soak hot, down.
    pub(crate) fn triangle_c(minutes: f64) -> f64 {
        match minutes % 400.0 {
            m if m < 90.0 => -40.0,
            m if m < 200.0 => -40.0 + (m - 90.0),
            m if m < 290.0 => 70.0,
            m => 70.0 - (m - 290.0),
        }
    }

    /// The standard profile after so many minutes: soaks at −40, 25, 70, 25 and −40 °C, a cycle without soaks; in a longer test cycles
    /// with soaks at 25 °C follow.
    pub(crate) fn standard_c(minutes: f64) -> f64 {
        match minutes {
            m if m < 90.0 => -40.0,
            m if m < 155.0 => -40.0 + (m - 90.0),
            m if m < 245.0 => 25.0,
            m if m < 290.0 => 25.0 + (m - 245.0),
            m if m < 380.0 => 70.0,
            m if m < 425.0 => 70.0 - (m - 380.0),
            m if m < 515.0 => 25.0,
            m if m < 580.0 => 25.0 - (m - 515.0),
            m if m < 670.0 => -40.0,
            m if m < 890.0 => 70.0 - (m - 780.0).abs(),
            m => match (m - 890.0) % 400.0 {
                m if m < 65.0 => -40.0 + m,
                m if m < 155.0 => 25.0,
                m if m < 200.0 => 25.0 + (m - 155.0),
                m if m < 245.0 => 70.0 - (m - 200.0),
                m if m < 335.0 => 25.0,
                m => 25.0 - (m - 335.0),
            },
        }
    }

    pub(crate) fn rows(&self) -> usize {
        let hours = self.hours.unwrap_or(400.0 / 60.0 * self.cycles as f64);
        (hours * 3600.0 / self.row_s).round() as usize
    }

    /// Every row: its number, what the drift is a function of, and the dice of its noise.
    pub(crate) fn run(&self, mut row: impl FnMut(usize, Now, &mut Dice)) {
        let mut dice = Dice::new(self.seed);
        let (mut block, mut lagged, mut slow) = ((self.chamber_c)(0.0), 0.0, 0.0);
        for i in 0..self.rows() {
            let minutes = (i as f64 + 0.5) * self.row_s / 60.0;
            let before = block;
            block += ((self.chamber_c)(minutes) - block) * (1.0 - (-self.row_s / self.block_lag_s).exp());
            let cpm = (block - before) / self.row_s * 60.0;
            lagged += (cpm - lagged) * (1.0 - (-self.row_s / self.rate_lag_s).exp());
            slow += (cpm - slow) * (1.0 - (-self.row_s / self.slow_lag_s).exp());
            let now = Now { celsius: block, cpm, lagged_cpm: lagged, slow_cpm: slow, hours: minutes / 60.0 };
            row(i, now, &mut dice);
        }
    }

    /// The log of counts; `disturb` adds °/h by hours of test.
    pub(crate) fn log_with(&self, disturb: &dyn Fn(f64) -> f64) -> Rows<3> {
        let mut log = Rows::new(["time_s", "temperature_c", "counts"]);
        let hours_per_row = self.row_s / 3600.0;
        let white = self.n_deg_rt_h / hours_per_row.sqrt();
        let mut start = Dice::new(self.seed ^ 0xf11c);
        let slow = Slow { b_dph: self.b_dph, k_dph_rt_h: self.k_dph_rt_h, markov: self.markov };
        let mut slow = slow.begin(&mut start);
        let (mut angle, mut counted) = (start.uniform() * self.quantum_arcsec, 0.0);
        self.run(|i, now, dice| {
            let slow_dph = slow.next(self.row_s, dice);
            let noise = slow_dph + white * dice.normal();
            let input = self.input_dph + self.bias_dph + (self.drift)(now) + disturb(now.hours) + noise;
            angle += input * self.row_s / (1.0 + self.scale_ppm * 1e-6);
            let dither = if self.is_dithered { start.uniform() } else { 0.0 };
            let total = (angle / self.quantum_arcsec + dither).floor();
            let step = self.thermometer_step_c;
            let read = if step > 0.0 { (now.celsius / step).round() * step } else { now.celsius };
            let time_s = self.start_s + (i + 1) as f64 * self.row_s;
            log.push([time_s, to_decimals(read, 4), total - counted]);
            counted = total;
        });
        log
    }

    pub(crate) fn log(&self) -> Rows<3> {
        self.log_with(&|_| 0.0)
    }
}

/// Part of some records for which `holds` is true, over both processors.
pub(crate) fn fraction(of: impl Into<Records>, holds: impl Fn(u64) -> bool + Sync) -> f64 {
    use rayon::prelude::*;
    let seeds = of.into().each();
    let count = seeds.end as f64;
    seeds.into_par_iter().filter(|seed| holds(*seed)).count() as f64 / count
}
