//! What must hold of any run, whatever its input.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};
use sagnac_log::ingest::sha256;
use tempfile::NamedTempFile;

use super::case::HuntCase;
use crate::program::Program;

/// Processor time of a run, s, after which it counts as endless. An answer is due in 10 s of the program that is shipped; this one is
/// optimised less, two run at a time, and CI's machine may be slow, so a fit of thousands of windows has six times as long.
const CPU_S: u32 = if cfg!(test) { 2 } else { 60 };
/// Wall clock after which it is stopped, s: for one that waits.
const WALL_S: u32 = 400;
/// Largest resident set of a run with the default budget.
const PEAK_KIB: u64 = 256 << 10;
/// Most that a run may write or say: its inputs have about 100 kB.
const OUTPUT_BYTES: u64 = 64 << 20;
/// Longest message of an error.
const MESSAGE_BYTES: usize = 8 << 10;

/// How a run ended.
#[derive(Debug)]
pub(super) struct Outcome {
    pub(super) status: i32,
    stdout: Vec<u8>,
    stderr: Vec<u8>,
    peak_kib: u64,
}

impl Outcome {
    /// The first line of what was said.
    pub(super) fn message(&self) -> String {
        String::from_utf8_lossy(&self.stderr).lines().next().unwrap_or_default().to_owned()
    }
}

/// Runs a case in its folder, and says what is wrong with how it ended.
pub(super) fn judge(case: &HuntCase, program: &Program, folder: &Path) -> Result<(Outcome, Vec<String>)> {
    let before = contents(folder)?;
    let outcome = run(program, folder, &case.args)?;
    let after = contents(folder)?;
    let mut wrong = ended_well(case, &outcome);
    wrong.extend(files_are_sound(case, &before, &after, &outcome, folder)?);
    if wrong.is_empty() && matches!(outcome.status, 0 | 1) {
        wrong.extend(read_back(program, folder, &before, &after)?);
    }
    Ok((outcome, wrong))
}

/// Runs the program under limits of processor time, output and wall clock.
fn run(program: &Program, folder: &Path, args: &[String]) -> Result<Outcome> {
    let peak = NamedTempFile::new()?;
    let output = Command::new("timeout")
        .args([
            "-s",
            "KILL",
            &WALL_S.to_string(),
            "prlimit",
            &format!("--cpu={CPU_S}"),
            &format!("--fsize={OUTPUT_BYTES}"),
            "--core=0",
        ])
        .args(["/usr/bin/time", "-f", "%M", "-o"])
        .arg(peak.path())
        .arg(program.path())
        .args(args)
        .env("RUST_BACKTRACE", "0")
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .context(
            "cannot start timeout, prlimit and /usr/bin/time; on Debian: apt-get install coreutils util-linux time",
        )?;
    let measured = fs::read_to_string(peak.path())?;
    // GNU time reports a signal as 128 and its number, or in words.
    let signal = measured.contains("terminated by signal");
    let status = if signal { -1 } else { output.status.code().unwrap_or(-1) };
    let peak_kib = measured.lines().last().and_then(|line| line.trim().parse().ok()).unwrap_or(0);
    Ok(Outcome { status, stdout: output.stdout, stderr: output.stderr, peak_kib })
}

/// Status, message, memory, and what was said.
fn ended_well(case: &HuntCase, outcome: &Outcome) -> Vec<String> {
    let said = String::from_utf8_lossy(&outcome.stderr);
    let first = said.lines().next().unwrap_or_default();
    let all: u64 = (outcome.stdout.len() + outcome.stderr.len()) as u64;
    let one_message = match outcome.status {
        2 | 3 => said.lines().any(|line| line.starts_with("error: ") || line.starts_with("refused: ")),
        _ => true,
    };
    let checks = [
        (matches!(outcome.status, 0..=3), format!("ended with {}: {first}", outcome.status)),
        (!said.contains("a defect of this program"), format!("a defect: {said}")),
        (one_message, format!("an error without a message: {said}")),
        (
            outcome.status < 2 || outcome.stderr.len() <= MESSAGE_BYTES,
            format!("a message of {} bytes", outcome.stderr.len()),
        ),
        (outcome.peak_kib > 0 && outcome.peak_kib < PEAK_KIB, format!("took {} MiB", outcome.peak_kib >> 10)),
        (all < OUTPUT_BYTES, format!("said {all} bytes")),
        (
            control(&outcome.stdout).is_none(),
            format!("a control character on standard output: {:?}", control(&outcome.stdout)),
        ),
        (
            control(&outcome.stderr).is_none(),
            format!("a control character on standard error: {:?}", control(&outcome.stderr)),
        ),
        (
            // The JSON of an error quotes the value; a corrected log repeats the cells that it does not correct.
            outcome.status > 1
                || case.args.first().is_some_and(|command| command == "compensate")
                || no_number(&outcome.stdout).is_none(),
            format!("no number on standard output: {:?}", no_number(&outcome.stdout)),
        ),
    ];
    checks.into_iter().filter(|(good, _)| !good).map(|(_, what)| what).collect()
}

