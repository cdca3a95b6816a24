//! Tables of the page: coefficients, their conditioning, and how the model was found.

use maud::{Markup, html};
use sagnac_log::setup::RateUnit;

use sagnac::calibration::{AxisCalibration, Candidate, Monomial, Prediction, SearchStep};
use sagnac_units::format::{celsius, on_scale, significant, with_sigma};

/// Candidates shown next to the selected one.
const SHOWN_CANDIDATES: usize = 12;

pub(crate) fn coefficients(axis: &AxisCalibration, units: RateUnit) -> Markup {
    let shown = |value: f64, sigma: Option<f64>, of_record: &str| {
        let (factor, unit) = units.shown(of_record);
        (factor * value, sigma.map(|sigma| factor * sigma), unit)
    };
    let in_zones: Vec<&Monomial> =
        if axis.zones.is_empty() { axis.monomial.iter().collect() } else { axis.zones.iter().collect() };
    html! {
        h3 { "Coefficients" }
        @if axis.correction.terms.is_empty() {
            p { "No term is justified: the drift does not follow temperature beyond the noise." }
        } @else {
            p.note {
                "Chebyshev polynomials of temperature scaled to " (format!("{:.3} … {:.3}", axis.span_c()[0], axis.span_c()[1]))
                " °C, zero at " (axis.reference_c()) " °C, as the target computes them."
            }
            div.scroll { table {
                thead { tr {
                    th { "term" } th { "value ± σ" } th.words { "unit" } th { "VIF" }
                    th.words { "" }
                } }
                @for term in &axis.correction.terms {
                    @let (value, sigma, unit) = shown(term.value, term.sigma, &term.unit);
                    tr {
                        td { (axis.name_of(term)) } td { (with_sigma(value, sigma)) }
                        td.words { (unit) }
                        td { (term.vif.map_or("-".to_owned(), |v| significant(v, 2))) }
                        td.words { @if term.significant == Some(false) { "not significant at 95 %" } }
                    }
                }
                @for parameter in axis.nonlinear() {
                    @let (value, sigma, unit) = shown(parameter.value, parameter.sigma, &parameter.unit);
                    tr {
                        td { (parameter.name) } td { (sigma.map_or_else(|| significant(value, 3), |sigma| with_sigma(value, Some(sigma)))) }
                        td.words { (unit) } td {}
                        td.words { @if parameter.sigma.is_none() { "not determined by this data: any smaller value fits as well" } }
                    }
                }
            } }
        }
        (inputs_and_conditioning(axis, units))
        @match &axis.monomial {
            Some(monomial) => p.note {
                "The same curve at rest in powers of °C, " (units.shown(&monomial.unit).1) " of " (monomial.window_s) " s, with the offset of run "
                (monomial.run) ":"
            },
            None => p.note { "The curve at rest is no polynomial of the temperature, so it has no powers of °C." },
        }
        @for zone in &in_zones { (powers(zone, units)) }
        (expected(axis, units))
        div.scroll { table {
            thead { tr { th { "run of the fit" } th { "offset ± σ, " (units.name()) } th { "fixed bias, " (units.name()) } } }
            @for offset in &axis.run_offsets {
                tr {
                    td { (offset.run) } td { (units.with_sigma(offset.value_dph, offset.sigma_dph)) }
                    td { (offset.fixed_bias_dph.map_or("input rate not known".to_owned(), |b| units.with_sigma(b, offset.sigma_dph))) }
                }
            }
        } }
        @if let Some(bias) = axis.correction.fixed_bias {
            p.note { "The correction removes the fixed bias too: " (units.with_sigma(bias.value_dph, Some(bias.sigma_dph))) " " (units.name()) ", the mean of " (bias.runs) " runs." }
        }
    }
}

/// Temperatures in the table of expected values.
const EXPECTED_AT: usize = 7;

/// The curve at rest with its intervals.
fn expected(axis: &AxisCalibration, units: RateUnit) -> Markup {
    let [lo, hi] = axis.span_c();
    let at = (0..EXPECTED_AT).map(|i| (lo + (hi - lo) * i as f64 / (EXPECTED_AT - 1) as f64).min(hi));
    let rows: Vec<(f64, Prediction)> = at.filter_map(|celsius| Some((celsius, axis.predict(celsius)?))).collect();
    html! {
        @if !rows.is_empty() && !axis.correction.terms.is_empty() {
            p.note { "What to expect at rest, less its value at " (axis.reference_c()) " °C, with 95 % confidence: of the curve, and of a further window of a run whose offset is known." }
            div.scroll { table {
                thead { tr { th { "°C" } th { "drift, " (units.name()) } th { "curve ±, " (units.name()) } th { "a window ±, " (units.name()) } } }
                @for (celsius_at, said) in &rows {
                    tr {
                        td { (celsius(*celsius_at)) } td { (on_scale(units.of_dph(said.drift_dph), 1000.0 * units.of_dph(said.curve_dph))) }
                        td { (units.number(said.curve_dph, 2)) } td { (units.number(said.window_dph, 2)) }
                    }
                }
            } }
        }
    }
}

