//! What each column of a log is: as the reader recognises it, else a guess by its name, its unit and its values.
//!
//! Columns of rates without a unit are looked at last and together, because one triad has one unit.

use std::collections::{BTreeMap, BTreeSet};

use sagnac_log::ingest::header::{Role, role_of};
use sagnac_log::ingest::names::{HeaderQuantity, HeaderUnit, Named, recognised};
use sagnac_log::ingest::{Sample, SampleColumn};
use sagnac_log::setup::RateUnit;

use crate::verbs::init::clocks::{MendedClock, is_of_clocks};
use crate::verbs::init::values::{TriadUnit, is_clock, of_rates, of_temperature};

/// What a column is for, and how sure that is.
pub(super) struct Guess {
    /// Header of Sagnac.
    pub(super) role: String,
    /// What of it is not stated in the log.
    pub(super) guessed: Vec<String>,
    /// Why it is not read, although its name is known.
    pub(super) unread: Option<String>,
}

impl Guess {
    fn sure(role: String) -> Self {
        Self { role, guessed: Vec::new(), unread: None }
    }

    fn because(role: String, why: String) -> Self {
        Self { role, guessed: vec![why], unread: None }
    }

    fn unread(why: String) -> Self {
        Self { role: "ignore".to_owned(), guessed: Vec::new(), unread: Some(why) }
    }
}

/// The columns of a log, understood.
pub(super) struct Guesses {
    /// One per column; `None` where nothing says what it is.
    pub(super) columns: Vec<Option<Guess>>,
    /// Why the rates have no unit, if they have none.
    pub(super) open_rates: Option<String>,
}

const FLAG: [&str; 3] = ["valid", "ok", "gueltig"];
/// Units of a time that Sagnac does not read: rounded to a few digits, they do not give the length of a row.
const UNREAD_TIME_UNITS: [&str; 22] = [
    "min", "mins", "minute", "minutes", "minuten", "minutos", "h", "hr", "hrs", "hour", "hours", "std", "stunde",
    "stunden", "heure", "heures", "hora", "horas", "days", "tage", "jours", "dias",
];
/// Largest time that a log can hold, s.
const MOST_TIME_S: f64 = 4.6e9;

/// What each column is.
pub(super) fn guesses_of(sample: &Sample) -> Guesses {
    let columns = &sample.columns;
    let of = |text: fn(&SampleColumn) -> String| columns.iter().map(text).collect::<Vec<_>>();
    let units = of(|column| column.unit.clone().unwrap_or_default());
    let cells = of(|column| column.cells.first().cloned().unwrap_or_default());
    let sure = recognised(&of(|column| column.header.clone()), &units, &cells, &BTreeMap::new());
    let mut used: BTreeSet<String> = sure.iter().flatten().map(|role| kind_of(role)).collect();
    let clock = MendedClock::of(sample);
    let one = |(at, (column, role)): (usize, (&SampleColumn, Option<String>))| match role {
        Some(role) => Some(Guess::sure(role)),
        None if clock.as_ref().is_some_and(|clock| clock.columns.contains(&at)) => {
            Some(Guess::unread("a time that is not read: see NEEDED".to_owned()))
        }
        None => guess(column, &mut used).map(|guess| next_to_others(column, guess)),
    };
    let guesses = columns.iter().zip(sure).enumerate().map(one).collect();
    with_rates(columns, guesses, &mut used)
}

/// A role that the reader does not give at once is a guess, however plain the header: other columns may be the same.
fn next_to_others(column: &SampleColumn, mut guess: Guess) -> Guess {
    let is_sure = guess.role == column.header || guess.role == "ignore" || column.is_dates();
    if guess.guessed.is_empty() && !is_sure {
        guess.guessed.push("other columns are of this quantity too".to_owned());
    }
    guess
}

