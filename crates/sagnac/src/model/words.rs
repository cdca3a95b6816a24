//! A model as people name it: `cubic + dT/dt` for `bias 3, rate 0`.
//!
//! For reading only: `--model` takes the words of [`crate::model::spec`].

use crate::model::spec::{InputTerms, ModelSpec};

/// Orders that have a name.
const ORDERS: [&str; 6] = ["constant", "linear", "quadratic", "cubic", "quartic", "quintic"];

fn order(order: u8) -> String {
    ORDERS.get(usize::from(order)).map_or_else(|| format!("order {order}"), |name| (*name).to_owned())
}

/// A rate term, with how it changes over the input.
fn rate(of: &str, series: u8) -> String {
    if series == 0 { of.to_owned() } else { format!("{of} ({})", order(series)) }
}

impl ModelSpec {
    /// As people name it; `constant` where nothing depends on temperature.
    pub fn words(&self) -> String {
        let parts: Vec<String> = self.inputs().iter().flat_map(of_input).collect();
        if parts.is_empty() { ORDERS[0].to_owned() } else { parts.join(" + ") }
    }
}

fn of_input(terms: &InputTerms) -> Vec<String> {
    let of = |what: &str| if terms.input.is_empty() { what.to_owned() } else { format!("{what} of {}", terms.input) };
    let derivative = if terms.input.is_empty() { "dT/dt".to_owned() } else { format!("d({})/dt", terms.input) };
    let mut parts = Vec::new();
    match (terms.bias, terms.zones) {
        (0, 0) => {}
        (0, zones) => parts.push(format!("{zones} zones")),
        (bias, 0) => parts.push(of(&order(bias))),
        (bias, zones) => parts.push(format!("{} in {zones} zones", order(bias))),
    }
    parts.extend(terms.rate.map(|series| rate(&derivative, series)));
    parts.extend(terms.slow_rate.map(|series| rate(&format!("slow {derivative}"), series)));
    parts.extend((terms.scale > 0).then(|| of(&format!("{} scale factor", order(terms.scale)))));
    parts.extend(terms.steps.map(|_| of("steps")));
    parts.extend(terms.harmonics.iter().map(|harmonic| of(harmonic.word())));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_model_has_its_name() {
        let names = [
            ("bias 0", "constant"),
            ("bias 1", "linear"),
            ("bias 3, rate 0", "cubic + dT/dt"),
            ("bias 7, rate 1", "order 7 + dT/dt (linear)"),
            ("bias 3, rate 1, slow rate 0", "cubic + dT/dt (linear) + slow dT/dt"),
            ("bias 2, zones 4", "quadratic in 4 zones"),
            ("bias 3, rate 0, scale 2", "cubic + dT/dt + quadratic scale factor"),
            ("bias 2, bias(cavity - block) 1, steps(mode)", "quadratic + linear of cavity - block + steps of mode"),
            ("bias 2, rate(cavity) 0", "quadratic + d(cavity)/dt"),
            ("bias 2, harmonic(path_length_v) 25.3", "quadratic + harmonic of path_length_v"),
        ];
        for (spec, name) in names {
            assert_eq!(spec.parse::<ModelSpec>().unwrap().words(), name, "{spec}");
        }
    }
}
