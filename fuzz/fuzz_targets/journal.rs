//! The journal of a recording: any bytes behind its magic are read to their end, and no block is read twice.
#![no_main]

use std::io::Write;

use sagnac_bench::JournalRows;
use sagnac_bench::journal::JournalReader;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(&[&b"SGJ2"[..], bytes].concat()).expect("a disk with room");
    let mut reader = JournalReader::open(file.path()).expect("it begins with the magic");
    let mut at = 0;
    while let Some(entries) = reader.next_block(u64::MAX).expect("a file that can be read") {
        assert!(reader.position() > at);
        at = reader.position();
        assert!(entries.iter().all(|entry| entry.payload.len() <= sagnac_bench::journal::MOST_BLOCK_BYTES));
    }
    assert!(reader.position() + reader.damaged() <= bytes.len() as u64 + 4);
    if let Ok(mut rows) = JournalRows::open(file.path()) {
        while let Ok(Some(_)) = rows.next_rows() {}
    }
});
