//! A test of the gyro: chamber, loops, errors, counts, row by row.
//!
//! ```text
//! every second    chamber ─▶ block, anode ─▶ thermometers
//!                 loops ─▶ actuator, mode, light, current
//!                 bias = Σ sources           ε = −1e6·(mode/m) + sawtooth·actuator
//! every row       count level: angle = (input + bias)·dt + N·√dt·normal, counts = ⌊Σ angle/(S₀(1 + ε·1e-6))⌋, differenced
//!                 beat level:  that rate through [`crate::beat::Beat`], tick by tick, stripped
//! ```
//!
//! The input is Ω; without dither (or when it fails) the counter sees Adler's mean rate of it. With dither the walk
//! is that of [`crate::physics::dithered_arw_deg_rt_h`] beside the scenario's own. What is not modelled here and is at
//! the beat level: the beat itself, dynamic lock-in zones, the walk within a dither period.

mod errors;
mod path;

pub use errors::SOURCES;
pub use path::LoopsSecond;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::TICK_S;
use crate::beat::Beat;
use crate::fault::{Fault, FaultKind};
use crate::gyro::errors::{Causes, Sources};
use crate::gyro::path::Control;
use crate::noise::{SlowNoise, Stream, generator, normal};
use crate::physics::{ARCSEC_RT_S_PER_DEG_RT_H, adler_mean_dph, mode_number};
use crate::plant::Design;
use crate::scenario::tables::Fidelity;
use crate::scenario::{Problem, Scenario};
use crate::thermal::{Temperatures, Thermal};

/// Light below this part of the regulated is none.
const DARK: f64 = 0.05;

/// Everything about a second: the truth, and what the sensors show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Second {
    /// Its end, s.
    pub end_s: f64,
    /// Temperatures.
    pub temperatures: Temperatures,
    /// Readings of the thermometers at its end, °C.
    pub readings_c: Vec<f64>,
    /// Path length and intensity.
    pub loops: LoopsSecond,
    /// True rate, °/h: constant input and table.
    pub input_dph: f64,
    /// Rate of the table, °/s.
    pub table_dps: f64,
    /// Errors by source, °/h, as [`SOURCES`] names them.
    pub errors_dph: [f64; SOURCES.len()],
    /// Deviation of the scale factor S = S₀·(1 + ε·1e-6), ppm.
    pub scale_ppm: f64,
    /// The gyro says its counts are good.
    pub valid: bool,
}

/// A row of the log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRow {
    /// Its end as the log's clock has it, ns.
    pub time_ns: i64,
    /// Counts of the interval.
    pub counts: i64,
    /// The gyro says they are good.
    pub valid: bool,
    /// True noise of the interval, arcsec: not for the log.
    pub noise_arcsec: f64,
}

/// A simulated test under way.
#[derive(Clone, Debug)]
pub struct GyroRun {
    scenario: Scenario,
    design: Design,
    thermal: Thermal,
    control: Control,
    sources: Sources,
    slow: SlowNoise,
    walk_rng: ChaCha8Rng,
    fault_rng: ChaCha8Rng,
    /// Part of a count that has not been given yet.
    pending: f64,
    /// The log's clock, s; rows are stamped in whole microseconds of it.
    time_s: f64,
    time_ns: i64,
    seconds: u64,
    length_s: u64,
    block_c: f64,
    mode_at_start: Option<i64>,
    stuck: Vec<Option<f64>>,
    second: Second,
    /// Nothing gets through in this second, noise neither.
    silent: bool,
    /// Constants of the scenario that every row needs.
    arcsec_per_count: f64,
    walk_arcsec_rt_s: f64,
    lock_in_dph: f64,
    dithered: bool,
    modes: f64,
    /// The light itself, at the beat level.
    beat: Option<Box<Beat>>,
    /// Length of the table's legs together, s.
    table_s: f64,
}

