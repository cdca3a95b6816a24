//! Flags for facts that a log does not contain; each overrides the key of its name in the setup file.

use std::path::PathBuf;

use bytesize::ByteSize;
use clap::{Args, ValueEnum};
use sagnac::window::{WindowBuilder, Windows};
use sagnac::{Error, Result};
use sagnac_log::memory::MemoryBudget;
use sagnac_log::setup::{Counter, PerAxis, RunDivision, Setup, TurnOnCount, WindowSize};

use crate::files::loading;

/// Log settings (override the setup file).
#[derive(Args, Clone, Default)]
#[command(next_help_heading = "Log settings (override the setup file)")]
pub(crate) struct SetupArgs {
    /// Setup file (bench.toml)
    #[arg(long, value_name = "FILE")]
    pub(crate) setup: Option<PathBuf>,
    /// Serial number of the gyro
    #[arg(long)]
    serial: Option<String>,
    /// Axis letter, for headers without one
    #[arg(long, hide_short_help = true)]
    axis: Option<char>,
    /// Nominal scale factor, arcsec per count
    #[arg(long, value_name = "ARCSEC")]
    arcsec_per_count: Option<f64>,
    /// Smallest step of the counts column, counts
    #[arg(long, value_name = "COUNTS", hide_short_help = true)]
    quantum: Option<f64>,
    /// Kind of the counts column
    #[arg(long, value_enum, hide_short_help = true)]
    counter: Option<CounterWord>,
    /// Width of a wrapping cumulative counter
    #[arg(long, value_name = "BITS", hide_short_help = true)]
    counter_bits: Option<u8>,
    /// Row interval, s; must agree with the time column within 2 %
    #[arg(long, value_name = "S", hide_short_help = true)]
    sample_interval: Option<f64>,
    /// Number of the gyro in a PX4 log, from 0
    #[arg(long, value_name = "N", hide_short_help = true)]
    instance: Option<u8>,
    /// Time to add to temperatures, s
    #[arg(long, value_name = "S", allow_negative_numbers = true, hide_short_help = true)]
    temperature_offset: Option<f64>,
    /// Input rate along the axis during the test, °/h; for several axes x=…,y=…,z=…
    #[arg(long, value_name = "DPH", allow_negative_numbers = true, hide_short_help = true)]
    input_rate: Option<PerAxis<f64>>,
    /// Analysis window: seconds, or `row` for one window per row
    #[arg(long, value_parser = window_size, hide_short_help = true)]
    window: Option<WindowSize>,
    /// Treat all files as one run, even with gaps between them
    #[arg(long, conflicts_with = "runs", hide_short_help = true)]
    one_run: bool,
    /// Treat each file as a separate run; by default, continuing time continues the run
    #[arg(long, hide_short_help = true)]
    runs: bool,
    /// How often the gyro was switched on for these logs: a number, or `files` for once per run
    #[arg(long, value_parser = turn_on_count, value_name = "N|files", hide_short_help = true)]
    turn_ons: Option<TurnOnCount>,
    /// Temperature at which the correction is zero, °C
    #[arg(long, value_name = "C", allow_negative_numbers = true, hide_short_help = true)]
    reference: Option<f64>,
    /// Time to discard at the start of each run, s
    #[arg(long, value_name = "S", hide_short_help = true)]
    discard_initial: Option<f64>,
    /// Smallest temperature span for a fit, °C
    #[arg(long, value_name = "C", hide_short_help = true)]
    min_span: Option<f64>,
    /// Thermometer of the model
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    thermometer: Option<String>,
    /// Further inputs for `auto`, separated by commas: thermometers, "one - another", auxiliary columns, or `none`. They also name the
    /// inputs of an image without a calibration
    #[arg(long, value_name = "NAMES", hide_short_help = true)]
    inputs: Option<String>,
    /// Memory limit for the data of one run, such as 512MiB or 4GiB [default: 1GiB]
    #[arg(long, value_name = "SIZE", value_parser = memory_budget, hide_short_help = true)]
    memory: Option<MemoryBudget>,
}

/// How a log becomes windows.
#[derive(Args, Clone, Default)]
pub(crate) struct LogArgs {
    #[command(flatten)]
    pub(crate) setup: SetupArgs,
    /// Keep windows with bumps, steps or start-up
    #[arg(long, hide_short_help = true)]
    pub(crate) keep_outliers: bool,
}

impl LogArgs {
    /// A builder that keeps outliers where `--keep-outliers` says so.
    pub(crate) fn outliers(&self, builder: WindowBuilder) -> WindowBuilder {
        if self.keep_outliers { builder.keep_outliers() } else { builder }
    }

