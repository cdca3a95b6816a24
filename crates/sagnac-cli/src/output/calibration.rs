//! A calibration for people: an axis with its verdict first, then terms, runs, scale factor, warnings and the search.

use sagnac::calibration::{AxisCalibration, Candidate, Monomial, PpmEstimate, RunOffset, ScaleFactor, SearchStep};
use sagnac::notes::{Note, NoteAbout, NoteLevel};
use sagnac_log::setup::RateUnit;
use sagnac_units::format::{celsius, significant, with_sigma};

use crate::output::console::Console;
use crate::output::tables::excluded;
use crate::output::terminal::table;

/// Candidates shown next to the selected one.
const SHOWN_CANDIDATES: usize = 8;

/// One axis, the verdict first.
pub(crate) fn describe(console: &mut Console, axis: &AxisCalibration, units: RateUnit) {
    console.say(format!("axis {}: {}", axis.axis, verdict(axis, units)));
    let (notes, name) = (axis.notes(units), units.name());
    say_notes(console, axis, &notes, &[NoteAbout::Prior]);
    console.say(coefficients(axis, units));
    conditioning(console, axis, units);
    let whole = axis.monomial.iter().filter(|_| axis.zones.is_empty());
    whole.chain(&axis.zones).for_each(|zone| console.say(powers(zone, units)));
    let offsets = axis.run_offsets.as_slice();
    if offsets.len() > MOST_RUNS {
        console.say(range_of_runs(axis, offsets, units));
    }
    for offset in offsets.iter().filter(|_| offsets.len() <= MOST_RUNS) {
        let bias = offset
            .fixed_bias_dph
            .map_or(String::new(), |b| format!(", fixed bias {} {name}", units.with_sigma(b, offset.sigma_dph)));
        let zeros = if axis.other_signals().next().is_none() { "" } else { ", other inputs at their references" };
        console.say(format!(
            "  run {}: {} {name} at {} °C{zeros}{bias}",
            offset.run,
            units.with_sigma(offset.value_dph, offset.sigma_dph),
            axis.reference_c()
        ));
    }
    if let Some(bias) = axis.correction.fixed_bias {
        let value = units.with_sigma(bias.value_dph, Some(bias.sigma_dph));
        console.say(format!("  the correction removes the fixed bias too: {value} {name}, mean of {} runs", bias.runs));
    }
    if let Some(scale) = axis.scale_factor() {
        console.say(scale_factor(scale, axis.reference_c(), units));
    }
    say_notes(console, axis, &notes, &[NoteAbout::ScaleFactor]);
    let Some(fit) = &axis.fit else { return };
    for m in &fit.misalignment {
        console.say(format!(
            "  misaligned towards {} by {} arcsec",
            m.towards,
            with_sigma(m.arcsec, Some(m.sigma_arcsec))
        ));
    }
    say_notes(console, axis, &notes, &[NoteAbout::Curve, NoteAbout::Fit]);
    if let Some(legs) = fit.hysteresis {
        console.say(format!(
            "  hysteresis (heating minus cooling): {} {name} before, {} {name} after the fit",
            units.with_sigma(legs.before_dph, Some(legs.sigma_dph)),
            units.with_sigma(legs.after_dph, Some(legs.sigma_dph))
        ));
    }
    if let Some(soak) = fit.soak.as_ref().filter(|soak| !soak.improves()) {
        console.say(format!(
            "  one more hour of soak improves the curve by less than 3 % at any temperature: σ of the curve {} (root mean square over the span)",
            units.text(soak.mean_sigma_dph, 3)
        ));
    } else if let Some(soak) = &fit.soak {
        console.say(format!(
            "  to improve the curve, soak one more hour at {:.0} °C: σ of the curve {} → {} (root mean square over the span)",
            soak.best_c,
            units.number(soak.mean_sigma_dph, 3),
            units.text(soak.mean_sigma_after_dph, 3)
        ));
    }
    if fit.candidates.len() > 1 {
        console.say(candidates(&fit.candidates, units));
    }
    if fit.model_search.len() > 1 {
        console.say(model_search(&fit.model_search, units));
    }
    say_notes(console, axis, &notes, &[NoteAbout::Search]);
    for line in excluded(&fit.excluded) {
        console.say(format!("  {line}"));
    }
}

/// Notes about these parts: facts on standard output, others on standard error.
fn say_notes(console: &mut Console, axis: &AxisCalibration, notes: &[Note], about: &[NoteAbout]) {
    for Note { level, about, text, .. } in notes.iter().filter(|note| about.contains(&note.about)) {
        match (level, about) {
            (NoteLevel::Fact, _) => console.say(format!("  {text}")),
            (NoteLevel::Warning, NoteAbout::Fit | NoteAbout::Search) => console.note(format!("warning: {text}")),
            _ => console.note(format!("{}: axis {}: {text}", level.name(), axis.axis)),
        }
    }
}

