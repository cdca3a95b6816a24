//! The firmware in QEMU behind a TCP serial line, which this program owns as a serial server does.
//!
//! ```text
//! rows of the chamber, uploads ─▶ line ─▶ firmware ─▶ line ─┬▶ frames, replies
//!                                                           └▶ tap: every byte as it is, to the bench
//! ```
//!
//! Few rows are on their way at a time: so nobody waits for room that only the other side can make.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use sagnac_board::frame::{Frame, FrameReader, MAX_FRAME};
use sagnac_board::{Message, OutputFrame, POWER_ON, Reply, RigSettings, Row};
use xtask::shell::text;

use super::process::Running;
use super::units::FRAME_TICKS;

/// How long the target may say nothing.
const SILENT: Duration = Duration::from_secs(60);
/// Frames of the rows that are on their way at most.
const AHEAD: u16 = 64;
/// Frames on their way while a message is answered: one row runs, one waits.
const ENOUGH: u16 = 2;
/// Bytes that are read at once: at most 100 frames.
const PIECE: usize = 4096;
/// Frames of the row in which the line is cut: more than are read before it is.
const CUT_FRAMES: u32 = 500;

/// The target.
pub(super) struct BoardInQemu {
    qemu: Running,
    address: String,
    line: TcpStream,
    reader: FrameReader,
    /// Who else gets the bytes.
    pub(super) tap: Option<TcpStream>,
    /// Frames since power-on of all rows that were sent.
    due: u16,
    /// Frames since power-on that came or were lost.
    heard: u16,
    /// Frames since power-on that came, and the answers that nobody has taken.
    pub(super) outputs: Vec<OutputFrame>,
    replies: VecDeque<Reply>,
}

impl BoardInQemu {
    /// Starts the emulator and connects; the firmware starts then.
    pub(super) fn start(program: &Path) -> Result<(Self, Reply)> {
        let machine = ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none"];
        let hosting = ["-semihosting-config", "enable=on,target=native", "-kernel", text(program)?];
        let line = ["-chardev", "socket,id=line,host=127.0.0.1,port=0,server=on,wait=on", "-serial", "chardev:line"];
        // The emulated clock jumps to the next tick as soon as the processor waits.
        let clock = ["-icount", "shift=5,sleep=off"];
        let mut command = Command::new("qemu-system-arm");
        let qemu = Running::start("qemu-system-arm", command.args([&machine[..], &hosting, &line, &clock].concat()))?;
        let waiting = qemu.line(SILENT)?;
        let address = waiting.split_once("disconnected:tcp:").and_then(|(_, rest)| rest.split_once(','));
        let (address, _) = address.with_context(|| format!("no port in what qemu-system-arm says: {waiting}"))?;
        let mut target = Self {
            qemu,
            line: connect(address)?,
            address: address.to_owned(),
            reader: FrameReader::new(),
            tap: None,
            due: 0,
            heard: 0,
            outputs: Vec::new(),
            replies: VecDeque::new(),
        };
        let reply = target.reply(POWER_ON)?;
        Ok((target, reply))
    }

    /// Switches it off and on, with this gyro. No row may run.
    pub(super) fn power_on(&mut self, settings: RigSettings) -> Result<Reply> {
        ensure!(self.waiting() == 0, "the target is switched off while a row runs");
        self.send(&Message::Settings(settings))?;
        (self.due, self.heard) = (0, 0);
        self.outputs.clear();
        self.reply(POWER_ON)
    }

    /// Runs rows to their end.
    pub(super) fn run(&mut self, rows: &[Row]) -> Result<()> {
        for row in rows {
            while self.waiting() >= AHEAD {
                self.hear()?;
            }
            self.row(row)?;
        }
        self.idle()
    }

    /// Sends a message while rows run; the answer.
    pub(super) fn ask(&mut self, message: &Message, soak: &Row) -> Result<Reply> {
        self.keep_running(soak)?;
        self.send(message)?;
        self.answer(message, soak)
    }

    /// Sends bytes as they are, while rows run.
    pub(super) fn say(&mut self, bytes: &[u8], soak: &Row) -> Result<()> {
        self.keep_running(soak)?;
        self.line.write_all(bytes).context("the target's line")
    }