/// What a column is, other than a rate without a unit; `None` where nothing says it. No role is given twice.
fn guess(column: &SampleColumn, used: &mut BTreeSet<String>) -> Option<Guess> {
    let header = &column.header;
    // Under these names without a unit a log holds dates.
    let is_of_dates = ["time", "timestamp", "datetime"].contains(&header.to_lowercase().as_str());
    let is_known = matches!(role_of(header), Ok(role) if role != Role::Ignored) && column.unit.is_none();
    if is_known && (!is_of_dates || column.is_dates()) && used.insert(kind_of(header)) {
        return Some(Guess::sure(header.clone()));
    }
    if column.is_dates() {
        return used.insert("time".to_owned()).then(|| Guess::sure("time".to_owned()));
    }
    let is_flag = FLAG.contains(&header.to_lowercase().as_str());
    let Some(named) = Named::of(header, column.unit.as_deref()) else {
        let flag = || Guess::because("valid".to_owned(), "by its name".to_owned());
        return (is_flag && used.insert("valid".to_owned())).then(flag);
    };
    // A `t` that only rises is the time; any other is a temperature.
    let is_alone = named.is_letter && named.words.len() == 1 && named.unit == HeaderUnit::Open;
    let is_t = is_alone && named.quantity == HeaderQuantity::Temperature && !used.contains("time_");
    let guess = match named.quantity {
        _ if is_t && is_clock(&column.numbers()) => time(column, &named),
        HeaderQuantity::Time => time(column, &named),
        HeaderQuantity::Temperature => Some(temperature(column, &named)),
        HeaderQuantity::Counts => Some(Guess::because(named.role(""), by_name_or_unit(&named))),
        HeaderQuantity::Rate => match named.unit {
            HeaderUnit::Known(ending) if named.by_unit.is_some() => {
                Some(Guess::because(named.role(ending), by_name_or_unit(&named)))
            }
            HeaderUnit::Known(ending) => Some(Guess::sure(named.role(ending))),
            HeaderUnit::Unread(_) | HeaderUnit::Open => None,
        },
    }?;
    (guess.role == "ignore" || used.insert(kind_of(&guess.role))).then_some(guess)
}

/// What says the quantity of a column.
fn by_name_or_unit(named: &Named) -> String {
    named.by_unit.as_ref().map_or("by its name".to_owned(), |unit| format!("by its unit, {unit}"))
}

/// The same with the columns of rates without a unit.
fn with_rates(columns: &[SampleColumn], mut guesses: Vec<Option<Guess>>, used: &mut BTreeSet<String>) -> Guesses {
    let axis = |(at, column): (usize, &SampleColumn)| {
        let named = Named::of(&column.header, column.unit.as_deref())?;
        let is_open = guesses[at].is_none() && named.quantity == HeaderQuantity::Rate && named.unit == HeaderUnit::Open;
        let numbers = column.numbers();
        let is_ours = is_open && !numbers.is_empty() && matches!(role_of(&column.header), Ok(Role::Ignored) | Err(_));
        is_ours.then_some((at, named, numbers))
    };
    let mut places = BTreeSet::new();
    let known: Vec<(usize, Named, Vec<f64>)> = columns.iter().enumerate().filter_map(axis).collect();
    let open: Vec<(usize, Named, Vec<f64>)> =
        known.into_iter().filter(|(_, named, _)| places.insert(named.place.clone())).collect();
    if open.is_empty() {
        return Guesses { columns: guesses, open_rates: None };
    }
    let stated: Vec<RateUnit> = guesses.iter().flatten().filter_map(|guess| unit_of(&guess.role)).collect();
    let numbers: Vec<Vec<f64>> = open.iter().map(|(.., numbers)| numbers.clone()).collect();
    let row_s = columns.iter().zip(&guesses).find_map(|(column, guess)| row_s(column, &guess.as_ref()?.role));
    let unit = match stated.first() {
        _ if open.iter().all(|(_, named, _)| named.is_letter) && is_gravity(&numbers) => {
            TriadUnit::Open("the columns look like accelerations, of 1 g together".to_owned())
        }
        Some(unit) => TriadUnit::One(*unit, "the unit, as of the other axes".to_owned()),
        None => of_rates(&numbers, row_s, usual_unit(columns, &open)),
    };
    let mut open_rates = None;
    for (at, named, _) in &open {
        guesses[*at] = match &unit {
            TriadUnit::One(unit, why) => {
                let role = named.role(unit.ending());
                let letter = named.is_letter.then(|| "by its letter".to_owned());
                let guessed = letter.into_iter().chain([why.clone()]).collect();
                used.insert(kind_of(&role)).then_some(Guess { role, guessed, unread: None })
            }
            TriadUnit::Open(why) => {
                open_rates = Some(why.clone());
                let roles = ["dph", "dps", "radps"].map(|ending| named.role(ending)).join(", ");
                Some(Guess::unread(format!("a rate, whose unit no value tells: one of {roles}")))
            }
        };
    }
    Guesses { columns: guesses, open_rates }
}

