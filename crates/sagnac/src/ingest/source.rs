//! Bytes of a log: opened, hashed, unpacked, guarded.
//!
//! ```text
//! file or stdin ─▶ SHA-256 ─▶ gunzip if it is gzip ─▶ no line over 1 MiB ─▶ reader
//! ```
//!
//! Memory is bounded for any input: a line without end is refused, not collected.

use std::cell::RefCell;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::rc::Rc;

use flate2::bufread::MultiGzDecoder;
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// No line of a log is longer.
const MAX_LINE_BYTES: u64 = 1 << 20;
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// The running hash of what was read.
#[derive(Clone, Default)]
pub(crate) struct HashHandle(Rc<RefCell<Sha256>>);

impl HashHandle {
    /// SHA-256 of everything read so far, in hexadecimal.
    pub(crate) fn hex(&self) -> String {
        hex(&self.0.borrow().clone().finalize())
    }
}

/// Bytes in lowercase hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of bytes in memory.
pub fn sha256(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

struct HashingReader<R> {
    inner: R,
    hash: HashHandle,
}

impl<R: Read> Read for HashingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.hash.0.borrow_mut().update(&buffer[..n]);
        Ok(n)
    }
}

/// Fails once a line exceeds [`MAX_LINE_BYTES`].
struct LineGuard<R> {
    inner: R,
    since_newline: u64,
}

impl<R: Read> Read for LineGuard<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buffer)?;
        match buffer[..n].iter().rposition(|b| *b == b'\n') {
            Some(last) => self.since_newline = (n - 1 - last) as u64,
            None => self.since_newline += n as u64,
        }
        if self.since_newline > MAX_LINE_BYTES {
            return Err(std::io::Error::new(
                std::io::ErrorKind::InvalidData,
                "a line of more than 1 MiB; this is no table of text",
            ));
        }
        Ok(n)
    }
}

/// Opened bytes of a log.
pub(crate) struct Source {
    pub(crate) name: String,
    pub(crate) reader: Box<dyn BufRead>,
    pub(crate) hash: HashHandle,
}

impl Source {
    /// Opens a file, or standard input for `-`.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        if path.as_os_str() == "-" {
            return Self::from_reader("standard input".to_owned(), Box::new(std::io::stdin()));
        }
        let name = path.display().to_string();
        let file = File::open(path).map_err(|e| Error::io(&name, "open", &e))?;
        if file.metadata().is_ok_and(|m| m.is_dir()) {
            return Err(Error::input("this is a directory; a log is a file").file(name));
        }
        Self::from_reader(name, Box::new(file))
    }

    /// Wraps any reader.
    pub(crate) fn from_reader(name: String, raw: Box<dyn Read>) -> Result<Self> {
        let hash = HashHandle::default();
        let hashed = HashingReader { inner: raw, hash: hash.clone() };
        let mut buffered = BufReader::with_capacity(1 << 16, hashed);
        let is_gzip = peek(&mut buffered, &name)?.starts_with(&GZIP_MAGIC);
        let plain: Box<dyn Read> = if is_gzip { Box::new(MultiGzDecoder::new(buffered)) } else { Box::new(buffered) };
        let guarded = LineGuard { inner: plain, since_newline: 0 };
        let mut reader = BufReader::with_capacity(1 << 16, guarded);
        refuse_binary(peek(&mut reader, &name)?).map_err(|e| e.file(&name))?;
        Ok(Self { name, reader: Box::new(reader), hash })
    }
}

fn peek<'a>(reader: &'a mut impl BufRead, name: &str) -> Result<&'a [u8]> {
    reader.fill_buf().map_err(|e| Error::io(name, "read", &e))
}

/// A text log has no zero byte and is UTF-8 where it begins.
fn refuse_binary(start: &[u8]) -> Result<()> {
    let start = &start[..start.len().min(4096)];
    let broken = std::str::from_utf8(start).err().is_some_and(|e| e.error_len().is_some());
    if broken || start.contains(&0) {
        return Err(Error::input("binary data in no format that Sagnac reads")
            .help("logs are CSV (comma, tab or semicolon), also gzipped; convert this file first"));
    }
    Ok(())
}
