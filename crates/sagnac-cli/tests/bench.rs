//! `sagnac bench` as a process: killed, resumed, finished, refused.

use std::io::Write;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sagnac_log::ingest::{ParquetRead, parquet_batches};

const HEADER: &str = "time_s,counts,temperature_c\n";
/// Longest wait for something that must happen.
const PATIENCE: Duration = Duration::from_secs(60);

struct Bench {
    folder: tempfile::TempDir,
    source: String,
}

impl Bench {
    fn new(source: impl Into<String>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let setup = "serial = \"T\"\naxis = \"z\"\narcsec_per_count = 0.6\n";
        std::fs::write(folder.path().join("bench.toml"), setup).unwrap();
        Self { folder, source: source.into() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sagnac"));
        command.current_dir(self.folder.path());
        command.args(["bench", "bench.toml", "-o", "run.parquet", "--page", "none"]).args(more);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn start(&self, more: &[&str]) -> Child {
        let mut command = self.command(&[&["--source", &self.source], more].concat());
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    fn run(&self, more: &[&str]) -> Output {
        self.command(more).output().unwrap()
    }

    /// A command on a terminal of its own, whose output is in `shown`.
    #[cfg(target_os = "linux")]
    fn on_terminal(&self, line: &str) -> Child {
        let mut terminal = Command::new("script");
        terminal.args(["-qefc", line, "shown"]).current_dir(self.folder.path()).env("TERM", "xterm-256color");
        terminal.stdin(Stdio::piped()).stdout(Stdio::null()).spawn().expect("script of util-linux")
    }

    fn journal_bytes(&self) -> u64 {
        std::fs::metadata(self.path("run.parquet.journal")).map_or(0, |file| file.len())
    }

    /// Kills a recording of a file when the journal no longer grows: it has the rest of the file then.
    fn kill_at_the_end(&self, child: &mut Child) {
        let (mut size, mut since) = (0, Instant::now());
        until("the end of the file", || {
            let now = self.journal_bytes();
            if now != size {
                (size, since) = (now, Instant::now());
            }
            size > 0 && since.elapsed() > Duration::from_secs(1)
        });
        child.kill().unwrap();
        child.wait().unwrap();
    }

    /// The counts of the finished log.
    fn counts(&self) -> Vec<u64> {
        let read = ParquetRead { roots: None, rows: 8192, values: u64::MAX, memory: Default::default() };
        let file = std::fs::File::open(self.path("run.parquet")).unwrap();
        let mut out = Vec::new();
        for batch in parquet_batches(file, &read).unwrap() {
            let batch = batch.unwrap();
            let column = batch.column_by_name("counts").unwrap().as_primitive::<Float64Type>();
            out.extend(column.iter().map(|count| count.unwrap() as u64));
        }
        out
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Waits until a condition holds.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "{what} did not happen");
        std::thread::yield_now();
    }
}

/// A row whose counts are its number.
fn row(number: u64) -> String {
    format!("{}.{:02},{number},{:.3}\n", number / 100, number % 100, 20.0 + (number % 1000) as f64 / 100.0)
}

/// 150 times `kill -9` of a recording of a file that grows: every row is in the log, once and in order.
#[test]
fn kills_lose_nothing_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("live.csv");
    let mut file = std::fs::File::create(&path).unwrap();
    file.write_all(HEADER.as_bytes()).unwrap();
    let goes_on = Arc::new(AtomicBool::new(true));
    let writer = {
        let goes_on = Arc::clone(&goes_on);
        std::thread::spawn(move || {
            let mut number = 0;
            while goes_on.load(Ordering::Relaxed) {
                // A row in two pieces, so that kills fall between them.
                let row = row(number);
                let (first, second) = row.split_at(row.len() / 2);
                file.write_all(first.as_bytes()).unwrap();
                file.write_all(second.as_bytes()).unwrap();
                number += 1;
                if number % 16 == 0 {
                    std::thread::park_timeout(Duration::from_millis(1));
                }
            }
            number
        })
    };
    let bench = Bench::new(format!("file:{}", path.display()));
    let mut random = ChaCha8Rng::seed_from_u64(21);
    for kill in 0..150 {
        let before = bench.journal_bytes();
        let mut child = bench.start(if kill == 0 { &[] } else { &["--resume"] });
        let grown = random.random_range(1..4000);
        until("a block", || bench.journal_bytes() > before + grown);
        child.kill().unwrap();
        child.wait().unwrap();
    }
    goes_on.store(false, Ordering::Relaxed);
    let written = writer.join().unwrap();
    let mut child = bench.start(&["--resume"]);
    bench.kill_at_the_end(&mut child);
    let out = bench.run(&["--finish"]);
    assert!(bench.path("run.parquet").exists(), "{}", text(&out.stderr));
    let counts = bench.counts();
    assert_eq!(counts.len() as u64, written);
    assert!(counts.iter().zip(0..).all(|(count, number)| *count == number), "rows are lost, twice or in disorder");
    assert!(!text(&out.stderr).contains("in no row"), "{}", text(&out.stderr));
}

/// While the bench was down another program began a new file under the same name, and it is the longer one: it is read from its start.
#[test]
fn a_file_that_was_replaced_while_the_bench_was_down_is_another() {
    let bench = Bench::new("file:live.csv");
    let rows = |numbers: std::ops::Range<u64>| HEADER.to_owned() + &numbers.map(row).collect::<String>();
    std::fs::write(bench.path("live.csv"), rows(0..500)).unwrap();
    bench.kill_at_the_end(&mut bench.start(&[]));
    std::fs::write(bench.path("new.csv"), rows(500..2000)).unwrap();
    std::fs::rename(bench.path("new.csv"), bench.path("live.csv")).unwrap();
    bench.kill_at_the_end(&mut bench.start(&["--resume"]));
    bench.kill_at_the_end(&mut bench.start(&["--resume"]));
    let out = bench.run(&["--finish"]);
    assert!(bench.path("run.parquet").exists(), "{}", text(&out.stderr));
    assert!(bench.counts().into_iter().eq(0..2000), "{}", text(&out.stderr));
}

/// 50 times `kill -9` of a recording over TCP: what is missing was sent within the second before a kill, or to nobody.
#[test]
fn kills_lose_at_most_the_last_second_of_a_line() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let bench = Bench::new(format!("tcp://{}", listener.local_addr().unwrap()));
    let goes_on = Arc::new(AtomicBool::new(true));
    // When each row was sent, and when each connection began.
    let sent = Arc::new(Mutex::new(Vec::<Instant>::new()));
    let begun = Arc::new(Mutex::new(Vec::<Instant>::new()));
    let server = {
        let (goes_on, sent, begun) = (Arc::clone(&goes_on), Arc::clone(&sent), Arc::clone(&begun));
        std::thread::spawn(move || {
            let mut number = 0;
            while goes_on.load(Ordering::Relaxed) {
                let (mut line, _) = listener.accept().unwrap();
                begun.lock().unwrap().push(Instant::now());
                let mut alive = line.write_all(HEADER.as_bytes()).is_ok();
                while alive && goes_on.load(Ordering::Relaxed) {
                    sent.lock().unwrap().push(Instant::now());
                    alive = line.write_all(row(number).as_bytes()).is_ok();
                    number += 1;
                    std::thread::park_timeout(Duration::from_micros(200));
                }
            }
        })
    };
    let mut random = ChaCha8Rng::seed_from_u64(22);
    let mut killed = Vec::new();
    for kill in 0..50 {
        let before = bench.journal_bytes();
        let mut child = bench.start(if kill == 0 { &[] } else { &["--resume"] });
        let grown = random.random_range(1..6000);
        until("a block", || bench.journal_bytes() > before + grown);
        killed.push(Instant::now());
        child.kill().unwrap();
        child.wait().unwrap();
    }
    goes_on.store(false, Ordering::Relaxed);
    // Lets the server go on from waiting for somebody.
    let address = bench.source.strip_prefix("tcp://").unwrap().to_owned();
    let _ = std::net::TcpStream::connect(address);
    server.join().unwrap();
    let out = bench.run(&["--finish"]);
    assert!(bench.path("run.parquet").exists(), "{}", text(&out.stderr));
    let counts = bench.counts();
    assert!(counts.windows(2).all(|pair| pair[0] < pair[1]), "rows are twice or in disorder");
    let (sent, begun) = (sent.lock().unwrap(), begun.lock().unwrap());
    let there: std::collections::BTreeSet<u64> = counts.iter().copied().collect();
    assert!(there.len() as f64 > 0.5 * sent.len() as f64, "{} of {}", there.len(), sent.len());
    let second = Duration::from_secs(1);
    for (number, at) in sent.iter().enumerate().filter(|(number, _)| !there.contains(&(*number as u64))) {
        let excused = killed.iter().any(|kill| {
            let back = begun.iter().find(|begun| *begun > kill).copied().unwrap_or_else(Instant::now);
            *at + second >= *kill && *at <= back
        });
        assert!(excused, "row {number} is lost, and no kill was near");
    }
}

