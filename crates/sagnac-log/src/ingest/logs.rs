//! Several logs, each opened when the one before has been read: a test of a thousand files needs one descriptor.

use std::iter::Peekable;

use crate::error::{Error, Result};
use crate::ingest::{LogReader, LogShape};

/// Logs in the order in which they are read.
pub struct Logs<'a>(Peekable<Box<dyn Iterator<Item = Result<LogReader>> + 'a>>);

impl<'a> Logs<'a> {
    /// Of an iterator that opens a log whenever the next one is asked for.
    pub fn opened_by(each: impl Iterator<Item = Result<LogReader>> + 'a) -> Self {
        let each: Box<dyn Iterator<Item = Result<LogReader>> + 'a> = Box::new(each);
        Self(each.peekable())
    }

    /// The first log, still to be read.
    ///
    /// # Errors
    /// No log, or one that cannot be opened.
    pub fn first(&mut self) -> Result<&LogReader> {
        match self.0.peek() {
            Some(Ok(log)) => Ok(log),
            Some(Err(error)) => Err(error.clone()),
            None => Err(Error::input("no log is given", "give one or more log files")),
        }
    }

    /// What the first log consists of.
    ///
    /// # Errors
    /// As [`Logs::first`].
    pub fn shape(&mut self) -> Result<LogShape> {
        self.first().map(|log| log.shape().clone())
    }
}

impl From<Vec<LogReader>> for Logs<'_> {
    fn from(logs: Vec<LogReader>) -> Self {
        Self::opened_by(logs.into_iter().map(Ok))
    }
}

impl Iterator for Logs<'_> {
    type Item = Result<LogReader>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}
