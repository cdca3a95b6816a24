//! Nothing that a command reads, or writes in the same run, is overwritten: by any spelling, link or derived name.

use std::fs;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use assert_cmd::Command;
use flate2::read::MultiGzDecoder;
use tempfile::TempDir;

/// A folder with a log, a setup, limits, a calibration of it and its image.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let it = Self { folder: tempfile::tempdir().unwrap() };
        let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/paper");
        for name in ["paper.toml", "bench.toml"] {
            fs::copy(scenario.join(name), it.path(name)).unwrap();
        }
        fs::write(it.path("limits.toml"), "[limits]\nbias_1sigma_dph_max = 1.0\n").unwrap();
        assert_eq!(it.run("simulate paper.toml -o log.csv").0, 0);
        let (status, said) = it.run("calibrate log.csv --setup bench.toml --model |bias 2| -o unit.cal.json");
        assert_eq!(status, 0, "{said}");
        assert_eq!(it.run("export unit.cal.json --to image -o unit.img").0, 0);
        it
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Exit status and standard error. An argument with spaces stands between bars.
    fn run(&self, line: &str) -> (i32, String) {
        let mut args = Vec::new();
        for (at, part) in line.split('|').enumerate() {
            if at % 2 == 1 {
                args.push(part);
            } else {
                args.extend(part.split_whitespace());
            }
        }
        let output = Command::cargo_bin("sagnac").unwrap().args(args).current_dir(self.folder.path()).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
    }

    /// Every file with its bytes.
    fn all(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let mut found: Vec<_> = fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.is_file())
            .map(|path| (path.clone(), fs::read(path).unwrap()))
            .collect();
        found.sort();
        found
    }
}

#[test]
fn inputs_and_outputs_are_kept_apart() {
    let it = Bench::new();
    let folder = it.folder.path();
    std::os::unix::fs::symlink("log.csv", folder.join("link.csv")).unwrap();
    fs::hard_link(folder.join("log.csv"), folder.join("hard.csv")).unwrap();
    fs::create_dir(folder.join("sub")).unwrap();
    // What an export of one axis of two, and of C sources, would be called.
    fs::copy(folder.join("unit.img"), folder.join("u-x.img")).unwrap();
    let before = it.all();
    let model = "--model |bias 2|";
    let cases = [
        format!("calibrate log.csv --setup bench.toml {model} -o bench.toml"),
        format!("calibrate log.csv --setup bench.toml {model} -o log.csv"),
        format!("calibrate log.csv --setup bench.toml {model} -o sub/../log.csv"),
        format!("calibrate log.csv --setup bench.toml {model} -o link.csv"),
        format!("calibrate log.csv --setup bench.toml {model} -o hard.csv"),
        format!("calibrate log.csv --setup bench.toml {model} --report bench.toml"),
        format!("calibrate log.csv --setup bench.toml {model} -o new.json --report new.json"),
        format!("calibrate log.csv --setup bench.toml {model} -o new.json --report sub/../new.json"),
        "verify unit.cal.json log.csv --limits limits.toml --report limits.toml".to_owned(),
        "verify unit.cal.json log.csv --setup bench.toml --report bench.toml".to_owned(),
        "verify unit.cal.json log.csv --report unit.cal.json".to_owned(),
        "compare unit.cal.json unit.cal.json --limits limits.toml --report limits.toml".to_owned(),
        "compensate unit.cal.json log.csv -o unit.cal.json".to_owned(),
        "compensate unit.cal.json log.csv --setup bench.toml -o bench.toml".to_owned(),
        "inspect log.csv --setup bench.toml --windows bench.toml".to_owned(),
        "allan log.csv --setup bench.toml -o bench.toml".to_owned(),
        "allan log.csv --setup bench.toml -o new.csv --report new.csv".to_owned(),
        "evaluate unit.cal.json --at 20,25 -o unit.cal.json".to_owned(),
        "export unit.cal.json --to image -o unit.cal.json".to_owned(),
        "export unit.img --to upload -o hard-of-nothing/../unit.img".to_owned(),
        "export paper.toml --to loops -o paper.toml".to_owned(),
        "simulate paper.toml -o paper.toml".to_owned(),
        "simulate paper.toml -o new.csv --truth new.csv".to_owned(),
    ];
    for case in cases {
        let (status, said) = it.run(&case);
        assert_eq!(status, 2, "{case}: {said}");
        assert_eq!(it.all(), before, "{case}: {said}");
        let named = said.contains("the command reads this file")
            || said.contains("two outputs have this name")
            || said.contains("does not exist");
        assert!(named || said.contains("no .csv is written"), "{case}: {said}");
    }
}

