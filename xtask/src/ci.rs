//! `cargo xtask ci`: everything that CI runs, in lists that fill all processors; prints the time of each part at the end.

use std::fs;
use std::slice;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Instant;

use anyhow::{Context, Error, Result, anyhow};
use xtask::debian::{self, need};
use xtask::shell::{built, root, sh, stdout_of, text};

use crate::checks::{build_lab, compiled_once, deny, examples, no_panic, run_lab};
use crate::{dist, docs, features, fuzz, layers};

/// A part by its name.
type Part = (&'static str, fn() -> Result<()>);

/// Cases of the hunt: so many are the same on every machine, so many minutes are not.
const HUNTED: &str = "6000";

/// What ends within seconds; a failure here waits for nothing.
const QUICK: [Part; 3] = [
    ("format", || sh("cargo", &["fmt", "--all", "--check"])),
    ("layers", layers::layers),
    ("compiled once", compiled_once),
];

/// In this order: lints, and what compiles the programs that most others run.
const FIRST: [Part; 3] = [
    ("clippy", || sh("cargo", &["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"])),
    ("tests, compiled", || sh("cargo", &["test", "--workspace", "--locked", "--no-run"])),
    ("lab, compiled", build_lab),
];

/// Then what runs on all processors, or would if each of its steps had as much to compile.
const RUNS: [Part; 10] = [
    ("features", features::features),
    ("docs", || docs::docs(true)),
    ("deny", deny),
    ("no-panic", no_panic),
    ("tests", tests),
    ("examples", examples),
    ("bless", || run_lab(&["bless", "--check"])),
    ("dist", || dist::dist(&["--check"])),
    ("hunt", || run_lab(&["hunt", "--cases", HUNTED])),
    ("fuzz", || fuzz::fuzz(&["--smoke"])),
];

/// And beside it what runs on one processor for most of its time: simulators, emulators, programs of Python. The longest come first; those
/// of a row share a folder, and run one after the other. The lab has a command for each but the Python package.
const BESIDE: [&[&str]; 6] = [&["fpga"], &["firmware", "closed-loop"], &["c"], &[WHEEL], &["conserve"], &["formats"]];
/// By this program, as it builds them.
const WHEEL: &str = "wheel";
const FLEET: &str = "fleet";

/// What is yet to be run of [`BESIDE`].
type Queue = Mutex<slice::Iter<'static, &'static [&'static str]>>;

/// All of it. Who has run the one list helps with the other, so that no processor waits. A failure ends both after what runs.
pub(crate) fn ci() -> Result<()> {
    need(&tools())?;
    let mut took = list(&QUICK)?;
    let queue = Mutex::new(BESIDE.iter());
    let (compiled, is_compiled) = channel();
    took += &thread::scope(|scope| {
        let other =
            scope.spawn(|| or_end(&queue, beside_first(is_compiled).and_then(|took| Ok(took + &beside(&queue)?))));
        let first = list(&FIRST).inspect(|_| {
            // Who waits for it has ended only with an error of its own.
            let _ = compiled.send(());
        });
        // Nobody waits for what will not come.
        drop(compiled);
        let rest = || list(&RUNS).and_then(|took| Ok(took + &beside(&queue)?));
        let mine = or_end(&queue, first.and_then(|took| Ok(took + &rest()?)));
        let other = other.join().map_err(|_| anyhow!("ci stops: a panic")).flatten();
        Ok::<_, Error>(mine? + &other?)
    })?;
    println!("ci: every part passed\n{:16} {:>8}\n{took}processor time {:9.0}", "part", "s", cpu_s()?);
    Ok(())
}

fn next(queue: &Queue) -> Option<&'static [&'static str]> {
    queue.lock().unwrap_or_else(PoisonError::into_inner).next().copied()
}

/// The result; a failure empties the queue.
fn or_end(queue: &Queue, result: Result<String>) -> Result<String> {
    if result.is_err() {
        *queue.lock().unwrap_or_else(PoisonError::into_inner) = [].iter();
    }
    result
}

/// One after the other; the time of each.
fn list(parts: &[Part]) -> Result<String> {
    let mut took = String::new();
    for (name, part) in parts {
        let wall = Instant::now();
        part().with_context(|| format!("ci stops at {name}"))?;
        took += &format!("{name:16} {:8.0}\n", wall.elapsed().as_secs_f64());
    }
    Ok(took)
}

/// Beside the first list, whose steps wait for one another, a workspace that needs nothing of it; until that list has ended.
fn beside_first(is_compiled: Receiver<()>) -> Result<String> {
    let took = row(&[FLEET])?;
    is_compiled.recv().context("ci stops: the first list has failed")?;
    Ok(took)
}

/// The same as a list of the queue.
fn beside(queue: &Queue) -> Result<String> {
    let mut took = String::new();
    while let Some(names) = next(queue) {
        took += &row(names)?;
    }
    Ok(took)
}

/// One after the other; the output of a command is shown when it ends, so that it does not mix with that of the tests.
fn row(names: &[&str]) -> Result<String> {
    let mut took = String::new();
    for name in names {
        let wall = Instant::now();
        println!("{}", run_beside(name).with_context(|| format!("ci stops at {name}"))?);
        took += &format!("{name:16} {:8.0} beside\n", wall.elapsed().as_secs_f64());
    }
    Ok(took)
}

fn run_beside(name: &str) -> Result<String> {
    let by_this = [WHEEL, FLEET].contains(&name);
    let program = if by_this { std::env::current_exe()? } else { built("debug", "lab") };
    stdout_of(3600, text(&program)?, &[name], &root())
}

/// Without the tests of generated files: `bless --check` does the same. All that fail are named, not the first alone.
fn tests() -> Result<()> {
    let arguments = ["test", "--workspace", "--locked", "--no-fail-fast", "--", "--skip"];
    sh("cargo", &[&arguments[..], &["generated_files_are_as_they_are_made"]].concat())
}

/// All Debian packages that the parts need, in one request. The browser only where a test without one fails.
fn tools() -> Vec<debian::Tool> {
    let browser = std::env::var_os("SAGNAC_REQUIRE_SHARED").is_some_and(|value| value == "1");
    let browser = if browser { debian::BROWSER } else { &[] };
    [debian::CORPUS, debian::C, debian::FPGA, debian::FIRMWARE, debian::DIST, debian::FORMATS, debian::WHEEL, browser]
        .concat()
}

/// Processor time of all child processes that have ended, s: proc(5), where it is in hundredths.
fn cpu_s() -> Result<f64> {
    of_children(&fs::read_to_string("/proc/self/stat").context("cannot read /proc/self/stat")?)
}

fn of_children(stat: &str) -> Result<f64> {
    // The name in parentheses may hold blanks; the sixteenth field is the fourteenth behind it.
    let (_, fields) = stat.rsplit_once(") ").context("/proc/self/stat has no name")?;
    let fields: Vec<&str> = fields.split(' ').collect();
    let ticks = |at: usize| fields.get(at).and_then(|field| field.parse::<f64>().ok());
    let (user, system) = ticks(13).zip(ticks(14)).context("/proc/self/stat is too short")?;
    Ok((user + system) / 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_queue_gives_each_row_once_and_ends_with_a_failure() {
        let queue = Mutex::new(BESIDE.iter());
        assert_eq!([next(&queue), next(&queue)], [Some(BESIDE[0]), Some(BESIDE[1])]);
        assert!(or_end(&queue, Ok(String::new())).is_ok() && next(&queue) == Some(BESIDE[2]));
        assert!(or_end(&queue, Err(anyhow!("a part"))).is_err() && next(&queue).is_none());
    }

    #[test]
    fn time_of_children_is_read_behind_any_name() {
        let stat = "7 (a) b) S 1 2 3 4 5 6 7 8 9 10 111 222 250 50 20 0 1 0";
        assert_eq!(of_children(stat).unwrap(), 3.0);
        assert!(of_children("7 (a) S 1").is_err());
    }
}
