//! Logs as they come: encodings, separators, preambles, units, dates, missing values, folders and patterns. Every form of one log gives
//! the figures of its plain form.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::Output;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BooleanArray, Float32Array, Int32Array, RecordBatch, StringArray, TimestampMillisecondArray,
};
use arrow_ipc::writer::{FileWriter, StreamWriter};
use assert_cmd::Command;
use flate2::read::MultiGzDecoder;
use parquet::arrow::ArrowWriter;
use serde_json::Value;
use tempfile::TempDir;

const ROWS: usize = 600;

fn sagnac(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("sagnac").unwrap().current_dir(folder).args(args).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Time, temperature and counts of a row.
fn row(at: usize) -> (usize, f64, usize) {
    let triangle = 1.0 - (2.0 * at as f64 / ROWS as f64 - 1.0).abs();
    (at + 1, (2000.0 + 3000.0 * triangle).round() / 100.0, 1200 + at * 7919 % 13 + (10.0 * triangle) as usize)
}

/// The rows in some form.
fn rows(form: impl Fn(usize, f64, usize) -> String) -> String {
    (0..ROWS).map(row).map(|(time, celsius, counts)| form(time, celsius, counts) + "\n").collect()
}

fn german(number: f64) -> String {
    format!("{number:.2}").replace('.', ",")
}

fn survey(folder: &Path, name: &str) -> (Value, String) {
    let output = sagnac(folder, &["inspect", name, "--arcsec-per-count", "1", "--json"]);
    assert!(output.status.success(), "{name}: {}", said(&output));
    let mut object: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{name}: {e}"));
    // Where the reading of an excluded row was is of the form, not of the log.
    object.as_object_mut().unwrap().remove("excluded");
    (object, said(&output))
}

fn utf16(text: &str, big: bool) -> Vec<u8> {
    let units = std::iter::once(0xfeff).chain(text.encode_utf16());
    units.flat_map(|unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
}

fn windows_1252(text: &str) -> Vec<u8> {
    encoding_rs::WINDOWS_1252.encode(text).0.into_owned()
}

#[test]
fn every_form_of_a_log_gives_the_figures_of_the_plain_one() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let head = "time_s;temperature_c;counts\n";
    let semicolons = rows(|time, celsius, counts| format!("{time};{};{counts}", german(celsius)));
    let commas = rows(|time, celsius, counts| format!("{time},{celsius:.2},{counts}"));
    let grouped = |separator: char| {
        let set_apart = |counts: usize| format!("{}{separator}{:03},0", counts / 1000, counts % 1000);
        rows(|time, celsius, counts| format!("{time};{};{}", german(celsius), set_apart(counts)))
    };
    let clock = |time: usize| format!("{:02}:{:02}:{:02}", 10 + time / 3600, time / 60 % 60, time % 60);
    fs::write(at.join("plain.csv"), format!("time_s,temperature_c,counts\n{commas}")).unwrap();
    let (plain, silent) = survey(at, "plain.csv");
    assert!(silent.lines().all(|line| !line.starts_with("plain.csv: ")), "{silent}");
    let forms: Vec<(&str, Vec<u8>, &str)> = vec![
        ("utf16-le.csv", utf16(&format!("{head}{semicolons}"), false), "text in UTF-16, little-endian"),
        ("utf16-be.csv", utf16(&format!("{head}{semicolons}"), true), "text in UTF-16, big-endian"),
        ("sep.csv", format!("sep=;\r\n{head}{semicolons}").into_bytes(), "names the separator: ;"),
        ("sep-bar.csv", format!("SEP=|\n{head}{semicolons}").replace(';', "|").into_bytes(), "names the separator: |"),
        (
            "preamble.csv",
            format!("Chamber 7; Nuremberg\nOperator;N. N.\n\nRun;3\n{head}{semicolons}").into_bytes(),
            "3 lines above the headers are not read",
        ),
        (
            "words.csv",
            format!("\"Chamber 7\";\"counts\"\nOperator;N. N.\n\n{head}{semicolons}").into_bytes(),
            "2 lines above the headers are not read",
        ),
        ("units.csv", format!("time,temperature,counts\ns,°C,-\n{commas}").into_bytes(), "one of units"),
        ("unit-of-one.csv", format!("time,temperature,counts\n[s],[°C],[1]\n{commas}").into_bytes(), "one of units"),
        (
            "brackets.csv",
            windows_1252(&format!("Time [s],Temperature (°C),Counts\n{commas}")),
            "read as Windows-1252. read as: Time [s] as time_s, Temperature (°C) as temperature_c",
        ),
        ("points.csv", format!("{head}{}", grouped('.')).into_bytes(), ""),
        ("spaces.csv", format!("{head}{}", grouped('\u{a0}')).into_bytes(), ""),
        (
            "dates.csv",
            format!(
                "time,temperature_c,counts\n{}",
                rows(|time, celsius, counts| format!("29.02.2024 {},{celsius:.2},{counts}", clock(time)))
            )
            .into_bytes(),
            "",
        ),
        (
            "excel.csv",
            format!(
                "time_excel,temperature_c,counts\n{}",
                rows(|time, celsius, counts| format!("{:.11},{celsius:.2},{counts}", 45351.5 + time as f64 / 86400.0))
            )
            .into_bytes(),
            "",
        ),
    ];
    for (name, bytes, assumed) in forms {
        fs::write(at.join(name), bytes).unwrap();
        let (found, said) = survey(at, name);
        let unwrapped = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(unwrapped.contains(assumed), "{name}: {said}");
        // A row that ends some microseconds late begins another window.
        let windows: &[&str] = if name == "excel.csv" { &[] } else { &["windows", "windows_used"] };
        for key in ["kind", "quantity", "rows"].iter().chain(windows) {
            assert_eq!(found[key], plain[key], "{name}: {key}");
        }
        for key in ["good_for", "cautions"] {
            assert_eq!(found["survey"][key], plain["survey"][key], "{name}: {key}");
        }
        // A spreadsheet's days are good to some microseconds, which moves the border of a window.
        let slope = |object: &Value| object["survey"]["axes"][0]["slope_dph_per_c"][0].as_f64().unwrap();
        let differ = (slope(&found) / slope(&plain) - 1.0).abs();
        assert!(differ <= if name == "excel.csv" { 0.01 } else { 0.0 }, "{name}: {differ}");
    }
}

/// What has two meanings is refused or read as it always was, never guessed.
#[test]
fn what_has_two_meanings_is_not_guessed() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let write = |name: &str, text: String| fs::write(at.join(name), text).unwrap();
    // The month or the day first.
    write(
        "dates.csv",
        format!("time,counts\n{}", rows(|time, _, counts| format!("03/04/2024 10:{:02}:00,{counts}", time % 60))),
    );
    // One group behind a point: thousands or decimals. Counts are whole, so it is refused.
    write(
        "points.csv",
        format!("time_s;counts\n{}", rows(|time, _, counts| format!("{time};{}.{:03}", counts / 1000, counts % 1000))),
    );
    // No line names counts: the first line is reported.
    write("none.csv", format!("Chamber 7\nfoo,bar\n{}", rows(|time, _, counts| format!("{time},{counts}"))));
    for (name, word) in [
        ("dates.csv", "unknown unit"),
        ("points.csv", "not a whole number of quanta"),
        ("none.csv", "none.csv:1: no column"),
    ] {
        let output = sagnac(at, &["inspect", name, "--arcsec-per-count", "1"]);
        assert!(output.status.code() == Some(2) && said(&output).contains(word), "{name}: {}", said(&output));
    }
    // A line of units that contradicts the headers, or is of units that are not known; a line of rubbish.
    let table = rows(|time, celsius, counts| format!("{time},{celsius:.2},{counts}"));
    for (head, word) in [
        ("time_s,temperature_c,counts\nms,C,-", ":2, `time_s`, value \"ms\": the header says `s`"),
        ("time_s,temperature_c,counts\ns,K,-", ":2, `temperature_c`, value \"K\": the header says `c`"),
        ("time_ns,temperature_c,counts\ns,C,-", ":2, `time_ns`, value \"s\": the header says `ns`"),
        ("time,temperature,counts\ns,F,-", ":2, `temperature`, value \"F\": unknown unit"),
        ("time,temperature,counts\ns,C,arcsec", ":2, `counts`, value \"arcsec\": unknown unit"),
        ("time_s,temperature_c,counts\nfoo,bar,baz", ":2: the line below the headers contains neither"),
    ] {
        write("units.csv", format!("{head}\n{table}"));
        let output = sagnac(at, &["inspect", "units.csv", "--arcsec-per-count", "1"]);
        assert!(output.status.code() == Some(2) && said(&output).contains(word), "{head}: {}", said(&output));
    }
    write(
        "missing.csv",
        format!(
            "time_s,temperature_c,counts\n1,-,NaN\n{}",
            rows(|time, c, counts| format!("{},{c:.2},{counts}", time + 1))
        ),
    );
    let output = sagnac(at, &["inspect", "missing.csv", "--arcsec-per-count", "1", "--json"]);
    assert!(!said(&output).contains("units"), "{}", said(&output));
    let object: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(object["rows"], Value::from(ROWS as u64 + 1));
}