/// Derived names: the C sources of a folder, and an image of one axis.
#[test]
fn derived_names_are_compared_too() {
    let it = Bench::new();
    let folder = it.folder.path();
    fs::create_dir(folder.join("c")).unwrap();
    for name in ["sagnac_unit.c", "sagnac_unit.h"] {
        let input = folder.join("c").join(name);
        fs::copy(folder.join("unit.img"), &input).unwrap();
        let (status, said) = it.run(&format!("export c/{name} --to c -o c"));
        assert!(status == 2 && said.contains("the command reads this file"), "{said}");
        assert_eq!(fs::read(&input).unwrap(), fs::read(folder.join("unit.img")).unwrap());
    }
}

/// A folder with a project of its own in it: its Makefile and README stay. Those of an export are replaced by the next one.
#[test]
fn an_export_replaces_no_makefile_of_another() {
    let it = Bench::new();
    let folder = it.folder.path();
    fs::create_dir(folder.join("project")).unwrap();
    for name in ["Makefile", "README.md"] {
        let own = folder.join("project").join(name);
        fs::write(&own, "all:\n").unwrap();
        let (status, said) = it.run("export unit.img --to c --with board,loops,banks,line -o project");
        assert!(status == 2 && said.contains(name) && said.contains("an empty folder"), "{said}");
        assert_eq!(fs::read_to_string(&own).unwrap(), "all:\n");
        assert!(!folder.join("project/sagnac_unit.c").exists(), "nothing is written");
        fs::remove_file(own).unwrap();
    }
    for _ in 0..2 {
        let (status, said) = it.run("export unit.img --to c --with board,loops,banks,line -o project");
        assert_eq!(status, 0, "{said}");
    }
}

/// The shell appends to a file: what is there stays, whatever name the standard output has.
#[test]
fn an_appended_file_keeps_what_it_has() {
    let it = Bench::new();
    for name in ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"] {
        let all = it.path("all.csv");
        fs::write(&all, "kept\n").unwrap();
        let out = fs::OpenOptions::new().append(true).open(&all).unwrap();
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("sagnac"));
        let args = ["compensate", "unit.cal.json", "log.csv", "-o", name];
        assert!(command.args(args).current_dir(it.folder.path()).stdout(out).status().unwrap().success());
        let text = fs::read_to_string(&all).unwrap();
        assert!(text.starts_with("kept\n") && text.lines().count() > 100, "{name}: {}", text.lines().count());
    }
}

/// A new file has the permissions of the umask; one that is replaced keeps its own.
#[test]
fn permissions_are_those_of_the_user() {
    use std::os::unix::fs::PermissionsExt;
    let it = Bench::new();
    let mode = |name: &str| fs::metadata(it.path(name)).unwrap().permissions().mode() & 0o777;
    let program = assert_cmd::cargo::cargo_bin!("sagnac");
    let shell = |umask: &str, out: &str| {
        let line = format!("umask {umask}; exec {} export unit.cal.json --to image -o {out}", program.display());
        assert!(
            std::process::Command::new("sh")
                .args(["-c", &line])
                .current_dir(it.folder.path())
                .status()
                .unwrap()
                .success()
        );
    };
    shell("077", "private.img");
    shell("027", "group.img");
    assert_eq!((mode("private.img"), mode("group.img")), (0o600, 0o640));
    shell("022", "private.img");
    assert_eq!(mode("private.img"), 0o600, "an existing file stays private");
    fs::set_permissions(it.path("group.img"), fs::Permissions::from_mode(0o664)).unwrap();
    shell("077", "group.img");
    assert_eq!(mode("group.img"), 0o664);
}

/// A file beyond the limit of sizes: an error that names it, the old file as it was, and no temporary one.
#[test]
fn a_limit_of_file_sizes_leaves_nothing_behind() {
    let it = Bench::new();
    fs::write(it.path("out.csv"), "before").unwrap();
    let before = it.all();
    // Blocks of 512 bytes or of a kilobyte, by the shell.
    let line = format!(
        "ulimit -f 8; exec {} simulate paper.toml -o out.csv",
        assert_cmd::cargo::cargo_bin!("sagnac").display()
    );
    let output = std::process::Command::new("sh").args(["-c", &line]).current_dir(it.folder.path()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(2) && said.contains("out.csv") && said.contains("too large"),
        "{:?} {said}",
        output.status
    );
    assert_eq!(it.all(), before);
    assert_eq!(fs::read_dir(it.folder.path()).unwrap().count(), before.len());
}

