//! Scenarios of the simulator: what is read was checked, and can be run.
#![no_main]

use sagnac_sim::Scenario;
use sagnac_sim::gyro::GyroRun;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Ok(mut scenario) = Scenario::from_toml(text) {
        scenario.run.loops = sagnac_sim::scenario::tables::Loops::Ideal;
        scenario.run.fidelity = sagnac_sim::scenario::tables::Fidelity::Count;
        let mut rows = 0;
        let mut run = GyroRun::new(&scenario, 1).expect("what was read was checked");
        let _ = run.each_row(|_, _| {
            rows += 1;
            if rows < 20 { Ok(()) } else { Err(()) }
        });
    }
});
