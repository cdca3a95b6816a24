//! `sagnac verify --limits` as scripts call it.

use std::io::Read as _;
use std::path::Path;

use assert_cmd::Command;
use flate2::read::MultiGzDecoder;
use sagnac_log::ingest::{hex, sha256};
use serde_json::Value;
use tempfile::TempDir;

fn sagnac() -> Command {
    Command::cargo_bin("sagnac").unwrap()
}

fn testdata(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/chamber").join(name).display().to_string()
}

/// A calibration of the first two cycles.
fn record(folder: &TempDir) -> String {
    let record = folder.path().join("u.cal.json").display().to_string();
    let logs = [testdata("cycle-1.csv.gz"), testdata("cycle-2.csv.gz")];
    let setup = testdata("bench.toml");
    let flags = ["calibrate", &logs[0], &logs[1], "--setup", &setup, "--model", "bias 3, rate 0", "-o", &record];
    sagnac().args(flags).assert().success();
    record
}

#[test]
fn every_limit_has_its_value_margin_and_verdict() {
    let folder = TempDir::new().unwrap();
    let (record, retest, limits) = (record(&folder), testdata("retest.csv.gz"), testdata("acceptance.toml"));
    let verify = |limits: &str| {
        let out = sagnac().args(["verify", &record, &retest, "--limits", limits, "--json"]).output().unwrap();
        (out.status.code().unwrap(), serde_json::from_slice::<Value>(&out.stdout).unwrap())
    };
    let (status, object) = verify(&limits);
    let axis = &object["axes"][0];
    assert_eq!((status, &axis["pass"]), (0, &Value::Bool(true)), "{}", axis["limits"]);
    let all = axis["limits"].as_array().unwrap();
    assert_eq!(all.len(), 14);
    for limit in all {
        let (value, bound, margin) = (&limit["value"], &limit["limit"], &limit["margin"]);
        let (value, bound) = (value.as_f64().unwrap(), bound.as_f64().unwrap());
        let room = if limit["name"].as_str().unwrap().ends_with("_min") { value - bound } else { bound - value };
        assert!((margin.as_f64().unwrap() - room / bound).abs() < 1e-12, "{limit}");
    }
    // Drift separate from noise: kilometres before, within two of its σ after, the random walk separately.
    let flight = &axis["flight"];
    let metres = |name: &str, part: &str| flight[name][part].as_f64().unwrap();
    assert!(metres("before_m", "value") > 4.0 * metres("before_m", "sigma"), "{}", flight["before_m"]);
    assert!(metres("after_m", "value").abs() < 2.0 * metres("after_m", "sigma"), "{}", flight["after_m"]);
    assert!((400.0..600.0).contains(&flight["noise_m"].as_f64().unwrap()));
    // The paper requires an improvement that this gyro's small drift does not allow.
    let (status, object) = verify("paper");
    assert_eq!((status, &object["axes"][0]["pass"]), (1, &Value::Bool(false)));
    assert_eq!(verify("navigation-grade").0, 0);
    assert!(metres("after_m", "sigma") * 2.0 <= flight["bound_after_m"].as_f64().unwrap());
}

/// A limit that does not apply to the retest is shown as not asked, also in the verdict; the page names retest and limits.
#[test]
fn what_is_not_asked_is_not_met() {
    let folder = TempDir::new().unwrap();
    let (record, retest) = (record(&folder), testdata("retest.csv.gz"));
    let page = folder.path().join("page.html").display().to_string();
    let flags = ["verify", "-v", &record, &retest, "--limits", "navigation-grade", "--report", &page, "--json"];
    let out = sagnac().args(flags).output().unwrap();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    let limits = object["axes"][0]["limits"].as_array().unwrap();
    let unasked: Vec<&Value> = limits.iter().filter(|limit| limit["pass"].is_null()).collect();
    let names: Vec<&Value> = unasked.iter().map(|limit| &limit["name"]).collect();
    assert_eq!(names, ["scale_factor_sigma_ppm_max", "scale_factor_repeatability_ppm_max", "excluded_max"]);
    assert_eq!(unasked[0]["why"], "needs a retest on a rate table");
    let said = String::from_utf8(out.stderr).unwrap();
    assert!(
        said.contains("16 of 16 limits met, 3 not asked of such a retest") && !said.contains("all limits met"),
        "{said}"
    );
    let html = std::fs::read_to_string(&page).unwrap();
    let record_hash = hex(&sha256(&std::fs::read(&record).unwrap()));
    for words in
        ["Accepted as far as asked", "navigation-grade", object["limits"]["sha256"].as_str().unwrap(), &record_hash]
    {
        assert!(html.contains(words), "{words}");
    }
    // Limits of which none can be asked are refused.
    let table_only = folder.path().join("table.toml").display().to_string();
    std::fs::write(&table_only, "scale_factor_sigma_ppm_max = 5.0\n").unwrap();
    sagnac().args(["verify", "-v", &record, &retest, "--limits", &table_only]).assert().code(3);
}

