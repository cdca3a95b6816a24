//! Delimited text.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sagnac_fuzz::read_log(bytes);
});