/// A pipe from the simulator: recorded, calibrated, and the same record as `calibrate` makes of the log.
#[test]
fn a_pipe_is_recorded_and_calibrated() {
    let bench = Bench::new("-");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scenario = root.join("scenarios/paper");
    std::fs::copy(scenario.join("bench.toml"), bench.path("bench.toml")).unwrap();
    let mut simulator = Command::new(env!("CARGO_BIN_EXE_sagnac"))
        .arg("simulate")
        .arg(scenario.join("paper.toml"))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let pipe = simulator.stdout.take().unwrap();
    let more = ["--source", "-", "--calibration", "unit.cal.json", "--report", "unit.html"];
    let out = bench.command(&more).stdin(pipe).output().unwrap();
    simulator.wait().unwrap();
    assert!(out.status.success(), "{}", text(&out.stderr));
    let again = Command::new(env!("CARGO_BIN_EXE_sagnac"))
        .current_dir(bench.folder.path())
        .args(["calibrate", "run.parquet", "--setup", "bench.toml", "-o", "again.cal.json"])
        .output()
        .unwrap();
    assert!(again.status.success(), "{}", text(&again.stderr));
    let read = |name: &str| std::fs::read(bench.path(name)).unwrap();
    assert!(read("unit.cal.json") == read("again.cal.json"), "the bench's record is not that of its log");
    assert!(text(&read("unit.html")).contains("<html"));
    // What is there is not replaced.
    let twice = bench.run(&["--source", "-"]);
    assert_eq!(twice.status.code(), Some(2));
    assert!(text(&twice.stderr).contains("exists already"), "{}", text(&twice.stderr));
}

