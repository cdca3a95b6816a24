//! Counts fringes with a quadrature counter and removes the dither from the counts.
//!
//! ```sh
//! cargo run -p sagnac-loops --example strip_dither
//! ```
//!
//! The gyro turns at 100 arcsec per second and is dithered by ±150 arcsec at 400.3 Hz. One fringe is 2.42 arcsec,
//! counted four times.

use sagnac_loops::{Counting, Quadrature, QuadratureState, Stripper};

const RATE_ARCSEC_S: f64 = 100.0;
const DITHER_ARCSEC: f64 = 150.0;
const DITHER_HZ: f64 = 400.3;
const FRINGE_ARCSEC: f64 = 2.42;
const TICK_S: f64 = 1e-4;
/// Pairs of comparator levels per tick: 2 MHz of samples.
const SAMPLES_PER_TICK: u32 = 200;

fn main() {
    let counter = Quadrature { counting: Counting::X4 };
    let mut count_state = QuadratureState::new();
    counter.update(&mut count_state, false, false);
    // The longest dither period: twice the nominal one, in ticks. A working dither moves the pickoff by far more than 10 arcsec.
    let mut stripper = Stripper::new(50, 100_000);

    let (mut raw_sum, mut largest, mut stripped_sum, mut stripped_ticks) = (0_i64, 0, 0_i64, 0_u32);
    for tick in 0..10_000_u32 {
        let mut counts = 0;
        for sample in 1..=SAMPLES_PER_TICK {
            let time_s = (f64::from(tick) + f64::from(sample) / f64::from(SAMPLES_PER_TICK)) * TICK_S;
            // A board reads these levels at two pins. Here they come from the angle.
            let fringes = (RATE_ARCSEC_S * time_s + dither_arcsec(time_s)) / FRINGE_ARCSEC;
            let quarter = (4.0 * fringes).floor().rem_euclid(4.0) as u8;
            counts += counter.update(&mut count_state, matches!(quarter, 1 | 2), matches!(quarter, 2 | 3));
        }
        raw_sum += i64::from(counts);
        largest = largest.max(counts.abs());
        // The pickoff measures the dither angle at the end of the tick, in any unit.
        let pickoff = (dither_arcsec(f64::from(tick + 1) * TICK_S) * 1e4).round() as i32;
        if let Some(period) = stripper.update(counts, pickoff) {
            assert!(!period.without_zero && stripper.has_dither());
            stripped_sum += period.counts;
            stripped_ticks += u32::from(period.ticks);
        }
    }

    let expected = RATE_ARCSEC_S * f64::from(stripped_ticks) * TICK_S / FRINGE_ARCSEC * 4.0;
    println!(
        "up to {largest} counts in a tick; {stripped_sum} counts over whole dither periods, {expected:.1} expected"
    );
    assert_eq!(count_state.lost, 0, "the samples are fast enough");
    assert!((stripped_sum as f64 - expected).abs() <= 2.0);
    assert_eq!(stripped_sum + stripper.pending(), raw_sum, "no count is lost");
}

fn dither_arcsec(time_s: f64) -> f64 {
    DITHER_ARCSEC * (std::f64::consts::TAU * DITHER_HZ * time_s).sin()
}