/// A limit of the plateaus that is not met names its plateau, in the result and in its row on the page.
#[test]
fn the_failing_plateau_is_named() {
    let folder = TempDir::new().unwrap();
    let (record, page) = (record(&folder), folder.path().join("a.html").display().to_string());
    let limits = folder.path().join("limits.toml").display().to_string();
    std::fs::write(&limits, "plateau_offset_dph_max = 1e-6\nplateau_sigma_dph_max = 1e-6\nramps_rms_dph_max = 1e-6\n")
        .unwrap();
    let args = ["verify", &record, &testdata("retest.csv.gz"), "--limits", &limits, "--report", &page, "--json"];
    let out = sagnac().args(args).assert().code(1).get_output().clone();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    let axis = &object["axes"][0];
    let plateaus = &axis["residual"]["plateaus"];
    let at = |key: &str| {
        axis["limits"].as_array().unwrap().iter().find(|limit| limit["name"] == key).unwrap()["plateau_c"].clone()
    };
    assert_eq!(at("plateau_offset_dph_max"), plateaus["worst_offset_temperature_c"]);
    assert_eq!(at("plateau_sigma_dph_max"), plateaus["worst_sigma_temperature_c"]);
    assert_eq!(at("ramps_rms_dph_max"), Value::Null);
    let place = format!("not met at {:.1} °C", at("plateau_offset_dph_max").as_f64().unwrap());
    let page = std::fs::read_to_string(page).unwrap();
    let row = page.split("<tr>").find(|row| row.contains("plateau bias, largest")).unwrap();
    assert!(row.contains(&place.replace('-', "−")), "{place}: {row}");
}

/// The rows of the retest at some temperatures.
fn retest_where(folder: &TempDir, wanted: fn(f64) -> bool) -> String {
    let path = folder.path().join("part.csv").display().to_string();
    let out = Command::new("gzip").args(["-dc", &testdata("retest.csv.gz")]).output().unwrap();
    let whole = String::from_utf8(out.stdout).unwrap();
    let place = whole.lines().next().unwrap().split(',').position(|name| name.starts_with("temperature_c")).unwrap();
    let is_wanted = |line: &&str| line.split(',').nth(place).unwrap().parse().is_ok_and(wanted);
    let kept: Vec<&str> = whole.lines().take(1).chain(whole.lines().skip(1).filter(is_wanted)).collect();
    std::fs::write(&path, kept.join("\n")).unwrap();
    path
}

/// A retest of both ends of the span without its middle covers only those, and gives no result for a flight through it.
#[test]
fn a_hole_in_the_retest_is_not_bridged() {
    let folder = TempDir::new().unwrap();
    let record = record(&folder);
    let ends = retest_where(&folder, |celsius| !(-20.0..50.0).contains(&celsius));
    let limits = folder.path().join("limits.toml").display().to_string();
    let flight = "[flight]\nprofile = [{ minutes = 0, temperature_c = -10 }, { minutes = 60, temperature_c = 40 }]\n";
    std::fs::write(&limits, format!("span_covered_min = 0.9\nposition_error_m_max = 1e6\n{flight}")).unwrap();
    let out = sagnac().args(["verify", &record, &ends, "--limits", &limits, "--json"]).output().unwrap();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    let axis = &object["axes"][0];
    assert_eq!(out.status.code(), Some(1));
    assert!(
        (axis["coverage"]["covered_fraction"].as_f64().unwrap() - 40.0 / 110.0).abs() < 0.02,
        "{}",
        axis["coverage"]
    );
    assert!(
        axis["flight_unavailable"].as_str().unwrap().contains("no window lies between"),
        "{}",
        axis["flight_unavailable"]
    );
    // And one retest counts once.
    sagnac().args(["verify", &record, &ends, &ends]).assert().code(2);
}