/// Words for no value are as an empty cell: the last temperature is held, and a row without counts is excluded.
#[test]
fn words_for_no_value_are_empty_cells() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let with = |word: &str| {
        rows(|time, celsius, counts| match time % 50 {
            7 => format!("{time},{word},{counts}"),
            9 => format!("{time},{celsius:.2},{word}"),
            _ => format!("{time},{celsius:.2},{counts}"),
        })
    };
    let write = |name: &str, word: &str| {
        fs::write(at.join(name), format!("time_s,temperature_c,counts\n{}", with(word))).unwrap()
    };
    write("empty.csv", "");
    let (empty, _) = survey(at, "empty.csv");
    for word in ["-", "--", "NaN", "nan", "NA", "N/A", "#N/A", "NULL", "None", "#VALUE!"] {
        write("word.csv", word);
        assert_eq!(survey(at, "word.csv").0, empty, "{word}");
    }
}

/// A folder and a pattern stand for their logs, run-2 before run-10; the record is that of the logs named one by one.
#[test]
fn a_folder_and_a_pattern_stand_for_their_logs() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("runs")).unwrap();
    for run in 1..=11 {
        let begun = run * 100_000;
        let text = rows(|time, celsius, counts| format!("{},{celsius:.2},{}", begun + time, counts + run));
        fs::write(at.join(format!("runs/run-{run}.csv")), format!("time_s,temperature_c,counts\n{text}")).unwrap();
    }
    fs::write(at.join("runs/notes.txt"), "no log").unwrap();
    fs::write(at.join("runs/.hidden.csv"), "no log").unwrap();
    let flags = ["--arcsec-per-count", "1", "--model", "bias 1", "--serial", "A"];
    let calibrated = |logs: &[&str], out: &str| {
        let output = sagnac(at, &[&["calibrate"], logs, &flags[..], &["-o", out]].concat());
        assert!(output.status.success(), "{}", said(&output));
        (fs::read(at.join(out)).unwrap(), said(&output))
    };
    let names: Vec<String> = (1..=11).map(|run| format!("runs/run-{run}.csv")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let (one_by_one, _) = calibrated(&names, "a.json");
    let (of_folder, words) = calibrated(&["runs"], "b.json");
    assert!(words.contains("runs: 11 logs, run-1.csv … run-11.csv"), "{words}");
    assert!(of_folder == one_by_one);
    assert!(calibrated(&["runs/run-*.csv"], "c.json").0 == one_by_one);
    let output = sagnac(at, &["inspect", "runs", "--arcsec-per-count", "1"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("11 logs, 11 runs"), "{}", said(&output));
    // As for a single log: what is known without the size of a count is said.
    let output = sagnac(at, &["inspect", "runs"]);
    assert!(output.status.success(), "{}", said(&output));
    assert!(String::from_utf8_lossy(&output.stdout).contains("count size unknown"));
    fs::create_dir(at.join("none")).unwrap();
    for (argument, word) in [("none", "the folder contains no log"), ("runs/*.parquet", "no file matches this pattern")]
    {
        let output = sagnac(at, &["calibrate", argument, "--arcsec-per-count", "1"]);
        assert!(output.status.code() == Some(2) && said(&output).contains(word), "{}", said(&output));
    }
    // An output that is one of the folder's logs is refused before the work.
    let output = sagnac(at, &["calibrate", "runs", "--arcsec-per-count", "1", "-o", "runs/run-3.csv"]);
    assert!(said(&output).contains("the command reads this file"), "{}", said(&output));
}

/// `init` writes a setup from which `calibrate` makes of an odd log what it makes of the plain one.
#[test]
fn init_writes_a_setup_that_calibrate_runs_from() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let commas = rows(|time, celsius, counts| format!("{time},{celsius:.2},{counts}"));
    fs::write(at.join("plain.csv"), format!("time_s,temperature_c,counts\n{commas}")).unwrap();
    let record = |log: &str, setup: &[&str]| {
        let flags = ["--arcsec-per-count", "1", "--model", "bias 1", "--window", "20", "--serial", "A", "-o", "u.json"];
        let output = sagnac(at, &[&["calibrate", log][..], &flags, setup].concat());
        assert!(output.status.success(), "{log}: {}", said(&output));
        let record: Value = serde_json::from_slice(&fs::read(at.join("u.json")).unwrap()).unwrap();
        let axis = &record["axes"][0];
        [&axis["terms"][0]["value"], &axis["run_offsets"][0]["value_dph"]].map(|value| value.as_f64().unwrap())
    };
    let plain = record("plain.csv", &[]);
    let total = |time: usize| (0..time).map(|at| row(at).2).sum::<usize>();
    let odd: [(&str, String, &[&str]); 7] = [
        (
            "german.csv",
            format!(
                "\"Prüfstand 7\";\"Zähler 3\";\"counts\"\nBediener;N. N.;\n\nZeit [s];Temperatur [°C];Impulse\n{}",
                rows(|time, celsius, counts| format!("{time};{};{counts}", german(celsius)))
            ),
            &["\"Zeit [s]\" = \"time_s\"\n", "\"Impulse\" = \"counts\"   # GUESS: by its name"],
        ),
        (
            "units.csv",
            format!("t,Temp,Pulses\nms,K,-\n{}", rows(|t, c, n| format!("{},{:.2},{n}", 1000 * t, c + 273.15))),
            &["\"t\" = \"time_ms\"\n", "\"Temp\" = \"temperature_k\"\n"],
        ),
        (
            "bare.csv",
            format!("timestamp,temp,cnt\n{}", rows(|t, c, n| format!("{},{c:.2},{n}", 1_000_000 * t))),
            &["GUESS: the unit, from rows that are 1000000 apart", "\"temp\" = \"temperature_c\"   # GUESS: the unit"],
        ),
        (
            "total.csv",
            format!("time_s,temperature_c,pulse\n{}", rows(|t, c, _| format!("{t},{c:.2},{}", total(t)))),
            &["counter = \"cumulative\"   # GUESS", "# \"time_s\" is read as it is"],
        ),
        (
            "by-unit.csv",
            format!(
                "Messung Kammer 3; Prüfling 9\nZeit;Block;Kreisel X\ns;°C;Impulse\n{}",
                rows(|time, celsius, counts| format!("{time};{};{counts}", german(celsius)))
            ),
            &["\"temperature_c_block\"   # GUESS: by its unit, °C", "\"counts_x\"   # GUESS: by its unit, Impulse"],
        ),
        (
            "behind-blank.csv",
            format!(
                "Zeit s;Kammer °C;Channel C;Kreisel Impulse\n{}",
                rows(|time, celsius, counts| format!("{time};{};7;{counts}", german(celsius)))
            ),
            &["\"temperature_c_kammer\"   # GUESS: by its unit, °C", "\"Channel C\" = \"ignore\""],
        ),
        (
            "more.csv",
            format!("time_s,temperature_c,counts,\"a \"\"b\"\"\"\n{}", rows(|t, c, n| format!("{t},{c:.2},{n},7"))),
            &["\"a \\\"b\\\"\" = \"ignore\""],
        ),
    ];
    for (name, text, words) in odd {
        fs::write(at.join(name), text).unwrap();
        let output = sagnac(at, &["init", name, "-o", "bench.toml"]);
        assert!(output.status.success(), "{name}: {}", said(&output));
        let setup = fs::read_to_string(at.join("bench.toml")).unwrap();
        for word in words {
            assert!(setup.contains(word), "{name}: {word}\n{setup}");
        }
        for (found, plain) in record(name, &["--setup", "bench.toml"]).iter().zip(plain) {
            // A running total has no counts in its first row.
            assert!((found / plain - 1.0).abs() < 0.02, "{name}: {found} {plain}");
        }
    }
    // What Sagnac does not read is not mapped to something that it does; what is no table is refused.
    let hours = format!("Time [h],Temp [F],counts\n{}", rows(|t, c, n| format!("{t},{c},{n}")));
    fs::write(at.join("hours.csv"), hours).unwrap();
    let text = String::from_utf8_lossy(&sagnac(at, &["init", "hours.csv"]).stdout).into_owned();
    assert!(text.contains("\"Time [h]\" = \"ignore\"") && text.contains("\"Temp [F]\" = \"ignore\""), "{text}");
    assert!(text.contains("NEEDED: no column of time"), "{text}");
    for (name, bytes) in [("none.csv", "1,2,3\n4,5,6\n"), ("empty.csv", ""), ("words.csv", "a b c\nd e f\n")] {
        fs::write(at.join(name), bytes).unwrap();
        assert_eq!(sagnac(at, &["init", name]).status.code(), Some(2), "{name}");
    }
}

