//! The journal of a recording: every byte as it came, with the time of its arrival.
//!
//! ```text
//! file   block*
//! block  "SGJ2"  u64 of the recording  u32 length of body  u32 CRC-32 of number and body  body: entries, LZ4 with their length in front
//! entry  u8 kind  u8 source  i64 arrival, ns since 1970  u32 length  bytes          (all little-endian)
//! ```
//!
//! Blocks are appended whole. A cut, wherever it falls, costs the block in which it is and nothing before it; a block that was damaged later
//! costs itself, because the next one is found by its magic, the random number of its recording, and its checksum: bytes of a source that are a
//! block of another recording are none here. Journals of before have "SGJ1" and no number; they are read and continued as they are. Rows, Parquet and the live figures are all made from this file and
//! from nothing else, so a recording that is resumed, or finished a week later, gives the rows that were shown.

mod reader;

pub use reader::JournalReader;

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use sagnac_log::{Error, Result};

/// First bytes of a block, with the number of its recording behind them.
const MAGIC: [u8; 4] = *b"SGJ2";
const NUMBER_BYTES: usize = 8;
/// Of a journal without such a number.
const OLD_MAGIC: [u8; 4] = *b"SGJ1";
/// Length and checksum of a body.
const SIZES_BYTES: usize = 8;
/// Most bytes of a block's entries.
pub const MOST_BLOCK_BYTES: usize = 1 << 20;
/// Bytes in which the next block is looked for first.
const FIRST_PIECE_BYTES: usize = 1 << 10;
/// A damaged file may be full of heads that promise a long body each: what is read for nothing stays in proportion to the file.
const FREE_BYTES: u64 = 64 << 20;
const BYTES_EACH: u64 = 16;
/// Bytes of an entry apart from its payload.
const ENTRY_BYTES: usize = 14;
/// Most bytes of an entry's payload.
pub const MOST_PAYLOAD_BYTES: usize = 1 << 16;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// What an entry is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EntryKind {
    /// The recording begins: [`crate::Start`] as JSON.
    Start,
    /// Bytes of a source.
    Bytes,
    /// A source is connected: [`crate::source::Connection`] as JSON.
    Connected,
    /// A source was lost; the payload says why.
    Lost,
    /// A source has ended by itself.
    Ended,
    /// The recording goes on after an interruption.
    Resumed,
    /// The recording has ended.
    Stopped,
    /// Something that a person should know, as text.
    Note,
}

impl EntryKind {
    const ALL: [Self; 8] =
        [Self::Start, Self::Bytes, Self::Connected, Self::Lost, Self::Ended, Self::Resumed, Self::Stopped, Self::Note];

    fn code(self) -> u8 {
        Self::ALL.iter().position(|kind| *kind == self).unwrap_or(0) as u8
    }

    fn of(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }
}

/// One entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// What it is.
    pub kind: EntryKind,
    /// Number of the source, from 0.
    pub source: u8,
    /// Time of arrival, ns since 1970: the clock of the computer at the start, and its monotonic clock since.
    pub arrival_ns: i64,
    /// Its bytes.
    pub payload: Vec<u8>,
}

impl Entry {
    /// An entry with a text.
    pub fn text(kind: EntryKind, source: u8, arrival_ns: i64, text: &str) -> Self {
        let most = text.char_indices().map(|(at, c)| at + c.len_utf8()).take_while(|end| *end <= MOST_PAYLOAD_BYTES);
        let end = most.last().unwrap_or(0);
        Self { kind, source, arrival_ns, payload: text.as_bytes().get(..end).unwrap_or_default().to_vec() }
    }

    fn append_to(&self, block: &mut Vec<u8>) {
        block.extend_from_slice(&[self.kind.code(), self.source]);
        block.extend_from_slice(&self.arrival_ns.to_le_bytes());
        block.extend_from_slice(&(self.payload.len() as u32).to_le_bytes());
        block.extend_from_slice(&self.payload);
    }
}

/// Splits the front of a slice off, as an array.
fn front<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk::<N>()?;
    *bytes = rest;
    Some(*first)
}

/// The entries of a block; `None` for anything that no writer made.
fn entries_of(mut bytes: &[u8]) -> Option<Vec<Entry>> {
    let mut entries = Vec::new();
    while !bytes.is_empty() {
        let [kind, source] = front(&mut bytes)?;
        let arrival_ns = i64::from_le_bytes(front(&mut bytes)?);
        let length = u32::from_le_bytes(front(&mut bytes)?) as usize;
        let payload = bytes.get(..length)?.to_vec();
        bytes = bytes.get(length..)?;
        entries.push(Entry { kind: EntryKind::of(kind)?, source, arrival_ns, payload });
    }
    Some(entries)
}

