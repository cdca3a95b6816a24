//! The text of a vector file, word by word.

use core::fmt;

use crate::{MAGIC, MAX_TABLE, Module, RECORD};

/// The first four words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Module tested.
    pub module: Module,
    /// Length of the table, bytes.
    pub table_len: usize,
    /// Number of records.
    pub records: u32,
}

/// Why a text is refused as a vector file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadFile {
    /// Text that is not a hexadecimal word of at most eight digits.
    NotAWord {
        /// Line, from 1.
        line: u32,
    },
    /// The text ends before the last record that its head announces.
    TooShort,
    /// There are words after the last record.
    TooLong {
        /// Line, from 1.
        line: u32,
    },
    /// The first word is not [`MAGIC`].
    NotVectors,
    /// The module is unknown.
    UnknownModule(u32),
    /// The table is longer than [`MAX_TABLE`].
    LongTable(u32),
}

impl fmt::Display for BadFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAWord { line } => write!(f, "line {line}: not a hexadecimal word of at most eight digits"),
            Self::TooShort => f.write_str("ends before its last record"),
            Self::TooLong { line } => write!(f, "line {line}: words after the last record"),
            Self::NotVectors => write!(f, "the first word is not {MAGIC:08x}"),
            Self::UnknownModule(number) => write!(f, "module {number} is unknown"),
            Self::LongTable(len) => write!(f, "a table of {len} bytes; the longest has {MAX_TABLE}"),
        }
    }
}

impl core::error::Error for BadFile {}

/// Reads the words of a file.
#[derive(Clone, Debug)]
pub struct Words<'a> {
    rest: &'a [u8],
    line: u32,
}

impl<'a> Words<'a> {
    /// Starts at the beginning of a text.
    pub const fn new(text: &'a [u8]) -> Self {
        Self { rest: text, line: 1 }
    }

    /// Reads the head.
    ///
    /// # Errors
    /// [`BadFile`].
    pub fn head(&mut self) -> Result<Head, BadFile> {
        if self.word()? != MAGIC {
            return Err(BadFile::NotVectors);
        }
        let number = self.word()?;
        let module = Module::of(number).ok_or(BadFile::UnknownModule(number))?;
        let len = self.word()?;
        let table_len = len as usize;
        if table_len > MAX_TABLE {
            return Err(BadFile::LongTable(len));
        }
        Ok(Head { module, table_len, records: self.word()? })
    }

    /// Reads the bytes of the table.
    ///
    /// # Errors
    /// [`BadFile`].
    pub fn table<'b>(&mut self, head: &Head, bytes: &'b mut [u8; MAX_TABLE]) -> Result<&'b [u8], BadFile> {
        let used = bytes.get_mut(..head.table_len).ok_or(BadFile::TooShort)?;
        for four in used.chunks_mut(4) {
            let word = self.word()?.to_le_bytes();
            four.iter_mut().zip(word).for_each(|(slot, byte)| *slot = byte);
        }
        Ok(used)
    }

    /// Reads the next record.
    ///
    /// # Errors
    /// [`BadFile`].
    pub fn record(&mut self) -> Result<[u32; RECORD], BadFile> {
        let mut record = [0; RECORD];
        for slot in &mut record {
            *slot = self.word()?;
        }
        Ok(record)
    }

    /// Checks that nothing follows.
    ///
    /// # Errors
    /// [`BadFile::TooLong`], or the error of what follows.
    pub fn end(&mut self) -> Result<(), BadFile> {
        match self.word() {
            Err(BadFile::TooShort) => Ok(()),
            Ok(_) => Err(BadFile::TooLong { line: self.line }),
            Err(other) => Err(other),
        }
    }

    fn word(&mut self) -> Result<u32, BadFile> {
        self.skip();
        if self.rest.is_empty() {
            return Err(BadFile::TooShort);
        }
        let bad = BadFile::NotAWord { line: self.line };
        let (mut value, mut digits) = (0_u32, 0);
        while let [first, rest @ ..] = self.rest {
            if first.is_ascii_whitespace() {
                break;
            }
            let digit = char::from(*first).to_digit(16).filter(|_| digits < 8).ok_or(bad)?;
            (value, digits, self.rest) = ((value << 4) | digit, digits + 1, rest);
        }
        Ok(value)
    }

    /// Skips white space and comments.
    fn skip(&mut self) {
        let mut comment = false;
        while let [first, rest @ ..] = self.rest {
            comment |= self.rest.starts_with(b"//");
            if !comment && !first.is_ascii_whitespace() {
                return;
            }
            if *first == b'\n' {
                comment = false;
                self.line = self.line.saturating_add(1);
            }
            self.rest = rest;
        }
    }
}
