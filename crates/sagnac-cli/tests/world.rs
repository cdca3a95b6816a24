//! Logs as other programs write them: `init` and `inspect` read them right, or say which line mends them. Small files are in `../shared/world`;
//! the other logs are made here, in many forms.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Output};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn sagnac(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("sagnac").unwrap().current_dir(folder).args(args).output().unwrap()
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The folder of small files of the world, or `None` where it is missing (with a message).
fn world() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/world");
    if path.exists() {
        return Some(path);
    }
    xtask::skip::skip(&format!("{} is not there", path.display()));
    None
}

#[test]
fn init_guesses_no_unit_wrong() {
    let Some(world) = world() else { return };
    let logs: [(&str, &[&str]); 8] = [
        (
            "6/mems.csv",
            &[
                "\"gyro_x\" = \"rate_dps_x\"   # GUESS",
                "\"gyro_y\" = \"rate_dps_y\"   # GUESS",
                "\"gyro_z\" = \"rate_dps_z\"   # GUESS",
            ],
        ),
        (
            "6/xsens.csv",
            &["\"Gyr_X\" = \"rate_radps_x\"   # GUESS", "\"rate_radps_y\"   # GUESS", "\"rate_radps_z\"   # GUESS"],
        ),
        ("6/deci.csv", &["\"temp\" = \"ignore\"   # no temperature in °C or K: 250 … 400 may be tenths"]),
        ("6/tmp-raw.csv", &["\"Tmp\" = \"ignore\"   # no temperature in °C or K", "below absolute zero"]),
        ("6/runs.csv", &["\"t\" = \"time_s\"   # GUESS: the unit, from rows that are 0.005 apart"]),
        ("11/euroc.csv", &["\"timestamp [ns]\" = \"time_ns\"\n", "\"w_RS_S_y [rad s^-1]\" = \"rate_radps_y\"\n"]),
        (
            "11/spaces.txt",
            &[
                "# NEEDED: the unit of the rates: the angle random walk would be",
                "\"ang_vel_x\" = \"ignore\"   # a rate",
            ],
        ),
        (
            "11/shimmer.csv",
            &["\"A_Temperature_CAL\" = \"temperature_c_a_cal\"\n", "\"A_Gyro_X_CAL\" = \"rate_dps_x\"\n"],
        ),
    ];
    for (name, wanted) in logs {
        let init = sagnac(&world, &["init", name]);
        assert!(init.status.success(), "{name}: {}", said(&init));
        let setup = out(&init);
        wanted.iter().for_each(|line| assert!(setup.contains(line), "{name}: {line}\n{setup}"));
    }
    for (name, words) in [
        ("11/lvm.lvm", ["LabVIEW's LVM", "awk \"/^X_Value/"]),
        ("11/serial-monitor.txt", ["a serial monitor with its stamps", "time_s,column_1,column_2"]),
        ("11/matrix.mat", ["MATLAB 7.3", "{i + 1}"]),
    ] {
        let refused = said(&sagnac(&world, &["init", name]));
        words.iter().for_each(|word| assert!(refused.replace("\n  ", " ").contains(word), "{name}: {word}\n{refused}"));
    }
}

#[test]
fn inspect_calls_no_wrong_log_good() {
    let Some(world) = world() else { return };
    let inspect = |args: &[&str]| sagnac(&world, &[&["inspect"], args].concat());
    let tenths = inspect(&["9/deci.csv"]);
    assert!(tenths.status.success() && !out(&tenths).contains("good for calibration"), "{}", out(&tenths));
    assert!(out(&tenths).contains("79 % of the rows are excluded"), "{}", out(&tenths));
    let unsigned = inspect(&["9/u16.csv"]);
    assert_eq!(unsigned.status.code(), Some(2), "{}", out(&unsigned));
    assert!(said(&unsigned).contains("a signed 16-bit number was read"), "{}", said(&unsigned));
    let noise = inspect(&["10/notime.csv", "--sample-interval", "0.01"]);
    assert!(out(&noise).contains("good for noise only"), "{}", out(&noise));
    let open = inspect(&["11/spaces.txt"]);
    assert!(said(&open).contains("sagnac init") && said(&open).contains("ang_vel_x"), "{}", said(&open));
}

