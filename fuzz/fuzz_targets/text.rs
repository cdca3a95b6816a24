//! Delimited text.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sagnac_fuzz::read_log(bytes);
    // What `sagnac init` looks at.
    if let Ok(sample) = sagnac_log::ingest::sample_reader("fuzz", Box::new(std::io::Cursor::new(bytes.to_vec()))) {
        let all = sample.columns.iter();
        for column in all {
            let _ = column.is_dates();
            assert!(column.numbers().len() <= column.cells.len());
        }
    }
});
