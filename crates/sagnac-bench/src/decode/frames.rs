//! Frames of a gyro's serial line to rows (docs/reference/serial-line.md).
//!
//! A row is a frame: counts before the correction, which are the log, next to those that the target corrected, its status, and the codes of its loops.
//!
//! A frame has the code that the slow update at its *beginning* read; the row of a log has what is known at its end. So a row waits for the next frame and
//! gets its code: `compensate` on the log then makes of each row what the target made of it. Where no frame follows, the row has its own frame's code.

use sagnac_board::frame::FrameReader;
use sagnac_board::{Message, OutputFrame, POWER_ON, Reply};
use sagnac_core::UNBOUNDED;
use sagnac_log::ingest::Content;
use sagnac_log::setup::{Setup, ThermometerSetup};
use sagnac_log::{Error, Result};

use crate::decode::clock::{ClockReport, RowClock};
use crate::decode::rows_made::Rows;
use crate::serial_line::{
    OutputClock, arcsec, axis_letter, image_words, intensity_words, is_piece_done, path_length_words, reply_words,
    status_words,
};

/// A source of frames.
pub(crate) struct Frames {
    reader: FrameReader,
    output: OutputClock,
    clock: RowClock,
    /// The axis of the setup; frames of another one are not its rows.
    axis: u8,
    others_said: bool,
    thermometer: Option<(f64, f64)>,
    skipped: u64,
    /// The newest row, and the ticks at its end.
    waiting: Option<Waiting>,
}

/// A row that waits for the code of the next frame.
struct Waiting {
    output: OutputFrame,
    ticks: u64,
    time_ns: i64,
    at_ns: i64,
}

impl Frames {
    pub(crate) fn new(setup: &Setup, rows: &mut Rows) -> Result<Self> {
        let axis = setup.axis.unwrap_or('x');
        let scale = |t: &ThermometerSetup| Some((t.offset_c?, t.gain_c_per_code?));
        let first = setup.thermometers.first();
        let thermometer = first.and_then(scale);
        let mut columns =
            vec![("time_ns".to_owned(), Content::Nanoseconds), (format!("counts_{axis}"), Content::Number)];
        if let Some(first) = first {
            if thermometer.is_none() {
                return Err(Error::input(
                    "frames contain thermometer codes, and the setup does not define them",
                    "set offset_c and gain_c_per_code under [[thermometer]]",
                )
                .column("thermometer"));
            }
            let name = if first.name.is_empty() { String::new() } else { format!("_{}", first.name) };
            columns.push((format!("temperature_c{name}"), Content::Number));
        }
        columns.extend(["target_angle_arcsec", "target_error_dph"].map(|name| (name.to_owned(), Content::Number)));
        let numbers = ["target_counts", "sequence", "actuator_code", "current_code", "lost_steps"];
        columns.extend(numbers.map(|name| (name.to_owned(), Content::Number)));
        let words = ["target_status", "path_length_status", "intensity_status", "image"];
        columns.extend(words.map(|name| (name.to_owned(), Content::Text)));
        rows.begin(columns, false);
        let axis = u8::try_from(axis).unwrap_or_default();
        let (reader, output, clock) = (FrameReader::new(), OutputClock::default(), RowClock::default());
        Ok(Self { reader, output, clock, axis, others_said: false, thermometer, skipped: 0, waiting: None })
    }

    pub(crate) fn connected(&mut self, rows: &mut Rows) {
        self.flush(rows);
        self.skipped += self.reader.skipped() + self.reader.buffered() as u64;
        self.reader = FrameReader::new();
        self.clock.connected();
    }

    pub(crate) fn push(&mut self, bytes: &[u8], at_ns: i64, rows: &mut Rows) {
        for byte in bytes {
            let mut frame = self.reader.push(*byte);
            while let Some(bytes) = frame {
                let is_own = bytes.is_for(self.axis);
                if !is_own && !self.others_said {
                    self.others_said = true;
                    let (theirs, own) = (axis_letter(&bytes), char::from(self.axis));
                    rows.say(at_ns, format!("the line has frames of axis {theirs}; the setup records axis {own}"));
                }
                match Message::parse(&bytes).filter(|_| is_own) {
                    Some(Message::Output(output)) => self.output(&output, at_ns, rows),
                    Some(Message::Reply(reply)) => self.reply(&reply, at_ns, rows),
                    _ => {}
                }
                frame = self.reader.next_buffered();
            }
        }
        rows.counts.lost_bytes = self.skipped + self.reader.skipped();
        self.clock.arrived();
    }

    fn reply(&mut self, reply: &Reply, at_ns: i64, rows: &mut Rows) {
        if reply.to == POWER_ON {
            // Power-on begins a new count.
            self.flush(rows);
            self.output.power_on();
            self.clock.connected();
        }
        if !is_piece_done(reply) {
            rows.say(at_ns, reply_words(reply));
        }
    }

    fn output(&mut self, output: &OutputFrame, at_ns: i64, rows: &mut Rows) {
        self.output.follow(output);
        rows.counts.missing_frames = self.output.missing;
        let ticks = i64::try_from(self.output.ticks).unwrap_or(i64::MAX);
        let (time_ns, restarted) = self.clock.at(ticks.saturating_mul(output.tick_ns.into()), at_ns);
        if restarted {
            rows.say(at_ns, "the gyro was switched off and on: its times go on by arrival");
        }
        let ticks = self.output.ticks;
        if let Some(waiting) = self.waiting.take() {
            let follows = ticks.checked_sub(waiting.ticks).is_some_and(|since| since == u64::from(output.frame_ticks));
            let code = if follows { output.temperature } else { waiting.output.temperature };
            self.row(&waiting, code, rows);
        }
        self.waiting = Some(Waiting { output: *output, ticks, time_ns, at_ns });
    }

    /// The row that waits, as no frame follows it.
    pub(crate) fn flush(&mut self, rows: &mut Rows) {
        if let Some(waiting) = self.waiting.take() {
            self.row(&waiting, waiting.output.temperature, rows);
        }
    }

    fn row(&self, waiting: &Waiting, code: Option<i32>, rows: &mut Rows) {
        let output = &waiting.output;
        let mut cells = vec![waiting.time_ns.to_string(), output.raw.to_string()];
        if let Some((offset_c, gain_c)) = self.thermometer {
            let celsius = code.map(|code| offset_c + gain_c * f64::from(code));
            cells.push(celsius.map_or(String::new(), |celsius| celsius.to_string()));
        }
        cells.push(arcsec(output.angle_nano_arcsec));
        cells.push(match output.error_milli_dph {
            UNBOUNDED => String::new(),
            milli => (f64::from(milli) * 1e-3).to_string(),
        });
        let numbers = [output.counts, i32::from(output.sequence), output.actuator, output.current];
        cells.extend(numbers.map(|number| number.to_string()));
        cells.push(output.lost_steps.to_string());
        cells.extend([status_words(output), path_length_words(output), intensity_words(output)]);
        cells.push(image_words(output).to_owned());
        rows.row(cells, waiting.at_ns);
    }

    pub(crate) fn clock(&self) -> ClockReport {
        self.clock.report()
    }
}
