//! `sagnac fleet calibrate`: the records of `sagnac calibrate`, a row for whatever comes, and nothing done twice.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use sagnac_sim::{PaperRig, csv_bytes};
use tempfile::TempDir;

const SETUP: &str = "arcsec_per_count = 1.059\nquantum = 0.25\n";

/// A folder of units: `lots/LOT/UNIT/run-1.csv …`, each unit with a curve of its own.
struct Factory(TempDir);

impl Factory {
    fn new(units: usize) -> Self {
        let it = Self(TempDir::new().unwrap());
        fs::write(it.path("bench.toml"), SETUP).unwrap();
        for unit in 0..units {
            let [a, b, c] = PaperRig::PAPER.coefficients;
            let step = unit as f64;
            let rig = PaperRig { coefficients: [a + 0.02 * step, b - step, c], ..PaperRig::PAPER };
            for run in 1..=2 {
                it.write(&format!("units/RLG-{unit}/run-{run}.csv"), &csv_bytes(rig.run(10 * unit as u64 + run)));
            }
            it.write(&format!("units/RLG-{unit}/retest/run-3.csv"), &csv_bytes(rig.run(10 * unit as u64 + 3)));
        }
        it
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sagnac"));
        command.args(args).current_dir(self.0.path());
        command
    }

    /// Exit status, standard output, standard error.
    fn run(&self, args: &[&str]) -> (i32, String, String) {
        let Output { status, stdout, stderr } = self.command(args).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (status.code().unwrap(), text(stdout), text(stderr))
    }

    fn fleet(&self, source: &str, folder: &str, more: &[&str]) -> (i32, String, String) {
        let args = ["fleet", "calibrate", source, "--setup", "bench.toml", "--model", "bias 2", "-o", folder];
        self.run(&[&args[..], more].concat())
    }
}

/// Every file of a folder but the lock.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(here) = folders.pop() {
        for entry in fs::read_dir(here).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name().unwrap() != "lock" {
                all.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// A folder, a pattern, a manifest; one thread or two; unit by unit: the same bytes.
#[test]
fn records_and_proofs_are_those_of_the_program_for_one_unit() {
    let it = Factory::new(3);
    let limits = ["--limits", "paper"];
    assert_eq!(it.fleet("units", "one", &[&limits[..], &["--threads", "1"]].concat()).0, 0);
    assert_eq!(it.fleet("units", "two", &[&limits[..], &["--threads", "2"]].concat()).0, 0);
    let one = files(&it.path("one"));
    assert_eq!(one.len(), 10, "{:?}", one.keys());
    assert_eq!(one, files(&it.path("two")));

    let mut manifest = "unit,run,use\n".to_owned();
    for unit in 0..3 {
        for (run, of) in [("run-1.csv", ""), ("run-2.csv", "calibrate"), ("retest/run-3.csv", "verify")] {
            manifest += &format!("RLG-{unit},units/RLG-{unit}/{run},{of}\n");
        }
    }
    it.write("manifest.csv", manifest.as_bytes());
    assert_eq!(it.fleet("manifest.csv", "listed", &limits).0, 0);
    assert_eq!(one, files(&it.path("listed")));
    assert_eq!(it.fleet("units/{unit}/run-{run}.csv", "matched", &[]).0, 0);
    assert_eq!(it.fleet("units/*/*.csv", "found", &[]).0, 0);
    assert_eq!(files(&it.path("matched")), files(&it.path("found")));

    for unit in 0..3 {
        let (folder, name) = (format!("units/RLG-{unit}"), format!("RLG-{unit}"));
        let args = ["calibrate", &folder, "--setup", "bench.toml", "--model", "bias 2", "--serial", &name];
        assert_eq!(it.run(&[&args[..], &["-o", "unit.cal.json"]].concat()).0, 0);
        let record = fs::read(it.path("unit.cal.json")).unwrap();
        assert!(one[Path::new(&format!("records/{name}.cal.json"))] == record, "{name}");
        assert_eq!(files(&it.path("found"))[Path::new(&format!("records/{name}.cal.json"))], record);
        let retest = format!("{folder}/retest");
        let (status, proof, _) = it.run(&["verify", "unit.cal.json", &retest, "--limits", "paper", "--json"]);
        assert_eq!(status, 0);
        assert!(one[Path::new(&format!("proofs/{name}.json"))] == proof.as_bytes(), "{name}");
    }
}

/// Whatever a unit brings is a row; the others are calibrated.
#[test]
fn a_broken_log_is_a_row_and_not_the_end() {
    let it = Factory::new(4);
    let cut = fs::read(it.path("units/RLG-1/run-1.csv")).unwrap();
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &cut).unwrap();
    let packed = packed.finish().unwrap();
    it.write("units/cut/run.csv.gz", &packed[..packed.len() / 2]);
    it.write("units/rubbish/run.csv", b"not a log\n");
    it.write("units/parquet/run.parquet", b"PAR1 and no more");
    it.write("units/odd-setup/run.csv", &cut);
    it.write("units/odd-setup/bench.toml", b"arcsec_per_cuont = 1.059\n");
    fs::create_dir(it.path("units/empty")).unwrap();
    // Level temperature: no slope can be had of it.
    let level: String = (1..=4000).map(|t| format!("{t},20,{}\n", 7 + t % 2)).collect();
    it.write("units/level/run.csv", format!("time_s,temperature_c,counts\n{level}").as_bytes());
    it.write("units/RLG-2/retest/run-3.csv", b"time_s,counts\n1,2\n");

    let (status, said, _) = it.fleet("units", "fleet", &["--limits", "paper"]);
    assert_eq!(status, 1, "{said}");
    assert!(said.contains("10 units: 4 calibrated, 1 refused, 5 failed; limits met by 2 of 4"), "{said}");
    for (unit, why) in [
        ("cut", "failed"),
        ("rubbish", "no column of counts or rates"),
        ("parquet", "failed"),
        ("odd-setup", "arcsec_per_cuont"),
        ("empty", "the unit has no log"),
        ("level", "refused"),
        ("RLG-2", "retest not judged"),
    ] {
        let line = said.lines().find(|line| line.split_whitespace().next() == Some(unit));
        assert!(line.is_some_and(|line| line.contains(why)), "{unit}: {said}");
    }
    let table = column(&it.path("fleet/fleet.parquet"), "outcome");
    assert_eq!(table.len(), 10);
    assert_eq!(table["RLG-0"], "calibrated");
    assert_eq!(table["level"], "refused");
    assert_eq!(column(&it.path("fleet/fleet.parquet"), "acceptance")["RLG-2"], "not judged");
    assert_eq!(column(&it.path("fleet/fleet.parquet"), "acceptance")["RLG-0"], "met");
    assert!(!it.path("fleet/records/cut.cal.json").exists());
}

