//! `sagnac export` for every target, and `sagnac line read`.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use sagnac_board::frame::{Frame, FrameReader};
use sagnac_board::{CommandHandler, Commit, MemoryFlash, Message, Piece, RigSettings, Row, run};
use sagnac_core::{Banks, Description, Gyro, Image};
use sagnac_loops::LoopTable;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn paper() -> PathBuf {
    root().join("testdata/image/paper.img")
}

fn mirror() -> PathBuf {
    root().join("scenarios/triangle-28cm-dithered/triangle-28cm-dithered.toml")
}

fn sagnac(args: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("sagnac").unwrap().args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn c_and_verilog_are_whole_folders() {
    let folder = tempfile::tempdir().unwrap();
    let image = paper();
    for (to, files) in [
        (
            "c",
            &[
                "sagnac_compensator.c",
                "sagnac_intensity.h",
                "sagnac_banks.c",
                "sagnac_board.h",
                "sagnac_unit.c",
                "sagnac_unit.h",
                "sagnac_version.h",
                "Makefile",
                "README.md",
                "check/check_vectors.c",
                "vectors/stripper.hex",
            ][..],
        ),
        (
            "verilog",
            &[
                "sagnac_correction.v",
                "sagnac_axi4_lite.v",
                "sagnac_watch.v",
                "sagnac_vote.v",
                "tb_watch.v",
                "sagnac_image.hex",
                "sagnac_loops.hex",
                "tb_path_length.v",
            ],
        ),
    ] {
        let out = folder.path().join(to);
        let parts: &[&str] = if to == "c" { &["--with", "board,loops,banks,line"] } else { &[] };
        let mirror = mirror();
        let export = ["export", text(&image), "--to", to, "-o", text(&out), "--loops", text(&mirror)];
        let (status, _, said) = sagnac(&[&export[..], parts].concat());
        assert_eq!(status, 0, "{said}");
        for file in files {
            assert!(!fs::read_to_string(out.join(file)).unwrap().is_empty(), "{file}");
        }
    }
    let unit = fs::read_to_string(folder.path().join("c/sagnac_unit.c")).unwrap();
    // The worked example of docs/reference/image-format.md.
    assert!(unit.contains("PAPER-RIG") && unit.contains(".mantissa = 558484714, .shift = 33"), "{unit}");
}

/// The correction alone: files that say how large a count is, and a program that checks the unit on any compiler.
#[test]
fn the_default_export_states_its_counts_and_checks_its_unit() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("c");
    let (status, _, said) = sagnac(&["export", text(&paper()), "--to", "c", "-o", text(&out)]);
    assert_eq!(status, 0, "{said}");
    assert_eq!(fs::read_dir(&out).unwrap().count(), 12);
    let header = fs::read_to_string(out.join("sagnac_unit.h")).unwrap();
    // Quarters of 1.059 arcsec in ticks of 100 µs: 0.26475/3600/1e-4 = 0.735416… °/s. A rate of 1e-9 °/s is 3600·1e-9·1e-4/0.26475 counts.
    assert!(
        header.contains("1 is 0.26475 arcsec of angle")
            && header.contains("1 in each tick of 100 us is 0.735416666667 deg/s"),
        "{header}"
    );
    // An image does not show it; the calibration does.
    assert!(header.contains("only the calibration of this image shows whether it is taken out"), "{header}");
    let cycles = root().join("testdata/chamber");
    let [one, two, setup] = ["cycle-1.csv.gz", "cycle-2.csv.gz", "bench.toml"].map(|name| cycles.join(name));
    let record = folder.path().join("unit.cal.json");
    let given =
        ["calibrate", text(&one), text(&two), "--setup", text(&setup), "--model", "bias 3", "-o", text(&record)];
    for (more, words) in [(None, "The fixed bias stays in"), (Some("--remove-bias"), "takes the fixed bias out: ")] {
        let made = sagnac(&given.iter().copied().chain(more).collect::<Vec<_>>());
        assert_eq!(made.0, 0, "{}", made.2);
        let c = folder.path().join("calibrated");
        assert_eq!(sagnac(&["export", text(&record), "--to", "c", "-o", text(&c)]).0, 0);
        let header = fs::read_to_string(c.join("sagnac_unit.h")).unwrap();
        assert!(header.contains(words), "{header}");
    }
    let value = |name: &str| -> f64 {
        let line = header.lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("{header}"));
        line.split(['(', ')']).nth(1).unwrap().parse().unwrap()
    };
    let ratio = value("_ABOVE ") / value("_BELOW ");
    assert!((ratio / (3600.0 * 1e-9 * 1e-4 / 0.26475) - 1.0).abs() < 1e-12, "{header}");
    let check = || {
        let sources =
            ["sagnac_unit_check.c", "sagnac_unit.c", "sagnac_compensator.c", "sagnac_integer.c", "-o", "check"];
        let built = std::process::Command::new("cc")
            .args(["-std=c99", "-Wall", "-Werror"])
            .args(sources)
            .current_dir(&out)
            .status();
        assert!(built.unwrap().success());
        std::process::Command::new(out.join("check")).output().unwrap()
    };
    let ran = check();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stdout));
    // One constant of the unit changed: the check fails.
    let unit = fs::read_to_string(out.join("sagnac_unit.c")).unwrap();
    fs::write(out.join("sagnac_unit.c"), unit.replacen(".mantissa = 558484714", ".mantissa = 658484714", 1)).unwrap();
    assert!(!check().status.success());
}

