//! Commands in the README and in `docs/` are run, and what a page shows is what they print.
//!
//! ```text
//! ```console            $ a command in a shell, > its further lines, then its output: run and compared
//! ```toml file=NAME     a file that the commands below it read: written first
//! ```sh                 commands that need what is not here: each `sagnac …` must be one that the program can parse
//! ```
//!
//! Each page has an empty folder of its own with links to `testdata` and `scenarios` and a folder `target`; pages whose
//! names begin with a digit are steps, and go through one folder in their order.
//! `SAGNAC_WRITE_DOCS=1` writes the outputs anew into the pages.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The README and every page of the book, with what it holds.
fn pages() -> Vec<(PathBuf, String)> {
    let mut paths = vec![root().join("README.md")];
    let mut folders = vec![root().join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ext| ext == "md") {
                paths.push(path);
            }
        }
    }
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

/// A fenced block: the words behind its fence, where its text begins in the page, and the text.
struct Block<'a> {
    info: Vec<&'a str>,
    start: usize,
    text: &'a str,
}

fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(fence) = page[at..].find("```").map(|n| at + n) {
        let start = fence + page[fence..].find('\n').expect("a fence is a line") + 1;
        let end = start + page[start..].find("```").expect("a block has an end");
        let info = page[fence + 3..start].split_whitespace().collect();
        found.push(Block { info, start, text: &page[start..end] });
        at = end + 3;
    }
    found
}

/// The commands of a console block, each with the output that the page shows.
fn commands(block: &str) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    for line in block.lines() {
        if let Some(command) = line.strip_prefix("$ ") {
            found.push((command.to_owned(), String::new()));
            continue;
        }
        let (command, output) = found.last_mut().expect("a console block begins with a command");
        match line.strip_prefix("> ").or((line == ">").then_some("")) {
            Some(more) if output.is_empty() => *command += &format!("\n{more}"),
            _ => *output += &format!("{line}\n"),
        }
    }
    found
}

/// Where a page's commands run.
struct Workplace(TempDir);

impl Workplace {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        fs::create_dir(folder.path().join("target")).unwrap();
        for name in ["testdata", "scenarios"] {
            std::os::unix::fs::symlink(root().canonicalize().unwrap().join(name), folder.path().join(name)).unwrap();
        }
        Self(folder)
    }

    /// The command in a shell: both outputs in the order in which they came.
    fn run(&self, command: &str) -> Output {
        let programs = Path::new(env!("CARGO_BIN_EXE_sagnac")).parent().unwrap().display();
        let path = std::env::var("PATH").unwrap_or_default();
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!("exec 2>&1\n{command}")).current_dir(self.0.path());
        shell.env("PATH", format!("{programs}:{path}")).env("LC_ALL", "C.UTF-8").env_remove("SOURCE_DATE_EPOCH");
        shell.output().unwrap()
    }
}

/// Without blanks at the end of lines and empty lines at the end.
fn trimmed(text: &str) -> String {
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

/// The page as the program would have it; else the command that failed.
fn made_anew(workplace: &Workplace, page: &str) -> Result<String, String> {
    let (mut out, mut copied) = (String::new(), 0);
    for block in blocks(page) {
        if let Some(name) = block.info.iter().find_map(|word| word.strip_prefix("file=")) {
            fs::write(workplace.0.path().join(name), block.text).unwrap();
        }
        if block.info.first() != Some(&"console") {
            continue;
        }
        out += &page[copied..block.start];
        for (command, _) in commands(block.text) {
            let output = workplace.run(&command);
            let printed = trimmed(&String::from_utf8_lossy(&output.stdout));
            if !output.status.success() {
                return Err(format!("fails: {command}\n{printed}"));
            }
            out += &format!("$ {}\n", command.replace('\n', "\n> "));
            if !printed.is_empty() {
                out += &format!("{printed}\n");
            }
        }
        copied = block.start + block.text.len();
    }
    Ok(out + &page[copied..])
}

/// Pages with examples: each alone, steps together.
fn groups() -> Vec<Vec<(PathBuf, String)>> {
    let is_step =
        |path: &Path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(char::is_numeric));
    let mut groups: Vec<Vec<(PathBuf, String)>> = Vec::new();
    for (path, page) in pages().into_iter().filter(|(_, page)| page.contains("```console\n")) {
        match groups.last_mut() {
            Some(group) if is_step(&path) && is_step(&group[0].0) && path.parent() == group[0].0.parent() => {
                group.push((path, page));
            }
            _ => groups.push(vec![(path, page)]),
        }
    }
    groups
}

