//! One tick of the board, in a fixed order.
//!
//! ```text
//! levels ─▶ counts ─▶ slow update: a slice ─▶ stripping ─▶ compensation ─▶ path-length loop ─▶ intensity loop ─▶ frame
//! ```
//!
//! A slow update is made in slices, one in each of the ticks before it is due (more where the temperature period has fewer ticks), with the
//! codes of the first of them. So no tick has a whole one, but for those that have none before them: at power-on, after another image, after
//! an upset, and among ticks that are made up.
//!
//! The status of a frame also has what the board alone knows: a dither that is missing, steps of unknown direction, counts beyond what
//! a call takes, a thermometer that stands still, where the image comes from, ticks that were missed, and memory that turned over.
//!
//! With a dithered gyro the counts go to the correction at the end of each dither period; the ticks in between have
//! none. The order is part of the format: the content of a frame depends on it.

use sagnac_core::{
    Compensator, ErrorBound, Image, Loaded, MAX_INPUTS, MAX_RAW, Origin, SlowUpdate, State, Status, UNBOUNDED,
    ValueSource, Watch, WatchSpec,
};
use sagnac_loops::{
    Counting, Intensity, IntensityState, LoopTable, PathLength, PathLengthState, PathLengthStatus, Quadrature,
    QuadratureState, Stripper,
};

use crate::frame_angle::FrameAngle;
use crate::message::{OutputFrame, image_code};

/// Usual ticks of an output frame: 10 ms at 100 µs.
pub const FRAME_TICKS: u16 = 100;
/// Longest pause that [`Board::make_up`] makes up, ticks: 105 s at 100 µs.
pub const LONGEST_PAUSE_TICKS: u32 = 1 << 20;

/// How the processor came to begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartCause {
    /// The power was off: a warm-up begins.
    PowerOn,
    /// A watchdog, a command or a dip of the supply: the gyro stayed warm.
    Reset {
        /// Seconds since power-on, from a clock that the reset left running; a warm-up goes on there. `None`: it is over, and the status is
        /// SETTLING for three of its time constants.
        since_power_on_s: Option<u32>,
    },
}

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

/// What a board is built with. Keep it in flash: [`Board::is_intact`] compares the board with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardSetup {
    /// The two loops.
    pub loops: LoopTable,
    /// A dithered gyro has one, as [`Stripper::new`] makes it.
    pub stripper: Option<Stripper>,
    /// Watches the image's thermometers: [`Status::STUCK`] while one stands still although another one goes away from it.
    pub watch: Option<WatchSetup>,
    /// Ticks of an output frame, usually [`FRAME_TICKS`]; 0 as 1.
    pub frame_ticks: u16,
}

/// The watch over the image's thermometers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WatchSetup {
    /// In 2⁻²⁴ °C.
    pub spec: WatchSpec,
    /// The path-length actuator is a heater that moves all thermometers; its command shows a still one too.
    pub heats: bool,
}

/// The board of one gyro axis.
#[derive(Clone, Debug)]
pub struct Board {
    gyro: Compensator,
    state: State,
    pending: Option<Pending>,
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
    seal: Seal,
    /// The checksum of the image, exclusive or the code of origin and trial.
    image_checksum: u32,
    /// The checksum of the image as it was given: no other image is taken for it.
    given_checksum: u32,
    /// The frame being filled, and its ticks so far.
    frame: OutputFrame,
    ticks_so_far: u16,
    /// In slices, in the ticks behind a slow update.
    error: ErrorBound,
    angle: FrameAngle,
}

/// Slow updates in so many seconds.
fn updates_in(image: &Image, seconds: u32) -> u64 {
    let d = image.description();
    let period_ns = u64::from(d.tick_ns) * u64::from(d.period_ticks);
    (u64::from(seconds) * 1_000_000_000).checked_div(period_ns).unwrap_or(0)
}

