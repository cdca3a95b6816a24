//! `sagnac fleet demo`: a factory in two minutes. Units of three lots are simulated and calibrated, one rig of three with a thermometer
//! that is off; the fleet's prior plans a shorter test, and more units get by with it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use rayon::prelude::*;
use sagnac::{Error, Result};
use sagnac_log::write::write_bytes;
use sagnac_sim::{Factory, LaggedChamber, Leg, Row, csv_bytes};

use sagnac_units::format::counted;

use crate::output::console::{Console, Outcome, Ran};
use crate::output::shell::command_line;
use crate::verbs::verb::Verb;

/// Simulate a factory: 200 units, their tests, and a shorter test for the next twenty
///
/// Each step prints its command, which you can run again in the folder.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac fleet demo -o factory/")]
pub(crate) struct Args {
    /// Folder to make, with the units' logs and all results
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Number of units; a tenth of them get the short test
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(60..=5000))]
    units: u32,
    /// Seed of the simulation
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

const LOTS: [&str; 3] = ["A", "B", "C"];
const RIGS: [&str; 3] = ["north", "south", "west"];
/// The thermometer of the last rig reads this much too high, °C.
const OFF_C: f64 = 4.0;
/// Interval of a row, s: a window of 100 s has ten.
const ROW_S: u32 = 10;
/// The brief units' odd one: its slope is so many σ away.
const ODD_SIGMAS: f64 = 8.0;
const MODEL: &str = "bias 3, rate 0";
const SETUP: &str = "arcsec_per_count = 0.15125\ninput_rate_dph = 4.498\nreference_c = 25.0\n";

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        let folder = &self.output;
        if fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()) {
            return Err(Error::input("the folder is not empty", "give a new folder, or delete this one first")
                .column("--output")
                .value(folder.display().to_string()));
        }
        let factory = Site { factory: Factory { seed: self.seed }, folder };
        console.say(format!(
            "{} units of three lots on three rigs, 14.8 h in the chamber each and as long a retest; the thermometer of rig west reads {OFF_C} °C high",
            self.units
        ));
        factory.write("bench.toml", SETUP.as_bytes())?;
        factory.units("units", 0..self.units, |_| Test::full())?;
        let pattern = "units/{lot}/{rig}/{unit}/{use}-{run}.csv";
        let more = ["--setup", "bench.toml", "--limits", "navigation-grade"];
        let calibrate = [&["fleet", "calibrate", pattern, "--model", MODEL, "-o", "fleet"], &more[..]].concat();
        factory.sagnac(console, &calibrate, true)?;
        factory.sagnac(console, &["fleet", "report", "fleet", "--report", "fleet.html"], false)?;
        let prior = ["fleet", "prior", "fleet", "--without-rig", RIGS[RIGS.len() - 1], "-o", "fleet.prior.json"];
        factory.sagnac(console, &prior, false)?;
        let plan =
            ["plan", "--prior", "fleet.prior.json", "--lot", "A", "--limits", "navigation-grade", "--start", "20"];
        let plan = [&plan[..], &["--block-lag", "20", "-o", "brief.csv"]].concat();
        factory.sagnac(console, &plan, false)?;
        let brief = Test::planned(
            &fs::read_to_string(folder.join("brief.csv")).map_err(|e| Error::io_path(folder, "read", &e))?,
        )?;
        let next = self.units / 10;
        console.say(format!("\n{next} more units of lot A with that test of {:.1} h; the last is odd", brief.hours()));
        factory.next_units(self.units..self.units + next, &brief)?;
        let pattern = pattern.replace("units/", "next/");
        let calibrate = ["fleet", "calibrate", &pattern, "--prior", "fleet.prior.json", "-o", "next-fleet"];
        factory.sagnac(console, &[&calibrate[..], &more].concat(), true)?;
        console.say(format!("\nEverything is in {}; fleet.html is the report.", folder.display()));
        Ok(Outcome::Done)
    }
}

/// A thermal test: start and legs of the chamber.
#[derive(Clone)]
struct Test {
    start_c: f64,
    legs: Vec<Leg>,
}

impl Test {
    fn full() -> Self {
        let LaggedChamber { start_c, legs, .. } = LaggedChamber::domain_notes().standard();
        Self { start_c, legs }
    }

    /// As `sagnac plan` writes it, from 20 °C.
    fn planned(steps: &str) -> Result<Self> {
        let broken = || Error::defect("these are not the steps of a plan").value(steps);
        let mut legs = Vec::new();
        for line in steps.lines().skip(1) {
            let numbers: Vec<f64> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
            let [to_c, rate_cpm, soak_min] = numbers[..] else { return Err(broken()) };
            legs.extend([Leg::Ramp(to_c, rate_cpm), Leg::Soak(60.0 * soak_min)]);
        }
        Ok(Self { start_c: 20.0, legs })
    }

