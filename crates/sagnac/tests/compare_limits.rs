//! Single comparisons; those over many records are in `measured/verify/compare_limits.rs`.

use crate::hostile::Bench;
use crate::measured::verify::compare_limits::{judged, missed, navigation, usual};
use crate::support::fit;
use sagnac::compare::{COMPARED, Comparison};
use sagnac::verify::SPECS;
use sagnac::{Limits, Setup};

#[test]
fn what_is_not_asked_says_so() {
    let limits = navigation();
    let record =
        |seed: u64, setup: &Setup, model: &str| fit(vec![Bench::new(seed, &usual).log()], setup, model).unwrap();
    let setup = Bench::setup();
    let [a, b] = [1, 2].map(|seed| record(seed, &setup, "bias 3, rate 0"));
    let found = judged(vec![a.clone(), b.clone()], &limits);
    let of = |found: &Comparison, key: &str| found.axes[0].limits.iter().find(|l| l.name == key).unwrap().clone();
    assert!(found.passed(), "{:?}", found.axes[0].limits);
    let asked: Vec<&str> = found.axes[0].limits.iter().filter(|l| l.pass.is_some()).map(|l| l.name.as_str()).collect();
    assert_eq!(
        asked,
        [
            "sigma_beyond_floor_dph_max",
            "span_covered_min",
            "drift_dph_per_c_max",
            "drift_dph_per_cpm_max",
            "hysteresis_dph_max",
            "arw_deg_rt_h_max",
            "temperature_residual_dph_max",
            "bias_repeatability_dph_max"
        ]
    );
    assert_eq!(of(&found, "arw_increase_max").why.unwrap(), "needs a retest: `sagnac verify`");
    assert!(of(&found, "scale_factor_repeatability_ppm_max").why.unwrap().contains("was not made on a rate table"));
    // The order of the records does not matter.
    let turned = judged(vec![b.clone(), a.clone()], &limits);
    for limit in &found.axes[0].limits {
        let other = of(&turned, &limit.name);
        assert_eq!((limit.pass, limit.value.is_some()), (other.pass, other.value.is_some()));
        limit
            .value
            .zip(other.value)
            .into_iter()
            .for_each(|(x, y)| assert!((x - y).abs() < 1e-6, "{limit:?} {other:?}"));
    }
    // One input rate is not known: the bias is not asked, the rest is.
    let blind = record(3, &Setup { input_rate_dph: None, ..setup.clone() }, "bias 3, rate 0");
    let found = judged(vec![a.clone(), blind], &limits);
    assert!(found.passed() && of(&found, "bias_repeatability_dph_max").why.unwrap().contains("month-1.cal.json"));
    // A record without rate terms hides their change: not met.
    let bare = record(4, &setup, "bias 3");
    let found = judged(vec![a.clone(), bare], &limits);
    assert!(of(&found, "drift_dph_per_cpm_max").why.unwrap().contains("has no rate term"));
    assert!(missed(&found).contains(&"drift_dph_per_cpm_max"));
    // Records of one log, and limits of which none is asked, are not accepted.
    assert!(!judged(vec![a.clone(), a.clone()], &limits).passed());
    let other: Limits = "arw_increase_max = 1.05".parse().unwrap();
    assert!(!judged(vec![a, b], &other).passed());
}

/// A change of a quarter of its guard band beyond the limit is not decided, and how much more would decide is stated.
#[test]
fn a_change_near_its_limit_is_not_decided() {
    let record = |seed: u64| fit(vec![Bench::new(seed, &usual).log()], &Bench::setup(), "bias 3, rate 0").unwrap();
    let records = vec![record(1), record(2)];
    let found = judged(records.clone(), &navigation());
    let bias = found.axes[0].limits.iter().find(|l| l.name == "bias_repeatability_dph_max").unwrap();
    let (value, sigma) = (bias.value.unwrap(), bias.sigma.unwrap());
    for (limit, word) in [(value + 2.0 * sigma, "met"), (value + 0.5 * sigma, "not decided")] {
        let limits: Limits = format!("decision = \"guarded\"\nbias_repeatability_dph_max = {limit}").parse().unwrap();
        let found = judged(records.clone(), &limits);
        let limit = &found.axes[0].limits[0];
        assert_eq!((limit.word(), found.passed()), (word, word == "met"), "{limit:?}");
        let remark = limit.remark().unwrap();
        assert_eq!(remark.contains("more hours would decide"), word == "not decided", "{remark}");
    }
    let simple: Limits = format!("bias_repeatability_dph_max = {}", value + 0.5 * sigma).parse().unwrap();
    assert!(judged(records, &simple).passed());
}

/// A comparison asks in the order of the limits.
#[test]
fn a_comparison_asks_in_the_order_of_the_limits() {
    let keys: Vec<&str> = SPECS.iter().map(|s| s.key).filter(|k| COMPARED.iter().any(|c| c.key == *k)).collect();
    assert_eq!(keys, COMPARED.map(|asked| asked.key));
}