/// The chamber's log as columns with names of another bench, and times of their own type.
fn foreign_columns() -> RecordBatch {
    let packed = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/chamber/cycle-1.csv.gz")).unwrap();
    let mut text = String::new();
    MultiGzDecoder::new(packed.as_slice()).read_to_string(&mut text).unwrap();
    let cells = |place: usize| text.lines().skip(1).map(move |line| line.split(',').nth(place).unwrap());
    let ms = |cell: &str| 1000 * cell.parse::<i64>().unwrap();
    let columns: [(&str, ArrayRef); 5] = [
        ("Aufnahme", Arc::new(TimestampMillisecondArray::from_iter_values(cells(0).map(ms)))),
        ("Temperatur", Arc::new(Float32Array::from_iter_values(cells(1).map(|cell| cell.parse::<f32>().unwrap())))),
        ("Impulse", Arc::new(Int32Array::from_iter_values(cells(2).map(|cell| cell.parse::<i32>().unwrap())))),
        ("Ventil", Arc::new(BooleanArray::from_iter(cells(2).map(|_| Some(true))))),
        ("Kommentar", Arc::new(StringArray::from(vec!["ok"; cells(2).count()]))),
    ];
    RecordBatch::try_from_iter(columns).unwrap()
}

/// `init` of a log of columns: the names and the type of the time are in its schema; the setup gives the plain log's calibration.
#[test]
fn init_reads_the_schema_of_parquet_and_arrow() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let batch = foreign_columns();
    let file = |name: &str| fs::File::create(at.join(name)).unwrap();
    let mut parquet = ArrowWriter::try_new(file("log.parquet"), batch.schema(), None).unwrap();
    parquet.write(&batch).unwrap();
    parquet.close().unwrap();
    let mut arrow = FileWriter::try_new(file("log.arrow"), &batch.schema()).unwrap();
    // In small batches too.
    (0..batch.num_rows())
        .step_by(99)
        .for_each(|row| arrow.write(&batch.slice(row, 99.min(batch.num_rows() - row))).unwrap());
    arrow.finish().unwrap();
    let mut stream = StreamWriter::try_new(file("log.arrows"), &batch.schema()).unwrap();
    stream.write(&batch).unwrap();
    stream.finish().unwrap();
    let record = |log: &str, setup: &[&str]| {
        let flags = ["--arcsec-per-count", "0.15125", "--model", "bias 3, rate 0", "-o", "u.json"];
        let output = sagnac(at, &[&["calibrate", log][..], &flags, setup].concat());
        assert!(output.status.success(), "{log}: {}", said(&output));
        let record: Value = serde_json::from_slice(&fs::read(at.join("u.json")).unwrap()).unwrap();
        record["axes"].clone()
    };
    let plain =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/chamber/cycle-1.csv.gz").display().to_string();
    let plain = record(&plain, &[]);
    assert!(plain[0]["terms"].as_array().is_some_and(|terms| terms.len() == 4), "{plain}");
    for name in ["log.parquet", "log.arrow", "log.arrows"] {
        let output = sagnac(at, &["init", name, "-o", "bench.toml"]);
        assert!(output.status.success(), "{name}: {}", said(&output));
        let setup = fs::read_to_string(at.join("bench.toml")).unwrap();
        let mapped = setup.split_once("[columns]\n").unwrap().1;
        let wanted = "\"Aufnahme\" = \"time\"\n\
                      \"Temperatur\" = \"temperature_c\"   # GUESS: the unit, from values near -40 (first: -40)\n\
                      \"Impulse\" = \"counts\"   # GUESS: by its name (first: 144)\n\
                      \"Ventil\" = \"ignore\"   # not known; \"aux_name\" makes it an input (first: true)\n\
                      \"Kommentar\" = \"ignore\"   # not known; \"aux_name\" makes it an input (first: ok)\n";
        assert_eq!(mapped, wanted, "{name}");
        assert_eq!(record(name, &["--setup", "bench.toml"]), plain, "{name}");
    }
    // A damaged file is refused.
    let whole = fs::read(at.join("log.parquet")).unwrap();
    fs::write(at.join("cut.parquet"), &whole[..whole.len() / 2]).unwrap();
    assert_eq!(sagnac(at, &["init", "cut.parquet"]).status.code(), Some(2));
}

