//! A log instead of a gyro, in its own time: `replay:LOG?speed=10`.
//!
//! Any log that Sagnac reads becomes text again, row by row, at the times of its rows. Rows that the reader refuses are not sent; the rest of the
//! bench cannot tell it from a gyro. A row is sent when its time has come; a gap in the log is a pause.

use std::path::Path;
use std::time::{Duration, Instant};

use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::setup::Setup;
use sagnac_log::{Error, Result};

use super::{Connection, Out, SourceEvent};
use crate::journal::MOST_PAYLOAD_BYTES;

/// Longest time between two sends.
const TOGETHER: Duration = Duration::from_millis(20);

/// Sends a log; `skip` bytes of its text were recorded before.
pub(crate) fn replay(path: &Path, speed: f64, skip: u64, setup: &Setup, out: &Out) {
    if !out.send(SourceEvent::Connected(Connection::from_byte(format!("replay of {}", path.display()), skip))) {
        return;
    }
    let mut sender = Sender { out, waiting: Vec::new(), skip, separator: b',' };
    match sender.pour(path, speed, setup) {
        Ok(true) => {
            out.send(SourceEvent::Ended);
        }
        Ok(false) => {}
        Err(error) => {
            out.send(SourceEvent::Lost(error.to_string()));
            out.send(SourceEvent::Ended);
        }
    }
}

struct Sender<'a> {
    out: &'a Out,
    waiting: Vec<u8>,
    skip: u64,
    separator: u8,
}

impl Sender<'_> {
    /// True at the end of the log, false where it is to stop.
    fn pour(&mut self, path: &Path, speed: f64, setup: &Setup) -> Result<bool> {
        let mut log = LogReader::open(path, setup, ReadMode::BulkWithText)?;
        if !log.shape().timed && setup.sample_interval_s.is_none() {
            return Err(Error::input(
                "the log has no times, and the row interval is not given",
                "set sample_interval_s in the setup",
            )
            .column("sample_interval_s")
            .file(path.display().to_string()));
        }
        // As in the log: numbers with a decimal comma need another separator.
        self.separator = log.delimiter();
        self.line(log.headers().iter().map(String::as_bytes))?;
        let (start, mut first_ns) = (Instant::now(), None);
        // Time of the log that was recorded before: it is not waited for again.
        let mut lead = Duration::ZERO;
        while let Some(batch) = log.next_batch()? {
            for (end_ns, fields) in batch.end_ns.iter().zip(&batch.fields) {
                let since_ns = end_ns.saturating_sub(*first_ns.get_or_insert(*end_ns)).max(0);
                let due = Duration::from_secs_f64(since_ns as f64 * 1e-9 / speed);
                if self.skip > self.waiting.len() as u64 {
                    lead = due;
                }
                let early = due.saturating_sub(lead + start.elapsed());
                if early > TOGETHER && (!self.send() || self.out.stop.wait(early)) {
                    return Ok(false);
                }
                self.line(fields)?;
                if self.waiting.len() >= MOST_PAYLOAD_BYTES / 2 && !self.send() {
                    return Ok(false);
                }
            }
            if self.out.stop.is_stopped() {
                return Ok(false);
            }
        }
        Ok(self.send())
    }

    /// A line of delimited text.
    fn line<'f>(&mut self, fields: impl IntoIterator<Item = &'f [u8]>) -> Result<()> {
        let mut writer = csv::WriterBuilder::new().delimiter(self.separator).from_writer(&mut self.waiting);
        let written = writer.write_record(fields).and_then(|()| writer.flush().map_err(Into::into));
        written.map_err(|e| Error::defect(format!("cannot replay: {e}")))
    }

    fn send(&mut self) -> bool {
        let known = self.skip.min(self.waiting.len() as u64);
        self.skip -= known;
        let bytes = self.waiting.split_off(known as usize);
        self.waiting.clear();
        bytes.is_empty()
            || bytes.chunks(MOST_PAYLOAD_BYTES / 2).all(|piece| self.out.send(SourceEvent::Bytes(piece.to_vec())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::{ArrivalClock, Stop};

    /// Eleven days that were recorded before are not waited for a second time.
    #[test]
    fn what_was_recorded_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        let text = "time_s,counts,temperature_c\n1,1,20\n1000000,2,20\n1000001,3,20\n";
        std::fs::write(&path, text).unwrap();
        let setup = Setup { arcsec_per_count: Some(0.6), sample_interval_s: Some(1.0), ..Setup::default() };
        let (to, came) = std::sync::mpsc::sync_channel(8);
        let stop = Stop::default();
        let out = Out { number: 0, clock: ArrivalClock::start(0), to, stop: stop.clone() };
        let recorded = text.len() - "1000001,3,20\n".len();
        std::thread::scope(|scope| {
            scope.spawn(|| replay(&path, 1.0, recorded as u64, &setup, &out));
            let next = || came.recv_timeout(Duration::from_secs(30)).map(|came| came.what);
            assert!(
                matches!(next(), Ok(SourceEvent::Connected(Connection { from_byte: Some(at), .. })) if at == recorded as u64)
            );
            let row = next();
            stop.stop();
            assert!(matches!(&row, Ok(SourceEvent::Bytes(bytes)) if bytes == b"1000001,3,20\n"), "{:?}", row.is_ok());
        });
    }
}
