//! Rows of the log: the seconds of the truth, counted.
//!
//! A row is a number of whole seconds, or a fraction of one second. The rate is constant within a second; noise is drawn
//! for each row, or for each tick at the beat level.

use rand_chacha::ChaCha8Rng;

use crate::gyro::build::Gyro;
use crate::gyro::second::{GyroState, Second};
use crate::random::{normal, uniform};
use crate::scenario::{FaultKind, REFERENCE_C, TICK_S};

/// Ticks in a second.
const TICKS_PER_S: u32 = 10_000;

/// A row of the log.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LogRow {
    /// End of its interval by the log's clock, ns.
    pub time_ns: i64,
    /// Counts of the interval.
    pub counts: i64,
    /// The gyro reports valid counts.
    pub valid: bool,
    /// True noise of the interval, arcsec. Part of the truth, not of the log.
    pub noise_arcsec: f64,
}

/// A simulated test in progress.
#[derive(Clone, Debug)]
pub struct GyroRun {
    gyro: Gyro,
    state: GyroState,
}

impl Gyro {
    /// Starts a run of the test.
    pub fn start(&self, seed: u64) -> GyroRun {
        GyroRun { gyro: self.clone(), state: self.start_state(seed) }
    }
}

impl GyroRun {
    /// Length of the test, s.
    pub fn length_s(&self) -> f64 {
        self.gyro.length_s()
    }

    /// Runs to the end of the test, row by row. Each row comes with the truth of its second, or with the mean over its
    /// seconds.
    ///
    /// # Errors
    /// The first error of `each`, which also ends the run.
    pub fn each_row<E>(&mut self, mut each: impl FnMut(&LogRow, &Second) -> Result<(), E>) -> Result<(), E> {
        let (gyro, state) = (&self.gyro, &mut self.state);
        if gyro.interval_s >= 1.0 {
            let seconds = libm::round(gyro.interval_s) as u64;
            while state.seconds + seconds <= gyro.length_s {
                let (row, mean) = gyro.long_row(state, seconds);
                if let Some(row) = row {
                    each(&row, &mean)?;
                }
            }
        } else {
            let rows = libm::round(1.0 / gyro.interval_s) as u32;
            while state.seconds < gyro.length_s {
                gyro.advance(state);
                gyro.short_rows(state, rows, &mut each)?;
            }
        }
        Ok(())
    }
}

impl Gyro {
    /// A row of whole seconds, and the mean of their truth. `None` for a dropped row.
    fn long_row(&self, state: &mut GyroState, seconds: u64) -> (Option<LogRow>, Second) {
        let (mut angle, mut length_s, mut valid, mut noise_arcsec) = (0.0, 0.0, true, 0.0);
        let mut mean = Second::default();
        for _ in 0..seconds {
            self.advance(state);
            let dt = self.advance_clock(state, 1.0);
            length_s += dt;
            mean.add(&state.second);
            if self.beat.is_some() {
                let (counts, noise) = self.beat_ticks(state, TICKS_PER_S, dt);
                angle += counts as f64;
                noise_arcsec += noise;
            } else {
                let noise = self.white_noise(&mut state.walk_rng, state.silent, libm::sqrt(dt));
                noise_arcsec += noise;
                angle += (state.second.rate_dph() * dt + noise) / self.arcsec_per_count(&state.second);
            }
            // After the beat, which may have declared its counts invalid.
            valid &= state.second.valid;
        }
        mean.finish(seconds, &state.second, valid);
        let counts = self.count(state, angle, length_s);
        let row = LogRow { time_ns: state.counter.time_ns, counts, valid, noise_arcsec };
        ((!self.is_dropped(state)).then_some(row), mean)
    }

