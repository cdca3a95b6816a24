//! PX4 ULog files, whose header is put before the bytes.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let header = [0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35, 1, 0, 0, 0, 0, 0, 0, 0, 0];
    sagnac_fuzz::read_log(&[&header[..], bytes].concat());
});