#[test]
fn loops_and_uploads_are_what_the_target_reads() {
    let folder = tempfile::tempdir().unwrap();
    let (table, upload) = (folder.path().join("gyro.loops"), folder.path().join("unit.upload"));
    assert_eq!(sagnac(&["export", text(&mirror()), "--to", "loops", "-o", text(&table)]).0, 0);
    LoopTable::decode(&fs::read(&table).unwrap()).unwrap();
    assert_eq!(sagnac(&["export", text(&paper()), "--to", "upload", "-o", text(&upload)]).0, 0);
    let mut reader = FrameReader::new();
    let bytes = fs::read(&upload).unwrap();
    let messages: Vec<Message> =
        bytes.iter().filter_map(|byte| reader.push(*byte)).map(|frame| Message::parse(&frame).unwrap()).collect();
    let mut image = Vec::new();
    for message in &messages {
        match message {
            Message::Piece(Piece { len, bytes, .. }) => image.extend_from_slice(&bytes[..usize::from(*len)]),
            Message::Commit(Commit { len, trial }) => assert_eq!((usize::from(*len), *trial), (image.len(), false)),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(image, fs::read(paper()).unwrap());
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let path = paper();
    for (args, expected) in [
        (&["--to", "verilog", "--trial"][..], "--trial"),
        (&["--to", "image", "--sequence", "3"][..], "--sequence"),
        (&["--to", "loops"][..], "UTF-8"),
    ] {
        let all = [&["export", text(&path)], args, &["-o", text(&out)]].concat();
        let (status, _, said) = sagnac(&all);
        assert!(status == 2 && said.contains(expected), "{args:?}: {status} {said}");
    }
}

/// The words of the hardware are the image's bytes, and its needs are stated.
#[test]
fn the_hardware_gets_the_bytes_of_the_image() {
    let folder = tempfile::tempdir().unwrap();
    let image = fs::read(paper()).unwrap();
    assert_eq!(sagnac(&["export", text(&paper()), "--to", "verilog", "-o", text(folder.path())]).0, 0);
    let hex = fs::read_to_string(folder.path().join("sagnac_image.hex")).unwrap();
    assert!(hex.contains("Needs INPUTS 1, PIECES 0, HARMONICS 0, DERIVED 0, STEP_LIMITS 1 or more."), "{hex}");
    let lines = hex.lines().filter(|line| !line.starts_with("//"));
    let words = lines.flat_map(|line| line.split(' ')).map(|word| u32::from_str_radix(word, 16).unwrap());
    assert_eq!(words.flat_map(u32::to_le_bytes).collect::<Vec<u8>>(), image);
}

/// Every byte of the image is in one row of the sheet, and the target's own arithmetic is far below the interval.
#[test]
fn the_data_sheet_has_every_byte_and_the_error_budget() {
    let folder = tempfile::tempdir().unwrap();
    let (image, sheet) = (folder.path().join("unit.img"), folder.path().join("unit.md"));
    let record = folder.path().join("unit.cal.json");
    let text_of = fs::read_to_string(root().join("testdata/found/log-7120/unit.cal.json")).unwrap();
    let calibration: serde_json::Value = serde_json::from_str(&text_of).unwrap();
    let serial = calibration["serial"].as_str().unwrap();
    fs::write(&record, text_of.replace(&format!("\"{serial}\""), "\"A|B<i>`\"")).unwrap();
    for (to, out) in [("image", &image), ("data-sheet", &sheet)] {
        let (status, _, said) = sagnac(&["export", text(&record), "--to", to, "-o", text(out), "--sequence", "7"]);
        assert_eq!(status, 0, "{said}");
    }
    let (bytes, sheet) = (fs::read(&image).unwrap(), fs::read_to_string(&sheet).unwrap());
    let (fields, budget) = sheet.split_once("## Error budget").unwrap();
    assert!(fields.contains("of gyro A\\|B&lt;i>\\`, axis"), "{fields}");
    let mut next = 0;
    for row in fields.lines().filter(|line| line.starts_with("| ") && line.ends_with(" |")) {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").map(str::trim).collect();
        let Ok(offset) = cells[0].parse::<usize>() else { continue };
        assert_eq!(offset, next, "{row}");
        let (kind, size) = cells[1].split_at(1);
        if let ("u" | "i", Ok(bits)) = (kind, size.parse::<usize>()) {
            let value = cells[3].parse::<i128>().unwrap().to_le_bytes();
            assert_eq!(bytes[offset..offset + bits / 8], value[..bits / 8], "{row}");
            next += bits / 8;
        } else {
            let len: usize = cells[1].strip_suffix(" bytes").unwrap().parse().unwrap();
            let (hex, here) = (cells[3], &bytes[offset..offset + len]);
            let shown: String = here.iter().map(|byte| format!("{byte:02x}")).collect();
            let read = String::from_utf8_lossy(here).trim_end_matches('\0').to_owned();
            let escaped = read.replace('|', "\\|").replace('<', "&lt;").replace('`', "\\`");
            assert!(hex == shown || hex == escaped, "{row}");
            next += len;
        }
    }
    assert_eq!(next, bytes.len());
    let rows: Vec<Vec<f64>> = budget
        .lines()
        .filter_map(|line| line.trim_matches('|').split(" | ").map(|cell| cell.trim().parse().ok()).collect())
        .collect();
    assert_eq!(rows.len(), 13, "{budget}");
    for row in rows {
        assert!(row[2] > 0.0 && row[3].abs() < 1e-6, "{row:?}");
    }
    let (status, _, said) =
        sagnac(&["export", text(&image), "--to", "data-sheet", "-o", text(&folder.path().join("x.md"))]);
    assert!(status == 2 && said.contains("a data sheet needs a calibration"), "{status} {said}");
}

/// What is read is never written over: a capture, a log, an image, a calibration.
#[test]
fn inputs_stay_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let cycle = folder.path().join("cycle-1.csv.gz");
    fs::copy(root().join("testdata/chamber/cycle-1.csv.gz"), &cycle).unwrap();
    let image = folder.path().join("unit.img");
    fs::copy(paper(), &image).unwrap();
    let line = folder.path().join("line.bin");
    fs::write(&line, captured()).unwrap();
    let bench = root().join("testdata/chamber/bench.toml");
    for (file, args) in [
        (&cycle, vec!["calibrate", text(&cycle), "--setup", text(&bench), "-o", text(&cycle)]),
        (&cycle, vec!["inspect", text(&cycle), "--setup", text(&bench), "--windows", text(&cycle)]),
        (&image, vec!["export", text(&image), "--to", "upload", "-o", text(&image)]),
        (&line, vec!["line", "read", text(&line), "-o", text(&line)]),
    ] {
        let before = fs::read(file).unwrap();
        let (status, _, said) = sagnac(&args);
        assert!(
            status == 2 && (said.contains("write to another") || said.contains("no .gz is written")),
            "{args:?}: {said}"
        );
        assert_eq!(fs::read(file).unwrap(), before, "{args:?}");
    }
    // And a capture without a frame leaves an older table alone.
    let csv = folder.path().join("frames.csv");
    fs::write(&csv, "precious").unwrap();
    assert_eq!(sagnac(&["line", "read", text(&image), "-o", text(&csv)]).0, 2);
    assert_eq!(fs::read(&csv).unwrap(), b"precious");
}

/// A board's line, as bytes.
fn captured() -> Vec<u8> {
    let image = Image::decode(&fs::read(paper()).unwrap()).unwrap();
    let loops = {
        let folder = tempfile::tempdir().unwrap();
        let table = folder.path().join("gyro.loops");
        sagnac(&["export", text(&mirror()), "--to", "loops", "-o", text(&table)]);
        LoopTable::decode(&fs::read(&table).unwrap()).unwrap()
    };
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).unwrap();
    let settings = RigSettings { wavelength: 100_000, ..RigSettings::default() };
    let row = Row { ticks: 2000, counts: 40, present: 1, codes: [20 << 24, 0, 0, 0] };
    let mut input = Vec::new();
    for message in [Message::Settings(settings), Message::Row(row), Message::RollBack, Message::Row(row)] {
        let (bytes, len) = message.frame().unwrap().bytes();
        input.extend_from_slice(&bytes[..len]);
    }
    let mut out = Vec::new();
    run(&mut CommandHandler::new(banks, Gyro::of(&image, 4), loops), input.into_iter(), |bytes| {
        out.extend_from_slice(bytes)
    });
    out
}