/// What cannot work is refused before anything is recorded.
#[test]
fn what_cannot_work_is_refused_first() {
    let bench = Bench::new("-");
    let refused = |more: &[&str], says: &str| {
        let out = bench.run(more);
        assert_eq!(out.status.code(), Some(2), "{more:?}: {}", text(&out.stderr));
        assert!(text(&out.stderr).contains(says), "{more:?}: {}", text(&out.stderr));
        assert_eq!(bench.journal_bytes(), 0, "{more:?}");
    };
    refused(&[], "bench.source");
    refused(&["--source", "ftp://x"], "not a source");
    refused(&["--source", "-", "--limits", "no-such-set"], "no-such-set");
    refused(&["--source", "-", "--stop-when", "met"], "--limits");
    refused(&["--source", "-", "--stop-when", "met", "--limits", "navigation-grade"], "span_c");
    refused(&["--source", "-", "--resume"], "there is no recording to continue");
    refused(&["--finish"], "run.parquet.journal");
    refused(&["--source", "-", "--model", "cubic"], "cubic");
    std::fs::write(bench.path("bench.toml"), "[bench]\nheaders = \"a,b\"\n").unwrap();
    refused(&["--source", "-"], "bench.headers");
    std::fs::write(
        bench.path("bench.toml"),
        "[bench]\n[[bench.poll]]\nsource = \"scpi://x:1\"\ncolumns = [{ name = \"t\" }]\n",
    )
    .unwrap();
    refused(&["--source", "-"], "query");
}

