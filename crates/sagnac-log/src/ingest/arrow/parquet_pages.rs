//! Reads the headers of a Parquet file's pages before the decoder sees them: what the columns that are read would unpack to.
//!
//! ```text
//! column chunk ─▶ header, page, header, page, …      largest dictionary and data page of each column, values of all
//! ```
//!
//! The decoder (parquet 59) allocates what a page header announces. A page of 10 kB can announce 2 GiB, and a dictionary of one cell of
//! 300 MB serves every row. A reader holds one dictionary and one page of each column at a time, so these together are compared with the
//! budget. A batch of rows holds the pages of all of its cells, so the mean bytes of a row say how many rows can be decoded at once.
//!
//! Snappy, Zstandard and LZ4 unpack to the announced size at most. Gzip, and the LZ4 frames of old writers, do not stop there: a page of
//! these that could be longer is unpacked once for its length.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use flate2::read::MultiGzDecoder;
use lz4_flex::frame::FrameDecoder;
use parquet::basic::Compression;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};

use crate::ingest::arrow::guard::is_longer;
use crate::ingest::arrow::thrift::{PageSizes, Part, Walk};

/// First attempt at the length of a page header, and the longest one.
const HEADER_BYTES: [usize; 2] = [1 << 10, 1 << 20];
/// A byte of gzip unpacks to this many at most, one of an LZ4 frame to fewer.
const MOST_RATIO: u64 = 1032;
/// A page that cannot unpack to more than this is not looked into.
const SMALL_BYTES: u64 = 32 << 20;
const INDEX: u64 = 1;
const DICTIONARY: u64 = 2;

/// What the columns that are read unpack to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Unpacked {
    /// Bytes of the largest dictionary and the largest page of each column, together.
    pub(crate) pages: u64,
    /// Values of all pages of all columns.
    pub(crate) values: u64,
    /// Bytes of a row: of each column the mean value in the page where it is largest, together.
    pub(crate) row: u64,
}

/// Sizes of the columns with these indices of the schema's leaves.
///
/// # Errors
/// What is wrong: a page beyond its column, a header that is none, a page that unpacks to more than it announces.
pub(crate) fn unpacked(
    file: &File,
    metadata: &ParquetMetaData,
    is_read: impl Fn(usize) -> bool,
) -> Result<Unpacked, String> {
    let mut file = file.try_clone().map_err(|e| e.to_string())?;
    let mut all = Unpacked::default();
    let columns = metadata.file_metadata().schema_descr().num_columns();
    for column in (0..columns).filter(|column| is_read(*column)) {
        let [mut dictionary, mut page, mut value] = [0_u64; 3];
        for group in metadata.row_groups() {
            let Some(chunk) = group.columns().get(column) else { continue };
            pages_of(&mut file, chunk, &mut |sizes| {
                if sizes.kind == DICTIONARY {
                    dictionary = dictionary.max(sizes.unpacked);
                } else {
                    page = page.max(sizes.unpacked);
                    all.values = all.values.saturating_add(sizes.values);
                }
                value = value.max(sizes.unpacked / sizes.values.max(1));
            })?;
        }
        all.pages = all.pages.saturating_add(dictionary).saturating_add(page);
        all.row = all.row.saturating_add(value);
    }
    Ok(all)
}

/// Calls `take` with the sizes of each page of a column chunk.
fn pages_of(file: &mut File, chunk: &ColumnChunkMetaData, take: &mut dyn FnMut(PageSizes)) -> Result<(), String> {
    let beyond = || "a page beyond its column".to_owned();
    let first = chunk.dictionary_page_offset().filter(|at| *at > 0).unwrap_or(chunk.data_page_offset());
    let first = u64::try_from(first).map_err(|_| beyond())?;
    let length = u64::try_from(chunk.compressed_size()).map_err(|_| beyond())?;
    let end = first.checked_add(length).ok_or_else(beyond)?;
    let mut at = first;
    while at < end {
        let (header, sizes) = header_at(file, at, end)?;
        let body_at = at + header;
        at = body_at.checked_add(sizes.packed).filter(|next| *next <= end).ok_or_else(beyond)?;
        if sizes.kind != INDEX {
            check_announced(file, body_at, sizes, chunk.compression())?;
            take(sizes);
        }
    }
    Ok(())
}

/// The page header at an offset: its length and what it states.
fn header_at(file: &mut File, at: u64, end: u64) -> Result<(u64, PageSizes), String> {
    for most in HEADER_BYTES {
        let mut bytes = Vec::new();
        let room = (end - at).min(most as u64);
        file.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
        file.by_ref().take(room).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
        let mut walk = Walk::new(&bytes);
        if walk.structure(0, Some(Part::Page)).is_some() {
            return Ok(((bytes.len() - walk.left.len()) as u64, walk.page));
        }
    }
    Err("a page header that is damaged".to_owned())
}

