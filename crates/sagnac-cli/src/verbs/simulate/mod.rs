//! `sagnac simulate`: a scenario in, the log of its test out, with the truth in its own file.

mod charts;
mod paper;

use std::cell::RefCell;
use std::io::Write;
use std::path::{Path, PathBuf};

use sagnac::{Error, Result};
use sagnac_log::ingest::Content;
use sagnac_log::write::{ParquetRows, write_atomically};
use sagnac_report::chart_report;
use sagnac_sim::{
    BlockWriter, Bode, Fault, FaultKind, LogRow, LogText, LoopDesign, LoopName, Scenario, ScenarioError, Second,
    truth_header, write_truth,
};
use sagnac_units::format::significant;

use crate::args::report::ReportArgs;
use crate::files::loading;
use crate::files::pipe::PipeAware;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::progress::SimulatedTime;
use crate::output::terminal::table;
use crate::verbs::simulate::charts::ChartRecorder;
use crate::verbs::verb::Verb;

/// Simulate a ring laser gyro on its thermal test
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac simulate scenarios/triangle-28cm-dithered/triangle-28cm-dithered.toml --seed 1 -o run.csv --truth truth.csv --report sim.html
  sagnac simulate scenarios/paper/paper.toml --fault stuck_thermometer@6000+3000 -o broken.csv
  sagnac simulate scenarios/square-28cm/square-28cm.toml --bode --report loops.html
  sagnac simulate --paper --report paper.html")]
pub(crate) struct Args {
    /// Scenario file with gyro, test and faults (docs/reference/scenario.md)
    #[arg(value_name = "SCENARIO", required_unless_present = "paper")]
    scenario: Option<PathBuf>,
    /// Reproduce the source paper instead: its rig, its table, its equations. The retest uses the next seed
    #[arg(long, conflicts_with_all = ["scenario", "output", "truth", "bode", "fault"])]
    paper: bool,
    /// Seed of all random numbers [default: the scenario's, 1 for the paper]
    #[arg(long)]
    seed: Option<u64>,
    /// Log to write: CSV, or Parquet for a name in .parquet; standard output by default
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Truth to write as CSV: true rate, each error source, temperatures, mode
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    /// Sweep both running loops instead, and print their open-loop gain next to the design
    #[arg(long)]
    bode: bool,
    /// Add a fault: KIND, KIND@START+SECONDS or KIND@START+SECONDS:SIZE (docs/explanation/simulator.md lists the kinds)
    #[arg(long, value_name = "FAULT")]
    fault: Vec<String>,
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        let Some(path) = &self.scenario else {
            return paper::run(self.seed.unwrap_or(1), &self.report, console);
        };
        check_files(self)?;
        let scenario = scenario(self, path)?;
        if self.bode {
            return bode(self, path, &scenario, console);
        }
        let outputs = [&self.output, &self.truth];
        let seed = self.seed.unwrap_or(scenario.seed);
        let mut recorder = self.report.is_asked().then(|| ChartRecorder::new(&scenario));
        let mut rows = 0;
        let mut to = |path: Option<&Path>, out: &mut (dyn Write + Send)| {
            rows = pour_with_truth(&scenario, seed, path, out, self.truth.as_deref(), &mut recorder)?;
            Ok(())
        };
        match &self.output {
            Some(path) => write_atomically(path, |out| to(Some(path), out))?,
            None if self.truth.is_none() && !self.report.is_asked() => return to_stdout(&scenario, seed),
            // With a truth or a report only, no log goes to the terminal.
            None => to(None, &mut std::io::sink())?,
        }
        describe(&scenario, seed, rows, console);
        for path in outputs.into_iter().flatten() {
            console.say(format!("wrote {}", path.display()));
        }
        if let Some(recorder) = recorder {
            self.report.write(console, || chart_report(&recorder.page(seed)))?;
        }
        Ok(Outcome::Done)
    }
}

/// Files out are what their names say.
fn check_files(args: &Args) -> Result<()> {
    args.output.iter().try_for_each(|path| loading::check_output_name(path, "CSV, or Parquet for .parquet"))?;
    let parquet = |path: &&PathBuf| loading::has_extension(path, "parquet");
    if let Some(path) = args.truth.iter().find(parquet) {
        return Err(Error::input("the truth is written as CSV only", "give it the ending .csv")
            .file(path.display().to_string()));
    }
    args.report.check_name()
}

