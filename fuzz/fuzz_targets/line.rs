//! The serial line: any bytes keep the handler going, and what comes out are whole frames.
#![no_main]

use sagnac_board::frame::FrameReader;
use sagnac_board::{CommandHandler, MemoryFlash, Message, Row, run};
use sagnac_core::{Banks, Gyro, Image, Trust};
use sagnac_loops::LoopTable;

const IMAGE: &[u8] = include_bytes!("../../testdata/image/paper.img");
const VECTORS: &[u8] = include_bytes!("../../testdata/vectors/intensity.hex");

fn loops() -> LoopTable {
    let mut words = sagnac_vectors::Words::new(VECTORS);
    let head = words.head().expect("our own file");
    let mut room = [0; sagnac_vectors::MAX_TABLE];
    LoopTable::decode(words.table(&head, &mut room).expect("our own file")).expect("our own table")
}

/// A board with a key, whose signatures are right when they begin with a one.
struct Keyed;

impl Trust for Keyed {
    fn public_key(&self) -> Option<[u8; 32]> {
        Some([7; 32])
    }

    fn model(&self) -> [u8; 16] {
        [0; 16]
    }

    fn lowest_counter(&self) -> u32 {
        1
    }

    fn raise_lowest_counter(&mut self, _to: u32) {}

    fn verify(&self, _public_key: &[u8; 32], _message: &[u8], signature: &[u8; 64]) -> bool {
        signature[0] == 1
    }

    fn challenge(&mut self) -> [u8; 16] {
        [1; 16]
    }
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // Bytes become frames of the kinds there are, some of them damaged; or stay what they are.
    let mut input = Vec::new();
    for chunk in bytes.chunks(65) {
        match chunk {
            [kind, rest @ ..] if kind % 12 != 11 => {
                const KINDS: [u8; 11] = [0x10, 0x11, 0x20, 0x21, 0x22, 0x01, 0x30, 0x03, 0x23, 0x24, 0x25];
                // A length that the kind has, as often as not.
                let kind = KINDS[usize::from(kind % 12)];
                let len = match (kind, rest.first()) {
                    (0x21, Some(odd)) if odd & 1 == 1 => 3,
                    (0x22 | 0x23 | 0x24 | 0x30, Some(odd)) if odd & 1 == 1 => 0,
                    _ => rest.len(),
                };
                let frame = sagnac_board::frame::Frame::new(kind, &rest[..len.min(rest.len())]).expect("64 bytes fit");
                // A row of hours would be run.
                let frame = match Message::parse(&frame) {
                    Some(Message::Row(row)) => {
                        Message::Row(Row { ticks: row.ticks % 500, ..row }).frame().expect("fits")
                    }
                    _ => frame,
                };
                // For every gyro of the line, for this one, or for another.
                let axis = b"0z0x"[usize::from(rest.first().unwrap_or(&0) >> 6)];
                let (bytes, len) = frame.of_axis(axis).bytes();
                input.extend_from_slice(&bytes[..len]);
            }
            other => input.extend_from_slice(other),
        }
    }
    let image = Image::decode(IMAGE).expect("our own image");
    let banks = || Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).expect("they fit");
    let mut reader = FrameReader::new();
    let mut whole = |bytes: &[u8]| {
        let found = bytes.iter().filter_map(|byte| reader.push(*byte)).count();
        assert_eq!((found, reader.buffered()), (1, 0));
    };
    let gyro = Gyro::of(&image, 4);
    run(&mut CommandHandler::new(banks(), gyro, loops()), input.iter().copied(), &mut whole);
    run(&mut CommandHandler::with_trust(banks(), gyro, loops(), Keyed), input.into_iter(), &mut whole);
    assert_eq!(reader.skipped(), 0);
});