/// Noise of a row, the same for each form of a log.
fn noise(row: usize) -> f64 {
    let mixed =
        |at: usize| (at as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (0..12).map(|at| (mixed(12 * row + at + 1) >> 11) as f64 / (1_u64 << 53) as f64).sum::<f64>() - 6.0
}

const ROWS: usize = 3000;

/// Time, s, temperature, °C, and rate, °/s, of each row.
fn rows() -> impl Iterator<Item = (usize, f64, f64)> {
    (1..=ROWS).map(|row| {
        let part = 1.0 - (2.0 * row as f64 / ROWS as f64 - 1.0).abs();
        (row, 20.0 + 30.0 * part, 0.02 + 0.01 * part + 0.002 * noise(row))
    })
}

fn survey(folder: &Path, name: &str, more: &[&str]) -> Value {
    let output = sagnac(folder, &[&["inspect", name, "--json"], more].concat());
    assert!(output.status.success(), "{name}: {}", said(&output));
    let mut object: Value = serde_json::from_slice(&output.stdout).unwrap();
    for own in ["ignored_columns", "kind"] {
        object.as_object_mut().unwrap().remove(own);
    }
    object["survey"]["thermometers"][0]["name"] = Value::Null;
    object
}

/// Headers behind a mark and columns between blanks are those of the plain log, with or without `init`.
#[test]
fn marks_and_blanks_change_no_figure() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let log = |head: &str, form: &dyn Fn(usize, f64, f64) -> String| {
        let rows: String = rows().map(|(time, celsius, rate)| form(time, celsius, rate) + "\n").collect();
        format!("{head}\n{rows}")
    };
    let commas = |time: usize, celsius: f64, rate: f64| format!("{time},{celsius:.3},{rate:.6}");
    let blanks = |time: usize, celsius: f64, rate: f64| format!("{time} {celsius:.3} {rate:.6}");
    let wide = |time: usize, celsius: f64, rate: f64| format!("  {time:>6}   {celsius:>9.3}  {rate:>10.6}  ");
    let names = "time_s,temperature_c,rate_dps_z";
    fs::write(at.join("plain.csv"), log(names, &commas)).unwrap();
    let plain = survey(at, "plain.csv", &[]);
    assert_eq!(plain["survey"]["good_for"], "calibration", "{plain}");
    let spaced = names.replace(',', " ");
    let forms = [
        log(&format!("#{names}"), &commas),
        log(&format!("# a bench\n#\n# {names}"), &commas),
        log(&format!("## {}", names.replace(',', ";")), &|t, c, r| commas(t, c, r).replace(',', ";")),
        log("# t [s],Temp [Degrees Celsius],w_z [deg s^-1]", &commas),
        log(&spaced, &blanks),
        log(&format!("# {spaced}"), &blanks),
        log(&format!("   {}  ", names.replace(',', "    ")), &wide),
        log(&format!("A bench, some day\n\n{spaced}"), &wide),
        log("GyroTime_s,TempC,GyroZ_dps", &commas).replacen("GyroTime_s", "Time_s", 1),
    ];
    for (form, text) in forms.iter().enumerate() {
        let name = format!("form-{form}.csv");
        fs::write(at.join(&name), text).unwrap();
        assert_eq!(survey(at, &name, &[])["survey"], plain["survey"], "{name}: {}", &text[..120]);
        let init = sagnac(at, &["init", &name, "-o", "bench.toml"]);
        assert!(out(&init).contains(": 0 guesses"), "{name}: {}{}", out(&init), said(&init));
        assert_eq!(survey(at, &name, &["--setup", "bench.toml"])["survey"], plain["survey"], "{name}");
        fs::remove_file(at.join("bench.toml")).unwrap();
    }
}

