//! Sources of bytes: standard input, growing files, TCP, UDP, serial ports, logs that are replayed.

use std::fs::{File, Metadata};
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::net::{TcpStream, ToSocketAddrs, UdpSocket};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

use sagnac_log::setup::Setup;
use sagnac_log::threads::spawn;

use super::{Address, Connection, GoOn, Out, PATIENCE, SessionEnd, SourceEvent};
use crate::journal::MOST_PAYLOAD_BYTES;
use crate::source::replay::replay;

/// Bytes read at once.
const PIECE_BYTES: usize = MOST_PAYLOAD_BYTES / 2;
/// How often a file is looked at whether it has grown.
const GROWN: Duration = Duration::from_millis(100);
/// Bytes of a file, the first and the last that were read, by which it is known again.
const KEPT_BYTES: usize = 1024;
/// Time to make a connection.
const CONNECT: Duration = Duration::from_secs(3);

/// Starts a source; a file or a replay goes on where it was recorded up to.
pub(crate) fn spawn_stream(
    address: Address,
    mut go_on: GoOn,
    setup: Setup,
    out: Out,
) -> std::io::Result<JoinHandle<()>> {
    spawn("source", move || match address {
        Address::Input => input(&out),
        Address::File(path) => {
            out.keep(|out| file(&path, &mut go_on, out));
        }
        Address::Tcp(address) => out.keep(|out| tcp(&address, out)),
        Address::Udp(address) => out.keep(|out| udp(&address, out)),
        Address::Serial { path, baud } => out.keep(|out| serial(&path, baud, out)),
        // From its beginning, where it was begun again after a fault, its rows would come twice: it ends.
        Address::Replay { path, speed } => out.keep(|out| {
            let replayed = catch_unwind(AssertUnwindSafe(|| replay(&path, speed, go_on.place, &setup, out)));
            if replayed.is_err() {
                out.send(SourceEvent::Lost("a fault of this program".to_owned()));
                return SessionEnd::Ended;
            }
            SessionEnd::Stopped
        }),
    })
}