#[test]
fn frames_become_rows_and_damage_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (line, csv) = (folder.path().join("line.bin"), folder.path().join("frames.csv"));
    let mut bytes = captured();
    fs::write(&line, &bytes).unwrap();
    let (status, _, said) = sagnac(&["line", "read", text(&line), "-o", text(&csv)]);
    assert_eq!(status, 0, "{said}");
    assert!(
        said.contains("40 output frames, 0 missing") && said.contains("roll back: refused: no older image"),
        "{said}"
    );
    let rows = fs::read_to_string(&csv).unwrap();
    assert_eq!(rows.lines().count(), 41);
    let counts: i32 = rows.lines().skip(1).map(|row| row.split(',').nth(3).unwrap().parse::<i32>().unwrap()).sum();
    assert_eq!(counts, 80);
    assert!(rows.lines().nth(1).unwrap().contains(",UNCORRECTED,"), "no bank holds an image");
    // A byte of the tenth output is damaged, the twentieth output is missing.
    let outputs: Vec<usize> =
        (0..bytes.len() - 4).filter(|at| bytes[*at..].starts_with(b"SG") && bytes[*at + 2] & 0x3f == 1).collect();
    bytes[outputs[9] + 20] ^= 0x10;
    bytes.drain(outputs[19]..outputs[20]);
    fs::write(&line, &bytes).unwrap();
    let (status, out, said) = sagnac(&["line", "read", text(&line)]);
    assert_eq!((status, out.lines().count()), (0, 39), "{said}");
    assert!(said.contains("38 output frames, 2 missing") && said.contains("59 bytes belong to no frame"), "{said}");
}

