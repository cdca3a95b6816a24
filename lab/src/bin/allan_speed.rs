//! Times the computation of deviations: rates from a file of little-endian f64, or a generated stream through the pyramid.
//!
//! `allan_speed FILE octave|log` prints the seconds of the computation and the last deviation. `allan_speed - ROWS` does the
//! same for a generated stream of ROWS rows, which is never in memory. For `cargo xtask bench allan`.

use std::time::Instant;

use sagnac_noise::{Deviation, Difference, Recorder, overlapping, phases};

fn differences(multiples: impl Iterator<Item = usize>) -> Vec<Difference> {
    multiples.map(|m| Difference { deviation: Deviation::Allan, m }).collect()
}

fn octaves(longest: usize) -> impl Iterator<Item = usize> {
    (0..40).map(|octave| 1 << octave).take_while(move |m| *m <= longest)
}

/// A hundred, from 1 to a third of the rows.
fn log_spaced(rows: usize) -> impl Iterator<Item = usize> {
    let last = (rows as f64 / 3.0).ln();
    (0..100).map(move |i| (last * f64::from(i) / 99.0).exp().round() as usize)
}

fn in_memory(file: &str, taus: &str) -> std::io::Result<()> {
    let bytes = std::fs::read(file)?;
    let rates: Vec<f64> = bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap_or_default())).collect();
    let wanted = match taus {
        "octave" => differences(octaves(rates.len() / 3)),
        _ => differences(log_spaced(rates.len())),
    };
    let started = Instant::now();
    let mean = rates.iter().sum::<f64>() / rates.len() as f64;
    let sums = overlapping(&phases(&rates, mean), &wanted);
    let seconds = started.elapsed().as_secs_f64();
    let variance = sums.last().zip(wanted.last()).and_then(|(sum, d)| sum.variance(d.deviation, d.m as f64));
    println!("{seconds} {}", variance.unwrap_or(0.0).sqrt());
    Ok(())
}

fn streamed(rows: u64) {
    let mut recorder = Recorder::new(differences(octaves(1 << 40)), 0);
    let mut state = 1_u64;
    let mut block = vec![0.0; 4096];
    let (mut left, mut seconds) = (rows, 0.0);
    while left > 0 {
        for value in &mut block {
            // Xorshift: fast, and white enough for timing.
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            *value = (state >> 40) as f64;
        }
        let now = block.len().min(usize::try_from(left).unwrap_or(usize::MAX));
        let started = Instant::now();
        recorder.push(&block[..now]);
        seconds += started.elapsed().as_secs_f64();
        left -= now as u64;
    }
    let recorded = recorder.finish();
    let used = recorded.sums.iter().filter(|(_, sum)| sum.number > 0.0).count();
    println!("{seconds} {used}");
}

fn main() -> std::io::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.as_slice() {
        [dash, rows] if dash == "-" => streamed(rows.parse().unwrap_or(0)),
        [file, taus] => in_memory(file, taus)?,
        _ => eprintln!("allan_speed FILE octave|log, or - ROWS"),
    }
    Ok(())
}