fn scenario(args: &Args, path: &Path) -> Result<Scenario> {
    let refused = |problem: ScenarioError| loading::scenario_refused(path, &problem);
    let mut scenario = loading::scenario(path)?;
    if scenario.name.is_empty() {
        scenario.name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        scenario.name.retain(|c| !c.is_control());
    }
    let length_s = scenario.profile().map_err(refused)?.length_s();
    for text in &args.fault {
        scenario.fault.push(fault(text, length_s)?);
        // The file was good: what is wrong now is what was just added.
        scenario.build().map_err(|problem| {
            Error::input(
                problem.to_string(),
                "write it as KIND@START+SECONDS:SIZE, docs/reference/scenario.md lists each kind with its range",
            )
            .column("--fault")
            .value(text)
        })?;
    }
    Ok(scenario)
}

/// `KIND[@START+SECONDS[:SIZE]]`.
fn fault(text: &str, length_s: f64) -> Result<Fault> {
    let (kind, rest) = text.split_once('@').map_or((text, None), |(kind, rest)| (kind, Some(rest)));
    let unknown = || {
        let names = FaultKind::ALL.map(|(_, name)| name).join(", ");
        Error::input("no such fault", format!("choose one of {names}")).column("--fault").value(text)
    };
    let mut fault = Fault::of_kind(kind.parse::<FaultKind>().map_err(|_| unknown())?, length_s);
    if let Some(rest) = rest {
        let form = || {
            Error::input(
                "a fault needs a start and a duration",
                "write it as KIND@START+SECONDS or KIND@START+SECONDS:SIZE",
            )
            .column("--fault")
            .value(text)
        };
        let (at, rest) = rest.split_once('+').ok_or_else(form)?;
        let (length, size) = rest.split_once(':').map_or((rest, None), |(length, size)| (length, Some(size)));
        let number = |text: &str| text.parse::<f64>().map_err(|_| form());
        fault.at_s = number(at)?;
        fault.for_s = number(length)?;
        fault.size = size.map_or(Ok(0.0), number)?;
    }
    Ok(fault)
}