impl Board {
    /// A board that begins. `levels` are the A/B levels at this moment; the first step counts from them.
    pub fn new(start: StartCause, image: Image, origin: Origin, setup: &BoardSetup, levels: (bool, bool)) -> Self {
        let counter = Quadrature { counting: Counting::X4 };
        let mut count_state = QuadratureState::new();
        counter.update(&mut count_state, levels.0, levels.1);
        let gyro = Compensator::new(image);
        let state = match start {
            StartCause::PowerOn => State::new(),
            StartCause::Reset { since_power_on_s: None } => State::warm(),
            StartCause::Reset { since_power_on_s: Some(seconds) } => gyro.state_after(updates_in(&image, seconds)),
        };
        Self {
            gyro,
            seal: Seal::of(&state, 0),
            image_checksum: image.checksum() ^ u32::from(image_code(origin, false)),
            given_checksum: image.checksum(),
            state,
            pending: None,
            counter,
            count_state,
            lost_steps: 0,
            stripper: setup.stripper,
            path: (setup.loops.path_length, setup.loops.path_length.start()),
            light: (setup.loops.intensity, setup.loops.intensity.start()),
            origin,
            trial: false,
            watch: setup.watch.map(ThermometerWatch::new),
            frame: OutputFrame {
                origin,
                frame_ticks: setup.frame_ticks.max(1),
                tick_ns: image.description().tick_ns,
                error_milli_dph: UNBOUNDED,
                ..OutputFrame::default()
            },
            ticks_so_far: 0,
            error: ErrorBound::new(),
            angle: FrameAngle::of(&image),
        }
    }

    /// Bit i: the image's input i stands still.
    pub fn standing_still(&self) -> u32 {
        self.watch.as_ref().map_or(0, |watch| watch.still)
    }

    /// What flash holds now, after a message or at power-on: continues with its image, between two ticks, if that is another one. The tick waits
    /// meanwhile: a check of the firmware bounds the instructions.
    #[inline(never)]
    pub fn use_loaded(&mut self, loaded: &Loaded) {
        // No two images that flash held one after the other have one sequence number.
        let sequence = self.image().description().sequence;
        if loaded.checksum() != self.given_checksum || loaded.image.description().sequence != sequence {
            self.take_image(loaded);
        }
        // A bit of the old code that turned over stays in the checksum.
        self.image_checksum ^= u32::from(image_code(self.origin, self.trial) ^ image_code(loaded.origin, loaded.trial));
        (self.origin, self.trial) = (loaded.origin, loaded.trial);
        (self.frame.origin, self.frame.trial) = (loaded.origin, loaded.trial);
    }

    /// Another image, between two ticks.
    fn take_image(&mut self, loaded: &Loaded) {
        self.image_checksum = loaded.checksum() ^ u32::from(image_code(self.origin, self.trial));
        self.given_checksum = loaded.checksum();
        self.gyro = Compensator::new(loaded.image);
        self.angle.take_scale_of(&loaded.image);
        self.state = self.gyro.migrate_state(&self.state);
        self.pending = None;
        self.seal = Seal::of(&self.state, self.frame.tick);
        // Its inputs may be other thermometers.
        self.watch = self.watch.as_ref().map(|watch| ThermometerWatch::new(watch.setup()));
    }

    /// False if a bit of the image, its origin, the loops, the stripper's or the watch's numbers turned over in memory since they were given.
    /// `setup` is the one in flash. Ask once a second, between two ticks; the state is compared at every slow update by itself.
    #[inline(never)]
    pub fn is_intact(&self, setup: &BoardSetup) -> bool {
        self.image().checksum() ^ u32::from(image_code(self.origin, self.trial)) == self.image_checksum
            && self.path.0 == setup.loops.path_length
            && self.light.0 == setup.loops.intensity
            && self.stripper.map(|stripper| stripper.at_start()) == setup.stripper
            && self.watch.as_ref().map(ThermometerWatch::setup) == setup.watch
            && self.frame.frame_ticks == setup.frame_ticks.max(1)
            && self.frame.tick_ns == self.image().description().tick_ns
            && self.angle.has_scale_of(self.image())
    }

