//! The two halves of a board's program: the tick's interrupt and the main loop.
//!
//! [`TickHandler`] runs in the interrupt and never waits. [`CommandHandler`] runs in the main loop: it reads messages
//! and may write flash. A message is handled when the rows before it have ended, so the same bytes in give the same
//! bytes out, for any timing of the two.

use embedded_storage::nor_flash::NorFlash;
use sagnac_core::{Banks, Gyro, Loaded, NoKey, Trust};
use sagnac_loops::{LoopTable, Stripper};

use crate::board::{ActuatorCodes, Board, BoardSetup, FRAME_TICKS, StartCause};
use crate::frame::{Frame, FrameReader};
use crate::message::{Message, OutputFrame, Reply, RigSettings, Row};
use crate::rig::Rig;
use crate::upload::Upload;

/// Longest period of a dithered gyro, ticks: 200 Hz at 100 µs.
const LONGEST_DITHER_TICKS: u16 = 50;
/// A quarter of the amplitude of the rig's pickoff.
const LEAST_SWING: u32 = 1 << 23;

/// The part that runs in the tick's interrupt: the board, and the rig instead of its gyro.
#[derive(Clone, Debug)]
pub struct TickHandler {
    board: Board,
    rig: Rig,
    actuators: ActuatorCodes,
}

impl TickHandler {
    /// Remaining ticks of the row.
    pub const fn ticks_left(&self) -> u32 {
        self.rig.ticks_left()
    }

    /// Starts a row. The row before must have ended.
    pub fn start_row(&mut self, row: Row) {
        self.rig.start_row(row);
    }

    /// One tick, if a row is running.
    #[inline]
    pub fn tick(&mut self) -> Option<OutputFrame> {
        if self.rig.ticks_left() == 0 {
            return None;
        }
        let (levels, sample) = self.rig.tick(&self.actuators);
        let (actuators, output) = self.board.tick(levels, &sample);
        self.actuators = actuators;
        output
    }

    /// Continues with the image that flash holds, between two ticks.
    pub fn use_loaded(&mut self, loaded: &Loaded) {
        self.board.use_loaded(loaded);
    }
}

/// Action of the caller after a message.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "handled at once, never kept")]
pub enum Action {
    /// Run this row.
    Run(Row),
    /// Send this. If there is an image, first give it to [`TickHandler::use_loaded`].
    Send(Message, Option<Loaded>),
    /// Replace the tick handler by this one, then send this reply.
    PowerOn(TickHandler, Reply),
    /// End.
    Stop,
}

/// The part that runs in the main loop: messages, and the flash banks.
#[derive(Debug)]
pub struct CommandHandler<F, T = NoKey> {
    banks: Banks<F>,
    gyro: Gyro,
    loops: LoopTable,
    upload: Upload<T>,
    reader: FrameReader,
}

impl<F: NorFlash> CommandHandler<F> {
    /// A handler for this gyro, without a key.
    pub const fn new(banks: Banks<F>, gyro: Gyro, loops: LoopTable) -> Self {
        Self::with_trust(banks, gyro, loops, NoKey)
    }
}

impl<F: NorFlash, T: Trust> CommandHandler<F, T> {
    /// A handler for this gyro and what it trusts.
    pub const fn with_trust(banks: Banks<F>, gyro: Gyro, loops: LoopTable, trust: T) -> Self {
        Self { banks, gyro, loops, upload: Upload::new(trust), reader: FrameReader::new() }
    }

    /// Power-on: starts the image of the banks, and a tick handler on a rig with these settings.
    #[inline(never)]
    pub fn power_on(&mut self, settings: RigSettings) -> (TickHandler, Reply) {
        let loaded = self.banks.start(&self.gyro, 0);
        let dithered = (settings.dither_counts > 0).then(|| Stripper::new(LONGEST_DITHER_TICKS, LEAST_SWING));
        let setup = BoardSetup { loops: self.loops, stripper: dithered, watch: None, frame_ticks: FRAME_TICKS };
        let mut board = Board::new(StartCause::PowerOn, loaded.image, loaded.origin, &setup, Rig::LEVELS);
        board.use_loaded(&loaded);
        let reply = self.upload.power_on(&loaded);
        (TickHandler { board, rig: Rig::new(settings), actuators: ActuatorCodes::default() }, reply)
    }

    /// Takes one byte from the serial line. Returns an action if a message ends with this byte.
    pub fn receive(&mut self, byte: u8) -> Option<Action> {
        let frame = self.reader.push(byte)?;
        self.handle(&frame)
    }

    /// The line has been quiet for longer than a sender pauses within a frame: what was begun belongs to no frame. Whole frames that a
    /// damaged one before them held back are handled now, one a call; call it until it returns `None`.
    pub fn quiet(&mut self) -> Option<Action> {
        let frame = self.reader.next_quiet()?;
        self.handle(&frame)
    }

    /// The axis letter of this gyro, for the frames that it sends.
    pub const fn axis(&self) -> u8 {
        self.gyro.axis
    }

    fn handle(&mut self, frame: &Frame) -> Option<Action> {
        match Message::parse(frame).filter(|_| frame.is_for(self.gyro.axis))? {
            Message::Row(row) => Some(Action::Run(row)),
            Message::Settings(settings) => {
                let (ticks, reply) = self.power_on(settings);
                Some(Action::PowerOn(ticks, reply))
            }
            Message::Stop => Some(Action::Stop),
            other => {
                let handled = self.upload.handle(&other, &mut self.banks, &self.gyro)?;
                Some(Action::Send(handled.message, handled.loaded))
            }
        }
    }
}

/// Both halves in one loop, for the host: bytes in, bytes out, until the input ends or a stop message arrives.
///
/// The firmware must produce the same bytes.
pub fn run<F: NorFlash, T: Trust>(
    handler: &mut CommandHandler<F, T>,
    input: impl Iterator<Item = u8>,
    mut out: impl FnMut(&[u8]),
) {
    let axis = handler.axis();
    let mut send = |message: Message| {
        if let Some(frame) = message.frame() {
            let (bytes, len) = frame.of_axis(axis).bytes();
            out(bytes.get(..len).unwrap_or(&[]));
        }
    };
    let (mut ticks, reply) = handler.power_on(RigSettings::default());
    send(Message::Reply(reply));
    for byte in input {
        match handler.receive(byte) {
            None => {}
            Some(Action::Run(row)) => {
                ticks.start_row(row);
                while ticks.ticks_left() > 0 {
                    if let Some(output) = ticks.tick() {
                        send(Message::Output(output));
                    }
                }
            }
            Some(Action::Send(message, loaded)) => {
                if let Some(loaded) = loaded {
                    ticks.use_loaded(&loaded);
                }
                send(message);
            }
            Some(Action::PowerOn(new, reply)) => {
                ticks = new;
                send(Message::Reply(reply));
            }
            Some(Action::Stop) => return,
        }
    }
}
