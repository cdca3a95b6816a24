//! The reports of `simulate` in a browser.

use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::Command as Sagnac;
use tempfile::TempDir;

fn scenario(name: &str) -> String {
    format!("{}/../../scenarios/{name}/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

fn sagnac(folder: &TempDir, args: &[&str]) {
    Sagnac::cargo_bin("sagnac").unwrap().current_dir(folder).args(args).assert().success();
}

/// Both reports in Chromium: every figure is drawn, nothing is said on the console.
#[test]
fn reports_open_in_a_browser() {
    let folder = TempDir::new().unwrap();
    let triangle = scenario("triangle-28cm-dithered");
    sagnac(&folder, &["simulate", &triangle, "--report", "sim.html"]);
    sagnac(&folder, &["simulate", &scenario("loop-design"), "--bode", "--report", "bode.html"]);
    for (page, figures) in [("sim.html", 8), ("bode.html", 4)] {
        let path = folder.path().join(page);
        assert!(std::fs::metadata(&path).unwrap().len() < 500_000, "{page}");
        let dom = dumped(&folder, &path);
        assert_eq!(dom.matches("<canvas").count(), figures, "{page}: canvases");
        assert_eq!(dom.matches("class=\"plot\"").count(), figures, "{page}: figures");
    }
}

/// The page after its scripts have run.
fn dumped(folder: &TempDir, page: &Path) -> String {
    let profile: PathBuf = folder.path().join("profile");
    let out = Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=4000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    assert!(out.status.success());
    String::from_utf8_lossy(&out.stdout).into_owned()
}
