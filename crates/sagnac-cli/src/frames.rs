//! `sagnac frames`: what a gyro said on its serial line, as CSV.

use std::io::{BufReader, Read, Write};
use std::path::PathBuf;

use sagnac::{Error, Result};
use sagnac_board::frame::FrameReader;
use sagnac_board::{ANSWER, COMMIT, CONFIRM, Message, Output, PIECE, POWER_ON, ROLL_BACK, Reply, ReplyCode, SERVICE};
use sagnac_core::{Origin, Status};
use sagnac_log::ingest::hex;
use sagnac_log::write::write_atomically;
use sagnac_loops::{IntensityStatus, PathLengthStatus};

use crate::console::{Console, Outcome, Ran};
use crate::files::Files;
use crate::loading;
use crate::pipe::PipeAware;

const HEADER: &str =
    "sequence,tick,time_s,counts,raw,status,path_length,intensity,actuator,current,thermometer_code,lost_steps,image\n";

/// Read the frames of a gyro's serial line (docs/reference/serial-line.md) and write them as CSV
///
/// Damaged and missing frames are counted; the gyro's replies are printed on standard error. Standard output gets each
/// frame as a row at once, so that a live line may be ended with Ctrl-C; a file of -o is written at the end.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac frames captured.bin -o frames.csv
  sagnac frames < /dev/ttyUSB0")]
pub(crate) struct Args {
    /// Bytes of the line; standard input by default
    #[arg(default_value = "-")]
    input: PathBuf,
    /// CSV to write; standard output by default
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Length of a tick, µs
    #[arg(long, default_value_t = 100.0)]
    tick_us: f64,
}

/// Findings besides the rows.
#[derive(Default)]
struct Tally {
    outputs: u64,
    /// Replies and challenges, as lines.
    answers: Vec<String>,
    others: u64,
    missing: u64,
    /// Places where the frames' count or clock jumps by more than lost frames explain.
    breaks: u64,
    damaged_bytes: u64,
    last: Option<Output>,
    /// Ticks since power-on, beyond the 32 bits of a frame.
    ticks: u64,
}

/// Largest number of answers that are listed one by one.
const MOST_ANSWERS: usize = 100;

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    if !(args.tick_us > 0.0 && args.tick_us <= 1e6) {
        return Err(Error::input("must be above 0 and at most a million")
            .column("--tick-us")
            .value(args.tick_us.to_string()));
    }
    Files::new().reads([&args.input]).writes(&args.output).check()?;
    args.output.iter().try_for_each(|path| loading::check_output_name(path, "CSV"))?;
    let mut tally = Tally::default();
    match &args.output {
        Some(path) => {
            write_atomically(path, |out| pour(args, &mut tally, out)).map_err(|e| e.file(path.display().to_string()))?
        }
        None => {
            let mut out = PipeAware::new(std::io::stdout());
            let poured = pour(args, &mut tally, &mut out);
            if !out.closed() {
                poured?;
            }
        }
    }
    report(&tally, console)
}

fn report(tally: &Tally, console: &mut Console) -> Ran {
    for answer in &tally.answers {
        console.note(answer);
    }
    console.note(format!("{} output frames, {} missing between them", tally.outputs, tally.missing));
    if tally.breaks > 0 {
        console.note(format!("{} times count or clock jump: restarts, or frames twice or in disorder", tally.breaks));
    }
    if tally.damaged_bytes > 0 {
        console.note(format!("{} bytes belong to no frame: damaged or of another sender", tally.damaged_bytes));
    }
    if tally.others > 0 {
        console.note(format!("{} frames of other kinds", tally.others));
    }
    Ok(Outcome::Done)
}

fn words_of(reply: &Reply) -> String {
    let what = match reply.to {
        POWER_ON => "power-on",
        PIECE => "piece of an image",
        COMMIT => "commit of an image",
        ROLL_BACK => "roll back",
        CONFIRM => "confirmation",
        SERVICE => "service mode",
        ANSWER => "answer to a challenge",
        _ => "message",
    };
    let became = match reply.code {
        ReplyCode::Done => "done",
        ReplyCode::NotAnImage => "refused: not an image, or damaged",
        ReplyCode::Mismatch => "refused: for another gyro, or beyond its limits",
        ReplyCode::NotNewer => "refused: not newer than the active image",
        ReplyCode::NoOlderImage => "refused: no older image to go back to",
        ReplyCode::Flash => "failed: flash",
        ReplyCode::BadPiece => "refused: beyond the longest image",
        ReplyCode::Locked => "refused: the service mode is closed",
        ReplyCode::Unsigned => "refused: not signed, and this gyro has a key",
        ReplyCode::BadSignature => "refused: the signature does not match, or is by another key",
        ReplyCode::NotOnTrial => "refused: no image is on trial",
    };
    let trial = if reply.trial { ", on trial: confirm it" } else { "" };
    match reply.sequence {
        0 => format!("{what}: {became}; factory defaults active"),
        number if reply.origin == Origin::Survivor => {
            format!(
                "{what}: {became}; image {number} active, the only usable one: the other bank is damaged or not for this gyro"
            )
        }
        number => format!("{what}: {became}; image {number} active{trial}"),
    }
}