/// Inputs as they were; after an error nothing new; in what was written no raw control character and no figure that is none.
fn files_are_sound(
    case: &HuntCase,
    before: &BTreeMap<String, [u8; 32]>,
    after: &BTreeMap<String, [u8; 32]>,
    outcome: &Outcome,
    folder: &Path,
) -> Result<Vec<String>> {
    let mut wrong = Vec::new();
    for name in before.iter().filter(|(name, hash)| after.get(*name) != Some(hash)).map(|(name, _)| name) {
        wrong.push(format!("the input {name} was changed"));
    }
    for name in after.keys().filter(|name| !before.contains_key(*name)) {
        if !matches!(outcome.status, 0 | 1) {
            wrong.push(format!("status {}, and yet {name} was written", outcome.status));
        }
        if !case.outputs.iter().any(|output| name.starts_with(output)) {
            wrong.push(format!("{name} was written, which nobody asked for"));
        }
        let bytes = fs::read(folder.join(name))?;
        if [".json", ".html", ".csv", ".h", ".c", ".v"].iter().any(|end| name.ends_with(end)) {
            wrong.extend(control(&bytes).map(|at| format!("a control character in {name}: {at:?}")));
        }
        if [".json", ".html"].iter().any(|end| name.ends_with(end)) {
            wrong.extend(no_number(&bytes).map(|at| format!("no number in {name}: {at:?}")));
        }
        if name.ends_with(".html") && !bytes.ends_with(b"</html>") && !bytes.ends_with(b"</html>\n") {
            wrong.push(format!("{name} has no end"));
        }
    }
    Ok(wrong)
}

/// What was written as a record, an image or a table can be read.
fn read_back(
    program: &Program,
    folder: &Path,
    before: &BTreeMap<String, [u8; 32]>,
    after: &BTreeMap<String, [u8; 32]>,
) -> Result<Vec<String>> {
    let mut wrong = Vec::new();
    for name in after.keys().filter(|name| !before.contains_key(*name)) {
        if ["out.json", "out.img", "windows.parquet"].contains(&name.as_str()) {
            let back = run(program, folder, &["inspect".to_owned(), name.clone()])?;
            let said = String::from_utf8_lossy(&back.stderr);
            if back.status != 0 {
                wrong.push(format!("{name} was written and cannot be read: {}", said.trim()));
            }
        }
    }
    Ok(wrong)
}

/// Every file of a folder, with the hash of its content.
fn contents(folder: &Path) -> Result<BTreeMap<String, [u8; 32]>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_file() {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            all.insert(name, sha256(&fs::read(&path)?));
        }
    }
    Ok(all)
}

/// The surroundings of the first control character that is no end of a line or tab.
fn control(bytes: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(bytes);
    let is_control = |c: char| (c.is_control() && !['\n', '\t'].contains(&c)) || ('\u{202a}'..='\u{202e}').contains(&c);
    let at = text.find(is_control)?;
    Some(text[at..].chars().take(12).collect())
}

/// The surroundings of the first word that stands for no number.
fn no_number(bytes: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(bytes);
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    for (at, word) in ["NaN", "inf", "-inf", "Infinity", "nan"].iter().flat_map(|word| text.match_indices(word)) {
        let [before, after] = [text[..at].chars().next_back(), text[at + word.len()..].chars().next()];
        if !before.is_some_and(is_word) && !after.is_some_and(is_word) {
            let from = text[..at].char_indices().rev().nth(30).map_or(0, |(from, _)| from);
            return Some(text[from..].chars().take(60).collect());
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    /// Problems of a program that is this shell script.
    fn problems(script: &str) -> Vec<String> {
        let tools = tempfile::tempdir().unwrap();
        let program = tools.path().join("sagnac");
        fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("log.csv"), "time_s\n").unwrap();
        let case =
            HuntCase { number: 0, kind: "test", args: vec!["calibrate".into()], files: vec![], outputs: vec!["out"] };
        judge(&case, &Program::at(&program), folder.path()).unwrap().1
    }

    #[test]
    fn a_run_as_it_should_be_has_no_problem() {
        assert_eq!(problems("[ $1 = inspect ] || echo '{}' > out.json; echo done"), Vec::<String>::new());
        assert_eq!(problems("echo 'error: log.csv: empty' >&2; exit 2"), Vec::<String>::new());
    }

    #[test]
    fn each_rule_notices_its_break() {
        for (script, what) in [
            ("kill -SEGV $$", "ended with"),
            ("exit 101", "ended with 101"),
            ("while :; do :; done", "ended with"),
            ("echo 'error: a defect of this program' >&2; exit 2", "a defect"),
            ("exit 2", "without a message"),
            ("printf 'error: %09000d\\n' 1 >&2; exit 2", "a message of"),
            ("head -c 400000000 /dev/zero | tail -c 390000000 | wc -c", "took"),
            ("printf 'a\\033[31m'", "on standard output"),
            ("printf 'error: a\\007\\n' >&2; exit 2", "on standard error"),
            ("echo 'sigma NaN deg/h'", "no number on standard output"),
            ("echo 'from -inf to 3'", "no number on standard output"),
            ("echo x >> log.csv", "the input log.csv was changed"),
            ("rm log.csv", "the input log.csv was changed"),
            ("echo x > out.json; echo error: no >&2; exit 2", "and yet out.json was written"),
            ("echo x > .tmp123", "which nobody asked for"),
            ("printf 'a\\001' > out.csv", "a control character in out.csv"),
            ("echo '{\"x\": NaN}' > out.json", "no number in out.json"),
            ("echo '<html>' > out.html", "has no end"),
            (
                "[ $1 = inspect ] && echo error: damaged >&2 && exit 2; echo x > out.json",
                "cannot be read: error: damaged",
            ),
        ] {
            let found = problems(script);
            assert!(found.iter().any(|problem| problem.contains(what)), "{script}: {found:?}");
        }
    }

    #[test]
    fn words_that_hold_the_letters_are_no_numbers_either() {
        assert_eq!(no_number("information, finance, nano, _inf_".as_bytes()), None);
        assert_eq!(no_number("σ inf °/h".as_bytes()).as_deref(), Some("σ inf °/h"));
    }
}
