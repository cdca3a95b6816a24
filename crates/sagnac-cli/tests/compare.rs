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
        let mut command = sagnac();
        command.args(["calibrate", &log, "--arcsec-per-count", "1.059", "--quantum", "0.25", "--tradeoff"]).args(flags);
        command.assert()
    };
    let out = String::from_utf8(calibrate(&[]).success().get_output().stdout.clone()).unwrap();
    let knee = out.lines().find(|line| line.contains("the knee")).unwrap();
    // 605 + 10 + 3·80: b₁, b₂ and what makes them zero at T0.
    assert!(knee.contains("bias 2 ") && knee.contains(" 855 "), "{knee}");
    calibrate(&["--model", "bias 2"]).code(2);
}

/// A gyro that came back within the limits, and one that did not: exit status, first words, JSON and report.
#[test]
fn compare_holds_what_changed_against_limits() {
    let folder = three_records();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let limits = at("limits.toml");
    fs::write(&limits, "decision = \"guarded\"\ntemperature_residual_dph_max = 0.04\narw_deg_rt_h_max = 0.01\n")
        .unwrap();
    let run = |records: &[String], page: &str| {
        let mut command = sagnac();
        command.arg("compare").args(records).args(["--limits", &limits, "--json", "--report", page]);
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
