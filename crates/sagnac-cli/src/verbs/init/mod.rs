//! `sagnac init`: looks at a log and writes a setup for it, each guess marked.
//!
//! Columns are found by their names and units, in English, German, French and Spanish; a unit that is not stated is guessed from the
//! values. Dates are a time, and so is a column that a schema calls one. What no log can say (size of a count, input rate, serial number) stays open: it is never guessed.

mod clocks;
mod guesses;
mod values;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use sagnac_log::ingest::header::{Role, role_of};
use sagnac_log::ingest::{Sample, SampleColumn, sample};
use sagnac_log::setup::ThermometerSetup;
use sagnac_log::write::write_bytes;
use sagnac_units::format::{counted, file_name, one_line};

use crate::output::console::{Console, Outcome, Ran};
use crate::verbs::init::clocks::MendedClock;
use crate::verbs::init::guesses::{Guess, Guesses, guesses_of, row_s};
use crate::verbs::verb::Verb;

/// Write a commented setup file for a log
///
/// Asks nothing. Marks each guess with GUESS, and leaves a blank for anything the log cannot tell.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac init cycle-1.csv -o bench.toml && sagnac calibrate cycle-1.csv --setup bench.toml --arcsec-per-count 1.059 -o unit.cal.json")]
pub(crate) struct Args {
    /// Log: CSV, tab- or semicolon-separated, Parquet, Arrow or ULog, also gzipped
    log: PathBuf,
    /// Setup to write; standard output by default
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        let text = setup_of(&self.log, &sample(&self.log)?);
        match &self.output {
            None => console.say(text.trim_end()),
            Some(path) => {
                write_bytes(path, text.as_bytes())?;
                let lines = |mark: &str| text.lines().filter(|line| line.contains(mark)).count();
                // The head names the mark too.
                let guesses = counted(lines("GUESS").saturating_sub(1), "guess", "guesses");
                let needed = match lines("# NEEDED") {
                    0 => String::new(),
                    n => format!(", {} to fill in: see NEEDED", counted(n, "value", "values")),
                };
                console.say(format!("wrote {}: {guesses}{needed}", path.display()));
            }
        }
        Ok(Outcome::Done)
    }
}

/// The setup as text.
fn setup_of(log: &Path, sample: &Sample) -> String {
    let Guesses { columns: guesses, open_rates } = guesses_of(sample);
    let mut out = format!(
        "# Made by `sagnac init` from {}. Lines with GUESS are to be checked; what no log can say is left open.\n",
        one_line(&file_name(&log.display().to_string()))
    );
    if sample.above > 0 {
        out += &format!("# The headers are in line {}.\n", sample.header_line);
    }
    for assumed in &sample.assumed {
        out += &format!("# {}.\n", one_line(assumed));
    }
    out += "\n# serial = \"\"            # serial number of the gyro: needed for an image\n# sensor = \"\"            # what it is, in words\n# rig = \"\"               # chamber, table, site\n";
    let is = |prefix: &str| guesses.iter().flatten().any(|guess| guess.role.starts_with(prefix));
    if is("counts") {
        out += "\n# NEEDED: the nominal size of a count, arcsec. No log can say it.\n# arcsec_per_count = 1.0\n";
        out += &counter(&sample.columns, &guesses);
    }
    if !is("time") {
        let mended =
            MendedClock::of(sample).map_or(String::new(), |clock| format!("\n# {}", named_in(&clock.mended, log)));
        out += &format!(
            "\n# NEEDED: no column of time was found. The length of a row, s:\n# sample_interval_s = 1.0{mended}\n"
        );
    }
    if !is("temperature") {
        out += "\n# No column of temperature was found: noise can be measured from this log, drift over temperature cannot.\n";
    }
    if let Some(why) = open_rates {
        out += &format!(
            "\n# NEEDED: the unit of the rates: {why}.\n# Map them below: rate_dph is °/h, rate_dps °/s, rate_radps rad/s.\n"
        );
    } else if !is("counts") && !is("rate") {
        out += "\n# NEEDED: no column of counts or rates was found. Map one below.\n";
    }
    out += &input_rate(&guesses);
    out + &columns(&sample.columns, &guesses) + &slow_thermometers(&sample.columns, &guesses)
}

/// How long readings hold, of thermometers that are read in few of the rows: one and a half times their interval, as the log reader has it.
fn slow_thermometers(all: &[SampleColumn], guesses: &[Option<Guess>]) -> String {
    let Some(row_s) = all.iter().zip(guesses).find_map(|(column, guess)| row_s(column, &guess.as_ref()?.role)) else {
        return String::new();
    };
    let mut out = String::new();
    for (column, guess) in all.iter().zip(guesses) {
        let Some(Ok(Role::Temperature { name, .. })) = guess.as_ref().map(|guess| role_of(&guess.role)) else {
            continue;
        };
        let apart_s = (1e3 * column.rows_apart().unwrap_or(0) as f64 * row_s).round() / 1e3;
        let hold_s = (1.5 * apart_s).ceil();
        if hold_s > ThermometerSetup::named(&name).stale_after_s {
            out += &format!(
                "\n[[thermometer]]\nname = {}\nstale_after_s = {hold_s}   # GUESS: its readings are {apart_s} s apart\n",
                quoted(&name)
            );
        }
    }
    out
}

