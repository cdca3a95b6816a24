//! Addresses of sources, as a setup and a flag write them.

use std::path::PathBuf;
use std::str::FromStr;

use sagnac_log::{Error, Result};

/// Baud of a serial port without one.
const DEFAULT_BAUD: u32 = 115_200;
/// Times real time that a replay may have: a row of 0.1 s takes less than two minutes, and a day more than 80 µs.
const SPEEDS: std::ops::RangeInclusive<f64> = 1e-3..=1e9;
/// Help for an address that is none.
const FORMS: &str =
    "write it as -, file:PATH, tcp://HOST:PORT, udp://HOST:PORT, serial:DEVICE?baud=115200 or replay:LOG?speed=10";

/// Where a gyro's bytes come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Address {
    /// Standard input.
    Input,
    /// A file that grows.
    File(PathBuf),
    /// A server that is connected to.
    Tcp(String),
    /// An address that is listened on.
    Udp(String),
    /// A serial port.
    Serial {
        /// Its device.
        path: PathBuf,
        /// Bits per second; eight of them a byte, no parity, one stop bit.
        baud: u32,
    },
    /// A log, in its own time.
    Replay {
        /// The log.
        path: PathBuf,
        /// Times real time; infinity for as fast as it can be read.
        speed: f64,
    },
}

impl Address {
    /// As it is shown.
    pub fn shown(&self) -> String {
        match self {
            Self::Input => "standard input".to_owned(),
            Self::File(path) => path.display().to_string(),
            Self::Tcp(address) => format!("tcp://{address}"),
            Self::Udp(address) => format!("udp://{address}"),
            Self::Serial { path, baud } => format!("{} at {baud} baud", path.display()),
            Self::Replay { path, .. } => format!("replay of {}", path.display()),
        }
    }
}

/// What is in front of `?`, and the value of the one key behind it.
fn with_key<'a>(text: &'a str, key: &str) -> Result<(&'a str, Option<&'a str>)> {
    let Some((front, query)) = text.split_once('?') else { return Ok((text, None)) };
    let value = query.strip_prefix(key).and_then(|rest| rest.strip_prefix('='));
    value.map(|value| (front, Some(value))).ok_or_else(|| not_an_address(text))
}

fn not_an_address(text: &str) -> Error {
    Error::input("not a source", FORMS).column("source").value(text)
}

/// HOST:PORT with a port; a bracketed IPv6 address has colons of its own.
fn host_and_port(text: &str) -> Option<String> {
    let (host, port) = text.rsplit_once(':')?;
    let sound = !host.is_empty() && !host.contains(['/', '?']) && port.parse::<u16>().is_ok();
    sound.then(|| text.to_owned())
}

impl FromStr for Address {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = || not_an_address(text);
        let path = |path: &str| Some(PathBuf::from(path)).filter(|_| !path.is_empty()).ok_or_else(bad);
        if text == "-" {
            return Ok(Self::Input);
        }
        let (scheme, rest) = text.split_once(':').ok_or_else(bad)?;
        match scheme {
            "file" => Ok(Self::File(path(rest)?)),
            "tcp" => rest.strip_prefix("//").and_then(host_and_port).map(Self::Tcp).ok_or_else(bad),
            "udp" => rest.strip_prefix("//").and_then(host_and_port).map(Self::Udp).ok_or_else(bad),
            "serial" => {
                let (device, baud) = with_key(rest, "baud")?;
                let baud = baud.map_or(Ok(DEFAULT_BAUD), str::parse).ok().filter(|baud| *baud > 0).ok_or_else(bad)?;
                Ok(Self::Serial { path: path(device)?, baud })
            }
            "replay" => {
                let (log, speed) = with_key(rest, "speed")?;
                let speed = match speed {
                    None => 1.0,
                    Some("max") => f64::INFINITY,
                    Some(speed) => speed.parse().ok().filter(|speed| SPEEDS.contains(speed)).ok_or_else(bad)?,
                };
                Ok(Self::Replay { path: path(log)?, speed })
            }
            _ => Err(bad()),
        }
    }
}

/// An instrument that is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Instrument {
    /// SCPI over TCP: lines of text.
    Scpi(String),
    /// Modbus over TCP.
    Modbus {
        /// HOST:PORT.
        address: String,
        /// Number of the unit behind it.
        unit: u8,
    },
}

impl Instrument {
    /// As it is shown.
    pub fn shown(&self) -> String {
        match self {
            Self::Scpi(address) => format!("scpi://{address}"),
            Self::Modbus { address, .. } => format!("modbus://{address}"),
        }
    }
}

impl FromStr for Instrument {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::input(
                "not the address of an instrument",
                "write it like scpi://HOST:PORT or modbus://HOST:PORT?unit=1",
            )
            .column("bench.poll.source")
            .value(text)
        };
        if let Some(rest) = text.strip_prefix("scpi://") {
            return host_and_port(rest).map(Self::Scpi).ok_or_else(bad);
        }
        let rest = text.strip_prefix("modbus://").ok_or_else(bad)?;
        let (address, unit) = with_key(rest, "unit").map_err(|_| bad())?;
        let unit = unit.map_or(Ok(1), str::parse).map_err(|_| bad())?;
        Ok(Self::Modbus { address: host_and_port(address).ok_or_else(bad)?, unit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_what_they_say() {
        let read = |text: &str| text.parse::<Address>().ok();
        assert_eq!(read("-"), Some(Address::Input));
        assert_eq!(read("tcp://[::1]:4000"), Some(Address::Tcp("[::1]:4000".into())));
        assert_eq!(
            read("serial:/dev/ttyUSB0?baud=9600"),
            Some(Address::Serial { path: "/dev/ttyUSB0".into(), baud: 9600 })
        );
        let fast = Address::Replay { path: "a.csv".into(), speed: f64::INFINITY };
        assert_eq!(read("replay:a.csv?speed=max"), Some(fast));
        for bad in [
            "",
            "tcp://host",
            "tcp:host:1",
            "udp://:",
            "file:",
            "serial:/dev/x?bauds=1",
            "replay:a?speed=0",
            "replay:a?speed=1e-300",
            "replay:a?speed=inf",
            "replay:a?speed=1e10",
            "ftp://x:1",
        ] {
            assert_eq!(read(bad), None, "{bad}");
        }
        let modbus = Instrument::Modbus { address: "c:502".into(), unit: 3 };
        assert_eq!("modbus://c:502?unit=3".parse::<Instrument>().ok(), Some(modbus));
        assert!("modbus://c?unit=3".parse::<Instrument>().is_err());
    }
}
