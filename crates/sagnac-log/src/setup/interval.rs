//! An interval in a setup: two numbers, the lower first.

use serde::{Deserialize, Deserializer};

use crate::error::{Error, Result};

/// Two numbers, no more and no fewer.
///
/// # Errors
/// Another number of them; what is no number.
pub(super) fn interval<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<[f64; 2], D::Error> {
    pair(Vec::deserialize(from)?)
}

/// The same where it may be absent.
///
/// # Errors
/// As [`interval`].
pub(super) fn some_interval<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Option<[f64; 2]>, D::Error> {
    Option::deserialize(from)?.map(pair).transpose()
}

fn pair<E: serde::de::Error>(numbers: Vec<f64>) -> std::result::Result<[f64; 2], E> {
    let count = numbers.len();
    numbers.try_into().map_err(|_| E::custom(format!("needs two values, the lower first, and has {count}")))
}

/// Refuses an interval that is empty or leaves `most`.
pub(super) fn check_interval(name: &str, [lo, hi]: [f64; 2], most: [f64; 2]) -> Result<()> {
    if lo >= most[0] && lo < hi && hi <= most[1] {
        return Ok(());
    }
    let key = name.rsplit('.').next().unwrap_or(name);
    let help = format!("write it like {key} = [0, 5], within {} … {}", most[0], most[1]);
    Err(Error::input("must be two values, the lower first", help).column(name).value(format!("[{lo}, {hi}]")))
}

#[cfg(test)]
mod tests {
    use crate::setup::{BenchSetup, Setup};

    #[test]
    fn an_interval_has_two_numbers_the_lower_first() {
        let at = |value: &str| {
            let keys = [
                format!("[bench]\nspan_c = {value}"),
                format!("[[thermometer]]\nvalid_range_c = {value}"),
                format!("[[aux]]\nname = \"supply_v\"\nvalid_range = {value}"),
            ];
            keys.map(|text| text.parse::<Setup>().and_then(|setup| setup.check()))
        };
        for wrong in ["[-40]", "[-40, 70, 1]", "[]", "[70, -40]", "[5, 5]", "[nan, 5]", "[0, inf]", "5", "[\"a\", 3]"] {
            for said in at(wrong) {
                let said = said.expect_err(wrong).to_string();
                let named = said.contains("two") || said.contains("invalid type");
                assert!(named, "{wrong}: {said}");
            }
        }
        assert!(at("[-40, 70]").iter().all(std::result::Result::is_ok));
        // As a record and a journal hold a setup without one.
        let setup: Setup = "[bench]\nramp_cpm = 1.0\n[[aux]]\nname = \"supply_v\"".parse().unwrap();
        let again: Setup = serde_json::from_str(&serde_json::to_string(&setup).unwrap()).unwrap();
        assert_eq!(again.aux, setup.aux);
        let bench = serde_json::to_string(&setup.bench).unwrap();
        let again: BenchSetup = serde_json::from_str(&bench).unwrap();
        assert!(bench.contains("\"span_c\":null") && again == setup.bench, "{bench}");
    }
}
