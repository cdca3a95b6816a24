//! A Parquet file whose end is an end.
//!
//! The decoder's own access to a `File` answers reads beyond the end with nothing, and its Thrift reader (parquet
//! 59) takes that for a skipped byte: a damaged page header that announces a list of 2^31 elements is then walked
//! through to the last one, an hour for a file of a kilobyte. Here reading on at the end is an error.

use std::fs::File;
use std::io::{self, BufReader, Read};

use bytes::Bytes;
use parquet::errors::Result;
use parquet::file::reader::{ChunkReader, Length};

/// Reads at the end that are let pass: readers look for the end once or twice.
const PATIENCE: u32 = 8;

/// The file, for the decoder.
pub(crate) struct ParquetFile(pub(crate) File);

/// Bytes from a place on.
pub(crate) struct UntilEnd {
    inner: BufReader<File>,
    at_end: u32,
}

impl Read for UntilEnd {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(out)?;
        if read == 0 && !out.is_empty() {
            self.at_end += 1;
            if self.at_end > PATIENCE {
                return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the file ends before its content"));
            }
        }
        Ok(read)
    }
}

impl Length for ParquetFile {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for ParquetFile {
    type T = UntilEnd;

    fn get_read(&self, start: u64) -> Result<UntilEnd> {
        Ok(UntilEnd { inner: self.0.get_read(start)?, at_end: 0 })
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        self.0.get_bytes(start, length)
    }
}