impl GyroRun {
    /// A test of a scenario that was checked.
    ///
    /// # Errors
    /// What [`Scenario::check`] refuses.
    pub fn new(scenario: &Scenario, seed: u64) -> Result<Self, Problem> {
        scenario.check()?;
        let profile = scenario.profile()?;
        let design = Design::of(scenario)?;
        let length_s = profile.length_s() as u64;
        Ok(Self {
            thermal: Thermal::new(scenario, profile, generator(seed, Stream::Thermometer)),
            control: Control::new(scenario, &design, seed),
            sources: Sources::new(scenario),
            slow: SlowNoise::new(&scenario.noise, seed),
            walk_rng: generator(seed, Stream::Walk),
            fault_rng: generator(seed, Stream::Fault),
            pending: 0.0,
            time_s: 0.0,
            time_ns: 0,
            seconds: 0,
            length_s,
            block_c: scenario.chamber.start_c,
            mode_at_start: None,
            stuck: vec![None; scenario.thermometer.len()],
            second: Second::default(),
            silent: false,
            arcsec_per_count: scenario.arcsec_per_count(),
            // At the beat level the walk of the dither comes by itself.
            walk_arcsec_rt_s: ARCSEC_RT_S_PER_DEG_RT_H
                * match scenario.run.fidelity {
                    Fidelity::Count => scenario.arw_deg_rt_h(),
                    Fidelity::Beat => scenario.noise.arw_deg_rt_h,
                },
            lock_in_dph: scenario.lock_in_dph(),
            dithered: scenario.is_dithered(),
            beat: (scenario.run.fidelity == Fidelity::Beat).then(|| Box::new(Beat::new(scenario, seed))),
            modes: mode_number(scenario.geometry.perimeter_m, scenario.geometry.wavelength_um * 1e-6),
            table_s: scenario.input.table.iter().map(|leg| leg.for_s).sum(),
            design,
            scenario: scenario.clone(),
        })
    }

    /// Length of the test, s.
    pub fn length_s(&self) -> f64 {
        self.length_s as f64
    }

    /// The latest fault of a kind that has begun and lasts, and for how long it has.
    fn fault(&self, kind: FaultKind) -> Option<(&Fault, f64)> {
        self.fault_where(|fault| fault.kind == kind)
    }