/// What the command reads is never what it writes: the source, the journal of the recording, limits of one's own.
#[test]
fn a_calibration_over_an_input_is_refused_first() {
    let bench = Bench::new("-");
    let source = HEADER.to_owned() + &(1..2000).map(row).collect::<String>();
    let limits = "sigma_over_floor_max = 1.1\n";
    std::os::unix::fs::symlink("live.csv", bench.path("link.csv")).unwrap();
    for (source_name, calibration) in [
        ("replay:live.csv?speed=max", "live.csv"),
        ("file:live.csv", "live.csv"),
        ("file:live.csv", "link.csv"),
        ("file:link.csv", "./live.csv"),
        ("replay:live.csv?speed=max", "run.parquet.journal"),
        ("replay:live.csv?speed=max", "run.parquet"),
        ("replay:live.csv?speed=max", "limits.toml"),
    ] {
        std::fs::write(bench.path("live.csv"), &source).unwrap();
        std::fs::write(bench.path("limits.toml"), limits).unwrap();
        let out = bench.run(&["--source", source_name, "--limits", "limits.toml", "--calibration", calibration]);
        assert_eq!(out.status.code(), Some(2), "{calibration}: {}", text(&out.stderr));
        assert_eq!(std::fs::read_to_string(bench.path("live.csv")).unwrap(), source, "{calibration}");
        assert_eq!(std::fs::read_to_string(bench.path("limits.toml")).unwrap(), limits, "{calibration}");
        assert_eq!(bench.journal_bytes(), 0, "{calibration}");
    }
}

/// A file that is written again in place, to more bytes than before: all of its new rows are recorded, and the journal says why.
#[test]
fn a_file_that_is_written_again_loses_no_row() {
    let bench = Bench::new("file:live.csv");
    let rows = |from: u64, to: u64| HEADER.to_owned() + &(from..to).map(row).collect::<String>();
    std::fs::write(bench.path("live.csv"), rows(1, 300)).unwrap();
    let mut child = bench.start(&[]);
    until("the first rows", || bench.journal_bytes() > 600);
    // In place and without making it shorter first.
    let mut file = std::fs::File::options().write(true).open(bench.path("live.csv")).unwrap();
    file.write_all(rows(1000, 1600).as_bytes()).unwrap();
    drop(file);
    bench.kill_at_the_end(&mut child);
    // Counts that rise are taken for a running total; the log is there.
    bench.run(&["--finish"]);
    let counts = bench.counts();
    assert_eq!(counts[counts.len() - 600..], (1000..1600).collect::<Vec<_>>(), "{} rows", counts.len());
}

/// A terminal that goes away ends no recording, with figures on it or without; Ctrl-C does, with a whole file.
#[test]
#[cfg(target_os = "linux")]
fn a_recording_outlives_its_terminal() {
    for more in ["", "--tui"] {
        let bench = Bench::new("file:live.csv");
        std::fs::write(bench.path("live.csv"), HEADER.to_owned() + &(1..500).map(row).collect::<String>()).unwrap();
        let line = format!(
            "echo $$ > pid; exec {} bench bench.toml -o run.parquet --page none {more} --source file:live.csv",
            env!("CARGO_BIN_EXE_sagnac")
        );
        let mut terminal = bench.on_terminal(&line);
        until("the first rows", || bench.journal_bytes() > 600);
        terminal.kill().unwrap();
        terminal.wait().unwrap();
        let pid = std::fs::read_to_string(bench.path("pid")).unwrap().trim().to_owned();
        let signal = |name: &str| Command::new("bash").args(["-c", &format!("kill -{name} {pid}")]).status().unwrap();
        assert!(signal("HUP").success());
        let mut file = std::fs::File::options().append(true).open(bench.path("live.csv")).unwrap();
        let before = bench.journal_bytes();
        (500..4000).for_each(|number| file.write_all(row(number).as_bytes()).unwrap());
        until("rows without a terminal", || bench.journal_bytes() > before);
        let mut settled = (0, Instant::now());
        until("the end of the file", || {
            let now = bench.journal_bytes();
            if now != settled.0 {
                settled = (now, Instant::now());
            }
            settled.1.elapsed() > Duration::from_secs(1)
        });
        assert!(signal("INT").success());
        until("the log", || bench.path("run.parquet").exists());
        assert_eq!(bench.counts(), (1..4000).collect::<Vec<_>>(), "{more}");
    }
}

/// Garbage instead of a log: nothing that is a row, exit 3, and the journal keeps it.
#[test]
fn garbage_is_kept_and_no_log() {
    let bench = Bench::new("-");
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let garbage: Vec<u8> = (0..200_000).map(|_| random.random()).collect();
    let path = bench.path("garbage");
    std::fs::write(&path, &garbage).unwrap();
    let out = bench.command(&["--source", "-"]).stdin(std::fs::File::open(&path).unwrap()).output().unwrap();
    assert_eq!(out.status.code(), Some(3), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("the recorded bytes contain no row"), "{}", text(&out.stderr));
    assert!(bench.journal_bytes() >= 200_000);
    assert!(!bench.path("run.parquet").exists());
}

