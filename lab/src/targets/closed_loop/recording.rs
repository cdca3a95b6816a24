//! A test recorded by `sagnac bench`, from a TCP port that passes on what the target sends.

use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};

use super::process::Running;
use crate::program::Program;

/// How long the bench may take to connect, and to end.
const PATIENCE: Duration = Duration::from_secs(120);

/// A recording that runs.
pub(super) struct Recording {
    bench: Running,
    listener: TcpListener,
}

impl Recording {
    /// Starts the bench, which connects; with the connection that its bytes go to.
    pub(super) fn start(work: &Path, setup: &str, name: &str) -> Result<(Self, TcpStream)> {
        let listener = TcpListener::bind("127.0.0.1:0").context("no free port for the bench")?;
        let source = format!("tcp://{}", listener.local_addr().context("the port of the bench")?);
        let (log, calibration) = (format!("{name}.parquet"), format!("{name}.cal.json"));
        let mut command = Command::new(Program::beside_the_lab()?.path());
        command.args(["bench", setup, "--source", &source, "-o", &log, "--calibration", &calibration]);
        let bench = Running::start("sagnac bench", command.args(["--page", "none"]).current_dir(work))?;
        let line = accept(&listener)?;
        Ok((Self { bench, listener }, line))
    }

    /// Closes the line and ends the recording with Ctrl-C; what the bench said.
    ///
    /// A bench connects again once it has read a closed line to its end. So when it does, it has everything.
    pub(super) fn end(self, line: TcpStream) -> Result<String> {
        drop(line);
        let _again = accept(&self.listener)?;
        self.bench.interrupt()?;
        self.bench.end(PATIENCE)
    }
}

/// The next connection.
fn accept(listener: &TcpListener) -> Result<TcpStream> {
    let listener = listener.try_clone().context("the port of the bench")?;
    let (to, connection) = channel();
    thread::spawn(move || to.send(listener.accept()));
    let connected = connection.recv_timeout(PATIENCE).context("sagnac bench does not connect")?;
    let (stream, _) = connected.context("the connection of the bench")?;
    stream.set_nodelay(true).context("the connection of the bench")?;
    Ok(stream)
}