    /// Goes on with what flash holds after [`Board::is_intact`] was false, with [`Status::UPSET`] in the frame.
    #[inline(never)]
    pub fn mend(&mut self, loaded: &Loaded, setup: &BoardSetup) {
        if *self.image() != loaded.image {
            self.take_image(loaded);
        }
        self.use_loaded(loaded);
        self.given_checksum = loaded.checksum();
        self.image_checksum = loaded.checksum() ^ u32::from(image_code(self.origin, self.trial));
        if self.path.0 != setup.loops.path_length {
            self.path = (setup.loops.path_length, setup.loops.path_length.start());
        }
        if self.light.0 != setup.loops.intensity {
            self.light = (setup.loops.intensity, setup.loops.intensity.start());
        }
        if self.stripper.map(|stripper| stripper.at_start()) != setup.stripper {
            self.stripper = setup.stripper;
        }
        if self.watch.as_ref().map(ThermometerWatch::setup) != setup.watch {
            self.watch = setup.watch.map(ThermometerWatch::new);
        }
        self.frame.frame_ticks = setup.frame_ticks.max(1);
        self.frame.tick_ns = self.image().description().tick_ns;
        self.angle.take_scale_of(&loaded.image);
        self.frame.status |= Status::UPSET;
    }

    /// The active image.
    pub const fn image(&self) -> &Image {
        self.gyro.image()
    }

    /// One tick: the levels seen during it, in order, and the sample at its end. A frame is returned every [`BoardSetup::frame_ticks`] ticks.
    #[inline]
    pub fn tick(
        &mut self,
        levels: impl Iterator<Item = (bool, bool)>,
        sample: &Sample,
    ) -> (ActuatorCodes, Option<OutputFrame>) {
        let mut counts = 0_i32;
        for (a, b) in levels {
            counts = counts.wrapping_add(self.counter.update(&mut self.count_state, a, b));
        }
        self.tick_counts(counts, self.count_state.lost, sample)
    }

    /// The same with the counts of a hardware counter (a timer in encoder mode, a capture unit): those of this tick, and the counter's
    /// total of steps of unknown direction, 0 for a counter that has none. A board calls one of the two, never both.
    #[inline]
    pub fn tick_counts(
        &mut self,
        counts: i32,
        lost_steps: u32,
        sample: &Sample,
    ) -> (ActuatorCodes, Option<OutputFrame>) {
        self.check_state();
        self.make_slices(sample);
        self.bound_error(1);
        if self.state.ticks_to_update() == 0 {
            self.slow_update(&sample.codes);
        }
        let counted = self.count(counts, lost_steps, sample.pickoff);
        let raw = counted.clamp(i64::from(-MAX_RAW), i64::from(MAX_RAW)) as i32;
        if i64::from(raw) != counted {
            // More counts than one call accepts: the excess is lost, and the status reports it.
            self.frame.status |= Status::OVERFLOW;
        }
        // No misuse is possible: a due update was made, and the counts are in range.
        if let Ok(output) = self.gyro.tick(&mut self.state, raw) {
            self.frame.counts = self.summed(self.frame.counts, output.counts);
            self.frame.status |= output.status | of_origin(self.origin) | sample.status;
        }
        if self.standing_still() != 0 {
            self.frame.status |= Status::STUCK;
        }
        self.frame.raw = self.summed(self.frame.raw, raw);
        let commands = self.loops(sample.light);
        (commands, self.end_of_tick(&commands))
    }

    /// Makes up ticks that passed without a call, before the one that has all their counts: while the processor erased its flash, say.
    ///
    /// Their correction is output, as that of ticks without counts, with [`Status::MISSED_TICKS`] in the frame. Slow updates among them
    /// have no sample (`HELD`). The loops and the stripping stand still: no light and no pickoff was seen, and the counts between two zeros
    /// of the dither are the same. The tick number of the frame jumps. After more than [`LONGEST_PAUSE_TICKS`] nothing is made up: the
    /// correction begins again, as after a reset.
    pub fn make_up(&mut self, missed_ticks: u32) {
        if missed_ticks == 0 {
            return;
        }
        self.check_state();
        self.frame.status |= Status::MISSED_TICKS;
        if missed_ticks > LONGEST_PAUSE_TICKS {
            self.frame.tick = self.frame.tick.wrapping_add(missed_ticks);
            self.begin_again();
            return;
        }
        let mut rest = missed_ticks;
        while rest > 0 {
            if self.state.ticks_to_update() == 0 {
                self.slow_update(&[None; MAX_INPUTS]);
            }
            let ticks = rest.min(self.state.ticks_to_update());
            if let Ok(output) = self.gyro.advance(&mut self.state, 0, ticks) {
                self.frame.counts = self.summed(self.frame.counts, output.counts);
                self.frame.status |= output.status;
            }
            self.frame.tick = self.frame.tick.wrapping_add(ticks);
            rest = rest.saturating_sub(ticks.max(1));
        }
    }