/// A curve in powers of °C, with the zone it is of.
fn powers(monomial: &Monomial, units: RateUnit) -> Markup {
    let (factor, unit) = units.shown(&monomial.unit);
    let sigma = |power: usize| monomial.sigma.as_ref().and_then(|all| Some(factor * all.get(power)?));
    html! {
        div.scroll { table {
            thead { tr {
                th { @match monomial.range_c { Some([from, to]) => { (format!("{from:.2} … {to:.2} °C")) } None => { "power" } } }
                th { "value ± σ" } th.words { "unit" }
            } }
            @for (power, value) in monomial.coefficients.iter().enumerate() {
                tr {
                    td { "T" sup { (power) } } td { (with_sigma(factor * value, sigma(power))) }
                    td.words { (unit) @match power { 0 => {} 1 => { " per °C" } _ => { " per °C" sup { (power) } } } }
                }
            }
        } }
    }
}

/// The other inputs of the target; the conditioning of the terms; the effect of thermometer noise.
fn inputs_and_conditioning(axis: &AxisCalibration, units: RateUnit) -> Markup {
    let (factor, walk) = units.shown("deg/rt h");
    html! {
        @if !axis.other_inputs().is_empty() {
            p.note { "Other inputs: the target must read them too, except for differences of two and repeats for a slow lag." }
            div.scroll { table {
                thead { tr {
                    th.words { "input" } th.words { "unit" } th { "its terms, " (units.name()) " rms" } th { "reference" } th { "span from" } th { "to" }
                } }
                @for input in axis.other_inputs() {
                    tr {
                        td.words { (input.name) }
                        td.words { @if axis.is_in_celsius(input) { "°C" } @else { "of its column" } }
                        @if let Some(rms_dph) = input.rms_dph.filter(|rms| *rms > 0.0) {
                            td { (units.number(rms_dph, 3)) } td { (input.on_its_scale(input.reference)) }
                        } @else {
                            td { "read for a difference only" } td { "-" }
                        }
                        td { (input.on_its_scale(input.span[0])) } td { (input.on_its_scale(input.span[1])) }
                    }
                }
            } }
        }
        @if let Some(near) = axis.fit.as_ref().and_then(|fit| fit.collinearity.as_ref()) {
            p.note {
                "Collinearity of the terms " (significant(near.condition, 3)) ", at most " (significant(near.limit, 3))
                "; VIF, the variance inflation factor, is by how much the other terms multiply the variance of a coefficient."
            }
        }
        @if let Some(noise) = axis.fit.as_ref().and_then(|fit| fit.correction_noise.as_ref()) {
            p.note {
                "Thermometer noise through these terms makes " (significant(factor * noise.deg_rt_h, 2)) " " (walk) " of angle random walk"
                @if let Some(more) = noise.increase {
                    ": " (significant(100.0 * more, 2)) " % more than the raw one, at most "
                    (significant(100.0 * noise.limit, 2)) " %"
                }
                "."
            }
        }
    }
}

/// The search from the grid's model to the one selected.
pub(crate) fn model_search(steps: &[SearchStep], units: RateUnit) -> Markup {
    let rows = SearchStep::rows(steps, units);
    html! {
        @if steps.len() > 1 {
            h3 { "Model search" }
            p.note {
                "One order, zone table or set of steps more while that is justified on data the fit did not see; then one less \
                 while none is needed. " (steps.len()) " models were tried; the record holds every one of them."
            }
            div.scroll { table {
                thead { tr { th { "step" } th.model { "model" } th { "σ on unseen data, " (units.name()) } th { "condition" } th.words { "" } } }
                @for [step, model, held_out, condition, words] in &rows {
                    tr { td { (step) } td.model { (model) } td { (held_out) } td { (condition) } td.words { (words) } }
                }
            } }
        }
    }
}

pub(crate) fn candidates(all: &[Candidate], units: RateUnit) -> Markup {
    let mut ranked: Vec<&Candidate> = all.iter().collect();
    ranked.sort_by(|a, b| a.held_out_dph.unwrap_or(f64::INFINITY).total_cmp(&b.held_out_dph.unwrap_or(f64::INFINITY)));
    let least = ranked.first().map_or("", |c| c.model.as_str());
    let rows = ranked.iter().enumerate().filter(|(i, c)| *i < SHOWN_CANDIDATES || c.chosen).map(|(_, c)| *c);
    html! {
        @if all.len() > 1 {
            h3 { "Candidates" }
            p.note {
                (all.len()) " models were tried on data that each fit did not see. The smallest σ on unseen data is that of " code { (least) }
                ". The smallest model is selected that larger ones hardly improve."
            }
            div.scroll { table {
                thead { tr { th.model { "model" } th { "coefficients" } th { "σ on unseen data, " (units.name()) } th.words { "" } } }
                @for candidate in rows {
                    tr.selected[candidate.chosen] {
                        td.model { (candidate.model) } td { (candidate.coefficients) }
                        td { (candidate.held_out_dph.map_or("not fitted".to_owned(), |h| units.number(h, 4))) }
                        td.words { @if candidate.chosen { "selected" } }
                    }
                }
            } }
        }
    }
}
