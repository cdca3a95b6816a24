//! `sagnac compare` as scripts call it.

use std::fs;

use assert_cmd::Command;
use sagnac_sim::{PaperRig, csv_bytes};
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn compare_names_what_disagrees_and_by_how_much() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let sagnac = || Command::cargo_bin("sagnac").unwrap();
    let mut changed = PaperRig::PAPER;
    changed.coefficients[0] += 0.05;
    for (index, rig) in [PaperRig::PAPER, PaperRig::PAPER, changed].iter().enumerate() {
        let (log, record) = (at(&format!("{index}.csv")), at(&format!("{index}.cal.json")));
        fs::write(&log, csv_bytes(rig.run(index as u64 + 1))).unwrap();
        let flags = ["calibrate", &log, "--arcsec-per-count", "1.059", "--quantum", "0.25", "--serial", "RLG-7"];
        sagnac().args(flags).args(["--model", "bias 2", "-o", &record]).assert().success();
    }
    let (a, b, c, page) = (at("0.cal.json"), at("1.cal.json"), at("2.cal.json"), at("compare.html"));
    let out =
        sagnac().args(["compare", &a, &b, &c, "--json", "--report", &page]).assert().success().get_output().clone();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    let curve = &object["axes"][0]["curves"][0];
    assert_eq!(curve["quantity"], "bias");
    assert_eq!(curve["worst"]["record"], 2);
    assert!(curve["worst"]["sigmas"].as_f64().unwrap() > 5.0, "{}", curve["worst"]);
    assert!(String::from_utf8_lossy(&out.stderr).contains("the records disagree"));
    assert!(fs::read_to_string(page).unwrap().contains("Do the curves come back?"));
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
        let mut command = Command::cargo_bin("sagnac").unwrap();
        command.args(["calibrate", &log, "--arcsec-per-count", "1.059", "--quantum", "0.25", "--tradeoff"]).args(flags);
        command.assert()
    };
    let out = String::from_utf8(calibrate(&[]).success().get_output().stdout.clone()).unwrap();
    let knee = out.lines().find(|line| line.contains("the knee")).unwrap();
    // 670 + 20 + 3·80: b₁, b₂ and what makes them zero at T0.
    assert!(knee.contains("bias 2 ") && knee.contains(" 930 "), "{knee}");
    calibrate(&["--model", "bias 2"]).code(2);
}
