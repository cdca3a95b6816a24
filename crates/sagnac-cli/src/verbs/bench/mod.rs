//! `sagnac bench`: a thermal test recorded as it runs.

mod lines;
mod screen;

use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use sagnac::calibration::{Calibration, program};
use sagnac::fit::{FitOptions, Model, calibrate_with_report_data};
use sagnac::plan::EnoughRequest;
use sagnac::verify::Limits;
use sagnac::window::WindowBuilder;
use sagnac::{Error, Result};
use sagnac_bench::live::{Live, LiveRequest};
use sagnac_bench::page::{Page, PageOf};
use sagnac_bench::source::Address;
use sagnac_bench::{Finished, JournalRows, Session, finish, journal_of};
use sagnac_log::setup::{RateUnit, Setup};
use sagnac_log::write::write_bytes;
use sagnac_report::calibration_report;
use sagnac_units::format::significant;

use crate::args::report::ReportArgs;
use crate::args::setup::SetupArgs;
use crate::args::setup::source_date_epoch;
use crate::args::units::UnitsArgs;
use crate::files::{Files, interrupt, loading};
use crate::output::calibration;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::progress::of_fit;
use crate::verbs::bench::lines::Lines;
use crate::verbs::bench::screen::BenchScreen;
use crate::verbs::verb::Verb;

/// Address of the page, if it is free.
const PAGE: &str = "127.0.0.1:8647";

/// Record a thermal test live and tell you when it is complete
///
/// Every byte goes first to a journal next to the log (LOG.journal). `kill -9` or a power cut costs at most a second, and --resume continues.
/// Ctrl-C ends the recording, writes the log as Parquet, and calibrates it. A second Ctrl-C exits at once; continue with --resume or --finish.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac bench bench.toml --source serial:/dev/ttyUSB0 -o run.parquet --calibration unit.cal.json
  sagnac simulate scenarios/paper/paper.toml | sagnac bench bench.toml --source - -o run.parquet")]
pub(crate) struct Args {
    /// Setup file with the sources under [bench]
    #[arg(value_name = "SETUP")]
    bench: Option<PathBuf>,
    /// Log to write at the end of the test: Parquet
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Source of the gyro's bytes (overrides the setup)
    ///
    /// -, file:PATH, tcp://HOST:PORT, udp://HOST:PORT, serial:DEVICE?baud=115200, replay:LOG?speed=10
    #[arg(long, value_name = "SOURCE")]
    source: Option<String>,
    /// Continue the recording of this log
    #[arg(long)]
    resume: bool,
    /// Stop recording: make the log of the recorded rows
    ///
    /// Uses the setup of the recording, or a corrected one on the command line
    #[arg(long, conflicts_with_all = ["resume", "source"])]
    finish: bool,
    /// Limits for the unit: a file or the name of a set
    #[arg(long, value_name = "LIMITS")]
    limits: Option<String>,
    /// `met`: end the recording when the test is complete
    ///
    /// Needs limits, and span_c under [bench]
    #[arg(long, value_enum, default_value = "never", hide_possible_values = true)]
    stop_when: StopWhen,
    /// Address of the page, or `none`
    #[arg(long = "page", id = "address", value_name = "ADDRESS", default_value = PAGE)]
    page_address: String,
    /// Show the figures as text on this terminal
    #[arg(long)]
    tui: bool,
    /// Calibration to write at the end
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    /// `auto`, or orders: "bias 3, rate 1"
    #[arg(long, default_value = "auto")]
    model: String,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    setup: SetupArgs,
}

/// Ends of a recording other than Ctrl-C and the end of its source.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum StopWhen {
    /// Nothing.
    Never,
    /// The test is complete.
    Met,
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        if !loading::has_extension(&self.output, "parquet") {
            return Err(Error::input("a recording is written as Parquet", "give it the ending .parquet")
                .file(self.output.display().to_string()));
        }
        let journal = journal_of(&self.output);
        let model: Model = self.model.parse()?;
        // A recording is finished with its own setup, or with a corrected one.
        let has_setup = self.bench.is_some() || self.setup.setup.is_some();
        let setup =
            if self.finish && !has_setup { JournalRows::open(&journal)?.start().setup() } else { setup_of(self)? };
        let files = Files::new().reads(&self.bench).reads(&self.setup.setup).reads(files_of(&setup));
        self.report.check_with(files.writes([&self.output, &journal]).writes(&self.calibration))?;
        let enough = enough_of(self, &setup)?;
        page_address(self)?;
        if !self.finish {
            if self.output.exists() && !self.resume {
                return Err(Error::input(
                    "a log of this name exists already",
                    "give another -o, or continue its recording with --resume",
                )
                .file(self.output.display().to_string()));
            }
            let request = LiveRequest { model: model.clone(), every_minute: is_replay(&setup), enough };
            record(self, &setup, request, &journal, console)?;
        }
        let finished = finish(JournalRows::open_with(&journal, &setup)?, &self.output)?;
        describe(&finished, console);
        console.say(format!("wrote {}", self.output.display()));
        calibrate(self, &setup, model, console)
    }
}

