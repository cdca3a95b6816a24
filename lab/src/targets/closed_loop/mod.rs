//! `cargo xtask closed-loop`: the circle closed, with the processor in it.
//!
//! ```text
//! chamber (sagnac simulate) ─ rows ─▶ firmware in QEMU ─ frames over TCP ─▶ sagnac bench ─▶ log, calibration ─▶ image
//!            ▲                             ▲                                                                     │
//!            └── second cycle              └── broken, cut, damaged (refused) and whole upload (confirmed) ──────┘
//! second cycle: corrected counts of the target = sagnac compensate, bit for bit; sagnac verify within limits.toml
//! ```

mod chamber;
mod picture;
mod process;
mod record;
mod recording;
mod target;
mod units;
mod upload;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac_board::{Message, POWER_ON, Reply, ReplyCode, RigSettings, Row};
use sagnac_core::Origin;
use sagnac_log::setup::Setup;
use sagnac_loops::LoopTable;
use sagnac_sim::Scenario;
use xtask::debian::{self, need};
use xtask::shell::{root, text};

use crate::places::CLOSED_LOOP_PICTURE;
use crate::program::Program;
use crate::targets::closed_loop::picture::Drift;
use crate::targets::closed_loop::record::Record;
use crate::targets::closed_loop::recording::Recording;
use crate::targets::closed_loop::target::BoardInQemu;
use crate::targets::closed_loop::units::FRAME_TICKS;
use crate::targets::closed_loop::upload::{Old, Pieces, lost};
use crate::targets::firmware::{build, built, settings as plant_of, sysroot};

/// Ticks of a gyro, 100 µs, in a tick of this unit.
const FASTER: i32 = 100;
/// The target's own counts have so many times less drift (σ) corrected than as counted.
const LEAST_GAIN: f64 = 5.0;
/// Sequence numbers of the factory's image and of that of the first cycle.
const FACTORY: u32 = 1;
const FITTED: u32 = 2;

/// The whole circle. `--picture`: makes the picture again instead of comparing it.
pub(crate) fn closed_loop(args: &[&str]) -> Result<()> {
    need(debian::FIRMWARE)?;
    let unit = FirmwareUnit::make()?;
    let (mut target, woken) = BoardInQemu::start(&unit.firmware)?;
    is(woken, POWER_ON, 0, false)?;
    unit.ships(&mut target)?;
    let first = unit.cycle(&mut target, "cycle-1", FACTORY)?;
    let old = Old { sequence: FACTORY, soak: *first.fed.last().context("an empty cycle")? };
    let (upload, image) = unit.accepted()?;
    old.survives_a_broken_image(&mut target, &upload, &image)?;
    old.survives_a_cut_line(&mut target, &upload)?;
    unit.uploaded(&mut target, &old, &upload)?;
    let second = unit.cycle(&mut target, "cycle-2", FITTED)?;
    unit.verified(&second.record)?;
    is(target.ask(&Message::RollBack, &old.soak)?, Message::ROLL_BACK, FACTORY, false)?;
    println!("check: image {FACTORY} lies whole in the other bank: a roll back puts it in force");
    let said = target.stop()?;
    println!("check: the firmware has ended in order: {}", said.trim());
    drawn(&picture::picture(&first.record, &second.record, unit.arcsec_per_count)?, args.contains(&"--picture"))?;
    println!("closed-loop: every check passed");
    Ok(())
}

/// The gyro, its firmware and its files.
struct FirmwareUnit {
    work: PathBuf,
    /// Folder of scenarios, setup and limits.
    given: PathBuf,
    firmware: PathBuf,
    settings: RigSettings,
    arcsec_per_count: f64,
}

/// A cycle: the rows that were fed, and what the bench recorded.
struct Cycle {
    fed: Vec<Row>,
    record: Record,
}

impl FirmwareUnit {
    /// The factory's calibration of the gyro, and the firmware that is built with its image.
    fn make() -> Result<Self> {
        let work = root().join("target/closed-loop");
        if work.exists() {
            fs::remove_dir_all(&work).with_context(|| format!("cannot empty {}", work.display()))?;
        }
        fs::create_dir_all(&work).with_context(|| format!("cannot make {}", work.display()))?;
        let given = root().join("firmware/gyro/closed-loop");
        let setup = Setup::read(given.join("bench.toml"))?;
        let arcsec_per_count = setup.arcsec_per_count.context("bench.toml has no arcsec_per_count")?;
        let (firmware, settings) = (work.join("gyro"), RigSettings::default());
        let mut unit = Self { work, given, firmware, settings, arcsec_per_count };
        unit.simulated("factory")?;
        unit.sagnac(&["calibrate", "factory.csv", "--setup", &unit.given("bench.toml")?, "-o", "factory.cal.json"])?;
        unit.sagnac(&["export", "factory.cal.json", "--to", "image", "-o", "factory.img"])?;
        unit.sagnac(&["export", &unit.given("factory.toml")?, "--to", "loops", "-o", "unit.loops"])?;
        let plant = plant_of(&LoopTable::decode(&unit.read("unit.loops")?)?, 0);
        // A degree takes a hundredth of the ticks, so the path moves a hundredth of the way: as much in a tick as in a gyro.
        unit.settings = RigSettings { peak_slope: plant.peak_slope / FASTER, ..plant };
        unit.build()?;
        Ok(unit)
    }