/// Runs that have a line each; more are one line.
const MOST_RUNS: usize = 8;

/// Many runs in one line: their range and scatter.
fn range_of_runs(axis: &AxisCalibration, offsets: &[RunOffset], units: RateUnit) -> String {
    let by_value = |a: &&RunOffset, b: &&RunOffset| a.value_dph.total_cmp(&b.value_dph);
    let [lowest, highest] = [offsets.iter().min_by(by_value), offsets.iter().max_by(by_value)];
    let end_text = |end: Option<&RunOffset>| {
        end.map_or(String::new(), |o| format!("{} (run {})", units.with_sigma(o.value_dph, o.sigma_dph), o.run))
    };
    let mean = offsets.iter().map(|offset| offset.value_dph).sum::<f64>() / offsets.len() as f64;
    let square = offsets.iter().map(|offset| (offset.value_dph - mean).powi(2)).sum::<f64>();
    let scatter = (square / (offsets.len() - 1).max(1) as f64).sqrt();
    format!(
        "  {} runs at {} °C: {} … {} {}, scatter σ {}; the record has each",
        offsets.len(),
        axis.reference_c(),
        end_text(lowest),
        end_text(highest),
        units.name(),
        units.text(scatter, 2)
    )
}

/// The other inputs, the conditioning of the terms, and the effect of thermometer noise.
fn conditioning(console: &mut Console, axis: &AxisCalibration, units: RateUnit) {
    for input in axis.other_inputs() {
        let [lo, hi] = input.span;
        let effect = match input.rms_dph.filter(|rms| *rms > 0.0) {
            None => "read for a difference".to_owned(),
            Some(rms) => format!("its terms make {} rms", units.text(rms, 3)),
        };
        console.say(format!(
            "  input {}: {effect}; reference {}, span {} to {}",
            input.name,
            input.on_its_scale(input.reference),
            input.on_its_scale(lo),
            input.on_its_scale(hi)
        ));
    }
    let fit = axis.fit.as_ref();
    let near = fit
        .and_then(|fit| fit.collinearity.as_ref())
        .map(|near| format!("collinearity {} (limit {})", significant(near.condition, 3), significant(near.limit, 3)));
    let noise = fit.and_then(|fit| fit.correction_noise.as_ref()).map(|noise| {
        let part = |part: f64| format!("{} %", significant(100.0 * part, 2));
        let raw = noise.increase.map_or("the raw one is not known".to_owned(), |more| {
            let note =
                if more > noise.limit { "; the value terms make it: a quieter thermometer would help" } else { "" };
            format!("{} more than raw, at most {}{note}", part(more), part(noise.limit))
        });
        let (factor, unit) = units.shown("deg/rt h");
        format!(
            "thermometer noise makes {} {unit} of angle random walk ({raw})",
            significant(factor * noise.deg_rt_h, 2)
        )
    });
    let words: Vec<String> = near.into_iter().chain(noise).collect();
    if !words.is_empty() {
        console.say(format!("  {}", words.join("; ")));
    }
}

/// A curve in powers of °C, with the zone it is of.
fn powers(monomial: &Monomial, units: RateUnit) -> String {
    let sigmas = monomial.sigma.as_deref().unwrap_or(&[]);
    let (factor, unit) = units.shown(&monomial.unit);
    let powers = monomial.coefficients.iter().enumerate().map(|(power, value)| {
        let value = with_sigma(factor * value, sigmas.get(power).map(|sigma| factor * sigma));
        if power == 0 { value } else { format!("({value})·T^{power}") }
    });
    let zone = monomial.range_c.map_or(String::new(), |[from, to]| format!(", {from:.2} … {to:.2} °C"));
    let sum = powers.collect::<Vec<_>>().join(" + ");
    format!("  in powers of °C ({unit}, {} s{zone}): {sum}", monomial.window_s)
}

/// The search from the grid's model to the one selected, with the best of each step.
fn model_search(steps: &[SearchStep], units: RateUnit) -> String {
    let last = steps.last().map_or(0, |step| step.step);
    let rows: Vec<Vec<String>> = SearchStep::rows(steps, units).into_iter().map(Vec::from).collect();
    if rows.len() < 2 {
        let tried = match steps.len() - 1 {
            1 => "1 model".to_owned(),
            models => format!("{models} models"),
        };
        return format!("  {tried} with one term more or less: none is justified, and none smaller is as good");
    }
    let title = format!("model search, {last} steps, {} models", steps.len());
    table(&["step", &title, &format!("held-out σ, {}", units.name()), "condition", ""], rows)
}

