//! Bytes of a live source: any are decoded, and the rows do not depend on how the bytes come in pieces.
#![no_main]

use sagnac_bench::Start;
use sagnac_bench::decode::Decoder;
use sagnac_bench::journal::{Entry, EntryKind};
use sagnac_log::setup::{LiveFormat, Setup, ThermometerSetup};

const POLL: &str =
    "[[bench.poll]]\nsource = \"scpi://x:1\"\ncolumns = [{ name = \"temperature_c_chamber\", query = \"T?\" }]";

fn setup(which: u8) -> Setup {
    let mut setup = Setup::parse(POLL).expect("our own text");
    setup.arcsec_per_count = Some(1.0);
    match which % 4 {
        0 => {}
        1 => setup.sample_interval_s = Some(0.5),
        2 => setup.bench.headers = Some("time_s;counts;temperature_c".to_owned()),
        _ => {
            setup.bench.format = LiveFormat::Frames;
            let codes =
                ThermometerSetup { offset_c: Some(0.0), gain_c_per_code: Some(1e-3), ..ThermometerSetup::named("") };
            setup.thermometers = vec![codes];
        }
    }
    setup
}

/// The rows of bytes that came in pieces of a length, as text.
fn rows(which: u8, bytes: &[u8], piece: usize) -> String {
    let start = Start::new("fuzz", 0, &setup(which), vec!["gyro".to_owned(), "chamber".to_owned()]);
    let mut decoder = Decoder::new(&start).expect("our own setup");
    let entry =
        |kind, source, payload: &[u8]| Entry { kind, source, arrival_ns: 1_000_000_000, payload: payload.to_vec() };
    decoder.push(&entry(EntryKind::Connected, 0, b"x"));
    decoder.push(&entry(EntryKind::Bytes, 1, bytes.get(..bytes.len().min(20)).unwrap_or_default()));
    for piece in bytes.chunks(piece) {
        decoder.push(&entry(EntryKind::Bytes, 0, piece));
    }
    let counts = decoder.counts();
    let batch = decoder.take().expect("columns of one length");
    assert_eq!(batch.as_ref().map_or(0, |batch| batch.num_rows()) as u64, counts.rows);
    format!("{:?} {counts:?}", batch.as_ref().map(|batch| batch.columns()))
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    let whole = rows(*which, bytes, usize::MAX >> 1);
    assert_eq!(whole, rows(*which, bytes, 7));
    assert_eq!(whole, rows(*which, bytes, 1));
});