/// The clock continues past its 32 bits, a restart is reported, and bits without a name are shown.
#[test]
fn odd_frames_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let line = folder.path().join("line.bin");
    let mut bytes = Vec::new();
    for (sequence, tick) in [(7, u32::MAX - 49), (8, 50), (9, 150), (3, 100), (4, 200)] {
        let status = sagnac_core::Status::from_bits(0x8001);
        let output = sagnac_board::OutputFrame {
            sequence,
            tick,
            status,
            light_status: 0x24,
            tick_ns: 100_000,
            ..Default::default()
        };
        let (frame, len) = Message::Output(output).frame().unwrap().bytes();
        bytes.extend_from_slice(&frame[..len]);
    }
    fs::write(&line, bytes).unwrap();
    let (status, out, said) = sagnac(&["line", "read", text(&line)]);
    assert_eq!(status, 0);
    assert!(said.contains("5 output frames, 0 missing") && said.contains("1 times count or clock jump"), "{said}");
    let rows: Vec<&str> = out.lines().skip(1).collect();
    assert!(rows[1].starts_with("8,4294967346,429496.734600,") && rows[3].starts_with("3,100,0.010000,"), "{out}");
    assert!(rows[0].contains(",OUT_OF_SPAN+0x8000,OK,IGNITING+0x20,"), "{out}");
}

