//! Kinds of cases: which files are made how, and which commands run on them.

use std::fs;

use anyhow::{Context, Result};
use sagnac_sim::{LaggedChamber, csv_bytes};
use tempfile::TempDir;

use super::case::HuntCase;
use super::chance::Chance;
use super::documents::{image, json, stream, toml};
use super::logs::log;
use crate::program::Program;

/// Beginnings of the names that commands may write.
pub(super) const OUTPUTS: [&str; 2] = ["out", "windows.parquet"];

const BENCH: &str = "\
serial = \"RLG-7\"
axis = \"x\"
sensor = \"ring laser gyro\"
arcsec_per_count = 0.15125
quantum = 1.0
counter = \"incremental\"
window = 100.0
reference_c = 20.0
min_span_c = 5.0
discard_initial_s = 60.0
temperature_offset_s = 0.0
tick_s = 0.0001
temperature_period_s = 1.0
slew_ticks = 100
input_rate_dph = 4.5
[noise]
n_deg_rt_h = 0.003
[columns]
temperature_c = \"temperature_c\"
[[thermometer]]
name = \"\"
valid_range_c = [-80.0, 125.0]
[[table]]
file = \"log.csv\"
rate_dps = 0.0
";

const LIMITS: &str = "\
base = \"navigation-grade\"
decision = \"guarded\"
sigma_dph_max = 0.1
peak_to_peak_dph_max = 1.0
sigma_over_floor_max = 3.0
improvement_min = 1.5
plateau_sigma_dph_max = 0.1
arw_deg_rt_h_max = 0.01
bias_repeatability_dph_max = 0.5
excluded_max = 0.005
";

const SCENARIO: &str = "\
name = \"small\"
seed = 1
[geometry]
shape = \"square\"
perimeter_m = 0.28
[dither]
frequency_hz = 400.0
amplitude_arcsec = 150.0
[noise]
arw_deg_rt_h = 0.003
[[thermometer]]
[chamber]
leg = [{ soak_s = 100 }, { to_c = 30, rate_cpm = 1 }]
";

const CURVE: &str =
    "tau_s,adev_dph\n1,6\n2,4.3\n4,3\n8,2.1\n16,1.5\n32,1.1\n64,0.76\n128,0.54\n256,0.4\n512,0.32\n1024,0.3\n";

/// Good files, made by the program.
pub(super) struct Materials {
    log: Vec<u8>,
    record: String,
    image: Vec<u8>,
    signed: Vec<u8>,
    key: Vec<u8>,
    public: Vec<u8>,
}

impl Materials {
    pub(super) fn make(program: &Program) -> Result<Self> {
        let folder = TempDir::new()?;
        let at = |name: &str| folder.path().join(name);
        let log = csv_bytes(LaggedChamber { row_s: 30, ..LaggedChamber::domain_notes() }.run(3));
        fs::write(at("log.csv"), &log)?;
        fs::write(at("bench.toml"), BENCH)?;
        for line in [
            "calibrate log.csv --setup bench.toml --model|bias 3, rate 1|-o unit.cal.json",
            "export unit.cal.json --to image -o unit.img",
            "key new -o unit.key",
            "key sign unit.img --key unit.key --model RLG --counter 3 -o signed.img",
        ] {
            program.stdout_in(folder.path(), &words(line))?;
        }
        let read = |name: &str| fs::read(at(name)).with_context(|| format!("no {name}"));
        Ok(Self {
            record: fs::read_to_string(at("unit.cal.json"))?,
            image: read("unit.img")?,
            signed: read("signed.img")?,
            key: read("unit.key")?,
            public: read("unit.pub")?,
            log,
        })
    }
}

/// Words of a command; between bars blanks belong to the word.
fn words(line: &str) -> Vec<&str> {
    let parts = line.split('|').enumerate();
    parts.flat_map(|(at, part)| if at % 2 == 1 { vec![part] } else { part.split_whitespace().collect() }).collect()
}

/// Kinds with how often each comes.
const KINDS: [(&str, usize); 10] = [
    ("log", 40),
    ("record", 14),
    ("image", 8),
    ("setup", 8),
    ("limits", 5),
    ("scenario", 4),
    ("curve", 4),
    ("stream", 4),
    ("key", 2),
    ("arguments", 3),
];

