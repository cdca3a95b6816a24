//! The two halves of a board's program: the tick's interrupt and the main loop.
//!
//! [`TickHandler`] runs in the interrupt and never waits. [`CommandHandler`] runs in the main loop: it reads messages
//! and may write flash. A message is handled when the rows before it have ended, so the same bytes in give the same
//! bytes out, for any timing of the two.

use embedded_storage::nor_flash::NorFlash;
use sagnac_core::{Banks, Gyro, Loaded};
use sagnac_loops::{LoopTable, Stripper};

use crate::board::{ActuatorCodes, Board};
use crate::frame::{Frame, FrameReader};
use crate::message::{Message, Output, POWER_ON, Reply, ReplyCode, RigSettings, Row};
use crate::rig::Rig;
use crate::upload::Upload;

/// Longest period of a dithered gyro, ticks: 200 Hz at 100 µs.
const LONGEST_DITHER_TICKS: u16 = 50;
/// A quarter of the amplitude of the rig's pickoff.
const LEAST_SWING: u32 = 1 << 23;

/// The part that runs in the tick's interrupt: the board, and the rig in place of its gyro.
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
    pub fn tick(&mut self) -> Option<Output> {
        if self.rig.ticks_left() == 0 {
            return None;
        }
        let (levels, sample) = self.rig.tick(&self.actuators);
        let (actuators, output) = self.board.tick(levels, &sample);
        self.actuators = actuators;
        output
    }

    /// Continues with the image that flash holds, between two ticks. Does nothing if that image is already running.
    pub fn use_image(&mut self, loaded: &Loaded) {
        if loaded.image != *self.board.image() {
            self.board.use_image(loaded.image, loaded.origin);
        }
    }
}

/// Action of the caller after a message.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "handled at once, never kept")]
pub enum Action {
    /// Run this row.
    Run(Row),
    /// Send this reply. If there is an image, first give it to [`TickHandler::use_image`].
    Reply(Reply, Option<Loaded>),
    /// Replace the tick handler by this one, then send this reply.
    PowerOn(TickHandler, Reply),
    /// End.
    Stop,
}

/// The part that runs in the main loop: messages, and the flash banks.
#[derive(Debug)]
pub struct CommandHandler<F> {
    banks: Banks<F>,
    gyro: Gyro,
    loops: LoopTable,
    upload: Upload,
    reader: FrameReader,
}

impl<F: NorFlash> CommandHandler<F> {
    /// A handler for this gyro.
    pub const fn new(banks: Banks<F>, gyro: Gyro, loops: LoopTable) -> Self {
        Self { banks, gyro, loops, upload: Upload::new(), reader: FrameReader::new() }
    }

    /// Power-on: loads the image from the banks and starts a tick handler on a rig with these settings.
    pub fn power_on(&mut self, settings: RigSettings) -> (TickHandler, Reply) {
        let loaded = self.banks.load(&self.gyro);
        let dithered = (settings.dither_counts > 0).then(|| Stripper::new(LONGEST_DITHER_TICKS, LEAST_SWING));
        let board = Board::new(loaded.image, loaded.origin, &self.loops, Rig::LEVELS, dithered);
        let reply = Reply::new(POWER_ON, ReplyCode::Done, &loaded);
        (TickHandler { board, rig: Rig::new(settings), actuators: ActuatorCodes::default() }, reply)
    }

    /// Takes one byte from the serial line. Returns an action if a message ends with this byte.
    pub fn receive(&mut self, byte: u8) -> Option<Action> {
        let frame = self.reader.push(byte)?;
        self.handle(&frame)
    }

    fn handle(&mut self, frame: &Frame) -> Option<Action> {
        match Message::parse(frame)? {
            Message::Row(row) => Some(Action::Run(row)),
            Message::Settings(settings) => {
                let (ticks, reply) = self.power_on(settings);
                Some(Action::PowerOn(ticks, reply))
            }
            Message::Stop => Some(Action::Stop),
            other => {
                let (reply, loaded) = self.upload.handle(&other, &mut self.banks, &self.gyro)?;
                Some(Action::Reply(reply, loaded))
            }
        }
    }
}

/// Both halves in one loop, for the host: bytes in, bytes out, until the input ends or a stop message arrives.
///
/// The firmware must produce the same bytes.
pub fn run<F: NorFlash>(handler: &mut CommandHandler<F>, input: impl Iterator<Item = u8>, mut out: impl FnMut(&[u8])) {
    let mut send = |message: Message| {
        if let Some(frame) = message.frame() {
            let (bytes, len) = frame.bytes();
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
            Some(Action::Reply(reply, loaded)) => {
                if let Some(loaded) = loaded {
                    ticks.use_image(&loaded);
                }
                send(Message::Reply(reply));
            }
            Some(Action::PowerOn(new, reply)) => {
                ticks = new;
                send(Message::Reply(reply));
            }
            Some(Action::Stop) => return,
        }
    }
}
