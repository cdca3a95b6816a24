//! `sagnac inspect` of a flash image: its head, inputs and terms.

use std::path::Path;

use sagnac::Result;
use sagnac::export::image_bytes;
use sagnac_core::{Description, Image, Kind, LagSpec, Multiplier, Shape, SignatureBlock, Term, ValueSource};
use sagnac_log::ingest::{hex, sha256};
use sagnac_units::format::significant;
use serde::Serialize;

use crate::args::signature::{model_name, words};
use crate::files::loading;
use crate::output::console::Console;
use crate::output::terminal::table;

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

pub(super) fn image(path: &Path, console: &mut Console) -> Result<()> {
    let (image, _, signature) = loading::signed_image(path)?;
    let object = image_object(&image, signature.as_ref());
    console.say(format!(
        "an image for axis {} of {}, sequence {}, SHA-256 {}",
        object.axis, object.serial, object.sequence, object.sha256
    ));
    if let Some(block) = &signature {
        console.say(format!("{}; not checked here: sagnac key verify", words(block)));
    }
    let dps_per_count = object.arcsec_per_count / 3600.0 / (f64::from(object.tick_ns) * 1e-9);
    console.say(format!(
        "{} arcsec per output count ({} counts of the log), {} °/s at one count a tick; tick {} ns, temperature period {} ticks, slew {} ticks; zero at {:.3} °C",
        object.arcsec_per_count, object.quantum, significant(dps_per_count, 6), object.tick_ns, object.period_ticks, object.slew_ticks, object.reference_c
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
        kind: if t.kind == Kind::Bias { "bias" } else { "scale" },
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
