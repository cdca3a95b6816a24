//! `sagnac init`: looks at a log and writes a setup for it, each guess marked.
//!
//! Columns are found by their names and units, in English, German, French and Spanish; a unit that is not stated is guessed from the
//! values. Dates are a time, and so is a column that a schema calls one. What no log can say (size of a count, input rate, serial number) stays open: it is never guessed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use sagnac_log::ingest::header::{Role, role_of};
use sagnac_log::ingest::names::{
    RATE, RATE_UNITS, TEMPERATURE, TEMPERATURE_UNITS, TIME, TIME_UNITS, axis_of, recognised, stated, thermometer_of,
    words_of,
};
use sagnac_log::ingest::{Sample, SampleColumn, sample};
use sagnac_log::setup::ThermometerSetup;
use sagnac_log::write::write_bytes;
use sagnac_units::format::{counted, file_name, one_line};

use crate::files::Files;
use crate::output::console::{Console, Outcome, Ran};
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
        Files::new().reads([&self.log]).writes(&self.output).check()?;
        let text = setup_of(&file_name(&self.log.display().to_string()), &sample(&self.log)?);
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

/// What a column is for, and how sure that is.
struct Guess {
    /// Header of Sagnac.
    role: String,
    /// What of it is not stated in the log.
    guessed: Vec<String>,
}

const COUNTS: [&str; 17] = [
    "counts",
    "count",
    "cnt",
    "cnts",
    "pulses",
    "pulse",
    "puls",
    "impulse",
    "fringes",
    "fringe",
    "impulsions",
    "pulsos",
    "counter",
    "zähler",
    "zaehler",
    "compteur",
    "contador",
];
const FLAG: [&str; 3] = ["valid", "ok", "gueltig"];

