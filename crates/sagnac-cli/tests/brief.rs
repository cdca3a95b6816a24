//! The short form of a result: one verdict per unit, at most 15 lines of 100 columns, nothing with `-q`, everything with `-v`.

use std::fmt::Write as _;
use std::fs;
use std::process::Output;

use assert_cmd::Command;
use tempfile::TempDir;

/// Three axes of a rate gyro, heated and cooled; SplitMix64 makes their noise. Rates in °/s, a cubic and a rate term in °/h.
fn log(seed: u64, rows: usize) -> String {
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut text = "time_s,temperature_c,rate_dps_x,rate_dps_y,rate_dps_z\n".to_owned();
    for row in 0..rows {
        let phase = row as f64 / rows as f64;
        let soaked = (1.2 - (2.0 * phase - 1.0).abs() * 1.4).clamp(0.0, 1.0);
        let u = 2.0 * soaked - 1.0;
        let rates: Vec<String> = [779.0, 317.0, 831.0]
            .map(|size| {
                let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                let dph = size * (u + 0.3 * u * u * u) + 40.0 * noise + 1000.0;
                format!("{:.7}", dph / 3600.0)
            })
            .to_vec();
        let _ = writeln!(text, "{},{:.3},{}", (row + 1) * 5, 20.0 + 40.0 * u, rates.join(","));
    }
    text
}

struct Unit(TempDir);

impl Unit {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        for (name, seed) in [("run1.csv", 1), ("run2.csv", 2), ("run3.csv", 3)] {
            fs::write(folder.path().join(name), log(seed, 4000)).unwrap();
        }
        let limits = "sigma_dph_max = 30\npeak_to_peak_dph_max = 1e4\nimprovement_sigma_min = 2\nout_of_span_max = 0.1\n\
                      span_covered_min = 0.9\nramps_rms_dph_max = 40\nmissing_max = 0.5\n";
        fs::write(folder.path().join("seven.toml"), limits).unwrap();
        fs::write(folder.path().join("strict.toml"), limits.replace("sigma_dph_max = 30", "sigma_dph_max = 0.1"))
            .unwrap();
        Self(folder)
    }

    fn run(&self, args: &str) -> Output {
        let mut command = Command::cargo_bin("sagnac").unwrap();
        command.current_dir(self.0.path()).args(args.split(' ')).output().unwrap()
    }

    /// Both streams, which are short.
    fn short(&self, args: &str) -> String {
        let Output { stdout, stderr, .. } = self.run(args);
        let text = String::from_utf8([stdout, stderr].concat()).unwrap();
        assert!(text.lines().count() <= 15, "{args}: {} lines\n{text}", text.lines().count());
        let widest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
        assert!(widest <= 100, "{args}: {widest} columns\n{text}");
        text
    }
}

#[test]
fn a_unit_has_one_verdict_in_fifteen_lines() {
    let it = Unit::new();
    let calibrate = "calibrate run1.csv run2.csv --serial IMU-0042 --window 50 -o unit.cal.json";
    let said = it.short(calibrate);
    assert!(said.starts_with("IMU-0042: calibrated over -20 … 60 °C (2 runs, 11 h, all data used)\n"), "{said}");
    assert!(said.contains("the fit") || said.contains("mean rate at 25 °C, Earth rate included, is kept"), "{said}");
    assert!(said.contains("next    sagnac verify unit.cal.json RETEST.csv"), "{said}");
    // The drift of axis x: 779·(u + 0.3u³) has a σ of some hundreds of °/h, the noise of a 50 s window 12.6 °/h.
    assert!(
        said.lines().any(|line| line.starts_with("x ") && line.contains(" x ") && line.contains("cubic")),
        "{said}"
    );

    let met = it.short("verify unit.cal.json run3.csv --window 50 --limits seven.toml");
    assert!(met.starts_with("IMU-0042: ACCEPTED - 21 limits met"), "{met}");
    assert!(met.contains("temperature span covered") && met.contains("≥ 90.0 %"), "{met}");
    let missed = it.short("verify unit.cal.json run3.csv --window 50 --limits strict.toml");
    let words = "IMU-0042: NOT ACCEPTED - axes x, y, z miss 1 of 7 limits\n";
    assert!(missed.starts_with(words), "{missed}");
    assert!(missed.contains("FAIL σ after correction"), "{missed}");
    let many = it.short("verify unit.cal.json run3.csv --window 50 --limits navigation-grade");
    assert!(many.starts_with("IMU-0042: NOT ACCEPTED") && many.contains(" met, "), "{many}");
    it.short("verify unit.cal.json run3.csv --window 50");
    it.short("allan run1.csv");
    assert_eq!(it.run("calibrate run3.csv --serial IMU-0042 --window 50 -o later.cal.json -q").status.code(), Some(0));
    let changed = it.short("compare unit.cal.json later.cal.json --limits navigation-grade");
    assert!(changed.starts_with("IMU-0042: "), "{changed}");
}

