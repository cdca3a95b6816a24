//! The paper's image and the loops of a mirror, as the vectors have them.

use sagnac_board::{BoardSetup, FRAME_TICKS};
use sagnac_loops::{LoopTable, Stripper};

pub(crate) const PAPER: &[u8] = include_bytes!("../../../../testdata/image/paper.img");

pub(crate) fn loops() -> LoopTable {
    loops_of("path-length-mirror")
}

pub(crate) fn setup(stripper: Option<Stripper>) -> BoardSetup {
    BoardSetup { loops: loops(), stripper, watch: None, frame_ticks: FRAME_TICKS }
}

pub(crate) fn loops_of(vectors: &str) -> LoopTable {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/vectors");
    let text = std::fs::read(format!("{folder}/{vectors}.hex")).unwrap();
    let mut words = sagnac_vectors::Words::new(&text);
    let head = words.head().unwrap();
    let mut room = [0; sagnac_vectors::MAX_TABLE];
    LoopTable::decode(words.table(&head, &mut room).unwrap()).unwrap()
}
