//! Limits files.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _ = sagnac::verify::Limits::parse(text);
});
