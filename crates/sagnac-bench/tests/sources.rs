//! Real sources: each sends a known log, and the finished Parquet holds it row by row.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::time::Duration;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use sagnac_bench::live::{Live, LiveRequest};
use sagnac_bench::{Finished, JournalRows, Session, SourceState, finish, journal_of};
use sagnac_log::ingest::{LogReader, ParquetRead, ReadMode, parquet_batches};
use sagnac_log::setup::Setup;

/// Longest wait for something that must happen.
const PATIENCE: Duration = Duration::from_secs(30);

fn setup(bench: &str) -> Setup {
    Setup::parse(&format!("serial = \"T\"\naxis = \"z\"\narcsec_per_count = 0.6\n{bench}")).unwrap()
}

/// Waits until a condition holds.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = std::time::Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "{what} did not happen");
        std::thread::yield_now();
    }
}

fn rows(from: u32, to: u32) -> String {
    (from..to).map(|i| format!("{}.5,{},{:.3}\n", i, 100 + i % 7, f64::from(i) / 100.0)).collect()
}

const HEADER: &str = "time_s,counts,temperature_c\n";

/// A recording in a folder of its own.
struct Recording {
    folder: tempfile::TempDir,
    session: Option<Session>,
}

impl Recording {
    fn begin(setup: &Setup) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::begin(setup, "test", &journal_of(&folder.path().join("run.parquet")), false).unwrap();
        Self { folder, session: Some(session) }
    }

    /// With the server that it connects to.
    fn over_tcp() -> (Self, TcpListener) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        (Self::begin(&setup(&format!("[bench]\nsource = \"tcp://{address}\""))), listener)
    }

    fn log(&self) -> PathBuf {
        self.folder.path().join("run.parquet")
    }

    fn session(&self) -> &Session {
        self.session.as_ref().unwrap()
    }

    /// Waits until so many rows were recorded.
    fn wait_for_rows(&self, rows: u64) {
        let path = journal_of(&self.log());
        let mut all = JournalRows::follow(&path, self.session().published.clone()).unwrap();
        until("rows", || {
            let _ = all.next_rows().unwrap();
            all.finished().counts.rows >= rows
        });
    }

    fn end(&mut self) -> Finished {
        let session = self.session.take().unwrap();
        session.stop.stop();
        session.join().unwrap();
        finish(JournalRows::open(&journal_of(&self.log())).unwrap(), &self.log()).unwrap()
    }

    fn column(&self, name: &str) -> Vec<Option<f64>> {
        column(&self.log(), name)
    }
}

fn column(log: &Path, name: &str) -> Vec<Option<f64>> {
    let read = ParquetRead { roots: None, rows: 1024, values: u64::MAX, memory: Default::default() };
    let batches = parquet_batches(std::fs::File::open(log).unwrap(), &read).unwrap();
    let mut out = Vec::new();
    for batch in batches {
        let batch = batch.unwrap();
        let column = batch.column_by_name(name).unwrap_or_else(|| panic!("no {name} in {:?}", batch.schema()));
        out.extend(column.as_primitive::<Float64Type>().iter());
    }
    out
}

fn expected_counts(from: u32, to: u32) -> Vec<Option<f64>> {
    (from..to).map(|i| Some(f64::from(100 + i % 7))).collect()
}

#[test]
fn a_tcp_source_that_breaks_leaves_a_gap_and_not_an_end() {
    let (mut recording, listener) = Recording::over_tcp();
    let (mut first, _) = listener.accept().unwrap();
    first.write_all((HEADER.to_owned() + &rows(0, 50)).as_bytes()).unwrap();
    recording.wait_for_rows(50);
    // The line breaks within a row, which is lost; another connection begins with headers again.
    first.write_all(b"50.5,10").unwrap();
    drop(first);
    let (mut second, _) = listener.accept().unwrap();
    second.write_all((HEADER.to_owned() + &rows(60, 100)).as_bytes()).unwrap();
    recording.wait_for_rows(90);
    let finished = recording.end();
    assert_eq!(finished.counts.rows, 90);
    assert_eq!(finished.counts.lost_bytes, 7);
    assert_eq!(recording.column("counts"), [expected_counts(0, 50), expected_counts(60, 100)].concat());
    assert!(finished.events.iter().any(|event| event.what.contains("lost")), "{:?}", finished.events);
}

