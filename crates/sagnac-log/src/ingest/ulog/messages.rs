//! A ULog file as messages: type, length, payload. One that is cut, at the end of the file or where data was appended later, is said to be.

use std::collections::BTreeSet;
use std::io::{BufRead, Read};

use crate::error::{Error, Result};

/// One message: type and payload.
pub(super) struct Message {
    pub(super) kind: u8,
    pub(super) payload: Vec<u8>,
}

impl Message {
    /// The topic a data message belongs to.
    pub(super) fn id(&self) -> Option<u16> {
        self.payload.first_chunk::<2>().map(|id| u16::from_le_bytes(*id))
    }
}

/// Splits a file into messages.
pub(super) struct Messages {
    reader: Box<dyn BufRead + Send>,
    position: u64,
    /// Where data was appended later; a message cut before it has no end.
    pub(super) appended: BTreeSet<u64>,
}

pub(super) enum Next {
    Message(Message),
    Cut,
    End,
}

impl Messages {
    pub(super) fn of(reader: Box<dyn BufRead + Send>) -> Self {
        Self { reader, position: 0, appended: BTreeSet::new() }
    }

    /// Reads as many bytes as there are, up to the buffer's length.
    pub(super) fn fill(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.reader.read(&mut buffer[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(Error::cannot("read", &e)),
            }
        }
        self.position += filled as u64;
        Ok(filled)
    }

    pub(super) fn next(&mut self) -> Result<Next> {
        let mut head = [0; 3];
        let end = self.position + head.len() as u64;
        if let Some(at) = self.appended.range(self.position + 1..end).next().copied() {
            // The last message before the appended data is cut within its header.
            let left = (at - self.position) as usize;
            self.fill(&mut head[..left])?;
            return Ok(Next::Cut);
        }
        match self.fill(&mut head)? {
            0 => return Ok(Next::End),
            3 => {}
            _ => return Ok(Next::Cut),
        }
        let length = u64::from(u16::from_le_bytes([head[0], head[1]]));
        let until_appended = self.appended.range(self.position..).next().map(|at| at - self.position);
        let cut = until_appended.filter(|left| *left < length);
        let mut payload = vec![0; cut.unwrap_or(length) as usize];
        let filled = self.fill(&mut payload)?;
        Ok(match cut {
            Some(_) => Next::Cut,
            None if filled < payload.len() => Next::Cut,
            None => Next::Message(Message { kind: head[2], payload }),
        })
    }
}

/// Where data was appended, from a flag-bits message.
pub(super) fn appended_offsets(payload: &[u8]) -> BTreeSet<u64> {
    let offsets = payload.get(16..40).unwrap_or(&[]).chunks_exact(8);
    let offsets = offsets.map(|bytes| u64::from_le_bytes(bytes.try_into().unwrap_or([0; 8])));
    offsets.filter(|offset| *offset > 0).collect()
}