fn verdict(axis: &AxisCalibration, units: RateUnit) -> String {
    let mut parts = vec![format!("`{}`", axis.correction.model)];
    if let Some(cv) = axis.cross_validation() {
        parts.push(format!("held-out σ {} ({}, {})", units.text(cv.sigma_dph, 3), cv.folds, cv.scheme));
    }
    if let Some(residual) = axis.residual() {
        parts.push(format!("residual σ {} over {} windows", units.text(residual.sigma_dph, 3), residual.n));
    }
    parts.push(match axis.noise_floor() {
        Some(floor) => format!("noise floor {}", units.text(floor.value_dph, 3)),
        None => "noise floor unknown".to_owned(),
    });
    parts.push(format!("span {:.2} … {:.2} °C", axis.span_c()[0], axis.span_c()[1]));
    parts.join("; ")
}

fn coefficients(axis: &AxisCalibration, units: RateUnit) -> String {
    let shown = |value: f64, sigma: Option<f64>, of_record: &str| {
        let (factor, unit) = units.shown(of_record);
        [with_sigma(factor * value, sigma.map(|sigma| factor * sigma)), unit]
    };
    let terms = axis.correction.terms.iter().map(|term| {
        let mark = if term.significant == Some(false) { "not significant" } else { "" };
        let [value, unit] = shown(term.value, term.sigma, &term.unit);
        vec![axis.name_of(term), value, unit, mark.to_owned()]
    });
    let others = axis.nonlinear().into_iter().map(|parameter| {
        let mark =
            if parameter.sigma.is_none() { "not determined by this data: any smaller value fits as well" } else { "" };
        let [value, unit] = shown(parameter.value, parameter.sigma, &parameter.unit);
        vec![parameter.name, value, unit, mark.to_owned()]
    });
    let rows: Vec<Vec<String>> = terms.chain(others).collect();
    if rows.is_empty() {
        return "  no term is justified: the drift does not follow temperature beyond the noise".to_owned();
    }
    table(&["term", "value ± σ", "unit", ""], rows)
}

/// The scale factor at T0 and plateau by plateau.
fn scale_factor(scale: &ScaleFactor, reference_c: f64, units: RateUnit) -> String {
    let at = scale.at_reference;
    let s = scale.arcsec_per_count.map_or(String::new(), |s| format!(", S = {s:.8} arcsec per count"));
    let mut out =
        format!("  scale factor at {reference_c} °C: {} ppm from nominal{s}", with_sigma(at.ppm, Some(at.sigma_ppm)));
    if let Some(r) = scale.repeatability {
        out += &format!(
            "\n  repeatability over {} temperatures: σ {} ppm (noise makes {})",
            r.temperatures,
            significant(r.sigma_ppm, 2),
            significant(r.of_noise_ppm, 2)
        );
    }
    let estimate = |e: Option<PpmEstimate>| e.map_or("-".to_owned(), |e| with_sigma(e.ppm, Some(e.sigma_ppm)));
    let rows = scale.plateaus.iter().map(|p| {
        vec![
            celsius(p.temperature_c),
            p.rates_dps.iter().map(|rate| significant(*rate, 4)).collect::<Vec<_>>().join(" "),
            estimate(Some(p.scale)),
            units.with_sigma(p.bias_dph, Some(p.bias_sigma_dph)),
            estimate(p.nonlinearity),
            estimate(p.asymmetry),
        ]
    });
    let at_rest = format!("rate at rest, {}", units.name());
    let header = ["plateau, °C", "rates, °/s", "scale, ppm", &at_rest, "nonlinearity, ppm", "asymmetry, ppm"];
    let rows: Vec<Vec<String>> = rows.collect();
    if rows.is_empty() { out } else { out + "\n" + &table(&header, rows) }
}

fn candidates(all: &[Candidate], units: RateUnit) -> String {
    let mut ranked: Vec<&Candidate> = all.iter().collect();
    ranked.sort_by(|a, b| a.held_out_dph.unwrap_or(f64::INFINITY).total_cmp(&b.held_out_dph.unwrap_or(f64::INFINITY)));
    let shown = ranked.iter().enumerate().filter(|(i, c)| *i < SHOWN_CANDIDATES || c.chosen).map(|(_, c)| {
        let held_out = c.held_out_dph.map_or("not fitted".to_owned(), |h| units.number(h, 4));
        let mark = if c.chosen { "selected: larger models gain too little" } else { "" };
        vec![c.model.clone(), c.coefficients.to_string(), held_out, mark.to_owned()]
    });
    let shown: Vec<Vec<String>> = shown.collect();
    let title = format!("{} of {} candidates", shown.len(), all.len());
    table(&[&title, "coefficients", &format!("held-out σ, {}", units.name()), ""], shown)
}
