//! Scenarios of the simulator: what can be built can be run.
#![no_main]

use sagnac_sim::{Fidelity, LoopModel, Scenario};

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Ok(mut scenario) = Scenario::from_toml(text) {
        if scenario.build().is_err() {
            return;
        }
        // The beat and the running loops are slow; they are only built.
        scenario.run.loops = LoopModel::Ideal;
        scenario.run.fidelity = Fidelity::Count;
        let Ok(gyro) = scenario.build() else { return };
        let mut rows = 0;
        let _ = gyro.start(1).each_row(|_, _| {
            rows += 1;
            if rows < 20 { Ok(()) } else { Err(()) }
        });
    }
});