/// The setup with the flags over it.
fn setup_of(args: &Args) -> Result<Setup> {
    let base = args.bench.as_deref().map_or_else(|| Ok(Setup::default()), Setup::read)?;
    let mut setup = args.setup.over(base)?;
    if let Some(source) = &args.source {
        setup.bench.source = Some(source.clone());
    }
    if let Some(limits) = &args.limits {
        setup.bench.limits = Some(limits.clone());
    }
    Ok(setup)
}

/// The files that a setup names: the source, and limits that are no name of a set.
fn files_of(setup: &Setup) -> Vec<PathBuf> {
    let source = setup.bench.source.as_deref().and_then(|source| source.parse().ok());
    let source = match source {
        Some(Address::File(path) | Address::Replay { path, .. }) => Some(path),
        _ => None,
    };
    source.into_iter().chain(setup.bench.limits.iter().map(PathBuf::from)).collect()
}

/// A replay has hours in seconds.
fn is_replay(setup: &Setup) -> bool {
    setup.bench.source.as_deref().is_some_and(|source| source.starts_with("replay:"))
}

/// What the test is to tell.
fn enough_of(args: &Args, setup: &Setup) -> Result<Option<EnoughRequest>> {
    let bench = &setup.bench;
    if args.stop_when == StopWhen::Met {
        if bench.limits.is_none() {
            return Err(Error::input("--stop-when met needs limits", "give --limits, or set limits under [bench]")
                .column("--limits"));
        }
        if bench.span_c.is_none() {
            return Err(Error::input(
                "--stop-when met needs the temperature range of the calibration",
                "set span_c = [-40, 70] under [bench]",
            )
            .column("bench.span_c"));
        }
    }
    let Some(limits) = &bench.limits else { return Ok(None) };
    let mut request = EnoughRequest::new(Limits::named_or_read(limits)?);
    (request.span_c, request.rate_cpm) = (bench.span_c, bench.ramp_cpm);
    request.share = bench.share.unwrap_or(request.share);
    request.probability = bench.probability.unwrap_or(request.probability);
    request.passes = bench.passes.unwrap_or(request.passes);
    request.units = args.units.over(setup);
    Ok(Some(request))
}

/// Records until the source ends, somebody ends it, or the test is complete.
fn record(args: &Args, setup: &Setup, request: LiveRequest, journal: &Path, console: &mut Console) -> Result<()> {
    interrupt::outlive_terminal();
    let session = Session::begin(setup, &program(), journal, args.resume)?;
    let stop = session.stop.clone();
    interrupt::first(move || stop.stop());
    console.note(format!("recording {} to {}", session.start.sources.join(", "), journal.display()));
    let (share, title) = (request.enough.as_ref().and_then(share_of), title_of(setup));
    let live = Live::default();
    let reader = live.begin(JournalRows::follow(journal, session.published.clone())?, setup, request)?;
    let page = page_of(args, setup, share, &session, &live, console)?;
    let mut shown = Shown::begin(args, &title, page.as_ref(), args.units.over(setup))?;
    loop {
        let has_ended = session.is_ended();
        shown.show(&live, &session, console);
        if has_ended {
            break;
        }
        let met = live.look(|state| state.study.confirmed);
        if met && args.stop_when == StopWhen::Met {
            session.stop.stop();
        }
    }
    let recorded = session.join();
    // The last fit is of the whole record, and is shown.
    let _ = reader.join();
    shown.end(&live, console);
    if args.stop_when == StopWhen::Met && live.look(|state| state.study.confirmed) {
        console.note("the test is complete, and was ended");
        let not_seen = live.look(|state| state.study.enough.as_ref().map(|enough| enough.not_seen.clone()));
        not_seen.into_iter().flatten().for_each(|what| console.note(format!("not seen by this test: {what}")));
    }
    page.into_iter().for_each(Page::end);
    recorded
}

/// How a running test is shown here.
enum Shown {
    Lines(Lines),
    Screen(Box<BenchScreen>),
}

impl Shown {
    fn begin(args: &Args, title: &str, page: Option<&Page>, units: RateUnit) -> Result<Self> {
        if !args.tui || !std::io::stdout().is_terminal() {
            return Ok(Self::Lines(Lines::new(units)));
        }
        let page = page.map_or(String::new(), |page| format!("   http://{}", page.address));
        BenchScreen::begin(&format!("{title}{page}"), units).map(|screen| Self::Screen(Box::new(screen)))
    }

