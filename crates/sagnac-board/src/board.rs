//! One tick of the board, in a fixed order.
//!
//! ```text
//! levels ─▶ counts ─▶ slow update, if due ─▶ stripping ─▶ compensation ─▶ path-length loop ─▶ intensity loop ─▶ frame
//! ```
//!
//! The status of a frame also has what the board alone knows: a dither that is missing, steps of unknown direction, counts beyond what
//! a call takes, a thermometer that stands still, and where the image comes from.
//!
//! With a dithered gyro the counts go to the correction at the end of each dither period; the ticks in between have
//! none. The order is part of the format: the content of a frame depends on it.

use sagnac_core::{
    Compensator, Image, Loaded, MAX_INPUTS, MAX_RAW, Origin, State, Status, ValueSource, Watch, WatchSpec,
};
use sagnac_loops::{
    Counting, Intensity, IntensityState, LoopTable, PathLength, PathLengthState, PathLengthStatus, Quadrature,
    QuadratureState, Stripper,
};

use crate::message::Output;

/// Ticks of an output frame: 10 ms at 100 µs.
pub const FRAME_TICKS: u16 = 100;

/// Inputs of a tick besides the levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// Codes of the image's inputs; `None` where there is no new sample.
    pub codes: [Option<i32>; 4],
    /// Dither angle at the end of the tick, in any unit. Not used without dither.
    pub pickoff: i32,
    /// Code of the photodiode.
    pub light: i32,
    /// Status bits that the caller adds, for example [`Status::OUTVOTED`] after a [`sagnac_core::vote`].
    pub status: Status,
}

/// Outputs of a tick to the converters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ActuatorCodes {
    /// Path-length actuator with its modulation, code.
    pub actuator: i32,
    /// Only the modulation, code.
    pub modulation: i32,
    /// Discharge current, code.
    pub current: i32,
}

/// The board of one gyro axis.
#[derive(Clone, Debug)]
pub struct Board {
    gyro: Compensator,
    state: State,
    counter: Quadrature,
    count_state: QuadratureState,
    /// The counter's total at the last tick.
    lost_steps: u32,
    stripper: Option<Stripper>,
    path: (PathLength, PathLengthState),
    light: (Intensity, IntensityState),
    origin: Origin,
    trial: bool,
    watch: Option<ThermometerWatch>,
    /// The frame being filled, and its ticks so far.
    frame: Output,
    frame_ticks: u16,
}

impl Board {
    /// A board at power-on. `levels` are the A/B levels at this moment; the first step counts from them.
    /// A dithered gyro has a stripper.
    pub fn new(
        image: Image,
        origin: Origin,
        loops: &LoopTable,
        levels: (bool, bool),
        stripper: Option<Stripper>,
    ) -> Self {
        let counter = Quadrature { counting: Counting::X4 };
        let mut count_state = QuadratureState::new();
        counter.update(&mut count_state, levels.0, levels.1);
        Self {
            gyro: Compensator::new(image),
            state: State::new(),
            counter,
            count_state,
            lost_steps: 0,
            stripper,
            path: (loops.path_length, loops.path_length.start()),
            light: (loops.intensity, loops.intensity.start()),
            origin,
            trial: false,
            watch: None,
            frame: Output { origin, ..Output::default() },
            frame_ticks: 0,
        }
    }

    /// Watches the image's thermometers from here on: [`Status::STUCK`] while one stands still although another one goes away from it.
    /// `heats`: the path-length actuator is a heater that moves them all; its command shows it too. `spec` is in 2⁻²⁴ °C.
    pub fn watch_thermometers(&mut self, spec: WatchSpec, heats: bool) {
        self.watch = Some(ThermometerWatch { watch: Watch::new(spec), heats, still: 0 });
    }

    /// Bit i: the image's input i stands still.
    pub fn standing_still(&self) -> u32 {
        self.watch.as_ref().map_or(0, |watch| watch.still)
    }

    /// What flash holds now, after a message or at power-on: continues with its image, between two ticks, if that is another one.
    #[inline(never)]
    pub fn use_loaded(&mut self, loaded: &Loaded) {
        if loaded.image != *self.image() {
            self.gyro = Compensator::new(loaded.image);
            self.state = self.gyro.migrate_state(&self.state);
            // Its inputs may be other thermometers.
            if let Some(watch) = &mut self.watch {
                *watch = ThermometerWatch { watch: Watch::new(watch.watch.spec()), still: 0, ..*watch };
            }
        }
        (self.origin, self.trial) = (loaded.origin, loaded.trial);
        (self.frame.origin, self.frame.trial) = (loaded.origin, loaded.trial);
    }

    /// The active image.
    pub const fn image(&self) -> &Image {
        self.gyro.image()
    }

    /// One tick: the levels seen during it, in order, and the sample at its end. A frame is returned every [`FRAME_TICKS`] ticks.
    #[inline]
    pub fn tick(
        &mut self,
        levels: impl Iterator<Item = (bool, bool)>,
        sample: &Sample,
    ) -> (ActuatorCodes, Option<Output>) {
        let mut counts = 0_i32;
        for (a, b) in levels {
            counts = counts.wrapping_add(self.counter.update(&mut self.count_state, a, b));
        }
        self.tick_counts(counts, self.count_state.lost, sample)
    }