/// `gx` may be a rate or an acceleration, and a triad of one unit that is stated once has it.
#[test]
fn a_triad_is_of_one_quantity_and_unit() {
    let folder = TempDir::new().unwrap();
    let init = |head: &str, means: [f64; 3], sigma: f64| {
        let cell = |row: usize, axis: usize| format!("{:.7}", means[axis] + sigma * noise(3 * row + axis));
        let row = |row: usize| format!("{:.2},{},{},{}\n", 0.01 * row as f64, cell(row, 0), cell(row, 1), cell(row, 2));
        fs::write(folder.path().join("log.csv"), format!("{head}\n{}", (0..900).map(row).collect::<String>())).unwrap();
        out(&sagnac(folder.path(), &["init", "log.csv"]))
    };
    let units = |setup: &str| {
        ["rate_dph_", "rate_dps_", "rate_radps_"].map(|unit| setup.matches(&format!("= \"{unit}")).count())
    };
    for names in [
        "gx,gy,gz",
        "wx,wy,wz",
        "GyroX,GyroY,GyroZ",
        "gyroADC[0],gyroADC[1],gyroADC[2]",
        "Gyroscope X,Gyroscope Y,Gyroscope Z",
    ] {
        let log = |means, sigma| units(&init(&format!("time_s,{names}"), means, sigma));
        // 0.3 °/√h in °/s, 0.01 °/√h in °/h, 0.3 °/√h in rad/s or 0.005 °/√h in °/s.
        assert_eq!(log([4.5, 0.14, -1.2], 0.05), [0, 3, 0], "{names}");
        assert_eq!(log([9.0, -3.0, 12.0], 6.0), [3, 0, 0], "{names}");
        assert_eq!(log([0.01, 0.002, -0.03], 0.000_87), [0; 3], "{names}");
    }
    let ros = init("time_s,angular_velocity.x,angular_velocity.y,angular_velocity.z", [0.01, 0.002, -0.03], 0.000_87);
    assert_eq!(units(&ros), [0, 0, 3], "{ros}");
    let gravity = init("time_s,gx,gy,gz", [0.1, -0.2, 0.97], 0.002);
    assert!(units(&gravity) == [0; 3] && gravity.contains("accelerations"), "{gravity}");
    let stated = init("time_s,gyro_x_dps,gyro_y,gyro_z", [0.01, 0.002, -0.03], 0.000_87);
    assert_eq!(units(&stated), [0, 3, 0], "{stated}");
}

/// The command that a refusal or a setup has for a log, run.
fn mend(folder: &Path, text: &str) {
    let start =
        ["awk -F", "awk \""].iter().filter_map(|start| text.find(start)).min().unwrap_or_else(|| panic!("{text}"));
    let command = text[start..].lines().next().unwrap();
    let run = Process::new("sh").current_dir(folder).args(["-c", command]).output().unwrap();
    assert!(run.status.success(), "{command}: {}", said(&run));
}

/// The printed commands make logs that are read, with the figures of the plain one.
#[test]
fn times_of_other_programs_are_mended_by_the_printed_line() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let clock = |time: usize| {
        let s = 85_000 + time;
        format!("{:02}:{:02}:{:02}", s / 3600 % 24, s / 60 % 60, s % 60)
    };
    let day = |time: usize| 28 + (85_000 + time) / 86_400;
    let log = |head: &str, separator: &str, form: &dyn Fn(usize) -> String| {
        let row = |(time, celsius, rate): (usize, f64, f64)| {
            format!("{}{separator}{celsius:.3}{separator}{rate:.6}\n", form(time))
        };
        format!("{}\n{}", head.replace(',', separator), rows().map(row).collect::<String>())
    };
    let names = "temperature_c,rate_dps_z";
    fs::write(at.join("plain.csv"), log(&format!("time_s,{names}"), ",", &|time| time.to_string())).unwrap();
    let plain = survey(at, "plain.csv", &[]);
    let logs = [
        ("clock.csv", log(&format!("Uhrzeit,{names}"), ";", &clock)),
        ("stamped.csv", log(&format!("Zeitpunkt,{names}"), "\t", &|time| format!("{}.000", clock(time)))),
        ("us.csv", log(&format!("Date,Time,{names}"), ",", &|time| format!("01/{}/2024,{}", day(time), clock(time)))),
        ("eu.csv", log(&format!("Date,Time,{names}"), ",", &|time| format!("{}/01/2024,{}", day(time), clock(time)))),
        (
            "de.csv",
            log(&format!("Datum,Uhrzeit,{names}"), ";", &|time| format!("{}.01.2024;{}", day(time), clock(time))),
        ),
        ("one.csv", log(&format!("Timestamp,{names}"), ",", &|time| format!("01/{}/2024 {}", day(time), clock(time)))),
    ];
    let stamped = |(time, celsius, rate): (usize, f64, f64)| format!("{}.000 -> {celsius:.3},{rate:.6}\n", clock(time));
    let serial = format!("{}.000 -> {names}\n{}", clock(0), rows().map(stamped).collect::<String>());
    for (name, text) in logs.into_iter().chain([("serial.csv", serial)]) {
        let is_serial = name == "serial.csv";
        fs::write(at.join(name), text).unwrap();
        let init = sagnac(at, &["init", name]);
        let words = if is_serial { said(&init).replace("\n  ", " ") } else { out(&init) };
        assert!(is_serial || words.contains("# NEEDED: no column of time was found"), "{words}");
        mend(at, &words);
        let mended = format!("{name}.csv");
        let made = sagnac(at, &["init", &mended, "-o", "bench.toml"]);
        assert!(made.status.success(), "{mended}: {}", said(&made));
        let found = survey(at, &mended, &["--setup", "bench.toml"]);
        for key in ["rows", "sample_interval_s", "windows_used", "axes"] {
            assert_eq!(found[key], plain[key], "{mended}: {key}");
        }
        fs::remove_file(at.join("bench.toml")).unwrap();
    }
}