/// Units of a time that Sagnac does not read: rounded to a few digits, they do not give the length of a row.
const UNREAD_TIME_UNITS: [&str; 22] = [
    "min", "mins", "minute", "minutes", "minuten", "minutos", "h", "hr", "hrs", "hour", "hours", "std", "stunde",
    "stunden", "heure", "heures", "hora", "horas", "days", "tage", "jours", "dias",
];
/// The setup as text.
fn setup_of(name: &str, sample: &Sample) -> String {
    let guesses = guesses_of(&sample.columns);
    let mut out = format!(
        "# Made by `sagnac init` from {}. Lines with GUESS are to be checked; what no log can say is left open.\n",
        one_line(name)
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
        let sampled = "# sample_interval_s = 1.0\n";
        out += &format!("\n# NEEDED: no column of time was found. The length of a row, s:\n{sampled}");
    }
    if !is("temperature") {
        out += "\n# No column of temperature was found: noise can be measured from this log, drift over temperature cannot.\n";
    }
    if !is("counts") && !is("rate") {
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

/// The interval of the rows by a column of times, s.
fn row_s(column: &SampleColumn, role: &str) -> Option<f64> {
    match role_of(role) {
        Ok(Role::Time { .. }) if column.is_dates() => median_step(&column.dates_s()),
        Ok(Role::Time { places: places @ ..=9 }) => {
            Some(median_step(&column.numbers())? * 10_f64.powi(places as i32 - 9))
        }
        _ => None,
    }
}

/// The median of the steps forward.
fn median_step(times: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
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
            Some(Guess { role, guessed }) if guessed.is_empty() => format!("{header} = \"{role}\"\n"),
            Some(Guess { role, guessed }) => {
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

/// Largest time that a log can hold, s.
const MOST_TIME_S: f64 = 4.6e9;

/// What each column is: as the reader recognises it, else a guess.
fn guesses_of(columns: &[SampleColumn]) -> Vec<Option<Guess>> {
    let of = |text: fn(&SampleColumn) -> String| columns.iter().map(text).collect::<Vec<_>>();
    let units = of(|column| column.unit.clone().unwrap_or_default());
    let cells = of(|column| column.cells.first().cloned().unwrap_or_default());
    let sure = recognised(&of(|column| column.header.clone()), &units, &cells, &BTreeMap::new());
    let mut used: BTreeSet<String> = sure.iter().flatten().map(|role| kind_of(role)).collect();
    let one = |(column, role): (&SampleColumn, Option<String>)| match role {
        Some(role) => Some(Guess { role, guessed: Vec::new() }),
        None => guess(column, &mut used).map(|guess| next_to_others(column, guess)),
    };
    columns.iter().zip(sure).map(one).collect()
}

/// A role that the reader does not give at once is a guess, however plain the header: other columns may be the same.
fn next_to_others(column: &SampleColumn, mut guess: Guess) -> Guess {
    let is_sure = guess.role == column.header || guess.role == "ignore" || column.is_dates();
    if guess.guessed.is_empty() && !is_sure {
        guess.guessed.push("other columns are of this quantity too".to_owned());
    }
    guess
}

/// What a column is; `None` where nothing says it. No role is given twice.
fn guess(column: &SampleColumn, used: &mut BTreeSet<String>) -> Option<Guess> {
    let header = &column.header;
    // Under these names without a unit a log holds dates.
    let is_of_dates = ["time", "timestamp", "datetime"].contains(&header.to_lowercase().as_str());
    let is_known = matches!(role_of(header), Ok(role) if role != Role::Ignored) && column.unit.is_none();
    if is_known && (!is_of_dates || column.is_dates()) && used.insert(kind_of(header)) {
        return Some(Guess { role: header.clone(), guessed: Vec::new() });
    }
    let (words, bracket) = words_of(header);
    let unit = column.unit.clone().or(bracket);
    let has = |names: &[&str]| words.iter().any(|word| names.contains(&word.as_str()));
    let first = words.first().map_or("", String::as_str);
    let (is_by_letter, axis) = axis_of(unit.as_deref(), &words);
    // A `t` that only rises is the time, alone or with a unit of time; any other, and one with a place behind it, is a temperature.
    let is_t = first == "t";
    let of_time = || words.len() == 1 || stated(unit.as_deref(), &words, TIME_UNITS).is_some();
    let rises = || column.numbers().windows(2).all(|pair| pair[1] > pair[0]);
    let guess = if column.is_dates() || has(&TIME) || is_t && of_time() && rises() {
        time(column, unit.as_deref(), &words)
    } else if has(&TEMPERATURE) || is_t {
        Some(temperature(column, unit.as_deref(), &words))
    } else if has(&COUNTS) {
        Some(Guess { role: format!("counts{axis}"), guessed: vec!["by its name".to_owned()] })
    } else if (has(&RATE) || is_by_letter) && !column.numbers().is_empty() {
        rate(column, unit.as_deref(), &words, &axis)
    } else if has(&FLAG) {
        Some(Guess { role: "valid".to_owned(), guessed: vec!["by its name".to_owned()] })
    } else {
        by_unit(column, unit.as_deref().or_else(|| behind_blank(header))?, &words, &axis)
    }?;
    (guess.role == "ignore" || used.insert(kind_of(&guess.role))).then_some(guess)
}

/// What a column is whose name says nothing, by its unit.
fn by_unit(column: &SampleColumn, unit: &str, words: &[String], axis: &str) -> Option<Guess> {
    let guess = if stated(Some(unit), &[], TEMPERATURE_UNITS).is_some() {
        temperature(column, Some(unit), words)
    } else if stated(Some(unit), &[], RATE_UNITS).is_some() {
        rate(column, Some(unit), words, axis)?
    } else if COUNTS.contains(&unit.to_lowercase().as_str()) {
        Guess { role: format!("counts{axis}"), guessed: Vec::new() }
    } else {
        return None;
    };
    Some(Guess { guessed: vec![format!("by its unit, {unit}")], ..guess })
}

/// The last word of a header, which may be a unit: `Chamber °C`. One letter alone names a channel as often.
fn behind_blank(header: &str) -> Option<&str> {
    let (_, last) = header.trim_end().rsplit_once(char::is_whitespace)?;
    (last.chars().count() > 1).then_some(last)
}

/// What a log has once: a role, or the time as a number in whatever unit. Dates may stand next to such a time.
fn kind_of(role: &str) -> String {
    if role.starts_with("time_") { "time_".to_owned() } else { role.to_owned() }
}

fn time(column: &SampleColumn, unit: Option<&str>, words: &[String]) -> Option<Guess> {
    if column.is_dates() {
        return Some(Guess { role: "time".to_owned(), guessed: Vec::new() });
    }
    let numbers = column.numbers();
    if let Some(ending) = stated(unit, words, TIME_UNITS) {
        return Some(Guess { role: format!("time_{ending}"), guessed: Vec::new() });
    }
    let named = || words.iter().map(String::as_str).find(|word| UNREAD_TIME_UNITS.contains(word));
    if let Some(unit) = unit.or_else(named) {
        return Some(Guess {
            role: "ignore".to_owned(),
            guessed: vec![format!("a time in {unit} is not read; convert it to seconds")],
        });
    }
    let step = median_step(&numbers)?;
    // Rows of a log are between half a millisecond and ten minutes apart, and its times less than two centuries from zero.
    let farthest = numbers.iter().fold(0.0_f64, |most, time| most.max(time.abs()));
    let is_of = |per_s: f64| step <= 600.0 * per_s && farthest <= MOST_TIME_S * per_s;
    let ending = [("s", 1.0), ("ms", 1e3), ("us", 1e6)].into_iter().find(|(_, per_s)| is_of(*per_s));
    let ending = ending.map_or("ns", |(ending, _)| ending);
    Some(Guess { role: format!("time_{ending}"), guessed: vec![format!("the unit, from rows that are {step} apart")] })
}

fn temperature(column: &SampleColumn, unit: Option<&str>, words: &[String]) -> Guess {
    let known = stated(unit, words, TEMPERATURE_UNITS);
    if let (None, Some(unit)) = (known, unit) {
        return Guess {
            role: "ignore".to_owned(),
            guessed: vec![format!("a temperature in {unit} is not read; convert it to °C")],
        };
    }
    let mut sorted = column.numbers();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let guessed = if middle > 200.0 { "k" } else { "c" };
    let ending = known.unwrap_or(guessed);
    let name = thermometer_of(words);
    let why = if known.is_none() { vec![format!("the unit, from values near {middle}")] } else { Vec::new() };
    Guess { role: format!("temperature_{ending}{name}"), guessed: why }
}

fn rate(column: &SampleColumn, unit: Option<&str>, words: &[String], axis: &str) -> Option<Guess> {
    if let Some(ending) = stated(unit, words, RATE_UNITS) {
        return Some(Guess { role: format!("rate_{ending}{axis}"), guessed: Vec::new() });
    }
    if unit.is_some() {
        return None;
    }
    let mut sizes: Vec<f64> = column.numbers().iter().map(|rate| rate.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let middle = sizes[sizes.len() / 2];
    // At rest a gyro sees the Earth at most: 15 °/h, 0.0042 °/s or 73 µrad/s, with its own bias.
    let ending = match middle {
        middle if middle < 1e-3 => "radps",
        middle if middle < 1.0 => "dps",
        _ => "dph",
    };
    Some(Guess {
        role: format!("rate_{ending}{axis}"),
        guessed: vec![format!("the unit, from rates near {middle}: check it")],
    })
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
