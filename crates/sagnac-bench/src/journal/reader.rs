//! A journal from its first block on, over damage and while it grows.
//!
//! ```text
//! first whole block ─▶ its mark ─▶ block ─▶ next place with that mark ─▶ block …
//! ```
//!
//! Where it fails: if no block is whole, a journal is read by the mark of its first head, and holds nothing.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use sagnac_log::{Error, Result};

use super::{
    BYTES_EACH, Entry, FIRST_PIECE_BYTES, FREE_BYTES, MAGIC, MOST_BLOCK_BYTES, MOST_PAYLOAD_BYTES, Mark, NUMBER_BYTES,
    entries_of, front, unpacked,
};

/// Reads a journal, also while it is written.
pub struct JournalReader {
    file: File,
    pub(super) mark: Mark,
    path: PathBuf,
    /// Behind the last block that was read.
    position: u64,
    /// Bytes between blocks that belong to none.
    damaged: u64,
    /// Bytes of bodies that may still be read behind heads that turn out to be none: [`FREE_BYTES`], and [`BYTES_EACH`] for each byte passed.
    credit: u64,
    /// Bytes read from the file.
    #[cfg(test)]
    pub(super) read: u64,
}

/// What stands at a place of the file.
enum JournalPiece {
    Block {
        entries: Vec<Entry>,
        length: u64,
    },
    /// Not enough bytes, yet.
    Short,
    Damaged,
}

impl JournalReader {
    /// Opens a journal.
    ///
    /// # Errors
    /// A file that cannot be read, or that does not begin with a block.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
        let mut reader = Self {
            file,
            mark: Mark(Vec::new()),
            path: path.to_owned(),
            position: 0,
            damaged: 0,
            credit: FREE_BYTES,
            #[cfg(test)]
            read: 0,
        };
        let Some(mark) = reader.find_mark()? else {
            let what = if reader.bytes(0, 1)?.is_empty() {
                "the journal is empty: nothing was recorded"
            } else {
                "this is not the journal of a recording"
            };
            return Err(Error::input(what, "remove --resume and --finish to begin a recording")
                .file(path.display().to_string()));
        };
        (reader.mark, reader.credit) = (mark, FREE_BYTES);
        Ok(reader)
    }

    /// The mark of the first whole block. Where none is whole, that of the first place that may begin one near the start.
    fn find_mark(&mut self) -> Result<Option<Mark>> {
        let (mut at, mut first) = (0, None);
        loop {
            let next = self.next_of(&MAGIC[..3], at, u64::MAX)?;
            let near = first.is_some() || next.is_some_and(|next| next < MOST_PAYLOAD_BYTES as u64);
            let Some(next) = next.filter(|_| near) else { return Ok(first) };
            self.credit = self.credit.saturating_add((next - at).saturating_mul(BYTES_EACH));
            let head = self.bytes(next, MAGIC.len() + NUMBER_BYTES)?;
            if let Some(mark) = Mark::of(&head) {
                self.mark = mark.clone();
                if matches!(self.look(next, u64::MAX)?, JournalPiece::Block { .. }) {
                    return Ok(Some(mark));
                }
                first = first.or(Some(mark));
            } else if next == 0 && head.starts_with(&MAGIC) {
                // Cut within its first head: any mark finds nothing.
                return Mark::new().map(Some);
            }
            at = next + 1;
        }
    }

    /// The journal's file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Behind the last whole block that was read.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Bytes that belong to no block, so far.
    pub fn damaged(&self) -> u64 {
        self.damaged
    }

    /// The entries of the next block that ends at or before `end`; `None` where there is none, yet.
    ///
    /// # Errors
    /// A failed read.
    pub fn next_block(&mut self, end: u64) -> Result<Option<Vec<Entry>>> {
        let mut at = self.position;
        loop {
            match self.look(at, end)? {
                JournalPiece::Block { entries, length } => {
                    self.damaged += at - self.position;
                    self.position = at + length;
                    self.credit = self.credit.saturating_add(length.saturating_mul(BYTES_EACH));
                    return Ok(Some(entries));
                }
                // The end of the file, a cut in its last block, or a damaged length: then whole blocks are behind it.
                JournalPiece::Short | JournalPiece::Damaged => match self.next_magic(at + 1, end)? {
                    Some(next) => {
                        self.credit = self.credit.saturating_add((next - at).saturating_mul(BYTES_EACH));
                        at = next;
                    }
                    None => return Ok(None),
                },
            }
        }
    }

    fn look(&mut self, at: u64, end: u64) -> Result<JournalPiece> {
        let (room, head_bytes) = (end.saturating_sub(at), self.mark.head_bytes());
        let head = self.bytes(at, head_bytes)?;
        let sizes = head.split_at_checked(self.mark.0.len()).filter(|(mark, _)| *mark == self.mark.0.as_slice());
        let Some((_, mut rest)) = sizes else {
            let is_begun = head.len() < head_bytes && self.mark.0.starts_with(&head);
            return Ok(if is_begun { JournalPiece::Short } else { JournalPiece::Damaged });
        };
        let (Some(length), Some(checksum)) = (front::<4>(&mut rest), front::<4>(&mut rest)) else {
            return Ok(JournalPiece::Short);
        };
        let length = u32::from_le_bytes(length) as usize;
        // LZ4 makes nothing longer by more than a part in 255.
        if length > MOST_BLOCK_BYTES + MOST_BLOCK_BYTES / 128 {
            return Ok(JournalPiece::Damaged);
        }
        if (head_bytes + length) as u64 > room {
            return Ok(JournalPiece::Short);
        }
        let before = self.credit;
        let Some(credit) = before.checked_sub(length as u64) else { return Ok(JournalPiece::Damaged) };
        self.credit = credit;
        let body = self.bytes(at + head_bytes as u64, length)?;
        if body.len() < length {
            return Ok(JournalPiece::Short);
        }
        if self.mark.checksum(&body) != u32::from_le_bytes(checksum) {
            return Ok(JournalPiece::Damaged);
        }
        let entries = unpacked(&body).and_then(|bytes| entries_of(&bytes));
        if entries.is_some() {
            self.credit = before;
        }
        Ok(entries.map_or(JournalPiece::Damaged, |entries| JournalPiece::Block {
            entries,
            length: (head_bytes + length) as u64,
        }))
    }

    /// The next place where a block may begin.
    fn next_magic(&mut self, from: u64, end: u64) -> Result<Option<u64>> {
        let mark = self.mark.0.clone();
        self.next_of(&mark, from, end)
    }

    /// The next place of some bytes.
    fn next_of(&mut self, wanted: &[u8], from: u64, end: u64) -> Result<Option<u64>> {
        // Most often it is near: between damaged blocks, or in a file full of them.
        let (mut at, mut piece) = (from, FIRST_PIECE_BYTES);
        while at < end {
            let bytes = self.bytes(at, piece)?;
            if let Some(place) = memchr::memmem::find(&bytes, wanted) {
                return Ok(Some(at + place as u64));
            }
            if bytes.len() < piece {
                return Ok(None);
            }
            at += (bytes.len() - (wanted.len() - 1)) as u64;
            piece = (2 * piece).min(MOST_PAYLOAD_BYTES);
        }
        Ok(None)
    }

    /// Up to so many bytes from a place.
    fn bytes(&mut self, at: u64, length: usize) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| {
            let mut limited = (&mut self.file).take(length as u64);
            limited.read_to_end(&mut bytes)
        });
        #[cfg(test)]
        {
            self.read += bytes.len() as u64;
        }
        read.map(|_| bytes).map_err(|e| Error::io_path(&self.path, "read", &e))
    }
}