/// A recording of another setup does not go on, and a journal that somebody else writes is not touched.
#[test]
fn a_recording_goes_on_with_its_own_setup() {
    let bench = Bench::new("-");
    let out = bench.command(&["--source", "-"]).stdin(Stdio::null()).output().unwrap();
    assert_eq!(out.status.code(), Some(3), "{}", text(&out.stderr));
    let before = bench.journal_bytes();
    let other = bench.run(&["--source", "-", "--resume", "--arcsec-per-count", "0.7"]);
    assert_eq!(other.status.code(), Some(2));
    assert!(text(&other.stderr).contains("differs from the recording"), "{}", text(&other.stderr));
    assert_eq!(bench.journal_bytes(), before);
}

/// A disk that is full (a limit on the size of files): recording stops with a word, what there is is kept, and it goes on when there is room.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_stops_the_recording_with_a_word() {
    let bench = Bench::new("file:live.csv");
    // Digits that do not compress well.
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let rows: String = (0..20_000_u32)
        .map(|i| format!("{i},{},{:.6}\n", random.random_range(0..1_000_000), random.random_range(20.0..30.0)))
        .collect();
    std::fs::write(bench.path("live.csv"), HEADER.to_owned() + &rows).unwrap();
    let program = env!("CARGO_BIN_EXE_sagnac");
    let line =
        format!("ulimit -f 100; exec {program} bench bench.toml -o run.parquet --page none --source file:live.csv");
    let out = Command::new("bash").args(["-c", &line]).current_dir(bench.folder.path()).output().unwrap();
    assert_eq!(out.status.code(), Some(2), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("with --resume"), "{}", text(&out.stderr));
    assert!(bench.journal_bytes() <= 102_400 && !bench.path("run.parquet").exists());
    let mut child = bench.start(&["--resume"]);
    let mut since = (bench.journal_bytes(), Instant::now());
    until("the rest", || {
        let now = bench.journal_bytes();
        if now != since.0 {
            since = (now, Instant::now());
        }
        since.1.elapsed() > Duration::from_secs(1)
    });
    child.kill().unwrap();
    child.wait().unwrap();
    bench.run(&["--finish"]);
    assert_eq!(bench.counts().len(), 20_000);
}

/// A test of two cycles over −40 … 70 °C with a smooth drift, rows of 5 s.
fn two_cycles() -> String {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let (mut block, mut angle, mut counted) = (-40.0, 0.0, 0.0);
    let mut text = HEADER.to_owned();
    for row in 1..=14_400_u32 {
        let minutes = f64::from(row) / 12.0 % 400.0;
        let chamber = match minutes {
            m if m < 90.0 => -40.0,
            m if m < 200.0 => -40.0 + (m - 90.0),
            m if m < 290.0 => 70.0,
            m => 70.0 - (m - 290.0),
        };
        block += (chamber - block) * 5.0 / 1200.0;
        let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
        angle += (4.5 + 0.001 * block) * 5.0 + 0.18 * 5.0_f64.sqrt() * noise;
        let counts = (angle / 0.15125).floor() - counted;
        counted += counts;
        text += &format!("{},{counts},{block:.4}\n", 5 * row);
    }
    text
}

/// The test ends itself when it is complete, long before its log does: record and report are written, and the exit status is 0.
#[test]
fn a_test_that_has_told_enough_ends_itself() {
    let bench = Bench::new("replay:test.csv?speed=max");
    std::fs::write(bench.path("test.csv"), two_cycles()).unwrap();
    let setup = "serial = \"T\"\naxis = \"z\"\narcsec_per_count = 0.15125\n[bench]\nspan_c = [-40, 69]\nlimits = \"navigation-grade\"\n";
    std::fs::write(bench.path("bench.toml"), setup).unwrap();
    let more = ["--stop-when", "met", "--calibration", "unit.cal.json", "--report", "unit.html"];
    let ended = bench.run(&[&["--source", "replay:test.csv?speed=2000"][..], &more].concat());
    assert!(ended.status.success(), "{}", text(&ended.stderr));
    assert!(text(&ended.stderr).contains("complete, and was ended"), "{}", text(&ended.stderr));
    // It soaked at the ends alone.
    assert!(
        text(&ended.stderr).contains("not seen by this test: a memory of the direction at rest"),
        "{}",
        text(&ended.stderr)
    );
    let rows = bench.counts().len();
    assert!((5000..13_000).contains(&rows), "{rows} rows");
    assert!(bench.path("unit.cal.json").exists() && bench.path("unit.html").exists());
    // It goes on where it ended, and then it ends with its log. Its lines are in the unit that is asked.
    let resumed = bench.run(&["--source", "replay:test.csv?speed=max", "--resume", "--units", "dps"]);
    assert!(resumed.status.success(), "{}", text(&resumed.stderr));
    assert!(text(&ended.stderr).contains("°/h") && !text(&ended.stderr).contains("°/s"), "{}", text(&ended.stderr));
    assert!(
        text(&resumed.stderr).contains("°/s") && !text(&resumed.stderr).contains("°/h"),
        "{}",
        text(&resumed.stderr)
    );
    assert_eq!(bench.counts().len(), 14_400);
}