/// An interrupted or late read is none that failed.
fn is_late(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

/// Reads until the end, a failure or the stop.
fn pour(reader: &mut dyn Read, out: &Out, at_end: impl Fn() -> SessionEnd) -> SessionEnd {
    let mut bytes = vec![0; PIECE_BYTES];
    loop {
        if out.stop.is_stopped() {
            return SessionEnd::Stopped;
        }
        match reader.read(&mut bytes) {
            Ok(0) => return at_end(),
            Ok(read) => {
                if !out.send(SourceEvent::Bytes(bytes.get(..read).unwrap_or_default().to_vec())) {
                    return SessionEnd::Stopped;
                }
            }
            Err(error) if is_late(&error) => {}
            Err(error) => return SessionEnd::Lost(error.to_string()),
        }
    }
}

fn input(out: &Out) {
    out.keep(|out| {
        if !out.send(SourceEvent::Connected(Connection::whole("standard input"))) {
            return SessionEnd::Stopped;
        }
        pour(&mut std::io::stdin(), out, || SessionEnd::Ended)
    });
}

/// A file that grows, from a place on. One that became shorter, or is another file under its name, is read from its start.
fn file(path: &Path, GoOn { place: at, tail }: &mut GoOn, out: &Out) -> SessionEnd {
    let mut open = match sagnac_log::read::open_input(path) {
        Ok(open) => open,
        Err(error) => return SessionEnd::NotConnected(error.to_string()),
    };
    let length = open.metadata().map_or(0, |metadata| metadata.len());
    if length < *at || !goes_on(&mut open, *at, tail) {
        *at = 0;
    }
    tail.clear();
    let mut read_before = match ReadBefore::up_to(&mut open, *at) {
        Ok(read_before) => read_before,
        Err(error) => return SessionEnd::NotConnected(error.to_string()),
    };
    if !out.send(SourceEvent::Connected(Connection::from_byte(path.display().to_string(), *at))) {
        return SessionEnd::Stopped;
    }
    let mut bytes = vec![0; PIECE_BYTES];
    loop {
        let read = read_before.is_there(&mut open, *at).and_then(|same| Ok((same, open.read(&mut bytes)?)));
        match read {
            Ok((false, _)) => {
                *at = 0;
                return SessionEnd::Lost("the file was written again".to_owned());
            }
            Ok((true, 0)) => {
                if let Some(why) = replaced(path, &open, *at) {
                    *at = 0;
                    return SessionEnd::Lost(why);
                }
                if out.stop.wait(GROWN) {
                    return SessionEnd::Stopped;
                }
            }
            Ok((true, read)) => {
                *at += read as u64;
                read_before.add(bytes.get(..read).unwrap_or_default());
                let came = SourceEvent::Bytes(bytes.get(..read).unwrap_or_default().to_vec());
                if !out.send(came) || out.stop.is_stopped() {
                    return SessionEnd::Stopped;
                }
            }
            Err(error) if is_late(&error) => {}
            Err(error) => return SessionEnd::Lost(error.to_string()),
        }
    }
}

/// The first and the last bytes of a file that were read: a file that is written again under its reader has others.
struct ReadBefore {
    first: Vec<u8>,
    last: Vec<u8>,
}

impl ReadBefore {
    /// Of the bytes before a place; the file is there then.
    fn up_to(open: &mut File, at: u64) -> std::io::Result<Self> {
        let mut part = |from: u64| {
            let mut bytes = Vec::new();
            open.seek(SeekFrom::Start(from))?;
            open.by_ref().take((at - from).min(KEPT_BYTES as u64)).read_to_end(&mut bytes)?;
            Ok::<_, std::io::Error>(bytes)
        };
        let read_before = Self { first: part(0)?, last: part(at.saturating_sub(KEPT_BYTES as u64))? };
        open.seek(SeekFrom::Start(at))?;
        Ok(read_before)
    }

    fn add(&mut self, bytes: &[u8]) {
        let room = KEPT_BYTES.saturating_sub(self.first.len());
        self.first.extend(bytes.iter().take(room));
        self.last.extend_from_slice(bytes);
        self.last.drain(..self.last.len().saturating_sub(KEPT_BYTES));
    }

    /// The file still has them before the place that it is read at. One that became shorter is looked at by [`replaced`].
    fn is_there(&self, open: &mut File, at: u64) -> std::io::Result<bool> {
        if open.metadata()?.len() < at {
            return Ok(true);
        }
        let now = Self::up_to(open, at)?;
        Ok(now.first == self.first && now.last == self.last)
    }
}

/// The file has the bytes that were recorded before a place.
fn goes_on(open: &mut File, at: u64, tail: &[u8]) -> bool {
    let mut there = vec![0; tail.len()];
    let from = at.saturating_sub(tail.len() as u64);
    open.seek(SeekFrom::Start(from)).and_then(|_| open.read_exact(&mut there)).is_ok() && there == tail
}

/// Why the file under a path is no longer the open one, as far as it was read.
fn replaced(path: &Path, open: &File, at: u64) -> Option<String> {
    let now = std::fs::metadata(path).ok()?;
    if now.len() < at {
        return Some("the file became shorter".to_owned());
    }
    is_another(&now, &open.metadata().ok()?).then(|| "another file took its name".to_owned())
}

#[cfg(unix)]
fn is_another(one: &Metadata, other: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (one.dev(), one.ino()) != (other.dev(), other.ino())
}

/// A system without numbers of files.
#[cfg(not(unix))]
fn is_another(_: &Metadata, _: &Metadata) -> bool {
    false
}

/// A connection to the first address of a name that answers.
pub(crate) fn connected(address: &str) -> std::io::Result<TcpStream> {
    let mut failed = std::io::Error::new(ErrorKind::NotFound, "the name has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT) {
            Ok(stream) => {
                stream.set_read_timeout(Some(PATIENCE))?;
                stream.set_write_timeout(Some(CONNECT))?;
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => failed = error,
        }
    }
    Err(failed)
}

fn tcp(address: &str, out: &Out) -> SessionEnd {
    let mut stream = match connected(address) {
        Ok(stream) => stream,
        Err(error) => return SessionEnd::NotConnected(error.to_string()),
    };
    if !out.send(SourceEvent::Connected(Connection::within(format!("tcp://{address}")))) {
        return SessionEnd::Stopped;
    }
    pour(&mut stream, out, || SessionEnd::Lost("the other side has closed the connection".to_owned()))
}

/// Datagrams: each is whole lines or frames, so the end of one is the end of a line.
fn udp(address: &str, out: &Out) -> SessionEnd {
    let socket = UdpSocket::bind(address).and_then(|socket| socket.set_read_timeout(Some(PATIENCE)).map(|()| socket));
    let socket = match socket {
        Ok(socket) => socket,
        Err(error) => return SessionEnd::NotConnected(error.to_string()),
    };
    let heard = socket.local_addr().map_or_else(|_| address.to_owned(), |bound| bound.to_string());
    if !out.send(SourceEvent::Connected(Connection::whole(format!("udp://{heard}")))) {
        return SessionEnd::Stopped;
    }
    let mut bytes = vec![0; MOST_PAYLOAD_BYTES];
    loop {
        if out.stop.is_stopped() {
            return SessionEnd::Stopped;
        }
        match socket.recv(&mut bytes) {
            Ok(read) => {
                if !out.send(SourceEvent::Bytes(bytes.get(..read).unwrap_or_default().to_vec())) {
                    return SessionEnd::Stopped;
                }
            }
            Err(error) if is_late(&error) => {}
            Err(error) => return SessionEnd::Lost(error.to_string()),
        }
    }
}

fn serial(path: &Path, baud: u32, out: &Out) -> SessionEnd {
    let port = serial2::SerialPort::open(path, baud).and_then(|mut port| {
        port.set_read_timeout(PATIENCE)?;
        Ok(port)
    });
    let mut port = match port {
        Ok(port) => port,
        Err(error) => return SessionEnd::NotConnected(error.to_string()),
    };
    if !out.send(SourceEvent::Connected(Connection::within(format!("{} at {baud} baud", path.display())))) {
        return SessionEnd::Stopped;
    }
    pour(&mut port, out, || SessionEnd::Lost("the port was closed".to_owned()))
}
