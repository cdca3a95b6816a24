//! Tests of simulated units, and the commands that each goes through.
//!
//! Five kinds of unit in turn: a block that lags; the same with slow noise, a warm-up and a drift in time; many inputs; a knee and
//! steps; a rate table. Sizes are drawn again for each unit.

use std::fs;
use std::path::Path;

use anyhow::Result;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sagnac_sim::{LaggedChamber, Leg, ManyInputs, RateTable, Row, csv_bytes};
use xtask::shell::root;

/// Units in a whole run.
pub(super) const UNITS: usize = 200;
/// Units of a lot of the fleet.
const LOT: u64 = 5;

/// A command and the name of its results.
pub(super) struct Command {
    pub(super) name: &'static str,
    pub(super) args: Vec<String>,
}

impl Command {
    fn new(name: &'static str, line: &str) -> Self {
        Self { name, args: line.split_whitespace().map(|word| word.replace('_', " ")).collect() }
    }
}

/// Sizes of one unit.
struct Draw(ChaCha8Rng);

impl Draw {
    /// A value between two bounds.
    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Sizes of either sign, the next one smaller by a third.
    fn powers(&mut self, number: usize, most: f64) -> Vec<f64> {
        (0..number).map(|power| self.between(-most, most) * 0.67_f64.powi(power as i32)).collect()
    }

    fn is(&mut self, chance: f64) -> bool {
        self.between(0.0, 1.0) < chance
    }
}

/// Writes the logs of a unit into a folder, and says what is to be done with them.
pub(super) fn simulated(number: u64, folder: &Path) -> Result<Vec<Command>> {
    fs::create_dir_all(folder)?;
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(number));
    let logs: [Vec<u8>; 3] = match number % 5 {
        0 => chamber(&mut draw, number, |_| 0.0),
        1 => {
            let (size, tau_s, slope) =
                (draw.between(0.02, 0.1), draw.between(600.0, 3000.0), draw.between(-1e-6, 1e-6));
            chamber(&mut draw, number, move |time_s| size * (-time_s / tau_s).exp() + slope * time_s)
        }
        2 | 3 => {
            let rig = many_inputs(&mut draw, number % 5 == 3);
            [0, 1, 2].map(|run| rig.csv(3 * number + run))
        }
        _ => {
            let rig = RateTable {
                plateaus_c: (0..6).map(|i| -40.0 + 22.0 * f64::from(i)).collect(),
                drift_dph: draw.powers(3, 0.04),
                scale_ppm: draw.powers(3, 40.0),
                ..RateTable::domain_notes()
            };
            [0, 1, 2].map(|run| rig.csv(3 * number + run, true))
        }
    };
    for (name, log) in ["calibrate-1.csv", "calibrate-2.csv", "verify-1.csv"].iter().zip(logs) {
        fs::write(folder.join(name), log)?;
    }
    let arcsec = [0.15125, 0.15125, 0.05, 0.05, 1.059][number as usize % 5];
    fs::write(
        folder.join("bench.toml"),
        format!("serial = \"S-{number}\"\naxis = \"z\"\narcsec_per_count = {arcsec}\ninput_rate_dph = 4.498\n"),
    )?;
    Ok(commands(number))
}

/// Three runs through a chamber, with something over the time of each run, °/h.
fn chamber(draw: &mut Draw, number: u64, over_time: impl Fn(f64) -> f64) -> [Vec<u8>; 3] {
    let soak = Leg::Soak(draw.between(3000.0, 9000.0));
    let (cold, hot, cpm) = (draw.between(-45.0, -10.0), draw.between(40.0, 75.0), draw.between(0.5, 2.0));
    let rig = LaggedChamber {
        start_c: cold,
        legs: vec![soak, Leg::Ramp(hot, cpm), soak, Leg::Ramp(cold, cpm)],
        block_lag_s: draw.between(100.0, 1500.0),
        thermometer_lsb_c: if draw.is(0.5) { 0.0625 } else { 0.001 },
        drift_dph: draw.powers(6, 0.06),
        rate_effect: draw.between(-0.06, 0.06),
        row_s: if draw.is(0.5) { 1 } else { 5 },
        ..LaggedChamber::domain_notes()
    };
    let slow = if draw.is(0.5) { draw.between(0.002, 0.01) } else { 0.0 };
    [0, 1, 2].map(|run| {
        let mut steps = Draw(ChaCha8Rng::seed_from_u64(1000 + 3 * number + run));
        let (mut state, mut angle, mut counted) = (0.0, 0.0, 0.0);
        let dt_s = f64::from(rig.row_s);
        let keep = (-dt_s / 1500.0).exp();
        csv_bytes(rig.run(3 * number + run).map(|row| {
            // A first-order Markov process: uniform steps are normal by their sum.
            state = keep * state + (3.0 * (1.0 - keep * keep)).sqrt() * slow * steps.between(-1.0, 1.0);
            angle += (state + over_time(row.time_s)) * dt_s;
            let whole = (angle / rig.arcsec_per_count).floor();
            let further = whole - counted;
            counted = whole;
            Row { counts: row.counts + further, ..row }
        }))
    })
}