/// A second column of times does not make a setup that no log can be read by.
#[test]
fn init_maps_one_time_as_a_number() {
    let folder = TempDir::new().unwrap();
    let text = rows(|t, c, n| format!("{t},{},{c:.2},{n}", 1000 * t));
    fs::write(folder.path().join("two.csv"), format!("clock [s],elapsed [ms],temp [C],counts\n{text}")).unwrap();
    let made = sagnac(folder.path(), &["init", "two.csv", "-o", "bench.toml"]);
    assert!(made.status.success(), "{}", said(&made));
    let setup = fs::read_to_string(folder.path().join("bench.toml")).unwrap();
    assert!(
        setup.contains("\"clock [s]\" = \"time_s\"\n") && setup.contains("\"elapsed [ms]\" = \"ignore\""),
        "{setup}"
    );
    let read = sagnac(folder.path(), &["inspect", "two.csv", "--setup", "bench.toml", "--arcsec-per-count", "1"]);
    assert!(read.status.success(), "{}", said(&read));
}

/// Loggers end rows, or the headers, in a separator, and name no column of row numbers.
#[test]
fn empty_cells_at_the_ends_of_lines_are_no_columns() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let log = |head: &str, begin: &str, end: &str| {
        let rows = rows(|time, celsius, counts| format!("{begin}{time}\t{celsius:.2}\t{counts}{end}"));
        format!("{head}\n{rows}")
    };
    let headers = "time_s\ttemperature_c\tcounts";
    fs::write(at.join("plain.csv"), log(headers, "", "")).unwrap();
    let (plain, _) = survey(at, "plain.csv");
    let forms = [
        ("rows.csv", log(headers, "", "\t")),
        ("headers.csv", log(&format!("{headers}\t"), "", "")),
        ("both.csv", log(&format!("{headers}\t"), "", "\t")),
        ("two.csv", log(headers, "", "\t\t")),
        ("commas.csv", log(headers, "", "\t").replace('\t', ",")),
        ("comment.csv", log(&format!("{headers}\tcomment"), "", "\t")),
        ("number.csv", log(&format!("\t{headers}"), "7\t", "")),
        ("blank.csv", log(&format!("\t\t\t\n{headers}\tcomment"), "", "\t")),
    ];
    for (name, text) in forms {
        fs::write(at.join(name), text).unwrap();
        let (found, _) = survey(at, name);
        for key in ["kind", "quantity", "rows", "windows", "windows_used", "survey"] {
            assert_eq!(found[key], plain[key], "{name}: {key}");
        }
        let made = sagnac(at, &["init", name, "-o", "bench.toml"]);
        assert!(made.status.success(), "{name}: {}", said(&made));
        let read = sagnac(at, &["inspect", name, "--setup", "bench.toml", "--arcsec-per-count", "1"]);
        assert!(read.status.success(), "{name}: {}", said(&read));
        fs::remove_file(at.join("bench.toml")).unwrap();
    }
    // One row of another width is one row that is not read.
    let first = log(headers, "", "").replacen("\n", "\n0\t20.00\t1200\t\n", 1);
    fs::write(at.join("first.csv"), first).unwrap();
    assert_eq!(survey(at, "first.csv").0["windows"], plain["windows"]);
}