/// A source that says nothing is named within three seconds of its last byte, and what it says afterwards is recorded.
#[test]
fn a_silent_source_is_named_within_three_seconds() {
    let (mut recording, listener) = Recording::over_tcp();
    let (mut line, _) = listener.accept().unwrap();
    line.write_all((HEADER.to_owned() + &rows(0, 5)).as_bytes()).unwrap();
    let state = |recording: &Recording| recording.session().sources.now().remove(0);
    until("live", || state(&recording).state == SourceState::Live);
    let last_ns = state(&recording).last_ns;
    until("silence", || state(&recording).state == SourceState::Silent);
    let after_s = (recording.session().clock.now_ns() - last_ns) as f64 * 1e-9;
    assert!(after_s < 3.0, "named after {after_s} s");
    line.write_all(rows(5, 9).as_bytes()).unwrap();
    until("live again", || state(&recording).state == SourceState::Live);
    let finished = recording.end();
    assert_eq!(finished.counts.rows, 9);
    assert!(finished.events.iter().any(|event| event.what.contains("silent")), "{:?}", finished.events);
}

#[test]
fn datagrams_are_lines() {
    let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let mut recording = Recording::begin(&setup(&format!(
        "[bench]\nsource = \"udp://{free}\"\nheaders = \"time_s,counts,temperature_c\""
    )));
    until("bound", || recording.session().sources.now()[0].last_ns > 0);
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    for i in 0..200 {
        sender.send_to(rows(i, i + 1).as_bytes(), free).unwrap();
        if i % 20 == 19 {
            recording.wait_for_rows(u64::from(i) + 1);
        }
    }
    assert_eq!(recording.end().counts.rows, 200);
    assert_eq!(recording.column("counts"), expected_counts(0, 200));
}

/// A pair of pseudo-terminals: the far end writes, the near end is opened by its path as any serial port.
#[test]
#[cfg(target_os = "linux")]
fn a_serial_port_is_read_from_the_middle_of_a_row() {
    let (gyro, port) = serial2::SerialPort::pair().unwrap();
    let fd = std::os::fd::AsRawFd::as_raw_fd(&port);
    let path = std::fs::read_link(format!("/proc/self/fd/{fd}")).unwrap();
    gyro.write_all(b"7,23.000\n").unwrap();
    let mut recording = Recording::begin(&setup(&format!("[bench]\nsource = \"serial:{}?baud=9600\"", path.display())));
    gyro.write_all((HEADER.to_owned() + &rows(0, 100)).as_bytes()).unwrap();
    recording.wait_for_rows(100);
    let finished = recording.end();
    assert_eq!(finished.counts.rows, 100);
    assert_eq!(recording.column("counts"), expected_counts(0, 100));
    drop(port);
}

/// A file that grows, is resumed at the byte where the recording stopped, and is replaced by another one.
#[test]
fn a_growing_file_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("live.csv");
    std::fs::write(&path, HEADER.to_owned() + &rows(0, 20) + "20.5,10").unwrap();
    let setup = setup(&format!("[bench]\nsource = \"file:{}\"", path.display()));
    let mut recording = Recording::begin(&setup);
    recording.wait_for_rows(20);
    recording.end();
    // While nobody looks, the row is finished and more come.
    let mut file = std::fs::File::options().append(true).open(&path).unwrap();
    file.write_all(("6,0.200\n".to_owned() + &rows(21, 40)).as_bytes()).unwrap();
    let log = recording.log();
    recording.session = Some(Session::begin(&setup, "test", &journal_of(&log), true).unwrap());
    recording.wait_for_rows(40);
    std::fs::rename(&path, folder.path().join("old.csv")).unwrap();
    std::fs::write(&path, HEADER.to_owned() + &rows(40, 60)).unwrap();
    recording.wait_for_rows(60);
    let finished = recording.end();
    assert_eq!((finished.counts.rows, finished.counts.lost_bytes), (60, 0));
    assert_eq!(recording.column("counts"), expected_counts(0, 60));
}