    fn hours(&self) -> f64 {
        let mut from = self.start_c;
        let mut seconds = 0.0;
        for leg in &self.legs {
            seconds += match leg {
                Leg::Soak(seconds) => *seconds,
                Leg::Ramp(to_c, rate_cpm) => {
                    let ramp = 60.0 * (to_c - from).abs() / rate_cpm;
                    from = *to_c;
                    ramp
                }
            };
        }
        seconds / 3600.0
    }
}

/// Where a factory's logs lie.
struct Site<'a> {
    factory: Factory,
    folder: &'a Path,
}

impl Site<'_> {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.folder.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| Error::io_path(folder, "make the folder", &e))?;
        }
        write_bytes(&path, bytes)
    }

    /// Units of all lots and rigs, with their tests and retests.
    fn units(&self, folder: &str, units: std::ops::Range<u32>, test: impl Fn(u32) -> Test + Sync) -> Result<()> {
        units.into_par_iter().try_for_each(|unit| {
            let (lot, rig) = ((unit % 3) as usize, (unit / 3 % 3) as usize);
            self.unit(folder, unit, lot, rig, &test(unit), 0.0)
        })
    }

    /// Units of the first lot on a sound rig; the last one is odd.
    fn next_units(&self, units: std::ops::Range<u32>, test: &Test) -> Result<()> {
        let last = units.end - 1;
        units.into_par_iter().try_for_each(|unit| {
            let odd = if unit == last { ODD_SIGMAS } else { 0.0 };
            self.unit("next", unit, 0, (unit % 2) as usize, test, odd)
        })
    }

    fn unit(&self, folder: &str, unit: u32, lot: usize, rig: usize, test: &Test, odd_sigmas: f64) -> Result<()> {
        let seed = self.factory.seed.wrapping_mul(1_000_003) + 10 * u64::from(unit);
        let own = self.factory.unit(lot as u64, u64::from(unit), odd_sigmas);
        let gyro =
            |test: &Test| LaggedChamber { start_c: test.start_c, legs: test.legs.clone(), row_s: ROW_S, ..own.clone() };
        let off_c = if rig + 1 == RIGS.len() { OFF_C } else { 0.0 };
        let log = |test: &Test, seed: u64| {
            let rows = gyro(test).run(seed);
            csv_bytes(rows.map(|row| Row { temperature_c: row.temperature_c + off_c, ..row }))
        };
        let place = format!("{folder}/{}/{}/RLG-{unit:04}", LOTS[lot], RIGS[rig]);
        self.write(&format!("{place}/calibrate-1.csv"), &log(test, seed + 1))?;
        self.write(&format!("{place}/verify-1.csv"), &log(&Test::full(), seed + 2))
    }

    /// A command of this program, as it is shown. Of a fleet's many lines the last alone; some of its units may fail.
    fn sagnac(&self, console: &mut Console, args: &[&str], is_of_units: bool) -> Result<()> {
        console.say(format!("\n$ sagnac {}", command_line(args)));
        let program = std::env::current_exe().map_err(|e| Error::io("this program", "find", &e))?;
        let output = Command::new(program).args(args).current_dir(self.folder).output();
        let output = output.map_err(|e| Error::io("this program", "start", &e))?;
        let said = String::from_utf8_lossy(&output.stdout);
        let lines: Vec<&str> = said.lines().collect();
        // Of a fleet those that are not good, and the end.
        let is_shown = |(at, line): &(usize, &&str)| {
            let is_good = !["  refused: ", "  failed: ", "not met"].iter().any(|word| line.contains(word));
            !is_of_units || !is_good || at + SHOWN >= lines.len()
        };
        let shown: Vec<&str> = lines.iter().enumerate().filter(is_shown).map(|(_, line)| *line).collect();
        if shown.len() < lines.len() {
            console.say(format!("… {} more", counted(lines.len() - shown.len(), "unit", "units")));
        }
        shown.into_iter().for_each(|line| console.say(line));
        let may_end = if is_of_units { &[0, 1][..] } else { &[0][..] };
        if output.status.code().is_some_and(|status| may_end.contains(&status)) {
            return Ok(());
        }
        Err(Error::input(
            String::from_utf8_lossy(&output.stderr).trim().to_owned(),
            "correct what this command of the demonstration reports",
        ))
    }
}

/// Last lines of a fleet that are shown.
const SHOWN: usize = 4;