    /// Cuts the line behind these bytes, while a row runs, and connects it again. What the target says in between is lost.
    pub(super) fn cut_behind(&mut self, begun: &[u8], soak: &Row) -> Result<()> {
        self.idle()?;
        let before = self.outputs.len();
        self.row(&Row { ticks: CUT_FRAMES * FRAME_TICKS, ..*soak })?;
        while self.outputs.len() == before {
            self.hear()?;
        }
        self.line.write_all(begun).context("the target's line")?;
        ensure!(self.waiting() > 0, "the row has ended before the line was cut");
        self.line.shutdown(Shutdown::Both).context("the target's line")?;
        self.line = connect(&self.address)?;
        self.reader = FrameReader::new();
        // What was begun before the cut ends here; these bytes are in no frame.
        self.line.write_all(&[0; MAX_FRAME]).context("the target's line")?;
        self.row(soak)
    }

    /// Waits until all rows have run.
    pub(super) fn idle(&mut self) -> Result<()> {
        while self.waiting() > 0 {
            self.hear()?;
        }
        Ok(())
    }

    /// Ends the emulation; what the firmware said.
    pub(super) fn stop(mut self) -> Result<String> {
        self.idle()?;
        self.send(&Message::Stop)?;
        self.qemu.end(SILENT)
    }

    /// Frames on their way.
    fn waiting(&self) -> u16 {
        self.due - self.heard
    }

    fn keep_running(&mut self, soak: &Row) -> Result<()> {
        while self.waiting() < ENOUGH {
            self.row(soak)?;
        }
        Ok(())
    }

    fn row(&mut self, row: &Row) -> Result<()> {
        let frames = u16::try_from(row.ticks / FRAME_TICKS).context("a row of so many frames")?;
        self.due = self.due.checked_add(frames).context("more rows than a power-on has numbers of frames")?;
        self.send(&Message::Row(*row))
    }

    fn send(&mut self, message: &Message) -> Result<()> {
        self.line.write_all(&bytes_of(message)?).context("the target's line")
    }

    /// The answer to a message, while rows run.
    fn answer(&mut self, message: &Message, soak: &Row) -> Result<Reply> {
        while self.replies.is_empty() {
            self.keep_running(soak)?;
            self.hear()?;
        }
        self.reply(message.kind())
    }

    /// The next reply, which must be to this.
    fn reply(&mut self, to: u8) -> Result<Reply> {
        loop {
            if let Some(reply) = self.replies.pop_front() {
                ensure!(reply.to == to, "an answer to {to:#x} is due, and this is {reply:?}");
                return Ok(reply);
            }
            self.hear()?;
        }
    }

    /// Takes what has come, and passes it on.
    fn hear(&mut self) -> Result<()> {
        let mut bytes = [0; PIECE];
        let said =
            || format!("the target has said nothing for {SILENT:?}; {} frames are due, {} came", self.due, self.heard);
        let read = self.line.read(&mut bytes).with_context(said)?;
        ensure!(read > 0, "the target has closed its line");
        let bytes = bytes.get(..read).unwrap_or(&[]);
        if let Some(tap) = &mut self.tap {
            tap.write_all(bytes).context("the bench has closed its line")?;
        }
        for byte in bytes {
            let mut frame = self.reader.push(*byte);
            while let Some(found) = frame {
                self.take(&found)?;
                frame = self.reader.next_buffered();
            }
        }
        Ok(())
    }

    fn take(&mut self, frame: &Frame) -> Result<()> {
        match Message::parse(frame) {
            Some(Message::Output(output)) => {
                self.heard = output.sequence.wrapping_add(1);
                self.outputs.push(output);
            }
            Some(Message::Reply(reply)) => self.replies.push_back(reply),
            other => bail!("an unexpected message of the target: {other:?}"),
        }
        Ok(())
    }
}

/// A message as bytes of the line.
pub(super) fn bytes_of(message: &Message) -> Result<Vec<u8>> {
    let (bytes, len) = message.frame().context("a message without a frame")?.bytes();
    Ok(bytes.get(..len).unwrap_or(&[]).to_vec())
}

fn connect(address: &str) -> Result<TcpStream> {
    let line = TcpStream::connect(address).with_context(|| format!("no serial line at {address}"))?;
    line.set_read_timeout(Some(SILENT)).context("the target's line")?;
    line.set_nodelay(true).context("the target's line")?;
    Ok(line)
}
