//! The unit that the firmware is built for: its image, its loops and its log.

use std::path::{Path, PathBuf};

use anyhow::Result;
use xtask::shell::text;

use crate::program::Program;

const SCENARIO: &str = "firmware/gyro/ten-minutes.toml";
/// The unit that the firmware is built for.
pub(super) struct FirmwareUnit {
    pub(super) image: PathBuf,
    pub(super) loops: PathBuf,
    pub(super) log: PathBuf,
}

/// Made by the program itself: a calibration from the long log, its image, the loops, the ten-minute log.
pub(super) fn unit(folder: &Path) -> Result<FirmwareUnit> {
    let file = |name: &str| folder.join(name);
    let unit = FirmwareUnit { image: file("unit.img"), loops: file("unit.loops"), log: file("ten-minutes.csv") };
    let (thermal, calibration) = (file("thermal.csv"), file("unit.cal.json"));
    sagnac(&["simulate", "scenarios/paper/paper.toml", "-o", text(&thermal)?])?;
    let calibrate = ["calibrate", text(&thermal)?, "--setup", "scenarios/paper/bench.toml", "-o"];
    sagnac(&[&calibrate[..], &[text(&calibration)?]].concat())?;
    sagnac(&["export", text(&calibration)?, "--to", "image", "-o", text(&unit.image)?])?;
    sagnac(&["export", SCENARIO, "--to", "loops", "-o", text(&unit.loops)?])?;
    sagnac(&["simulate", SCENARIO, "-o", text(&unit.log)?])?;
    Ok(unit)
}

pub(super) fn sagnac(args: &[&str]) -> Result<String> {
    Program::beside_the_lab()?.stdout(args)
}