/// The case of a number.
pub(super) fn case(number: u64, with: &Materials) -> Result<HuntCase> {
    let chance = &mut Chance::of(number);
    let all: usize = KINDS.iter().map(|(_, weight)| weight).sum();
    let mut at = chance.below(all);
    let kind = KINDS.iter().find(|(_, weight)| {
        let here = at < *weight;
        at = at.wrapping_sub(*weight);
        here
    });
    let kind = kind.map_or("log", |(kind, _)| *kind);
    let mut files =
        vec![("good.csv".to_owned(), with.log.clone()), ("unit.cal.json".to_owned(), with.record.clone().into_bytes())];
    let mut add = |name: &str, bytes: Vec<u8>| files.push((name.to_owned(), bytes));
    let line = match kind {
        "log" => {
            let log = log(chance);
            add(log.name, log.bytes);
            add("unit.img", with.image.clone());
            on_log(chance, log.name)
        }
        "record" => {
            add("record.json", json(chance, &with.record));
            chance
                .pick(&[
                    "inspect record.json",
                    "inspect record.json --json",
                    "export record.json --to image -o out.img",
                    "export record.json --to c -o out.c",
                    "export record.json --to verilog -o out.v",
                    "evaluate record.json --at -40:70:10 -o out.csv",
                    "compare record.json unit.cal.json --report out.html --json",
                    "verify record.json good.csv --report out.html",
                    "compensate record.json good.csv -o out.csv",
                ])
                .to_owned()
        }
        "image" => {
            let bytes = if chance.one_in(3) { &with.signed } else { &with.image };
            add("other.img", image(chance, bytes));
            add("unit.key", with.key.clone());
            add("unit.pub", with.public.clone());
            chance
                .pick(&[
                    "inspect other.img",
                    "inspect other.img --json",
                    "verify other.img good.csv --report out.html",
                    "compensate other.img good.csv -o out.csv",
                    "key verify other.img --key unit.pub --model RLG",
                    "key sign other.img --key unit.key --model RLG --counter 4 -o out.img",
                ])
                .to_owned()
        }
        "setup" => {
            add("bench.toml", toml(chance, BENCH));
            add("log.csv", with.log.clone());
            chance
                .pick(&[
                    "calibrate log.csv --setup bench.toml --model|bias 2|-o out.json --report out.html",
                    "inspect log.csv --setup bench.toml --windows windows.parquet",
                    "allan log.csv --setup bench.toml --json",
                    "inspect log.csv --setup bench.toml",
                    "verify unit.cal.json log.csv --setup bench.toml --json",
                ])
                .to_owned()
        }
        "limits" => {
            add("limits.toml", toml(chance, LIMITS));
            chance
                .pick(&[
                    "verify unit.cal.json good.csv --limits limits.toml --report out.html --json",
                    "compare unit.cal.json unit.cal.json --limits limits.toml",
                ])
                .to_owned()
        }
        "scenario" => {
            add("gyro.toml", toml(chance, SCENARIO));
            chance
                .pick(&[
                    "simulate gyro.toml -o out.csv",
                    "simulate gyro.toml --bode --report out.html",
                    "export gyro.toml --to loops -o out.loops",
                ])
                .to_owned()
        }
        "curve" => {
            let curve = if chance.one_in(2) { other_curve(chance) } else { chance.damage(CURVE.as_bytes().to_vec()) };
            add("curve.csv", curve);
            let duration = if chance.one_in(2) { format!(" --duration {}", chance.number()) } else { String::new() };
            format!("allan curve.csv --report out.html --json{duration}")
        }
        "stream" => {
            add("line.bin", stream(chance));
            "line read line.bin -o out.csv".to_owned()
        }
        "key" => {
            let (name, good) = if chance.one_in(2) { ("other.key", &with.key) } else { ("other.pub", &with.public) };
            add(name, if chance.one_in(4) { good.clone() } else { chance.damage(good.clone()) });
            add("signed.img", with.signed.clone());
            add("unit.img", with.image.clone());
            match name {
                "other.key" => "key sign unit.img --key other.key --model RLG --counter 4 -o out.img".to_owned(),
                _ => "key verify signed.img --key other.pub --model RLG".to_owned(),
            }
        }
        _ => arguments(chance),
    };
    let args = words(&line).into_iter().map(|word| word.replace('\0', "")).collect();
    Ok(HuntCase { number, kind, args, files, outputs: OUTPUTS.to_vec() })
}

