//! Sends a new image to a board over its serial line and reads the replies.
//!
//! ```sh
//! cargo run -p sagnac-board --example upload_image
//! ```
//!
//! The host sends frames; the board stores the image in its flash banks and starts to use it between two ticks.
//! `sagnac export --to upload` writes the same frames into a file.

use std::error::Error;

use sagnac_board::frame::FrameReader;
use sagnac_board::{CommandHandler, Commit, MemoryFlash, Message, ReplyCode, Row, run};
use sagnac_core::{Banks, Gyro, Image, Status};
use sagnac_loops::LoopTable;

const IMAGE: &[u8] = include_bytes!("../../../testdata/image/paper.img");
/// A file of reference vectors, which contains a loop table.
const LOOPS: &[u8] = include_bytes!("../../../testdata/vectors/path-length-mirror.hex");

fn main() -> Result<(), Box<dyn Error>> {
    // The board: its identity, its flash and its loops. It starts without an image.
    let gyro = Gyro::of(&Image::decode(IMAGE)?, 4);
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).ok_or("the banks do not fit the flash")?;
    let mut board = CommandHandler::new(banks, gyro, loop_table()?);

    // The host: a second without an image, the image in pieces and the commit, another second.
    let second = Message::Row(Row { ticks: 10_000, counts: 40, present: 1, codes: [20 << 24, 0, 0, 0] });
    let mut to_board = vec![second];
    to_board.extend(Message::pieces(IMAGE));
    to_board.extend([
        Message::Commit(Commit { len: u16::try_from(IMAGE.len())?, trial: false }),
        second,
        Message::Stop,
    ]);
    let mut bytes = Vec::new();
    for message in &to_board {
        let (frame, len) = message.frame().ok_or("a message does not fit a frame")?.bytes();
        bytes.extend_from_slice(&frame[..len]);
    }

    let mut from_board = Vec::new();
    run(&mut board, bytes.into_iter(), |bytes| from_board.extend_from_slice(bytes));

    let mut reader = FrameReader::new();
    let (mut statuses, mut accepted_pieces, mut committed) = (Vec::new(), 0, None);
    for byte in from_board {
        match reader.push(byte).and_then(|frame| Message::parse(&frame)) {
            Some(Message::Output(output)) => statuses.push(output.status),
            Some(Message::Reply(reply)) if reply.to == Message::PIECE => {
                accepted_pieces += i32::from(reply.code == ReplyCode::Done)
            }
            Some(Message::Reply(reply)) if reply.to == Message::COMMIT => {
                committed = Some((reply.code, reply.sequence))
            }
            _ => {}
        }
    }

    println!("{accepted_pieces} pieces accepted, commit: {committed:?}, {} output frames", statuses.len());
    assert_eq!(accepted_pieces, 4, "232 bytes in pieces of 60");
    assert_eq!(committed, Some((ReplyCode::Done, 1)));
    assert_eq!(statuses.len(), 200);
    assert!(statuses[..100].iter().all(|status| *status == Status::UNCORRECTED));
    assert!(statuses[100..].iter().all(|status| *status == Status::OK));
    assert_eq!(reader.skipped(), 0);
    Ok(())
}

fn loop_table() -> Result<LoopTable, Box<dyn Error>> {
    let mut words = sagnac_vectors::Words::new(LOOPS);
    let head = words.head()?;
    let mut bytes = [0; sagnac_vectors::MAX_TABLE];
    Ok(LoopTable::decode(words.table(&head, &mut bytes)?)?)
}
