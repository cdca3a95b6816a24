//! A thermal cycle of a dithered gyro, written as a CSV file.
//!
//! ```sh
//! cargo run -p sagnac-sim --example thermal_cycle -- cycle.csv
//! ```
//!
//! The log has a row per second: time, counts, validity, thermometer, actuator and light. Without a file name it goes to
//! the folder for temporary files. At the end the drift between cold and hot soak is computed from the counts and
//! compared with the scenario.

use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

use sagnac_sim::{BlockWriter, LogText, Scenario};

const SCENARIO: &str = r#"
name = "example"

[geometry]
shape = "triangle"
perimeter_m = 0.28

[dither]
frequency_hz = 400.0
amplitude_arcsec = 150.0

[bias]
slope_dph_per_c = 0.01

[[thermometer]]
lsb_c = 0.0625

# From -10 °C to 50 °C at 2 °C/min, with soaks of three hours.
[chamber]
start_c = -10.0
leg = [{ soak_s = 10800 }, { to_c = 50, rate_cpm = 2 }, { soak_s = 10800 }]

[input]
direction = "up"
latitude_deg = 48.0
"#;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).map_or_else(|| std::env::temp_dir().join("thermal-cycle.csv"), PathBuf::from);

    let scenario: Scenario = SCENARIO.parse()?;
    let gyro = scenario.build()?;
    let mut text = LogText::new(&scenario);
    let mut out = BlockWriter::new(File::create(&path)?);
    out.write_all(text.header_line().as_bytes())?;

    // Counts of the last two hours of each soak.
    let end_s = gyro.length_s();
    let (mut cold, mut hot) = (0, 0);
    gyro.start(scenario.seed).each_row(|row, second| {
        if (3600.0..10_800.0).contains(&(second.end_s - 1.0)) {
            cold += row.counts;
        } else if second.end_s > end_s - 7200.0 {
            hot += row.counts;
        }
        out.write_all(text.line(row, second))
    })?;
    out.flush()?;

    // 1 arcsec/s is 1 °/h.
    let drift_dph = (hot - cold) as f64 * scenario.arcsec_per_count() / 7200.0;
    let slope_dph_per_c = drift_dph / 60.0;
    println!("wrote {}", path.display());
    println!("drift from cold to hot: {drift_dph:.3} °/h, {slope_dph_per_c:.5} °/h/°C");
    assert!((slope_dph_per_c - 0.01).abs() < 0.0005, "the scenario's slope is 0.01 °/h/°C");
    Ok(())
}