    /// Messages are handled while rows run, as on a gyro: the feature `live`.
    fn build(&self) -> Result<()> {
        let folder = root().join("target/firmware");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let (image, loops) = (self.work.join("factory.img"), self.work.join("unit.loops"));
        build(&sysroot(&folder)?, &image, &loops, &["--features", "live", "--bin", "gyro"])?;
        fs::copy(built("gyro"), &self.firmware).context("the firmware that was built")?;
        Ok(())
    }

    /// The gyro gets the factory's image, and is switched off and on.
    fn ships(&self, target: &mut BoardInQemu) -> Result<()> {
        self.sagnac(&["export", "factory.cal.json", "--to", "upload", "-o", "factory.up"])?;
        let upload = Pieces::read(&self.read("factory.up")?)?;
        let shelf = Row { ticks: FRAME_TICKS, counts: 7, present: 1, codes: [20 << 24, 0, 0, 0] };
        let reply = Old { sequence: 0, soak: shelf }.send(target, &upload)?;
        is(reply, Message::COMMIT, FACTORY, false)?;
        println!("check: the gyro leaves the factory with image {FACTORY}");
        target.idle()
    }

    /// The log of a scenario, whose counts are as long as the setup says.
    fn simulated(&self, name: &str) -> Result<PathBuf> {
        let (scenario, log) = (self.given(&format!("{name}.toml"))?, format!("{name}.csv"));
        let text = fs::read_to_string(&scenario).with_context(|| format!("cannot read {scenario}"))?;
        let arcsec = Scenario::from_toml(&text)?.arcsec_per_count();
        let same = (arcsec / self.arcsec_per_count - 1.0).abs() < 1e-12;
        ensure!(same, "a count of {name} is {arcsec} arcsec, of bench.toml {}", self.arcsec_per_count);
        self.sagnac(&["simulate", &scenario, "-o", &log])?;
        Ok(self.work.join(log))
    }

    /// A cycle of the chamber from power-on, recorded by the bench.
    fn cycle(&self, target: &mut BoardInQemu, name: &str, sequence: u32) -> Result<Cycle> {
        let fed = chamber::rows(&self.simulated(name)?)?;
        let (recording, line) = Recording::start(&self.work, &self.given("bench.toml")?, name)?;
        target.idle()?;
        target.tap = Some(line);
        is(target.power_on(self.settings)?, POWER_ON, sequence, false)?;
        target.run(&fed)?;
        let said = recording.end(target.tap.take().context("the bench's line")?)?;
        fs::write(self.work.join(format!("{name}.txt")), said)
            .with_context(|| format!("what the bench said of {name}"))?;
        ensure!(lost(&target.outputs) == 0, "{name}: frames are lost on the line");
        let record = Record::read(&self.work.join(format!("{name}.parquet")))?;
        let counts = record.holds_what_was_fed(&fed)?;
        println!("check: {name}: {} frames recorded, none missing; {counts} counts, frame by frame as fed", fed.len());
        let image = if sequence == FACTORY { "factory.img" } else { "fitted.img" };
        let equal = record.is_as_compensated(&self.work, image, &self.given("bench.toml")?, name)?;
        println!(
            "check: {name}: corrected counts of image {sequence} on the target equal the host's in all {equal} frames"
        );
        Ok(Cycle { fed, record })
    }

    /// The bench's calibration is that of the recorded log, byte for byte; its image, and the upload of it on trial.
    fn accepted(&self) -> Result<(Pieces, Vec<u8>)> {
        let setup = self.given("bench.toml")?;
        self.sagnac(&["calibrate", "cycle-1.parquet", "--setup", &setup, "-o", "again.cal.json"])?;
        let (live, again) = (self.read("cycle-1.cal.json")?, self.read("again.cal.json")?);
        ensure!(
            live == again,
            "the bench's calibration and `sagnac calibrate` of its log differ, in {}",
            self.work.display()
        );
        println!("check: the bench's calibration is that of `sagnac calibrate` on its log, byte for byte");
        let sequence = FITTED.to_string();
        let export = ["export", "cycle-1.cal.json", "--sequence", &sequence, "--to"];
        self.sagnac(&[&export[..], &["image", "-o", "fitted.img"]].concat())?;
        self.sagnac(&[&export[..], &["upload", "--trial", "-o", "fitted.up"]].concat())?;
        Ok((Pieces::read(&self.read("fitted.up")?)?, self.read("fitted.img")?))
    }

