//! Shared by the log targets: reads the bytes to the end, both for a fit and to write them again, and fits them if
//! possible.

use std::io::Cursor;

use sagnac::fit::{FitOptions, Model, calibrate};
use sagnac::window::WindowBuilder;
use sagnac_log::ingest::{LogReader, ReadMode, sample_reader};
use sagnac_log::setup::Setup;

/// Logs of more windows are not fitted: these targets test the reading.
const FEW_WINDOWS: usize = 60;

/// One log in so many is fitted, chosen by the sum of its bytes: a fit takes as long as a thousand readings, and `table` fits
/// whatever it reads.
const ONE_FIT_IN: u32 = 64;

/// Reads the bytes as a log and fits them. The library catches a decoder's panic, so its message is suppressed.
pub fn read_log(bytes: &[u8]) {
    only_our_own_panics_are_findings();
    let setup = Setup {
        arcsec_per_count: Some(1.0),
        min_span_c: Some(1.0),
        reference_c: Some(20.0),
        window: Some(sagnac_log::setup::WindowSize::Seconds(10.0)),
        ..Setup::default()
    };
    for pace in [ReadMode::Bulk, ReadMode::BulkWithText] {
        let Ok(mut log) = LogReader::from_reader("log", Box::new(Cursor::new(bytes.to_vec())), &setup, pace) else {
            continue;
        };
        while let Ok(Some(_)) = log.next_batch() {}
    }
    look_at(bytes);
    if bytes.iter().fold(0_u32, |sum, byte| sum.wrapping_add(u32::from(*byte))) % ONE_FIT_IN != 0 {
        return;
    }
    let Ok(log) = LogReader::from_reader("log", Box::new(Cursor::new(bytes.to_vec())), &setup, ReadMode::Bulk) else {
        return;
    };
    let Ok(windows) = WindowBuilder::read_all(vec![log], &setup).map(|builder| builder.finish()) else { return };
    if windows.len() < FEW_WINDOWS {
        let options = FitOptions::new(Model::Auto);
        let _ = calibrate(windows, &setup, &options).map(|calibration| calibration.to_json());
    }
}

/// What `sagnac init` looks at.
fn look_at(bytes: &[u8]) {
    let Ok(sample) = sample_reader("fuzz", Box::new(Cursor::new(bytes.to_vec()))) else { return };
    for column in &sample.columns {
        let _ = column.is_dates();
        assert!(column.numbers().len() <= column.cells.len());
    }
}

/// Only our own panics end the run: decoders may panic, and the library catches that.
pub fn only_our_own_panics_are_findings() {
    std::panic::set_hook(Box::new(our_own_panics_abort));
}

/// A panic in our own files is a finding, wherever it is caught; one in a decoder is not.
fn our_own_panics_abort(info: &std::panic::PanicHookInfo<'_>) {
    let place = info.location().map(|l| l.file().to_owned()).unwrap_or_default();
    if place.contains("crates/sagnac") {
        eprintln!("{info}");
        std::process::abort();
    }
}