    fn fault_where(&self, wanted: impl Fn(&Fault) -> bool) -> Option<(&Fault, f64)> {
        let end_s = self.seconds as f64;
        let lasting = self.scenario.fault.iter().filter(|fault| wanted(fault));
        lasting.filter_map(|fault| Some((fault, fault.since_s(end_s)?))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn active(&self, kind: FaultKind) -> bool {
        self.fault(kind).is_some()
    }

    /// Rate of the table at a time, °/s.
    fn table_dps(&self, time_s: f64) -> f64 {
        if self.table_s <= 0.0 {
            return 0.0;
        }
        let mut left = libm::fmod(time_s, self.table_s);
        for leg in &self.scenario.input.table {
            if left < leg.for_s {
                return leg.rate_dps;
            }
            left -= leg.for_s;
        }
        0.0
    }

    /// The next second into `self.second`.
    fn advance(&mut self) {
        self.seconds += 1;
        let end_s = self.seconds as f64;
        let mut readings_c = std::mem::take(&mut self.second.readings_c);
        let temperatures = self.thermal.second(end_s, &mut readings_c);
        self.break_thermometers(&mut readings_c);
        let before_c = self.block_c;
        self.block_c = 2.0 * temperatures.block_c - before_c;
        let loops = self.loops([before_c, self.block_c]);
        // The scale factor is nominal on the first mode that was held; while one is looked for, nothing is said of it.
        if loops.valid {
            self.mode_at_start.get_or_insert(loops.mode);
        }
        let modes_on = loops.mode - self.mode_at_start.unwrap_or(loops.mode);
        let actuator_waves = loops.actuator * self.scenario.path_length.waves_per_unit;
        // Off its peak the cavity pulls the beat here and there.
        let swing = |since: f64| 0.5 * libm::sin(std::f64::consts::TAU * since / 37.0);
        let unlocked_dph = self.fault(FaultKind::LockLoss).map_or(0.0, |(_, since)| swing(since));
        let causes = Causes {
            end_s,
            temperatures,
            actuator_waves,
            mode: loops.mode,
            current_ma: loops.current_ma,
            slow: self.slow.second(end_s),
            unlocked_dph,
        };
        let mut errors_dph = self.sources.second(&causes);
        let table_dps = self.table_dps(end_s - 0.5);
        let rate_dph = self.scenario.input_dph() + 3600.0 * table_dps + errors_dph.iter().sum::<f64>();
        let counted_dph = self.counted_of(rate_dph, &loops);
        // No light, or locked without dither.
        self.silent = counted_dph == 0.0 && rate_dph != 0.0;
        if let Some(uncounted) = errors_dph.last_mut() {
            *uncounted = counted_dph - rate_dph;
        }
        self.second = Second {
            end_s,
            temperatures,
            readings_c,
            loops,
            input_dph: self.scenario.input_dph() + 3600.0 * table_dps,
            table_dps,
            errors_dph,
            scale_ppm: -1e6 * modes_on as f64 / self.modes
                + self.scenario.scale_factor.actuator_ppm_per_wave * actuator_waves,
            valid: loops.valid,
        };
    }

    fn loops(&mut self, block_c: [f64; 2]) -> LoopsSecond {
        if let Some((fault, since)) = self.fault(FaultKind::ModeResetStorm) {
            let every = fault.strength().max(1.0);
            let (turn, before) = ((since / every) as i64, ((since - 1.0) / every) as i64);
            if turn != before
                && let Control::Ideal(ideal) = &mut self.control
            {
                ideal.storm(if turn % 2 == 0 { -1 } else { 1 });
            }
        }
        let kinds = [FaultKind::PumpFailure, FaultKind::LockLoss];
        let fault = kinds.into_iter().find_map(|kind| self.fault(kind).map(|(_, since)| (kind, since)));
        self.control.second(&self.design, block_c, fault)
    }

    fn break_thermometers(&mut self, readings_c: &mut [f64]) {
        for (index, reading) in readings_c.iter_mut().enumerate() {
            let mine = |kind| {
                let found = self.fault_where(|fault| fault.kind == kind && fault.sensor as usize == index);
                found.map(|(fault, since)| (fault.strength(), since))
            };
            let (stuck, drifting) = (mine(FaultKind::StuckThermometer), mine(FaultKind::DriftingThermometer));
            if stuck.is_some() {
                *reading = *self.stuck[index].get_or_insert(*reading);
            } else {
                self.stuck[index] = None;
            }
            if let Some((c_per_h, since)) = drifting {
                let lsb = self.scenario.thermometer[index].lsb_c;
                let drifted = *reading + c_per_h * since / 3600.0;
                *reading = if lsb > 0.0 { libm::round(drifted / lsb) * lsb } else { drifted };
            }
        }
    }

    /// Input and all errors, °/h: what the counter sees over this second. At the beat level what lock-in leaves of it
    /// is for the beat to find.
    fn rate_dph(&self) -> f64 {
        self.second.input_dph + self.second.errors_dph.iter().sum::<f64>()
    }

    /// Mean rate that is counted of a rate: nothing without light, Adler's without dither.
    fn counted_of(&self, rate_dph: f64, loops: &LoopsSecond) -> f64 {
        if loops.light < DARK {
            0.0
        } else if self.undithered() && self.beat.is_none() {
            adler_mean_dph(rate_dph, self.lock_in_dph)
        } else {
            rate_dph
        }
    }

    fn undithered(&self) -> bool {
        !self.dithered || self.active(FaultKind::DitherFailure)
    }

    /// Runs to the end, row by row.
    ///
    /// # Errors
    /// What `each` says.
    pub fn each_row<E>(&mut self, mut each: impl FnMut(&LogRow, &Second) -> Result<(), E>) -> Result<(), E> {
        if self.scenario.run.interval_s >= 1.0 {
            let seconds = libm::round(self.scenario.run.interval_s) as u64;
            while self.seconds + seconds <= self.length_s {
                let (row, mean) = self.long_row(seconds);
                if let Some(row) = row {
                    each(&row, &mean)?;
                }
            }
        } else {
            let rows = libm::round(1.0 / self.scenario.run.interval_s) as u32;
            while self.seconds < self.length_s {
                self.advance();
                self.short_rows(rows, &mut each)?;
            }
        }
        Ok(())
    }

    /// A row of whole seconds, and the mean of their truth.
    fn long_row(&mut self, seconds: u64) -> (Option<LogRow>, Second) {
        let (mut angle, mut length_s, mut valid, mut noise_arcsec) = (0.0, 0.0, true, 0.0);
        let mut mean = Second::default();
        for _ in 0..seconds {
            self.advance();
            let dt = self.clock(1.0);
            length_s += dt;
            mean.add(&self.second);
            if self.beat.is_some() {
                let (counts, noise) = self.beats(10_000, dt);
                angle += counts as f64;
                noise_arcsec += noise;
            } else {
                let noise = self.noise(libm::sqrt(dt));
                noise_arcsec += noise;
                angle += (self.rate_dph() * dt + noise) / self.scale();
            }
            // After the beat, which may have found its counts not to be good.
            valid &= self.second.valid;
        }
        mean.finish(seconds, &self.second, valid);
        let counts = self.count(angle, length_s);
        let row = LogRow { time_ns: self.time_ns, counts, valid, noise_arcsec };
        ((!self.dropped()).then_some(row), mean)
    }

    /// The rows of a second.
    fn short_rows<E>(&mut self, rows: u32, each: &mut impl FnMut(&LogRow, &Second) -> Result<(), E>) -> Result<(), E> {
        let nominal_s = 1.0 / f64::from(rows);
        let scale = self.scale();
        let rate = self.rate_dph();
        let broken = !self.scenario.fault.is_empty();
        let root = libm::sqrt(nominal_s);
        let step = rate * nominal_s / scale;
        let start_ns = self.time_ns;
        for row in 1..=rows {
            let (counts, noise_arcsec) = if self.beat.is_some() {
                let dt = self.clock(nominal_s);
                let (counts, noise_arcsec) = self.beats(10_000 / rows, dt);
                (self.count(counts as f64, dt), noise_arcsec)
            } else {
                let noise_arcsec = self.noise(root);
                let counts = if broken || self.has_clock() {
                    let dt = self.clock(nominal_s);
                    self.count(rate * dt / scale + noise_arcsec / scale, dt)
                } else {
                    self.time_ns = start_ns + (1_000_000_000 * i64::from(row)) / i64::from(rows);
                    self.time_s = self.time_ns as f64 * 1e-9;
                    self.whole(step + noise_arcsec / scale)
                };
                (counts, noise_arcsec)
            };
            if !(broken && self.dropped()) {
                let out = LogRow { time_ns: self.time_ns, counts, valid: self.second.valid, noise_arcsec };
                each(&out, &self.second)?;
            }
        }
        Ok(())
    }

    /// So many ticks of the light that take a time, in stripped counts; and the noise put in, arcsec.
    fn beats(&mut self, ticks: u32, length_s: f64) -> (i64, f64) {
        let (stopped, dark) = (self.active(FaultKind::DitherFailure), self.second.loops.light < DARK);
        let from_c = self.second.temperatures.block_c - crate::plant::REFERENCE_C;
        let stretched = length_s / (f64::from(ticks) * TICK_S);
        let per_scale = stretched / (1.0 + self.second.scale_ppm * 1e-6);
        let rate_dph = self.rate_dph() * per_scale;
        let (mut counts, mut noise_arcsec) = (0, 0.0);
        for tick in 0..ticks {
            let noise = self.noise(libm::sqrt(TICK_S));
            noise_arcsec += noise;
            let Some(beat) = &mut self.beat else { break };
            if tick == 0 {
                beat.tune(from_c, stopped);
            }
            let out = beat.tick(rate_dph + noise / TICK_S);
            counts += if dark { 0 } else { out.stripped };
            self.second.valid &= !out.without_zero;
        }
        (counts, noise_arcsec)
    }

    fn scale(&self) -> f64 {
        self.arcsec_per_count * (1.0 + self.second.scale_ppm * 1e-6)
    }

    fn noise(&mut self, root_s: f64) -> f64 {
        let noise =
            if self.walk_arcsec_rt_s > 0.0 { self.walk_arcsec_rt_s * root_s * normal(&mut self.walk_rng) } else { 0.0 };
        if self.silent { 0.0 } else { noise }
    }

    fn has_clock(&self) -> bool {
        let e = &self.scenario.electronics;
        e.clock_ppm != 0.0 || e.clock_ppm_per_c != 0.0 || e.counter_bits > 0.0
    }

    /// True length of a nominal interval; moves the log's own clock.
    fn clock(&mut self, nominal_s: f64) -> f64 {
        let e = &self.scenario.electronics;
        let from = self.second.temperatures.block_c - crate::plant::REFERENCE_C;
        let fast = (e.clock_ppm + e.clock_ppm_per_c * from) * 1e-6;
        let slow = self
            .fault(FaultKind::ClockDrift)
            .map_or(0.0, |(fault, since)| fault.strength() * 1e-6 * since / fault.for_s.max(1.0));
        // A fault of the clock shows against that of the log; an oscillator that is always off is also the log's.
        self.time_s += nominal_s * (1.0 + slow);
        self.time_ns = libm::round(self.time_s * 1e6) as i64 * 1000;
        nominal_s * (1.0 + slow) / (1.0 + fast)
    }

    /// Whole counts of an angle in counts; the rest waits.
    #[inline]
    fn whole(&mut self, counts: f64) -> i64 {
        self.pending += counts;
        let whole = libm::floor(self.pending);
        self.pending -= whole;
        whole as i64
    }

    /// The same, with a counter that may stop at its ends: what is beyond them is lost.
    fn count(&mut self, counts: f64, length_s: f64) -> i64 {
        let whole = self.whole(counts);
        let bits = self.scenario.electronics.counter_bits;
        let mut most = if bits >= 1.0 { (libm::exp2(bits - 1.0) - 1.0) as i64 } else { i64::MAX };
        if let Some((fault, _)) = self.fault(FaultKind::SaturatedCounter) {
            let mean = (self.second.input_dph * length_s / self.arcsec_per_count).abs();
            most = most.min((fault.strength() * mean) as i64);
        }
        whole.clamp(-most, most)
    }

    fn dropped(&mut self) -> bool {
        let Some(part) = self.fault(FaultKind::DroppedSamples).map(|(fault, _)| fault.strength()) else {
            return false;
        };
        // A uniform value in [0, 1) from the upper 53 bits.
        (self.fault_rng.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64) < part
    }
}

impl Second {
    fn add(&mut self, second: &Self) {
        self.temperatures.block_c += second.temperatures.block_c;
        self.temperatures.block_cpm += second.temperatures.block_cpm;
        self.input_dph += second.input_dph;
        self.table_dps += second.table_dps;
        self.scale_ppm += second.scale_ppm;
        self.errors_dph.iter_mut().zip(second.errors_dph).for_each(|(sum, e)| *sum += e);
    }

    /// Means of what was added; the rest is as at the end.
    fn finish(&mut self, seconds: u64, last: &Self, valid: bool) {
        let part = 1.0 / seconds as f64;
        self.input_dph *= part;
        self.table_dps *= part;
        self.scale_ppm *= part;
        self.errors_dph.iter_mut().for_each(|sum| *sum *= part);
        let (block_c, block_cpm) = (self.temperatures.block_c * part, self.temperatures.block_cpm * part);
        self.temperatures = Temperatures { block_c, block_cpm, ..last.temperatures };
        self.readings_c.clone_from(&last.readings_c);
        self.loops = last.loops;
        self.end_s = last.end_s;
        self.valid = valid;
    }
}
