//! Broken logs and curves for `sagnac allan`.

use super::{Case, Good, case, good};

pub(super) fn noise_budgets(by: &Good) -> Vec<Case> {
    vec![
        case("curve whose tau falls", "allan curve.csv -o out.json")
            .file("curve.csv", "tau_s,adev_dph\n1,0.2\n2,0.1\n1.5,0.1\n")
            .place("curve.csv:4"),
        case("curve below zero", "allan curve.csv -o out.json")
            .file("curve.csv", "tau_s,adev_dph_x,adev_dph_y\n1,0.2,0.3\n2,0.1,-0.1\n")
            .place("adev_dph_y"),
        case("curve without points", "allan curve.csv -o out.json").file("curve.csv", "tau_s,adev_dph\n"),
        case("--taus for a curve, which has its own", "allan curve.csv --taus 1,2")
            .file("curve.csv", "tau_s,adev_dph\n1,0.2\n")
            .place("curve.csv"),
        case("tau that is no number", "allan log.csv --arcsec-per-count 1 --taus 1,x")
            .file("log.csv", good())
            .place("--taus"),
        case("tau shorter than a row", "allan log.csv --arcsec-per-count 1 --taus 0.001")
            .file("log.csv", good())
            .place("--taus"),
        case("calibration instead of a log or curve", "allan unit.cal.json")
            .file("unit.cal.json", by.record.as_str())
            .place("unit.cal.json"),
        case("--detrend temperature without a thermometer", "allan log.csv --detrend temperature")
            .file("log.csv", "time_s,rate_dph\n1,1\n2,2\n3,1\n4,2\n")
            .refused(),
    ]
}
