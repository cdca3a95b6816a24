//! The size of a report, and that it is always the same. `browser/` looks at reports in a browser.

use std::path::Path;

use assert_cmd::Command as Sagnac;
use sagnac_sim::{LaggedChamber, Leg, csv_bytes};
use tempfile::TempDir;

fn sagnac(folder: &Path, args: &[&str]) {
    Sagnac::cargo_bin("sagnac").unwrap().current_dir(folder).args(args).assert().success();
}

/// 24 hours of one axis, a row each 5 s.
#[test]
fn the_report_of_a_day_is_small_and_always_the_same() {
    let day = LaggedChamber {
        row_s: 5,
        legs: vec![
            Leg::Soak(10_800.0),
            Leg::Ramp(70.0, 0.5),
            Leg::Soak(10_800.0),
            Leg::Ramp(-40.0, 0.5),
            Leg::Soak(10_800.0),
            Leg::Ramp(70.0, 0.5),
            Leg::Soak(14_400.0),
        ],
        ..LaggedChamber::domain_notes()
    };
    let folder = TempDir::new().unwrap();
    let rows: Vec<_> = day.run(1).collect();
    let hours = rows[rows.len() - 1].time_s / 3600.0;
    assert!((23.9..24.2).contains(&hours), "{hours}");
    std::fs::write(folder.path().join("day.csv"), csv_bytes(rows.into_iter())).unwrap();
    let flags = ["--arcsec-per-count", "0.15125", "-o", "u.json", "--report"];
    sagnac(folder.path(), &[&["calibrate", "day.csv"][..], &flags, &["day.html"]].concat());
    sagnac(folder.path(), &[&["calibrate", "day.csv"][..], &flags, &["again.html"]].concat());
    sagnac(folder.path(), &["verify", "u.json", "day.csv", "--report", "proof.html"]);
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    for name in ["day.html", "proof.html"] {
        let size = read(name).len();
        assert!(size < 400_000, "{name} has {size} bytes");
    }
    assert!(read("day.html") == read("again.html"));
    // The report states that a retest on the log of the fit proves nothing, and claims no reduction.
    let proof = String::from_utf8(read("proof.html")).unwrap();
    assert!(
        proof.contains("This is no proof")
            && proof.contains("no reduction is stated")
            && !proof.contains("rift reduced")
    );
}

/// The page opens with the terminal's numbers, shows the residual alone, and claims nothing where nothing was gained.
#[test]
fn the_headline_has_the_numbers_of_the_terminal() {
    let folder = TempDir::new().unwrap();
    let data = |name: &str| format!("{}/../../testdata/chamber/{name}", env!("CARGO_MANIFEST_DIR"));
    let log = data("cycle-1.csv.gz");
    let run = |model: &str| {
        let args = ["calibrate", &log, "--setup", &data("bench.toml"), "--model", model, "--report", "u.html"];
        let out = Sagnac::cargo_bin("sagnac").unwrap().current_dir(folder.path()).args(args).output().unwrap();
        let said = String::from_utf8(out.stderr).unwrap() + &String::from_utf8(out.stdout).unwrap();
        (said, std::fs::read_to_string(folder.path().join("u.html")).unwrap())
    };
    let (said, page) = run("bias 3, rate 0");
    let row: Vec<&str> = said.lines().find(|line| line.starts_with("z ")).unwrap().split_whitespace().collect();
    let [.., remaining, _, times, _] = row[1..7] else { panic!("{said}") };
    assert!(
        page.contains(&format!("<b class=\"word\">Drift reduced {times} times; remaining {remaining} °/h</b>")),
        "{row:?}"
    );
    assert!(page.contains("id=\"residual-z\"") && page.contains("Noise alone leaves 95 % of the points in the band."));
    let (_, page) = run("bias 0");
    assert!(page.contains("<b class=\"word\">Drift not reduced; remaining "));
}

/// A warning that the terminal prints about a fit stands on its page, in the same words.
#[test]
fn terminal_and_page_have_the_same_notes() {
    let folder = TempDir::new().unwrap();
    let data = |name: &str| format!("{}/../../testdata/chamber/{name}", env!("CARGO_MANIFEST_DIR"));
    let args = ["calibrate", "-v", &data("cycle-1.csv.gz"), "--setup", &data("bench.toml"), "--model", "bias 0"];
    let ran = Sagnac::cargo_bin("sagnac")
        .unwrap()
        .current_dir(folder.path())
        .args(args)
        .args(["--report", "u.html"])
        .output();
    let said = String::from_utf8(ran.unwrap().stderr).unwrap();
    let warnings: Vec<&str> = said.lines().filter_map(|line| line.strip_prefix("warning: ")).collect();
    assert!(warnings.iter().any(|line| line.contains("the rows contradict this model")), "{said}");
    let page = std::fs::read_to_string(folder.path().join("u.html")).unwrap();
    let page = page.replace("<code>", "`").replace("</code>", "`");
    for warning in warnings {
        // Some name their axis, which the page's verdict is about already.
        let words = warning.strip_prefix("axis z: ").unwrap_or(warning);
        assert!(page.contains(&format!("Warning: {words}.")), "{words}");
    }
}
