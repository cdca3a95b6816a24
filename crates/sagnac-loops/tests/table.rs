//! Tables as bytes: what was designed comes back, what cannot run is refused, what is accepted never overflows.

use proptest::prelude::*;
use sagnac_core::bytes::crc32;
use sagnac_loops::{IntensityConfig, LoopGoal, LoopTable, PathLengthConfig, TABLE_LEN, TableError};

fn designed(bandwidth_hz: f64, heater: bool, update_ticks: u16) -> LoopTable {
    let path = PathLengthConfig {
        tick_s: 1e-4,
        modulation_hz: 1250.0,
        modulation_waves: 0.01,
        separate_modulator: heater,
        answer_ticks: 1,
        range: if heater { [0.0, 4.0] } else { [-150.0, 150.0] },
        waves_per_unit: if heater { 0.75 } else { 0.012 },
        codes_per_unit: if heater { 30_000.0 } else { 870.0 },
        lag_s: if heater { [5.0, 8.0] } else { [0.0; 2] },
        peak_code: 4e6,
        curvature: 5.0,
        noise: 1e-4,
        goal: LoopGoal { bandwidth_hz, phase_margin_deg: 45.0 },
        reset_margin_waves: 0.2,
        reset_s: 0.01,
        settle_s: 0.01,
        sweep_s: if heater { 0.0 } else { 0.05 },
        lock_waves: 0.005,
    };
    let light = IntensityConfig {
        tick_s: 1e-4,
        update_ticks,
        set_code: 200_000.0,
        codes_per_ma: 400_000.0,
        lag_s: 1e-3,
        range_ma: [0.3, 2.0],
        current_codes_per_ma: 500_000.0,
        slew_ma_per_s: 1e4,
        ignition_ma: 1.5,
        ignition_s: 0.5,
        rest_s: 1.0,
        tries: 3,
        low_part: 0.8,
        goal: LoopGoal { bandwidth_hz: 10.0, phase_margin_deg: 60.0 },
    };
    let path_length = path.build().unwrap().integers;
    LoopTable { tick_ns: 100_000, path_length, intensity: light.build().unwrap().integers }
}

fn sealed(mut bytes: [u8; TABLE_LEN]) -> [u8; TABLE_LEN] {
    let crc = crc32(&bytes[..TABLE_LEN - 4]);
    bytes[TABLE_LEN - 4..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

#[test]
fn what_was_designed_comes_back() {
    for heater in [false, true] {
        for bandwidth_hz in [0.5, 3.0, 40.0] {
            let table = designed(bandwidth_hz, heater, 8);
            assert_eq!(LoopTable::decode(&table.encode()), Ok(table));
        }
    }
}

#[test]
fn every_flipped_bit_is_refused() {
    let good = designed(20.0, false, 8).encode();
    for bit in 0..TABLE_LEN * 8 {
        let mut bytes = good;
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(LoopTable::decode(&bytes).is_err(), "bit {bit}");
    }
    assert_eq!(LoopTable::decode(&good[1..]), Err(TableError::Length(TABLE_LEN - 1)));
    assert_eq!(LoopTable::decode(&[0; TABLE_LEN]), Err(TableError::NotATable));
}

#[test]
fn values_that_cannot_run_are_refused_by_name() {
    let good = designed(20.0, false, 8).encode();
    // Offset of a field in the table, its new value, words of the error.
    let cases: [(usize, &[u8], &str); 13] = [
        (24 + 280, &[0, 0, 0, 0x80], "path-length range"),
        (24 + 284, &[0xff, 0xff, 0xff, 0x7f], "path-length range"),
        (16, &[0, 0, 0, 0], "tick"),
        (24 + 256, &[7], "path-length reference"),
        (24 + 130, &[7], "path-length reference"),
        (24 + 352, &[1, 0], "path-length least curvature"),
        (24 + 356, &[1, 0, 0, 0], "path-length most curvature"),
        (24 + 356, &[1, 0, 0, 0x40], "path-length most curvature"),
        (24 + 340, &[0, 0, 4, 0], "path-length lock time"),
        (24 + 260, &[0, 0, 0, 0x40], "path-length kp"),
        (24 + 276 + 4, &[0, 0, 0, 0x7f], "path-length range"),
        (24 + 276 + 20, &[0, 0, 0, 0], "path-length wavelength"),
        (24 + 392, &[0, 0], "intensity ticks"),
    ];
    for (at, with, field) in cases {
        let mut bytes = good;
        bytes[at..at + with.len()].copy_from_slice(with);
        assert_eq!(LoopTable::decode(&sealed(bytes)), Err(TableError::OutOfRange(field)));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    /// Random fields in an accepted table, random codes: arithmetic is checked in tests, so an overflow would stop it.
    #[test]
    fn what_is_accepted_never_overflows(
        changes in prop::collection::vec((16..TABLE_LEN - 4, any::<u8>()), 0..2),
        extremes in prop::collection::vec((74_usize..126, prop::sample::select(vec![0_u32, 1, 0x7f, 0x80_0000, 0x3fff_ffff])), 0..3),
        codes in prop::collection::vec((any::<i32>(), 1_u16..200), 1..30),
    ) {
        let mut bytes = designed(20.0, false, 8).encode();
        for (at, with) in changes {
            bytes[at] = with;
        }
        for (word, with) in extremes {
            bytes[word * 4..word * 4 + 4].copy_from_slice(&with.to_le_bytes());
        }
        if let Ok(table) = LoopTable::decode(&sealed(bytes)) {
            prop_assert_eq!(LoopTable::decode(&table.encode()), Ok(table));
            let (mut path, mut light) = (table.path_length.start(), table.intensity.start());
            for (code, times) in codes {
                for _ in 0..times {
                    let out = table.path_length.tick(&mut path, code);
                    let current = table.intensity.tick(&mut light, code, code & 1 == 0).current;
                    prop_assert!(out.actuator.unsigned_abs() <= 1 << 23 && (0..=1 << 23).contains(&current));
                }
            }
        }
    }
}
