//! `sagnac inspect`: what a file is, and what `calibrate` would do with it.

use std::path::{Path, PathBuf};

use sagnac::Result;
use sagnac::calibration::Calibration;
use sagnac::export::image_bytes;
use sagnac::fit::{FitOptions, Model, calibrate};
use sagnac::window::{WindowBuilder, Windows};
use sagnac_core::{
    Description, Image, Kind as Quantity, LagSpec, Multiplier, Shape, SignatureBlock, Term, ValueSource,
};
use sagnac_log::ingest::{AngleUnit, LogReader, LogShape, ReadMode, Tally, hex, sha256};
use sagnac_log::setup::Setup;
use sagnac_units::format::significant;
use sagnac_units::s_from_ns;
use serde::Serialize;

use crate::calibrate::{excluded, summary};
use crate::console::{Console, Outcome, Ran, table};
use crate::key::words;
use crate::loading::{self, Kind};
use crate::progress::open_log;
use crate::setup_args::LogArgs;
use crate::signature_args::model_name;

/// Say what a log, window table, calibration or image is
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac inspect cycle-1.csv --arcsec-per-count 1.059")]
pub(crate) struct Args {
    /// Any file
    file: PathBuf,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    reading: LogArgs,
}

/// Output of `inspect --json` for a log or window table.
#[derive(Serialize)]
struct LogObject {
    kind: &'static str,
    axes: Vec<LogAxis>,
    thermometers: Vec<LogThermometer>,
    quantity: &'static str,
    rows: u64,
    sample_interval_s: f64,
    length_s: f64,
    windows: usize,
    windows_used: usize,
    excluded: Vec<Tally>,
    ignored_columns: Vec<String>,
    /// The model that `calibrate` would select, or why it refuses.
    calibrate: CalibrateObject,
}

#[derive(Serialize)]
struct LogAxis {
    axis: char,
    /// Null for counts of unknown scale.
    mean_dph: Option<f64>,
    /// Null for rates.
    mean_counts_per_s: Option<f64>,
}

const SCALE_KEY: &str = "arcsec_per_count";