/// A retest over a third of the temperatures counts for a third of them, by record and by image alone.
#[test]
fn a_narrow_retest_is_no_acceptance() {
    let folder = TempDir::new().unwrap();
    let record = record(&folder);
    let narrow = retest_where(&folder, |celsius| celsius > 35.0);
    let limits = folder.path().join("limits.toml").display().to_string();
    std::fs::write(&limits, "base = \"navigation-grade\"\nsigma_over_floor_max = 2.0\n").unwrap();
    let out = sagnac().args(["verify", &record, &narrow, "--limits", &limits, "--json"]).output().unwrap();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    let axis = &object["axes"][0];
    let missed: Vec<&Value> =
        axis["limits"].as_array().unwrap().iter().filter(|limit| limit["pass"] == false).map(|l| &l["name"]).collect();
    // The only plateau above 35 °C is compared with nothing and reached from one side, 35 °C are too few for a slope, and the colder
    // part is missing time.
    let all = ["span_covered_min", "plateau_offset_dph_max", "drift_dph_per_c_max", "memory_dph_max", "missing_max"];
    let all = all.map(Value::from);
    assert_eq!((out.status.code(), missed), (Some(1), all.iter().collect()), "{}", axis["limits"]);
    assert!(
        (axis["coverage"]["covered_fraction"].as_f64().unwrap() - 35.0 / 110.0).abs() < 0.01,
        "{}",
        axis["coverage"]
    );
}

/// Limits met on a log of the fit are not an acceptance, on the terminal and on paper.
#[test]
fn a_log_of_the_fit_is_never_accepted() {
    let folder = TempDir::new().unwrap();
    let (record, page) = (record(&folder), folder.path().join("a.html").display().to_string());
    let limits = folder.path().join("limits.toml").display().to_string();
    std::fs::write(&limits, "sigma_over_floor_max = 2.0\n").unwrap();
    let flags = ["verify", &record, &testdata("cycle-1.csv.gz"), "--limits", &limits, "--report", &page, "--json"];
    let out = sagnac().args(flags).assert().code(1).get_output().clone();
    let object: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(object["training_overlap"][0], "cycle-1.csv.gz");
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("Not accepted") && page.contains("This is no proof") && !page.contains("none of them seen"));
}

/// A flight to untested temperatures is not computed, and its limit is not met.
#[test]
fn a_flight_beyond_the_test_is_not_accepted() {
    let folder = TempDir::new().unwrap();
    let record = record(&folder);
    let limits = folder.path().join("limits.toml").display().to_string();
    let flight = "position_error_m_max = 1e6\n[flight]\nprofile = [{ minutes = 0, temperature_c = 20 }, { minutes = 60, temperature_c = 95 }]\n";
    std::fs::write(&limits, flight).unwrap();
    let out =
        sagnac().args(["verify", "-v", &record, &testdata("retest.csv.gz"), "--limits", &limits]).assert().code(1);
    let said = String::from_utf8(out.get_output().stdout.clone()).unwrap();
    assert!(
        said.contains("the flight is not available: the flight goes to 95 °C") && said.contains("unknown"),
        "{said}"
    );
    std::fs::write(&limits, flight.replace("minutes = 60", "minutes = -1")).unwrap();
    sagnac().args(["verify", "-v", &record, &testdata("retest.csv.gz"), "--limits", &limits]).assert().code(2);
}

