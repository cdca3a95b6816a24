//! `sagnac compare` as scripts call it.

use std::fs;

use assert_cmd::Command;
use sagnac_sim::{PaperRig, csv_bytes};
use serde_json::Value;
use tempfile::TempDir;

fn sagnac() -> Command {
    Command::cargo_bin("sagnac").unwrap()
}

/// Records 0 and 1 of one gyro, and record 2 of it after its slope changed by 0.05 °/h.
fn three_records() -> TempDir {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let mut changed = PaperRig::PAPER;
    changed.coefficients[0] += 0.05;
    for (index, rig) in [PaperRig::PAPER, PaperRig::PAPER, changed].iter().enumerate() {
        let (log, record) = (at(&format!("{index}.csv")), at(&format!("{index}.cal.json")));
        fs::write(&log, csv_bytes(rig.run(index as u64 + 1))).unwrap();
        let flags = ["calibrate", &log, "--arcsec-per-count", "1.059", "--quantum", "0.25", "--serial", "RLG-7"];
        sagnac().args(flags).args(["--model", "bias 2", "-o", &record]).assert().success();
    }
    folder
}

#[test]
fn compare_names_what_disagrees_and_by_how_much() {
    let folder = three_records();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (a, b, c, page) = (at("0.cal.json"), at("1.cal.json"), at("2.cal.json"), at("compare.html"));
    let out =
        sagnac().args(["compare", &a, &b, &c, "--json", "--report", &page]).assert().success().get_output().clone();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    let curve = &object["axes"][0]["curves"][0];
    assert_eq!(curve["quantity"], "bias");
    assert_eq!(curve["worst"]["record"], 2);
    assert!(curve["worst"]["sigmas"].as_f64().unwrap() > 5.0, "{}", curve["worst"]);
    assert!(String::from_utf8_lossy(&out.stderr).contains("the records disagree"));
    assert!(fs::read_to_string(page).unwrap().contains("Curves of axis "));
    // A log is not a calibration, and a single record cannot be compared.
    sagnac().args(["compare", &a, &at("0.csv")]).assert().code(2);
    sagnac().args(["compare", &a]).assert().code(2);
}

/// The knee on the paper's rig is the paper's own order; nothing to trade with one model.
#[test]
fn the_tradeoff_marks_the_knee() {
    let folder = TempDir::new().unwrap();
    let log = folder.path().join("log.csv").display().to_string();
    fs::write(&log, csv_bytes(PaperRig::PAPER.run(1))).unwrap();
    let calibrate = |flags: &[&str]| {
        let mut command = sagnac();
        command.args(["calibrate", &log, "--arcsec-per-count", "1.059", "--quantum", "0.25", "--tradeoff"]).args(flags);
        command.assert()
    };
    let out = String::from_utf8(calibrate(&[]).success().get_output().stdout.clone()).unwrap();
    let knee = out.lines().find(|line| line.contains("the knee")).unwrap();
    // 572 + 15 + 3·77: b₁, b₂ and what makes them zero at T0.
    assert!(knee.contains("bias 2 ") && knee.contains(" 818 "), "{knee}");
    calibrate(&["--model", "bias 2"]).code(2);
}

/// A gyro that came back within the limits, and one that did not: exit status, first words, JSON and report.
#[test]
fn compare_holds_what_changed_against_limits() {
    let folder = three_records();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let limits = at("limits.toml");
    fs::write(&limits, "decision = \"guarded\"\ntemperature_residual_dph_max = 0.04\narw_increase_max = 1.05\n")
        .unwrap();
    let run = |records: &[String], page: &str| {
        let mut command = sagnac();
        command.args(["compare", "-v"]).args(records).args(["--limits", &limits, "--json", "--report", page]);
        command.output().unwrap()
    };
    let [a, b, c, page] = ["0.cal.json", "1.cal.json", "2.cal.json", "page.html"].map(at);
    let same = run(&[a.clone(), b.clone()], &page);
    let text = String::from_utf8_lossy(&same.stderr).into_owned();
    assert_eq!(same.status.code(), Some(0), "{text}");
    assert!(text.contains("1 of 1 limits met, 1 not asked of a comparison"), "{text}");
    let object: Value = serde_json::from_slice(&same.stdout).unwrap();
    assert_eq!(object["axes"][0]["pass"], true);
    assert_eq!(object["axes"][0]["limits"][0]["why"], "needs a retest: `sagnac verify`");
    assert!(fs::read_to_string(&page).unwrap().contains("Limits of axis"));
    let apart = run(&[a.clone(), b, c.clone()], &page);
    let text = String::from_utf8_lossy(&apart.stderr).into_owned();
    assert_eq!(apart.status.code(), Some(1), "{text}");
    assert!(text.contains("LIMITS NOT MET") && text.contains("NOT MET: ") && text.contains(&c), "{text}");
    // The record of one log under two names proves nothing.
    let copy = at("copy.cal.json");
    fs::copy(&a, &copy).unwrap();
    let twice = run(&[a, copy], &page);
    assert_eq!(twice.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&twice.stderr).contains("NOT ACCEPTED: records were made from the same log"));
}