/// An output that cannot be written is reported before anything is read: the log of each command is rubbish, which would be reported else.
#[test]
fn outputs_are_tried_before_the_work() {
    let it = Bench::new();
    fs::write(it.path("rubbish.csv"), "no log at all\n").unwrap();
    fs::write(it.path("a-file"), "").unwrap();
    for line in [
        "calibrate rubbish.csv -o nowhere/unit.cal.json",
        "calibrate rubbish.csv --report nowhere/unit.html",
        "calibrate rubbish.csv --figures a-file",
        "calibrate rubbish.csv --figures a-file/below",
        "verify unit.cal.json rubbish.csv --report nowhere/proof.html",
        "compare rubbish.csv rubbish.csv --report nowhere/change.html",
        "compensate rubbish.csv rubbish.csv -o nowhere/out.csv",
        "inspect rubbish.csv --windows nowhere/w.parquet",
        "allan rubbish.csv -o nowhere/curve.csv",
        "inspect rubbish.csv --report nowhere/log.html",
        "simulate rubbish.csv -o nowhere/log.csv",
        "simulate rubbish.csv --truth nowhere/truth.csv",
        "simulate --paper --report nowhere/paper.html",
        "calibrate rubbish.csv -o .",
    ] {
        let (status, said) = it.run(line);
        assert_eq!(status, 2, "{line}: {said}");
        let about_output = ["nowhere", "a-file", "a folder", "Not a directory"];
        assert!(about_output.iter().any(|word| said.contains(word)) && !said.contains("rubbish"), "{line}: {said}");
    }
}

#[test]
fn a_report_is_html_and_its_figures_are_svg() {
    let it = Bench::new();
    for (name, word) in [
        ("unit.pdf", "--print-to-pdf=unit.pdf unit.html"),
        ("unit.svg", "--figures FOLDER"),
        ("unit.PNG", "--figures FOLDER"),
        ("unit.docx", "unit.html"),
        ("unit", "unit.html"),
        ("other.csv", "other.html"),
    ] {
        let (status, said) = it.run(&format!("inspect log.csv --setup bench.toml --report {name}"));
        assert!(status == 2 && said.contains(word), "{name}: {said}");
    }
    let line = "verify unit.cal.json log.csv --report proof.HTML --figures new/folder";
    let (status, said) = it.run(line);
    assert_eq!(status, 0, "{said}");
    let page = fs::read_to_string(it.path("proof.HTML")).unwrap();
    let figures = |folder: &str| -> Vec<(String, String)> {
        let mut all: Vec<(String, String)> = fs::read_dir(it.path(folder))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read_to_string(path).unwrap()))
            .collect();
        all.sort();
        all
    };
    let all = figures("new/folder");
    assert!(all.len() >= 3 && all.len() == page.matches("<figure>").count(), "{}", all.len());
    for (name, svg) in &all {
        assert!(name.ends_with(".svg") && svg.starts_with("<svg width=\"860\" height=\"350\""), "{name}");
        assert!(svg.contains("xmlns=\"http://www.w3.org/2000/svg\"") && svg.ends_with("</svg>"), "{name}");
    }
    it.run("verify unit.cal.json log.csv --figures again");
    assert_eq!(figures("again"), all);
}

/// A figure's name is that of an input, or of the record: the folder is refused before the work.
#[test]
fn figures_replace_no_file_of_the_command() {
    let it = Bench::new();
    fs::copy(it.path("log.csv"), it.path("temperature.svg")).unwrap();
    let before = it.all();
    for line in [
        "inspect temperature.svg --setup bench.toml --figures .",
        "calibrate log.csv --setup bench.toml --model |bias 2| -o drift-z.svg --figures .",
        "calibrate temperature.svg --setup bench.toml --model |bias 2| -o other.cal.json --figures ./",
    ] {
        let (status, said) = it.run(line);
        assert!(status == 2 && said.contains("a figure may get the name"), "{line}: {status} {said}");
        assert_eq!(it.all(), before, "{line}");
    }
    // A link among the figures, to the log or to the record that is to be.
    fs::create_dir(it.path("linked")).unwrap();
    for (target, name) in [("../log.csv", "coverage.svg"), ("../new.cal.json", "drift-z.svg")] {
        std::os::unix::fs::symlink(target, it.path("linked").join(name)).unwrap();
        for line in [
            "inspect log.csv --setup bench.toml --figures linked",
            "calibrate log.csv --setup bench.toml --model |bias 2| -o new.cal.json --figures linked",
        ] {
            let (status, said) = it.run(line);
            assert!(status == 2 && said.contains("this is a link"), "{line}: {status} {said}");
            assert_eq!(it.all(), before, "{line}");
        }
        fs::remove_file(it.path("linked").join(name)).unwrap();
    }
    assert_eq!(it.run("inspect log.csv --setup bench.toml --figures figures").0, 0);
}

