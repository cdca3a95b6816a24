//! A test that lacks a tool or a recording. libtest counts an early return as passed, so that the test says it here.

use std::fs::OpenOptions;
use std::io::Write;

/// The file that counts them, by `cargo xtask test`.
pub const SKIPPED: &str = "SAGNAC_SKIPPED";

/// True where CI demands every tool and every recording.
pub fn demands_everything() -> bool {
    std::env::var_os("SAGNAC_REQUIRE_SHARED").is_some_and(|value| value == "1")
}

/// Says in one line what a test lacks.
///
/// # Panics
/// Where CI demands everything, or the line cannot be counted.
pub fn skip(lacks: &str) {
    assert!(!demands_everything(), "{lacks}");
    let thread = std::thread::current();
    let line = format!("skipped: {}: {lacks}\n", thread.name().unwrap_or("a test"));
    print!("{line}");
    let Some(path) = std::env::var_os(SKIPPED) else { return };
    let file = OpenOptions::new().create(true).append(true).open(&path);
    if let Err(error) = file.and_then(|mut file| file.write_all(line.as_bytes())) {
        panic!("cannot count a skipped test in {}: {error}", path.display());
    }
}
