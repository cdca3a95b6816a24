//! `cargo xtask firmware`: builds the firmware and compares it with the host, a line per check.
//!
//! ```text
//! simulate ─▶ calibrate ─▶ image ─┐
//! scenario ─▶ loops ──────────────┴▶ firmware (thumbv7em) ─▶ QEMU ─▶ vectors, instructions, frames
//! ten-minute log ─▶ messages ─┬─▶ serial line of the emulated board ─▶ frames ─┐
//!                             └─▶ the same board on this machine ─────▶ frames ┴▶ equal, byte for byte
//! ```

mod build;
mod prices;
mod serial_line;
mod unit;

use std::fs;

use anyhow::{Context, Result, ensure};
use xtask::debian::{self, need};
use xtask::shell::root;

pub(crate) use self::build::{build, built, sysroot};
use self::build::{emulate, stm32f407};
use self::prices::{costs, instructions, prices};
pub(crate) use self::serial_line::settings;
use self::serial_line::{line_of, signed_while_ticks_run};
use self::unit::unit;

pub(crate) fn firmware() -> Result<()> {
    need(debian::FIRMWARE)?;
    let folder = root().join("target/firmware");
    fs::create_dir_all(&folder)?;
    let sysroot = sysroot(&folder)?;
    let unit = unit(&folder)?;
    let refused = build(&sysroot, &unit.image, &unit.loops, &["--features", "broken", "--bin", "gyro"])
        .err()
        .context("a firmware with a panic path links")?;
    let reason = format!("{refused:#}");
    ensure!(reason.contains("sagnac_firmware_has_a_panic_path"), "it fails for another reason: {reason}");
    build(&sysroot, &unit.image, &unit.loops, &[])?;
    println!("check: no panic path in the linked programs, and with one they do not link");
    for line in emulate("vectors", &["-serial", "null"], &folder, 300)?.lines() {
        println!("check: Rust on the target: {line}");
    }
    instructions(&folder)?;
    costs(&folder)?;
    prices(&folder)?;
    line_of(&folder, &unit, "without dither", 0, 600)?;
    line_of(&folder, &unit, "dithered", 60, 60)?;
    signed_while_ticks_run(&sysroot, &folder, &unit)?;
    stm32f407(&sysroot)?;
    println!("firmware: every check passed");
    Ok(())
}