/// Units that Sagnac does not know map no column: the line of `init` says that the setup is not complete.
#[test]
fn init_counts_the_values_that_no_log_says() {
    let folder = TempDir::new().unwrap();
    let log = "Uhrzeit;Kammer [degF];Drehrate [grad/min]\n08:00:00;68,00;12,7\n08:00:10;68,00;12,8\n";
    fs::write(folder.path().join("log.csv"), log).unwrap();
    let init = sagnac(folder.path(), &["init", "log.csv", "-o", "bench.toml"]);
    let line = String::from_utf8_lossy(&init.stdout);
    assert_eq!(line.trim(), "wrote bench.toml: 0 guesses, 2 values to fill in: see NEEDED");
}

/// A time in minutes, rounded, does not give the length of a row.
#[test]
fn init_takes_no_time_in_minutes_for_one_in_seconds() {
    let folder = TempDir::new().unwrap();
    for header in ["Zeit_min", "Time (min)", "elapsed hours", "time_h"] {
        let text = rows(|t, c, n| format!("{:.4},{c:.2},{n}", t as f64 / 60.0));
        fs::write(folder.path().join("log.csv"), format!("{header},temp [C],counts\n{text}")).unwrap();
        let made = sagnac(folder.path(), &["init", "log.csv"]);
        let setup = String::from_utf8(made.stdout).unwrap();
        let line = setup.lines().find(|line| line.starts_with(&format!("\"{header}\" = "))).unwrap_or_default();
        assert!(line.contains("\"ignore\"") && line.contains("convert it to seconds"), "{header}: {setup}");
    }
}