/// Where rows go.
enum RowsOut<'a> {
    Text(BlockWriter<&'a mut (dyn Write + Send)>),
    Parquet(Box<ParquetRows<'a>>),
}

impl<'a> RowsOut<'a> {
    fn new(path: Option<&Path>, text: &LogText, out: &'a mut (dyn Write + Send)) -> Result<Self> {
        if path.is_some_and(|path| loading::has_extension(path, "parquet")) {
            let columns = text.headers().iter().map(|name| (name.clone(), Content::Number));
            return Ok(Self::Parquet(Box::new(ParquetRows::new(out, columns.collect(), None, false)?)));
        }
        let mut blocks = BlockWriter::new(out);
        blocks.write_all(text.header_line().as_bytes()).map_err(unwritten)?;
        Ok(Self::Text(blocks))
    }

    #[inline]
    fn row(&mut self, line: &[u8]) -> Result<()> {
        match self {
            Self::Text(blocks) => blocks.write_all(line).map_err(unwritten),
            Self::Parquet(rows) => {
                let cells: Vec<&[u8]> = line.trim_ascii_end().split(|byte| *byte == b',').collect();
                rows.row(&cells)
            }
        }
    }

    fn finish(&mut self) -> Result<()> {
        match self {
            Self::Text(blocks) => blocks.flush().map_err(unwritten),
            Self::Parquet(rows) => rows.finish(),
        }
    }
}

fn unwritten(error: std::io::Error) -> Error {
    Error::cannot("write", &error)
}

/// The log, and the truth next to it where it is asked for; how many rows there were.
fn pour_with_truth(
    scenario: &Scenario,
    seed: u64,
    path: Option<&Path>,
    out: &mut (dyn Write + Send),
    truth: Option<&Path>,
    recorder: &mut Option<ChartRecorder>,
) -> Result<u64> {
    let Some(truth) = truth else { return pour(scenario, seed, path, out, None, recorder) };
    let mut rows = 0;
    write_atomically(truth, |truth| {
        rows = pour(scenario, seed, path, out, Some(truth), recorder)?;
        Ok(())
    })?;
    Ok(rows)
}

fn pour(
    scenario: &Scenario,
    seed: u64,
    path: Option<&Path>,
    out: &mut (dyn Write + Send),
    truth: Option<&mut (dyn Write + Send)>,
    recorder: &mut Option<ChartRecorder>,
) -> Result<u64> {
    let invalid = |problem: ScenarioError| {
        Error::input(
            problem.message.clone(),
            "correct the key in the scenario, docs/reference/scenario.md lists its range",
        )
        .column(problem.key)
    };
    let mut run = scenario.build().map_err(invalid)?.start(seed);
    let mut text = LogText::new(scenario);
    let mut log = RowsOut::new(path, &text, out)?;
    let mut truth = truth.map(BlockWriter::new);
    if let Some(truth) = &mut truth {
        truth.write_all(truth_header().as_bytes()).map_err(unwritten)?;
    }
    let progress = RefCell::new(SimulatedTime::new(run.length_s()));
    let (mut rows, mut shown_s) = (0_u64, 0.0);
    run.each_row(|row: &LogRow, second: &Second| {
        rows += 1;
        log.row(text.line(row, second))?;
        if let Some(truth) = &mut truth {
            write_truth(truth, row, second).map_err(unwritten)?;
        }
        if let Some(recorder) = recorder {
            recorder.take(row, second);
        }
        if second.end_s > shown_s {
            shown_s = second.end_s;
            progress.borrow_mut().at(second.end_s);
        }
        Ok::<(), Error>(())
    })?;
    if let Some(truth) = &mut truth {
        truth.flush().map_err(unwritten)?;
    }
    log.finish()?;
    Ok(rows)
}

fn to_stdout(scenario: &Scenario, seed: u64) -> Ran {
    let mut out = PipeAware::new(std::io::stdout());
    let poured = pour(scenario, seed, None, &mut out, None, &mut None);
    if !out.closed() {
        poured.map_err(|e| e.file("standard output"))?;
    }
    Ok(Outcome::Done)
}

fn describe(scenario: &Scenario, seed: u64, rows: u64, console: &mut Console) {
    console.say(format!(
        "{}: {rows} rows, seed {seed}; {} arcsec per count, lock-in {} °/h, angle random walk {} °/√h",
        scenario.name,
        scenario.arcsec_per_count(),
        significant(scenario.lock_in_dph(), 3),
        significant(scenario.arw_deg_rt_h(), 3)
    ));
    let random =
        scenario.arw_deg_rt_h() + scenario.noise.bias_instability_dph + scenario.noise.rate_random_walk_dph_rt_h;
    if random == 0.0 && scenario.thermometer.iter().all(|t| t.noise_c == 0.0) {
        console.note("note: nothing in this scenario is random, so every seed gives the same log ([noise], [dither])");
    }
}

fn bode(args: &Args, path: &Path, scenario: &Scenario, console: &mut Console) -> Ran {
    if args.output.is_some() || args.truth.is_some() {
        return Err(Error::input("--bode sweeps the loops and writes no log", "remove -o and --truth").column("--bode"));
    }
    let refused = |problem: ScenarioError| loading::scenario_refused(path, &problem);
    let design = LoopDesign::build(scenario).map_err(refused)?;
    let length = design.sweep(LoopName::PathLength, scenario.path_length.bandwidth_hz).map_err(refused)?;
    let light = design.sweep(LoopName::Intensity, scenario.intensity.bandwidth_hz).map_err(refused)?;
    for sweep in [&length, &light] {
        describe_loop(sweep, console);
    }
    args.report.write(console, || chart_report(&charts::bode_page(scenario, &[length, light])))?;
    Ok(Outcome::Done)
}

fn describe_loop(sweep: &Bode, console: &mut Console) {
    let or_none = |value: Option<f64>, unit: &str| {
        value.map_or("none in this sweep".to_owned(), |v| format!("{}{unit}", significant(v, 4)))
    };
    console.say(format!(
        "{} loop: crossover {} (design {}), phase margin {} (design {}), gain margin {}",
        sweep.which.name(),
        or_none(sweep.crossover_hz, " Hz"),
        or_none(Some(sweep.design_crossover_hz), " Hz"),
        or_none(sweep.phase_margin_deg, "°"),
        or_none(Some(sweep.design_phase_margin_deg), "°"),
        or_none(sweep.gain_margin, "")
    ));
    let rows = sweep.points.iter().map(|p| {
        let db = |gain: f64| format!("{:.2}", 20.0 * gain.log10());
        vec![
            significant(p.frequency_hz, 4),
            db(p.gain),
            db(p.design_gain),
            format!("{:.1}", p.phase_deg),
            format!("{:.1}", p.design_phase_deg),
        ]
    });
    console.say(table(&["frequency, Hz", "gain, dB", "design, dB", "phase, deg", "design, deg"], rows));
}
