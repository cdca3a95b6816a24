//! A gyro on a rate table in a chamber that steps through temperatures, up and down again.
//!
//! ```text
//! chamber: −40, −18, 4, 26, 48, 70, 48, 26, 4, −18, −40 °C, 2,500 s each, 1 °C/min between; the block follows at once
//! table:   x·Ω_most, x = 1, −1, ½, −½, 0 in turn, 100 s each unless told
//! ε(T, x)  = S's deviation + over temperature ± hysteresis/2 (heating −, cooling +) ± asymmetry/2 (by the sign of x)      ppm
//! counted  = [Ω/(1 + ε) + nonlinearity·Ω_most·c(x) + input + bias + drift(T) + N + slow]/S0, floor of the sum
//! c(x)     = (x³ − 0.85 x)/0.3: on these five x its straight line is zero and its largest value is 1, at ±½
//! ```
//!
//! An asymmetry a bends the line, too: on these x by 0.3 a, at rest.

use sagnac_log::setup::Setup;

use super::{Dice, N_DEG_RT_H, QUANTUM_ARCSEC, Slow};
use crate::support::rows::{Rows, to_decimals};

/// Temperatures in their order, °C.
const PLATEAUS_C: [f64; 11] = [-40.0, -18.0, 4.0, 26.0, 48.0, 70.0, 48.0, 26.0, 4.0, -18.0, -40.0];
const SOAK_S: f64 = 2500.0;
const ROW_S: f64 = 5.0;
/// Parts of the largest rate.
const PARTS: [f64; 5] = [1.0, -1.0, 0.5, -0.5, 0.0];

/// A row of the test.
#[derive(Clone, Copy)]
pub(crate) struct Row {
    pub(crate) celsius: f64,
    /// Rate of the chamber, °C/min.
    pub(crate) cpm: f64,
    /// Since the start, h.
    pub(crate) hours: f64,
    /// Part of the largest rate, as the rates come in turn.
    pub(crate) part: f64,
}

/// One test of one gyro.
#[derive(Clone, Copy)]
pub(crate) struct Table {
    pub(crate) seed: u64,
    /// Largest rate of the table, °/s.
    pub(crate) most_dps: f64,
    /// Time at each rate, s.
    pub(crate) dwell_s: f64,
    /// Time of the first row's start, s.
    pub(crate) start_s: f64,
    pub(crate) slow: Slow,
    /// Part of the largest rate at which the table turns.
    pub(crate) turns: fn(Row) -> f64,
    /// The log has no rate of the table here.
    pub(crate) is_blank: fn(Row) -> bool,
    /// An error of the gyro that its calibration did not have, °/h.
    pub(crate) error_dph: fn(Row) -> f64,
    /// Deviation of S from its nominal value, ppm.
    pub(crate) scale_ppm: f64,
    /// Deviation of S over temperature next to that of every gyro here: ppm at 70 °C, straight, zero at 15 °C.
    pub(crate) over_temperature_ppm: f64,
    /// S while cooling less S while heating, ppm.
    pub(crate) hysteresis_ppm: f64,
    /// S at positive rates less S at negative ones, ppm.
    pub(crate) asymmetry_ppm: f64,
    /// Largest distance of a rate from the straight line, ppm of the largest rate.
    pub(crate) nonlinearity_ppm: f64,
}

impl Table {
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            seed,
            most_dps: 10.0,
            dwell_s: 100.0,
            start_s: 0.0,
            slow: Slow::default(),
            turns: |row| row.part,
            is_blank: |_| false,
            error_dph: |_| 0.0,
            scale_ppm: 0.0,
            over_temperature_ppm: 0.0,
            hysteresis_ppm: 0.0,
            asymmetry_ppm: 0.0,
            nonlinearity_ppm: 0.0,
        }
    }

    /// How its logs are read.
    pub(crate) fn setup() -> Setup {
        Setup { arcsec_per_count: Some(QUANTUM_ARCSEC), input_rate_dph: Some(4.5.into()), ..Setup::default() }
    }

    /// ε over temperature of every gyro here, ppm.
    pub(crate) fn of_every_gyro_ppm(celsius: f64) -> f64 {
        let u = (celsius - 15.0) / 55.0;
        -18.0 * u + 9.0 * u * u
    }

    /// ε at a temperature and a part of the largest rate, ppm.
    fn epsilon_ppm(&self, celsius: f64, cooling: bool, part: f64) -> f64 {
        let half = if cooling { 0.5 } else { -0.5 };
        let side = if part == 0.0 { 0.0 } else { 0.5 * part.signum() };
        self.scale_ppm
            + Self::of_every_gyro_ppm(celsius)
            + self.over_temperature_ppm * ((celsius - 15.0) / 55.0)
            + self.hysteresis_ppm * half
            + self.asymmetry_ppm * side
    }

    /// The chamber row by row: temperature, and whether it cools or has cooled.
    fn chamber() -> impl Iterator<Item = (f64, bool)> {
        let rows = |seconds: f64| (seconds / ROW_S).round() as usize;
        let soak = move |celsius: f64, cooling: bool| std::iter::repeat_n((celsius, cooling), rows(SOAK_S));
        let first = soak(PLATEAUS_C[0], false);
        let others = PLATEAUS_C.windows(2).flat_map(move |pair| {
            let (from, to) = (pair[0], pair[1]);
            let count = rows(60.0 * (to - from).abs());
            let ramp = (1..=count).map(move |row| (from + (to - from) * row as f64 / count as f64, to < from));
            ramp.chain(soak(to, to < from))
        });
        first.chain(others)
    }

    /// The log of counts with the table's rate.
    pub(crate) fn log(&self) -> Rows<4> {
        let mut log = Rows::new(["time_s", "temperature_c", "counts", "reference_rate_dps"]);
        let mut dice = Dice::new(self.seed);
        let white = N_DEG_RT_H / (ROW_S / 3600.0).sqrt();
        let mut dice_of_slow = Dice::new(self.seed ^ 0xf11c);
        let mut slow = self.slow.begin(&mut dice_of_slow);
        let (mut angle, mut counted) = (dice.uniform() * QUANTUM_ARCSEC, 0.0);
        let mut before_c = PLATEAUS_C[0];
        for (row, (celsius, cooling)) in Self::chamber().enumerate() {
            let part = PARTS[(row as f64 * ROW_S / self.dwell_s) as usize % PARTS.len()];
            let cpm = 60.0 * (celsius - before_c) / ROW_S;
            before_c = celsius;
            let now = Row { celsius, cpm, hours: row as f64 * ROW_S / 3600.0, part };
            let part = (self.turns)(now);
            let most_dph = 3600.0 * self.most_dps;
            let bend = 1e-6 * self.nonlinearity_ppm * most_dph * (part.powi(3) - 0.85 * part) / 0.3;
            let turned = part * most_dph / (1.0 + 1e-6 * self.epsilon_ppm(celsius, cooling, part)) + bend;
            let u = (celsius - 15.0) / 55.0;
            let drift = 0.02 * u - 0.015 * u * u;
            let noise = white * dice.normal() + slow.next(ROW_S, &mut dice_of_slow);
            angle += (turned + 4.5 + 0.01 + drift + noise + (self.error_dph)(now)) * ROW_S;
            let total = (angle / QUANTUM_ARCSEC).floor();
            let time_s = self.start_s + (row + 1) as f64 * ROW_S;
            let dps = if (self.is_blank)(now) { f64::NAN } else { part * self.most_dps };
            log.push([time_s, to_decimals(celsius, 4), total - counted, dps]);
            counted = total;
        }
        log
    }
}