#[derive(Serialize)]
struct LogThermometer {
    name: String,
    min_c: Option<f64>,
    max_c: Option<f64>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum CalibrateObject {
    Models { models: Vec<String> },
    Asks { asks_for: &'static str },
    Refused { refused: bool, reason: String },
}

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    match loading::kind_of(&args.file)? {
        Kind::Image => image(&args.file, console)?,
        Kind::Calibration => {
            let calibration: Calibration = loading::calibration(&args.file)?;
            console.say(format!("a calibration of {} by {}", calibration.serial, calibration.provenance.program));
            summary(console, &calibration);
            console.object(&calibration)?;
        }
        Kind::WindowTable => {
            let (windows, setup) = loading::windows(std::slice::from_ref(&args.file), &args.reading)?;
            console.say("a window table");
            log(windows, Vec::new(), "window table", &setup, console)?;
        }
        Kind::Log => {
            let given = args.reading.setup.over(Setup::default())?;
            let (reader, setup) = open_as_far_as_known(&args.file, given)?;
            let shape = reader.shape().clone();
            console.say(shape_text(&shape));
            let windows = args.reading.outliers(WindowBuilder::read_all(vec![reader], &setup)?).finish();
            log(windows, shape.ignored, "log", &setup, console)?;
        }
    }
    Ok(Outcome::Done)
}

/// Opens a log. Counts without a stated scale are read with 1 arcsec per count, so that °/h means counts per second; the
/// returned setup still lacks the scale.
fn open_as_far_as_known(path: &Path, given: Setup) -> Result<(LogReader, Setup)> {
    match open_log(path, &given, ReadMode::Bulk) {
        Err(error) if error.place.column.as_deref() == Some(SCALE_KEY) && path.as_os_str() != "-" => {
            let setup = Setup { arcsec_per_count: Some(1.0), ..given };
            Ok((open_log(path, &setup, ReadMode::Bulk)?, Setup { arcsec_per_count: None, ..setup }))
        }
        opened => Ok((opened?, given)),
    }
}

fn shape_text(shape: &LogShape) -> String {
    let axes: Vec<String> = shape.axes.iter().map(char::to_string).collect();
    let quantity = match shape.unit {
        AngleUnit::Quanta { quantum, .. } => format!("counts, quantum {quantum}"),
        AngleUnit::Arcsec => "rates".to_owned(),
    };
    let thermometers = match shape.thermometers.len() {
        0 => "no thermometer".to_owned(),
        1 => "one thermometer".to_owned(),
        n => format!("{n} thermometers"),
    };
    let ignored =
        if shape.ignored.is_empty() { String::new() } else { format!("; not read: {}", shape.ignored.join(", ")) };
    format!("a log of {quantity}, axes {}, {thermometers}{ignored}", axes.join(" "))
}

fn log(windows: Windows, ignored: Vec<String>, kind: &'static str, setup: &Setup, console: &mut Console) -> Result<()> {
    let scale_known = setup.arcsec_per_count.is_some() || windows.shape.unit == AngleUnit::Arcsec;
    let object = describe_windows(&windows, ignored, kind, scale_known);
    console.say(format!(
        "{} rows every {} s, {} s in all; {} windows, {} of them to be used",
        object.rows,
        significant(object.sample_interval_s, 6),
        significant(object.length_s, 6),
        object.windows,
        object.windows_used
    ));
    let cell = |value: Option<f64>| value.map_or("-".to_owned(), |v| significant(v, 7));
    let rows = object.axes.iter().map(|a| vec![a.axis.to_string(), cell(a.mean_dph), cell(a.mean_counts_per_s)]);
    console.say(table(&["axis", "mean, °/h", "mean, counts/s"], rows));
    for t in &object.thermometers {
        let name = if t.name.is_empty() { "temperature" } else { &t.name };
        if let (Some(lo), Some(hi)) = (t.min_c, t.max_c) {
            console.say(format!("{name}: {lo:.2} … {hi:.2} °C"));
        } else {
            console.say(format!("{name}: no usable value"));
        }
    }
    excluded(&object.excluded).iter().for_each(|line| console.say(line));
    let calibrate = if scale_known {
        would(calibrate(windows, setup, &FitOptions::new(Model::Auto)), console)?
    } else {
        console.say("calibrate needs the size of a count in arcsec (--arcsec-per-count)");
        CalibrateObject::Asks { asks_for: SCALE_KEY }
    };
    console.object(&LogObject { calibrate, ..object })
}

/// Result of a trial `calibrate`; here a refusal is a result, a bad input is an error.
fn would(tried: Result<Calibration>, console: &mut Console) -> Result<CalibrateObject> {
    match tried {
        Ok(calibration) => {
            let models: Vec<String> = calibration.axes.iter().map(|axis| axis.correction.model.clone()).collect();
            for axis in &calibration.axes {
                let held_out = axis.cross_validation().map_or(f64::NAN, |cv| cv.sigma_dph);
                console.say(format!(
                    "calibrate would select `{}` for axis {}: held-out σ {} °/h",
                    axis.correction.model,
                    axis.axis,
                    significant(held_out, 3)
                ));
            }
            Ok(CalibrateObject::Models { models })
        }
        Err(error) if error.kind == sagnac::ErrorKind::Refused => {
            console.say(format!("calibrate would refuse: {error}"));
            Ok(CalibrateObject::Refused { refused: true, reason: error.what })
        }
        Err(error) => Err(error),
    }
}

fn describe_windows(windows: &Windows, ignored: Vec<String>, kind: &'static str, scale_known: bool) -> LogObject {
    let used: Vec<usize> = (0..windows.len()).filter(|i| windows.rows.excluded[*i].is_none()).collect();
    // A log too short for a single window still has a mean.
    let described: Vec<usize> = if used.is_empty() { (0..windows.len()).collect() } else { used.clone() };
    let total_s: f64 = described.iter().map(|i| windows.duration_s(*i)).sum();
    let axes = windows.shape.axes.iter().enumerate().map(|(index, axis)| {
        let angle: f64 = described.iter().map(|i| windows.rows.angle[index][*i]).sum();
        let per_s = angle / total_s;
        let finite = |value: f64| value.is_finite().then_some(value);
        let counts = match windows.shape.unit {
            AngleUnit::Quanta { quantum, .. } => finite(per_s * quantum),
            AngleUnit::Arcsec => None,
        };
        let mean_dph = finite(per_s * windows.shape.unit.arcsec()).filter(|_| scale_known);
        LogAxis { axis: *axis, mean_dph, mean_counts_per_s: counts }
    });
    let thermometers = windows.shape.thermometers.iter().enumerate().map(|(index, name)| {
        let extreme =
            |column: &[f64], pick: fn(f64, f64) -> f64| column.iter().copied().filter(|t| t.is_finite()).reduce(pick);
        LogThermometer {
            name: name.clone(),
            min_c: extreme(&windows.rows.min_c[index], f64::min),
            max_c: extreme(&windows.rows.max_c[index], f64::max),
        }
    });
    LogObject {
        kind,
        axes: axes.collect(),
        thermometers: thermometers.collect(),
        quantity: if matches!(windows.shape.unit, AngleUnit::Arcsec) { "rates" } else { "counts" },
        rows: windows.runs.iter().flat_map(|run| &run.files).map(|file| file.summary.rows).sum(),
        sample_interval_s: windows.shape.sample_interval_s,
        length_s: windows.runs.iter().map(|run| s_from_ns(run.end_ns - run.start_ns)).sum(),
        windows: windows.len(),
        windows_used: used.len(),
        excluded: windows.tallies.list(),
        ignored_columns: ignored,
        calibrate: CalibrateObject::Models { models: Vec::new() },
    }
}

/// Output of `inspect --json` for an image.
#[derive(Serialize)]
struct ImageObject {
    kind: &'static str,
    serial: String,
    axis: char,
    sha256: String,
    arcsec_per_count: f64,
    quantum: f64,
    tick_ns: u32,
    period_ticks: u32,
    slew_ticks: u32,
    reference_c: f64,
    sequence: u32,
    parent: String,
    /// What the signature block says; it is not checked here.
    #[serde(skip_serializing_if = "Option::is_none")]
    signature: Option<SignatureObject>,
    thermometers: Vec<ImageThermometer>,
    terms: Vec<ImageTerm>,
}

#[derive(Serialize)]
struct SignatureObject {
    model: String,
    counter: u32,
    key: String,
}

#[derive(Serialize)]
struct ImageThermometer {
    /// Of a difference: the two thermometers, by their place.
    #[serde(skip_serializing_if = "Option::is_none")]
    difference: Option<[u8; 2]>,
    /// Of a repeat: the input that it repeats for a second lag, by its place.
    #[serde(skip_serializing_if = "Option::is_none")]
    repeats: Option<u8>,
    /// Of a warm-up since power-on: its time constant, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    warm_up_s: Option<f64>,
    /// In units of 2^exponent of its own; 0 for °C.
    unit_exponent: i8,
    span_c: [f64; 2],
    valid_range_c: [f64; 2],
    has_rate: bool,
}

#[derive(Serialize)]
struct ImageTerm {
    kind: &'static str,
    sensor: u8,
    order: u8,
    /// `zone` or `step`, for terms that begin at a knot; `cosine` or `sine`.
    #[serde(skip_serializing_if = "Option::is_none")]
    shape: Option<&'static str>,
    /// Where it begins, in the unit of the span.
    #[serde(skip_serializing_if = "Option::is_none")]
    from: Option<f64>,
    /// Of a cosine or sine: turns over the span.
    #[serde(skip_serializing_if = "Option::is_none")]
    turns: Option<f64>,
    times_rate: bool,
    mantissa: i32,
    shift: u8,
}

fn image(path: &Path, console: &mut Console) -> Result<()> {
    let (image, _, signature) = loading::signed_image(path)?;
    let object = image_object(&image, signature.as_ref());
    console.say(format!(
        "an image for axis {} of {}, sequence {}, SHA-256 {}",
        object.axis, object.serial, object.sequence, object.sha256
    ));
    if let Some(block) = &signature {
        console.say(format!("{}; not checked here: sagnac key verify", words(block)));
    }
    console.say(format!(
        "{} arcsec per output count ({} counts of the log); tick {} ns, temperature period {} ticks, slew {} ticks; zero at {:.3} °C",
        object.arcsec_per_count, object.quantum, object.tick_ns, object.period_ticks, object.slew_ticks, object.reference_c
    ));
    for (at, t) in object.thermometers.iter().enumerate() {
        if let Some(tau_s) = t.warm_up_s {
            console.say(format!("input {at}: the warm-up since power-on, time constant {} s", significant(tau_s, 4)));
            continue;
        }
        let what = match (t.difference, t.repeats) {
            (Some([of, less]), _) => format!("input {at}: {of} less {less}, "),
            (None, Some(of)) => format!("input {at}: {of} once more behind a second lag, "),
            (None, None) if object.thermometers.len() > 1 => format!("input {at}: "),
            (None, None) => String::new(),
        };
        let unit = if t.unit_exponent == 0 { "°C".to_owned() } else { format!("times 2^{}", t.unit_exponent) };
        let rate = if t.has_rate { ", with a rate filter" } else { "" };
        console.say(format!(
            "{what}span {:.3} … {:.3} {unit}, valid range {:.1} … {:.1} {unit}{rate}",
            t.span_c[0], t.span_c[1], t.valid_range_c[0], t.valid_range_c[1]
        ));
    }
    let rows = object.terms.iter().map(|t| {
        let times = if t.times_rate { "rate" } else { "1" };
        let name = match (t.shape, t.from, t.turns) {
            (Some(shape), Some(from), _) => format!("{} {shape} from {from:.3}", t.kind),
            (Some(shape), _, Some(turns)) => format!("{} {shape} of {turns:.3} turns", t.kind),
            _ => format!("{} {}", t.kind, t.order),
        };
        vec![name, t.sensor.to_string(), times.to_owned(), t.mantissa.to_string(), t.shift.to_string()]
    });
    console.say(table(&["term", "input", "times", "mantissa", "shift"], rows));
    console.object(&object)
}

/// τ of a lag filter: α = 1 − e^(−Δt/τ).
fn time_constant_s(lag: &LagSpec, d: &Description) -> f64 {
    let alpha = f64::from(lag.alpha_mantissa) * 2.0_f64.powi(-i32::from(lag.alpha_shift));
    let period_s = f64::from(d.period_ticks) * f64::from(d.tick_ns) * 1e-9;
    -period_s / (-alpha).ln_1p()
}

fn image_object(image: &Image, signature: Option<&SignatureBlock>) -> ImageObject {
    let d = image.description();
    let celsius = |q24: i32| f64::from(q24) / f64::from(1 << 24);
    let thermometers = image.inputs().iter().map(|t| ImageThermometer {
        difference: match t.source {
            ValueSource::Difference { of, less } => Some([of, less]),
            ValueSource::Code | ValueSource::Repeat { .. } | ValueSource::WarmUp => None,
        },
        repeats: match t.source {
            ValueSource::Repeat { of } => Some(of),
            ValueSource::Code | ValueSource::Difference { .. } | ValueSource::WarmUp => None,
        },
        warm_up_s: (t.source == ValueSource::WarmUp).then(|| time_constant_s(&t.lag, d)),
        unit_exponent: t.unit_exponent,
        span_c: [celsius(t.span_lo_q24), celsius(t.span_hi_q24)],
        valid_range_c: [celsius(t.valid_lo_q24), celsius(t.valid_hi_q24)],
        has_rate: t.lag.is_used(),
    });
    let from = |t: &Term, knot_q15: i16| {
        let t = image.inputs().get(usize::from(t.input))?;
        let (lo, hi) = (celsius(t.span_lo_q24), celsius(t.span_hi_q24));
        Some(f64::midpoint(lo, hi) + f64::from(knot_q15) / 32_768.0 * (hi - lo) / 2.0)
    };
    let piece = |t: &Term| match t.shape {
        Shape::Chebyshev(_) => (None, None),
        Shape::Zone { knot_q15 } => (Some("zone"), from(t, knot_q15)),
        Shape::Step { knot_q15 } => (Some("step"), from(t, knot_q15)),
        Shape::Cosine { .. } => (Some("cosine"), None),
        Shape::Sine { .. } => (Some("sine"), None),
    };
    let terms = image.terms().iter().map(|t| ImageTerm {
        shape: piece(t).0,
        from: piece(t).1,
        turns: t.shape.turns_q18().map(|turns| f64::from(turns) / f64::from(1 << 18)),
        kind: if t.kind == Quantity::Bias { "bias" } else { "scale" },
        sensor: t.input,
        order: t.shape.order().unwrap_or(0),
        times_rate: t.multiplier == Multiplier::Rate,
        mantissa: t.mantissa,
        shift: t.shift,
    });
    ImageObject {
        kind: "image",
        serial: image.serial().unwrap_or_default().to_owned(),
        axis: char::from(d.axis),
        sha256: hex(&sha256(&image_bytes(image))),
        arcsec_per_count: d.scale_factor_femto_arcsec as f64 / 1e15,
        quantum: d.quantum_nano_counts as f64 / 1e9,
        tick_ns: d.tick_ns,
        period_ticks: d.period_ticks,
        slew_ticks: d.slew_ticks,
        reference_c: celsius(d.reference_q24),
        sequence: d.sequence,
        parent: hex(&d.parent),
        signature: signature.map(|block| SignatureObject {
            model: model_name(&block.model),
            counter: block.counter,
            key: hex(&block.key_id),
        }),
        thermometers: thermometers.collect(),
        terms: terms.collect(),
    }
}