/// A fleet's own files are named like its logs, its manifest or its setup: refused, and all of them stand.
#[test]
fn a_fleet_replaces_none_of_its_inputs() {
    let it = Bench::new();
    let folder = it.path("fl/units");
    fs::create_dir_all(&folder).unwrap();
    fs::copy(it.path("log.csv"), it.path("fleet.parquet")).unwrap();
    fs::write(it.path("m.csv"), "unit,run\nA,fleet.parquet\n").unwrap();
    fs::write(folder.join("A.json"), "unit,run\nA,../../log.csv\n").unwrap();
    fs::copy(it.path("bench.toml"), folder.join("B.json")).unwrap();
    fs::write(it.path("m2.csv"), "unit,run\nB,log.csv\n").unwrap();
    let (before, in_folder) =
        (it.all(), [fs::read(folder.join("A.json")), fs::read(folder.join("B.json"))].map(Result::unwrap));
    for line in [
        "fleet calibrate m.csv --setup bench.toml --model |bias 2| -o .",
        "fleet calibrate fl/units/A.json --setup bench.toml --model |bias 2| -o fl",
        "fleet calibrate m2.csv --setup fl/units/B.json --model |bias 2| -o fl",
        "fleet calibrate m2.csv --setup bench.toml --limits fl/units/B.json --model |bias 2| -o fl",
    ] {
        let (status, said) = it.run(line);
        assert!(status == 2 && said.contains("the command reads this file"), "{line}: {status} {said}");
        assert_eq!(it.all(), before, "{line}");
        let now = [fs::read(folder.join("A.json")), fs::read(folder.join("B.json"))].map(Result::unwrap);
        assert_eq!(now, in_folder, "{line}");
    }
}

/// A pattern over names that are no text reads them; one over several folders finds each.
#[test]
#[cfg(target_os = "linux")]
fn a_pattern_reads_names_that_are_no_text() {
    use std::os::unix::ffi::OsStrExt;
    let it = Bench::new();
    fs::create_dir_all(it.path("runs/first/below")).unwrap();
    let latin = std::ffi::OsStr::from_bytes(b"Pr\xfcfung.csv");
    fs::copy(it.path("log.csv"), it.path("runs").join(latin)).unwrap();
    assert_eq!(it.run("simulate paper.toml --seed 9 -o runs/first/below/run.csv").0, 0);
    for (line, found) in [
        ("inspect runs/*.csv --setup bench.toml", "1 log"),
        ("inspect runs/Pr?fung.csv --setup bench.toml", "1 log"),
        ("inspect runs/**/*.csv --setup bench.toml", "2 logs"),
        ("inspect ru*/f*/below/[r]un.csv --setup bench.toml", "1 log"),
        ("inspect ru*/f*/below/[^a]un.csv --setup bench.toml", "1 log"),
    ] {
        let (status, said) = it.run(line);
        assert!(status == 0 && said.contains(found), "{line}: {status} {said}");
    }
    assert_eq!(it.run("inspect runs/*.tsv --setup bench.toml").0, 2);
}

/// A key that the disk has no room for is not there, and its name is free.
#[test]
#[cfg(target_os = "linux")]
fn a_key_is_whole_or_not_there() {
    let it = Bench::new();
    let program = assert_cmd::cargo::cargo_bin("sagnac");
    let line = format!("ulimit -f 0; {} key new -o unit.key", program.display());
    let limited = std::process::Command::new("sh").args(["-c", &line]).current_dir(it.folder.path()).output().unwrap();
    assert!(!limited.status.success());
    assert!(!it.path("unit.key").exists() && !it.path("unit.pub").exists());
    assert_eq!(it.run("key new -o unit.key").0, 0);
}