/// Flags of every command that reads logs.
const FLAGS: [&str; 12] = [
    "--window row",
    "--window 7",
    "--window 1000",
    "--runs",
    "--one-run",
    "--sample-interval 1",
    "--discard-initial 100",
    "--input-rate 5",
    "--axis z",
    "--serial A",
    "--memory 64MiB",
    "--temperature-offset 3",
];
/// How counts are scaled.
const COUNTS: [&str; 6] = [
    "--arcsec-per-count 0.15125",
    "--arcsec-per-count 0.15125",
    "--arcsec-per-count 0.15125 --quantum 0.5",
    "--arcsec-per-count 1e-6",
    "",
    "--arcsec-per-count 0.15125 --counter cumulative --counter-bits 16",
];

/// A command on a log, with flags by chance.
fn on_log(chance: &mut Chance, name: &str) -> String {
    let counts = chance.pick(&COUNTS);
    let mut line = match chance.below(9) {
        0 | 1 => format!("calibrate {name} {counts} -o out.json --report out.html --min-span 1 --reference 15"),
        2 => format!(
            "calibrate {name} {counts} --model|bias 2, rate 0|--reference 15 --min-span 1 -o out.json --keep-outliers"
        ),
        3 => format!("verify unit.cal.json {name} --axis x --report out.html --json"),
        4 => format!("verify unit.img {name} --axis x --limits navigation-grade"),
        5 => format!("compensate unit.cal.json {name} --axis x {}", chance.pick(&["-o out.csv", "-o out.parquet", ""])),
        6 => format!("inspect {name} {counts} --windows {}", chance.pick(&["windows.parquet", "out.csv"])),
        7 => {
            let more = chance.pick(&["", "", "--exact", "--taus all", "--detrend temperature"]);
            format!("allan {name} {counts} --json --report out.html {more}")
        }
        _ => format!("inspect {name} {counts} --json"),
    };
    for _ in 0..chance.pick(&[0, 0, 0, 1, 2]) {
        let flag = chance.pick(&FLAGS);
        if !line.contains(flag.split(' ').next().unwrap_or_default()) {
            line += &format!(" {flag}");
        }
    }
    line
}

fn other_curve(chance: &mut Chance) -> Vec<u8> {
    let mut text = "tau_s,adev_dph\n".to_owned();
    let mut tau_s = 10_f64.powi(chance.below(12) as i32 - 8);
    for _ in 0..chance.below(60) {
        tau_s *= 1.0 + 3.0 * chance.unit();
        let adev =
            if chance.one_in(10) { chance.number().to_owned() } else { format!("{}", chance.unit() / tau_s.sqrt()) };
        text += &format!("{tau_s},{adev}\n");
    }
    text.into_bytes()
}

/// Numbers and words in the arguments themselves.
fn arguments(chance: &mut Chance) -> String {
    let number = chance.number();
    match chance.below(6) {
        0 => format!(
            "import --polynomial|{number},2,{}|--window 100 --span 10,30 --arcsec-per-count 1 --serial A -o out.json",
            chance.number()
        ),
        1 => format!(
            "import --polynomial 0.85,-46,1043 --window|{number}|--span|{},{}|--arcsec-per-count|{}|-o out.json",
            chance.number(),
            chance.number(),
            chance.number()
        ),
        2 => format!("evaluate unit.cal.json --at|{number}:{}:{}|-o out.csv", chance.number(), chance.number()),
        3 => format!("calibrate good.csv --arcsec-per-count|{number}|--window|{}|-o out.json", chance.number()),
        4 => format!(
            "calibrate good.csv --arcsec-per-count 0.15125 --serial|{}|--model|{}|-o out.json",
            chance.word().replace('|', ""),
            chance.word().replace('|', "")
        ),
        _ => format!(
            "calibrate good.csv --arcsec-per-count 0.15125 --reference|{number}|--min-span|{}|--input-rate|{}|-o out.json",
            chance.number(),
            chance.number()
        ),
    }
}