    /// Windows of logs, with the setup that they are read with.
    pub(crate) fn windows(&self, paths: &[PathBuf]) -> Result<(Windows, Setup)> {
        for path in paths {
            if !matches!(loading::kind_of(path)?, loading::FileKind::Log) {
                return Err(Error::input(
                    "a log is needed, and this is an image or a calibration",
                    "give the CSV, Parquet or ULog file that the test recorded",
                )
                .file(path.display().to_string()));
            }
        }
        let setup = self.setup.over(Setup::default())?;
        let builder = WindowBuilder::read_all(loading::logs(paths, &setup, "reading")?, &setup)?;
        Ok((self.outliers(builder).finish(), setup))
    }
}

/// Names between commas; none for the word `none`.
fn names(text: &str) -> Vec<String> {
    let all = text.split(',').map(|name| name.trim().to_owned());
    if text == "none" { Vec::new() } else { all.collect() }
}

/// How a counts column counts.
#[derive(Clone, Copy, ValueEnum)]
enum CounterWord {
    Incremental,
    Cumulative,
}

impl SetupArgs {
    /// The memory budget of the run.
    pub(crate) fn memory(&self) -> MemoryBudget {
        self.memory.unwrap_or_default()
    }

    /// The setup file (or `base` without one) with the flags over it.
    pub(crate) fn over(&self, base: Setup) -> Result<Setup> {
        let mut setup = match &self.setup {
            Some(path) => Setup::read(path)?,
            None => base,
        };
        fn put<T: Clone>(slot: &mut Option<T>, flag: &Option<T>) {
            if flag.is_some() {
                slot.clone_from(flag);
            }
        }
        put(&mut setup.serial, &self.serial);
        put(&mut setup.axis, &self.axis);
        put(&mut setup.arcsec_per_count, &self.arcsec_per_count);
        put(&mut setup.quantum, &self.quantum);
        put(&mut setup.counter_bits, &self.counter_bits);
        put(&mut setup.sample_interval_s, &self.sample_interval);
        put(&mut setup.instance, &self.instance);
        put(&mut setup.input_rate_dph, &self.input_rate);
        put(&mut setup.window, &self.window);
        put(&mut setup.turn_ons, &self.turn_ons);
        put(&mut setup.reference_c, &self.reference);
        put(&mut setup.min_span_c, &self.min_span);
        put(&mut setup.use_thermometer, &self.thermometer);
        put(&mut setup.inputs, &self.inputs.as_deref().map(names));
        setup.memory = self.memory();
        setup.discard_initial_s = self.discard_initial.unwrap_or(setup.discard_initial_s);
        setup.temperature_offset_s = self.temperature_offset.unwrap_or(setup.temperature_offset_s);
        setup.counter = match self.counter {
            Some(CounterWord::Incremental) => Some(Counter::Incremental),
            Some(CounterWord::Cumulative) => Some(Counter::Cumulative),
            None => setup.counter,
        };
        setup.runs = match (self.one_run, self.runs) {
            (true, _) => RunDivision::One,
            (_, true) => RunDivision::Files,
            _ => setup.runs,
        };
        if self.input_rate.is_some() {
            setup.earth = None;
        }
        setup.check()?;
        Ok(setup)
    }
}

/// SOURCE_DATE_EPOCH, which takes the place of the newest sample's time in provenance.
pub(crate) fn source_date_epoch() -> Result<Option<i64>> {
    let Some(value) = std::env::var_os("SOURCE_DATE_EPOCH") else { return Ok(None) };
    let text = value.to_string_lossy();
    let parsed = text.parse().map(Some);
    parsed.map_err(|_| {
        Error::input("must be whole seconds", "set it to seconds since 1970: SOURCE_DATE_EPOCH=$(date +%s)")
            .column("SOURCE_DATE_EPOCH")
            .value(&text)
    })
}

fn window_size(text: &str) -> std::result::Result<WindowSize, String> {
    if text == "row" {
        return Ok(WindowSize::ROW);
    }
    text.parse().map(WindowSize::Seconds).map_err(|_| "seconds, or the word `row`".to_owned())
}

fn turn_on_count(text: &str) -> std::result::Result<TurnOnCount, String> {
    if text == "files" {
        return Ok(TurnOnCount::FILES);
    }
    text.parse().map(TurnOnCount::Number).map_err(|_| "a number, or the word `files`".to_owned())
}

fn memory_budget(text: &str) -> std::result::Result<MemoryBudget, String> {
    let bytes: ByteSize = text.parse()?;
    let least = ByteSize(MemoryBudget::LEAST);
    MemoryBudget::of_bytes(bytes.as_u64()).ok_or_else(|| format!("at least {least}"))
}

/// Comma-separated numbers.
pub(crate) fn numbers(flag: &str, text: &str) -> Result<Vec<f64>> {
    let parsed: std::result::Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    parsed.map_err(|_| {
        Error::input("not a list of numbers separated by commas", format!("write it like {flag} -20,25,60"))
            .column(flag)
            .value(text)
    })
}
