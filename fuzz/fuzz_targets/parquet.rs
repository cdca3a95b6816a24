//! Parquet logs.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if !bytes.starts_with(b"PAR1") {
        return;
    }
    sagnac_fuzz::read_log(bytes);
});
