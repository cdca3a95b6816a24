//! On a terminal of 60 to 200 columns no line is longer than the terminal, and no number is broken. `script` of util-linux is the terminal.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Stdio};

use tempfile::TempDir;

/// What a person sees of a command on a terminal with so many columns, and its exit status.
fn on_a_terminal(folder: &Path, columns: usize, arguments: &str) -> String {
    on_a_terminal_with(folder, columns, "", arguments)
}

/// The same behind `env …`.
fn on_a_terminal_with(folder: &Path, columns: usize, environment: &str, arguments: &str) -> String {
    let program = env!("CARGO_BIN_EXE_sagnac");
    let line = format!("stty cols {columns} rows 40; {environment} {program} {arguments}");
    let output = Command::new("script")
        .args(["-qefc", &line, "/dev/null"])
        .current_dir(folder)
        // Styled help would count its escapes as columns; a machine of CI styles on a dumb terminal too.
        .env("TERM", "dumb")
        .env("NO_COLOR", "1")
        .stdin(Stdio::null())
        .output()
        .expect("script of util-linux");
    String::from_utf8_lossy(&output.stdout).replace('\r', "")
}

fn chamber(name: &str) -> String {
    format!("{}/../../testdata/chamber/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn every_command_fits_terminals_of_60_to_200_columns() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for name in ["cycle-1.csv.gz", "retest.csv.gz", "bench.toml", "limits.toml"] {
        std::fs::copy(chamber(name), at.join(name)).unwrap();
    }
    let commands = [
        "calibrate cycle-1.csv.gz --setup bench.toml --model 'bias 3, rate 0' -o a.json",
        "calibrate retest.csv.gz --setup bench.toml --tradeoff -o b.json",
        "export a.json --to image -o a.img",
        "verify a.json retest.csv.gz --limits limits.toml",
        "verify a.img retest.csv.gz --limits navigation-grade",
        "compare a.json b.json --limits navigation-grade",
        "inspect cycle-1.csv.gz --setup bench.toml",
        "inspect a.img",
        "inspect a.json",
        "allan cycle-1.csv.gz --setup bench.toml",
        "evaluate a.json --at -40,0,70",
        "verify a.json",
        "verify --help",
        "calibrate cycle-1.csv.gz --setup bench.toml --model 'bias 3, rate 0, bias(a_name_that_is_not_there - another) 1'",
    ];
    for columns in [60, 80, 100, 133, 200] {
        for command in commands {
            let shown = on_a_terminal(at, columns, command);
            assert!(shown.lines().count() > 0, "{command}");
            // A hash is a single word, and so is what clap repeats of a command.
            let fits = |line: &&str| line.chars().count() <= columns || !line.trim().contains(' ');
            let over: Vec<&str> = shown.lines().filter(|line| !fits(line)).collect();
            assert!(over.is_empty(), "{columns}, {command}: {over:#?}");
        }
    }
    // A pipe gets each line whole.
    let whole = assert_cmd::Command::cargo_bin("sagnac").unwrap().current_dir(at).args(["inspect", "a.json"]).output();
    let whole = whole.unwrap();
    // A terminal shows notes next to it.
    let whole = String::from_utf8([whole.stdout, whole.stderr].concat()).unwrap();
    assert!(whole.lines().any(|line| line.chars().count() > 100), "{whole}");
    // The words are the same, but for the rules of tables.
    let words = |text: &str| -> Vec<String> {
        let mut all: Vec<String> =
            text.split(|c: char| c.is_whitespace() || c == '─').filter(|w| !w.is_empty()).map(str::to_owned).collect();
        all.sort();
        all
    };
    for columns in [100, 133, 200] {
        assert_eq!(words(&on_a_terminal(at, columns, "inspect a.json")), words(&whole), "{columns}");
    }
}

/// `-h` of every command fits a screen; what it leaves out is in `--help`, which it names.
#[test]
fn the_short_help_of_a_command_fits_a_screen() {
    let folder = TempDir::new().unwrap();
    let program = on_a_terminal(folder.path(), 100, "-h");
    let commands: Vec<&str> = program
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(commands.len() >= 16, "{commands:?}");
    for command in commands.into_iter().filter(|command| *command != "help") {
        let short = on_a_terminal(folder.path(), 100, &format!("{command} -h"));
        assert!(short.lines().count() <= 32, "{command}: {} lines\n{short}", short.lines().count());
        let all = on_a_terminal(folder.path(), 100, &format!("{command} --help"));
        assert!(all.lines().count() == short.lines().count() || short.contains("see more with '--help'"), "{command}");
    }
}

/// A verdict has a colour unless NO_COLOR is set; a locale without UTF-8 gets ASCII, a file and a pipe neither.
#[test]
fn a_verdict_is_in_colour_and_plain_where_the_terminal_is() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for name in ["cycle-1.csv.gz", "retest.csv.gz", "bench.toml", "limits.toml"] {
        std::fs::copy(chamber(name), at.join(name)).unwrap();
    }
    on_a_terminal(at, 100, "calibrate cycle-1.csv.gz --setup bench.toml --model 'bias 3, rate 0' -o a.json");
    let verify = "verify a.json retest.csv.gz --limits limits.toml";
    let coloured = on_a_terminal_with(at, 100, "env -u NO_COLOR LC_ALL=C.UTF-8", verify);
    assert!(
        coloured.contains("RLG-0001: \u{1b}[1;32mACCEPTED\u{1b}[0m - 3 limits met") && coloured.contains('…'),
        "{coloured}"
    );
    let plain = on_a_terminal_with(at, 100, "env LC_ALL=C", verify);
    assert!(plain.contains("RLG-0001: ACCEPTED - 3 limits met") && plain.contains("<= 1.10"), "{plain}");
    assert!(plain.is_ascii() && !plain.contains('\u{1b}'), "{plain}");
    let piped =
        assert_cmd::Command::cargo_bin("sagnac").unwrap().current_dir(at).args(verify.split(' ')).output().unwrap();
    let piped = String::from_utf8(piped.stdout).unwrap();
    assert!(piped.contains("≤ 1.10") && !piped.contains('\u{1b}'), "{piped}");
}
