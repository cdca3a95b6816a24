//! `sagnac manual`: shell completions, man pages and docs/reference/cli.md, made from the program itself.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::builder::StyledStr;
use clap::{Arg, ArgAction, Command, ValueEnum};
use clap_complete::{Generator, Shell};
use sagnac::{Error, Result};
use sagnac_core::Status;
use sagnac_log::ingest::Reason;
use sagnac_log::ingest::header::HEADERS;
use sagnac_log::setup::{BenchSetup, PollColumn, Setup};
use sagnac_log::write::write_bytes;
use serde_json::Value;

use crate::files::named::{Use, use_of};
use crate::output::console::{Console, Outcome, Ran};

/// Print completions for a shell, a man page, or the manual as Markdown
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac manual bash > /etc/bash_completion.d/sagnac
  sagnac manual man --output /usr/local/share/man/man1")]
pub(crate) struct Args {
    /// What to print
    #[arg(value_enum)]
    what: ManualForm,
    /// With `man`: write a page for the program and one for each command into this folder
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// Forms of the manual.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ManualForm {
    Bash,
    Zsh,
    Fish,
    Powershell,
    Elvish,
    Man,
    Markdown,
}

/// The page of a command and those of its own, each whole.
fn write_pages(command: &Command, folder: &Path) -> Result<()> {
    let page = clap_mangen::Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text).map_err(|e| Error::io_path(folder, "write", &e))?;
    write_bytes(&folder.join(page.get_filename()), &text)?;
    command.get_subcommands().filter(|own| !own.is_hide_set()).try_for_each(|own| write_pages(own, folder))
}

pub(crate) fn run(args: &Args, mut program: Command, console: &mut Console) -> Ran {
    program.set_bin_name("sagnac");
    if let Some(folder) = &args.output {
        if args.what != ManualForm::Man {
            return Err(Error::input(
                "only man pages are written to a folder",
                "redirect the others: sagnac manual markdown > sagnac.md",
            )
            .column("--output"));
        }
        std::fs::create_dir_all(folder).map_err(|e| Error::io_path(folder, "make", &e))?;
        program = program.disable_help_subcommand(true);
        program.build();
        write_pages(&program, folder)?;
        console.say(format!("wrote man pages to {}", folder.display()));
        return Ok(Outcome::Done);
    }
    program.build();
    let text = match args.what {
        ManualForm::Bash => completions(Shell::Bash, &program)?,
        ManualForm::Zsh => completions(Shell::Zsh, &program)?,
        ManualForm::Fish => completions(Shell::Fish, &program)?,
        ManualForm::Powershell => completions(Shell::PowerShell, &program)?,
        ManualForm::Elvish => completions(Shell::Elvish, &program)?,
        ManualForm::Man => rendered(|out| clap_mangen::Man::new(program.clone()).render(out))?,
        ManualForm::Markdown => markdown(&mut program)?,
    };
    console.say(text.trim_end());
    Ok(Outcome::Done)
}

fn completions(shell: Shell, program: &Command) -> Result<String> {
    rendered(|mut out| shell.try_generate(program, &mut out))
}