/// Found by the hunt: every window was short, so the noise floor was the mean of nothing, and a limit beyond it was met by σ ± 0.026 °/h.
#[test]
fn a_floor_of_nothing_meets_no_limit() {
    let folder = TempDir::new().unwrap();
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/found/log-3070");
    let limits = folder.path().join("limits.toml");
    std::fs::write(&limits, "sigma_beyond_floor_dph_max = 0.001\n").unwrap();
    let verify = |record: &Path, retest: &Path| {
        let limits = limits.display().to_string();
        let out = sagnac()
            .args(["verify", "-v"])
            .args([record, retest])
            .args(["--limits", &limits, "--axis", "x"])
            .output()
            .unwrap();
        (out.status.code().unwrap(), String::from_utf8(out.stdout).unwrap(), String::from_utf8(out.stderr).unwrap())
    };
    let (status, _, said) = verify(&found.join("unit.cal.json"), &found.join("log.parquet"));
    assert!(status == 3 && said.contains("0 usable windows"), "{said}");

    // A record that states no noise at all, of a retest whose noise cannot be measured: the floor is not known.
    let rows: String = (1..=400)
        .map(|row: u32| format!("{},{:.4},{}\n", row * 100, 5.0 + f64::from(row) * 0.075, 3000 + row % 2))
        .collect();
    let log = folder.path().join("log.csv");
    std::fs::write(&log, format!("time_s,temperature_c,counts\n{rows}")).unwrap();
    let record = folder.path().join("silent.cal.json");
    let text = std::fs::read_to_string(found.join("unit.cal.json")).unwrap();
    let mut silent: Value = serde_json::from_str(&text).unwrap();
    silent["axes"][0]["noise_floor"]["n_deg_rt_h"] = 0.0.into();
    silent["axes"][0]["noise_floor"]["q_arcsec"] = 0.0.into();
    silent["setup"]["noise"] = Value::Null;
    std::fs::write(&record, silent.to_string()).unwrap();
    let (status, out, said) = verify(&record, &log);
    assert!(status == 1 && out.contains("the noise floor is not known"), "{status} {out} {said}");
}

/// What is periodic averages out in windows of its period: a retest does not choose their length.
#[test]
fn limits_are_not_held_against_another_window() {
    let folder = TempDir::new().unwrap();
    let (record, retest) = (record(&folder), testdata("retest.csv.gz"));
    let run = |more: &[&str]| {
        let args = [&["verify", &record, &retest, "--window", "300"], more].concat();
        let out = sagnac().args(args).output().unwrap();
        (out.status.code().unwrap(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    assert_eq!(run(&[]).0, 0);
    let (status, said) = run(&["--limits", "navigation-grade"]);
    assert!(status == 3 && said.contains("the calibration has 100.0 s"), "{status}: {said}");
}

/// An input rate of another axis, or one for several axes, must not switch a limit off.
#[test]
fn a_limit_of_the_bias_cannot_be_switched_off_by_a_name() {
    let folder = TempDir::new().unwrap();
    let (record, retest) = (record(&folder), testdata("retest.csv.gz"));
    let run = |rate: &str| {
        let args = ["verify", &record, &retest, "--limits", "navigation-grade", "--input-rate", rate];
        let out = sagnac().args(args).output().unwrap();
        (out.status.code().unwrap(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    assert_eq!(run("4.498").0, 0);
    assert_eq!(run("z=4.498").0, 0);
    // Off by 0.1 °/h.
    assert_eq!(run("z=4.4").0, 1);
    let (status, said) = run("q=4.4");
    assert!(status == 2 && said.contains("input rates of q, but the log has z"), "{status}: {said}");
}

/// A temperature that jumped and came back: the gyro's processor judges it by its own rule, and neither the terminal nor the page says left out.
#[test]
fn a_jump_of_a_thermometer_is_corrected_and_named() {
    let folder = TempDir::new().unwrap();
    let (record, page) = (record(&folder), folder.path().join("a.html").display().to_string());
    let packed = std::fs::read(testdata("retest.csv.gz")).unwrap();
    let mut text = String::new();
    MultiGzDecoder::new(packed.as_slice()).read_to_string(&mut text).unwrap();
    let jumped = text.replacen("\n9995,14.25,", "\n9995,44.25,", 1);
    assert_ne!(jumped, text);
    let log = folder.path().join("jumped.csv").display().to_string();
    std::fs::write(&log, jumped).unwrap();
    let out = sagnac().args(["verify", "-v", &record, &log, "--report", &page]).assert().success().get_output().clone();
    let said = String::from_utf8([out.stdout, out.stderr].concat()).unwrap();
    assert!(said.contains("note: 1 row, thermometer_jump (first at jumped.csv:2000)"), "{said}");
    let page = std::fs::read_to_string(page).unwrap();
    let (before, replayed) = page.split_once("<h3>Corrected as the gyro does it</h3>").unwrap();
    assert!(replayed.contains("<td>thermometer jump</td><td>1</td>") && !before.contains("thermometer jump"));
    assert!(before.ends_with("<h3>Left out</h3><p>Nothing.</p>"), "{}", &before[before.len() - 200..]);
}
