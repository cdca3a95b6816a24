//! Stopped at any moment while it writes: the old file or the new one, never half of it; after Ctrl-C no other file.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use sagnac_sim::{PaperRig, csv_bytes};
use tempfile::TempDir;

const KILLS: u32 = 200;
/// A whole run is timed again after so many kills, because other work on the machine comes and goes; it counts as twice as long if none of
/// the kills before came after its end.
const KILLS_PER_MEASUREMENT: u32 = 20;
const OLD: &str = "what was there before\n";

fn start(folder: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sagnac"));
    command.args(["compensate", "unit.cal.json", "log.csv", "-o", "out.csv"]).current_dir(folder);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Waits until this time after the start; a kill is valid at any moment, also after the end.
fn wait_until(started: Instant, moment: Duration) {
    while started.elapsed() < moment {
        std::hint::spin_loop();
    }
}

/// Every order of the kills spreads them over the whole of a run; this one does so between two measurements too.
fn moment(kill: u32) -> u32 {
    kill % KILLS_PER_MEASUREMENT * (KILLS / KILLS_PER_MEASUREMENT) + kill / KILLS_PER_MEASUREMENT
}

fn temporary_files(folder: &Path) -> usize {
    let names = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(".sagnac-")).count()
}

/// Half of the kills by SIGKILL, half by SIGINT, spread over the whole of a run.
#[test]
fn killed_at_any_moment_leaves_the_old_file_or_the_new_one() {
    let folder = TempDir::new().unwrap();
    let path = folder.path();
    std::fs::write(path.join("log.csv"), csv_bytes(PaperRig::PAPER.run(1))).unwrap();
    let calibrate = ["calibrate", "log.csv", "--arcsec-per-count", "1.059", "--quantum", "0.25", "-o", "unit.cal.json"];
    assert_cmd::Command::cargo_bin("sagnac").unwrap().current_dir(path).args(calibrate).assert().success();
    let time_of_whole_run = || {
        let started = Instant::now();
        assert!(start(path).wait().unwrap().success());
        started.elapsed()
    };
    time_of_whole_run();
    let new = std::fs::read(path.join("out.csv")).unwrap();
    assert!(new.len() > 100_000);
    let (mut with_old, mut with_new, mut whole, mut new_before) = (0, 0, Duration::ZERO, 0);
    for kill in 0..KILLS {
        if kill % KILLS_PER_MEASUREMENT == 0 {
            let longer = if with_new > new_before || kill == 0 { Duration::ZERO } else { whole * 2 };
            whole = time_of_whole_run().max(longer);
            new_before = with_new;
        }
        std::fs::write(path.join("out.csv"), OLD).unwrap();
        let started = Instant::now();
        let mut child = start(path);
        wait_until(started, whole * moment(kill) / (KILLS - KILLS / 8));
        let polite = kill % 2 == 1;
        if polite {
            // By the program of that name: no unsafe call here.
            Command::new("kill").args(["-INT", &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
        } else {
            // It may have ended by itself.
            let _ = child.kill();
        }
        child.wait().unwrap();
        let out = std::fs::read(path.join("out.csv")).unwrap();
        let is_new = out == new;
        assert!(is_new || out == OLD.as_bytes(), "kill {kill}: {} bytes of {}", out.len(), new.len());
        (with_old, with_new) = (with_old + u32::from(!is_new), with_new + u32::from(is_new));
        if polite && temporary_files(path) > 0 {
            // Before the handler is installed, Ctrl-C ends a program like SIGKILL; nothing is written by then.
            panic!("kill {kill}: Ctrl-C left a temporary file");
        }
        for entry in std::fs::read_dir(path).unwrap().map(Result::unwrap) {
            if entry.file_name().to_string_lossy().starts_with(".sagnac-") {
                std::fs::remove_file(entry.path()).unwrap();
            }
        }
    }
    // The test is meaningful only if kills came both before the end and after it.
    assert!(with_old > KILLS / 10 && with_new > 0, "{with_old} old, {with_new} new");
}