/// An instrument that answers lines, as the controller of a chamber does.
fn scpi_server() -> std::net::SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for line in listener.incoming() {
            let mut line: TcpStream = line.unwrap();
            std::thread::spawn(move || {
                let (mut bytes, mut asked) = ([0; 64], Vec::new());
                while let Ok(read) = line.read(&mut bytes) {
                    if read == 0 {
                        return;
                    }
                    asked.extend_from_slice(&bytes[..read]);
                    while let Some(end) = asked.iter().position(|byte| *byte == b'\n') {
                        let question = String::from_utf8(asked.drain(..=end).collect()).unwrap();
                        let answer: &[u8] =
                            if question.trim() == "MEAS:TEMP?" { b"+2.150000E+01\r\n" } else { b"45\r\n" };
                        line.write_all(answer).unwrap();
                    }
                }
            });
        }
    });
    address
}

#[test]
fn a_chamber_is_asked_over_scpi() {
    let chamber = scpi_server();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let setup = setup(&format!(
        "[bench]\nsource = \"tcp://{}\"\n[[bench.poll]]\nsource = \"scpi://{chamber}\"\nevery_s = 0.05\ncolumns = [{{ name = \"temperature_c_chamber\", query = \"MEAS:TEMP?\" }}, {{ name = \"set_point_c\", query = \"SOUR:TEMP?\" }}]",
        listener.local_addr().unwrap()
    ));
    let mut recording = Recording::begin(&setup);
    let (mut line, _) = listener.accept().unwrap();
    until("answers", || recording.session().sources.now()[1..].iter().all(|source| source.bytes > 0));
    line.write_all((HEADER.to_owned() + &rows(0, 10)).as_bytes()).unwrap();
    recording.wait_for_rows(10);
    recording.end();
    assert_eq!(recording.column("temperature_c_chamber"), vec![Some(21.5); 10]);
    assert_eq!(recording.column("set_point_c"), vec![Some(45.0); 10]);
    // The log is read with the same setup; the chamber is a thermometer of it.
    let log = LogReader::open(recording.log(), &Setup { bench: Default::default(), ..setup }, ReadMode::Bulk).unwrap();
    assert_eq!(log.shape().thermometers, ["", "chamber"]);
}

/// The peer is another implementation: tokio-modbus serves, rmodbus asks.
#[test]
fn a_chamber_is_asked_over_modbus() {
    use tokio_modbus::prelude::*;
    struct Chamber;
    impl tokio_modbus::server::Service for Chamber {
        type Request = SlaveRequest<'static>;
        type Response = Response;
        type Exception = ExceptionCode;
        type Future = std::future::Ready<Result<Response, ExceptionCode>>;
        fn call(&self, asked: Self::Request) -> Self::Future {
            std::future::ready(match asked.request {
                Request::ReadHoldingRegisters(100, 1) if asked.slave == 3 => {
                    Ok(Response::ReadHoldingRegisters(vec![(-405_i16) as u16]))
                }
                Request::ReadInputRegisters(7, 2) => {
                    let bits = 36.25_f32.to_bits();
                    Ok(Response::ReadInputRegisters(vec![(bits >> 16) as u16, bits as u16]))
                }
                _ => Err(ExceptionCode::IllegalDataAddress),
            })
        }
    }
    let std_listener = TcpListener::bind("127.0.0.1:0").unwrap();
    std_listener.set_nonblocking(true).unwrap();
    let chamber = std_listener.local_addr().unwrap();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async move {
            let listener = tokio::net::TcpListener::from_std(std_listener).unwrap();
            let server = tokio_modbus::server::tcp::Server::new(listener);
            let on_connected = |stream, _| async move { Ok(Some((Chamber, stream))) };
            server.serve(&on_connected, |error| panic!("{error}")).await.unwrap();
        });
    });
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let column = |name: &str, more: &str| format!("{{ name = \"{name}\", {more} }}");
    let setup = setup(&format!(
        "[bench]\nsource = \"tcp://{}\"\n[[bench.poll]]\nsource = \"modbus://{chamber}?unit=3\"\nevery_s = 0.05\ncolumns = [{}, {}]",
        listener.local_addr().unwrap(),
        column("temperature_c_chamber", "register = 100, scale = 0.1"),
        column("set_point_c", "register = 7, table = \"input\", type = \"f32\""),
    ));
    let mut recording = Recording::begin(&setup);
    let (mut line, _) = listener.accept().unwrap();
    until("answers", || recording.session().sources.now()[1..].iter().all(|source| source.bytes > 0));
    line.write_all((HEADER.to_owned() + &rows(0, 10)).as_bytes()).unwrap();
    recording.wait_for_rows(10);
    recording.end();
    assert_eq!(recording.column("temperature_c_chamber"), vec![Some(-40.5); 10]);
    assert_eq!(recording.column("set_point_c"), vec![Some(36.25); 10]);
}

