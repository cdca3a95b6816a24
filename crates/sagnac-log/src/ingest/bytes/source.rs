//! Bytes of a log: opened, hashed, unpacked.
//!
//! ```text
//! file or stdin ─▶ SHA-256 ─▶ gunzip if it is gzip ─▶ first bytes, which tell the format ─▶ UTF-16 to UTF-8 ─▶ reader
//! ```

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use flate2::bufread::MultiGzDecoder;
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};
use crate::read::open_input;

const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];
/// So many first bytes tell every format.
pub(crate) const FIRST_BYTES: usize = 8;

/// The running hash of what was read.
#[derive(Clone, Default)]
pub(crate) struct HashHandle(Arc<Mutex<Sha256>>);

impl HashHandle {
    /// SHA-256 of everything read so far, in hexadecimal.
    pub(crate) fn hex(&self) -> String {
        hex(&self.0.lock().unwrap_or_else(PoisonError::into_inner).clone().finalize())
    }

    /// Forgets what was read, and reads all of `bytes`.
    pub(crate) fn begin_anew_with(&self, bytes: impl Read) -> std::io::Result<()> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Sha256::default();
        let mut hashing = HashingReader { inner: bytes, hash: self.clone(), read: Arc::default() };
        std::io::copy(&mut hashing, &mut std::io::sink()).map(|_| ())
    }

    pub(crate) fn update(&self, bytes: &[u8]) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).update(bytes);
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

/// SHA-256 of a file's bytes, in hexadecimal.
///
/// # Errors
/// A file that cannot be read.
pub fn sha256_of_file(path: &Path) -> Result<String> {
    let hash = HashHandle::default();
    let file = File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
    hash.begin_anew_with(file).map_err(|e| Error::io_path(path, "read", &e))?;
    Ok(hash.hex())
}

struct HashingReader<R> {
    inner: R,
    hash: HashHandle,
    /// Bytes that were read.
    read: Arc<AtomicU64>,
}

impl<R: Read> Read for HashingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.hash.update(&buffer[..n]);
        self.read.fetch_add(n as u64, Ordering::Relaxed);
        Ok(n)
    }
}

/// Unpacked bytes, as long as they are not far more than the packed ones: a megabyte of gzip can hold a gigabyte of nothing.
struct Unpacked<R> {
    inner: R,
    packed: Arc<AtomicU64>,
    given: u64,
}

/// Rows that differ in their times alone pack to a fortieth.
const MOST_TIMES_PACKED: u64 = 100;
/// Below this it does not matter.
const FREE_UNPACKED_BYTES: u64 = 16 << 20;

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.given += n as u64;
        let most = self.packed.load(Ordering::Relaxed).saturating_mul(MOST_TIMES_PACKED).max(FREE_UNPACKED_BYTES);
        if self.given > most {
            let what = format!("the gzip file unpacks to over {MOST_TIMES_PACKED} times its size, which no log does");
            return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, what));
        }
        Ok(n)
    }
}

/// Opened bytes of a log.
pub(crate) struct Source {
    pub(crate) name: String,
    pub(crate) reader: Box<dyn BufRead + Send>,
    pub(crate) hash: HashHandle,
    /// Its first bytes, unpacked: fewer than [`FIRST_BYTES`] of a short first line.
    pub(crate) start: Vec<u8>,
    /// The file that holds exactly these bytes: decoders that seek open it again.
    pub(crate) plain_file: Option<PathBuf>,
    packed: bool,
    /// What had to be assumed of the bytes.
    pub(crate) assumed: Vec<String>,
}

/// Callback for the number of bytes read from a file.
pub type Watch = Box<dyn FnMut(u64) + Send>;

/// A file that reports how far it has been read.
struct Watched {
    file: File,
    done: u64,
    watch: Option<Watch>,
}

impl Read for Watched {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.file.read(buffer)?;
        self.done += n as u64;
        if let Some(watch) = &mut self.watch {
            watch(self.done);
        }
        Ok(n)
    }
}

impl Source {
    /// Opens a file, or standard input for `-`.
    pub(crate) fn open(path: &Path, watch: Option<Watch>) -> Result<Self> {
        if path.as_os_str() == "-" {
            return Self::from_reader("standard input".to_owned(), Box::new(std::io::stdin()));
        }
        let name = path.display().to_string();
        let file = open_input(path).map_err(|e| Error::io(&name, "open", &e))?;
        if file.metadata().is_ok_and(|m| m.is_dir()) {
            return Err(
                Error::input("this is a folder, and a log is a file", "give the name of a file in it").file(name)
            );
        }
        let plain = file.metadata().is_ok_and(|m| m.is_file());
        let source = Self::from_reader(name, Box::new(Watched { file, done: 0, watch }))?;
        let plain = plain && !source.packed;
        Ok(Self { plain_file: plain.then(|| path.to_owned()), ..source })
    }

    /// Wraps any reader.
    pub(crate) fn from_reader(name: String, raw: Box<dyn Read + Send>) -> Result<Self> {
        let hash = HashHandle::default();
        let read = Arc::<AtomicU64>::default();
        let hashed = HashingReader { inner: raw, hash: hash.clone(), read: Arc::clone(&read) };
        let reader = Box::new(BufReader::with_capacity(1 << 16, hashed));
        let (mut reader, mut start) = first_bytes(reader, &name)?;
        let packed = start.starts_with(&GZIP_MAGIC);
        if packed {
            let unpacked = Unpacked { inner: MultiGzDecoder::new(reader), packed: read, given: 0 };
            let unpacked = BufReader::with_capacity(1 << 16, unpacked);
            (reader, start) = first_bytes(Box::new(unpacked), &name)?;
        }
        let mut assumed = Vec::new();
        if let Some(encoding) = utf16_of(&start) {
            let decoded = encoding_rs_io::DecodeReaderBytesBuilder::new().bom_override(true).build(reader);
            reader = Box::new(BufReader::with_capacity(1 << 16, decoded));
            assumed.push(format!("text in {encoding}"));
        }
        Ok(Self { name, reader, hash, start, plain_file: None, packed, assumed })
    }
}

/// The encoding of two bytes per character that a byte order mark names; four bytes of ones begin an Arrow stream.
fn utf16_of(start: &[u8]) -> Option<&'static str> {
    match start {
        [0xff, 0xff, ..] | [0xff, 0xfe, 0, 0, ..] => None,
        [0xff, 0xfe, ..] => Some("UTF-16, little-endian"),
        [0xfe, 0xff, ..] => Some("UTF-16, big-endian"),
        _ => None,
    }
}

/// The first bytes of a reader, and a reader that still has them. A reader that gives enough of them at once stays as it is, for its
/// whole first block tells binary data from text. A pipe may give them one by one; a line that ends earlier is text.
fn first_bytes(mut reader: Box<dyn BufRead + Send>, name: &str) -> Result<(Box<dyn BufRead + Send>, Vec<u8>)> {
    let failed = |e: std::io::Error| Error::io(name, "read", &e);
    let mut start = loop {
        match reader.fill_buf() {
            Ok(bytes) => break bytes[..bytes.len().min(FIRST_BYTES)].to_vec(),
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(failed(e)),
        }
    };
    if start.len() == FIRST_BYTES || start.is_empty() || start.contains(&b'\n') {
        return Ok((reader, start));
    }
    start.clear();
    reader.by_ref().take(FIRST_BYTES as u64).read_until(b'\n', &mut start).map_err(failed)?;
    Ok((Box::new(Cursor::new(start.clone()).chain(reader)), start))
}