/// Calibrates a log of counts that a function of the row makes, with some flags.
fn calibrated(folder: &Path, counts: impl Fn(usize) -> usize, flags: &[&str]) -> Output {
    let rows = rows(|time, celsius, _| format!("{time},{celsius},{}", counts(time)));
    fs::write(folder.join("log.csv"), format!("time_s,temperature_c,counts\n{rows}")).unwrap();
    let args = ["calibrate", "log.csv", "--arcsec-per-count", "1", "--model", "bias 1", "--window", "10"];
    sagnac(folder, &[&args[..], flags].concat())
}

/// A running total has a drift of thousands of °/h, taken for counts of each row. A setup that states what they are is believed.
#[test]
fn a_running_total_is_not_calibrated_as_counts_of_rows() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    // With noise, and of a slow gyro with many rows alike.
    let totals: [fn(usize) -> usize; 2] = [|row| 1200 * row + row * 7919 % 13, |row| row / 3 + 20];
    for total in totals {
        let refused = calibrated(at, total, &[]);
        assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
        assert!(said(&refused).contains("like a running total") && said(&refused).contains("--counter cumulative"));
        for counter in ["incremental", "cumulative"] {
            let stated = calibrated(at, total, &["--counter", counter]);
            assert!(stated.status.success(), "{counter}: {}", said(&stated));
        }
    }
    let init = sagnac(at, &["init", "log.csv"]);
    assert!(String::from_utf8_lossy(&init.stdout).contains("counter = \"cumulative\"   # GUESS"));
    // A stream ends before its rows are taken for corrected ones.
    let record = calibrated(at, |row| 1200 + row * 7919 % 13, &["--serial", "A", "-o", "a.cal.json"]);
    assert!(record.status.success(), "{}", said(&record));
    let endless: String = (1..5000).map(|row| format!("{row},20.0,{}\n", 1200 * row)).collect();
    let stream = Command::cargo_bin("sagnac")
        .unwrap()
        .current_dir(at)
        .args(["compensate", "a.cal.json"])
        .write_stdin(format!("time_s,temperature_c,counts\n{endless}"))
        .output()
        .unwrap();
    assert_eq!(stream.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&stream.stdout).lines().count() < 60 && said(&stream).contains("running total"));
}