/// Whether three means make 1 g, in g or m/s²: `gx` may be an acceleration.
fn is_gravity(axes: &[Vec<f64>]) -> bool {
    let mean = |axis: &Vec<f64>| axis.iter().sum::<f64>() / axis.len() as f64;
    let size = axes.iter().map(|axis| mean(axis).powi(2)).sum::<f64>().sqrt();
    axes.len() == 3 && [1.0, 9.81].into_iter().any(|gravity: f64| (size / gravity - 1.0).abs() < 0.05)
}

/// The unit of a rate's header.
fn unit_of(role: &str) -> Option<RateUnit> {
    let ending = role.strip_prefix("rate_")?.split('_').next()?;
    RateUnit::of_ending(ending)
}

/// The unit that programs with such headers write: rad/s in ROS (`angular_velocity.x`), of Xsens (`Gyr_X`) and ArduPilot (`GyrX`).
fn usual_unit(columns: &[SampleColumn], open: &[(usize, Named, Vec<f64>)]) -> Option<RateUnit> {
    let is_usual = |(at, named, _): &(usize, Named, Vec<f64>)| {
        let header = &columns[*at].header;
        let has = |word: &str| named.words.iter().any(|other| other == word);
        has("angular") && has("velocity") || ["Gyr_", "Gyr"].iter().any(|start| is_axis_behind(header, start))
    };
    open.iter().all(is_usual).then_some(RateUnit::RadPerSecond)
}

fn is_axis_behind(header: &str, start: &str) -> bool {
    header.strip_prefix(start).is_some_and(|axis| ["X", "Y", "Z"].contains(&axis))
}

/// What a log has once: a role, or the time as a number in whatever unit. Dates may stand next to such a time.
fn kind_of(role: &str) -> String {
    if role.starts_with("time_") { "time_".to_owned() } else { role.to_owned() }
}

fn time(column: &SampleColumn, named: &Named) -> Option<Guess> {
    let numbers = column.numbers();
    let role = |ending: &str| format!("time_{ending}");
    if let HeaderUnit::Known(ending) = named.unit {
        return Some(Guess::sure(role(ending)));
    }
    let word = || named.words.iter().find(|word| UNREAD_TIME_UNITS.contains(&word.as_str())).cloned();
    let unread = if let HeaderUnit::Unread(unit) = &named.unit { Some(unit.clone()) } else { word() };
    if let Some(unit) = unread {
        let why = format!("a time in {unit} is not read; convert it to seconds");
        return Some(Guess::because("ignore".to_owned(), why));
    }
    if is_of_clocks(column) {
        return None;
    }
    let step = median_step(&numbers)?;
    // Rows of a log are between half a millisecond and ten minutes apart, and its times less than two centuries from zero.
    let farthest = numbers.iter().fold(0.0_f64, |most, time| most.max(time.abs()));
    let is_of = |per_s: f64| step <= 600.0 * per_s && farthest <= MOST_TIME_S * per_s;
    let ending = [("s", 1.0), ("ms", 1e3), ("us", 1e6)].into_iter().find(|(_, per_s)| is_of(*per_s));
    let ending = ending.map_or("ns", |(ending, _)| ending);
    Some(Guess::because(role(ending), format!("the unit, from rows that are {} apart", (1e9 * step).round() / 1e9)))
}

fn temperature(column: &SampleColumn, named: &Named) -> Guess {
    match &named.unit {
        HeaderUnit::Known(ending) if named.by_unit.is_some() => {
            Guess::because(named.role(ending), by_name_or_unit(named))
        }
        HeaderUnit::Known(ending) => Guess::sure(named.role(ending)),
        HeaderUnit::Unread(unit) => {
            Guess::because("ignore".to_owned(), format!("a temperature in {unit} is not read; convert it to °C"))
        }
        HeaderUnit::Open => {
            let mut sorted = column.numbers();
            sorted.sort_by(f64::total_cmp);
            let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
            match of_temperature(&sorted) {
                Ok(ending) => Guess::because(named.role(ending), format!("the unit, from values near {middle}")),
                Err(why) => Guess::unread(format!("no temperature in °C or K: {why}; convert it to °C")),
            }
        }
    }
}

/// The interval of the rows by a column of times, s.
pub(super) fn row_s(column: &SampleColumn, role: &str) -> Option<f64> {
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