    /// The whole upload is taken on trial while ticks run, and confirmed.
    fn uploaded(&self, target: &mut BoardInQemu, old: &Old, upload: &Pieces) -> Result<()> {
        let before = target.outputs.len();
        is(old.send(target, upload)?, Message::COMMIT, FITTED, true)?;
        old.frames_say(target, true)?;
        self.sagnac(&["line", "send", "confirm", "-o", "confirm.bin"])?;
        let confirm = self.read("confirm.bin")?;
        ensure!(confirm == target::bytes_of(&Message::Confirm)?, "`sagnac line send confirm` makes another message");
        is(target.ask(&Message::Confirm, &old.soak)?, Message::CONFIRM, FITTED, false)?;
        old.frames_say(target, false)?;
        let during = target.outputs.get(before..).unwrap_or(&[]);
        ensure!(lost(during) == 0, "the upload costs frames");
        println!(
            "check: image {FITTED} is taken on trial and confirmed within {} frames, none lost; answers and frames say so",
            during.len()
        );
        Ok(())
    }

    /// The retest meets the limits, and its proof is what the target did.
    fn verified(&self, record: &Record) -> Result<()> {
        let limits = self.given("limits.toml")?;
        let axis = self.proof("cycle-2.parquet", &["--limits", &limits])?;
        ensure!(axis["pass"] == true, "the limits are not met: {axis}");
        let number = |name: &str| axis[name].as_f64().with_context(|| format!("no {name} in the proof"));
        println!(
            "check: `sagnac verify` of the recorded log meets limits.toml: max − min improved {:.2} times, σ {:.2} times",
            number("improvement")?,
            number("improvement_sigma")?
        );
        let windows = record.is_as_verified(&axis["after"])?;
        println!(
            "check: the {windows} windows after correction of `sagnac verify` are those of the target's own counts"
        );
        let sigma = |counts: &[f64]| Drift::of(counts, self.arcsec_per_count).sigma_dph();
        let (before, after) = (sigma(&record.counts), sigma(&record.target));
        let gain = before / after;
        ensure!(gain > LEAST_GAIN, "σ {before} °/h as counted, {after} °/h as the target corrected it");
        println!(
            "check: the target's own counts: σ {before:.4} °/h as counted, {after:.4} °/h corrected: {gain:.2} times"
        );
        Ok(())
    }

    /// What `sagnac verify` says of the fitted image on a log.
    fn proof(&self, log: &str, limits: &[&str]) -> Result<serde_json::Value> {
        let setup = self.given("bench.toml")?;
        let verify = ["verify", "fitted.img", log, "--setup", &setup, "--json"];
        let mut proof: serde_json::Value = serde_json::from_str(&self.sagnac(&[&verify[..], limits].concat())?)?;
        proof.pointer_mut("/axes/0").map(serde_json::Value::take).context("a proof without an axis")
    }

    fn sagnac(&self, args: &[&str]) -> Result<String> {
        Program::beside_the_lab()?.stdout_in(&self.work, args)
    }

    /// A file of the folder of scenarios.
    fn given(&self, name: &str) -> Result<String> {
        Ok(text(&self.given.join(name))?.to_owned())
    }

    /// A file that was made.
    fn read(&self, name: &str) -> Result<Vec<u8>> {
        let path = self.work.join(name);
        fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
    }
}

/// The target has done what it was told, and says that this image is in force: 0 for the factory defaults.
fn is(reply: Reply, to: u8, sequence: u32, trial: bool) -> Result<()> {
    let origin = if sequence == 0 { Origin::FactoryDefaults } else { Origin::Newest };
    let expected = Reply { to, code: ReplyCode::Done, sequence, origin, trial };
    ensure!(reply == expected, "the target says {reply:?}; due is {expected:?}");
    Ok(())
}

/// Compares the picture of the page, or writes it.
fn drawn(svg: &str, anew: bool) -> Result<()> {
    let path: &Path = &root().join(CLOSED_LOOP_PICTURE);
    if anew {
        fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))?;
        println!("wrote {}", path.display());
        return Ok(());
    }
    let before = fs::read_to_string(path).with_context(|| format!("no picture {}", path.display()))?;
    ensure!(before == svg, "{CLOSED_LOOP_PICTURE} is out of date: `cargo xtask closed-loop --picture` makes it again");
    println!("check: {CLOSED_LOOP_PICTURE} is of this run");
    Ok(())
}
