//! Messages of the program on broken inputs. Each case of the corpus must end with the documented status and one message
//! that names the place, within 256 MiB, and must not change existing files; otherwise the page is not written.

use std::fs;
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use tempfile::{NamedTempFile, TempDir};

use crate::corpus::{Case, Feed, cases};
use crate::made::Made;
use crate::places::ERRORS;
use crate::program::Program;

/// Limit on the address space of a run: a log is never held in memory. With one arena: the C library reserves 64 MiB of addresses for each, and
/// which threads get one is a matter of timing.
const MEMORY_KIB: u64 = 600_000;
/// Largest resident set of a run with the default budget.
const PEAK_KIB: u64 = 256 << 10;
const OLD: &str = "what was there before\n";
/// Files in every case's folder.
const OURS: [&str; 2] = ["sagnac", "out.json"];

const HEAD: &str = "# Error messages for broken inputs

Made by `cargo xtask bless`; do not edit. Every input of the table is made and run. A message states what is wrong, where (file, line,
column, value) and, if there is a remedy, what to do. Status 2: bad usage or input. Status 3: refused, because the data cannot
support the answer. Existing files are never changed by a command that fails. Each run took less than 256 MiB of memory.

| input | status | message |
|---|---|---|
";

/// How a case ended.
struct Outcome {
    status: i32,
    stderr: String,
    peak_kib: u64,
}

/// One table, in the order of the corpus.
pub(crate) fn make(program: &Program) -> Result<Vec<Made>> {
    let cases = cases(program)?;
    ensure!(cases.len() >= 50, "{} cases", cases.len());
    let (mut page, mut wrong) = (String::from(HEAD), Vec::new());
    for (number, case) in cases.iter().enumerate() {
        ensure!(cases[..number].iter().all(|other| other.name != case.name), "two cases named {}", case.name);
        let folder = prepared(case, program)?;
        let before = listing(folder.path())?;
        let outcome = run(case, folder.path()).with_context(|| case.name)?;
        wrong.extend(problems(case, folder.path(), &before, &outcome)?);
        page += &row(case, &outcome);
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(vec![Made::new(ERRORS, page)])
}

/// Writes the files of every case into a folder of its own: the seeds of fuzzing.
pub(crate) fn keep(program: &Program, to: &Path) -> Result<()> {
    for case in cases(program)? {
        let from = TempDir::new()?;
        case.make(from.path())?;
        let to = to.join(case.name.replace(' ', "-"));
        fs::create_dir_all(&to)?;
        for name in listing(from.path())?.iter().filter(|name| from.path().join(name).is_file()) {
            // A file without read permission cannot be copied.
            let _ = fs::copy(from.path().join(name), to.join(name));
        }
    }
    Ok(())
}

/// A folder with the program, an older output, and the files of the case.
fn prepared(case: &Case, program: &Program) -> Result<TempDir> {
    let folder = TempDir::new()?;
    // Readable by everyone: some cases run as the user nobody.
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755))?;
    let [sagnac, output] = OURS.map(|name| folder.path().join(name));
    fs::copy(program.path(), &sagnac).with_context(|| format!("cannot copy {}", program.path().display()))?;
    fs::set_permissions(&sagnac, fs::Permissions::from_mode(0o755))?;
    fs::write(output, OLD)?;
    case.make(folder.path()).with_context(|| case.name)?;
    Ok(folder)
}

/// Runs a case in its own folder.
fn run(case: &Case, folder: &Path) -> Result<Outcome> {
    let peak = NamedTempFile::new()?;
    // A case may run as another user.
    fs::set_permissions(peak.path(), fs::Permissions::from_mode(0o666))?;
    let limited = format!(
        "ulimit -v {MEMORY_KIB}; export MALLOC_ARENA_MAX=1; exec /usr/bin/time -f %M -o {} \"$0\" \"$@\"",
        peak.path().display()
    );
    let mut command = if case.as_nobody && is_root() {
        let mut command = Command::new("setpriv");
        command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "sh", "-c", &limited]);
        command
    } else {
        let mut command = Command::new("sh");
        command.args(["-c", &limited]);
        command
    };
    command.arg(folder.join("sagnac")).args(&case.args).current_dir(folder).env_remove("SOURCE_DATE_EPOCH");
    command.stdin(if matches!(case.stdin, Feed::Nothing) { Stdio::null() } else { Stdio::piped() });
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()?;
    if let (Feed::Endless(block, times), Some(mut stdin)) = (&case.stdin, child.stdin.take()) {
        // The program ends long before its input does.
        let _ = (0..*times).try_for_each(|_| stdin.write_all(block));
    }
    let output = child.wait_with_output()?;
    let measured = fs::read_to_string(peak.path())?;
    let peak_kib = measured.lines().last().and_then(|line| line.trim().parse().ok());
    let peak_kib = peak_kib.context("no peak from /usr/bin/time; on Debian: apt-get install time")?;
    Ok(Outcome { status: output.status.code().unwrap_or(-1), stderr: String::from_utf8(output.stderr)?, peak_kib })
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|out| out.stdout == b"0\n")
}

