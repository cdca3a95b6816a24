//! Batches that are passed to another thread: all of them, in order, and the first error.

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{Batch, LogReader, ReadMode};
use sagnac_log::setup::Setup;
use sagnac_log::threads::alone;

const ROWS: u32 = 400_000;

/// A row a second; that of `broken` is half a count.
fn log(broken: Option<u32>) -> LogReader {
    let row = |at: u32| {
        let counts = if broken == Some(at) { "0.5".to_owned() } else { (at % 7).to_string() };
        format!("{at},{:.2},{counts}\n", 20.0 + f64::from(at % 50) / 100.0)
    };
    let text: String = std::iter::once("time_s,temperature_c,counts\n".to_owned()).chain((0..ROWS).map(row)).collect();
    let setup = Setup { arcsec_per_count: Some(0.5), ..Setup::default() };
    LogReader::from_reader("log", Box::new(std::io::Cursor::new(text)), &setup, ReadMode::Bulk).unwrap()
}

fn read(broken: Option<u32>, mut take: impl FnMut(&Batch) -> Result<()> + Send) -> (Result<()>, u64) {
    let mut log = log(broken);
    let ended = log.for_each_batch(&mut take);
    (ended, log.summary().rows)
}

#[test]
fn every_row_comes_once_and_in_order() {
    let lines = || {
        let mut lines = Vec::new();
        let (ended, rows) = read(None, |batch| {
            lines.extend_from_slice(&batch.line);
            Ok(())
        });
        ended.unwrap();
        assert_eq!(rows, u64::from(ROWS));
        lines
    };
    let passed_on = lines();
    assert!(passed_on.iter().copied().eq(2..=u64::from(ROWS) + 1));
    assert_eq!(alone(lines), passed_on);
}

/// An error of `take` is of earlier rows than one of reading that came meanwhile; without one, that of reading is reported.
#[test]
fn the_first_error_is_reported() {
    let refused = |at: u64| {
        move |batch: &Batch| match batch.line.contains(&at) {
            true => Err(Error::input("refused", "remove the line").line(at)),
            false => Ok(()),
        }
    };
    for _ in 0..20 {
        let line = |ended: (Result<()>, u64)| ended.0.unwrap_err().place.line;
        assert_eq!(line(read(Some(300_000), refused(250_000))), Some(250_000));
        assert_eq!(line(read(Some(300_000), refused(390_000))), Some(300_002));
        assert_eq!(line(read(None, refused(ROWS.into()))), Some(u64::from(ROWS)));
    }
}

#[test]
#[should_panic(expected = "in the middle")]
fn a_panic_is_passed_back() {
    let _ = read(None, |batch| {
        assert!(!batch.line.contains(&200_000), "in the middle");
        Ok(())
    });
}
