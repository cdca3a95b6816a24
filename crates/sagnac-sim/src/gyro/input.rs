//! Input rate: a constant, the Earth's rate, and a rate table that repeats its legs. The table changes its rate at once.

use crate::scenario::{RateTableLeg, Scenario};

/// The input rate over time.
#[derive(Clone, Debug)]
pub(crate) struct InputRate {
    /// Constant rate and Earth rate, °/h.
    constant_dph: f64,
    table: Vec<RateTableLeg>,
    /// Length of the table's legs together, s.
    table_s: f64,
}

impl InputRate {
    pub(crate) fn build(scenario: &Scenario) -> Self {
        let table = scenario.input.table.clone();
        Self { constant_dph: scenario.input_dph(), table_s: table.iter().map(|leg| leg.for_s).sum(), table }
    }

    /// Rate of the table at a time, °/s.
    pub(crate) fn table_dps(&self, time_s: f64) -> f64 {
        if self.table_s <= 0.0 {
            return 0.0;
        }
        let mut within_s = libm::fmod(time_s, self.table_s);
        for leg in &self.table {
            if within_s < leg.for_s {
                return leg.rate_dps;
            }
            within_s -= leg.for_s;
        }
        0.0
    }

    /// Input rate at a rate of the table, °/h.
    pub(crate) fn rate_dph(&self, table_dps: f64) -> f64 {
        self.constant_dph + 3600.0 * table_dps
    }
}