/// Counts that never change hold neither drift nor noise.
#[test]
fn a_counter_that_stands_still_is_good_for_nothing() {
    let folder = TempDir::new().unwrap();
    let refused = calibrated(folder.path(), |_| 150, &[]);
    assert_eq!(refused.status.code(), Some(3), "{}", said(&refused));
    assert!(said(&refused).contains("constant in all 60 windows"), "{}", said(&refused));
    let inspected = sagnac(folder.path(), &["inspect", "log.csv", "--arcsec-per-count", "1"]);
    assert!(String::from_utf8_lossy(&inspected.stdout).contains("not usable"), "{inspected:?}");
}

/// Columns as recorders name them: a time with its unit behind one letter, rates by the letter of the axis, microseconds since a start-up years ago.
#[test]
fn init_knows_the_names_of_recorders() {
    let folder = TempDir::new().unwrap();
    let logs = [
        (
            "t_s,gx_dps,temperature_c\n0.01,0.003,20\n0.02,0.004,20\n0.03,0.002,21\n",
            ["\"t_s\" = \"time_s\"", "\"gx_dps\" = \"rate_dps_x\""],
        ),
        (
            "timestamp,rate_dph,temperature_c\n256551281491968,5,20\n256551281997314,6,21\n256551282502660,4,21\n",
            ["\"timestamp\" = \"time_us\"", "rate_dph"],
        ),
        (
            "t_s\tTemp [K]\tZähler x\tZähler y\n5\t300\t470\t199\n10\t301\t945\t395\n15\t302\t1419\t594\n20\t303\t1892\t792\n",
            ["\"Zähler x\" = \"counts_x\"", "counter = \"cumulative\"   # GUESS"],
        ),
    ];
    for (log, wanted) in logs {
        fs::write(folder.path().join("log.csv"), log).unwrap();
        let out = sagnac(folder.path(), &["init", "log.csv"]);
        let setup = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(wanted.iter().all(|line| setup.contains(line)), "{setup}");
    }
}

/// A triangle with soaks, 12 h of rows of 1 s whose temperature is read once a minute, ARW 0.003 °/√h. The drift is 0.4·u + 0.05·u², u = T/55.
fn minute_log() -> String {
    let drift_dph = |celsius: f64| 0.4 * celsius / 55.0 + 0.05 * (celsius / 55.0).powi(2);
    let at_s = |second: usize| {
        let phase = (second % 14_400) as f64 / 3600.0;
        if phase < 1.0 {
            -40.0
        } else if phase < 2.0 {
            -40.0 + 110.0 * (phase - 1.0)
        } else if phase < 3.0 {
            70.0
        } else {
            70.0 - 110.0 * (phase - 3.0)
        }
    };
    let (mut state, mut total, mut counted) = (7_u64, 0.0, 0.0);
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut text = String::from("time_s,temperature_c,counts\n");
    for second in 1..=43_200 {
        let normal = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let celsius = at_s(second);
        total += (4.5 + drift_dph(celsius) + 0.003 * 60.0 * normal) / 0.15125;
        let read = if second % 60 == 0 { format!("{celsius:.2}") } else { String::new() };
        text += &format!("{second},{read},{}\n", f64::floor(total) - counted);
        counted = f64::floor(total);
    }
    text
}