    /// Shows what is new, and waits for more or a moment.
    fn show(&mut self, live: &Live, session: &Session, console: &mut Console) {
        match self {
            Self::Lines(lines) => {
                lines.show(live, &session.sources.now(), console);
                lines.wait(live, &session.stop);
            }
            Self::Screen(screen) => {
                if let Err(error) = screen.show(live, &session.sources.now(), &session.stop) {
                    // The terminal has gone away: the recording goes on.
                    *self = Self::Lines(Lines::new(screen.units()));
                    console.note(format!("the terminal is gone, the recording goes on: {error}"));
                }
            }
        }
    }

    /// The last word, in lines.
    fn end(self, live: &Live, console: &mut Console) {
        let mut lines = match self {
            Self::Lines(lines) => lines,
            Self::Screen(screen) => {
                let units = screen.units();
                drop(screen);
                Lines::new(units)
            }
        };
        lines.last(live, console);
    }
}

fn title_of(setup: &Setup) -> String {
    setup.serial.clone().map_or_else(|| "Sagnac bench".to_owned(), |serial| format!("{serial} on the bench"))
}

/// What of a limit the curve may take at a temperature.
fn share_of(request: &EnoughRequest) -> Option<(f64, String)> {
    let limits = &request.limits;
    let named = [
        ("plateau_offset_dph_max", limits.plateau_offset_dph_max),
        ("temperature_residual_dph_max", limits.temperature_residual_dph_max),
    ];
    let (name, limit) = named.into_iter().find_map(|(name, limit)| Some((name, limit?)))?;
    Some((limit * request.share, format!("{} % of {name}", significant(100.0 * request.share, 2))))
}

/// The page's address; `None` where there is to be no page.
fn page_address(args: &Args) -> Result<Option<SocketAddr>> {
    if args.page_address == "none" {
        return Ok(None);
    }
    args.page_address.parse().map(Some).map_err(|_| {
        Error::input("not an address", "write it like --page 127.0.0.1:8647, or --page none")
            .column("--page")
            .value(&args.page_address)
    })
}

/// Serves the page, unless there is to be none.
fn page_of(
    args: &Args,
    setup: &Setup,
    share: Option<(f64, String)>,
    session: &Session,
    live: &Live,
    console: &mut Console,
) -> Result<Option<Page>> {
    let Some(address) = page_address(args)? else { return Ok(None) };
    let content = PageOf {
        title: title_of(setup),
        subtitle: session.start.sources.join(", "),
        live: live.clone(),
        sources: session.sources.clone(),
        clock: session.clock,
        stop: session.stop.clone(),
        share,
        units: args.units.over(setup),
        is_replay: is_replay(setup),
    };
    let page = match Page::begin(content.clone(), address) {
        // The usual port may be another bench's.
        Err(_) if args.page_address == PAGE => Page::begin(content, SocketAddr::from(([127, 0, 0, 1], 0)))?,
        made => made?,
    };
    console.note(format!("the page: http://{}/?token={}", page.address, page.token));
    Ok(Some(page))
}

fn describe(finished: &Finished, console: &mut Console) {
    let counts = finished.counts;
    console.say(format!("{} rows of {} bytes", counts.rows, counts.bytes));
    let mut odd = |number: u64, what: &str| {
        if number > 0 {
            console.note(format!("{number} {what}"));
        }
    };
    odd(counts.cut_lines, "lines have another number of fields than the headers: cut or damaged");
    odd(counts.missing_frames, "frames are missing between those that came");
    odd(counts.lost_bytes, "bytes are in no row; the journal has them");
    odd(finished.damaged_bytes, "bytes of the journal are damaged");
    let clock = finished.clock;
    let drift =
        clock.drift_ppm.map_or(String::new(), |ppm| format!(", the gyro's clock is {} ppm fast", significant(ppm, 2)));
    console.note(format!(
        "half of the rows arrive within {} s of the quickest of their minute{drift}",
        significant(clock.jitter_s, 2)
    ));
}

/// Calibrates the finished log, as `calibrate` does.
fn calibrate(args: &Args, setup: &Setup, model: Model, console: &mut Console) -> Ran {
    let setup = Setup { bench: Default::default(), ..setup.clone() };
    let logs = loading::logs(std::slice::from_ref(&args.output), &setup, "reading")?;
    let windows = WindowBuilder::read_all(logs, &setup)?.finish();
    let options = FitOptions::new(model).source_date_epoch(source_date_epoch()?).progress(of_fit());
    let (calibration, report_data) = calibrate_with_report_data(windows, &setup, &options)?;
    drop(options);
    let units = args.units.over(&setup);
    for axis in &calibration.axes {
        calibration::describe(console, axis, units);
    }
    write_record(args, &calibration, console)?;
    args.report.write(console, || calibration_report(&calibration, &report_data, units))?;
    Ok(Outcome::Done)
}

fn write_record(args: &Args, calibration: &Calibration, console: &mut Console) -> Result<()> {
    if let Some(path) = &args.calibration {
        write_bytes(path, calibration.to_json()?.as_bytes())?;
        console.say(format!("wrote {}", path.display()));
    }
    Ok(())
}
