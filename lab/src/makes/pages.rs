//! Runs the commands in the README and in `docs/` and writes their output into the pages.
//!
//! ```text
//! ```console            $ a command in a shell, > its further lines, then its output: run and compared
//! ```toml file=NAME     a file that the commands below it read: written first
//! ```sh                 commands that need missing files or tools: the program must be able to parse each `sagnac …`
//! ```
//!
//! Each page runs in its own folder with links to `testdata` and `scenarios` and an empty folder `target`. Pages whose names
//! begin with a digit are steps: they share one folder and run in order.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhow::{Context, Result, anyhow, bail, ensure};
use tempfile::TempDir;
use xtask::shell::{root, text};

use crate::made::Made;
use crate::places::{DOCS, README};
use crate::program::Program;

/// A page of the project.
struct Page {
    /// Relative to the workspace.
    path: PathBuf,
    text: String,
}

/// The README and every page of the book.
fn pages() -> Result<Vec<Page>> {
    let mut paths = vec![PathBuf::from(README)];
    let mut folders = vec![PathBuf::from(DOCS)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root().join(&folder))? {
            let path = folder.join(entry?.file_name());
            if root().join(&path).is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ext| ext == "md") {
                paths.push(path);
            }
        }
    }
    paths.sort();
    let page = |path: PathBuf| {
        let text = fs::read_to_string(root().join(&path)).with_context(|| format!("cannot read {}", path.display()))?;
        Ok(Page { path, text })
    };
    paths.into_iter().map(page).collect()
}

/// A fenced block: the words after its fence, the offset of its text in the page, and the text.
struct Block<'a> {
    info: Vec<&'a str>,
    start: usize,
    text: &'a str,
}

fn blocks(page: &str) -> Result<Vec<Block<'_>>> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(fence) = page[at..].find("```").map(|n| at + n) {
        let start = fence + page[fence..].find('\n').context("a fence that is no line")? + 1;
        let end = start + page[start..].find("```").context("a block without an end")?;
        let info = page[fence + 3..start].split_whitespace().collect();
        found.push(Block { info, start, text: &page[start..end] });
        at = end + 3;
    }
    Ok(found)
}

/// The commands of a console block, each with the output that the page shows.
fn commands(block: &str) -> Result<Vec<(String, String)>> {
    let mut found: Vec<(String, String)> = Vec::new();
    for line in block.lines() {
        if let Some(command) = line.strip_prefix("$ ") {
            found.push((command.to_owned(), String::new()));
            continue;
        }
        let (command, output) = found.last_mut().context("a console block that does not begin with a command")?;
        match line.strip_prefix("> ").or((line == ">").then_some("")) {
            Some(more) if output.is_empty() => *command += &format!("\n{more}"),
            _ => *output += &format!("{line}\n"),
        }
    }
    Ok(found)
}

/// The folder in which a page's commands run.
struct Workplace {
    folder: TempDir,
    /// The program's folder comes first.
    path: String,
}

impl Workplace {
    fn new(program: &Program) -> Result<Self> {
        let folder = TempDir::new()?;
        fs::create_dir(folder.path().join("target"))?;
        for name in ["testdata", "scenarios"] {
            std::os::unix::fs::symlink(root().canonicalize()?.join(name), folder.path().join(name))?;
        }
        let programs = program.path().parent().context("a program without a folder")?.canonicalize()?;
        let path = format!("{}:{}", text(&programs)?, std::env::var("PATH").unwrap_or_default());
        Ok(Self { folder, path })
    }

    /// Runs the command in a shell; returns both outputs in the order in which they were printed.
    fn run(&self, command: &str) -> Result<Output> {
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!("exec 2>&1\n{command}")).current_dir(self.folder.path());
        shell.env("PATH", &self.path).env("LC_ALL", "C.UTF-8").env_remove("SOURCE_DATE_EPOCH");
        shell.output().context("cannot start sh")
    }
}

/// Without blanks at the end of lines and empty lines at the end.
fn trimmed(text: &str) -> String {
    text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n").trim_end().to_owned()
}