/// First bytes of every block of one recording.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Mark(Vec<u8>);

impl Mark {
    fn new() -> Result<Self> {
        let mut number = [0; NUMBER_BYTES];
        getrandom::fill(&mut number)
            .map_err(|e| Error::input(format!("the system gives no random numbers: {e}"), "start the bench later"))?;
        Ok(Self([&MAGIC[..], &number].concat()))
    }

    /// That of the block that these bytes begin.
    fn of(bytes: &[u8]) -> Option<Self> {
        let length = match *bytes.first_chunk::<4>()? {
            MAGIC => MAGIC.len() + NUMBER_BYTES,
            OLD_MAGIC => OLD_MAGIC.len(),
            _ => return None,
        };
        bytes.get(..length).map(|mark| Self(mark.to_vec()))
    }

    /// Of the number and a body.
    fn checksum(&self, body: &[u8]) -> u32 {
        let mut digest = CRC.digest();
        digest.update(self.0.get(MAGIC.len()..).unwrap_or_default());
        digest.update(body);
        digest.finalize()
    }

    /// Bytes before the body.
    fn head_bytes(&self) -> usize {
        self.0.len() + SIZES_BYTES
    }
}

/// Appends to a journal.
pub struct JournalWriter {
    file: File,
    mark: Mark,
    path: PathBuf,
    /// Length of the file up to its last whole block.
    length: u64,
    waiting: Vec<u8>,
    is_synced: bool,
}

impl JournalWriter {
    /// A new journal. It is locked while this lives.
    ///
    /// # Errors
    /// A file that is there, or that cannot be made.
    pub fn create(path: &Path) -> Result<Self> {
        // A file without a byte holds no recording.
        let is_empty = std::fs::metadata(path).is_ok_and(|file| file.is_file() && file.len() == 0);
        let file = File::options().read(true).append(true).create_new(!is_empty).open(path);
        let file = file.map_err(|e| match e.kind() {
            ErrorKind::AlreadyExists => Error::input(
                "a recording of this name exists already",
                "continue it with --resume, make its log with --finish, or give another -o",
            )
            .file(path.display().to_string()),
            _ => Error::io_path(path, "make", &e),
        })?;
        Self::of(file, path, Mark::new()?)
    }

    /// Goes on with a journal behind its last whole block; what a cut spoiled behind it is removed.
    ///
    /// # Errors
    /// A file that is no journal, or cannot be written, or that another program records into.
    pub fn resume(path: &Path) -> Result<Self> {
        let file = File::options().read(true).append(true).open(path).map_err(|e| Error::io_path(path, "write", &e))?;
        // Locked before its end is looked for.
        let mut writer = Self::of(file, path, Mark::new()?)?;
        let mut reader = JournalReader::open(path)?;
        writer.mark = reader.mark.clone();
        while reader.next_block(u64::MAX)?.is_some() {}
        writer.length = reader.position();
        writer.file.set_len(writer.length).map_err(|e| Error::io_path(path, "write", &e))?;
        Ok(writer)
    }

    fn of(file: File, path: &Path, mark: Mark) -> Result<Self> {
        file.try_lock().map_err(|_| {
            Error::input("another program records into this file", "end that program, or give another -o")
                .file(path.display().to_string())
        })?;
        Ok(Self { file, mark, path: path.to_owned(), length: 0, waiting: Vec::new(), is_synced: true })
    }

