//! `sagnac line read`: what a gyro said on its serial line, as CSV.

use std::io::{BufReader, Read, Write};
use std::path::PathBuf;

use sagnac::{Error, Result};
use sagnac_bench::serial_line::{
    OutputClock, arcsec, axis_letter, image_words, intensity_words, is_piece_done, path_length_words, reply_words,
    status_words,
};
use sagnac_board::frame::{Frame, FrameReader};
use sagnac_board::{Message, OutputFrame, POWER_ON};
use sagnac_core::UNBOUNDED;
use sagnac_log::ingest::hex;
use sagnac_log::write::write_atomically;

use crate::files::loading;
use crate::files::pipe::PipeAware;
use crate::output::console::{Console, Outcome, Ran};
use crate::verbs::verb::Verb;

const HEADER: &str = "sequence,tick,time_s,counts,raw,status,path_length,intensity,actuator,current,thermometer_code,lost_steps,image,\
     angle_arcsec,error_dph,axis\n";

/// Read the frames of a gyro's serial line (docs/reference/serial-line.md) and write them as CSV
///
/// Counts damaged and missing frames, and prints the gyro's replies on standard error. Standard output gets each frame as a row at once,
/// so you can end a live line with Ctrl-C. A file of -o is written at the end.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac line read captured.bin -o frames.csv
  sagnac line read < /dev/ttyUSB0")]
pub(crate) struct Args {
    /// Received bytes; standard input by default
    #[arg(default_value = "-")]
    input: PathBuf,
    /// CSV to write; standard output by default
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Findings next to the rows.
#[derive(Default)]
struct FrameTally {
    outputs: u64,
    /// Replies and challenges, as lines.
    answers: Vec<String>,
    others: u64,
    /// Of each axis.
    clocks: [OutputClock; 4],
    damaged_bytes: u64,
}

/// Largest number of answers that are listed one by one.
const MOST_ANSWERS: usize = 100;

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        self.output.iter().try_for_each(|path| loading::check_output_name(path, "CSV"))?;
        let mut tally = FrameTally::default();
        match &self.output {
            Some(path) => write_atomically(path, |out| pour(self, &mut tally, out))
                .map_err(|e| e.file(path.display().to_string()))?,
            None => {
                let mut out = PipeAware::new(std::io::stdout());
                let poured = pour(self, &mut tally, &mut out);
                if !out.closed() {
                    poured?;
                }
            }
        }
        report(&tally, console)
    }
}

fn report(tally: &FrameTally, console: &mut Console) -> Ran {
    for answer in &tally.answers {
        console.note(answer);
    }
    let missing: u64 = tally.clocks.iter().map(|clock| clock.missing).sum();
    let breaks: u64 = tally.clocks.iter().map(|clock| clock.breaks).sum();
    console.note(format!("{} output frames, {missing} missing between them", tally.outputs));
    if breaks > 0 {
        console.note(format!("{breaks} times count or clock jump: restarts, or frames twice or in disorder"));
    }
    if tally.damaged_bytes > 0 {
        console.note(format!("{} bytes belong to no frame: damaged or of another sender", tally.damaged_bytes));
    }
    if tally.others > 0 {
        console.note(format!("{} frames of other kinds", tally.others));
    }
    Ok(Outcome::Done)
}

fn pour(args: &Args, tally: &mut FrameTally, out: &mut dyn Write) -> Result<()> {
    let input = &args.input;
    let failed = |e: &std::io::Error| Error::io_path(input, "read", e);
    let mut bytes: Box<dyn Read> = if input.as_os_str() == "-" {
        Box::new(std::io::stdin())
    } else {
        Box::new(sagnac_log::read::open_input(input).map_err(|e| Error::io_path(input, "open", &e))?)
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
            while let Some(bytes) = frame {
                if let Some(row) = tally.take(&bytes) {
                    out.write_all(row.as_bytes()).map_err(|e| written(&e))?;
                }
                frame = reader.next_buffered();
            }
        }
    }
    tally.damaged_bytes = reader.skipped() + reader.buffered() as u64;
    if tally.outputs == 0 && tally.answers.is_empty() {
        let error = Error::input(
            "the file contains no frame of a gyro",
            "give the bytes as received: docs/reference/serial-line.md describes a frame",
        );
        return Err(error.file(input.display().to_string()));
    }
    out.flush().map_err(|e| written(&e))
}

impl FrameTally {
    fn note(&mut self, line: String) {
        if self.answers.len() < MOST_ANSWERS {
            self.answers.push(line);
        }
    }

    /// Counts a frame; the row of an output.
    fn take(&mut self, frame: &Frame) -> Option<String> {
        let clock = self.clocks.get_mut(usize::from(frame.axis))?;
        match Message::parse(frame) {
            Some(Message::Output(output)) => {
                self.outputs += 1;
                clock.follow(&output);
                Some(row(&output, clock.ticks, axis_letter(frame)))
            }
            Some(Message::Reply(reply)) => {
                if reply.to == POWER_ON {
                    // Power-on begins a new count.
                    clock.power_on();
                }
                if !is_piece_done(&reply) {
                    self.note(of_axis(frame, &reply_words(&reply)));
                }
                None
            }
            Some(Message::Challenge(challenge)) => {
                self.note(of_axis(frame, &format!("challenge {}", hex(&challenge))));
                None
            }
            _ => {
                self.others += 1;
                None
            }
        }
    }
}

/// A gyro's words, with the axis if the frame has one.
fn of_axis(frame: &Frame, words: &str) -> String {
    match axis_letter(frame) {
        "" => words.to_owned(),
        axis => format!("axis {axis}: {words}"),
    }
}

fn row(o: &OutputFrame, ticks: u64, axis: &str) -> String {
    let time_s = ticks as f64 * f64::from(o.tick_ns) * 1e-9;
    let error_dph = match o.error_milli_dph {
        UNBOUNDED => String::new(),
        milli => format!("{}.{:03}", milli / 1000, milli % 1000),
    };
    let thermometer = o.temperature.map_or(String::new(), |code| code.to_string());
    format!(
        "{},{ticks},{time_s:.6},{},{},{},{},{},{},{},{thermometer},{},{},{},{error_dph},{axis}\n",
        o.sequence,
        o.counts,
        o.raw,
        status_words(o),
        path_length_words(o),
        intensity_words(o),
        o.actuator,
        o.current,
        o.lost_steps,
        image_words(o),
        arcsec(o.angle_nano_arcsec)
    )
}
