//! Runs the board of one gyro axis for ten seconds, tick by tick, and reads its output frames.
//!
//! ```sh
//! cargo run -p sagnac-board --example one_board
//! ```
//!
//! This is the body of a tick's interrupt. On a target, the levels come from the comparators, the codes from the
//! converters, and the actuator codes go to the converters.

use std::error::Error;

use sagnac_board::{ActuatorCodes, Board, BoardSetup, FRAME_TICKS, Sample, StartCause};
use sagnac_core::{Image, Origin, Status};
use sagnac_loops::LoopTable;

/// On a target: `include_bytes!("unit.img")`, or `Banks::load` from flash.
const IMAGE: &[u8] = include_bytes!("../../../testdata/image/paper.img");
/// A file of reference vectors, which contains a loop table. On a target: `include_bytes!("gyro.loops")`.
const LOOPS: &[u8] = include_bytes!("../../../testdata/vectors/path-length-mirror.hex");

fn main() -> Result<(), Box<dyn Error>> {
    let image = Image::decode(IMAGE)?;
    let mut quarter = 0;
    let setup = BoardSetup { loops: loop_table()?, stripper: None, watch: None, frame_ticks: FRAME_TICKS };
    let mut board = Board::new(StartCause::PowerOn, image, Origin::Newest, &setup, levels(quarter));

    let mut frames = Vec::new();
    let mut actuators = ActuatorCodes::default();
    for tick in 0..100_000_u32 {
        // One quarter fringe forward every 100 ticks: 100 counts per second.
        let stepped = tick % 100 == 0;
        quarter = if stepped { (quarter + 1) % 4 } else { quarter };
        // A cavity without light: the path-length loop keeps searching.
        let sample = Sample { codes: [Some(20 << 24), None, None, None], pickoff: 0, light: 0, status: Status::OK };
        let (new_actuators, frame) = board.tick(stepped.then_some(levels(quarter)).into_iter(), &sample);
        actuators = new_actuators;
        frames.extend(frame);
    }

    let raw: i32 = frames.iter().map(|frame| frame.raw).sum();
    let corrected: i32 = frames.iter().map(|frame| frame.counts).sum();
    println!(
        "{} frames, {raw} counts before and {corrected} after the correction; actuator at {}",
        frames.len(),
        actuators.actuator
    );
    assert_eq!(frames.len(), 1000, "a frame every 10 ms");
    assert_eq!(raw, 1000);
    // The paper's curve at 20 °C: 38.75 counts in 100 s, which are 15.5 quanta of 0.25 count in 10 s.
    assert!((raw - corrected - 15).abs() <= 1, "{corrected}");
    assert!(frames.iter().all(|frame| frame.status == Status::OK && frame.lost_steps == 0));
    Ok(())
}

/// Comparator levels in a quarter of a fringe.
fn levels(quarter: u8) -> (bool, bool) {
    (matches!(quarter, 1 | 2), matches!(quarter, 2 | 3))
}

fn loop_table() -> Result<LoopTable, Box<dyn Error>> {
    let mut words = sagnac_vectors::Words::new(LOOPS);
    let head = words.head()?;
    let mut bytes = [0; sagnac_vectors::MAX_TABLE];
    Ok(LoopTable::decode(words.table(&head, &mut bytes)?)?)
}