/// Deviations from the expected result: one message and at most one help; the old output unchanged; no other file
/// written.
fn problems(case: &Case, folder: &Path, before: &[String], outcome: &Outcome) -> Result<Vec<String>> {
    let stderr = &outcome.stderr;
    let word = if case.status == 3 { "refused: " } else { "error: " };
    let lines: Vec<&str> = stderr.lines().collect();
    let first = lines.first().copied().unwrap_or_default();
    let helps = lines.iter().filter(|line| line.starts_with("  help: ")).count();
    let old = fs::read_to_string(folder.join("out.json")).unwrap_or_default();
    let after = listing(folder)?;
    let checks = [
        (outcome.status == case.status, format!("status {} instead of {}", outcome.status, case.status)),
        (first.starts_with(word), format!("does not begin with {word:?}")),
        ((lines.len() == 1 + helps && helps <= 1) || case.usage, "more than one message".to_owned()),
        (case.place.is_none_or(|place| first.contains(place)), format!("does not name {:?}", case.place)),
        (old == OLD, "the old output was changed".to_owned()),
        (after == before, format!("left {after:?}")),
        (outcome.peak_kib < PEAK_KIB, format!("took {} MiB", outcome.peak_kib >> 10)),
    ];
    let failed = checks.into_iter().filter(|(good, _)| !good);
    Ok(failed.map(|(_, what)| format!("{}: {what}: {}", case.name, stderr.trim())).collect())
}

fn listing(folder: &Path) -> Result<Vec<String>> {
    let names = fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut names: Vec<String> = names.collect::<Result<_>>()?;
    names.sort();
    Ok(names)
}

fn row(case: &Case, outcome: &Outcome) -> String {
    let lines = outcome.stderr.lines().filter(|line| !line.is_empty());
    let message: Vec<String> = lines.map(|line| line.trim().replace('|', "\\|").replace('<', "&lt;")).collect();
    format!("| {} | {} | {} |\n", case.name, outcome.status, message.join("<br>"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corpus::example;

    /// Problems of a run that changed no file, with this status and message.
    fn ended(status: i32, stderr: &str) -> Vec<String> {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("out.json"), OLD).unwrap();
        let outcome = Outcome { status, stderr: stderr.to_owned(), peak_kib: 20_000 };
        problems(&example(), folder.path(), &["out.json".to_owned()], &outcome).unwrap()
    }

    #[test]
    fn a_case_must_end_with_its_status_and_one_message_that_names_the_place() {
        assert_eq!(ended(2, "error: log.csv: empty\n  help: rows\n"), Vec::<String>::new());
        for (status, stderr, problem) in [
            (3, "error: log.csv: empty\n", "status 3 instead of 2"),
            (2, "log.csv: empty\n", "does not begin with"),
            (2, "error: log.csv: empty\nerror: again\n", "more than one message"),
            (2, "error: empty\n", "does not name"),
        ] {
            let problems = ended(status, stderr);
            assert!(problems.len() == 1 && problems[0].contains(problem), "{problems:?}");
        }
    }

    #[test]
    fn a_changed_output_a_file_more_and_much_memory_are_noticed() {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("out.json"), "new").unwrap();
        fs::write(folder.path().join("more"), "").unwrap();
        let outcome = Outcome { status: 2, stderr: "error: log.csv\n".to_owned(), peak_kib: PEAK_KIB };
        let problems = problems(&example(), folder.path(), &["out.json".to_owned()], &outcome).unwrap();
        assert!(
            problems.len() == 3
                && ["was changed", "more", "took 256 MiB"]
                    .iter()
                    .zip(&problems)
                    .all(|(what, found)| found.contains(what)),
            "{problems:?}"
        );
    }
}
