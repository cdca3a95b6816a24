//! Flash images: what decodes encodes to the same bytes, and runs.
#![no_main]

use sagnac_core::{Compensator, Image, State};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // With a CRC that fits, or hardly any input would come past it.
    let mut whole = bytes.to_vec();
    if let Some(body) = bytes.len().checked_sub(4) {
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes[..body]);
        whole[body..].copy_from_slice(&crc.to_le_bytes());
    }
    let Ok(image) = Image::decode(&whole) else { return };
    assert_eq!(sagnac::export::image_bytes(&image), whole);
    let gyro = Compensator::new(image);
    let mut state = State::new();
    let codes = vec![Some(i32::from(bytes[0]) << 23); gyro.image().inputs().len()];
    for raw in bytes.iter().take(64) {
        if state.ticks_to_update() == 0 {
            let _ = gyro.update(&mut state, &codes);
        }
        let _ = gyro.tick(&mut state, i32::from(*raw) << 18);
    }
});
