//! Vectors of counting, stripping, watch and vote.

use anyhow::Result;
use sagnac_vectors::Module;

use crate::makes::making::Making;

/// All three counting modes: forward, back, jitter, and double steps.
pub(super) fn quadrature() -> Result<Making> {
    let mut making = Making::new(Module::Quadrature, Vec::new(), "quadrature counter: 1, 2 and 4 counts per fringe")?;
    for (index, multiplier) in [1, 2, 4].into_iter().enumerate() {
        making.step(0, &[multiplier])?;
        for run in 0..40_u32 {
            let share = |percent: u32| u32::MAX / 100 * percent;
            let (forward, back) = [(90, 95), (5, 90), (45, 90), (100, 100)][(run % 4) as usize];
            let double = if run % 5 == 4 { 97 } else { back };
            making.step(1, &[1000, run * 31 + index as u32, share(forward), share(back), share(double)])?;
        }
    }
    Ok(making)
}

/// Dithers of several periods and amplitudes, with noise; a dither that dies, at rest anywhere or in its noise, and returns.
pub(super) fn stripper() -> Result<Making> {
    let mut making =
        Making::new(Module::Stripper, Vec::new(), "dither stripper: whole periods, dead dithers, ends of the range")?;
    let ends = [0, 70_000, -70_000, i32::MIN, i32::MAX].map(i32::cast_unsigned);
    for (start, (longest, least_swing)) in
        [(50, 250_000), (1, 0), (0, 1), (65_535, 1 << 20), (7, u32::MAX), (50, 0)].into_iter().enumerate()
    {
        making.step(0, &[longest, least_swing])?;
        for run in 0..60_u32 {
            let seed = run * 47 + start as u32;
            let period = [25, 24, 50, 3, 1000][(run % 5) as usize];
            let step = u32::MAX / period + run;
            let amplitude = [1 << 20, 1 << 24, 0, u32::MAX, 1 << 20, 300_000][(run % 6) as usize];
            let counts = [3, -40, 0, i32::MAX, i32::MIN, 1][(run / 2 % 6) as usize].cast_unsigned();
            let bits = [0, 8, 20, 31][(run / 3 % 4) as usize];
            let place = if run % 4 == 0 { ends[(run / 4 % 5) as usize] } else { 0 };
            making.step(1, &[700, seed, counts, bits, amplitude, step, [0, 16, 31][(run % 3) as usize], place])?;
        }
    }
    Ok(making)
}

/// Thermometers that walk, drift, stand still, are missing and jump to the ends of the range, under limits from none to the largest; votes of
/// none to eight, with ties, codes at the limit and at the ends of the range.
pub(super) fn watch() -> Result<Making> {
    let about = "watch over thermometers that stand still, vote of several codes";
    let mut making = Making::new(Module::Watch, Vec::new(), about)?;
    let (most, half) = (u32::MAX, 1 << 31);
    let limits = [
        [100, 10, 25],
        [100, 10, 0],
        [10 << 24, 1_677_722, 2000],
        [1, 1, 1],
        [0, 0, 0],
        [half, half, half],
        [most, most, most],
        [3000, 500, 7],
    ];
    for (start, limits) in (0..).zip(limits) {
        making.step(0, &limits)?;
        for run in 0..60 {
            making.step(1, &updates(start, run))?;
            making.step(2, &votes(start * 60 + run))?;
        }
    }
    Ok(making)
}

/// A run of updates: without noise a thermometer reaches a limit exactly.
fn updates(start: u32, run: u32) -> [u32; 7] {
    let at = |list: &[u32], step: u32| list[(run / step) as usize % list.len()];
    let whole_c = if start == 2 { 1 << 24 } else { 1 };
    let drift = [1, -1, 5, 0, -10, 25][run as usize % 6] * whole_c;
    let bits = if start == 2 { at(&[0, 0, 18, 21], 3) } else { at(&[0, 0, 3, 0, 8, 31], 5) };
    let command_drift = at(&[0, 1, 5_u32.wrapping_neg(), 400, 1 << 30], 2);
    let ends = [0, i32::MIN, i32::MAX, 1 << 30].map(i32::cast_unsigned);
    let still = at(&[1, 2, 0, 15, 5, 8, 14, 4], 1);
    let sometimes = at(&[0, 0, 0, 4, 15], 4);
    let never = at(&[0, 0, 8, 12, 0, 1, 14], 3);
    let set = at(&[0, 0, 2, 1, 0, 4, 15], 1);
    let flags = still | sometimes << 4 | never << 8 | set << 12 | at(&[1, 0, 1], 7) << 16;
    [48, run * 61 + start, i32::cast_unsigned(drift), bits, command_drift, at(&ends, 6), flags]
}

/// A run of votes of none to eight codes; every third has a code far from the others.
fn votes(run: u32) -> [u32; 7] {
    let at = |list: &[u32], step: u32| list[(run / step) as usize % list.len()];
    let voters = run % 9;
    let never = (0xff << voters & 0xff_u32).rotate_left(4 * (run % 2));
    let never = (never | never >> 8) & 0xff;
    let bits = at(&[2, 3, 8, 16, 31, 0], 9);
    let agree = at(&[1, 0, (1 << bits) / 3, 3, u32::MAX, 1 << 30], 4);
    let base = at(&[0, 3_u32.wrapping_neg(), 1 << 31, (1 << 31) - 1, 25_000], 5);
    let set = at(&[5_u32.wrapping_neg(), 1 << 31, (1 << 31) - 1, 90_000], 7);
    let far = at(&[0, 0, 2, 0, 0, 32, 0, 0, 0x81], 1);
    [48, run * 67 + 5, agree, bits, base, set, at(&[0, 0, 0x12, 0, 0xff], 11) | never << 8 | far << 16]
}