    /// Adds an entry to the block that waits. A payload is at most [`MOST_PAYLOAD_BYTES`] long.
    ///
    /// # Errors
    /// A failed write, where the block is full.
    pub fn push(&mut self, entry: &Entry) -> Result<()> {
        if self.waiting.len() + ENTRY_BYTES + entry.payload.len() > MOST_BLOCK_BYTES {
            self.write()?;
        }
        entry.append_to(&mut self.waiting);
        Ok(())
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes in the file.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Bytes that wait to be written.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Writes the block that waits; the length of the journal since.
    ///
    /// # Errors
    /// A failed write. The journal then ends with its last whole block.
    pub fn write(&mut self) -> Result<u64> {
        if self.waiting.is_empty() {
            return Ok(self.length);
        }
        let body = lz4_flex::block::compress_prepend_size(&self.waiting);
        let mut block = Vec::with_capacity(self.mark.head_bytes() + body.len());
        block.extend_from_slice(&self.mark.0);
        block.extend_from_slice(&(body.len() as u32).to_le_bytes());
        block.extend_from_slice(&self.mark.checksum(&body).to_le_bytes());
        block.extend_from_slice(&body);
        if let Err(error) = self.file.write_all(&block) {
            // Part of the block may be there: a reader would skip it, a resumed recording remove it.
            let _ = self.file.set_len(self.length);
            return Err(Error::io_path(&self.path, "write", &error).help(
                "free space, then continue with --resume, or make the log with --finish: earlier rows are safe",
            ));
        }
        self.length += block.len() as u64;
        self.waiting.clear();
        self.is_synced = false;
        Ok(self.length)
    }

    /// Brings everything that was written to the disk.
    ///
    /// # Errors
    /// A failed write.
    pub fn sync(&mut self) -> Result<()> {
        if !std::mem::replace(&mut self.is_synced, true) {
            self.file.sync_data().map_err(|e| Error::io_path(&self.path, "write", &e))?;
        }
        Ok(())
    }
}

/// The entries' bytes of a block.
fn unpacked(body: &[u8]) -> Option<Vec<u8>> {
    let (size, _) = body.split_first_chunk::<4>()?;
    if u32::from_le_bytes(*size) as usize > MOST_BLOCK_BYTES {
        return None;
    }
    lz4_flex::block::decompress_size_prepended(body).ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn entry(number: u8, payload: Vec<u8>) -> Entry {
        Entry { kind: EntryKind::Bytes, source: number % 3, arrival_ns: i64::from(number) * 1_000_000, payload }
    }

    fn written(path: &Path, blocks: &[Vec<Vec<u8>>]) -> Vec<u64> {
        let mut writer = JournalWriter::create(path).unwrap();
        let mut ends = Vec::new();
        for block in blocks {
            for payload in block {
                writer.push(&entry(payload.len() as u8, payload.clone())).unwrap();
            }
            ends.push(writer.write().unwrap());
            writer.sync().unwrap();
        }
        ends
    }

    fn payloads(path: &Path) -> (Vec<Vec<u8>>, u64) {
        let mut reader = JournalReader::open(path).unwrap();
        let mut all = Vec::new();
        while let Some(entries) = reader.next_block(u64::MAX).unwrap() {
            all.extend(entries.into_iter().map(|entry| entry.payload));
        }
        (all, reader.damaged())
    }

    /// A block without the number of its recording.
    fn of_before(block: &[u8]) -> Vec<u8> {
        let body = &block[20..];
        [&OLD_MAGIC[..], &block[12..16], &CRC.checksum(body).to_le_bytes(), body].concat()
    }

    fn blocks() -> impl Strategy<Value = Vec<Vec<Vec<u8>>>> {
        let payload = prop::collection::vec(any::<u8>(), 0..200);
        prop::collection::vec(prop::collection::vec(payload, 1..5), 1..6)
    }

    /// Two megabytes of heads that promise a megabyte each cost a small multiple of the file, and the block behind them is found.
    #[test]
    fn heads_that_promise_much_cost_little() {
        let folder = tempfile::tempdir().unwrap();
        let (path, whole) = (folder.path().join("a.journal"), folder.path().join("b.journal"));
        written(&whole, &[vec![b"first".to_vec()], vec![b"last".to_vec()]]);
        let blocks = std::fs::read(&whole).unwrap();
        let head = [&blocks[..12], &(1_u32 << 20).to_le_bytes(), &[0; 4]].concat();
        std::fs::write(&path, [&blocks[..], &head.repeat(300_000), &blocks].concat()).unwrap();
        let mut reader = JournalReader::open(&path).unwrap();
        let mut found = 0;
        while reader.next_block(u64::MAX).unwrap().is_some() {
            found += 1;
        }
        let length = std::fs::metadata(&path).unwrap().len();
        assert_eq!(found, 4);
        // A KiB for each head; without the bounds 300 GB were read.
        assert!(reader.read < 400 * length, "{} bytes read of {length}", reader.read);
    }

    /// A source whose bytes are a whole block, of another recording or of a journal of before, behind a block that a cut tore: it is none here.
    #[test]
    fn a_block_in_the_bytes_of_a_source_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("a.journal"), folder.path().join("b.journal"));
        written(&other, &[vec![b"forged".to_vec()]]);
        let forged = std::fs::read(&other).unwrap();
        let old = of_before(&forged);
        let ends =
            written(&path, &[vec![b"first".to_vec()], vec![[&forged[..], &old].concat()], vec![b"last".to_vec()]]);
        let mut bytes = std::fs::read(&path).unwrap();
        // The checksum of the second block.
        bytes[ends[0] as usize + 16] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(payloads(&path).0, [b"first".to_vec(), b"last".to_vec()]);
    }

    /// A journal without a number is read and continued as it is.
    #[test]
    fn a_journal_of_before_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let (path, new) = (folder.path().join("a.journal"), folder.path().join("b.journal"));
        written(&new, &[vec![b"first".to_vec()]]);
        std::fs::write(&path, of_before(&std::fs::read(&new).unwrap())).unwrap();
        let mut writer = JournalWriter::resume(&path).unwrap();
        writer.push(&entry(1, b"more".to_vec())).unwrap();
        writer.write().unwrap();
        assert_eq!(payloads(&path), (vec![b"first".to_vec(), b"more".to_vec()], 0));
        assert_eq!(memchr::memmem::find_iter(&std::fs::read(&path).unwrap(), &OLD_MAGIC).count(), 2);
    }

    proptest! {
        /// A cut anywhere costs no block before it, and a resumed journal goes on behind the last whole one.
        #[test]
        fn a_cut_costs_the_block_it_is_in(blocks in blocks(), part in 0.0..1.0_f64) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.journal");
            let ends = written(&path, &blocks);
            let cut = 4 + (part * (*ends.last().unwrap() as f64 - 4.0)) as u64;
            File::options().write(true).open(&path).unwrap().set_len(cut).unwrap();
            let whole = ends.iter().filter(|end| **end <= cut).count();
            let expected: Vec<Vec<u8>> = blocks[..whole].concat();
            prop_assert_eq!(&payloads(&path).0, &expected);
            let mut writer = JournalWriter::resume(&path).unwrap();
            writer.push(&entry(1, b"more".to_vec())).unwrap();
            writer.write().unwrap();
            let (all, damaged) = payloads(&path);
            prop_assert_eq!(damaged, 0);
            prop_assert_eq!(all, [expected, vec![b"more".to_vec()]].concat());
        }

        /// Damage costs the blocks in which it is; the others are read.
        #[test]
        fn damage_costs_one_block(blocks in blocks(), place in 0.0..1.0_f64, bit in 0_u8..8) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.journal");
            let ends = written(&path, &blocks);
            let mut bytes = std::fs::read(&path).unwrap();
            let at = (place * bytes.len() as f64) as usize;
            // Without its first magic a file is no journal.
            prop_assume!(at >= 4);
            bytes[at] ^= 1 << bit;
            std::fs::write(&path, &bytes).unwrap();
            let hit = ends.iter().position(|end| (at as u64) < *end).unwrap();
            let mut expected = blocks.clone();
            expected.remove(hit);
            prop_assert_eq!(payloads(&path).0, expected.concat());
        }

        /// Any bytes are read without a panic, and without a block that nobody wrote.
        #[test]
        fn any_bytes_are_no_block(noise in prop::collection::vec(any::<u8>(), 0..500)) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.journal");
            std::fs::write(&path, [&MAGIC[..], &noise].concat()).unwrap();
            prop_assert!(payloads(&path).0.is_empty());
        }
    }

    #[test]
    fn two_programs_do_not_record_into_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.journal");
        let mut writer = JournalWriter::create(&path).unwrap();
        writer.push(&entry(1, b"x".to_vec())).unwrap();
        writer.write().unwrap();
        assert!(JournalWriter::create(&path).is_err());
        assert!(JournalWriter::resume(&path).is_err_and(|e| e.what.contains("another program")));
        drop(writer);
        assert!(JournalWriter::resume(&path).is_ok());
    }

    /// A full disk: the write fails, and the journal ends with its last whole block.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_keeps_what_there_is() {
        let full = Path::new("/dev/full");
        let file = File::options().read(true).append(true).open(full).unwrap();
        let mut writer = JournalWriter {
            file,
            mark: Mark::new().unwrap(),
            path: full.to_owned(),
            length: 0,
            waiting: Vec::new(),
            is_synced: true,
        };
        writer.push(&entry(1, b"x".to_vec())).unwrap();
        let error = writer.write().unwrap_err();
        assert!(error.help.contains("--resume"), "{}", error.what);
        assert_eq!(writer.length, 0);
    }
}
