//! `sagnac allan` as scripts call it.

use std::fs;

use assert_cmd::Command;
use sagnac_sim::{PaperRig, csv_bytes};
use serde_json::Value;
use tempfile::TempDir;

fn sagnac() -> Command {
    Command::cargo_bin("sagnac").unwrap()
}

/// The names that scripts rely on, and a curve that is read again.
#[test]
fn allan_speaks_json_and_reads_its_own_curve() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let still = PaperRig { coefficients: [0.0, 0.0, 424.64], windows: 40, ..PaperRig::PAPER };
    fs::write(at("log.csv"), csv_bytes(still.run(1))).unwrap();
    let (csv, html) = (at("curve.csv"), at("allan.html"));
    let log = at("log.csv");
    let flags = ["allan", &log, "--arcsec-per-count", "1.059", "--quantum", "0.25", "--json", "-o", &csv];
    let out = sagnac().args(flags).args(["--report", &html]).assert().success().get_output().stdout.clone();
    let object: Value = serde_json::from_slice(&out).unwrap();
    let axis = &object["axes"][0];
    for name in ["tau_s", "adev_dph", "lower_dph", "upper_dph", "n"] {
        assert!(axis["curve"][0][name].is_number(), "{name}");
    }
    for name in ["q_arcsec", "n_deg_rt_h", "b_dph", "k_dph_rt_h", "r_dph_h"] {
        let term = &axis["terms"][name];
        assert!(
            term["value"].is_number() && term["lower"].is_number() || term["unresolved"].is_string(),
            "{name}: {term}"
        );
    }
    // The rig's walk: 0.003 °/√h.
    let n = axis["terms"]["n_deg_rt_h"].clone();
    assert!(n["lower"].as_f64().unwrap() < 0.003 && n["upper"].as_f64().unwrap() > 0.003, "{n}");
    let again =
        sagnac().args(["allan", &csv, "--duration", "4000", "--json"]).assert().success().get_output().stdout.clone();
    let again: Value = serde_json::from_slice(&again).unwrap();
    let value = |object: &Value| object["axes"][0]["terms"]["n_deg_rt_h"]["value"].as_f64().unwrap();
    assert!((value(&again) / value(&object) - 1.0).abs() < 0.05, "{} and {}", value(&again), value(&object));
    let page = fs::read_to_string(html).unwrap();
    // N, B and K with their intervals stand before the curve, in this order; the others only where they are resolved.
    let place = |words: &str| page.find(words).unwrap_or_else(|| panic!("{words}"));
    let listed = [
        "Noise terms, with 95 % intervals",
        "angle random walk N",
        "bias instability B",
        "rate random walk K",
        "id=\"allan-x\"",
    ];
    assert!(listed.map(place).is_sorted(), "{listed:?}");
    let cell = |name: &str| sagnac_units::format::significant(n[name].as_f64().unwrap(), 3);
    assert!(page.contains(&format!("{} ({} … {})", cell("value"), cell("lower"), cell("upper"))));
    let has_ramp = axis["terms"]["r_dph_h"]["value"].is_number();
    assert_eq!(page[..place("id=\"allan-x\"")].contains("rate ramp R"), has_ramp);
}

/// A record without any deviation, and curves as spreadsheets write them: said in words, drawn or not, never for ever.
#[test]
fn odd_records_end_with_words() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let run = |args: &[&str]| {
        let out =
            sagnac().args(args).timeout(std::time::Duration::from_secs(60)).assert().success().get_output().clone();
        String::from_utf8(out.stdout).unwrap()
    };
    let rows: String = (1..=1000).map(|k| format!("{k},7.123\n")).collect();
    fs::write(at("constant.csv"), format!("time_s,rate_dph\n{rows}")).unwrap();
    assert!(
        run(&["allan", "-v", &at("constant.csv"), "--report", &at("constant.html")]).contains("all its rows are alike")
    );
    fs::write(at("two.csv"), "time_s,rate_dph\n1,5\n2,6\n").unwrap();
    let two = run(&["allan", "-v", &at("two.csv"), "--json"]);
    let object: Value = serde_json::from_str(&two).unwrap();
    assert!(object["axes"][0]["curve"][0]["lower_dph"].is_null(), "one difference has no interval: {two}");
    let curve = "\u{feff}# made elsewhere\ntau_s,adev_dph_x,adev_dph_y\n1,0.2,\n2,0.1,\n4,0.05,\n";
    fs::write(at("curve.csv"), curve).unwrap();
    let said = run(&["allan", "-v", &at("curve.csv"), "--report", &at("curve.html"), "-o", &at("again.csv")]);
    assert!(said.contains("quantization Q") && said.contains("0.115"), "Q = 0.2/√3: {said}");
    assert!(!said.contains("e-"), "a rounding is no term: {said}");
}

/// Rows far from the others: named by line, both figures shown, the clean one used up to 0.5 % of the rows, and beyond it said
/// that it is not.
#[test]
fn disturbed_rows_are_named_and_both_figures_shown() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let run = || {
        let rate = |k: u32| f64::from(k * 7919 % 1009) / 504.5 + if k % 1000 == 500 { 40.0 } else { 9.0 };
        let rows: String = (1..=4000).map(|k| format!("{k},{}\n", rate(k))).collect();
        fs::write(at("log.csv"), format!("time_s,rate_dph\n{rows}")).unwrap();
        let out = sagnac().args(["allan", "-v", &at("log.csv"), "--report", &at("log.html")]).assert().success();
        let json =
            sagnac().args(["allan", "-v", &at("log.csv"), "--json"]).assert().success().get_output().stdout.clone();
        let object: Value = serde_json::from_slice(&json).unwrap();
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        (text(&out.get_output().stdout), text(&out.get_output().stderr), object["axes"][0]["disturbed"].clone())
    };
    let (said, warned, object) = run();
    assert!(
        said.contains("4 rows are far from those around them, 0.10 % of all:") && said.contains("log.csv:501 (+3"),
        "{said}"
    );
    assert!(
        said.contains("the figures are without them; with them: ") && !warned.contains("too many"),
        "{said} {warned}"
    );
    assert_eq!((object["rows"].as_u64(), object["excluded"].as_bool()), (Some(4), Some(true)));
    assert!(fs::read_to_string(at("log.html")).unwrap().contains("the figures are without them"));
    let many = |k: u32| if k % 100 == 50 { 40.0 } else { 9.0 };
    let rows: String = (1..=4000).map(|k| format!("{k},{}\n", f64::from(k * 7919 % 1009) / 504.5 + many(k))).collect();
    fs::write(at("many.csv"), format!("time_s,rate_dph\n{rows}")).unwrap();
    let out = sagnac().args(["allan", "-v", &at("many.csv")]).assert().success().get_output().clone();
    let (said, warned) = (String::from_utf8(out.stdout).unwrap(), String::from_utf8(out.stderr).unwrap());
    assert!(said.contains("40 rows are far") && said.contains("the figures are with them; without them: "), "{said}");
    assert!(warned.contains("too many to exclude"), "{warned}");
}