    /// The rows of one second.
    fn short_rows<E>(
        &self,
        state: &mut GyroState,
        rows: u32,
        each: &mut impl FnMut(&LogRow, &Second) -> Result<(), E>,
    ) -> Result<(), E> {
        let nominal_s = 1.0 / f64::from(rows);
        let scale = self.arcsec_per_count(&state.second);
        let rate = state.second.rate_dph();
        let has_faults = !self.faults.is_empty();
        let root = libm::sqrt(nominal_s);
        let step = rate * nominal_s / scale;
        let start_ns = state.counter.time_ns;
        for row in 1..=rows {
            let (counts, noise_arcsec) = if self.beat.is_some() {
                let dt = self.advance_clock(state, nominal_s);
                let (counts, noise_arcsec) = self.beat_ticks(state, TICKS_PER_S / rows, dt);
                (self.count(state, counts as f64, dt), noise_arcsec)
            } else {
                let noise_arcsec = self.white_noise(&mut state.walk_rng, state.silent, root);
                let counts = if has_faults || !self.counter.is_exact() {
                    let dt = self.advance_clock(state, nominal_s);
                    self.count(state, rate * dt / scale + noise_arcsec / scale, dt)
                } else {
                    state.counter.stamp(start_ns + (1_000_000_000 * i64::from(row)) / i64::from(rows));
                    state.counter.whole(step + noise_arcsec / scale)
                };
                (counts, noise_arcsec)
            };
            if !(has_faults && self.is_dropped(state)) {
                let valid = state.second.valid;
                let out = LogRow { time_ns: state.counter.time_ns, counts, valid, noise_arcsec };
                each(&out, &state.second)?;
            }
        }
        Ok(())
    }

    /// A number of ticks at the beat level, which take `length_s`: stripped counts and the noise added, arcsec.
    fn beat_ticks(&self, state: &mut GyroState, ticks: u32, length_s: f64) -> (i64, f64) {
        let stopped = self.faults.active(FaultKind::DitherFailure, state.seconds as f64).is_some();
        let dark = state.second.is_dark();
        let from_reference_c = state.second.temperatures.block_c - REFERENCE_C;
        let stretched = length_s / (f64::from(ticks) * TICK_S);
        let per_scale = stretched / (1.0 + state.second.scale_ppm * 1e-6);
        let rate_dph = state.second.rate_dph() * per_scale;
        let (mut counts, mut noise_arcsec) = (0, 0.0);
        let (Some(beat), Some(beat_state)) = (&self.beat, &mut state.beat) else { return (counts, noise_arcsec) };
        beat.tune(beat_state, from_reference_c, stopped);
        for _ in 0..ticks {
            let noise = self.white_noise(&mut state.walk_rng, state.silent, libm::sqrt(TICK_S));
            noise_arcsec += noise;
            let out = beat.tick(beat_state, rate_dph + noise / TICK_S);
            counts += if dark { 0 } else { out.stripped };
            state.second.valid &= !out.without_zero;
        }
        (counts, noise_arcsec)
    }

    /// Scale factor of a second.
    fn arcsec_per_count(&self, second: &Second) -> f64 {
        self.arcsec_per_count * (1.0 + second.scale_ppm * 1e-6)
    }

    /// Angle of white noise over an interval whose root is given, arcsec.
    fn white_noise(&self, rng: &mut ChaCha8Rng, silent: bool, root_s: f64) -> f64 {
        let noise = if self.walk_arcsec_rt_s > 0.0 { self.walk_arcsec_rt_s * root_s * normal(rng) } else { 0.0 };
        if silent { 0.0 } else { noise }
    }

    /// Advances the log's clock by a nominal interval; its true length.
    fn advance_clock(&self, state: &mut GyroState, nominal_s: f64) -> f64 {
        let fault = self.faults.active(FaultKind::ClockDrift, state.seconds as f64);
        let drift = fault.map_or(0.0, |fault| fault.size * 1e-6 * fault.since_s / fault.duration_s.max(1.0));
        self.counter.advance(&mut state.counter, nominal_s, state.second.temperatures.block_c, drift)
    }

    /// Counts of a row of a length, as its counter reports them.
    fn count(&self, state: &mut GyroState, counts: f64, length_s: f64) -> i64 {
        let fault = self.faults.active(FaultKind::SaturatedCounter, state.seconds as f64);
        let limit = fault.map_or(i64::MAX, |fault| {
            let mean = (state.second.input_dph * length_s / self.arcsec_per_count).abs();
            (fault.size * mean) as i64
        });
        self.counter.count(&mut state.counter, counts, limit)
    }

    fn is_dropped(&self, state: &mut GyroState) -> bool {
        let fault = self.faults.active(FaultKind::DroppedSamples, state.seconds as f64);
        fault.is_some_and(|fault| uniform(&mut state.fault_rng) < fault.size)
    }
}