fn pour(args: &Args, tally: &mut Tally, out: &mut dyn Write) -> Result<()> {
    let input = &args.input;
    let failed = |e: &std::io::Error| Error::io_path(input, "read", e);
    let mut bytes: Box<dyn Read> = if input.as_os_str() == "-" {
        Box::new(std::io::stdin())
    } else {
        Box::new(std::fs::File::open(input).map_err(|e| Error::io_path(input, "open", &e))?)
    };
    let written = |e: &std::io::Error| Error::io("output", "write", e);
    out.write_all(HEADER.as_bytes()).map_err(|e| written(&e))?;
    let mut reader = FrameReader::new();
    let mut block = [0; 1 << 16];
    let mut source = BufReader::new(&mut bytes);
    loop {
        let have = source.read(&mut block).map_err(|e| failed(&e))?;
        if have == 0 {
            break;
        }
        for byte in &block[..have] {
            let mut frame = reader.push(*byte);
            while let Some(found) = frame {
                if let Some(row) = tally.take(&found, args.tick_us) {
                    out.write_all(row.as_bytes()).map_err(|e| written(&e))?;
                }
                frame = reader.next_buffered();
            }
        }
    }
    tally.damaged_bytes = reader.skipped() + reader.buffered() as u64;
    if tally.outputs == 0 && tally.answers.is_empty() {
        let error = Error::input("holds no frame of a gyro").help("docs/reference/serial-line.md has the format");
        return Err(error.file(input.display().to_string()));
    }
    out.flush().map_err(|e| written(&e))
}

/// A gap of more frames than this, five minutes, is a restart or a disorder.
const LONGEST_GAP: u16 = 1 << 15;

impl Tally {
    /// Counts the frames missing before an output and advances the clock.
    fn follow(&mut self, output: &Output) {
        let Some(last) = self.last.replace(*output) else {
            self.ticks = output.tick.into();
            return;
        };
        let gap = output.sequence.wrapping_sub(last.sequence).wrapping_sub(1);
        let moved = output.tick.wrapping_sub(last.tick);
        if gap < LONGEST_GAP && moved < 1 << 31 {
            self.missing += u64::from(gap);
            self.ticks += u64::from(moved);
        } else {
            self.breaks += 1;
            self.ticks = output.tick.into();
        }
    }

    fn note(&mut self, line: String) {
        if self.answers.len() < MOST_ANSWERS {
            self.answers.push(line);
        }
    }

    /// Counts a frame; the row of an output.
    fn take(&mut self, frame: &sagnac_board::frame::Frame, tick_us: f64) -> Option<String> {
        match Message::parse(frame) {
            Some(Message::Output(output)) => {
                self.outputs += 1;
                self.follow(&output);
                Some(row(&output, self.ticks, tick_us))
            }
            Some(Message::Reply(reply)) => {
                if reply.to == POWER_ON {
                    // Power-on begins a new count.
                    self.last = None;
                }
                if !(reply.to == PIECE && reply.code == ReplyCode::Done) {
                    self.note(words_of(&reply));
                }
                None
            }
            Some(Message::Challenge(challenge)) => {
                self.note(format!("challenge {}", hex(&challenge)));
                None
            }
            _ => {
                self.others += 1;
                None
            }
        }
    }
}

/// Where the image comes from, as a word.
fn origin_word(origin: Origin) -> &'static str {
    match origin {
        Origin::Newest => "newest",
        Origin::Survivor => "survivor",
        Origin::FactoryDefaults => "factory defaults",
    }
}

fn row(o: &Output, ticks: u64, tick_us: f64) -> String {
    let time_s = ticks as f64 * tick_us * 1e-6;
    let status =
        names(Status::NAMES.iter().chain(&Status::BOARD_NAMES).map(|(bit, name)| (bit.bits(), *name)), o.status.bits());
    let path = PathLengthStatus::NAMES.iter().map(|(bit, name)| (bit.bits().into(), *name));
    let light = IntensityStatus::NAMES.iter().map(|(bit, name)| (bit.bits().into(), *name));
    let thermometer = o.temperature.map_or(String::new(), |code| code.to_string());
    let image = if o.trial { "on trial" } else { origin_word(o.origin) };
    let (path, light) = (names(path, o.path_status.into()), names(light, o.light_status.into()));
    format!(
        "{},{ticks},{time_s:.6},{},{},{status},{path},{light},{},{},{thermometer},{},{image}\n",
        o.sequence, o.counts, o.raw, o.actuator, o.current, o.lost_steps
    )
}

/// Names of the bits that are set, joined; bits without a name as a number.
fn names<'a>(all: impl Iterator<Item = (u16, &'a str)>, bits: u16) -> String {
    let (mut set, mut left) = (Vec::new(), bits);
    for (bit, name) in all.filter(|(bit, _)| bits & bit != 0) {
        set.push(name.to_owned());
        left &= !bit;
    }
    if left != 0 {
        set.push(format!("0x{left:x}"));
    }
    if set.is_empty() { "OK".to_owned() } else { set.join("+") }
}