/// Such a log has no temperature in most rows, and says what to do; `init` does it.
#[test]
fn a_thermometer_that_is_read_once_a_minute_is_held_as_init_says() {
    let folder = TempDir::new().unwrap();
    let log = minute_log();
    fs::write(folder.path().join("slow.csv"), &log).unwrap();
    let count = ["--arcsec-per-count", "0.15125"];
    let refused = sagnac(folder.path(), &[&["calibrate", "slow.csv", "-o", "a.cal.json"], &count[..]].concat());
    assert_eq!(refused.status.code(), Some(3), "{}", said(&refused));
    assert!(said(&refused).contains("stale_after_s under [[thermometer]]"), "{}", said(&refused));
    let seen = sagnac(folder.path(), &[&["inspect", "slow.csv"], &count[..]].concat());
    assert!(String::from_utf8_lossy(&seen.stdout).replace("\n ", "").contains("stale_after_s"), "{seen:?}");

    assert!(sagnac(folder.path(), &["init", "slow.csv", "-o", "bench.toml"]).status.success());
    let setup = fs::read_to_string(folder.path().join("bench.toml")).unwrap();
    assert!(setup.contains("stale_after_s = 90   # GUESS: its readings are 60 s apart"), "{setup}");
    // A stretch without readings is not how often they come.
    let gap = log.lines().enumerate().map(|(at, line)| {
        let [time, _, counts] = line.split(',').collect::<Vec<_>>()[..] else { panic!("{line}") };
        if at == 0 {
            line.to_owned()
        } else {
            format!("{time},{},{counts}", if (200..700).contains(&at) { "" } else { "25" })
        }
    });
    fs::write(folder.path().join("gap.csv"), gap.collect::<Vec<_>>().join("\n")).unwrap();
    let of_gap = sagnac(folder.path(), &["init", "gap.csv"]);
    assert!(
        of_gap.status.success() && !String::from_utf8_lossy(&of_gap.stdout).contains("[[thermometer]]"),
        "{of_gap:?}"
    );
    let with_setup = [&["inspect", "slow.csv", "--setup", "bench.toml", "--json"], &count[..]].concat();
    let survey: Value = serde_json::from_slice(&sagnac(folder.path(), &with_setup).stdout).unwrap();
    assert_eq!(survey["survey"]["thermometers"][0]["reading_interval_s"], 60.0, "{survey}");
    assert!(survey["survey"]["cautions"].to_string().contains("one reading every 60 s"), "{survey}");
    let made = [&["calibrate", "slow.csv", "--setup", "bench.toml", "-o", "b.cal.json"], &count[..]].concat();
    assert!(sagnac(folder.path(), &made).status.success());
    let curve = sagnac(folder.path(), &["evaluate", "b.cal.json", "--at=-40,0,70", "--json"]);
    let curve: Value = serde_json::from_slice(&curve.stdout).unwrap();
    let points = curve["axes"][0]["points"].as_array().unwrap();
    let truth = [-40.0, 0.0, 70.0].map(|c: f64| {
        let of = |c: f64| 0.4 * c / 55.0 + 0.05 * (c / 55.0).powi(2);
        of(c) - of(25.0)
    });
    for (point, truth) in points.iter().zip(truth) {
        let [value, lower, upper] = ["drift_dph", "lower_dph", "upper_dph"].map(|key| point[key].as_f64().unwrap());
        assert!((value - truth).abs() < 0.01 && lower < truth && truth < upper, "{point} for {truth}");
    }
}

/// A log whose headers state quantity and unit needs no setup: the record is that of the setup that `init` writes.
#[test]
fn what_init_is_sure_of_is_read_at_once() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let heads = ["Time (ms),Chip temp [°C],Gyro X (deg/s)", "t_ms,temp_c,gx_dps"];
    for head in heads {
        let rate = |counts: usize| counts as f64 / 36_000.0;
        let log = format!(
            "{head}\n{}",
            rows(|time, celsius, counts| format!("{},{celsius:.2},{}", 1000 * time, rate(counts)))
        );
        fs::write(at.join("log.csv"), log).unwrap();
        let init = sagnac(at, &["init", "log.csv", "-o", "bench.toml"]).stdout;
        assert!(String::from_utf8_lossy(&init).contains(": 0 guesses"), "{head}");
        let terms = |setup: &[&str]| {
            let flags = ["calibrate", "log.csv", "--model", "bias 1", "--window", "20", "--json"];
            let output = sagnac(at, &[&flags[..], setup].concat());
            assert!(output.status.success(), "{head}: {}", said(&output));
            let record: Value = serde_json::from_slice(&output.stdout).unwrap();
            record["axes"][0]["terms"].clone()
        };
        assert_eq!(terms(&[]), terms(&["--setup", "bench.toml"]), "{head}");
        fs::remove_file(at.join("bench.toml")).unwrap();
    }
}