    /// Begins the state again if a bit of it turned over since the last tick.
    #[inline]
    fn check_state(&mut self) {
        if !self.seal.holds(&self.gyro, &self.state, self.frame.tick) {
            self.begin_again();
            self.frame.status |= Status::UPSET;
        }
    }

    #[cold]
    fn begin_again(&mut self) {
        self.state = self.gyro.restart(&self.state);
        self.pending = None;
        self.seal = Seal::of(&self.state, self.frame.tick);
    }

    /// The slices of this tick, of the update that is due next.
    #[inline]
    fn make_slices(&mut self, sample: &Sample) {
        let (slices, period_ticks) = (self.gyro.slices() as u32, self.image().description().period_ticks);
        let of_tick = if period_ticks >= slices { 1 } else { slices.checked_div(period_ticks).unwrap_or(slices) + 1 };
        let left = self.state.ticks_to_update();
        if self.pending.is_none() && left > 0 && left <= slices {
            if !self.seal.is_of(&self.state) {
                self.begin_again();
                self.frame.status |= Status::UPSET;
                return;
            }
            let codes = sample.codes.get(..self.image().inputs().len()).unwrap_or(&[]);
            let update = self.gyro.begin_update(&self.state, codes).ok();
            self.pending = update.map(|update| Pending { update, codes: sample.codes });
        }
        if let Some(pending) = &mut self.pending {
            for _ in 0..of_tick {
                self.gyro.advance_update(&mut pending.update);
            }
        }
    }

    /// Puts the update in force that is due now: the one in slices, or a whole one with these codes.
    fn slow_update(&mut self, codes: &[Option<i32>; MAX_INPUTS]) {
        // Where there were fewer ticks than slices.
        self.bound_error(MAX_INPUTS + 1);
        let mut codes = *codes;
        if let Some(mut pending) = self.pending.take() {
            codes = pending.codes;
            let _ = self.gyro.apply_update(&mut self.state, &mut pending.update);
        } else {
            let of_image = codes.get(..self.gyro.image().inputs().len()).unwrap_or(&[]);
            let _ = self.gyro.update(&mut self.state, of_image);
        }
        self.seal = Seal::of(&self.state, self.frame.tick);
        self.error.begin(&self.state);
        self.frame.error_milli_dph = self.frame.error_milli_dph.max(self.error.milli_dph());
        self.frame.temperature = codes.first().copied().flatten();
        if let Some(watch) = &mut self.watch {
            let command = watch.heats.then_some(self.path.1.held());
            watch.still = watch.watch.update(&temperatures(self.gyro.image(), &codes), command);
        }
    }

    /// So many slices of the bound of the last slow update.
    #[inline]
    fn bound_error(&mut self, slices: usize) {
        if !self.error.is_whole() {
            for _ in 0..slices {
                self.error.advance(self.gyro.image(), &self.state);
            }
            self.frame.error_milli_dph = self.frame.error_milli_dph.max(self.error.milli_dph());
        }
    }

