//! LOCKED needs evidence: hundreds of random cavities, mirrors and photodiodes, with faults that leave the error small.
//!
//! The cavity here is the test's own: I = gain of a Gaussian line, periodic in the path, with noise and quantization.

use sagnac_loops::{DesignError, LoopGoal, PathLengthConfig, PathLengthPhase, PathLengthState, PathLengthStatus};

/// What is wrong with the loop's hardware.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    /// The photodiode reads the same code whatever the light.
    Stuck,
    /// Its amplifier drifts, without an answer to the light.
    StuckAndNoisy,
    /// The mirror answers the modulation in counterphase: the modulation is above its resonance.
    Counterphase,
    /// The light of the search was that of a flash.
    Flash,
    /// Once it is locked, a spike of up to a tenth of the light, in one tick of every eighth period.
    Spikes,
}

/// A small generator: the numbers of Park and Miller.
struct Dice(u64);

impl Dice {
    fn unit(&mut self) -> f64 {
        self.0 = self.0 * 48_271 % 2_147_483_647;
        self.0 as f64 / 2_147_483_647.0
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Sum of twelve uniform numbers: σ = 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

struct Gyro {
    config: PathLengthConfig,
    /// Rest position of the path, wavelengths from a peak.
    start_waves: f64,
    dice: Dice,
}

impl Gyro {
    fn random(seed: u64, searches: bool) -> Self {
        let mut dice = Dice(1 + seed * 7919);
        let half_period = dice.within(2.0, 16.0).floor();
        let period_s = 2.0 * half_period * 1e-4;
        let (modulation_waves, curvature) = (dice.within(0.01, 0.03), dice.within(3.0, 12.0));
        let config = PathLengthConfig {
            tick_s: 1e-4,
            modulation_hz: 1.0 / period_s,
            modulation_waves,
            separate_modulator: false,
            answer_ticks: dice.within(0.0, 1.99) as u8,
            range: [-150.0, 150.0],
            waves_per_unit: 0.012,
            codes_per_unit: 870.0,
            lag_s: [0.0; 2],
            peak_code: dice.within(5e4, 4e6),
            curvature,
            noise: dice.within(0.0, 3e-4),
            goal: LoopGoal { bandwidth_hz: 0.02 / period_s, phase_margin_deg: 50.0 },
            reset_margin_waves: 0.2,
            reset_s: 0.01,
            settle_s: 0.02,
            sweep_s: if searches { 0.3 } else { 0.0 },
            lock_waves: 0.005,
        };
        let start_waves = dice.within(-0.5, 0.5);
        Self { config, start_waves, dice }
    }

    /// Runs some seconds; the share of ticks with status zero, and the state at the end.
    fn run(&mut self, fault: Fault, seconds: f64) -> (f64, PathLengthState) {
        let loops = self.config.build().unwrap().integers;
        let mut state = loops.start();
        let waves_per_code = self.config.waves_per_unit / self.config.codes_per_unit;
        let (mut held, mut clean) = (state.held(), 0_u32);
        let delay = usize::from(self.config.answer_ticks);
        let mut answers = vec![0_i32; delay + 1];
        let stuck = self.dice.within(0.2, 1.0) * self.config.peak_code;
        let ticks = (seconds / 1e-4) as usize;
        for tick in 0..ticks {
            let modulation =
                f64::from(answers[tick % (delay + 1)]) * if fault == Fault::Counterphase { -1.0 } else { 1.0 };
            let x = self.start_waves + (f64::from(held) + modulation) * waves_per_code;
            let off = x - x.round();
            // 1 at the peak with the curvature of the design; a tenth of the light between two peaks.
            let shape = 0.1 + 0.9 * (-self.config.curvature / 0.9 * off * off).exp();
            let searching = matches!(state.phase(), PathLengthPhase::Sweeping { .. });
            let light = match fault {
                Fault::Stuck => stuck / self.config.peak_code,
                Fault::StuckAndNoisy => 0.7 + 0.1 * (tick as f64 * 1e-5).sin(),
                Fault::Flash if searching && off.abs() > 0.45 => 8.0,
                _ => shape,
            };
            let noise = if fault == Fault::Stuck { 0.0 } else { self.config.noise * self.dice.normal() };
            let period = loops.ticks_per_period() as usize;
            let locked = tick > ticks / 2;
            let hit = fault == Fault::Spikes && locked && tick % (8 * period) == (tick / (8 * period)) % period;
            let noise = noise + if hit { self.dice.within(-0.1, 0.1) } else { 0.0 };
            let code = ((light + noise) * self.config.peak_code).round() as i32;
            let out = loops.tick(&mut state, code);
            held = out.actuator;
            answers[tick % (delay + 1)] = out.modulation;
            if !out.status.contains(PathLengthStatus::INVALID) {
                clean += 1;
            }
        }
        (f64::from(clean) / ticks as f64, state)
    }
}

/// A sound gyro locks, with a search and without one, and stays locked.
#[test]
fn a_sound_loop_locks() {
    for seed in 0..200 {
        let mut gyro = Gyro::random(seed, seed % 2 == 0);
        let (clean, state) = gyro.run(Fault::None, 4.0);
        assert!(matches!(state.phase(), PathLengthPhase::Locked { .. }), "{seed}: {:?}", state.phase());
        assert!(state.status() == PathLengthStatus::OK && clean > 0.5, "{seed}: {:?}, {clean}", state.status());
    }
}

/// Spikes that are a hundred times a peak's harmonic do not end a lock.
#[test]
fn spikes_do_not_end_a_lock() {
    for seed in 0..200 {
        let (clean, state) = Gyro::random(seed, seed % 2 == 0).run(Fault::Spikes, 6.0);
        assert!(matches!(state.phase(), PathLengthPhase::Locked { .. }), "{seed}: {:?}", state.phase());
        assert!(state.status() == PathLengthStatus::OK && clean > 0.5, "{seed}: {:?}, {clean}", state.status());
    }
}

/// A photodiode that does not answer, and a mirror that answers in counterphase: never a tick of status zero, and the
/// reason is named.
#[test]
fn a_fault_that_leaves_the_error_small_never_reads_locked() {
    for fault in [Fault::Stuck, Fault::StuckAndNoisy, Fault::Counterphase] {
        let mut named = 0;
        for seed in 0..150 {
            let (clean, state) = Gyro::random(seed, seed % 2 == 0).run(fault, 4.0);
            assert_eq!(clean, 0.0, "{fault:?}, {seed}");
            named += u32::from(state.status().contains(PathLengthStatus::NO_PEAK));
        }
        assert!(named > 140, "{fault:?}: named in {named} of 150");
    }
}

/// Exactly on the trough the error is zero to the bit. A loop without a search leaves it and locks on a peak.
#[test]
fn a_start_on_the_trough_is_left() {
    for seed in 0..150 {
        let mut gyro = Gyro::random(seed, false);
        gyro.config.noise = 0.0;
        gyro.start_waves = 0.5;
        let (_, state) = gyro.run(Fault::None, 4.0);
        assert!(matches!(state.phase(), PathLengthPhase::Locked { .. }), "{seed}: {:?}", state.phase());
        let x = 0.5 + f64::from(state.held()) * gyro.config.waves_per_unit / gyro.config.codes_per_unit;
        assert!((x - x.round()).abs() < 0.02, "{seed}: at {x}");
    }
}

/// Light that the search saw and the settled path does not repeat: not locked.
#[test]
fn a_flash_in_the_search_is_not_a_peak() {
    for seed in 0..100 {
        let (clean, state) = Gyro::random(seed, true).run(Fault::Flash, 3.0);
        assert_eq!(clean, 0.0, "{seed}");
        assert!(state.status().contains(PathLengthStatus::NO_PEAK), "{seed}");
    }
}

/// A photodiode that gets stuck at the very code of the peak, after the lock: reported within two loss times.
#[test]
fn a_photodiode_that_gets_stuck_is_found_out() {
    for seed in 0..100 {
        let mut gyro = Gyro::random(seed, true);
        let design = gyro.config.build().unwrap();
        let (_, mut state) = gyro.run(Fault::None, 4.0);
        let ticks = i64::from(design.integers.ticks_per_period());
        let fields = design.integers.fields();
        let lost_periods = fields.iter().find(|(name, _)| *name == "lost_periods").unwrap().1;
        let code = gyro.config.peak_code as i32;
        let found = (0..).find(|_| {
            let status = design.integers.tick(&mut state, code).status;
            status.contains(PathLengthStatus::INVALID | PathLengthStatus::NO_PEAK | PathLengthStatus::WAS_LOST)
        });
        let found: i64 = found.unwrap();
        assert!(found <= 2 * lost_periods * ticks, "{seed}: after {found} ticks of {lost_periods} periods");
    }
}

/// Crosstalk of the modulation: a second harmonic in the photodiode's code, so much of the light of the peak, with this phase. Whether the loop
/// reads LOCKED on a stuck photodiode, and whether the check with the lamp off finds the crosstalk.
fn with_crosstalk(gyro: &mut Gyro, share: f64, phase: f64) -> (bool, bool) {
    let loops = gyro.config.build().unwrap().integers;
    let period = f64::from(loops.ticks_per_period());
    let amplitude = share * gyro.config.peak_code;
    let code = |tick: u32, light: f64, noise: f64| {
        let crosstalk = amplitude * (2.0 * std::f64::consts::TAU * f64::from(tick) / period + phase).cos();
        (light + crosstalk + noise).round() as i32
    };
    let stuck = gyro.dice.within(0.5, 1.0) * gyro.config.peak_code;
    let mut state = loops.start();
    let mut locks = false;
    for tick in 0..40_000 {
        loops.tick(&mut state, code(tick, stuck, 0.0));
        locks |= matches!(state.phase(), PathLengthPhase::Locked { .. });
    }
    let (mut state, mut sum, mut periods, mut tick) = (loops.start(), 0, 0, 0);
    while periods < loops.hearing_periods() {
        let noise = gyro.config.noise * gyro.config.peak_code * gyro.dice.normal();
        loops.tick(&mut state, code(tick, 0.0, noise));
        tick += 1;
        if state.begins_period() {
            (sum, periods) = (sum + state.second_harmonic(), periods + 1);
        }
    }
    (locks, loops.is_heard(sum, periods))
}

/// A modulation that reaches the amplifier of a stuck photodiode looks like a peak. With the lamp off it shows; a sound photodiode and its
/// noise do not.
#[test]
fn crosstalk_that_looks_like_a_peak_is_heard_with_the_lamp_off() {
    let (mut locked, mut heard) = (0, 0);
    for seed in 0..150 {
        for phase in 0..8 {
            let mut gyro = Gyro::random(seed, seed % 2 == 0);
            let share = gyro.dice.within(1e-4, 5e-3);
            let (locks, is_heard) = with_crosstalk(&mut gyro, share, f64::from(phase) * std::f64::consts::FRAC_PI_4);
            assert!(
                is_heard || !locks,
                "{seed}, phase {phase}, {share}: locks on crosstalk that the check does not hear"
            );
            (locked, heard) = (locked + u32::from(locks), heard + u32::from(is_heard));
        }
        let mut sound = Gyro::random(seed, seed % 2 == 0);
        assert_eq!(with_crosstalk(&mut sound, 0.0, 0.0), (false, false), "{seed}: noise is heard");
    }
    assert!(locked > 100 && heard < 1200, "{locked} locked, {heard} heard");
}

/// A modulation that shows no peak is refused where the loop is designed, with the one that would do.
#[test]
fn a_modulation_that_shows_nothing_is_refused() {
    let mut config = Gyro::random(1, true).config;
    (config.peak_code, config.modulation_waves) = (2000.0, 0.001);
    let Err(DesignError::Faint { codes, least_waves }) = config.build() else { panic!("{:?}", config.build()) };
    // c·a²/2 of the light: the closed form.
    let wanted = config.curvature * 1e-6 / 2.0 * 2000.0;
    assert!((codes / wanted - 1.0).abs() < 0.1, "{codes} for {wanted}");
    config.modulation_waves = least_waves * 1.001;
    assert!(config.build().is_ok());
    config.modulation_waves = least_waves * 0.99;
    assert!(config.build().is_err());
}