/// Columns of another program, of which the setup says nothing or has the headers that the log has too: its rows are known as they come.
#[test]
fn recognised_columns_are_shown_as_they_come() {
    let columns = "Time (s),Temp (degC),Gyro X (deg/s),Gyro Y (deg/s)";
    let rows = (0..600).map(|i| format!("{i},{:.2},0.{:03},-0.002\n", 20.0 + 0.01 * f64::from(i), 300 + i % 7));
    let log = format!("{columns}\n{}", rows.collect::<String>());
    for headers in [String::new(), format!("[bench]\nheaders = \"{columns}\"\n")] {
        let bench = Bench::new("replay:test.csv?speed=max");
        std::fs::write(bench.path("test.csv"), &log).unwrap();
        std::fs::write(bench.path("bench.toml"), format!("serial = \"T\"\nunits = \"dps\"\n{headers}")).unwrap();
        let said = text(&bench.run(&["--source", "replay:test.csv?speed=max"]).stderr);
        let last = said.lines().rfind(|line| line.contains(" rows: ")).unwrap_or_else(|| panic!("{said}"));
        assert!(last.contains("600 rows: x 0.30") && last.contains("y -0.002"), "{said}");
        assert!(!said.contains("no rows yet"), "{said}");
    }
}

/// On a terminal the figures are drawn in text; `q` ends the recording, and the terminal is as before.
#[test]
#[cfg(target_os = "linux")]
fn a_terminal_shows_the_figures() {
    let bench = Bench::new("file:live.csv");
    std::fs::write(bench.path("live.csv"), two_cycles()).unwrap();
    let line = format!(
        "stty cols 140 rows 45; {} bench bench.toml -o run.parquet --page none --tui --source file:live.csv",
        env!("CARGO_BIN_EXE_sagnac")
    );
    let mut child = bench.on_terminal(&line);
    let shown = || text(&std::fs::read(bench.path("shown")).unwrap_or_default());
    until("the figures", || ["Allan", "temperature", "bias"].iter().all(|word| shown().contains(word)));
    child.stdin.take().unwrap().write_all(b"q").unwrap();
    assert!(child.wait().unwrap().success());
    // The alternate screen was entered and is left.
    assert!(shown().contains("\u{1b}[?1049h") && shown().contains("\u{1b}[?1049l"));
    assert_eq!(bench.counts().len(), 14_400);
}

/// A setup that does not fit the source loses nothing: the recording goes on, says why, and is finished with a corrected setup.
#[test]
fn a_wrong_setup_is_corrected_afterwards() {
    let bench = Bench::new("-");
    let log = "t;Ctr;T\n".to_owned() + &(0..300).map(|i| format!("{i},5;7;2{},25\n", i % 10)).collect::<String>();
    std::fs::write(bench.path("log"), log).unwrap();
    let out =
        bench.command(&["--source", "-"]).stdin(std::fs::File::open(bench.path("log")).unwrap()).output().unwrap();
    assert_eq!(out.status.code(), Some(3), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("lines without headers"), "{}", text(&out.stderr));
    let setup =
        "axis = \"z\"\narcsec_per_count = 0.6\n[columns]\nt = \"time_s\"\nCtr = \"counts\"\nT = \"temperature_c\"\n";
    std::fs::write(bench.path("bench.toml"), setup).unwrap();
    let out = bench.run(&["--finish"]);
    assert!(bench.path("run.parquet").exists(), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("300 rows"), "{}", text(&out.stdout));
}