/// An answer that grows old is no value: the rows behind it have none.
#[test]
fn an_instrument_that_is_lost_leaves_no_stale_values() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let chamber = TcpListener::bind("127.0.0.1:0").unwrap();
    let setup = setup(&format!(
        "[bench]\nsource = \"tcp://{}\"\n[[bench.poll]]\nsource = \"scpi://{}\"\nevery_s = 0.01\ncolumns = [{{ name = \"temperature_c_chamber\", query = \"T?\" }}]",
        listener.local_addr().unwrap(),
        chamber.local_addr().unwrap()
    ));
    let mut recording = Recording::begin(&setup);
    let (mut line, _) = listener.accept().unwrap();
    let (mut instrument, _) = chamber.accept().unwrap();
    let mut question = [0; 3];
    instrument.read_exact(&mut question).unwrap();
    instrument.write_all(b"21\n").unwrap();
    until("an answer", || recording.session().sources.now()[1].bytes > 0);
    line.write_all((HEADER.to_owned() + &rows(0, 5)).as_bytes()).unwrap();
    recording.wait_for_rows(5);
    // It is asked, and says nothing any more; its values are too old after 1.03 s.
    drop(instrument);
    let answered_ns = recording.session().sources.now()[1].last_ns;
    until("old answers", || recording.session().clock.now_ns() - answered_ns > 1_100_000_000);
    line.write_all(rows(5, 10).as_bytes()).unwrap();
    recording.wait_for_rows(10);
    recording.end();
    assert_eq!(recording.column("temperature_c_chamber"), [vec![Some(21.0); 5], vec![None; 5]].concat());
}

/// What is shown is what the finished log says: the last fit of the recording is that of the log.
#[test]
fn the_fit_that_is_shown_is_that_of_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.csv");
    // A triangle over 50 °C and back with a quadratic drift, in rows of 10 s; the noise is a fixed sequence.
    let mut text = HEADER.to_owned();
    let mut seed = 12_345_u64;
    for i in 0..4000_u32 {
        let along = (f64::from(i) / 2000.0 - 1.0).abs();
        let celsius = 45.0 - 50.0 * along;
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let noise = (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5;
        let rate_dph = 4.5 + 0.02 * (celsius - 20.0) - 4e-4 * (celsius - 20.0).powi(2);
        let counts = (rate_dph * 10.0 / 0.6 + 8.0 * noise).round();
        text += &format!("{},{counts},{celsius:.3}\n", 10 * (i + 1));
    }
    std::fs::write(&path, text).unwrap();
    let setup = setup(&format!("[bench]\nsource = \"replay:{}?speed=max\"", path.display()));
    let mut recording = Recording::begin(&setup);
    let live = Live::default();
    let rows = JournalRows::follow(&journal_of(&recording.log()), recording.session().published.clone()).unwrap();
    let request = LiveRequest { model: "auto".parse().unwrap(), enough: None, every_minute: false };
    let reader = live.begin(rows, &setup, request).unwrap();
    until("the end", || recording.session().is_ended());
    reader.join().unwrap();
    recording.end();
    let plain = Setup { bench: Default::default(), ..setup };
    let record = sagnac::calibrate(&plain, [recording.log()], "auto".parse().unwrap()).unwrap();
    let study = live.look(|state| state.study.clone());
    let (shown, made) = (&study.axes[0], &record.axes[0]);
    assert_eq!(shown.model, made.correction.model);
    assert_eq!(shown.residual_dph.to_bits(), made.residual().unwrap().sigma_dph.to_bits());
    assert_eq!(shown.floor_dph.map(f64::to_bits), made.noise_floor().map(|floor| floor.value_dph.to_bits()));
    for at in &shown.curve {
        let predicted = made.predict(at.temperature_c).unwrap();
        assert_eq!(
            (at.drift_dph.to_bits(), at.half_dph.to_bits()),
            (predicted.drift_dph.to_bits(), predicted.curve_dph.to_bits())
        );
    }
    // And the log of the test says the same as the text that was replayed.
    let text = sagnac::calibrate(&plain, [path], "auto".parse().unwrap()).unwrap();
    assert_eq!(serde_json::to_string(&text.axes).unwrap(), serde_json::to_string(&record.axes).unwrap());
}

