//! Tries.
use sagnac_sim::{Scenario, beat::Beat, scenario::tables::BeatModel};
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let mut scenario = Scenario::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap();
    let seconds: u32 = std::env::args().nth(2).unwrap().parse().unwrap();
    for model in [BeatModel::Adler, BeatModel::TwoMode] {
        scenario.run.beat_model = model;
        let t = std::time::Instant::now();
        let mut beat = Beat::new(&scenario, 3);
        let rate = 4.5;
        let start = beat.drift_fringes();
        let mut last = start;
        let mut squares = 0.0;
        let mut n = 0.0;
        let s = scenario.arcsec_per_fringe();
        for _ in 0..seconds * 40 {
            for _ in 0..250 {
                beat.tick(rate);
            }
            let now = beat.drift_fringes();
            let d = (now - last) * s - rate * 0.025;
            squares += d * d;
            n += 1.0;
            last = now;
        }
        let took = t.elapsed().as_secs_f64();
        let arw = (squares / n / 0.025_f64).sqrt() / 60.0;
        println!(
            "{model:?}: mean {} dph, arw {arw} (formula {}), {:.1} times",
            (last - start) * s / f64::from(seconds),
            scenario.arw_deg_rt_h(),
            f64::from(seconds) / took
        );
    }
}
