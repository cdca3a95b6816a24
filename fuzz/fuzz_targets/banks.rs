//! Flash with any content: loading says what there is, and storing works on top of it.
#![no_main]

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use sagnac_board::MemoryFlash;
use sagnac_core::{Banks, Description, Gyro, Image, Loaded, Origin};

const IMAGE: &[u8] = include_bytes!("../../testdata/image/paper.img");

fn image(sequence: u32) -> Image {
    let own = Image::decode(IMAGE).expect("our own image");
    Image::new(Description { sequence, ..*own.description() }).expect("our own image")
}

fn known_image(loaded: &Loaded) -> bool {
    [image(1), image(2)].contains(&loaded.image) || loaded.origin == Origin::FactoryDefaults
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let gyro = Gyro::of(&image(1), 4);
    // What two stores left, then pieces of it written over as the input says, eight bytes at a time.
    let mut banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).expect("they fit");
    banks.store(&gyro, &image(1)).expect("empty flash");
    banks.store(&gyro, &image(2)).expect("empty flash");
    let mut old = banks.into_flash();
    let mut all = [0; MemoryFlash::LEN];
    old.read(0, &mut all).expect("in range");
    for change in bytes.chunks_exact(3) {
        let at = usize::from(u16::from_le_bytes([change[0], change[1]])) % all.len();
        all[at] = change[2];
    }
    let mut flash = MemoryFlash::new();
    flash.write(0, &all).expect("blank flash");
    let mut banks = Banks::new(flash, 0, MemoryFlash::BANK).expect("they fit");
    let loaded = banks.load(&gyro);
    // A hash of 16 bytes is not met by chance; a fuzzer that learns to is welcome to be looked at.
    assert!(known_image(&loaded), "{loaded:?}");
    assert!(known_image(&banks.start(&gyro, 0)));
    let _ = banks.confirm(&gyro);
    let _ = banks.roll_back(&gyro);
    match banks.store(&gyro, &image(7)) {
        Ok(()) => assert_eq!(banks.load(&gyro).image, image(7)),
        // Eight bytes of a note that says so.
        Err(error) => panic!("{error}"),
    }
});
