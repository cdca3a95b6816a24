//! A board on hardware behind traits: pauses, counters that wrap, converters, the serial line, and memory that turns over.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use crate::given::{PAPER, loops_of, setup};
use embedded_hal::pwm::SetDutyCycle;
use embedded_hal::spi::{ErrorType as SpiErrorType, Operation, SpiDevice};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use proptest::prelude::*;
use sagnac_board::frame::{Frame, FrameReader};
use sagnac_board::{
    ActuatorCodes, Axis, Board, BoardSetup, Commit, Converters, FringeCounter, LONGEST_PAUSE_TICKS, Line, MemoryFlash,
    Message, OutputFrame, Piece, PwmOutput, Sample, SpiDac, StartCause, TickClock,
};
use sagnac_core::{BankReport, Banks, Description, Gyro, Image, Loaded, MAX_IMAGE_LEN, NoKey, Origin, Status};
use sagnac_loops::Stripper;

/// A gyro that turns, and time that passes, whoever looks.
#[derive(Clone, Debug, Default)]
struct World {
    position: Rc<Cell<i64>>,
    ticks: Rc<Cell<u64>>,
    pickoff: Rc<Cell<i32>>,
    driven: Rc<Cell<u32>>,
}

struct Counter<const BITS: u32>(World);
struct Clock<const BITS: u32>(World);
struct Analogue(World);

impl<const B: u32> FringeCounter for Counter<B> {
    const BITS: u32 = B;
    fn position(&mut self) -> u32 {
        (self.0.position.get() & ((1 << B) - 1)) as u32
    }
}

impl<const B: u32> TickClock for Clock<B> {
    const BITS: u32 = B;
    fn ticks(&mut self) -> u32 {
        (self.0.ticks.get() & ((1 << B) - 1)) as u32
    }
}

impl Converters for Analogue {
    fn sample(&mut self) -> Sample {
        let codes = [Some(20 << 24), None, None, None];
        Sample { codes, pickoff: self.0.pickoff.get(), light: 1 << 20, status: Status::OK }
    }
    fn drive(&mut self, _: &ActuatorCodes) {
        self.0.driven.set(self.0.driven.get() + 1);
    }
}

fn board(stripper: Option<Stripper>) -> Board {
    Board::new(StartCause::PowerOn, Image::decode(PAPER).unwrap(), Origin::Newest, &setup(stripper), (false, false))
}

/// Runs `calls` interrupts, each after so many ticks of so many counts; the sums of the frames and the bits they had.
fn run<const BITS: u32>(pauses: impl Iterator<Item = u32>, counts: i64) -> (Vec<OutputFrame>, World) {
    let world = World::default();
    world.position.set(-100);
    world.ticks.set((1 << BITS) - 5);
    let mut axis =
        Axis::new(board(None), Counter::<BITS>(world.clone()), Clock::<BITS>(world.clone()), Analogue(world.clone()));
    let mut frames = Vec::new();
    for pause in pauses {
        world.position.set(world.position.get() + counts * i64::from(pause));
        world.ticks.set(world.ticks.get() + u64::from(pause));
        frames.extend(axis.tick());
    }
    (frames, world)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever the pauses: every count and every tick is in a frame, and the correction is that of a board without a pause, to the
    /// count. Counter and clock wrap, at 16 bits and at 32.
    #[test]
    fn pauses_lose_neither_counts_nor_ticks(
        pauses in prop::collection::vec(prop_oneof![6 => Just(1_u32), 1 => Just(0), 1 => 2..400_u32, 1 => 5_000..30_000_u32], 400),
        counts in -1_i64..=1,
        wide in any::<bool>(),
    ) {
        // The first slow update has its sample; without one the counts up to the next are UNCORRECTED.
        let pauses: Vec<u32> = std::iter::once(1).chain(pauses).collect();
        let paused = pauses.iter().copied();
        let (frames, world) = if wide { run::<32>(paused, counts) } else { run::<16>(paused, counts) };
        // A call within the same tick is none: whole frames of 100 calls that had ticks.
        let calls: Vec<u32> = pauses.iter().copied().filter(|pause| *pause > 0).collect();
        prop_assert_eq!(frames.len(), calls.len() / 100);
        prop_assert_eq!(world.driven.get() as usize, calls.len());
        let mut begun = 0;
        for (frame, own) in frames.iter().zip(calls.chunks(100)) {
            begun += own.iter().sum::<u32>();
            prop_assert_eq!(frame.tick, begun);
            prop_assert_eq!(i64::from(frame.raw), counts * i64::from(own.iter().sum::<u32>()));
            prop_assert_eq!(frame.status.contains(Status::MISSED_TICKS), own.iter().any(|pause| *pause > 1));
            prop_assert!(!frame.status.contains(Status::UPSET));
        }
        let mut steady = board(None);
        let mut wanted = 0;
        for _ in 0..begun {
            let sample = Sample { codes: [Some(20 << 24), None, None, None], ..Sample::default() };
            wanted += steady.tick_counts(counts as i32, 0, &sample).1.map_or(0, |frame| frame.counts);
        }
        // The board without a pause still has up to 99 ticks in a frame that has not ended.
        let got: i32 = frames.iter().map(|frame| frame.counts).sum();
        prop_assert!((got - wanted).abs() <= 101, "{} for {}", got, wanted);
    }
}

