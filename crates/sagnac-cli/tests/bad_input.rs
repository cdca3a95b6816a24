//! Broken inputs, made here: each ends with the documented status, one message that names the place, and
//! leaves what was there untouched. The snapshot holds every message in one file, and docs/reference/errors.md is made
//! of it (`cargo xtask errors`).
//!
//! SAGNAC_KEEP_CORPUS=FOLDER keeps the files.

mod corpus;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use corpus::{Case, Feed, cases};
use tempfile::TempDir;

/// Address space a run may use: a log is never held in memory.
const MEMORY_KIB: u64 = 600_000;
const OLD: &str = "what was there before\n";

struct Outcome {
    status: i32,
    stderr: String,
}

/// Runs a case in its own folder.
fn run(case: &Case, folder: &Path) -> Outcome {
    let program = folder.join("sagnac");
    let limited = format!("ulimit -v {MEMORY_KIB}; exec \"$0\" \"$@\"");
    let mut command = if case.as_nobody && is_root() {
        let mut command = Command::new("setpriv");
        command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "sh", "-c", &limited]);
        command
    } else {
        let mut command = Command::new("sh");
        command.args(["-c", &limited]);
        command
    };
    command.arg(program).args(&case.args).current_dir(folder).env_remove("SOURCE_DATE_EPOCH");
    command.stdin(if matches!(case.stdin, Feed::Nothing) { Stdio::null() } else { Stdio::piped() });
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    if let (Feed::Endless(block, times), Some(mut stdin)) = (&case.stdin, child.stdin.take()) {
        // The program goes away long before the end.
        let _ = (0..*times).try_for_each(|_| stdin.write_all(block));
    }
    let output = child.wait_with_output().unwrap();
    Outcome { status: output.status.code().unwrap_or(-1), stderr: String::from_utf8(output.stderr).unwrap() }
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|out| out.stdout == b"0\n")
}

fn copy_program(folder: &Path) {
    use std::os::unix::fs::PermissionsExt;
    let program = folder.join("sagnac");
    std::fs::copy(env!("CARGO_BIN_EXE_sagnac"), &program).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// What is wrong with how a case ended: one message and at most one help; the old output is what it was; nothing
/// else was left.
fn problems(case: &Case, folder: &Path, before: &[String], outcome: &Outcome) -> Vec<String> {
    let stderr = &outcome.stderr;
    let word = if case.status == 3 { "refused: " } else { "error: " };
    let lines: Vec<&str> = stderr.lines().collect();
    let first = lines.first().copied().unwrap_or_default();
    let helps = lines.iter().filter(|line| line.starts_with("  help: ")).count();
    let old = std::fs::read_to_string(folder.join("out.json")).unwrap_or_default();
    let checks = [
        (outcome.status == case.status, format!("status {} instead of {}", outcome.status, case.status)),
        (first.starts_with(word), format!("does not begin with {word:?}")),
        ((lines.len() == 1 + helps && helps <= 1) || case.usage, "more than one message".to_owned()),
        (case.place.is_none_or(|place| first.contains(place)), format!("does not name {:?}", case.place)),
        (old == OLD, "the old output is gone".to_owned()),
        (listing(folder) == before, format!("left {:?}", listing(folder))),
    ];
    let failed = checks.into_iter().filter(|(good, _)| !good);
    failed.map(|(_, what)| format!("{}: {what}: {}", case.name, stderr.trim())).collect()
}

fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn every_broken_input_is_told_by_name_and_place() {
    let (mut all, mut wrong) = (String::new(), Vec::new());
    let cases = cases();
    assert!(cases.len() >= 50, "{} cases", cases.len());
    for (number, case) in cases.iter().enumerate() {
        assert!(cases[..number].iter().all(|other| other.name != case.name), "two cases named {}", case.name);
        let folder = TempDir::new().unwrap();
        copy_program(folder.path());
        std::fs::write(folder.path().join("out.json"), OLD).unwrap();
        case.make(folder.path());
        if let Some(kept) = std::env::var_os("SAGNAC_KEEP_CORPUS") {
            keep(folder.path(), &Path::new(&kept).join(case.name.replace(' ', "-")));
        }
        let before = listing(folder.path());
        let outcome = run(case, folder.path());
        wrong.extend(problems(case, folder.path(), &before, &outcome));
        writeln!(
            all,
            "# {}\n$ sagnac {}\nstatus {}\n{}",
            case.name,
            case.args.join(" "),
            outcome.status,
            outcome.stderr
        )
        .unwrap();
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let snapshots = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/snapshots");
    insta::with_settings!({ snapshot_path => snapshots, prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::assert_snapshot!("bad_input", all);
    });
}

fn keep(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for name in listing(from).iter().filter(|name| *name != "sagnac" && *name != "out.json") {
        if from.join(name).is_file() {
            // A file that nobody may read cannot be kept either.
            let _ = std::fs::copy(from.join(name), to.join(name));
        }
    }
}