/// What a board says when it starts is no line of headers, and other headers than before end nothing: their rows are not read.
#[test]
fn odd_lines_end_no_recording() {
    let (mut recording, listener) = Recording::over_tcp();
    let (mut first, _) = listener.accept().unwrap();
    let boot = "rate_limit=4,counts_ok\nbooting...\n";
    first
        .write_all((boot.to_owned() + HEADER + &rows(0, 20) + "counts_reset,now\n" + &rows(20, 30)).as_bytes())
        .unwrap();
    recording.wait_for_rows(30);
    drop(first);
    let (mut second, _) = listener.accept().unwrap();
    let other = "time_s,temperature_c,counts\n1,2,3\n4,5,6\n";
    second.write_all((other.to_owned() + HEADER + &rows(30, 40)).as_bytes()).unwrap();
    recording.wait_for_rows(40);
    let finished = recording.end();
    assert_eq!(recording.column("counts"), expected_counts(0, 40));
    for said in ["the headers changed", "the earlier headers are back", "unreadable header line"] {
        assert!(finished.events.iter().any(|event| event.what.contains(said)), "{said}: {:?}", finished.events);
    }
}

/// A rig that writes Windows-1252, decimal commas and dates of its country: the log is that of the same rows in a file.
#[test]
fn a_foreign_rig_is_read_as_its_file_is() {
    let row = |i: u32| {
        format!("24.11.2026 08:{:02}:{:02};{},{:02};{};n{i}\r\n", i / 60, i % 60, 20 + i / 100, i % 100, 7 + i % 5)
    };
    let text = "Zeitpunkt;Temperatur (°C);Zähler;Bemerkung\r\n".to_owned() + &(0..300).map(row).collect::<String>();
    let bytes: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.txt");
    std::fs::write(&path, &bytes).unwrap();
    let columns =
        "[columns]\n\"Zeitpunkt\" = \"time\"\n\"Temperatur (°C)\" = \"temperature_c\"\n\"Zähler\" = \"counts_z\"\n";
    let setup = setup(&format!("{columns}[bench]\nsource = \"file:{}\"", path.display()));
    let mut recording = Recording::begin(&setup);
    recording.wait_for_rows(300);
    recording.end();
    let plain = Setup { bench: Default::default(), ..setup };
    let rows = |path: &Path| {
        let mut log = LogReader::open(path, &plain, ReadMode::Bulk).unwrap();
        let mut all = Vec::new();
        while let Some(batch) = log.next_batch().unwrap() {
            all.extend(batch.end_ns.iter().copied().zip(batch.angle[0].clone()).zip(batch.temperature_c[0].clone()));
        }
        all
    };
    let recorded = rows(&recording.log());
    assert_eq!(recorded.len(), 300);
    assert_eq!(recorded, rows(&path));
}