/// A pause in which slow updates were due has no sample for them: HELD, in the frame of the pause alone.
#[test]
fn a_slow_update_in_a_pause_is_held() {
    let period = Image::decode(PAPER).unwrap().description().period_ticks;
    let pauses = (0..period * 3).map(|call| if call == 500 { period } else { 1 });
    let (frames, _) = run::<32>(pauses, 1);
    let held: Vec<usize> = (0..frames.len()).filter(|at| frames[*at].status.contains(Status::HELD)).collect();
    let missed: Vec<usize> = (0..frames.len()).filter(|at| frames[*at].status.contains(Status::MISSED_TICKS)).collect();
    assert_eq!(missed, [5]);
    assert!(held.first() == Some(&5) && held.len() <= 1 + period as usize / 100, "{held:?}");
    assert_eq!(frames.last().unwrap().status, Status::OK);
}

/// Longer than what is made up: the correction begins again at once, and nobody waits for it.
#[test]
fn a_pause_without_end_begins_anew() {
    let pauses = (0..20_000).map(|call| if call == 15_000 { LONGEST_PAUSE_TICKS + 2 } else { 1 });
    let (frames, _) = run::<32>(pauses, 0);
    assert!(frames[150].status.contains(Status::MISSED_TICKS));
    assert_eq!(frames[150].tick - frames[149].tick, 100 + LONGEST_PAUSE_TICKS + 1);
    assert_eq!(frames.last().unwrap().status, Status::OK);
    let before: i32 = frames[50..100].iter().map(|frame| frame.counts).sum();
    let after: i32 = frames[150..].iter().map(|frame| frame.counts).sum();
    assert!((before - after).abs() <= 1, "{before} {after}");
}

/// A dithered gyro: counts of a pause are whole after it, whatever the phase of the dither at its two ends.
#[test]
fn a_pause_keeps_the_counts_of_a_dithered_gyro() {
    for pause in [0, 1, 7, 12, 13, 24, 25, 60, 400] {
        let world = World::default();
        let mut axis = Axis::new(
            board(Some(Stripper::new(50, 1000))),
            Counter::<32>(world.clone()),
            Clock::<32>(world.clone()),
            Analogue(world.clone()),
        );
        let (mut raw, mut bits) = (0, Status::OK);
        for tick in 0..20_000_u64 {
            // A period of 25 ticks; 3 counts a tick, and 200 counts of dither.
            let angle = (tick as f64 / 25.0 * std::f64::consts::TAU).sin();
            world.position.set(tick as i64 * 3 + (angle * 200.0).round() as i64);
            world.pickoff.set((angle * 1e6) as i32);
            world.ticks.set(tick + 1);
            if !(5_000..5_000 + pause).contains(&tick)
                && let Some(frame) = axis.tick()
            {
                raw += frame.raw;
                bits |= frame.status;
            }
        }
        // Of the last period and the first one nothing is known: 2 periods of 75 counts.
        assert!((i64::from(raw) - 60_000).abs() <= 450, "{raw} with a pause of {pause}");
        assert_eq!(bits.contains(Status::MISSED_TICKS), pause > 0);
        assert!(!bits.contains(Status::UPSET) && !bits.contains(Status::COUNTS_LOST));
    }
}

fn what_flash_holds(image: Image) -> Loaded {
    Loaded::new(image, Origin::Newest, [BankReport::Uncommitted; 2], false)
}

/// Another image than that of flash, or other loops, in memory: after mending both are those of flash, and one frame says so.
#[test]
fn memory_that_differs_from_flash_is_mended() {
    let image = Image::decode(PAPER).unwrap();
    let turned_over = Image::new(Description { sequence: 1 << 20, ..*image.description() }).unwrap();
    let sample = Sample { codes: [Some(20 << 24), None, None, None], ..Sample::default() };
    let frame = |board: &mut Board| (0..100).find_map(|_| board.tick_counts(1, 0, &sample).1).unwrap();
    let mut board = Board::new(StartCause::PowerOn, turned_over, Origin::Newest, &setup(None), (false, false));
    assert_eq!(frame(&mut board).status, Status::OK);
    board.mend(&what_flash_holds(image), &setup(None));
    assert_eq!(frame(&mut board).status, Status::UPSET);
    assert!(*board.image() == image && board.is_intact(&setup(None)));
    assert_eq!(frame(&mut board).status, Status::OK);
    let heater = BoardSetup { loops: loops_of("path-length-heater"), ..setup(None) };
    assert!(!board.is_intact(&heater));
    board.mend(&what_flash_holds(image), &heater);
    assert!(board.is_intact(&heater));
    assert_eq!(frame(&mut board).status, Status::UPSET);
}

#[derive(Clone, Default)]
struct Channel(Rc<Cell<u16>>);

impl embedded_hal::pwm::ErrorType for Channel {
    type Error = Infallible;
}