/// A command with the log's name, where a shell takes it as it is.
fn named_in(command: &str, log: &Path) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+".contains(c);
    let name = log.to_str().filter(|name| name.chars().all(is_plain)).unwrap_or("log.csv");
    command.replace("'IN'", &format!("'{name}'")).replace("'OUT'", &format!("'{name}.csv'"))
}

/// The line of the input rate, with the letters of the axes where there are several.
fn input_rate(guesses: &[Option<Guess>]) -> String {
    let axis_of = |guess: &Guess| match role_of(&guess.role) {
        Ok(Role::Counts { axis } | Role::Rate { axis, .. }) => axis,
        _ => None,
    };
    let axes: BTreeSet<char> = guesses.iter().flatten().filter_map(axis_of).collect();
    let each: Vec<String> = axes.iter().map(|axis| format!("{axis} = 0.0")).collect();
    let (value, of) =
        if each.len() > 1 { (format!("{{ {} }}", each.join(", ")), "each") } else { ("0.0".to_owned(), "the") };
    format!("\n# input_rate_dph = {value}     # input rate along {of} axis during the test, °/h, for the fixed bias\n")
}

/// The mapping of the columns.
fn columns(all: &[SampleColumn], guesses: &[Option<Guess>]) -> String {
    let mut out = String::from("\n[columns]\n");
    for (column, guess) in all.iter().zip(guesses).filter(|(column, _)| !column.header.is_empty()) {
        let (header, cell) = (quoted(&column.header), column.cells.iter().find(|cell| !cell.is_empty()));
        let example = cell.map_or(String::new(), |cell| format!(" (first: {})", one_line(cell)));
        out += &match guess {
            Some(guess) if guess.role == column.header && guess.guessed.is_empty() => {
                format!("# {header} is read as it is\n")
            }
            Some(Guess { role, unread: Some(why), .. }) => {
                format!("{header} = \"{role}\"   # {}{example}\n", one_line(why))
            }
            Some(Guess { role, guessed, .. }) if guessed.is_empty() => format!("{header} = \"{role}\"\n"),
            Some(Guess { role, guessed, .. }) => {
                format!("{header} = \"{role}\"   # GUESS: {}{example}\n", guessed.join("; "))
            }
            None => format!("{header} = \"ignore\"   # not known; \"aux_name\" makes it an input{example}\n"),
        };
    }
    out
}

/// Moves in one direction, with none in the other, that are no noise.
const FEWEST_MOVES: usize = 16;

/// Whether a column of counts is a running total, and its smallest step.
fn counter(all: &[SampleColumn], guesses: &[Option<Guess>]) -> String {
    let is_counts = |guess: &Option<Guess>| guess.as_ref().is_some_and(|guess| guess.role.starts_with("counts"));
    let Some((column, _)) = all.iter().zip(guesses).find(|(_, guess)| is_counts(guess)) else { return String::new() };
    let numbers = column.numbers();
    let steps: Vec<f64> = numbers.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let spread = steps.iter().map(|step| (step - mean).abs()).fold(0.0, f64::max);
    let count = |moves: fn(&&f64) -> bool| steps.iter().filter(moves).count();
    let (rises, falls) = (count(|step| **step > 0.0), count(|step| **step < 0.0));
    // By about as much each, or, of a slow gyro with many rows alike, so often that noise would have gone the other way.
    let goes_on = steps.len() > 2 && mean.abs() > spread || rises.max(falls) >= FEWEST_MOVES;
    let mut out = String::new();
    if rises.min(falls) == 0 && goes_on {
        out += "counter = \"cumulative\"   # GUESS: rows differ in one direction only\n";
    }
    let fraction =
        |quantum: f64| numbers.iter().all(|count| ((count / quantum).round() * quantum - count).abs() < 1e-9);
    if !fraction(1.0)
        && let Some(quantum) = [0.5, 0.25, 0.125, 0.1, 0.01].into_iter().find(|quantum| fraction(*quantum))
    {
        out += &format!("quantum = {quantum}   # GUESS: every count is a multiple of it\n");
    }
    out
}

/// A key of TOML.
fn quoted(header: &str) -> String {
    let escaped: String = header
        .chars()
        .flat_map(|c| match c {
            '"' | '\\' => vec!['\\', c],
            c if c.is_control() => format!("\\u{:04X}", u32::from(c)).chars().collect(),
            c => vec![c],
        })
        .collect();
    format!("\"{escaped}\"")
}
