//! Instruments that are asked: SCPI and Modbus, over TCP.
//!
//! Each column is a source of its own in the journal: its bytes are the answer as it came, a line of text or the registers' bytes.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rmodbus::client::ModbusRequest;
use sagnac_log::setup::{PollColumn, PollSetup, RegisterTable};
use sagnac_log::threads::spawn;

use super::stream::connected;
use super::{Connection, Instrument, Out, SessionEnd, SourceEvent};

/// Longest time for an answer.
const ANSWER: Duration = Duration::from_secs(2);
/// Longest answer, bytes.
const MOST_ANSWER_BYTES: u64 = 4096;
/// Bytes of a Modbus TCP header, which tells the length of the rest.
const MODBUS_HEAD_BYTES: usize = 6;
/// Function code's bit of an exception.
const EXCEPTION: u8 = 0x80;

/// Starts to ask an instrument. `outs` are the ways of its columns.
pub(crate) fn spawn_poll(instrument: Instrument, poll: PollSetup, outs: Vec<Out>) -> std::io::Result<JoinHandle<()>> {
    spawn("poll", move || {
        // One of the columns speaks for the instrument.
        if let Some(first) = outs.first() {
            first.keep(|_| ask_on(&instrument, &poll, &outs, first));
        }
    })
}

/// Asks all columns in turn until something fails.
fn ask_on(instrument: &Instrument, poll: &PollSetup, outs: &[Out], first: &Out) -> SessionEnd {
    let (Instrument::Scpi(address) | Instrument::Modbus { address, .. }) = instrument;
    let client = connected(address).and_then(|stream| {
        stream.set_read_timeout(Some(ANSWER))?;
        let reader = BufReader::new(stream.try_clone()?);
        Ok(Client { stream, reader, transaction: 0 })
    });
    let mut client = match client {
        Ok(client) => client,
        Err(error) => return SessionEnd::NotConnected(error.to_string()),
    };
    if !first.send(SourceEvent::Connected(Connection::whole(instrument.shown()))) {
        return SessionEnd::Stopped;
    }
    let every = Duration::from_secs_f64(poll.every_s);
    let mut due = Instant::now();
    loop {
        for (column, out) in poll.columns.iter().zip(outs) {
            let answer = match instrument {
                Instrument::Scpi(_) => client.ask_scpi(column),
                Instrument::Modbus { unit, .. } => client.ask_modbus(*unit, column),
            };
            match answer {
                Ok(answer) => {
                    if !out.send(SourceEvent::Bytes(answer)) {
                        return SessionEnd::Stopped;
                    }
                }
                Err(error) => return SessionEnd::Lost(format!("{}: {error}", column.name)),
            }
        }
        // An instrument that is slower than it is asked is asked as fast as it answers.
        due = (due + every).max(Instant::now());
        if first.stop.wait(due.saturating_duration_since(Instant::now())) {
            return SessionEnd::Stopped;
        }
    }
}

/// Asks, and reads answers.
struct Client {
    stream: TcpStream,
    reader: BufReader<TcpStream>,
    transaction: u16,
}

fn wrong(what: impl Into<String>) -> std::io::Error {
    std::io::Error::new(ErrorKind::InvalidData, what.into())
}

impl Client {
    /// A question, and its answer without the end of the line.
    fn ask_scpi(&mut self, column: &PollColumn) -> std::io::Result<Vec<u8>> {
        // What nobody asked for would be taken for the answer, and every later answer for that of the question before.
        self.stream.set_nonblocking(true)?;
        let unasked = self.stream.peek(&mut [0]).is_ok_and(|bytes| bytes > 0) || !self.reader.buffer().is_empty();
        self.stream.set_nonblocking(false)?;
        if unasked {
            return Err(wrong("it sends unrequested data"));
        }
        let question = column.query.as_deref().unwrap_or_default();
        self.stream.write_all(format!("{question}\n").as_bytes())?;
        let mut answer = Vec::new();
        (&mut self.reader).take(MOST_ANSWER_BYTES).read_until(b'\n', &mut answer)?;
        if !answer.ends_with(b"\n") {
            return Err(wrong("the connection ended within an answer"));
        }
        Ok(answer.trim_ascii().to_vec())
    }

    /// The bytes of the registers, the high byte of each first.
    fn ask_modbus(&mut self, unit: u8, column: &PollColumn) -> std::io::Result<Vec<u8>> {
        let mut request = ModbusRequest::new_tcp_udp(unit, self.transaction);
        self.transaction = self.transaction.wrapping_add(1);
        let (register, count) = (column.register.unwrap_or(0), column.kind.registers());
        let mut question = Vec::new();
        let encoded = match column.table {
            RegisterTable::Holding => request.generate_get_holdings(register, count, &mut question),
            RegisterTable::Input => request.generate_get_inputs(register, count, &mut question),
        };
        encoded.map_err(|e| wrong(e.to_string()))?;
        self.stream.write_all(&question)?;
        let mut answer = vec![0; MODBUS_HEAD_BYTES];
        self.reader.read_exact(&mut answer)?;
        let length = match answer.get(4..6) {
            Some([high, low]) => usize::from(u16::from_be_bytes([*high, *low])),
            _ => 0,
        };
        // Unit, function and number of bytes, then the registers; an exception is shorter.
        if !(3..=256).contains(&length) {
            return Err(wrong(format!("an answer of {length} bytes")));
        }
        answer.resize(MODBUS_HEAD_BYTES + length, 0);
        self.reader.read_exact(answer.get_mut(MODBUS_HEAD_BYTES..).unwrap_or_default())?;
        if answer.get(7).is_some_and(|function| function & EXCEPTION != 0) {
            let code = answer.get(8).copied().unwrap_or(0);
            return Err(wrong(format!("the instrument refuses register {register} (exception {code})")));
        }
        request.parse_ok(&answer).map_err(|e| wrong(e.to_string()))?;
        let registers = answer.get(9..).unwrap_or_default();
        if registers.len() != usize::from(2 * count) {
            return Err(wrong(format!("{} bytes for {count} registers", registers.len())));
        }
        Ok(registers.to_vec())
    }
}
