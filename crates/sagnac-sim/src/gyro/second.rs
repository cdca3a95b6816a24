//! The truth of one second: temperatures, loops, errors and the counted part of the rate.

use rand_chacha::ChaCha8Rng;

use crate::beat::BeatState;
use crate::gyro::bias::{BiasInputs, BiasState, ERROR_SOURCES};
use crate::gyro::build::Gyro;
use crate::gyro::counter::CounterState;
use crate::gyro::loops::{LoopSecond, LoopsState};
use crate::noise::SlowNoiseState;
use crate::physics::adler_mean_dph;
use crate::random::{Stream, generator};
use crate::scenario::FaultKind;
use crate::thermal::{Temperatures, ThermalState};

/// Light below this fraction of the regulated light gives no counts.
const DARK: f64 = 0.05;

/// Truth and sensor readings of one second.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Second {
    /// Its end, s.
    pub end_s: f64,
    /// Temperatures.
    pub temperatures: Temperatures,
    /// Readings of the thermometers at its end, °C.
    pub readings_c: Vec<f64>,
    /// Path length and intensity.
    pub loops: LoopSecond,
    /// True rate, °/h: constant input and rate table.
    pub input_dph: f64,
    /// Rate of the table, °/s.
    pub table_dps: f64,
    /// Errors, °/h, in the order of [`ERROR_SOURCES`].
    pub errors_dph: [f64; ERROR_SOURCES.len()],
    /// Deviation of the scale factor, S = S₀·(1 + ε·1e-6), ppm.
    pub scale_ppm: f64,
    /// The gyro reports valid counts.
    pub valid: bool,
}

/// Memory of a run.
#[derive(Clone, Debug)]
pub(super) struct GyroState {
    thermal: ThermalState,
    loops: LoopsState,
    bias: BiasState,
    slow: SlowNoiseState,
    pub(super) beat: Option<Box<BeatState>>,
    pub(super) counter: CounterState,
    pub(super) walk_rng: ChaCha8Rng,
    pub(super) fault_rng: ChaCha8Rng,
    /// Seconds so far.
    pub(super) seconds: u64,
    /// Block at the end of the second, °C.
    block_c: f64,
    /// The first mode that was held; there the scale factor is nominal.
    first_mode: Option<i64>,
    /// Readings of stuck thermometers, °C.
    stuck_c: Vec<Option<f64>>,
    /// No light, or locked: nothing is counted in this second, not even noise.
    pub(super) silent: bool,
    pub(super) second: Second,
}

impl Gyro {
    pub(super) fn start_state(&self, seed: u64) -> GyroState {
        GyroState {
            thermal: self.thermal.start(seed),
            loops: self.loops.start(seed),
            bias: self.bias.start(),
            slow: self.slow.start(seed),
            beat: self.beat.as_ref().map(|beat| Box::new(beat.start(seed))),
            counter: CounterState::default(),
            walk_rng: generator(seed, Stream::Walk),
            fault_rng: generator(seed, Stream::Fault),
            seconds: 0,
            block_c: self.start_c,
            first_mode: None,
            stuck_c: vec![None; self.thermometers],
            silent: false,
            second: Second::default(),
        }
    }

    /// Advances by a second; its truth goes to `state.second`.
    pub(super) fn advance(&self, state: &mut GyroState) {
        state.seconds += 1;
        let end_s = state.seconds as f64;
        let mut readings_c = std::mem::take(&mut state.second.readings_c);
        let temperatures = self.thermal.second(&mut state.thermal, end_s, &mut readings_c);
        self.break_thermometers(&mut state.stuck_c, end_s, &mut readings_c);
        let before_c = state.block_c;
        state.block_c = 2.0 * temperatures.block_c - before_c;
        let loops = self.advance_loops(&mut state.loops, end_s, [before_c, state.block_c]);
        // While a mode is searched for, the deviation of the scale factor is reported as 0.
        if loops.valid {
            state.first_mode.get_or_insert(loops.mode);
        }
        let modes_on = loops.mode - state.first_mode.unwrap_or(loops.mode);
        let actuator_waves = loops.actuator * self.waves_per_unit;
        let inputs = BiasInputs {
            end_s,
            temperatures,
            actuator_waves,
            mode: loops.mode,
            current_ma: loops.current_ma,
            slow: self.slow.second(&mut state.slow, end_s),
            unlocked_dph: self.unlocked_dph(end_s),
        };
        let mut errors_dph = self.bias.second(&mut state.bias, &inputs);
        let table_dps = self.input.table_dps(end_s - 0.5);
        let input_dph = self.input.rate_dph(table_dps);
        let rate_dph = input_dph + errors_dph.iter().sum::<f64>();
        let counted_dph = self.counted_dph(rate_dph, end_s, &loops);
        state.silent = counted_dph == 0.0 && rate_dph != 0.0;
        if let Some(uncounted) = errors_dph.last_mut() {
            *uncounted = counted_dph - rate_dph;
        }
        let scale_ppm = -1e6 * modes_on as f64 / self.mode_number + self.actuator_ppm_per_wave * actuator_waves;
        let valid = loops.valid;
        state.second =
            Second { end_s, temperatures, readings_c, loops, input_dph, table_dps, errors_dph, scale_ppm, valid };
    }

