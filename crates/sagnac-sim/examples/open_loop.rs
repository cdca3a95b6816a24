//! Open loop of the running path-length and intensity loops: crossover and phase margin, measured and as designed.
//!
//! ```sh
//! cargo run -p sagnac-sim --example open_loop
//! ```
//!
//! The loops' own code (`sagnac-loops`) runs on the simulated plant while a small sine is added to its output. The
//! wanted phase margin is a minimum: an integrator alone has 87° and 80° here. More needs a proportional part.

use std::error::Error;

use sagnac_sim::{LoopDesign, LoopName, Scenario};

const SCENARIO: &str = "
[geometry]
perimeter_m = 0.28
[intensity]
bandwidth_hz = 20.0
[[thermometer]]
[chamber]
leg = [{ soak_s = 60 }]
";

fn main() -> Result<(), Box<dyn Error>> {
    let mut scenario = Scenario::from_toml(SCENARIO)?;
    println!("loop           wanted   crossover, Hz (design)   phase margin, ° (design)");
    for margin_deg in [60.0, 100.0] {
        scenario.path_length.phase_margin_deg = margin_deg;
        scenario.intensity.phase_margin_deg = margin_deg;
        let design = LoopDesign::build(&scenario)?;
        for which in [LoopName::PathLength, LoopName::Intensity] {
            let bode = design.sweep(which, 20.0)?;
            let crossover_hz = bode.crossover_hz.ok_or("the gain does not cross unity")?;
            let phase_margin_deg = bode.phase_margin_deg.ok_or("no crossover")?;
            println!(
                "{:12}   {margin_deg:4}°   {crossover_hz:9.2} ({:.2})        {phase_margin_deg:9.2} ({:.2})",
                which.name(),
                bode.design_crossover_hz,
                bode.design_phase_margin_deg
            );
            assert!((crossover_hz / bode.design_crossover_hz - 1.0).abs() < 0.02);
            assert!((phase_margin_deg - bode.design_phase_margin_deg).abs() < 1.5);
            assert!(bode.design_phase_margin_deg > margin_deg - 0.1);
        }
    }
    Ok(())
}