/// A column of text, by unit.
fn column(table: &Path, name: &str) -> BTreeMap<String, String> {
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(table).unwrap()).unwrap();
    assert_eq!(reader.schema().metadata()["sagnac.fleet"], "1");
    let mut out = BTreeMap::new();
    for batch in reader.build().unwrap() {
        let batch = batch.unwrap();
        let of = |name: &str| batch.column_by_name(name).unwrap().as_string::<i32>().clone();
        let rows = of("unit");
        rows.iter().zip(of(name).iter()).for_each(|(unit, value)| {
            out.insert(unit.unwrap().to_owned(), value.unwrap_or_default().to_owned());
        });
    }
    out
}

/// Only what has changed is done: a log, the setup, the limits, a record that somebody edited; and whatever was added.
#[test]
fn a_second_run_does_what_has_changed() {
    let it = Factory::new(3);
    let again = |more: &[&str]| {
        let (status, said, _) = it.fleet("units", "fleet", more);
        assert_eq!(status, 0, "{said}");
        let unchanged = |line: &&str| line.contains("(unchanged)");
        let done = said.lines().filter(|line| line.starts_with("RLG-") && !unchanged(line));
        done.map(|line| line.split_whitespace().next().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let all = ["RLG-0", "RLG-1", "RLG-2"];
    assert_eq!(again(&[]), all);
    let first = files(&it.path("fleet"));
    assert_eq!(again(&[]), [""; 0]);
    assert_eq!(files(&it.path("fleet")), first);
    assert_eq!(again(&["--again"]), all);
    assert_eq!(files(&it.path("fleet")), first);

    let record = it.path("fleet/records/RLG-1.cal.json");
    fs::write(&record, "{}").unwrap();
    assert_eq!(again(&[]), ["RLG-1"]);
    fs::remove_file(it.path("fleet/proofs/RLG-2.json")).unwrap();
    assert_eq!(again(&[]), ["RLG-2"]);
    assert_eq!(files(&it.path("fleet")), first);

    let log = it.path("units/RLG-0/run-2.csv");
    let bytes = fs::read(&log).unwrap();
    fs::write(&log, &bytes[..bytes.len() * 9 / 10]).unwrap();
    assert_eq!(again(&[]), ["RLG-0"]);
    fs::write(&log, &bytes).unwrap();
    assert_eq!(again(&[]), ["RLG-0"]);
    assert_eq!(files(&it.path("fleet")), first);

    assert_eq!(again(&["--limits", "paper"]), all);
    assert_eq!(again(&["--limits", "paper"]), [""; 0]);
    fs::write(it.path("bench.toml"), format!("{SETUP}reference_c = 25.0\n")).unwrap();
    assert_eq!(again(&["--limits", "paper"]), all);

    it.write("units/RLG-3/run-1.csv", &csv_bytes(PaperRig::PAPER.run(77)));
    assert_eq!(again(&["--limits", "paper"]), ["RLG-3"]);
    assert_eq!(column(&it.path("fleet/fleet.parquet"), "outcome").len(), 4);
    // Of another source: added to the table.
    it.write("more/RLG-9/run-1.csv", &csv_bytes(PaperRig::PAPER.run(78)));
    assert_eq!(it.fleet("more", "fleet", &[]).0, 0);
    let units: Vec<String> = column(&it.path("fleet/fleet.parquet"), "outcome").into_keys().collect();
    assert_eq!(units, ["RLG-0", "RLG-1", "RLG-2", "RLG-3", "RLG-9"]);
}

/// Killed in the middle, by the signal that nothing can catch: the next run ends with the same bytes, and does not do again what was done.
#[test]
fn killed_in_the_middle_nothing_is_lost_or_double() {
    let it = Factory::new(8);
    assert_eq!(it.fleet("units", "whole", &[]).0, 0);
    let whole = files(&it.path("whole"));
    let mut caught = 0;
    for kill in 1..8 {
        let args = ["fleet", "calibrate", "units", "--setup", "bench.toml", "--model", "bias 2", "-o", "fleet"];
        let _ = fs::remove_dir_all(it.path("fleet"));
        let mut child = it.command(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        // As soon as so many units are done.
        let done =
            || fs::read_dir(it.path("fleet/units")).map_or(0, |entries| entries.flatten().filter(is_result).count());
        while done() < kill && child.try_wait().unwrap().is_none() {
            std::thread::yield_now();
        }
        let _ = child.kill();
        let _ = child.wait();
        let were_done = done();
        caught += u32::from(were_done < 8);
        let (status, said, _) = it.fleet("units", "fleet", &[]);
        assert_eq!(status, 0, "{said}");
        assert!(said.contains(&format!("{were_done} unchanged since before")), "{were_done}: {said}");
        assert_eq!(files(&it.path("fleet")), whole, "after {kill}");
    }
    assert!(caught >= 4, "only {caught} of 7 kills came before the end");
}

fn is_result(entry: &fs::DirEntry) -> bool {
    !entry.file_name().to_string_lossy().starts_with('.')
}

/// Two programs at one folder: the second is refused, and the first ends as alone.
#[test]
fn two_at_once_do_not_mix() {
    let it = Factory::new(1);
    fs::create_dir(it.path("fleet")).unwrap();
    let lock = fs::File::create(it.path("fleet/lock")).unwrap();
    lock.lock().unwrap();
    let (status, _, said) = it.fleet("units", "fleet", &[]);
    assert!(status == 2 && said.contains("another program writes into this folder"), "{said}");
    drop(lock);
    assert_eq!(it.fleet("units", "fleet", &[]).0, 0);
}

/// A disk without room: an error that names the file, and what was there before is whole.
#[test]
fn without_room_the_results_of_before_stand() {
    let it = Factory::new(2);
    assert_eq!(it.fleet("units", "fleet", &[]).0, 0);
    let before = files(&it.path("fleet"));
    it.write("units/RLG-2/run-1.csv", &csv_bytes(PaperRig::PAPER.run(77)));
    let program = env!("CARGO_BIN_EXE_sagnac");
    // A unit that is new; and all of them again, with another model.
    for (model, names) in [("bias 2", "RLG-2.cal.json"), ("bias 3", ".cal.json")] {
        let line =
            format!("ulimit -f 8; exec {program} fleet calibrate units --setup bench.toml --model '{model}' -o fleet");
        let output = Command::new("sh").args(["-c", &line]).current_dir(it.0.path()).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(names), "{said}");
        assert_eq!(files(&it.path("fleet")), before, "{model}");
    }
    assert_eq!(it.fleet("units", "fleet", &[]).0, 0);
    assert_eq!(column(&it.path("fleet/fleet.parquet"), "outcome").len(), 3);
}

/// A log that is away for a night does not take the record with it: the unit is not renewed, in the table and by the exit status, and when the
/// log is back nothing is done again.
#[test]
fn a_log_that_is_away_keeps_the_record() {
    let it = Factory::new(2);
    assert_eq!(it.fleet("units", "fleet", &[]).0, 0);
    let first = files(&it.path("fleet"));
    let (log, away) = (it.path("units/RLG-1/run-2.csv"), it.path("run-2.away"));
    fs::rename(&log, &away).unwrap();
    std::os::unix::fs::symlink(it.path("nowhere"), &log).unwrap();
    let (status, said, _) = it.fleet("units", "fleet", &[]);
    assert_eq!(status, 1, "{said}");
    let line = said.lines().find(|line| line.starts_with("RLG-1")).unwrap();
    assert!(line.contains("not renewed: ") && line.contains("run-2.csv"), "{line}");
    assert!(said.contains("1 not renewed"), "{said}");
    let now = files(&it.path("fleet"));
    for file in ["records/RLG-1.cal.json", "proofs/RLG-1.json", "records/RLG-0.cal.json"] {
        assert_eq!(now[Path::new(file)], first[Path::new(file)], "{file}");
    }
    assert_eq!(column(&it.path("fleet/fleet.parquet"), "outcome")["RLG-1"], "not renewed");
    // All of its logs: a share that is not there.
    fs::remove_file(&log).unwrap();
    let first_log = it.path("units/RLG-1/run-1.csv");
    fs::rename(&first_log, it.path("run-1.away")).unwrap();
    let (status, said, _) = it.fleet("units", "fleet", &[]);
    assert!(status == 1 && said.contains("1 not renewed"), "{said}");
    assert_eq!(
        files(&it.path("fleet"))[Path::new("records/RLG-1.cal.json")],
        first[Path::new("records/RLG-1.cal.json")]
    );
    fs::rename(it.path("run-1.away"), &first_log).unwrap();
    fs::rename(&away, &log).unwrap();
    let (status, said, _) = it.fleet("units", "fleet", &[]);
    assert!(status == 0 && said.matches("(unchanged)").count() == 2, "{said}");
    assert_eq!(files(&it.path("fleet")), first);
}

/// Manifests and patterns that cannot be meant: refused with their place, before anything is written.
#[test]
fn sources_that_cannot_be_meant_are_refused() {
    let it = Factory::new(1);
    let log = "units/RLG-0/run-1.csv";
    for (name, text, why) in [
        ("no-run.csv", "unit,lot\nA,1\n".to_owned(), "lacks a column"),
        ("odd.csv", format!("unit,run,batch\nA,{log},1\n"), "`batch`"),
        ("two-lots.csv", format!("unit,run,lot\nA,{log},1\nA,units/RLG-0/run-2.csv,2\n"), "two-lots.csv:3"),
        ("twice.csv", format!("unit,run\nA,{log}\nA,{log}\n"), "the same log twice"),
        ("name.csv", format!("unit,run\n../A,{log}\n"), "the name cannot be used for a unit"),
        ("use.csv", format!("unit,run,use\nA,{log},retest\n"), "`calibrate` or `verify`"),
        ("empty.csv", "unit,run\n".to_owned(), "no line"),
        ("short.csv", "unit,run,lot\nA\n".to_owned(), "short.csv"),
    ] {
        it.write(name, text.as_bytes());
        let (status, _, said) = it.fleet(name, "fleet", &[]);
        assert!(status == 2 && said.contains(why), "{name}: {said}");
    }
    for (source, why) in [
        ("units/{unit}/{gyro}.csv", "{gyro}"),
        ("units/{lot}/*.csv", "has no {unit}"),
        ("units/{unit}/none-{run}.csv", "no file matches"),
        ("nowhere", "nowhere"),
    ] {
        let (status, _, said) = it.fleet(source, "fleet", &[]);
        assert!(status == 2 && said.contains(why), "{source}: {said}");
    }
    for folder in ["units", "units/fleet", "./units/../units/a/b"] {
        let (status, _, said) = it.fleet("units", folder, &[]);
        assert!(status == 2 && said.contains("inside the folder of the units"), "{folder}: {said}");
    }
    for args in [["fleet", "report", "units"], ["fleet", "prior", "units"]] {
        let (status, _, said) = it.run(&args);
        assert!(status == 2 && said.contains("this is not a folder of `sagnac fleet calibrate`"), "{said}");
    }
    let (status, _, said) = it.fleet("units", "fleet", &["--serial", "RLG-7"]);
    assert!(status == 2 && said.contains("one serial number is given for all units"), "{said}");
    assert!(!it.path("fleet").exists());
    assert_eq!(fs::read_dir(it.path("units")).unwrap().count(), 1);
    // Of a table calculator: a byte order mark, semicolons, carriage returns.
    it.write("semicolons.csv", format!("\u{feff}unit;run\r\nA;{log}\r\n").as_bytes());
    assert_eq!(it.fleet("semicolons.csv", "fleet", &[]).0, 0);
}

/// On the basis that all units share, and at the common temperatures, the curve is that of the record.
#[test]
fn the_common_basis_is_the_curve_of_the_record() {
    let it = Factory::new(2);
    assert_eq!(it.fleet("units", "fleet", &[]).0, 0);
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(it.path("fleet/fleet.parquet")).unwrap());
    let batch = reader.unwrap().build().unwrap().next().unwrap().unwrap();
    let list = |name: &str, row: usize| -> Vec<f64> {
        let values = batch.column_by_name(name).unwrap().as_list::<i32>().value(row);
        values.as_primitive::<Float64Type>().values().to_vec()
    };
    for row in 0..2 {
        let (beta, curve) = (list("coefficients", row), [list("curve_c", row), list("curve_dph", row)]);
        let sigmas = list("curve_sigma_dph", row);
        let lower = list("covariance", row);
        let reference = batch.column_by_name("reference_c").unwrap().as_primitive::<Float64Type>().value(row);
        // T_1 and T_2 of x = (T − 20)/60, written out.
        let basis = |t: f64| [(t - 20.0) / 60.0, 2.0 * ((t - 20.0) / 60.0).powi(2) - 1.0];
        assert_eq!((beta.len(), lower.len(), curve[0].len()), (2, 3, 4), "20, 25, 30 and 35 °C");
        for (at, t) in curve[0].iter().enumerate() {
            let weight: Vec<f64> = basis(*t).iter().zip(basis(reference)).map(|(a, b)| a - b).collect();
            let drift: f64 = weight.iter().zip(&beta).map(|(w, b)| w * b).sum();
            assert!((drift - curve[1][at]).abs() < 1e-9 * (1.0 + drift.abs()), "{t} °C: {drift} {}", curve[1][at]);
            // The curve's own, and what lies next to the model: never less.
            let of = |i: usize, j: usize| weight[i] * weight[j] * lower[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
            let sigma = (of(0, 0) + 2.0 * of(0, 1) + of(1, 1)).max(0.0).sqrt();
            assert!(sigma <= sigmas[at] * (1.0 + 1e-6) + 1e-9, "{t} °C: {sigma} {}", sigmas[at]);
        }
        // The highest order is only scaled: by the square of the ratio of the two spans.
        let record: serde_json::Value =
            serde_json::from_slice(&fs::read(it.path(&format!("fleet/records/RLG-{row}.cal.json"))).unwrap()).unwrap();
        let axis = &record["axes"][0];
        let span: Vec<f64> = (0..2).map(|end| axis["span_c"][end].as_f64().unwrap()).collect();
        let scale = (120.0 / (span[1] - span[0])).powi(2);
        let of = |key: &str| axis["terms"][1][key].as_f64().unwrap() * scale;
        assert!((beta[1] / of("value") - 1.0).abs() < 1e-9, "{} {}", beta[1], of("value"));
        assert!((lower[2].sqrt() / of("sigma") - 1.0).abs() < 1e-6, "{} {}", lower[2].sqrt(), of("sigma"));
    }
}

/// The prior of units whose curves were drawn here: mean and scatter of the quadratic in closed form, merged from two halves to the same
/// bytes, and an outlier named.
#[test]
fn the_prior_of_a_fleet_is_that_of_its_units() {
    let it = Factory::new(0);
    // 24 equal steps: variance n(n + 1)/12 of a step squared.
    let (n, step) = (24_u64, 0.02);
    let [a, b, c] = PaperRig::PAPER.coefficients;
    let mut units = "unit,lot,run\n".to_owned();
    for unit in 0..n {
        let rig = PaperRig { coefficients: [a + step * unit as f64, b, c], windows: 60, ..PaperRig::PAPER };
        it.write(&format!("logs/{unit}.csv"), &csv_bytes(rig.run(unit)));
        units += &format!("RLG-{unit},,logs/{unit}.csv\n");
    }
    it.write("manifest.csv", units.as_bytes());
    assert_eq!(it.fleet("manifest.csv", "fleet", &[]).0, 0);
    let (status, said, _) = it.run(&["fleet", "prior", "fleet", "-o", "fleet.prior.json", "--json"]);
    assert_eq!(status, 0);
    let prior: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(prior["terms"], serde_json::json!(["bias 1", "bias 2"]));
    // Counts of 1.059 arcsec in 100 s are 0.01059 °/h; T² is 60²·(T_2(x) + 1)/2 + ….
    let per_a = 0.01059 * 1800.0;
    let mean = prior["fleet"]["mean"][1].as_f64().unwrap();
    let sigma = prior["fleet"]["covariance"][2].as_f64().unwrap().sqrt();
    let wanted = [per_a * (a + step * (n - 1) as f64 / 2.0), per_a * step * ((n * (n + 1)) as f64 / 12.0).sqrt()];
    assert!((mean / wanted[0] - 1.0).abs() < 0.02, "{mean} for {}", wanted[0]);
    assert!((sigma / wanted[1] - 1.0).abs() < 0.05, "{sigma} for {}", wanted[1]);

    // As text, and of a unit that is not of this fleet.
    let odd = PaperRig { coefficients: [a + 9.0, b, c], windows: 60, ..PaperRig::PAPER };
    it.write("odd/RLG-99/run.csv", &csv_bytes(odd.run(99)));
    assert_eq!(it.fleet("odd", "fleet", &[]).0, 0);
    let (status, said, _) = it.run(&["fleet", "prior", "fleet", "-o", "with-odd.json"]);
    assert!(status == 0 && said.contains("not used: RLG-99 x, odd: bias"), "{said}");
    let sums = |name: &str| {
        let text = fs::read_to_string(it.path(name)).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["sums"].clone()
    };
    assert_eq!(sums("with-odd.json"), sums("fleet.prior.json"));

    // With itself, or with its own fleet, it would count twice.
    for other in ["fleet.prior.json", "fleet"] {
        let (status, _, said) = it.run(&["fleet", "prior", "fleet.prior.json", other, "-o", "twice.json"]);
        assert!(status == 2 && said.contains("logs are in both"), "{status} {said}");
    }
    // No output takes the place of what it is made from.
    let before = files(it.0.path());
    for output in ["fleet/fleet.parquet", "fleet/units/RLG-3.json", "fleet/records/RLG-3.cal.json"] {
        let (status, _, said) = it.run(&["fleet", "prior", "fleet", "-o", output]);
        assert!(status == 2 && said.contains("the command reads this file"), "{output}: {status} {said}");
    }
    it.write("limits.toml", b"drift_dph_per_c_max = 0.01\n");
    let plan = ["plan", "--prior", "fleet.prior.json", "--limits", "limits.toml", "-o", "limits.toml"];
    let (status, _, said) = it.run(&plan);
    assert!(status == 2 && said.contains("the command reads this file"), "{status} {said}");
    std::fs::remove_file(it.path("limits.toml")).unwrap();
    assert!(files(it.0.path()) == before);
    let (_, said, _) = it.run(&["inspect", "fleet.prior.json"]);
    assert!(said.contains("a prior of a fleet for `bias 2`, of 24 axes"), "{said}");
    let (_, said, _) = it.run(&["inspect", "fleet/fleet.parquet"]);
    assert!(said.contains("a fleet of 25 units, 25 calibrated"), "{said}");

    // The next unit of it with the prior, alone and as a fleet: the same bytes, with the prior's hash; the odd one is refused by name.
    let next = PaperRig { coefficients: [a + 0.2, b, c], windows: 40, ..PaperRig::PAPER };
    it.write("next/RLG-50/run.csv", &csv_bytes(next.run(50)));
    it.write("next/RLG-98/run.csv", &csv_bytes(odd.run(98)));
    let calibrated_with = |prior: &str| {
        let args = ["fleet", "calibrate", "next", "--setup", "bench.toml", "-o", "next-fleet", "--prior", prior];
        it.run(&args)
    };
    let (status, _, _) = calibrated_with("fleet.prior.json");
    assert_eq!(status, 1, "one of the two is refused");
    let refused = fs::read_to_string(it.path("next-fleet/units/RLG-98.json")).unwrap();
    assert!(refused.contains("not of this fleet") && refused.contains("give it the full test"), "{refused}");
    let one = ["calibrate", "-v", "next/RLG-50/run.csv", "--setup", "bench.toml", "--serial", "RLG-50"];
    let with_prior = [&one[..], &["--prior", "fleet.prior.json", "-o", "alone.cal.json"]].concat();
    let (status, said, _) = it.run(&with_prior);
    assert!(status == 0 && said.contains("prior of 24 axes: the test determines"), "{said}");
    let with_report = [&with_prior[..], &["--report", "alone.html"]].concat();
    assert_eq!(it.run(&with_report).0, 0);
    let page = fs::read_to_string(it.path("alone.html")).unwrap();
    assert!(page.contains("Fitted with the prior of its fleet") && !page.to_lowercase().contains("not fitted here"));
    let record = fs::read(it.path("alone.cal.json")).unwrap();
    assert_eq!(record, fs::read(it.path("next-fleet/records/RLG-50.cal.json")).unwrap());
    let hash = sagnac_log::ingest::sha256_of_file(&it.path("fleet.prior.json")).unwrap();
    assert!(String::from_utf8(record).unwrap().contains(&hash));
    let (status, _, said) = it.run(&[&with_prior[..], &["--model", "bias 2"]].concat());
    assert!(status == 2 && said.contains("--model"), "{said}");
    let (status, _, said) = it.run(&[&one[..], &["--lot", "A"]].concat());
    assert!(status == 2 && said.contains("--prior"), "{said}");
    // What has not changed is not done again; with another prior it is.
    let said = calibrated_with("fleet.prior.json").1;
    assert!(said.contains("unchanged since before"), "{said}");
    let said = calibrated_with("with-odd.json").1;
    assert!(!said.contains("unchanged since before"), "{said}");

    // Too few, another model, rubbish.
    it.write("few/RLG-1/run.csv", &csv_bytes(PaperRig::PAPER.run(1)));
    assert_eq!(it.fleet("few", "few-fleet", &[]).0, 0);
    for (args, status, why) in [
        (["fleet", "prior", "few-fleet", "--json"], 3, "too few"),
        (["fleet", "prior", "fleet", "--model=bias 7"], 3, "0 axes of `bias 7`"),
        (["fleet", "prior", "fleet.prior.json", "--model=bias 7"], 2, "the prior is for `bias 2`"),
        (["fleet", "prior", "manifest.csv", "--json"], 2, "not a prior of a fleet"),
        (["fleet", "prior", "nowhere", "--json"], 2, "nowhere"),
    ] {
        let (got, out, said) = it.run(&args);
        assert!(got == status && (said.contains(why) || out.contains(why)), "{args:?}: {got} {said}");
    }
}

/// A rig whose chamber adds a rate, an outlier and a refusal, all of them named; of ten thousand units the page stays small.
#[test]
fn the_report_names_what_is_wrong() {
    let it = Factory::new(0);
    let [a, b, c] = PaperRig::PAPER.coefficients;
    let mut units = "unit,lot,rig,run,use\n".to_owned();
    for unit in 0..36_u64 {
        let (lot, rig) = (unit % 2, unit / 2 % 3);
        let bend = if unit == 11 { 2.0 } else { 0.01 * (unit * 7 % 5) as f64 };
        let off = if rig == 1 { 40.0 } else { 0.0 };
        let level = c + off + (unit * 5 % 7) as f64;
        let gyro = PaperRig { coefficients: [a + bend, b, level], windows: 60, ..PaperRig::PAPER };
        for (run, of) in [(1, "calibrate"), (2, "verify")] {
            it.write(&format!("logs/{unit}-{run}.csv"), &csv_bytes(gyro.run(100 * unit + run)));
            units += &format!("RLG-{unit},{lot},rig-{rig},logs/{unit}-{run}.csv,{of}\n");
        }
    }
    it.write("logs/short.csv", b"time_s,temperature_c,counts\n1,20,1\n2,20,1\n3,20,1\n");
    units += "RLG-99,0,rig-0,logs/short.csv,calibrate\n";
    it.write("manifest.csv", units.as_bytes());
    assert_eq!(it.fleet("manifest.csv", "fleet", &["--limits", "paper"]).0, 1);
    let (status, said, _) = it.run(&["fleet", "report", "fleet", "--report", "fleet.html"]);
    assert_eq!(status, 0, "{said}");
    assert!(
        said.contains("all lots: 36 of 37 units calibrated") && said.contains("outlier: RLG-11 x, bias 2"),
        "{said}"
    );
    assert!(said.contains("rig rig-1: rate at T0 differs by"), "{said}");
    assert!(!said.contains("rig rig-0") && !said.contains("rig rig-2"), "{said}");
    let page = fs::read_to_string(it.path("fleet.html")).unwrap();
    for words in [
        "Fleet of 37 units",
        "RLG-11 x",
        "Rigs that differ",
        "rig-1",
        "Capability",
        "Refusals and failures",
        "angle random walk",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // The same in °/s, the limits too: 1 °/s is 3600 °/h.
    let (status, in_dps, _) = it.run(&["fleet", "report", "fleet", "--report", "dps.html", "--units", "dps"]);
    let off = |said: &str| -> f64 {
        let size = said.split("rate at T0 differs by ").nth(1).unwrap().split(' ').next().unwrap();
        size.parse().unwrap()
    };
    assert!(status == 0 && (off(&in_dps) * 3600.0 / off(&said) - 1.0).abs() < 0.01, "{in_dps}");
    let dps = fs::read_to_string(it.path("dps.html")).unwrap();
    assert!(dps.contains("°/s") && !dps.contains("°/h"), "{:?}", dps.find("°/h").map(|at| &dps[at - 90..at + 9]));
    // A click from the outlier, and from the one without a record, to what is known of it.
    for (unit, words) in [("RLG-11", "records/RLG-11.cal.json"), ("RLG-99", "refused: the log has no usable window")] {
        let entry = page.split(&format!("id=\"unit-{unit}\"")).nth(1).and_then(|rest| rest.split("</section>").next());
        assert!(entry.is_some_and(|entry| entry.contains(words)), "{unit}: {entry:?}");
        assert!(page.contains(&format!("href=\"#unit-{unit}\"")), "{unit}");
    }

    let results: Vec<String> =
        (0..36).map(|unit| fs::read_to_string(it.path(&format!("fleet/units/RLG-{unit}.json"))).unwrap()).collect();
    for unit in 0..10_000 {
        let text = &results[unit * 31 % 36];
        let (head, axis) = text.split_once("\"axes\": [").unwrap();
        let axis = axis.rsplit_once(']').unwrap().0;
        let axes = ["x", "y", "z"].map(|letter| axis.replace("\"axis\": \"x\"", &format!("\"axis\": \"{letter}\"")));
        let head = head.replace(&format!("\"RLG-{}\"", unit * 31 % 36), &format!("\"U-{unit}\""));
        it.write(&format!("many/units/U-{unit}.json"), format!("{head}\"axes\": [{}]}}", axes.join(",")).as_bytes());
    }
    let (status, said, wrong) = it.run(&["fleet", "report", "many", "--report", "many.html"]);
    assert!(status == 0 && said.contains("all lots: 10000 of 10000 units"), "{said} {wrong}");
    let bytes = fs::metadata(it.path("many.html")).unwrap().len();
    assert!(bytes < 3_000_000, "{bytes}");
}

/// The demonstration: the rig that is off is named, the planned test is half of the full one or shorter, and all but the outlier pass
/// with it. Its files are a factory like any other.
#[test]
fn the_demonstration_shows_what_it_says() {
    let it = Factory::new(0);
    let (status, said, problems) = it.run(&["fleet", "demo", "-o", "factory", "--units", "90"]);
    assert_eq!(status, 0, "{problems}");
    for line in ["90 units: 90 calibrated", "rig west: ", "without the prior, its model known: ", "RLG-0098  refused"] {
        assert!(said.contains(line), "{line}: {said}");
    }
    assert!(!said.contains("rig north") && !said.contains("rig south"), "{said}");
    let hours: f64 = said.split(" h of chamber").next().unwrap().rsplit('\n').next().unwrap().parse().unwrap();
    assert!(hours < 7.4, "{hours} of 14.8 h");
    let next = said.lines().find(|line| line.starts_with("9 units: ")).unwrap();
    let [calibrated, met] = ["calibrated", "limits met by"].map(|of| next.contains(of));
    assert!(calibrated && met && next.contains("0 failed"), "{next}");
    let report = fs::read_to_string(it.path("factory/fleet.html")).unwrap();
    assert!(report.contains("west"));
    // By hand, in the folder: the same bytes.
    let before = files(&it.path("factory/fleet"));
    let pattern = "factory/units/{lot}/{rig}/{unit}/{use}-{run}.csv";
    let args = ["fleet", "calibrate", pattern, "--model", "bias 3, rate 0", "-o", "again"];
    let more = ["--setup", "factory/bench.toml", "--limits", "navigation-grade"];
    // All are sound; a few retests are so noisy that a limit is not decided.
    let met = said.split("limits met by ").nth(1).unwrap().split(' ').next().unwrap().parse::<i32>().unwrap();
    assert!((87..=90).contains(&met), "{met} of 90 sound units");
    assert_eq!(it.run(&[&args[..], &more].concat()).0, i32::from(met < 90));
    assert_eq!(files(&it.path("again")), before);
    let (status, _, problems) = it.run(&["fleet", "demo", "-o", "factory"]);
    assert!(status == 2 && problems.contains("not empty"), "{problems}");
    // A plan: JSON, a chamber's program, and what is refused.
    let plan = ["plan", "--prior", "factory/fleet.prior.json", "--limits", "navigation-grade"];
    let with = |more: &[&str]| it.run(&[&plan[..], more].concat());
    let (_, in_dps, _) = with(&["--lot", "A", "--units", "dps"]);
    assert!(in_dps.contains("°/s") && !in_dps.contains("°/h"), "{in_dps}");
    let (_, dps_json, _) = with(&["--lot", "A", "--units", "dps", "--json"]);
    assert_eq!(dps_json, with(&["--lot", "A", "--json"]).1);
    let (status, json, _) = with(&["--lot", "A", "--json", "-o", "test.csv"]);
    let made: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(status == 0 && made["probability"].as_f64().unwrap() >= 0.95, "{json}");
    let steps = fs::read_to_string(it.path("test.csv")).unwrap();
    assert_eq!(steps.lines().count() - 1, made["steps"].as_array().unwrap().len(), "{steps}");
    for (more, status, why) in [
        (&["--lot", "A", "--share", "0.02"][..], 3, "every test of up to 24 h misses"),
        (&["--lot", "D"], 3, "no lot of this name"),
        (&["--lot", "A", "--start", "90"], 2, "outside the fleet's"),
        (&["--lot", "A", "--ramps", "0"], 2, "0.01 … 20 °C/min"),
        (&["--lot", "A", "--probability", "1"], 2, "between 0 and 1"),
    ] {
        let (found, _, problems) = with(more);
        assert!(found == status && problems.contains(why), "{more:?}: {problems}");
    }
    it.write("none.toml", b"arw_deg_rt_h_max = 0.004\n");
    let (status, _, problems) =
        it.run(&["plan", "--prior", "factory/fleet.prior.json", "--lot", "A", "--limits", "none.toml"]);
    assert!(status == 2 && problems.contains("the limits contain none that a calibration test decides"), "{problems}");
    let (status, _, problems) = it.run(&["fleet", "prior", "factory/fleet", "--without-rig", "east"]);
    assert!(status == 2 && problems.contains("no unit of the fleet has this rig"), "{problems}");
}

/// The same log under two names is one test of one unit: it says once how units scatter.
#[test]
fn a_copied_log_is_not_another_unit() {
    let it = Factory::new(24);
    for run in [1, 2] {
        let log = fs::read(it.path(&format!("units/RLG-3/run-{run}.csv"))).unwrap();
        it.write(&format!("units/RLG-100/copy-{run}.csv"), &log);
    }
    assert_eq!(it.fleet("units", "fleet", &[]).0, 0);
    let (status, said, problems) = it.run(&["fleet", "prior", "fleet", "--json"]);
    assert_eq!(status, 0, "{problems}");
    let prior: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(prior["fleet"]["axes"].as_u64(), Some(24), "{said}");
    let not_used = prior["not_used"].as_array().unwrap();
    assert!(
        not_used.iter().any(|one| one["reason"] == "its log is that of RLG-3" && one["axis"] == "RLG-100 x"),
        "{said}"
    );
}