/// What is wrong with each page of a group; `SAGNAC_WRITE_DOCS` writes stale outputs anew instead.
fn findings(group: Vec<(PathBuf, String)>) -> Vec<String> {
    let workplace = Workplace::new();
    let mut found = Vec::new();
    for (path, page) in group {
        match made_anew(&workplace, &page) {
            Err(failure) => found.push(format!("{}: {failure}", path.display())),
            Ok(anew) if anew == page => {}
            Ok(anew) if std::env::var_os("SAGNAC_WRITE_DOCS").is_some() => fs::write(&path, anew).unwrap(),
            Ok(anew) => found.push(format!("{}:{}", path.display(), first_difference(&page, &anew))),
        }
    }
    found
}

/// Line, what the page shows there, and what the program prints.
fn first_difference(page: &str, anew: &str) -> String {
    let mut lines = page.lines().zip(anew.lines()).enumerate();
    let shorter = page.lines().count().min(anew.lines().count());
    let (at, (shown, printed)) =
        lines.find(|(_, (shown, printed))| shown != printed).unwrap_or((shorter, ("(ends)", "(ends)")));
    format!("{}\n  shows  {shown}\n  prints {printed}", at + 1)
}

#[test]
fn pages_show_what_the_program_prints() {
    let groups = groups();
    assert!(
        groups.len() > 4 && groups.iter().any(|group| group.len() > 4),
        "the README, the tutorial, some of the how-to"
    );
    let threads: Vec<_> = groups.into_iter().map(|group| std::thread::spawn(move || findings(group))).collect();
    let found: Vec<String> = threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect();
    let help = "SAGNAC_WRITE_DOCS=1 cargo test -p sagnac-cli --test pages writes the outputs anew";
    assert!(found.is_empty(), "{}\n{help}", found.join("\n"));
}

/// With `--help` behind it a command is parsed up to there and does nothing; a flag that is not there fails.
#[test]
fn commands_on_pages_can_be_parsed() {
    let workplace = Workplace::new();
    let mut parsed = 0;
    for (path, page) in pages() {
        for block in blocks(&page).iter().filter(|block| block.info.first() == Some(&"sh")) {
            let joined = block.text.replace("\\\n", " ");
            for line in joined.lines().filter(|line| line.starts_with("sagnac ")) {
                let command = line.split(['|', '>', '<', '#', '&', ';']).next().unwrap_or(line);
                let output = workplace.run(&format!("{} --help", command.split("        (").next().unwrap_or(command)));
                let said = String::from_utf8_lossy(&output.stdout);
                assert!(output.status.success(), "{}: {line}\n{said}", path.display());
                parsed += 1;
            }
        }
    }
    assert!(parsed > 30, "{parsed} commands");
    assert!(!workplace.run("sagnac calibrate log.csv --no-such-flag --help").status.success());
}

#[test]
fn blocks_and_commands_are_found() {
    let page = "a\n```console\n$ one \\\n> two\nout\n> no command\n$ three\n```\n```toml file=x.toml\nk = 1\n```\n";
    let blocks = blocks(page);
    assert_eq!(
        (blocks[0].info.as_slice(), blocks[1].info.as_slice()),
        (&["console"][..], &["toml", "file=x.toml"][..])
    );
    let expected = [("one \\\ntwo", "out\n> no command\n"), ("three", "")];
    assert_eq!(commands(blocks[0].text), expected.map(|(command, output)| (command.to_owned(), output.to_owned())));
}