/// The page with the current output of its commands; an error names the command that fails.
fn made_anew(workplace: &Workplace, page: &str) -> Result<String> {
    let (mut out, mut copied) = (String::new(), 0);
    for block in blocks(page)? {
        if let Some(name) = block.info.iter().find_map(|word| word.strip_prefix("file=")) {
            fs::write(workplace.folder.path().join(name), block.text)?;
        }
        if block.info.first() != Some(&"console") {
            continue;
        }
        out += &page[copied..block.start];
        for (command, _) in commands(block.text)? {
            let output = workplace.run(&command)?;
            let printed = trimmed(&String::from_utf8_lossy(&output.stdout));
            ensure!(output.status.success(), "fails: {command}\n{printed}");
            out += &format!("$ {}\n", command.replace('\n', "\n> "));
            if !printed.is_empty() {
                out += &format!("{printed}\n");
            }
        }
        copied = block.start + block.text.len();
    }
    Ok(out + &page[copied..])
}

/// Groups of pages: each page by itself, the steps of a folder together.
fn groups(pages: Vec<Page>) -> Vec<Vec<Page>> {
    let is_step =
        |path: &Path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(char::is_numeric));
    let mut groups: Vec<Vec<Page>> = Vec::new();
    for page in pages.into_iter().filter(|page| page.text.contains("```console\n")) {
        match groups.last_mut() {
            Some(group)
                if is_step(&page.path) && is_step(&group[0].path) && page.path.parent() == group[0].path.parent() =>
            {
                group.push(page);
            }
            _ => groups.push(vec![page]),
        }
    }
    groups
}

/// The pages of a group with the program's present output.
fn group_anew(program: &Program, group: &[Page]) -> Result<Vec<Made>> {
    let workplace = Workplace::new(program)?;
    let anew = |page: &Page| {
        let text = made_anew(&workplace, &page.text).with_context(|| page.path.display().to_string())?;
        Ok(Made::new(page.path.display().to_string(), text))
    };
    group.iter().map(anew).collect()
}

pub(crate) fn make(program: &Program) -> Result<Vec<Made>> {
    let groups = groups(pages()?);
    let has_all = groups.len() > 4 && groups.iter().any(|group| group.len() > 4);
    ensure!(has_all, "not the README, the tutorial and some of the how-to: {} groups of pages", groups.len());
    let made: Vec<Result<Vec<Made>>> = std::thread::scope(|scope| {
        let threads: Vec<_> = groups.iter().map(|group| scope.spawn(move || group_anew(program, group))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| Err(anyhow!("a panic, see above")))).collect()
    });
    Ok(made.into_iter().collect::<Result<Vec<_>>>()?.concat())
}

/// Parses each `sagnac …` in the blocks of shell commands that are not run; returns their number.
///
/// With `--help` at its end a command is only parsed; an unknown flag fails.
pub fn parse_commands(program: &Program) -> Result<usize> {
    let workplace = Workplace::new(program)?;
    ensure!(
        !workplace.run("sagnac calibrate log.csv --no-such-flag --help")?.status.success(),
        "an unknown flag is accepted: this check is not effective"
    );
    let mut parsed = 0;
    for page in pages()? {
        for block in blocks(&page.text)?.iter().filter(|block| block.info.first() == Some(&"sh")) {
            let joined = block.text.replace("\\\n", " ");
            for line in joined.lines().filter(|line| line.starts_with("sagnac ")) {
                let command = line.split(['|', '>', '<', '#', '&', ';']).next().unwrap_or(line);
                let command = command.split("        (").next().unwrap_or(command);
                let output = workplace.run(&format!("{command} --help"))?;
                if !output.status.success() {
                    bail!("{}: {line}\n{}", page.path.display(), String::from_utf8_lossy(&output.stdout));
                }
                parsed += 1;
            }
        }
    }
    Ok(parsed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_and_commands_are_found() {
        let page = "a\n```console\n$ one \\\n> two\nout\n> no command\n$ three\n```\n```toml file=x.toml\nk = 1\n```\n";
        let blocks = blocks(page).unwrap();
        assert_eq!(
            (blocks[0].info.as_slice(), blocks[1].info.as_slice()),
            (&["console"][..], &["toml", "file=x.toml"][..])
        );
        let expected = [("one \\\ntwo", "out\n> no command\n"), ("three", "")];
        let expected = expected.map(|(command, output)| (command.to_owned(), output.to_owned()));
        assert_eq!(commands(blocks[0].text).unwrap(), expected);
        assert!(commands("out\n").is_err());
    }

    #[test]
    fn steps_of_a_folder_go_together() {
        let page = |path: &str| Page { path: path.into(), text: "```console\n$ true\n```\n".to_owned() };
        let groups = groups(["README.md", "a/1-x.md", "a/2-y.md", "a/z.md", "b/3-u.md"].map(page).into());
        let sizes: Vec<usize> = groups.iter().map(Vec::len).collect();
        assert_eq!(sizes, [1, 2, 1, 1]);
    }
}
