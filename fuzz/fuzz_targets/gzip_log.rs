//! Gzip of anything, whose magic is put before the bytes.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sagnac_fuzz::read_log(&[&[0x1f, 0x8b, 8][..], bytes].concat());
});