/// Refuses a page that unpacks to more than it announces, where its decoder would not.
fn check_announced(file: &mut File, at: u64, sizes: PageSizes, codec: Compression) -> Result<(), String> {
    let (packed, announced) = (sizes.packed.saturating_sub(sizes.levels), sizes.unpacked.saturating_sub(sizes.levels));
    if packed.saturating_mul(MOST_RATIO) <= SMALL_BYTES.max(announced) {
        return Ok(());
    }
    file.seek(SeekFrom::Start(at.saturating_add(sizes.levels))).map_err(|e| e.to_string())?;
    let page = file.take(packed);
    let longer = match codec {
        Compression::GZIP(_) => is_longer(MultiGzDecoder::new(page), announced),
        // Another form of LZ4 is no frame from its first byte on.
        Compression::LZ4 => is_longer(FrameDecoder::new(page), announced),
        _ => false,
    };
    if longer { Err("a page that unpacks to more than it announces".to_owned()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float64Array, RecordBatch};
    use parquet::arrow::ArrowWriter;
    use parquet::arrow::arrow_reader::ArrowReaderMetadata;
    use parquet::basic::GzipLevel;
    use parquet::file::properties::{WriterProperties, WriterVersion};

    use super::*;

    const ROWS: usize = 20_000;

    /// A column of numbers that do not repeat, in one page.
    fn file(codec: Compression, version: WriterVersion) -> Vec<u8> {
        let values = (0..ROWS).map(|i| f64::from(i as u32).sqrt());
        let column: ArrayRef = Arc::new(Float64Array::from_iter_values(values));
        let batch = RecordBatch::try_from_iter([("counts", column)]).unwrap();
        let properties = WriterProperties::builder()
            .set_compression(codec)
            .set_writer_version(version)
            .set_dictionary_enabled(false)
            .build();
        let mut bytes = Vec::new();
        let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        bytes
    }

    fn sizes(bytes: &[u8]) -> Result<Unpacked, String> {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        let metadata = ArrowReaderMetadata::load(&file, Default::default()).unwrap();
        unpacked(&file, metadata.metadata(), |_| true)
    }

    #[test]
    fn sizes_are_those_of_the_pages() {
        let gzip = Compression::GZIP(GzipLevel::default());
        for codec in [Compression::UNCOMPRESSED, Compression::SNAPPY, gzip, Compression::LZ4_RAW] {
            for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
                let found = sizes(&file(codec, version)).unwrap();
                assert_eq!(found.values, ROWS as u64, "{codec} {version:?}");
                assert!((8 * ROWS as u64..9 * ROWS as u64).contains(&found.pages), "{codec} {version:?}: {found:?}");
                assert_eq!(found.row, 8, "{codec} {version:?}");
            }
        }
    }

    /// A batch of rows holds the cells of every column, so a row is as long as all of them.
    #[test]
    fn a_row_has_the_cells_of_every_column() {
        let column = || Arc::new(Float64Array::from_iter_values((0..100).map(f64::from))) as ArrayRef;
        let batch = RecordBatch::try_from_iter([("a", column()), ("b", column()), ("c", column())]).unwrap();
        let mut bytes = Vec::new();
        let properties = WriterProperties::builder().set_dictionary_enabled(false).build();
        let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        assert_eq!(sizes(&bytes).unwrap().row, 3 * 8);
    }

    /// The size in the header is made smaller by a bit of its varint; the pages stay as they are.
    #[test]
    fn a_page_of_gzip_that_unpacks_to_more_is_refused() {
        for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
            let mut bytes = file(Compression::GZIP(GzipLevel::default()), version);
            assert!(sizes(&bytes).is_ok());
            // Behind `PAR1`: field 1, the kind, then field 2, the size unpacked.
            assert_eq!((bytes[4], bytes[6]), (0x15, 0x15));
            let last = 7 + bytes[7..].iter().position(|byte| byte & 0x80 == 0).unwrap();
            bytes[last] -= 1;
            assert_eq!(sizes(&bytes), Err("a page that unpacks to more than it announces".to_owned()), "{version:?}");
        }
    }

    #[test]
    fn a_page_beyond_its_column_is_refused() {
        let mut bytes = file(Compression::UNCOMPRESSED, WriterVersion::PARQUET_1_0);
        let packed = bytes[7..].iter().position(|byte| *byte == 0x15).unwrap() + 8;
        let last = packed + bytes[packed..].iter().position(|byte| byte & 0x80 == 0).unwrap();
        bytes[last] += 1;
        assert_eq!(sizes(&bytes), Err("a page beyond its column".to_owned()));
    }
}