    /// The sum of a frame, with OVERFLOW where 32 bits do not hold it.
    #[inline]
    fn summed(&mut self, sum: i32, counts: i32) -> i32 {
        let (sum, wraps) = sum.overflowing_add(counts);
        if wraps {
            self.frame.status |= Status::OVERFLOW;
        }
        sum
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

    fn end_of_tick(&mut self, commands: &ActuatorCodes) -> Option<OutputFrame> {
        self.frame.tick = self.frame.tick.wrapping_add(1);
        self.ticks_so_far += 1;
        if self.ticks_so_far < self.frame.frame_ticks {
            return None;
        }
        self.frame.lost_steps = self.lost_steps as u16;
        self.frame.angle_nano_arcsec = self.angle.of_counts(self.frame.counts);
        if ErrorBound::is_open_ended(self.frame.status) {
            self.frame.error_milli_dph = UNBOUNDED;
        }
        let given = self.frame;
        self.ticks_so_far = 0;
        self.frame = OutputFrame {
            sequence: given.sequence.wrapping_add(1),
            tick: given.tick,
            temperature: given.temperature,
            actuator: given.actuator,
            current: commands.current,
            origin: self.origin,
            trial: self.trial,
            error_milli_dph: self.error.milli_dph(),
            frame_ticks: given.frame_ticks,
            tick_ns: given.tick_ns,
            ..OutputFrame::default()
        };
        Some(given)
    }
}

/// A slow update in slices, and the codes it was begun with.
#[derive(Clone, Copy, Debug)]
struct Pending {
    update: SlowUpdate,
    codes: [Option<i32>; MAX_INPUTS],
}

/// What the state must still be at the next slow update, and when that is.
#[derive(Clone, Copy, Debug)]
struct Seal {
    checksum: u32,
    /// Number of the tick before which the next slow update is due.
    update_at: u32,
}

impl Seal {
    fn of(state: &State, tick: u32) -> Self {
        Self { checksum: state.checksum(), update_at: tick.wrapping_add(state.ticks_to_update()) }
    }

    fn is_of(self, state: &State) -> bool {
        self.checksum == state.checksum()
    }

    /// At every tick the bounds and the time of the slow update, and the checksum when it is due.
    #[inline]
    fn holds(self, gyro: &Compensator, state: &State, tick: u32) -> bool {
        let due = state.ticks_to_update() == 0;
        gyro.is_plausible(state) && due == (tick == self.update_at) && (!due || self.is_of(state))
    }
}

/// The watch over the thermometers, and what it found at the last slow update.
#[derive(Clone, Debug)]
struct ThermometerWatch {
    watch: Watch<MAX_INPUTS>,
    heats: bool,
    still: u32,
}

impl ThermometerWatch {
    const fn new(setup: WatchSetup) -> Self {
        Self { watch: Watch::new(setup.spec), heats: setup.heats, still: 0 }
    }

    const fn setup(&self) -> WatchSetup {
        WatchSetup { spec: self.watch.spec(), heats: self.heats }
    }
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

#[cfg(test)]
mod tests {
    extern crate std;

    use sagnac_core::BankReport;

    use super::*;

    fn loops() -> LoopTable {
        let words =
            std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/vectors/path-length-mirror.hex"));
        let (words, mut room) = (words.unwrap(), [0; sagnac_vectors::MAX_TABLE]);
        let mut words = sagnac_vectors::Words::new(&words);
        let head = words.head().unwrap();
        LoopTable::decode(words.table(&head, &mut room).unwrap()).unwrap()
    }

    fn board_of(setup: &BoardSetup) -> Board {
        let image = Image::decode(include_bytes!("../../../testdata/image/paper.img")).unwrap();
        Board::new(StartCause::PowerOn, image, Origin::Newest, setup, (false, false))
    }

    fn plain() -> BoardSetup {
        BoardSetup { loops: loops(), stripper: None, watch: None, frame_ticks: FRAME_TICKS }
    }

    fn board() -> Board {
        board_of(&plain())
    }

    fn frame(board: &mut Board) -> OutputFrame {
        let sample = Sample { codes: [Some(20 << 24), None, None, None], ..Sample::default() };
        core::iter::repeat_with(|| board.tick_counts(3, 0, &sample).1).find_map(|frame| frame).unwrap()
    }

