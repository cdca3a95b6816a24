//! The paper's image and the loops of a mirror, as the vectors have them.

use sagnac_loops::LoopTable;

pub(crate) const PAPER: &[u8] = include_bytes!("../../../../testdata/image/paper.img");

pub(crate) fn loops() -> LoopTable {
    let text =
        std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/vectors/path-length-mirror.hex")).unwrap();
    let mut words = sagnac_vectors::Words::new(&text);
    let head = words.head().unwrap();
    let mut room = [0; sagnac_vectors::MAX_TABLE];
    LoopTable::decode(words.table(&head, &mut room).unwrap()).unwrap()
}
