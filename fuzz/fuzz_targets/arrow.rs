//! Arrow logs, file and stream.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if !bytes.starts_with(b"ARROW1") && !bytes.starts_with(&[0xff; 4]) {
        return;
    }
    sagnac_fuzz::read_log(bytes);
});
