//! Tables of the page: coefficients, what speaks against them, and how the model was found.

use maud::{Markup, html};

use crate::calibration::{AxisCalibration, Candidate, Monomial, PathStep, PathVerdict};
use crate::digits::{significant, with_sigma};

/// Candidates shown besides the one that was taken.
const SHOWN_CANDIDATES: usize = 12;

pub(crate) fn coefficients(axis: &AxisCalibration) -> Markup {
    let further = axis.inputs.iter().filter_map(|input| Some((format!("lag({})", input.name), input.lag_s?)));
    let lags = axis.lag_s.map(|lag| ("lag".to_owned(), lag)).into_iter().chain(further);
    let in_zones = if axis.zones.is_empty() { std::slice::from_ref(&axis.monomial) } else { &axis.zones };
    html! {
        h3 { "Coefficients" }
        @if axis.terms.is_empty() {
            p { "No term earns its place: the drift does not follow temperature beyond the noise." }
        } @else {
            p.note {
                "Chebyshev polynomials of temperature scaled to " (format!("{:.3} … {:.3}", axis.span_c[0], axis.span_c[1]))
                " °C, zero at " (axis.reference_c) " °C: what the target computes with."
            }
            div.scroll { table {
                tr { th { "term" } th { "value ± σ" } th.words { "unit" } th { "variance ×" } th.words { "" } }
                @for term in &axis.terms {
                    tr {
                        td { (term.name(axis.is_main(term))) } td { (with_sigma(term.value, term.sigma)) }
                        td.words { (term.unit) }
                        td { (term.inflation.map_or(String::new(), |v| significant(v, 2))) }
                        td.words { @if term.significant == Some(false) { "not significant at 95 %" } }
                    }
                }
                @for (name, lag) in lags {
                    tr {
                        td { (name) } td { (lag.sigma.map_or_else(|| significant(lag.value, 3), |s| with_sigma(lag.value, Some(s)))) } td.words { "s" } td {}
                        td.words { @if lag.sigma.is_none() { "not resolved: the smallest within 2 % of the least misfit" } }
                    }
                }
            } }
        }
        (inputs_and_doubts(axis))
        p.note {
            "The same curve at rest in powers of °C, " (axis.monomial.unit) " of " (axis.monomial.window_s) " s, with the constant of run "
            (axis.monomial.run) ":"
        }
        @for zone in in_zones { (powers(zone)) }
        div.scroll { table {
            tr { th { "run of the fit" } th { "constant ± σ, °/h" } th { "fixed bias, °/h" } }
            @for constant in &axis.constants {
                tr {
                    td { (constant.run) } td { (with_sigma(constant.value_dph, constant.sigma_dph)) }
                    td { (constant.fixed_bias_dph.map_or("input rate not known".to_owned(), |b| with_sigma(b, constant.sigma_dph))) }
                }
            }
        } }
    }
}

/// A curve in powers of °C, with the zone it is of.
fn powers(monomial: &Monomial) -> Markup {
    let sigma = |power: usize| monomial.sigma.as_ref().and_then(|all| all.get(power).copied());
    html! {
        div.scroll { table {
            tr {
                th { @match monomial.from_to_c { Some([from, to]) => { (format!("{from:.2} … {to:.2} °C")) } None => { "power" } } }
                th { "value ± σ" }
            }
            @for (power, value) in monomial.coefficients.iter().enumerate() {
                tr { td { "T" sup { (power) } } td { (with_sigma(*value, sigma(power))) } }
            }
        } }
    }
}