#[test]
fn what_is_no_line_is_refused() {
    let (status, _, said) = sagnac(&["line", "read", text(&paper())]);
    assert!(status == 2 && said.contains("no frame of a gyro"), "{status} {said}");
    let frame = Frame::new(0x37, &[1, 2, 3]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let line = folder.path().join("line.bin");
    let (bytes, len) = frame.bytes();
    fs::write(&line, &bytes[..len]).unwrap();
    assert_eq!(sagnac(&["line", "read", text(&line)]).0, 2);
}

/// Three calibrations, each of one axis, in one export: every image has its name, and an axis comes once.
#[test]
fn three_axes_are_one_export() {
    let folder = tempfile::tempdir().unwrap();
    let image = Image::decode(&fs::read(paper()).unwrap()).unwrap();
    let axis = |letter: u8| {
        let of_axis = Image::new(Description { axis: letter, ..*image.description() }).unwrap();
        let path = folder.path().join(format!("{}.img", char::from(letter)));
        fs::write(&path, sagnac::export::image_bytes(&of_axis)).unwrap();
        path
    };
    let [x, y, z] = [b'x', b'y', b'z'].map(axis);
    let out = folder.path().join("c");
    let (status, _, said) = sagnac(&["export", text(&x), text(&y), text(&z), "--to", "c", "-o", text(&out)]);
    assert_eq!(status, 0, "{said}");
    let header = fs::read_to_string(out.join("sagnac_unit.h")).unwrap();
    assert!(
        header.contains("#define SAGNAC_UNIT_AXES 3U")
            && header.contains("{&sagnac_image_x, &sagnac_image_y, &sagnac_image_z}"),
        "{header}"
    );
    let (status, _, said) = sagnac(&["export", text(&x), text(&x), "--to", "c", "-o", text(&out)]);
    assert!(status == 2 && said.contains("another input has this axis"), "{said}");
    // One letter in two cases has one name in C and one address on the line.
    let capital = axis(b'Z');
    let (status, _, said) = sagnac(&["export", text(&z), text(&capital), "--to", "c", "-o", text(&out)]);
    assert!(status == 2 && said.contains("another input has this axis"), "{said}");
    // Uploads: a file each, and each frame is for its axis.
    let up = folder.path().join("unit.up");
    assert_eq!(sagnac(&["export", text(&x), text(&z), "--to", "upload", "-o", text(&up)]).0, 0);
    for (letter, code) in [("x", 1), ("z", 3)] {
        let bytes = fs::read(folder.path().join(format!("unit-{letter}.up"))).unwrap();
        let mut reader = FrameReader::new();
        let frames: Vec<Frame> = bytes.iter().filter_map(|byte| reader.push(*byte)).collect();
        assert!(frames.len() > 2 && frames.iter().all(|frame| frame.axis == code), "{letter}");
    }
}

/// A message for an axis without an address would be one for every gyro; an answer needs no output file.
#[test]
fn a_message_names_an_axis_that_has_an_address() {
    let (status, _, said) = sagnac(&["line", "send", "roll-back", "--axis", "q"]);
    assert!(status == 2 && said.contains("x, y and z alone"), "{said}");
    let folder = tempfile::tempdir().unwrap();
    let key = folder.path().join("unit.key");
    assert_eq!(sagnac(&["key", "new", "-o", text(&key)]).0, 0);
    let challenge = "1b".repeat(16);
    let args = ["--challenge", &challenge, "--key", text(&key), "--serial", "RLG-0001"];
    let (status, _, said) = sagnac(&[&["line", "send", "answer", "commit"], &args[..], &["--axis", "z"]].concat());
    assert_eq!(status, 0, "{said}");
    let (status, _, said) = sagnac(&[&["line", "send", "answer", "commit"], &args[..]].concat());
    assert!(status == 2 && said.contains("an answer is for one axis"), "{said}");
}