    /// Loops and the faults that act on them.
    fn advance_loops(&self, state: &mut LoopsState, end_s: f64, block_c: [f64; 2]) -> LoopSecond {
        if let Some(storm) = self.faults.active(FaultKind::ModeResetStorm, end_s) {
            let every_s = storm.size.max(1.0);
            let (reset, before) = ((storm.since_s / every_s) as i64, ((storm.since_s - 1.0) / every_s) as i64);
            if reset != before {
                self.loops.force_reset(state, if reset % 2 == 0 { -1 } else { 1 });
            }
        }
        let kinds = [FaultKind::PumpFailure, FaultKind::LockLoss];
        let active = |kind| self.faults.active(kind, end_s).map(|fault| (kind, fault.since_s));
        self.loops.second(state, block_c, kinds.into_iter().find_map(active))
    }

    /// Error of a cavity off its peak: the beat frequency swings.
    fn unlocked_dph(&self, end_s: f64) -> f64 {
        let swing = |since_s: f64| 0.5 * libm::sin(std::f64::consts::TAU * since_s / 37.0);
        self.faults.active(FaultKind::LockLoss, end_s).map_or(0.0, |fault| swing(fault.since_s))
    }

    fn break_thermometers(&self, stuck_c: &mut [Option<f64>], end_s: f64, readings_c: &mut [f64]) {
        for (index, (reading_c, stuck_c)) in readings_c.iter_mut().zip(stuck_c).enumerate() {
            if self.faults.active_on(index, FaultKind::StuckThermometer, end_s).is_some() {
                *reading_c = *stuck_c.get_or_insert(*reading_c);
            } else {
                *stuck_c = None;
            }
            if let Some(drift) = self.faults.active_on(index, FaultKind::DriftingThermometer, end_s) {
                let c_per_h = drift.size;
                *reading_c = self.thermal.round(index, *reading_c + c_per_h * drift.since_s / 3600.0);
            }
        }
    }

    /// The counted part of a rate: nothing without light, Adler's mean rate without dither. At the beat level lock-in is
    /// part of the beat.
    fn counted_dph(&self, rate_dph: f64, end_s: f64, loops: &LoopSecond) -> f64 {
        let undithered = !self.dithered || self.faults.active(FaultKind::DitherFailure, end_s).is_some();
        if loops.light < DARK {
            0.0
        } else if undithered && self.beat.is_none() {
            adler_mean_dph(rate_dph, self.lock_in_dph)
        } else {
            rate_dph
        }
    }
}

impl Second {
    /// Whether there is too little light to count.
    pub(super) fn is_dark(&self) -> bool {
        self.loops.light < DARK
    }

    /// Input and all errors, °/h: the rate that the counter sees.
    pub(super) fn rate_dph(&self) -> f64 {
        self.input_dph + self.errors_dph.iter().sum::<f64>()
    }

    /// Adds the quantities that are averaged over a row.
    pub(super) fn add(&mut self, second: &Self) {
        self.temperatures.block_c += second.temperatures.block_c;
        self.temperatures.block_cpm += second.temperatures.block_cpm;
        self.input_dph += second.input_dph;
        self.table_dps += second.table_dps;
        self.scale_ppm += second.scale_ppm;
        self.errors_dph.iter_mut().zip(second.errors_dph).for_each(|(sum, e)| *sum += e);
    }

    /// Makes means of the sums; everything else is as in the last second.
    pub(super) fn finish(&mut self, seconds: u64, last: &Self, valid: bool) {
        let weight = 1.0 / seconds as f64;
        self.input_dph *= weight;
        self.table_dps *= weight;
        self.scale_ppm *= weight;
        self.errors_dph.iter_mut().for_each(|sum| *sum *= weight);
        let (block_c, block_cpm) = (self.temperatures.block_c * weight, self.temperatures.block_cpm * weight);
        self.temperatures = Temperatures { block_c, block_cpm, ..last.temperatures };
        self.readings_c.clone_from(&last.readings_c);
        self.loops = last.loops;
        self.end_s = last.end_s;
        self.valid = valid;
    }
}