/// LabVIEW's text, with decimal commas, becomes a log of its channels.
#[test]
fn a_file_of_labview_is_mended_by_the_printed_line() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nX_Dimension\tTime\tTime\t\nX0\t0,0E+0\t0,0E+0\t\nDelta_X\t1,0\t1,0\t\n***End_of_Header***\t\t\t\nX_Value\tTemp [°C]\tGyro [deg/s]\tComment\n";
    let row =
        |(time, celsius, rate): (usize, f64, f64)| format!("{time}\t{celsius:.3}\t{rate:.6}\t\n").replace('.', ",");
    fs::write(at.join("log.lvm"), head.to_owned() + &rows().map(row).collect::<String>()).unwrap();
    let refused = sagnac(at, &["inspect", "log.lvm"]);
    assert_eq!(refused.status.code(), Some(2));
    mend(at, &said(&refused).replace("\n  ", " "));
    let found = survey(at, "log.lvm.csv", &[]);
    assert_eq!(
        (&found["rows"], &found["survey"]["good_for"]),
        (&Value::from(ROWS), &Value::from("calibration")),
        "{found}"
    );
}

/// Logs of which most is excluded, of rates that no gyro has, and clipped ones.
#[test]
fn inspect_says_what_is_wrong_with_the_values() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let verdict = |form: &dyn Fn(usize, f64, f64) -> String| {
        let rows: String = rows().map(|(time, celsius, rate)| form(time, celsius, rate) + "\n").collect();
        fs::write(at.join("log.csv"), format!("time_s,temperature_c,rate_dps_z,valid\n{rows}")).unwrap();
        out(&sagnac(at, &["inspect", "log.csv"]))
    };
    let sound = verdict(&|t, c, r| format!("{t},{c:.2},{r:.5},1.000000"));
    assert!(sound.contains("good for calibration") && !sound.contains("full scale"), "{sound}");
    let tenths = verdict(&|t, c, r| format!("{t},{:.0},{r:.5},1", 10.0 * c));
    assert!(!tenths.contains("good for calibration") && tenths.contains("temperature_invalid"), "{tenths}");
    let flagged = verdict(&|t, c, r| format!("{t},{c:.2},{r:.5},{}", u8::from(t % 1000 < 400)));
    assert!(!flagged.contains("good for calibration") && flagged.contains("% of the rows are excluded"), "{flagged}");
    let codes = verdict(&|t, c, r| format!("{t},{c:.2},{:.0},1", 30_000.0 + 1e5 * r));
    assert!(codes.contains("not usable: axis z reads") && codes.contains("faster than any gyro"), "{codes}");
    let clipped = verdict(&|t, c, r| format!("{t},{c:.2},{:.5},1", f64::min(r, 0.026)));
    assert!(clipped.contains("0.0260000 °/s exactly") || clipped.contains("93.6"), "{clipped}");
    assert!(clipped.replace("\n ", "").contains("clipped at full scale"), "{clipped}");
}
