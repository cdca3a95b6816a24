//! Around the board: power-on from the flash banks, and what each message of the line does.
//!
//! [`Desk`] belongs to the main loop (it may touch flash), [`Line`] to the tick's interrupt. A message is handled when
//! the rows before it have run out, so the same bytes in give the same bytes out, however the two take turns.

use embedded_storage::nor_flash::NorFlash;
use sagnac_core::{Banks, Gyro, Loaded};
use sagnac_loops::LoopTable;

use crate::board::{Board, Commands};
use crate::frame::{Frame, Reader};
use crate::message::{Message, Output, POWER_ON, Reply, ReplyCode, RigSettings, Row};
use crate::rig::Rig;
use crate::upload::Upload;

/// Longest period of a dithered gyro, ticks: 200 Hz at 100 µs.
const LONGEST_DITHER_TICKS: u16 = 50;

/// What runs in the tick's interrupt: the board, and the rig that it sees.
#[derive(Clone, Debug)]
pub struct Line {
    board: Board,
    rig: Rig,
    commands: Commands,
}

impl Line {
    /// Ticks of the row to go.
    pub const fn left(&self) -> u32 {
        self.rig.left()
    }

    /// Begins a row; the one before must have run out.
    pub fn begin(&mut self, row: Row) {
        self.rig.begin(row);
    }

    /// One tick, if there is a row for it.
    #[inline]
    pub fn tick(&mut self) -> Option<Output> {
        if self.rig.left() == 0 {
            return None;
        }
        let (levels, sample) = self.rig.tick(&self.commands);
        let (commands, output) = self.board.tick(levels, &sample);
        self.commands = commands;
        output
    }

    /// Goes on with what flash holds, between two ticks; with the image that runs already nothing changes.
    pub fn take_over(&mut self, loaded: &Loaded) {
        if loaded.image != *self.board.image() {
            self.board.take_over(loaded.image, loaded.origin);
        }
    }
}

/// What a message asks of the caller.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "handled at once, never kept")]
pub enum Asked {
    /// Run this row.
    Run(Row),
    /// Give this answer; where there is an image, the line takes it over first.
    Answer(Reply, Option<Loaded>),
    /// Put this line in the place of the old one, then give this answer.
    PowerOn(Line, Reply),
    /// The end.
    Stop,
}

/// What the main loop holds.
#[derive(Debug)]
pub struct Desk<F> {
    banks: Banks<F>,
    gyro: Gyro,
    loops: LoopTable,
    upload: Upload,
    reader: Reader,
}

impl<F: NorFlash> Desk<F> {
    /// A desk for this gyro.
    pub const fn new(banks: Banks<F>, gyro: Gyro, loops: LoopTable) -> Self {
        Self { banks, gyro, loops, upload: Upload::new(), reader: Reader::new() }
    }

    /// Power-on: what the banks hold, on a rig with these settings.
    pub fn power_on(&mut self, settings: RigSettings) -> (Line, Reply) {
        let loaded = self.banks.load(&self.gyro);
        let dithered = (settings.dither_counts > 0).then_some(LONGEST_DITHER_TICKS);
        let board = Board::new(loaded.image, loaded.origin, &self.loops, Rig::LEVELS, dithered);
        let reply = Reply { to: POWER_ON, code: ReplyCode::Done, sequence: loaded.image.description().sequence };
        (Line { board, rig: Rig::new(settings), commands: Commands::default() }, reply)
    }

    /// A byte of the line; what it asks for, if a message ends with it.
    pub fn take(&mut self, byte: u8) -> Option<Asked> {
        let frame = self.reader.take(byte)?;
        self.handle(&frame)
    }

    fn handle(&mut self, frame: &Frame) -> Option<Asked> {
        match Message::of(frame)? {
            Message::Row(row) => Some(Asked::Run(row)),
            Message::Settings(settings) => {
                let (line, reply) = self.power_on(settings);
                Some(Asked::PowerOn(line, reply))
            }
            Message::Stop => Some(Asked::Stop),
            other => {
                let (reply, loaded) = self.upload.handle(&other, &mut self.banks, &self.gyro)?;
                Some(Asked::Answer(reply, loaded))
            }
        }
    }
}

/// The whole line on this machine: bytes in, bytes out, until they end or a stop is asked for.
///
/// This is what the firmware must equal.
pub fn run<F: NorFlash>(desk: &mut Desk<F>, input: impl Iterator<Item = u8>, mut out: impl FnMut(&[u8])) {
    let mut say = |message: Message| {
        if let Some(frame) = message.frame() {
            let (bytes, len) = frame.bytes();
            out(bytes.get(..len).unwrap_or(&[]));
        }
    };
    let (mut line, reply) = desk.power_on(RigSettings::default());
    say(Message::Reply(reply));
    for byte in input {
        match desk.take(byte) {
            None => {}
            Some(Asked::Run(row)) => {
                line.begin(row);
                while line.left() > 0 {
                    if let Some(output) = line.tick() {
                        say(Message::Output(output));
                    }
                }
            }
            Some(Asked::Answer(reply, loaded)) => {
                if let Some(loaded) = loaded {
                    line.take_over(&loaded);
                }
                say(Message::Reply(reply));
            }
            Some(Asked::PowerOn(new, reply)) => {
                line = new;
                say(Message::Reply(reply));
            }
            Some(Asked::Stop) => return,
        }
    }
}
