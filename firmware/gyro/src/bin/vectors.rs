//! The Rust core on the target against the reference vectors.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use sagnac_firmware::{finish, say};
use sagnac_vectors::check;

macro_rules! vectors {
    ($($name:literal),+ $(,)?) => {
        [$(($name, include_bytes!(concat!("../../../../testdata/vectors/", $name, ".hex")).as_slice())),+]
    };
}

const FILES: [(&str, &[u8]); 15] = vectors!(
    "compensator-full",
    "compensator-paper",
    "compensator-inputs",
    "compensator-harmonic",
    "compensator-lags",
    "compensator-warm-up",
    "compensator-edges",
    "compensator-advance",
    "compensator-limits",
    "path-length-mirror",
    "path-length-heater",
    "intensity",
    "quadrature",
    "stripper",
    "watch",
);

#[entry]
fn main() -> ! {
    let mut passed = true;
    for (name, text) in FILES {
        match check(text) {
            Ok(done) => say(format_args!("{name}: {} records equal, {} ticks", done.records, done.ticks)),
            Err(failure) => {
                say(format_args!("{name}: FAILED: {failure}"));
                passed = false;
            }
        }
    }
    finish(passed)
}