fn many_inputs(draw: &mut Draw, knee_and_steps: bool) -> ManyInputs {
    let mut rig = ManyInputs {
        drift_dph: draw.powers(5, 0.05),
        rate_effects: [draw.between(-0.05, 0.05), 0.0],
        cavity_heat_c: draw.between(0.0, 6.0),
        ..ManyInputs::plain()
    };
    rig.legs.truncate(4);
    if knee_and_steps {
        rig.knee_dph = draw.between(-0.03, 0.03);
        rig.steps_dph = draw.powers(6, 0.03);
    } else {
        rig.gradient_dph_per_c = draw.between(-0.02, 0.02);
        rig.voltage_dph_per_v = if draw.is(0.5) { draw.between(-4e-4, 4e-4) } else { 0.0 };
    }
    rig
}

/// Models in turn, so that what selection passes over is fitted as well. `_` stands for a blank.
const MODELS: [&str; 4] = ["auto", "bias_3,_rate_1", "bias_2,_rate_0,_slow_rate_0", "bias_2,_zones_4,_rate_0"];
/// Further flags in turn.
const FLAGS: [&str; 3] = ["", "--tradeoff", "--warm-up"];

fn commands(number: u64) -> Vec<Command> {
    let model = MODELS[(number / 5 % 4) as usize];
    let flag = FLAGS[(number / 20 % 3) as usize];
    let both = "calibrate-1.csv calibrate-2.csv --setup bench.toml";
    let verify = "verify-1.csv --limits navigation-grade";
    [
        ("calibrate", format!("calibrate {both} {flag} --model auto -o unit.cal.json")),
        ("given", format!("calibrate calibrate-1.csv --setup bench.toml --model {model} -o given.cal.json --json")),
        ("image", "export unit.cal.json --to image -o unit.img".to_owned()),
        ("verify", format!("verify unit.cal.json {verify}")),
        ("verify-json", format!("verify unit.img --setup bench.toml {verify} --json")),
        ("verify-given", format!("verify given.cal.json {verify} --json")),
        ("compare", "compare unit.cal.json given.cal.json --limits navigation-grade --json".to_owned()),
        ("compare-text", "compare unit.cal.json given.cal.json".to_owned()),
        ("evaluate", "evaluate unit.cal.json --at -40:70:10 --json".to_owned()),
        ("inspect", "inspect verify-1.csv --setup bench.toml --json".to_owned()),
    ]
    .map(|(name, line)| Command::new(name, &line))
    .into()
}

/// The logs of testdata.
pub(super) fn testdata(folder: &Path) -> Result<Vec<Command>> {
    fs::create_dir_all(folder)?;
    let at = root().join("testdata");
    let chamber = |file: &str| at.join("chamber").join(file).display().to_string();
    let logs = format!("{} {}", chamber("cycle-1.csv.gz"), chamber("cycle-2.csv.gz"));
    let setup = format!("--setup {}", chamber("bench.toml"));
    let retest = chamber("retest.csv.gz");
    let mems = at.join("mems-chamber-sweep/bench.toml").display().to_string();
    let sweep = root().join("../shared/data/mems-chamber-sweep");
    let mut commands = vec![
        Command::new("chamber", &format!("calibrate {logs} {setup} -o unit.cal.json")),
        Command::new("chamber-json", &format!("calibrate {logs} {setup} -o again.cal.json --json --tradeoff")),
        Command::new("chamber-image", "export unit.cal.json --to image -o unit.img"),
        Command::new(
            "chamber-verify",
            &format!("verify unit.cal.json {retest} --limits {}", chamber("acceptance.toml")),
        ),
        Command::new(
            "chamber-verify-json",
            &format!("verify unit.cal.json {retest} --limits {} --json", chamber("limits.toml")),
        ),
        Command::new("chamber-compare", "compare unit.cal.json again.cal.json"),
    ];
    if sweep.is_dir() {
        commands.push(Command::new(
            "mems",
            &format!("calibrate {} --setup {mems} -o mems.cal.json --json", sweep.display()),
        ));
    }
    Ok(commands)
}

/// Units of one kind as a fleet, its prior, and units calibrated with it.
pub(super) fn fleets(folder: &Path) -> Result<Vec<Command>> {
    for entry in fs::read_dir(folder)?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Some(number) = name.strip_prefix("unit-").and_then(|number| number.parse::<u64>().ok()) else { continue };
        if number % 5 == 0 {
            let unit = folder.join(format!("units/{}/S-{number}", number / 5 % LOT));
            fs::create_dir_all(&unit)?;
            for log in ["calibrate-1.csv", "verify-1.csv"] {
                fs::copy(entry.path().join(log), unit.join(log))?;
            }
        }
    }
    fs::write(folder.join("bench.toml"), "axis = \"z\"\narcsec_per_count = 0.15125\ninput_rate_dph = 4.498\n")?;
    let calibrate = "fleet calibrate units/{lot}/{unit}/{use}-{run}.csv --setup bench.toml --limits navigation-grade";
    let given = calibrate.replace("calibrate units", "calibrate --model bias_3,_rate_0 units");
    Ok([
        ("fleet", format!("{given} -o fleet")),
        ("fleet-auto", format!("{calibrate} -o fleet-auto")),
        ("fleet-report", "fleet report fleet".to_owned()),
        ("prior", "fleet prior fleet -o fleet.prior.json".to_owned()),
        ("fleet-with-prior", format!("{calibrate} --prior fleet.prior.json -o with-prior")),
        ("plan", "plan --prior fleet.prior.json --limits navigation-grade --start 20 --block-lag 20".to_owned()),
    ]
    .map(|(name, line)| Command::new(name, &line))
    .into())
}
