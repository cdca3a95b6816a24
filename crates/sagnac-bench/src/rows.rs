//! A journal as rows: while it grows, and when it has ended.

use std::path::Path;
use std::time::Duration;

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use sagnac_log::ingest::MemoryTable;
use sagnac_log::setup::Setup;
use sagnac_log::write::{ParquetBatches, write_atomically};
use sagnac_log::{Error, Result};

use crate::decode::{ClockReport, Counts, Decoder, Event};
use crate::journal::JournalReader;
use crate::record::Published;
use crate::start::Start;

/// Most rows that are handed on together.
const MOST_ROWS: usize = 8192;
/// Time after which those who wait for rows get none.
const PATIENCE: Duration = Duration::from_secs(1);

/// What became of a journal.
#[derive(Clone, Debug)]
pub struct Finished {
    /// What was recorded.
    pub counts: Counts,
    /// The gyro's clock next to the computer's.
    pub clock: ClockReport,
    /// What happened.
    pub events: Vec<Event>,
    /// Bytes of the journal that are damaged.
    pub damaged_bytes: u64,
    /// The recording's beginning, ns since 1970.
    pub started_ns: i64,
}

/// Rows of a journal, in order.
pub struct JournalRows {
    reader: JournalReader,
    decoder: Decoder,
    start: Start,
    /// Of a journal that grows.
    published: Option<Published>,
    ended: bool,
}

impl JournalRows {
    /// Of a journal that has ended.
    ///
    /// # Errors
    /// A file that is no journal.
    pub fn open(path: &Path) -> Result<Self> {
        Self::of(path, None, None)
    }

    /// Of a journal that has ended, read with another setup than it was recorded with.
    ///
    /// # Errors
    /// A file that is no journal.
    pub fn open_with(path: &Path, setup: &Setup) -> Result<Self> {
        Self::of(path, None, Some(setup))
    }

    /// Of one that grows.
    ///
    /// # Errors
    /// A file that is no journal.
    pub fn follow(path: &Path, published: Published) -> Result<Self> {
        Self::of(path, Some(published), None)
    }

    fn of(path: &Path, published: Option<Published>, setup: Option<&Setup>) -> Result<Self> {
        let mut reader = JournalReader::open(path)?;
        let named = |e: Error| e.file(path.display().to_string());
        let entries = reader.next_block(u64::MAX)?.unwrap_or_default();
        let start = Start::of(&entries).map_err(named)?;
        let start = setup.map_or(start.clone(), |setup| start.with(setup));
        let mut decoder = Decoder::new(&start)?;
        entries.iter().for_each(|entry| decoder.push(entry));
        Ok(Self { reader, decoder, start, published, ended: false })
    }

    /// What is recorded, and how.
    pub fn start(&self) -> &Start {
        &self.start
    }

    /// The decoder, for what is known besides rows.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Reads on; false where there is nothing more, yet.
    fn step(&mut self) -> Result<bool> {
        let end = self.published.as_ref().map_or(u64::MAX, Published::length);
        let Some(entries) = self.reader.next_block(end)? else { return Ok(false) };
        entries.iter().for_each(|entry| self.decoder.push(entry));
        Ok(true)
    }

    /// Reads on until the columns are known; `None` where the recording ends before.
    ///
    /// # Errors
    /// A failed read.
    pub fn schema(&mut self) -> Result<Option<SchemaRef>> {
        loop {
            if let Some(schema) = self.decoder.schema() {
                return Ok(Some(schema));
            }
            if self.has_ended_before_columns()? {
                return Ok(None);
            }
        }
    }

    /// Reads on a little, or waits for more up to a second: true where the recording has ended and no columns are known.
    ///
    /// # Errors
    /// A failed read.
    pub(crate) fn has_ended_before_columns(&mut self) -> Result<bool> {
        Ok(self.decoder.schema().is_none() && !self.step()? && self.is_at_end())
    }

    /// Nothing more will come; otherwise it waits for more, up to a second.
    fn is_at_end(&mut self) -> bool {
        let Some(published) = &self.published else { return true };
        let is_ended = published.is_ended();
        let position = self.reader.position();
        published.wait_beyond(position, PATIENCE) <= position && is_ended
    }

    /// The next rows: as many as are there, or none after a second without any. `None` at the end.
    ///
    /// # Errors
    /// As [`JournalRows::schema`].
    pub fn next_rows(&mut self) -> Result<Option<RecordBatch>> {
        loop {
            if self.decoder.waiting() >= MOST_ROWS {
                return self.decoder.take();
            }
            if self.step()? {
                continue;
            }
            if self.decoder.waiting() > 0 {
                return self.decoder.take();
            }
            if self.ended {
                return Ok(None);
            }
            self.ended = self.is_at_end();
            if !self.ended && self.published.as_ref().is_some_and(|shown| shown.length() <= self.reader.position()) {
                return self.decoder.take();
            }
        }
    }

    /// What was made of the journal so far.
    pub fn finished(&self) -> Finished {
        Finished {
            counts: self.decoder.counts(),
            clock: self.decoder.clock(),
            events: self.decoder.events().to_vec(),
            damaged_bytes: self.reader.damaged(),
            started_ns: self.start.started_ns,
        }
    }

    /// A log for the reader of logs, under a name. `look` sees each batch, with what is known of it.
    ///
    /// # Errors
    /// As [`JournalRows::schema`]; a recording without headers.
    pub fn table(
        mut self,
        name: &str,
        mut look: impl FnMut(&RecordBatch, &Self) + Send + 'static,
    ) -> Result<MemoryTable> {
        let none = || Error::refused("the recording ended before a row came", "connect the gyro, and record again");
        let schema = self.schema()?.ok_or_else(none)?;
        let batches = std::iter::from_fn(move || {
            let next = self.next_rows().transpose()?;
            Some(next.inspect(|batch| look(batch, &self)).map_err(|e| ArrowError::ExternalError(Box::new(e))))
        });
        Ok(MemoryTable { name: name.to_owned(), schema, batches: Box::new(batches) })
    }
}

/// Writes the log of a recording.
///
/// # Errors
/// A file that is no journal, a recording without a row, a failed write.
pub fn finish(mut rows: JournalRows, log: &Path) -> Result<Finished> {
    let journal = rows.reader.path().to_owned();
    let nothing = || {
        Error::refused("the recorded bytes contain no row", "correct `format`, `headers` or [columns] in the setup, and run again with --finish: the journal keeps the bytes")
            .file(journal.display().to_string())
    };
    let Some(schema) = rows.schema()? else { return Err(rows.decoder.problem().cloned().unwrap_or_else(nothing)) };
    write_atomically(log, |out| {
        let mut writer = ParquetBatches::new(out, schema)?;
        while let Some(batch) = rows.next_rows()? {
            writer.write(&batch)?;
        }
        if rows.decoder.counts().rows == 0 {
            return Err(nothing());
        }
        writer.finish()
    })?;
    Ok(rows.finished())
}
