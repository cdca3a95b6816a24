//! Speed of the simulator: `speed SCENARIO SECONDS` prints times real time of both beat models and of the count level,
//! with ideal loops. `cargo xtask bench` runs it.

use std::time::Instant;

use sagnac_sim::{Beat, BeatModel, Scenario, TICK_S};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let (path, seconds) = (args.next().ok_or("give a scenario")?, args.next().ok_or("give seconds")?);
    let (mut scenario, seconds) = (Scenario::from_file(path)?, seconds.parse::<u32>()?);
    for (name, model) in [("adler", BeatModel::Adler), ("two-mode", BeatModel::TwoMode)] {
        scenario.run.beat_model = model;
        let beat = Beat::build(&scenario)?;
        let mut state = beat.start(1);
        let start = Instant::now();
        let counts: i64 = (0..seconds * 10_000).map(|_| beat.tick(&mut state, scenario.input_dph()).stripped).sum();
        let times = f64::from(seconds) / start.elapsed().as_secs_f64();
        println!("{name} {times:.0} ({counts} counts)");
    }
    scenario.run.interval_s = TICK_S;
    let mut run = scenario.build()?.start(1);
    let (start, length_s, mut counts) = (Instant::now(), run.length_s().min(3600.0), 0);
    let ended = run.each_row(|row, second| {
        counts += row.counts;
        if second.end_s > length_s { Err(()) } else { Ok(()) }
    });
    println!("count {:.0} ({counts} counts, {ended:?})", length_s / start.elapsed().as_secs_f64());
    Ok(())
}
