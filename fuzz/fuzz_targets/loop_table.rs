//! Tables of the loops: what decodes encodes to the same bytes, runs, and keeps its actuators in range.
#![no_main]

use sagnac_core::bytes::crc32;
use sagnac_loops::{LoopTable, TABLE_LEN, TABLE_MAGIC};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut whole = [0; TABLE_LEN];
    whole.iter_mut().zip(bytes).for_each(|(slot, byte)| *slot = *byte);
    // Magic, version, length and checksum fit, or hardly any input would come past them.
    whole[..8].copy_from_slice(&TABLE_MAGIC);
    whole[8..16].copy_from_slice(&[1, 0, 0, 0, 0x80, 1, 0, 0]);
    let crc = crc32(&whole[..TABLE_LEN - 4]);
    whole[TABLE_LEN - 4..].copy_from_slice(&crc.to_le_bytes());
    let Ok(table) = LoopTable::decode(&whole) else { return };
    assert_eq!(table.encode(), whole);
    let (mut path, mut light) = (table.path_length.start(), table.intensity.start());
    for byte in bytes.iter().cycle().take(2000) {
        let code = (i32::from(*byte) - 100) << 17;
        let out = table.path_length.tick(&mut path, code);
        let current = table.intensity.tick(&mut light, code, *byte > 200).current;
        assert!(out.actuator.unsigned_abs() <= 1 << 23 && (0..=1 << 23).contains(&current));
    }
});
