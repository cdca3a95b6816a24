//! The serial line: any bytes keep the handler going, and what comes out are whole frames.
#![no_main]

use sagnac_board::frame::FrameReader;
use sagnac_board::{CommandHandler, MemoryFlash, Message, Row, run};
use sagnac_core::{Banks, Gyro, Image};
use sagnac_loops::LoopTable;

const IMAGE: &[u8] = include_bytes!("../../testdata/image/paper.img");
const VECTORS: &[u8] = include_bytes!("../../testdata/vectors/intensity.hex");

fn loops() -> LoopTable {
    let mut words = sagnac_vectors::Words::new(VECTORS);
    let head = words.head().expect("our own file");
    let mut room = [0; sagnac_vectors::MAX_TABLE];
    LoopTable::decode(words.table(&head, &mut room).expect("our own file")).expect("our own table")
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // Bytes become frames of the kinds there are, some of them damaged; or stay what they are.
    let mut input = Vec::new();
    for chunk in bytes.chunks(40) {
        match chunk {
            [kind, rest @ ..] if kind % 8 != 7 => {
                let kind = [0x10, 0x11, 0x20, 0x21, 0x22, 0x01, 0x30][usize::from(kind % 8)];
                let frame = sagnac_board::frame::Frame::new(kind, rest).expect("40 bytes fit");
                // A row of hours would be run.
                let frame = match Message::parse(&frame) {
                    Some(Message::Row(row)) => {
                        Message::Row(Row { ticks: row.ticks % 500, ..row }).frame().expect("fits")
                    }
                    _ => frame,
                };
                let (bytes, len) = frame.bytes();
                input.extend_from_slice(&bytes[..len]);
            }
            other => input.extend_from_slice(other),
        }
    }
    let image = Image::decode(IMAGE).expect("our own image");
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).expect("they fit");
    let mut reader = FrameReader::new();
    run(&mut CommandHandler::new(banks, Gyro::of(&image, 4), loops()), input.into_iter(), |bytes| {
        let found = bytes.iter().filter_map(|byte| reader.push(*byte)).count();
        assert_eq!((found, reader.buffered()), (1, 0));
    });
    assert_eq!(reader.skipped(), 0);
});