fn rendered(fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<String> {
    let mut bytes = Vec::new();
    fill(&mut bytes).map_err(|e| Error::io("the manual", "write", &e))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// docs/reference/cli.md.
fn markdown(program: &mut Command) -> Result<String> {
    let mut out =
        String::from("# Command line\n\nMade by `sagnac manual markdown`; do not edit.\n\n| command | |\n|---|---|\n");
    let names = shown(program);
    for command in program.get_subcommands().filter(|command| names.iter().any(|name| name == command.get_name())) {
        out += &format!("| [`{0}`](#sagnac-{0}) | {1} |\n", command.get_name(), plain(command.get_about()));
    }
    out += EXIT_STATUS;
    out += FILES;
    out += &files(program, "");
    for name in names {
        if let Some(command) = program.find_subcommand_mut(&name) {
            out += &section(command, "##");
        }
    }
    out += "\n## Flags over the setup\n\nOf every command that reads logs; each overrides the key of its name in bench.toml.\n\n";
    out += "| argument | |\n|---|---|\n";
    let with_setup = program.get_subcommands().find(|command| command.get_arguments().any(is_setup));
    for arg in with_setup.iter().flat_map(|command| command.get_arguments()).filter(|arg| is_setup(arg)) {
        out += &format!("| `{}` | {} |\n", form(arg), meaning(arg));
    }
    out += LOGS;
    out += "| header | the column holds |\n|---|---|\n";
    HEADERS.iter().for_each(|(form, meaning)| out += &format!("| `{form}` | {meaning} |\n"));
    out += "\nOther headers are not read, unless `[columns]` maps them. A known quantity with an unknown unit is refused.\n";
    out += "\n## bench.toml\n\nWhat a log cannot say of itself. Flags of the same names override the file; `verify` and `compensate` take \
            all of it from the calibration unless overridden. Unknown keys are refused.\n\n";
    out += &keys(&schema_of::<Setup>()?)?;
    out += "\n## \\[bench\\] in bench.toml\n\nHow `sagnac bench` records a test; no record holds it. `[[bench.poll]]` is an instrument, an entry of its \
            `columns` a column.\n\n";
    out += &keys(&schema_of::<BenchSetup>()?)?;
    out += "\nA column of an instrument:\n\n";
    out += &keys(&schema_of::<PollColumn>()?)?;
    out += "\n## limits.toml\n\n[limits.md](limits.md) lists the keys of a limits file.\n";
    out += "\n## Why rows and windows are excluded\n\n| reason | what it means |\n|---|---|\n";
    Reason::ALL.iter().for_each(|r| out += &format!("| `{}` | {} |\n", r.name(), r.meaning()));
    out += "\n## Status of corrected rows\n\nThe words of the `status` column, joined by `|`; `OK` for none of them: ";
    out += &Status::NAMES.map(|(_, name)| format!("`{name}`")).join(", ");
    out += ". Each is explained in [arithmetic.md](../explanation/arithmetic.md).\n";
    Ok(out)
}

const EXIT_STATUS: &str = "
Exit status: 0 done (verify: passed, or no limits given), 1 limits not met, 2 bad usage or input, 3 refused because the data
cannot support the answer, 130 after Ctrl-C. [errors.md](errors.md) lists the messages.

Every command takes `-v` (everything) and `-q` (errors alone). The short result of `calibrate`, `verify`, `allan`, `compare` and `fleet report` fits 15 lines of
100 columns for up to three axes; long messages wrap there. A verdict has a colour on a terminal without `NO_COLOR`.

With `--json` one object goes to standard output and the text to standard error; an error is
`{\"refused\", \"reason\", \"place\": {\"file\", \"line\", \"column\", \"value\"}, \"help\"}`; only errors in flags are always text. A read that
takes over a second shows its progress, only on a terminal. Files are replaced
whole or not at all. If the reader of a pipe closes it, the program ends without a message.
";

const FILES: &str = "
## Files

What each command reads and writes. It refuses an output that is one of its inputs, by any spelling, link or pattern, before it begins; and it
replaces no file that it opened as an input.

| command | reads | writes |
|---|---|---|
";

/// A row for each command whose arguments name files.
fn files(command: &Command, words: &str) -> String {
    let cell = |wanted: &[Use]| {
        let named = command.get_arguments().filter(|arg| use_of(words, arg).is_some_and(|used| wanted.contains(&used)));
        named.map(|arg| format!("`{}`", form(arg))).collect::<Vec<_>>().join(", ")
    };
    let (reads, writes) = (cell(&[Use::Reads]), cell(&[Use::Writes, Use::WritesInto, Use::Figures]));
    let mut out = String::new();
    if !(reads.is_empty() && writes.is_empty()) {
        out += &format!("| `{words}` | {reads} | {writes} |\n");
    }
    for own in command.get_subcommands().filter(|own| !own.is_hide_set() && own.get_name() != "help") {
        out += &files(own, format!("{words} {}", own.get_name()).trim());
    }
    out
}

const LOGS: &str = "
## Logs

| format | |
|---|---|
| text | comma, tab or semicolon (the latter two also with decimal comma); byte-order mark, CRLF, `#` comments, quoted fields within a line; UTF-8 |
| Parquet, Arrow (file or stream) | numbers, booleans, text and Arrow's own times, by the column's name; a null is an empty field; Parquet with snappy, gzip, zstd, lz4 or none, Arrow with lz4, zstd or none |
| PX4 ULog | a row per message of `sensor_gyro`, else `sensor_combined`, of `--instance`; its own temperature and those of other sensors |
| gzip of any of these, `-` | unpacked; standard input |

Times are numbers in the unit of the header, or dates of ISO 8601. Rows that cannot be used are excluded, with the reason and the first
place; `compensate` does not write them either. Its text begins with a line `# sagnac compensated …` (for pandas: `comment='#'`). Two logs are
the same log only if they have the same bytes: an unpacked or converted copy is another log.

The format is recognised by the first bytes, not by the name. A file is a run, or continues the run of the file before
([runs](../how-to/map-my-csv.md#files-and-runs)). Rows of binary formats are numbered as lines of the same table in text: the first is line 2. The first
line of text names the columns:

";

fn plain(text: Option<&StyledStr>) -> String {
    text.map_or(String::new(), ToString::to_string)
}

/// The names of a command's own commands, without those that are hidden.
fn shown(command: &Command) -> Vec<String> {
    let shown = command.get_subcommands().filter(|command| command.get_name() != "help" && !command.is_hide_set());
    shown.map(|command| command.get_name().to_owned()).collect()
}

/// One command: what it does, its arguments, its examples; then the commands below it.
fn section(command: &mut Command, heading: &str) -> String {
    let usage = command.render_usage().to_string().replace("Usage: ", "");
    let about = command.get_long_about().or(command.get_about()).map_or(String::new(), ToString::to_string);
    let mut out = format!(
        "\n{heading} {}\n\n{}\n\n```text\n{}\n```\n",
        command.get_bin_name().unwrap_or_default(),
        about.trim(),
        usage.trim()
    );
    let mut arguments = command
        .get_arguments()
        .filter(|arg| arg.get_id() != "help" && !arg.is_global_set() && !is_setup(arg))
        .peekable();
    if arguments.peek().is_some() {
        out += "\n| argument | |\n|---|---|\n";
    }
    for arg in arguments {
        out += &format!("| `{}` | {} |\n", form(arg), meaning(arg));
    }
    if command.get_arguments().any(is_setup) {
        out += "| and the [flags over the setup](#flags-over-the-setup) | |\n";
    }
    if let Some(examples) = command.get_after_long_help().or(command.get_after_help()) {
        let examples = examples.to_string();
        let lines: Vec<&str> = examples.lines().skip(1).map(str::trim_start).collect();
        out += &format!("\n```sh\n{}\n```\n", lines.join("\n"));
    }
    for name in shown(command) {
        if let Some(below) = command.find_subcommand_mut(&name) {
            out += &section(below, "###");
        }
    }
    out
}

/// True for the flags that every command with a log has.
fn is_setup(arg: &Arg) -> bool {
    arg.get_help_heading().is_some_and(|heading| heading.starts_with("What the log"))
}

/// `-o, --output <FILE>`.
fn form(arg: &Arg) -> String {
    let names = [arg.get_short().map(|s| format!("-{s}")), arg.get_long().map(|l| format!("--{l}"))];
    let names: Vec<String> = names.into_iter().flatten().collect();
    let takes_value = matches!(arg.get_action(), ArgAction::Set | ArgAction::Append);
    // A bar would end the cell of a table.
    let values = arg.get_value_names().unwrap_or_default().join(" ").replace('|', "\\|");
    match (names.is_empty(), takes_value) {
        (true, _) => format!("<{values}>"),
        (false, true) => format!("{} <{values}>", names.join(", ")),
        (false, false) => names.join(", "),
    }
}

fn meaning(arg: &Arg) -> String {
    let mut out = plain(arg.get_long_help().or(arg.get_help())).replace("\n\n", ". ");
    let possible: Vec<String> = arg.get_possible_values().iter().map(|v| format!("`{}`", v.get_name())).collect();
    if !possible.is_empty() && matches!(arg.get_action(), ArgAction::Set) {
        out += &format!(" ({})", possible.join(", "));
    }
    let defaults: Vec<String> = arg.get_default_values().iter().map(|v| format!("`{}`", v.to_string_lossy())).collect();
    if !defaults.is_empty() && matches!(arg.get_action(), ArgAction::Set) && !out.contains("by default") {
        out += &format!("; {} by default", defaults.join(", "));
    }
    out.replace('|', "\\|")
}

fn schema_of<T: schemars::JsonSchema>() -> Result<Value> {
    serde_json::to_value(schemars::schema_for!(T)).map_err(|e| Error::defect(format!("cannot describe the keys: {e}")))
}

/// Keys of a file with their meaning, those of its sub-tables too.
fn keys(schema: &Value) -> Result<String> {
    let mut out = String::from("| key | meaning |\n|---|---|\n");
    let none = || Error::defect("a schema without properties");
    for (key, property) in schema["properties"].as_object().ok_or_else(none)? {
        out += &format!("| `{key}` | {} |\n", description(property));
        let Some(table) = table_of(schema, property) else { continue };
        for (inner, property) in table["properties"].as_object().ok_or_else(none)? {
            out += &format!("| `{key}.{inner}` | {} |\n", description(property));
        }
    }
    Ok(out)
}

fn description(property: &Value) -> String {
    property["description"].as_str().unwrap_or_default().replace('\n', " ").replace('|', "\\|")
}

/// The sub-table that a property refers to, alone or in a list.
fn table_of<'a>(schema: &'a Value, property: &'a Value) -> Option<&'a Value> {
    let either = property["anyOf"].as_array().into_iter().flatten();
    let candidates = either.chain([property, &property["items"]]);
    let name = candidates.filter_map(|c| c["$ref"].as_str()).find_map(|r| r.strip_prefix("#/$defs/"))?;
    Some(&schema["$defs"][name]).filter(|table| table["properties"].is_object())
}
