//! How far a log has been read, on a terminal and after a second; silent otherwise.

use std::fs::File;
use std::io::{IsTerminal, Read};
use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sagnac::ingest::{LogReader, Pace};
use sagnac::setup::Setup;
use sagnac::{Error, Result};

/// Nothing is shown of what ends sooner.
const PATIENCE: Duration = Duration::from_secs(1);
const TEMPLATE: &str = "{msg} {wide_bar} {bytes} of {total_bytes}, {binary_bytes_per_sec}, {eta} left";

/// Opens a log; a long read from a file shows itself on a terminal.
pub(crate) fn open_log(path: &Path, setup: &Setup, pace: Pace) -> Result<LogReader> {
    let regular = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file);
    match regular {
        Some(metadata) if std::io::stderr().is_terminal() => {
            let file = File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
            let watched = Watched::new(file, path, metadata.len());
            LogReader::from_reader(&path.display().to_string(), Box::new(watched), setup, pace)
        }
        _ => LogReader::open(path, setup, pace),
    }
}

/// A file that tells how far it has been read.
struct Watched {
    file: File,
    bar: ProgressBar,
    since: Option<Instant>,
}

impl Watched {
    fn new(file: File, path: &Path, length: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style);
        }
        bar.set_message(path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default());
        Self { file, bar, since: None }
    }
}

impl Read for Watched {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.file.read(buffer)?;
        let since = *self.since.get_or_insert_with(|| {
            self.bar.reset_elapsed();
            Instant::now()
        });
        if self.bar.is_hidden() && since.elapsed() > PATIENCE {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        self.bar.inc(n as u64);
        if n == 0 {
            self.bar.finish_and_clear();
        }
        Ok(n)
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