    /// An image or a checksum that turned over, or other loops, is found by the comparison alone, and mended from what flash holds.
    #[test]
    fn an_upset_image_is_found_and_mended() {
        let (mut board, setup) = (board(), plain());
        assert!(board.is_intact(&setup));
        let image = *board.image();
        let held = Loaded::new(image, Origin::Newest, [BankReport::Uncommitted; 2], false);
        let mut description = *image.description();
        description.sequence ^= 1 << 20;
        let mut other = *image.description();
        other.terms[0].mantissa ^= 1;
        let upsets = [description, other].map(|upset| Compensator::new(Image::new(upset).unwrap()));
        for upset in [upsets[0], upsets[1], board.gyro] {
            board.gyro = upset;
            board.image_checksum ^= u32::from(upset.image() == &image);
            assert!(!board.is_intact(&setup) && frame(&mut board).status == Status::OK);
            board.mend(&held, &setup);
            assert!(board.is_intact(&setup) && *board.image() == image);
            assert_eq!(frame(&mut board).status, Status::UPSET);
            assert_eq!(frame(&mut board).status, Status::OK);
        }
    }

    /// The board's own fields: each that turned over is found by the comparison, and mended. A lost stripper would leave the dither in the
    /// output, a lost origin the status of a board without an image.
    #[test]
    fn an_upset_of_the_boards_own_fields_is_found_and_mended() {
        let spec = WatchSpec { shows: 1 << 25, still: 1 << 20, command_shows: 500 };
        let watch = WatchSetup { spec, heats: true };
        let setup = BoardSetup { stripper: Some(Stripper::new(50, 1000)), watch: Some(watch), ..plain() };
        let image = *board().image();
        let held = Loaded::new(image, Origin::Newest, [BankReport::Uncommitted; 2], false);
        let upsets: [fn(&mut Board); 10] = [
            |board| board.stripper = None,
            |board| board.stripper = Some(Stripper::new(50 ^ 4, 1000)),
            |board| board.stripper = Some(Stripper::new(50, 1000 ^ 64)),
            |board| board.watch = None,
            |board| board.watch.as_mut().unwrap().heats = false,
            |board| board.watch.as_mut().unwrap().watch = Watch::new(WatchSpec { shows: 1, ..WatchSpec::default() }),
            |board| board.origin = Origin::Survivor,
            |board| board.origin = Origin::FactoryDefaults,
            |board| board.trial = true,
            |board| board.image_checksum ^= 1,
        ];
        for (number, upset) in upsets.iter().enumerate() {
            let mut board = board_of(&setup);
            frame(&mut board);
            assert!(board.is_intact(&setup));
            upset(&mut board);
            assert!(!board.is_intact(&setup), "upset {number}");
            // What flash holds, after a message, does not hide it.
            let mut hidden = board.clone();
            hidden.use_loaded(&held);
            assert!(!hidden.is_intact(&setup), "upset {number}, used again");
            board.mend(&held, &setup);
            assert!(board.is_intact(&setup) && board.origin == Origin::Newest && !board.trial, "upset {number}");
            assert!(frame(&mut board).status.contains(Status::UPSET));
        }
    }

    /// SAG-CORE-027: a state that is not the one of the last slow update is found at the next one, one frame says so, and the correction
    /// goes on. A tick that does not fit the time of the slow update is found at once.
    #[test]
    fn an_upset_state_is_found_at_the_next_slow_update() {
        for bit in 0..32 {
            let mut board = board();
            let period_frames = board.image().description().period_ticks / u32::from(FRAME_TICKS);
            for _ in 0..period_frames {
                assert_eq!(frame(&mut board).status, Status::OK);
            }
            frame(&mut board);
            board.seal.checksum ^= 1 << bit;
            // The slices of the next update begin in the last frame before it.
            for _ in 2..period_frames {
                assert_eq!(frame(&mut board).status, Status::OK);
            }
            assert_eq!(frame(&mut board).status, Status::UPSET, "bit {bit}");
            assert_eq!(frame(&mut board).status, Status::OK);
            board.seal.update_at ^= 1 << bit;
            let found =
                (0..2 * period_frames).map(|_| frame(&mut board).status).filter(|status| *status == Status::UPSET);
            assert_eq!(found.count(), 1, "bit {bit} of the time");
        }
    }
}
