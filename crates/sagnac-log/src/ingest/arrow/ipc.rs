//! Arrow files and streams, checked before their decoder sees them.
//!
//! ```text
//! message: −1, length, metadata (FlatBuffers), body of buffers      every length against the file's, every size against the budget
//! ```
//!
//! The decoder (arrow 59) allocates what a message announces: its metadata, its body, and what its packed buffers unpack to. Dictionaries
//! stay in memory to the end of the file, so they count together; each batch counts for itself.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};

use arrow_ipc::CompressionType;
use arrow_ipc::reader::StreamReader;
use lz4_flex::frame::FrameDecoder;

use crate::error::{Error, Result};
use crate::ingest::arrow::guard::{broken, clone_of, guarded, is_longer};
use crate::memory::MemoryBudget;

/// Writers align the first message of a file to at most this.
const PADDING: usize = 72;
/// Largest metadata of a message, bytes: a description of columns.
const MOST_METADATA: u64 = 8 << 20;
/// A packed buffer of LZ4 unpacks to this many times its size at most.
const LZ4_RATIO: u64 = 255;

/// The two forms of Arrow's format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ArrowForm {
    File,
    Stream,
}

/// Where Arrow's messages begin: in the file form after its magic and padding.
fn messages_at(file: &mut File, form: ArrowForm) -> Result<u64> {
    if form == ArrowForm::Stream {
        return Ok(0);
    }
    let mut start = [0; PADDING];
    let unreadable = |e: std::io::Error| Error::cannot("read", &e);
    file.seek(SeekFrom::Start(0)).map_err(unreadable)?;
    file.read_exact(&mut start).map_err(|_| truncated())?;
    let first = start.chunks_exact(8).skip(1).position(|word| word.starts_with(&[0xff; 4]));
    Ok(8 * (1 + first.unwrap_or(0)) as u64)
}

fn truncated() -> Error {
    Error::damaged("Arrow file: it ends too early")
}

/// A decoder, with the columns of these places alone, if any are given: the others are not unpacked.
pub(crate) fn arrow_reader(
    file: &File,
    form: ArrowForm,
    wanted: Option<Vec<usize>>,
) -> Result<StreamReader<BufReader<File>>> {
    let mut file = clone_of(file)?;
    let at = messages_at(&mut file, form)?;
    file.seek(SeekFrom::Start(at)).map_err(|e| Error::cannot("read", &e))?;
    StreamReader::try_new_buffered(file, wanted).map_err(|e| broken("Arrow file", &e))
}

/// Reads through the messages and checks every length against the file's length, every size against the budget; detects a truncated
/// file.
///
/// # Errors
/// What is wrong, or too large.
pub(crate) fn check_arrow(file: &mut File, form: ArrowForm, memory: MemoryBudget) -> Result<()> {
    let unreadable = |e: std::io::Error| Error::cannot("read", &e);
    let size = file.metadata().map_err(unreadable)?.len();
    if form == ArrowForm::File {
        let mut tail = [0; 6];
        file.seek(SeekFrom::Start(size.saturating_sub(6))).map_err(unreadable)?;
        file.read_exact(&mut tail).map_err(unreadable)?;
        if tail != *b"ARROW1" || size < 24 {
            return Err(truncated());
        }
    }
    let mut at = messages_at(file, form)?;
    let mut dictionaries = 0_u64;
    loop {
        if at == size {
            return Ok(());
        }
        let mut head = [0; 8];
        file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        file.read_exact(&mut head).map_err(|_| truncated())?;
        let [mark, length] = [&head[..4], &head[4..]].map(|part| i32::from_le_bytes(part.try_into().unwrap_or([0; 4])));
        if mark != -1 {
            return Err(Error::input(
                "a damaged Arrow file, or one of a version before 0.15",
                "write it again with a current version of Arrow",
            ));
        }
        if length == 0 {
            return Ok(());
        }
        let length = u64::try_from(length).map_err(|_| truncated())?;
        if at + 8 + length > size {
            return Err(truncated());
        }
        if length > MOST_METADATA {
            return Err(Error::input(
                "an Arrow message has more than 8 MiB of metadata",
                "write the file again without metadata",
            ));
        }
        let mut metadata = vec![0; length as usize];
        file.read_exact(&mut metadata).map_err(|_| truncated())?;
        let body_at = at + 8 + length;
        let message = guarded(|| check_message(&metadata, file, body_at, size, memory.decoder()))?;
        if message.stays {
            dictionaries = dictionaries.saturating_add(message.unpacked);
        }
        if message.unpacked.max(dictionaries) > memory.decoder() {
            return Err(memory.exceeded("a batch that unpacks to", memory.decoder(), "write it with smaller batches"));
        }
        at = body_at + message.body;
    }
}

/// A message's sizes, bytes.
struct MessageSizes {
    /// Of its body in the file.
    body: u64,
    /// Of its buffers in memory: those of the body, or what they unpack to.
    unpacked: u64,
    /// A dictionary, which stays in memory.
    stays: bool,
}

/// The sizes of a message, if they are consistent; `share` is what it may unpack to.
fn check_message(metadata: &[u8], file: &mut File, body_at: u64, size: u64, share: u64) -> Result<MessageSizes> {
    let damaged = |e: &dyn std::fmt::Display| Error::damaged(format!("Arrow file: {e}"));
    let message = arrow_ipc::root_as_message(metadata).map_err(|e| damaged(&e))?;
    let body = u64::try_from(message.bodyLength()).map_err(|e| damaged(&e))?;
    if body_at.saturating_add(body) > size {
        return Err(truncated());
    }
    let dictionary = message.header_as_dictionary_batch().and_then(|batch| batch.data());
    let stays = dictionary.is_some();
    let Some(batch) = message.header_as_record_batch().or(dictionary) else {
        return Ok(MessageSizes { body, unpacked: body, stays });
    };
    let codec = batch.compression().map(|compression| compression.codec());
    let mut unpacked = body;
    for buffer in batch.buffers().iter().flatten() {
        let (offset, length) = (u64::try_from(buffer.offset()), u64::try_from(buffer.length()));
        let (Ok(offset), Ok(length)) = (offset, length) else { return Err(damaged(&"a negative length")) };
        if offset.saturating_add(length) > body {
            return Err(damaged(&"a buffer beyond its message"));
        }
        if let (Some(codec), Some(packed)) = (codec, length.checked_sub(8)) {
            let mut announced = [0; 8];
            file.seek(SeekFrom::Start(body_at + offset)).map_err(|e| damaged(&e))?;
            file.read_exact(&mut announced).map_err(|e| damaged(&e))?;
            // −1: not compressed after all.
            let announced = u64::try_from(i64::from_le_bytes(announced)).unwrap_or(packed);
            unpacked = unpacked.saturating_add(announced);
            // The decoder unpacks an LZ4 frame to its end, whatever was announced.
            let could_be_longer =
                codec == CompressionType::LZ4_FRAME && body.saturating_mul(LZ4_RATIO) > share && unpacked <= share;
            if could_be_longer && is_longer(FrameDecoder::new(file.take(packed)), announced) {
                return Err(damaged(&"a buffer that unpacks to more than it announces"));
            }
        }
    }
    Ok(MessageSizes { body, unpacked, stays })
}