    /// The same with the counts of a hardware counter (a timer in encoder mode, a capture unit): those of this tick, and the counter's
    /// total of steps of unknown direction, 0 for a counter that has none. A board calls one of the two, never both.
    #[inline]
    pub fn tick_counts(&mut self, counts: i32, lost_steps: u32, sample: &Sample) -> (ActuatorCodes, Option<Output>) {
        if self.state.ticks_to_update() == 0 {
            self.slow_update(sample);
        }
        let counted = self.count(counts, lost_steps, sample.pickoff);
        let raw = counted.clamp(i64::from(-MAX_RAW), i64::from(MAX_RAW)) as i32;
        if i64::from(raw) != counted {
            // More counts than one call accepts: the excess is lost, and the status reports it.
            self.frame.status |= Status::OVERFLOW;
        }
        // No misuse is possible: a due update was made, and the counts are in range.
        if let Ok(output) = self.gyro.tick(&mut self.state, raw) {
            self.frame.counts = self.frame.counts.wrapping_add(output.counts);
            self.frame.status |= output.status | of_origin(self.origin) | sample.status;
        }
        if self.standing_still() != 0 {
            self.frame.status |= Status::STUCK;
        }
        self.frame.raw = self.frame.raw.wrapping_add(raw);
        let commands = self.loops(sample.light);
        (commands, self.end_of_tick(&commands))
    }

    fn slow_update(&mut self, sample: &Sample) {
        let wanted = self.gyro.image().inputs().len();
        let codes = sample.codes.get(..wanted).unwrap_or(&[]);
        let _ = self.gyro.update(&mut self.state, codes);
        self.frame.temperature = sample.codes.first().copied().flatten();
        if let Some(watch) = &mut self.watch {
            let command = watch.heats.then_some(self.path.1.held());
            watch.still = watch.watch.update(&temperatures(self.gyro.image(), &sample.codes), command);
        }
    }

    fn count(&mut self, counts: i32, lost_steps: u32, pickoff: i32) -> i64 {
        if lost_steps != self.lost_steps {
            self.lost_steps = lost_steps;
            self.frame.status |= Status::COUNTS_LOST;
        }
        let Some(stripper) = &mut self.stripper else { return counts.into() };
        let stripped = stripper.update(counts, pickoff).map_or(0, |out| out.counts);
        if !stripper.has_dither() {
            self.frame.status |= Status::NO_DITHER;
        }
        stripped
    }

    fn loops(&mut self, light: i32) -> ActuatorCodes {
        let (path, path_state) = (&self.path.0, &mut self.path.1);
        let held = path.tick(path_state, light);
        let hold = held.status.contains(PathLengthStatus::HOLD_LIGHT);
        let lit = self.light.0.tick(&mut self.light.1, light, hold);
        self.frame.path_status |= held.status.bits();
        self.frame.light_status |= lit.status.bits();
        self.frame.actuator = held.actuator;
        self.frame.current = lit.current;
        ActuatorCodes {
            actuator: held.actuator.wrapping_add(held.modulation),
            modulation: held.modulation,
            current: lit.current,
        }
    }

    fn end_of_tick(&mut self, commands: &ActuatorCodes) -> Option<Output> {
        self.frame.tick = self.frame.tick.wrapping_add(1);
        self.frame_ticks += 1;
        if self.frame_ticks < FRAME_TICKS {
            return None;
        }
        self.frame.lost_steps = self.lost_steps as u16;
        let given = self.frame;
        self.frame_ticks = 0;
        self.frame = Output {
            sequence: given.sequence.wrapping_add(1),
            tick: given.tick,
            temperature: given.temperature,
            actuator: given.actuator,
            current: commands.current,
            origin: self.origin,
            trial: self.trial,
            ..Output::default()
        };
        Some(given)
    }
}

/// The watch over the thermometers, and what it found at the last slow update.
#[derive(Clone, Debug)]
struct ThermometerWatch {
    watch: Watch<MAX_INPUTS>,
    heats: bool,
    still: u32,
}

/// The image's thermometers, 2⁻²⁴ °C: inputs with a code of their own in °C.
fn temperatures(image: &Image, codes: &[Option<i32>; MAX_INPUTS]) -> [Option<i32>; MAX_INPUTS] {
    let mut values = [None; MAX_INPUTS];
    for ((slot, input), code) in values.iter_mut().zip(image.inputs()).zip(codes) {
        if input.source == ValueSource::Code && input.unit_exponent == 0 {
            *slot = code.and_then(|code| input.value_q24(code));
        }
    }
    values
}

/// What the source of an image adds to the status of every tick.
fn of_origin(origin: Origin) -> Status {
    match origin {
        Origin::FactoryDefaults => Status::UNCORRECTED,
        Origin::Survivor => Status::SURVIVOR,
        Origin::Newest => Status::OK,
    }
}