/// What the target must read besides its thermometer; how near the terms are to each other; what thermometer noise does.
fn inputs_and_doubts(axis: &AxisCalibration) -> Markup {
    html! {
        @if !axis.inputs.is_empty() {
            p.note { "Further inputs: the target must read them too, but for differences of two." }
            div.scroll { table {
                tr { th.words { "input" } th { "its terms make, °/h rms" } th { "no effect at" } th { "seen from" } th { "to" } }
                @for input in &axis.inputs {
                    tr {
                        td.words { (input.name) }
                        td { @if input.rms_dph > 0.0 { (significant(input.rms_dph, 3)) } @else { "read for a difference" } }
                        td { (significant(input.reference, 5)) }
                        td { (significant(input.span[0], 5)) } td { (significant(input.span[1], 5)) }
                    }
                }
            } }
        }
        @if let Some(near) = &axis.collinearity {
            p.note {
                "Condition of the terms " (significant(near.condition, 3)) ", at most " (significant(near.limit, 3))
                "; “variance ×” is by how much the other terms multiply a coefficient's variance."
            }
        }
        @if let Some(noise) = &axis.correction_noise {
            p.note {
                "Thermometer noise through these terms makes " (significant(noise.deg_rt_h, 2)) " °/√h of angle random walk"
                @if let Some(more) = noise.increase {
                    ": " (significant(100.0 * more, 2)) " % more than the raw one, at most "
                    (significant(100.0 * noise.limit, 2)) " %"
                }
                "."
            }
        }
    }
}

/// The way from the grid's model to the one taken.
pub(crate) fn path(steps: &[PathStep]) -> Markup {
    let words = |verdict: PathVerdict| match verdict {
        PathVerdict::Start => "start",
        PathVerdict::Taken => "taken",
        PathVerdict::NoGain => "",
        PathVerdict::Missed => "",
        PathVerdict::Collinear => "refused: collinear",
        PathVerdict::NotFitted => "not fitted",
        PathVerdict::TooNoisy => "left: its thermometer is too noisy",
        PathVerdict::LagRaised => "lag raised for the thermometer's noise",
    };
    html! {
        @if steps.len() > 1 {
            h3 { "Path" }
            p.note {
                "One order, zone table or set of steps more while that earns its coefficients on data the fit did not see; then one less \
                 while none is missed."
            }
            div.scroll { table {
                tr { th { "step" } th { "model" } th { "held-out σ, °/h" } th { "condition" } th.words { "" } }
                @for step in steps {
                    tr.taken[step.verdict == PathVerdict::Taken || step.verdict == PathVerdict::Start] {
                        td { (step.step) } td { (step.model) }
                        td { (step.held_out_dph.map_or("-".to_owned(), |h| significant(h, 4))) }
                        td { (step.condition.map_or("-".to_owned(), |c| significant(c, 3))) }
                        td.words { (words(step.verdict)) }
                    }
                }
            } }
        }
    }
}

pub(crate) fn candidates(all: &[Candidate]) -> Markup {
    let mut ranked: Vec<&Candidate> = all.iter().collect();
    ranked.sort_by(|a, b| a.held_out_dph.unwrap_or(f64::INFINITY).total_cmp(&b.held_out_dph.unwrap_or(f64::INFINITY)));
    let least = ranked.first().map_or("", |c| c.model.as_str());
    let rows = ranked.iter().enumerate().filter(|(i, c)| *i < SHOWN_CANDIDATES || c.chosen).map(|(_, c)| *c);
    html! {
        @if all.len() > 1 {
            h3 { "Candidates" }
            p.note {
                (all.len()) " models were tried on data that each fit did not see. The least held-out mean square is that of " code { (least) }
                "; the smallest model within 2 % of it is taken."
            }
            div.scroll { table {
                tr { th { "model" } th { "coefficients" } th { "held-out σ, °/h" } th.words { "" } }
                @for candidate in rows {
                    tr.taken[candidate.chosen] {
                        td { (candidate.model) } td { (candidate.coefficients) }
                        td { (candidate.held_out_dph.map_or("not fitted".to_owned(), |h| significant(h, 4))) }
                        td.words { @if candidate.chosen { "taken" } }
                    }
                }
            } }
        }
    }
}