impl SetDutyCycle for Channel {
    fn max_duty_cycle(&self) -> u16 {
        10_000
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.0.set(duty);
        Ok(())
    }
}

#[test]
fn a_pulse_width_follows_the_code_within_its_range() {
    let channel = Channel::default();
    let mut output = PwmOutput::new(channel.clone(), -100, 100).unwrap();
    let codes = [(i32::MIN, 0), (-100, 0), (-99, 50), (0, 5_000), (1, 5_050), (100, 10_000), (i32::MAX, 10_000)];
    for (code, duty) in codes {
        output.set(code).unwrap();
        assert_eq!(channel.0.get(), duty, "code {code}");
    }
    assert!(PwmOutput::new(channel.clone(), 5, 5).is_none() && PwmOutput::new(channel.clone(), 5, 4).is_none());
    let mut widest = PwmOutput::new(channel.clone(), i32::MIN, i32::MAX).unwrap();
    widest.set(0).unwrap();
    assert_eq!(channel.0.get(), 5_000);
}

#[derive(Clone, Default)]
struct Bus(Rc<RefCell<Vec<u8>>>);

impl SpiErrorType for Bus {
    type Error = Infallible;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        for operation in operations {
            let Operation::Write(bytes) = operation else { panic!("only writes") };
            self.0.borrow_mut().extend_from_slice(bytes);
        }
        Ok(())
    }
}

#[test]
fn a_converter_on_spi_gets_one_word() {
    let bus = Bus::default();
    let mut dac = SpiDac::new(bus.clone(), -0x8000);
    for code in [0, 1, -0x8000, 0x7fff, i32::MIN, i32::MAX] {
        dac.set(code).unwrap();
    }
    assert_eq!(*bus.0.borrow(), [0x80, 0, 0x80, 1, 0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
}

/// A serial port in memory.
#[derive(Clone, Debug, Default)]
struct Port {
    arrived: Rc<RefCell<VecDeque<u8>>>,
    sent: Rc<RefCell<Vec<u8>>>,
}

impl ErrorType for Port {
    type Error = Infallible;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.arrived.borrow().is_empty())
    }
}

impl Read for Port {
    fn read(&mut self, room: &mut [u8]) -> Result<usize, Infallible> {
        let mut arrived = self.arrived.borrow_mut();
        assert!(!arrived.is_empty(), "a real port would wait here");
        let taken = arrived.len().min(room.len());
        room.iter_mut().zip(arrived.drain(..taken)).for_each(|(slot, byte)| *slot = byte);
        Ok(taken)
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.sent.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl Port {
    fn give(&self, message: Message) {
        let (bytes, len) = message.frame().unwrap().bytes();
        self.arrived.borrow_mut().extend(&bytes[..len]);
    }

    fn said(&self) -> Vec<Message> {
        let mut reader = FrameReader::new();
        let frames: Vec<Frame> = self.sent.borrow_mut().drain(..).filter_map(|byte| reader.push(byte)).collect();
        frames.iter().filter_map(Message::parse).collect()
    }
}

/// An image goes over the line into flash and into the board; a message that was cut short does not hold up the next one.
#[test]
fn an_image_arrives_over_the_line() {
    let image = Image::decode(PAPER).unwrap();
    let gyro = Gyro::of(&image, 4);
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).unwrap();
    let port = Port::default();
    let (mut line, loaded) = Line::power_on(port.clone(), banks, gyro, NoKey, 0).unwrap();
    assert_eq!(loaded.origin, Origin::FactoryDefaults);
    assert!(matches!(port.said()[..], [Message::Reply(reply)] if reply.sequence == 0));
    assert!(!line.poll(|_| panic!("nothing arrived")).unwrap());
    let mut board = Board::new(StartCause::PowerOn, loaded.image, loaded.origin, &setup(None), (false, false));
    let mut bytes = [0; MAX_IMAGE_LEN];
    let len = image.encode(&mut bytes).unwrap();
    for (at, piece) in bytes[..len].chunks(60).enumerate() {
        let mut room = [0; 60];
        room[..piece.len()].copy_from_slice(piece);
        port.give(Message::Piece(Piece { offset: at as u16 * 60, len: piece.len() as u8, bytes: room }));
    }
    let commit = Message::Commit(Commit { len: len as u16, trial: false });
    let (cut, cut_len) = commit.frame().unwrap().bytes();
    port.arrived.borrow_mut().extend(&cut[..cut_len - 3]);
    let mut used = 0;
    while line.poll(|_| used += 1).unwrap() {}
    assert_eq!(used, 0);
    line.quiet(|_| panic!("half a message")).unwrap();
    port.give(commit);
    while line
        .poll(|loaded| {
            used += 1;
            board.use_loaded(loaded);
        })
        .unwrap()
    {}
    assert!(used == 1 && *board.image() == image && line.load().image == image);
    let said = port.said();
    assert!(
        said.len() == len.div_ceil(60) + 1
            && said
                .iter()
                .all(|message| matches!(message, Message::Reply(reply) if reply.code == sagnac_board::ReplyCode::Done))
    );
    line.send(OutputFrame::default()).unwrap();
    assert_eq!(port.said(), [Message::Output(OutputFrame::default())]);
}
