//! `sagnac frames`: what a gyro said on its serial line, as CSV.

use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};

use sagnac::write::write_atomically;
use sagnac::{Error, Result};
use sagnac_board::frame::Reader;
use sagnac_board::{Message, Output, Reply, ReplyCode};
use sagnac_core::Status;
use sagnac_loops::{IntensityStatus, PathLengthStatus};

use crate::console::{Console, Outcome, Ran};
use crate::pipe::PipeAware;

const HEADER: &str =
    "sequence,tick,time_s,counts,raw,status,path_length,intensity,actuator,current,temperature,lost_steps\n";

/// Read the frames of a gyro's serial line (docs/serial-line.md) and write them as CSV
///
/// Damaged and missing frames are counted; what the gyro answered is told on standard error.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac frames captured.bin -o frames.csv
  sagnac frames < /dev/ttyUSB0")]
pub(crate) struct Args {
    /// Bytes of the line; standard input unless told
    #[arg(default_value = "-")]
    input: PathBuf,
    /// CSV to write; standard output unless told
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Length of a tick, µs
    #[arg(long, default_value_t = 100.0)]
    tick_us: f64,
}

/// What was found beside the rows.
#[derive(Default)]
struct Tally {
    outputs: u64,
    answers: Vec<Reply>,
    others: u64,
    missing: u64,
    damaged_bytes: u64,
    last: Option<u16>,
}

/// As many answers are told one by one.
const MOST_ANSWERS: usize = 100;

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    if !(args.tick_us > 0.0 && args.tick_us <= 1e6) {
        return Err(Error::input("must be above 0 and at most a million")
            .column("--tick-us")
            .value(args.tick_us.to_string()));
    }
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
    tell(&tally, &args.input, console)
}

fn tell(tally: &Tally, input: &Path, console: &mut Console) -> Ran {
    for answer in &tally.answers {
        console.note(words_of(answer));
    }
    if tally.outputs == 0 && tally.answers.is_empty() {
        return Err(Error::input("holds no frame")
            .file(input.display().to_string())
            .help("docs/serial-line.md has the format"));
    }
    console.note(format!("{} output frames, {} missing between them", tally.outputs, tally.missing));
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
        0 => "power-on",
        0x20 => "piece of an image",
        0x21 => "commit of an image",
        0x22 => "roll back",
        _ => "message",
    };
    let became = match reply.code {
        ReplyCode::Done => "done",
        ReplyCode::NotAnImage => "refused: not an image, or damaged",
        ReplyCode::Unfit => "refused: for another gyro, or beyond what this one can need",
        ReplyCode::NotNewer => "refused: not newer than the image in force",
        ReplyCode::NothingToGoBackTo => "refused: no older image to go back to",
        ReplyCode::Flash => "failed: flash",
        ReplyCode::Pieces => "refused: outside of an image's room",
    };
    match reply.sequence {
        0 => format!("{what}: {became}; factory defaults in force"),
        number => format!("{what}: {became}; image {number} in force"),
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
    let mut reader = Reader::new();
    let mut block = [0; 1 << 16];
    let mut source = BufReader::new(&mut bytes);
    loop {
        let have = source.read(&mut block).map_err(|e| failed(&e))?;
        if have == 0 {
            break;
        }
        for byte in &block[..have] {
            let mut frame = reader.take(*byte);
            while let Some(found) = frame {
                if let Some(row) = tally.take(&found, args.tick_us) {
                    out.write_all(row.as_bytes()).map_err(|e| written(&e))?;
                }
                frame = reader.next_held();
            }
        }
    }
    tally.damaged_bytes = reader.skipped() + reader.pending() as u64;
    out.flush().map_err(|e| written(&e))
}

impl Tally {
    /// Counts a frame; the row of an output.
    fn take(&mut self, frame: &sagnac_board::frame::Frame, tick_us: f64) -> Option<String> {
        match Message::of(frame) {
            Some(Message::Output(output)) => {
                self.outputs += 1;
                if let Some(last) = self.last.replace(output.sequence) {
                    self.missing += u64::from(output.sequence.wrapping_sub(last).wrapping_sub(1));
                }
                Some(row(&output, tick_us))
            }
            Some(Message::Reply(reply)) => {
                if reply.to == 0 {
                    // Power-on begins a new count.
                    self.last = None;
                }
                if self.answers.len() < MOST_ANSWERS && !(reply.to == 0x20 && reply.code == ReplyCode::Done) {
                    self.answers.push(reply);
                }
                None
            }
            _ => {
                self.others += 1;
                None
            }
        }
    }
}

fn row(o: &Output, tick_us: f64) -> String {
    let time_s = f64::from(o.tick) * tick_us * 1e-6;
    let path = names(PathLengthStatus::NAMES.iter().map(|(bit, name)| (bit.bits(), *name)), o.path_status);
    let light = names(IntensityStatus::NAMES.iter().map(|(bit, name)| (bit.bits(), *name)), o.light_status);
    let status: Vec<&str> =
        Status::NAMES.iter().filter(|(bit, _)| o.status.contains(*bit)).map(|(_, name)| *name).collect();
    let status = if status.is_empty() { "OK".to_owned() } else { status.join("+") };
    format!(
        "{},{},{time_s:.6},{},{},{status},{path},{light},{},{},{},{}\n",
        o.sequence, o.tick, o.counts, o.raw, o.actuator, o.current, o.temperature, o.lost_steps
    )
}

fn names<'a>(all: impl Iterator<Item = (u8, &'a str)>, bits: u8) -> String {
    let set: Vec<&str> = all.filter(|(bit, _)| bits & bit != 0).map(|(_, name)| name).collect();
    if set.is_empty() { "OK".to_owned() } else { set.join("+") }
}