/// Model, setup, data and program come first; then the most changed temperature, with a figure of the difference.
#[test]
fn compare_says_what_changed() {
    let folder = three_records();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (a, c, page) = (at("0.cal.json"), at("2.cal.json"), at("compare.html"));
    let (log, other) = (at("1.csv"), at("other.cal.json"));
    let flags = ["--arcsec-per-count", "1.059", "--quantum", "0.25", "--serial", "RLG-7", "--reference", "20"];
    let fit = [&["calibrate", &log], &flags[..], &["--model", "bias 3", "--window", "200", "-o", &other]].concat();
    sagnac().args(fit).assert().success();
    let text = |args: &[&str]| {
        let out = sagnac().args(["compare", "-v"]).args(args).output().unwrap();
        String::from_utf8(out.stdout).unwrap()
    };
    let said = text(&[&a, &other]);
    for word in [
        "model, axis x: `bias 2` → `bias 3`",
        "setup, reference_c: not set → 20.0",
        "setup, window: 100.00 s → 200.00 s",
        "data, axis x: 1 log, ",
    ] {
        assert!(said.contains(word), "{word}: {said}");
    }
    assert!(!text(&[&a, &a]).contains(" → "), "{said}");
    // The third record's slope is higher: farthest from the reference the difference is largest.
    let out = sagnac().args(["compare", "-v", &a, &c, "--json", "--report", &page]).output().unwrap();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    let curve = &object["axes"][0]["curves"][0];
    let celsius: Vec<f64> = curve["temperatures_c"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let differences: Vec<[f64; 2]> = serde_json::from_value(curve["differences"][0].clone()).unwrap();
    let ratio = |at: usize| (differences[at][0] / differences[at][1]).abs();
    let most =
        (0..celsius.len()).filter(|at| ratio(*at).is_finite()).max_by(|a, b| ratio(*a).total_cmp(&ratio(*b))).unwrap();
    let table = text(&[&a, &c]);
    let first_row = table.lines().skip_while(|line| !line.contains('─')).nth(1).unwrap();
    assert!(first_row.trim_start().starts_with(&format!("{:.1} °C", celsius[most])), "{table}");
    assert!(table.contains(&format!("bias: most changed at {:.1} °C, by ", celsius[most])), "{table}");
    let page = fs::read_to_string(page).unwrap();
    assert!(page.contains("Change of axis x, bias") && page.contains("bias-difference-x"));
}

/// The difference of two records of an unchanged gyro lies within its interval as often as stated; that of a changed one outside.
#[test]
fn the_interval_of_a_difference_covers() {
    use sagnac::compare::compare;
    use sagnac::fit::{FitOptions, Model, calibrate};
    use sagnac::window::WindowBuilder;
    use sagnac_log::ingest::{LogReader, ReadMode};
    use sagnac_log::setup::Setup;

    let setup = Setup {
        serial: Some("RLG-7".to_owned()),
        arcsec_per_count: Some(1.059),
        quantum: Some(0.25),
        ..Setup::default()
    };
    let options = FitOptions::new(Model::Fixed("bias 2".parse().unwrap()));
    let record = |rig: PaperRig, seed: u64| {
        let bytes = std::io::Cursor::new(csv_bytes(rig.run(seed)));
        let log = LogReader::from_reader("log", Box::new(bytes), &setup, ReadMode::Bulk).unwrap();
        let windows = WindowBuilder::read_all(vec![log], &setup).unwrap().finish();
        (format!("{seed}"), calibrate(windows, &setup, &options).unwrap())
    };
    let mut changed = PaperRig::PAPER;
    changed.coefficients[0] += 0.05;
    let (mut within, mut all, mut seen) = (0, 0, 0);
    const PAIRS: u64 = 200;
    for pair in 0..PAIRS {
        let first = record(PaperRig::PAPER, 1000 + 3 * pair);
        let ratios = |other: (String, sagnac::calibration::Calibration)| -> Vec<f64> {
            let found = compare(&[first.clone(), other], None).unwrap();
            let curve = &found.axes[0].curves[0];
            curve.differences[0].iter().map(|[value, sigma]| value.abs() / sigma).filter(|r| r.is_finite()).collect()
        };
        let same = ratios(record(PaperRig::PAPER, 1001 + 3 * pair));
        within += same.iter().filter(|ratio| **ratio <= 1.96).count();
        all += same.len();
        seen += usize::from(ratios(record(changed, 1002 + 3 * pair)).iter().any(|ratio| *ratio > 3.0));
    }
    // 95 % are stated; the twelve temperatures of a pair go together, so that the fraction scatters by about 1.5 %.
    let fraction = within as f64 / all as f64;
    assert!((0.91..=0.99).contains(&fraction), "{fraction}");
    assert_eq!(seen, PAIRS as usize);
}