/// Devices and pipes as the result of a unit, and a manifest without an end: refused or passed over, in bounded memory.
#[test]
#[cfg(target_os = "linux")]
fn devices_among_a_fleet_are_no_files() {
    let it = Bench::new();
    fs::write(it.path("m.csv"), "unit,run\nA,log.csv\n").unwrap();
    fs::create_dir_all(it.path("fl/units")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", it.path("fl/units/A.json")).unwrap();
    let setup = fs::read_to_string(it.path("bench.toml")).unwrap();
    let of_all: String =
        setup.lines().filter(|line| !line.starts_with("serial")).map(|line| format!("{line}\n")).collect();
    fs::write(it.path("all.toml"), of_all).unwrap();
    let (status, said) = it.run("fleet calibrate m.csv --setup all.toml --model |bias 2| -o fl");
    assert!(status == 2 && said.contains("has the name of a file to write"), "{status} {said}");
    let (status, said) = it.run("fleet calibrate /dev/zero --setup bench.toml -o fl2");
    assert!(status == 2 && said.contains("larger than"), "{status} {said}");
}

/// Two gigabytes of empty lines, and one of comments, in a few megabytes of gzip: read in seconds, or refused.
#[test]
fn gzip_of_nothing_is_bounded() {
    let it = Bench::new();
    for (name, line) in [("empty.csv.gz", &b"\n"[..]), ("notes.csv.gz", b"#\n")] {
        let mut packed =
            flate2::write::GzEncoder::new(fs::File::create(it.path(name)).unwrap(), flate2::Compression::best());
        std::io::Write::write_all(&mut packed, b"time_s,temperature_c,counts\n").unwrap();
        let block = line.repeat((1 << 20) / line.len());
        for _ in 0..600 {
            std::io::Write::write_all(&mut packed, &block).unwrap();
        }
        packed.finish().unwrap();
        let (status, said) = it.run(&format!("inspect {name} --setup bench.toml"));
        let named = ["unpacks to over 100 times", "no header"].iter().any(|why| said.contains(why));
        assert!(status == 2 && named, "{name}: {status} {said}");
    }
}

/// The line of a manifest is the one that an editor shows, whatever its line ends.
#[test]
fn lines_of_a_manifest_are_those_of_an_editor() {
    let it = Bench::new();
    for ends in ["\n", "\r\n"] {
        fs::write(it.path("m.csv"), ["unit,run", "A,log.csv", "B,", ""].join(ends)).unwrap();
        let (status, said) = it.run("fleet calibrate m.csv --setup bench.toml -o fl");
        assert!(status == 2 && said.contains("m.csv:3,"), "{ends:?}: {said}");
    }
}

/// A link that appears while the command runs: what is compared before the file is replaced is the file that was opened, not its name. The
/// log comes on standard input and is longer than a pipe, so the command has looked at its names when the link is made.
#[cfg(unix)]
#[test]
fn a_link_that_appears_later_to_an_input_is_not_replaced() {
    let it = Bench::new();
    let packed = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/chamber/cycle-1.csv.gz")).unwrap();
    let mut log = Vec::new();
    MultiGzDecoder::new(packed.as_slice()).read_to_end(&mut log).unwrap();
    assert!(log.len() > 100_000);
    let run = |links: bool| {
        let args = ["calibrate", "-", "--setup", "bench.toml", "--model", "bias 2", "-o", "new.json"];
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("sagnac"));
        let command = command.args(args).current_dir(it.folder.path());
        let mut program = command.stdin(Stdio::piped()).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        let mut input = program.stdin.take().unwrap();
        let (most, last) = log.split_at(log.len() - 100);
        input.write_all(most).unwrap();
        if links {
            fs::hard_link(it.path("bench.toml"), it.path("new.json")).unwrap();
        }
        input.write_all(last).unwrap();
        drop(input);
        let output = program.wait_with_output().unwrap();
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let setup = fs::read(it.path("bench.toml")).unwrap();
    let (status, said) = run(true);
    assert!(status == 2 && said.contains("the command reads this file"), "{status} {said}");
    assert!(fs::read(it.path("bench.toml")).unwrap() == setup && fs::read(it.path("new.json")).unwrap() == setup);
    fs::remove_file(it.path("new.json")).unwrap();
    let (status, said) = run(false);
    assert_eq!(status, 0, "{said}");
}

/// A log that the shell opened: standard input is an input too.
#[cfg(unix)]
#[test]
fn redirected_standard_input_is_not_replaced() {
    let it = Bench::new();
    let before = fs::read(it.path("log.csv")).unwrap();
    let program = assert_cmd::cargo::cargo_bin("sagnac");
    let mut command = std::process::Command::new(program);
    let input = fs::File::open(it.path("log.csv")).unwrap();
    let command = command.args(["compensate", "unit.cal.json", "-", "-o", "log.csv"]).current_dir(it.folder.path());
    let output = command.stdin(input).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && said.contains("the command reads this file"), "{said}");
    assert!(fs::read(it.path("log.csv")).unwrap() == before);
}