/// The short form in another unit: it stays short, its numbers are those of °/h by the factor, and the record is the same.
#[test]
fn rates_are_shown_in_the_unit_that_is_asked() {
    let it = Unit::new();
    let calibrate = "calibrate run1.csv run2.csv --serial IMU-0042 --window 50 -o unit.cal.json";
    let unseen = |said: &str, unit: &str| -> f64 {
        let line = said.lines().find(|line| line.starts_with("x ")).unwrap();
        line.split(unit).nth(1).unwrap().trim().parse().unwrap()
    };
    let dph = unseen(&it.short(calibrate), "°/h");
    let record = fs::read(it.0.path().join("unit.cal.json")).unwrap();
    for (unit, name, dph_per_unit) in [("dps", "°/s", 3600.0), ("mdps", "m°/s", 3.6), ("rad/s", "rad/s", 206_264.806)]
    {
        let said = it.short(&format!("{calibrate} --units {unit}"));
        // Both are rounded to three digits.
        assert!((unseen(&said, name) * dph_per_unit / dph - 1.0).abs() < 0.011 && !said.contains("°/h"), "{said}");
        assert_eq!(fs::read(it.0.path().join("unit.cal.json")).unwrap(), record, "{unit}");
        let judged =
            it.short(&format!("verify unit.cal.json run3.csv --window 50 --limits navigation-grade --units {unit}"));
        assert!(judged.contains(name) && !judged.contains("°/h"), "{judged}");
        assert!(it.short(&format!("allan run1.csv --units {unit}")).contains(name), "{unit}");
        for report in [
            format!("{calibrate} --units {unit} --report r.html"),
            format!("verify unit.cal.json run3.csv --window 50 --units {unit} --report r.html"),
            format!("allan run1.csv --units {unit} --report r.html"),
            format!("compare unit.cal.json unit.cal.json --units {unit} --report r.html"),
        ] {
            it.run(&report);
            let page = fs::read_to_string(it.0.path().join("r.html")).unwrap();
            assert!(page.contains(name) && !page.contains("°/h"), "{report}");
            fs::remove_file(it.0.path().join("r.html")).unwrap();
        }
        let why = String::from_utf8(it.run(&format!("-v allan run1.csv --units {unit}")).stdout).unwrap();
        assert!(why.contains("at most") && !why.contains("°/h") && !why.contains("°/√h"), "{why}");
        let verbose = it.run(&format!("-v {calibrate} --units {unit}"));
        assert!(!String::from_utf8_lossy(&verbose.stdout).contains("°/h"), "{verbose:?}");
    }
    fs::write(it.0.path().join("bench.toml"), "units = \"dps\"\n").unwrap();
    let by_setup = it.short(&format!("{calibrate} --setup bench.toml"));
    assert!(by_setup.contains("°/s") && !by_setup.contains("°/h"), "{by_setup}");
    // The record has the setup, and with it the unit of what is made of it.
    assert!(it.short("evaluate unit.cal.json --at 0,20").contains("drift, °/s"));
    assert_eq!(it.run(&format!("{calibrate} --units furlong")).status.code(), Some(2));
}

/// Columns with names of their own: said of the first log, not with `-q`.
#[test]
fn the_columns_of_two_logs_are_named_once() {
    let it = Unit::new();
    for name in ["run1.csv", "run2.csv"] {
        let text = fs::read_to_string(it.0.path().join(name)).unwrap();
        let text = text.replacen("time_s,temperature_c,rate_dps_x", "Time (s),Temp (degC),Gyro X (deg/s)", 1);
        fs::write(it.0.path().join(name), text).unwrap();
    }
    let calibrate = "calibrate run1.csv run2.csv --serial IMU-0042 --window 50 -o unit.cal.json";
    let said = it.short(calibrate);
    assert_eq!(said.matches("read as").count(), 1, "{said}");
    assert!(it.short(&format!("-q {calibrate}")).is_empty());
}

#[test]
fn quiet_prints_errors_alone_and_verbose_everything() {
    let it = Unit::new();
    let quiet = it.run("calibrate run1.csv run2.csv --serial IMU-0042 --window 50 -o unit.cal.json -q");
    assert!(quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty(), "{quiet:?}");
    let missed = it.run("-q verify unit.cal.json run3.csv --window 50 --limits strict.toml");
    assert!(missed.status.code() == Some(1) && missed.stdout.is_empty() && missed.stderr.is_empty(), "{missed:?}");
    let refused = it.run("-q calibrate no-such.csv");
    assert!(refused.status.code() == Some(2) && !refused.stderr.is_empty(), "{refused:?}");
    let object = it.run("-q verify unit.cal.json run3.csv --window 50 --json");
    assert!(serde_json::from_slice::<serde_json::Value>(&object.stdout).is_ok(), "{object:?}");
    let verbose = it.run("-v verify unit.cal.json run3.csv --window 50 --limits strict.toml");
    let verbose = String::from_utf8(verbose.stdout).unwrap();
    assert!(verbose.contains("axis z: LIMITS NOT MET") && verbose.contains("lag-1 autocorrelation"), "{verbose}");
}
