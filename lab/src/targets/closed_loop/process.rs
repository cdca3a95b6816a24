//! A program that runs next to this one, with what it says line by line.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

/// A program that runs; it is ended when this value goes.
pub(super) struct Running {
    name: &'static str,
    child: Child,
    /// Lines of both outputs; closed when the program has ended.
    lines: Receiver<String>,
}

impl Running {
    /// Starts a program.
    pub(super) fn start(name: &'static str, command: &mut Command) -> Result<Self> {
        let piped = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = piped.spawn().with_context(|| format!("cannot start {name}"))?;
        let (to, lines) = channel();
        let (out, err) = (child.stdout.take(), child.stderr.take());
        out.into_iter().for_each(|pipe| pass_on(pipe, to.clone()));
        err.into_iter().for_each(|pipe| pass_on(pipe, to.clone()));
        Ok(Self { name, child, lines })
    }

    /// The next line that it says.
    pub(super) fn line(&self, within: Duration) -> Result<String> {
        self.lines.recv_timeout(within).with_context(|| format!("{} says nothing", self.name))
    }

    /// Sends it Ctrl-C.
    pub(super) fn interrupt(&self) -> Result<()> {
        let process = self.child.id().to_string();
        let status = Command::new("kill").args(["-INT", &process]).status().context("cannot start kill")?;
        ensure!(status.success(), "{}: cannot be sent Ctrl-C ({status})", self.name);
        Ok(())
    }

    /// Waits for its end; what it said. A failure or a longer wait is an error.
    pub(super) fn end(mut self, within: Duration) -> Result<String> {
        let until = Instant::now() + within;
        let mut said = String::new();
        loop {
            match self.lines.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(line) => said += &(line + "\n"),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => bail!("{} has not ended within {within:?}:\n{said}", self.name),
            }
        }
        let status = self.child.wait().with_context(|| format!("the end of {}", self.name))?;
        ensure!(status.success(), "{} ({status}):\n{said}", self.name);
        Ok(said)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Both fail only where it has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Passes the lines of a pipe on, until its end.
fn pass_on(pipe: impl Read + Send + 'static, to: Sender<String>) {
    thread::spawn(move || {
        for line in BufReader::new(pipe).split(b'\n').map_while(Result::ok) {
            if to.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
                break;
            }
        }
    });
}
