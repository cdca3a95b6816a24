//! Logs in every form: the same numbers result, and unusable values are counted with their place.

use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::GzEncoder;
use sagnac_log::ingest::{Batch, LogReader, ReadMode, Reason};
use sagnac_log::setup::{Counter, Setup};
use sagnac_log::{Error, ErrorKind, Result};

fn counts_setup() -> Setup {
    Setup { arcsec_per_count: Some(1.0), ..Setup::default() }
}

/// Everything usable in one batch, with the reader.
fn read(bytes: impl Into<Vec<u8>>, setup: &Setup) -> Result<(Batch, LogReader)> {
    let mut reader = LogReader::from_reader("log.csv", Box::new(Cursor::new(bytes.into())), setup, ReadMode::Bulk)?;
    let batch = reader.next_batch()?.cloned().unwrap_or_default();
    Ok((batch, reader))
}

fn refused(bytes: impl Into<Vec<u8>>, setup: &Setup) -> Error {
    match read(bytes, setup) {
        Err(error) => error,
        Ok(_) => panic!("accepted"),
    }
}

fn tallies(reader: &LogReader) -> Vec<(Reason, u64, String)> {
    reader.summary().tallies.list().into_iter().map(|t| (t.reason, t.rows, t.first)).collect()
}

const PLAIN: &str = "time_s,temperature_c,counts\n1,20.5,7\n2,20.6,8\n3,20.7,-9\n";

#[test]
fn the_same_numbers_come_out_of_every_dialect() {
    let (plain, _) = read(PLAIN, &counts_setup()).unwrap();
    assert_eq!(plain.angle[0], [7.0, 8.0, -9.0]);
    assert_eq!(plain.start_ns, [0, 1_000_000_000, 2_000_000_000]);
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(PLAIN.as_bytes()).unwrap();
    let dialects: Vec<Vec<u8>> = vec![
        PLAIN.replace(',', "\t").into(),
        PLAIN.replace(',', ";").replace('.', ",").into(),
        format!("\u{feff}{}", PLAIN.replace('\n', "\r\n")).into(),
        format!("# a comment\n\n{PLAIN}# another\n").into(),
        PLAIN.replace("time_s,temperature_c", "\"time_s\",\"temperature_c\"").into(),
        "time_ms,temperature_k,counts\n1000,293.65,7\n2000,293.75,8\n3000,293.85,-9\n".into(),
        gzip.finish().unwrap(),
    ];
    for dialect in dialects {
        let (batch, reader) = read(dialect.clone(), &counts_setup()).unwrap();
        assert_eq!(
            (&batch.angle, &batch.end_ns),
            (&plain.angle, &plain.end_ns),
            "{}",
            String::from_utf8_lossy(&dialect)
        );
        for (ours, theirs) in batch.temperature_c[0].iter().zip(&plain.temperature_c[0]) {
            assert!((ours - theirs).abs() < 1e-9);
        }
        assert_eq!(tallies(&reader), []);
    }
}

#[test]
fn rows_that_cannot_be_used_are_counted_with_their_first_line() {
    let log = "time_s,temperature_c,counts,valid\n\
               1,20,1,1\n2,20,1,1\n2,20,1,1\n1.5,20,1,1\n3,20,x,1\n4,20,1,1\n5,20,inf,1\n6,20\n7,20,1,1\n\
               50,20,1,1\n51,999,1,1\n52,warm,1,1\n53,,1,1\n54,20,1,0\nx,20,1,1\n55,20,1e300,1\n";
    let (batch, reader) = read(log, &counts_setup()).unwrap();
    let expected = [
        (Reason::Ragged, 1, 9),
        (Reason::NotANumber, 3, 6),
        (Reason::ValueOutOfRange, 1, 17),
        (Reason::TimeBackwards, 1, 5),
        (Reason::DuplicateTime, 1, 4),
        // After the ragged row, and the real one.
        (Reason::Gap, 2, 10),
        (Reason::FlaggedInvalid, 1, 15),
        (Reason::TemperatureNotANumber, 1, 13),
        (Reason::TemperatureInvalid, 1, 12),
    ];
    let expected: Vec<_> = expected.into_iter().map(|(r, n, line)| (r, n, format!("log.csv:{line}"))).collect();
    assert_eq!(tallies(&reader), expected);
    assert_eq!(batch.line, [2, 3, 7, 10, 11, 12, 13, 14, 15]);
    // A row after a gap has the nominal interval; one after an unreadable count its own.
    assert_eq!((batch.start_ns[2], batch.start_ns[4]), (3_000_000_000, 49_000_000_000));
    // An invalid reading is no temperature; an empty field keeps the newest one.
    assert!(batch.temperature_c[0][5].is_nan() && batch.temperature_c[0][6].is_nan());
    assert_eq!(batch.temperature_c[0][7], 20.0);
    assert!(!batch.valid[8]);
    assert_eq!(reader.summary().rows, 16);
}

#[test]
fn a_thermometer_that_jumps_or_freezes_is_invalid() {
    let rows = |t: &dyn Fn(u32) -> String| {
        let lines: Vec<String> = (1..=1500).map(|s| format!("{s},{},1\n", t(s))).collect();
        lines.concat()
    };
    let jump = format!("time_s,temperature_c,counts\n{}", rows(&|s| if s == 700 { "60".into() } else { "20".into() }));
    let (batch, reader) = read(jump, &counts_setup()).unwrap();
    assert_eq!(tallies(&reader), [(Reason::ThermometerJump, 1, "log.csv:701".to_owned())]);
    assert!(batch.temperature_c[0][699].is_nan() && batch.temperature_c[0][700] == 20.0);

    let stays = format!("time_s,temperature_c,counts\n{}", rows(&|s| if s >= 700 { "60".into() } else { "20".into() }));
    let (batch, _) = read(stays, &counts_setup()).unwrap();
    assert_eq!(batch.temperature_c[0][720], 60.0, "a new level that stays is one");

    let moving = |s: u32| {
        format!("{},{}", 20.0 + f64::from(s) / 100.0, if s < 100 { 20.0 + f64::from(s) / 100.0 } else { 21.0 })
    };
    let frozen = format!("time_s,temperature_c_a,temperature_c_b,counts\n{}", rows(&moving));
    let (batch, reader) = read(frozen, &counts_setup()).unwrap();
    let list = tallies(&reader);
    assert_eq!(list.len(), 1);
    assert_eq!(list[0].0, Reason::ThermometerFrozen);
    assert!(batch.temperature_c[1][1400].is_nan() && batch.temperature_c[0][1400] > 30.0);
}

/// A thermometer read every tenth row: its register holds between, and no longer than that.
#[test]
fn a_sparse_thermometer_is_a_register() {
    let rows: String = (1..=200)
        .map(|s| {
            let celsius = if s % 10 == 1 && s < 100 { format!("{}", f64::from(s) / 10.0) } else { String::new() };
            format!("{s},{celsius},1\n")
        })
        .collect();
    let (batch, reader) = read(format!("time_s,temperature_c,counts\n{rows}"), &counts_setup()).unwrap();
    let t = &batch.temperature_c[0];
    assert_eq!((t[0], t[9], t[10], t[19], t[99]), (0.1, 0.1, 1.1, 1.1, 9.1));
    assert!(t[101].is_nan() && t[199].is_nan(), "held for 10 s at most");
    assert_eq!(tallies(&reader), []);
}

/// Fast ramps in slow rows, and changes during a gap, are not jumps.
#[test]
fn a_ramp_in_slow_rows_is_no_jump() {
    let rows: String =
        (1..=40).map(|i| format!("{},{},1\n", i * 100, -40.0 + f64::from(i) * 8.3 / 4.0 * 1.5)).collect();
    let (_, reader) =
        read(format!("time_s,temperature_c,counts\n{rows}6000,99,1\n6100,99,1\n"), &counts_setup()).unwrap();
    assert_eq!(tallies(&reader), [(Reason::Gap, 1, "log.csv:42".to_owned())]);
}

/// One stray quote costs its row, not the rest of the log.
#[test]
fn a_stray_quote_costs_one_row() {
    let (batch, reader) = read("time_s,counts\n1,\"4\"\n2,\"5\n3,6\n4,7\n", &counts_setup()).unwrap();
    assert_eq!(batch.angle[0], [4.0, 6.0, 7.0]);
    assert_eq!(tallies(&reader), [(Reason::NotANumber, 1, "log.csv:3".to_owned())]);
}

#[test]
fn a_quoted_field_may_hold_the_delimiter() {
    let log = "time_s,note,counts\n1,\"by anna, b\",4\n2,\"an \"\"x\"\"\",5\n3,plain,6\n";
    let (batch, reader) = read(log, &counts_setup()).unwrap();
    assert_eq!(batch.angle[0], [4.0, 5.0, 6.0]);
    assert_eq!(tallies(&reader), []);
}

/// Flagged rows cannot make a log unreadable.
#[test]
fn a_flagged_row_may_hold_anything() {
    let (batch, reader) =
        read("time_s,counts,valid\n1,4,1\n2,0.37,0\n3,1e300,0\n4,x,0\n5,6,1\n", &counts_setup()).unwrap();
    assert_eq!(batch.angle[0], [4.0, 6.0]);
    assert_eq!(tallies(&reader), [(Reason::FlaggedInvalid, 3, "log.csv:3".to_owned())]);
}

#[test]
fn cumulative_counters_are_unrolled_and_their_wraps_too() {
    let setup = Setup { counter: Some(Counter::Cumulative), ..counts_setup() };
    let (batch, _) = read("time_s,counts\n1,100\n2,107\n3,x\n4,120\n5,118\n", &setup).unwrap();
    assert_eq!(batch.angle[0], [7.0, 13.0, -2.0]);
    // The unreadable row's counts are in the next one, and so is its interval.
    assert_eq!((batch.start_ns[1], batch.end_ns[1]), (2_000_000_000, 4_000_000_000));
    let wrapping = "time_s,counts\n1,65530\n2,65534\n3,3\n4,7\n5,65533\n";
    let with_width = Setup { counter_bits: Some(16), ..setup.clone() };
    let (batch, _) = read(wrapping, &with_width).unwrap();
    assert_eq!(batch.angle[0], [4.0, 5.0, 4.0, -10.0]);
    let error = refused(wrapping, &setup);
    assert_eq!((error.kind, error.place.line), (ErrorKind::Input, Some(4)));
    assert!(error.help.contains("counter_bits"));
}

#[test]
fn quanta_are_whole_or_the_log_is_refused() {
    let log = "time_s,counts\n1,1.25\n2,0.75\n";
    let (batch, _) = read(log, &Setup { quantum: Some(0.25), ..counts_setup() }).unwrap();
    assert_eq!(batch.angle[0], [5.0, 3.0]);
    let error = refused(log, &counts_setup());
    assert_eq!((error.place.line, error.place.value.as_deref()), (Some(2), Some("1.25")));
}

#[test]
fn what_a_log_cannot_say_is_asked_for() {
    let error = refused(PLAIN, &Setup::default());
    assert_eq!(error.place.column.as_deref(), Some("arcsec_per_count"));
    let error = refused("temperature_c,counts\n20,1\n", &counts_setup());
    assert_eq!(error.place.column.as_deref(), Some("sample_interval_s"));
    for (log, word) in [
        ("", "empty"),
        ("time_s,counts\n", "no row"),
        ("1,2\n3,4\n", "numbers"),
        ("a,b\n1,2\n", "no column"),
        ("time_s,counts\n1,1\n1,1\n", "does not advance"),
        ("time_s,counts,counts\n1,1,1\n", "duplicate column"),
        ("time_s,temperature_f,counts\n1,1,1\n", "unknown unit"),
        ("time,temperature_c,counts\n1,1,1\n", "unknown unit"),
        ("time_s,reference_rate_dph,counts\n1,1,1\n", "unknown unit"),
        ("time_s,counts\n1,1\n2,1\n90000000,1\n", "leaps"),
    ] {
        let error = refused(log, &counts_setup());
        assert!(error.what.contains(word) && error.kind == ErrorKind::Input, "{log:?}: {error}");
        assert_eq!(error.place.file.as_deref(), Some("log.csv"), "{log:?}");
    }
    assert!(refused(b"PK\x03\x04\x00\x00".to_vec(), &counts_setup()).what.contains("a zip archive"));
    assert!(refused(b"\x01\x02\x00\x00".to_vec(), &counts_setup()).what.contains("binary"));
    assert!(refused(vec![b'1'; 3 << 20], &counts_setup()).what.contains("1 MiB"));
}

/// The same log with times as numbers and as dates: the same rows, to the nanosecond.
#[test]
fn dates_are_times() {
    let text = |time: &dyn Fn(u32) -> String, name: &str, quote: &str| -> String {
        let rows = (0..200).map(|k| format!("{quote}{}{quote},{}\n", time(k), 5 + k % 7));
        format!("{name},counts\n") + &rows.collect::<String>()
    };
    let numbers = text(&|k| format!("{}.25", 1_709_251_100 + 5 * k), "time_s", "");
    let (wanted, _) = read(numbers, &counts_setup()).unwrap();
    // From 29 February into March: seconds since midnight, and the day.
    let parts = |k: u32| {
        let second = 86_300 + 5 * k;
        let (day, second) = if second < 86_400 { ("2024-02-29", second) } else { ("2024-03-01", second - 86_400) };
        (day, second / 3600, second / 60 % 60, second % 60)
    };
    let extended = |between: &'static str, end: &'static str| {
        move |k: u32| {
            let (day, h, m, s) = parts(k);
            format!("{day}{between}{h:02}:{m:02}:{s:02}.25{end}")
        }
    };
    let basic = |k: u32| {
        let (day, h, m, s) = parts(k);
        format!("{}T{h:02}{m:02}{s:02}.250000Z", day.replace('-', ""))
    };
    for (time, name, quote) in [
        (&extended("T", "Z") as &dyn Fn(u32) -> String, "time", ""),
        (&extended(" ", ""), "timestamp", ""),
        (&extended("T", "+00:00"), "datetime_utc", "\""),
        (&basic, "time_iso", ""),
    ] {
        let (batch, reader) = read(text(time, name, quote), &counts_setup()).unwrap();
        assert_eq!(
            (&batch.start_ns, &batch.end_ns, &batch.angle),
            (&wanted.start_ns, &wanted.end_ns, &wanted.angle),
            "{name}"
        );
        assert_eq!((reader.shape().nominal_ns, reader.shape().timed), (5_000_000_000, true));
        assert!(tallies(&reader).is_empty());
    }
    // Offsets count: the clock goes back by an hour, time does not.
    let summer = "time,counts\n2024-10-27T02:59:50+02:00,1\n2024-10-27T02:59:55+02:00,1\n2024-10-27T02:00:00+01:00,1\n";
    let (batch, reader) = read(summer, &counts_setup()).unwrap();
    assert_eq!((batch.len(), tallies(&reader).len()), (3, 0));
    // Numbers next to dates are read, the dates are not.
    let (_, reader) = read("timestamp,time_s,counts\n2024-10-27,1,1\nx,2,1\n", &counts_setup()).unwrap();
    assert_eq!(reader.shape().ignored, ["timestamp"]);
}

/// A time column that cannot be read is refused by name, with or without an interval that was given; nothing is put in
/// its place.
#[test]
fn a_time_column_that_cannot_be_read_is_refused() {
    let with_interval = Setup { sample_interval_s: Some(1.0), ..counts_setup() };
    let rows = |time: &str| (0..40).map(|k| format!("{time}{k},1.5\n")).collect::<String>();
    for (header, time, column, word) in [
        ("time", "", "time", "unknown unit"),
        ("time", "noon ", "time", "unknown unit"),
        ("timestamp", "02/29/2024 12:00:", "timestamp", "unknown unit"),
        ("time_s", "2024-02-29T12:00:", "time_s", "times in the first rows"),
        ("Time [h]", "", "Time [h]", "looks like a time"),
        ("gps_epoch", "", "gps_epoch", "looks like a time"),
        ("date", "noon", "date", "looks like a time"),
        ("utc clock", "noon", "utc clock", "looks like a time"),
    ] {
        for (setup, values) in
            [(&Setup::default(), "rate_dph"), (&with_interval, "rate_dph"), (&with_interval, "counts")]
        {
            let log = format!("{header},{values}\n{}", rows(time).replace(".5", ""));
            let error = refused(log, setup);
            assert!(error.what.contains(word), "{header} {time}: {error}");
            assert_eq!(error.place.column.as_deref(), Some(column), "{error}");
            assert!(!error.help.is_empty(), "{error}");
        }
    }
    // A column whose name and first cell are of dates is a time.
    let dates = (0..40).map(|k| format!("2024-02-29T12:00:{k:02},1,20\n")).collect::<String>();
    assert!(read(format!("date,rate_dph,temperature_c\n{dates}"), &Setup::default()).is_ok());
    // Headers without a time, and one that the setup ignores.
    assert!(read("rate_dph,temperature_c\n1,20\n2,20\n", &Setup::default()).is_ok());
    let ignored = Setup { columns: [("gps_epoch".to_owned(), "ignore".to_owned())].into(), ..with_interval };
    assert!(read(format!("gps_epoch,rate_dph\n{}", rows("")), &ignored).is_ok());
    // Without an interval a short name is enough.
    assert_eq!(refused(format!("t,rate_dph\n{}", rows("")), &Setup::default()).place.column.as_deref(), Some("t"));
}

/// `--sample-interval` against the time column: accepted within 2 %, refused beyond, in a file and in a pipe.
#[test]
fn an_interval_that_the_time_column_contradicts_is_refused() {
    let log = |step: &dyn Fn(u32) -> f64| {
        let mut time_s = 0.0;
        let rows = (0..200).map(|k| {
            time_s += step(k);
            format!("{time_s:.6},5\n")
        });
        "time_s,counts\n".to_owned() + &rows.collect::<String>()
    };
    let jitter = |k: u32| 5.0 + 0.3 * (f64::from(k * 7919 % 101) / 50.0 - 1.0);
    let losses = |k: u32| if k % 9 == 4 { 10.0 } else { 5.0 };
    let rounded = |k: u32| f64::from(1 + k % 2);
    let given = |seconds: f64| Setup { sample_interval_s: Some(seconds), ..counts_setup() };
    let even = |_| 5.0;
    type Case<'a> = (&'a dyn Fn(u32) -> f64, f64, bool);
    let cases: [Case<'_>; 14] = [
        (&even, 5.0, true),
        (&even, 5.09, true),
        (&even, 4.91, true),
        (&even, 5.11, false),
        (&even, 4.89, false),
        (&even, 1.0, false),
        (&even, 10.0, false),
        (&jitter, 5.0, true),
        (&jitter, 4.8, false),
        (&losses, 5.0, true),
        (&losses, 6.0, false),
        (&rounded, 1.5, true),
        (&rounded, 1.0, true),
        (&even, 0.005, false),
    ];
    for (step, seconds, accepted) in cases {
        let text = log(step);
        let outcome = read(text.clone(), &given(seconds)).map(|(_, reader)| reader.shape().nominal_ns);
        let source = Box::new(std::io::Cursor::new(text.into_bytes()));
        let mut pipe = LogReader::from_reader("pipe", source, &given(seconds), ReadMode::LineByLine).unwrap();
        let of_pipe = loop {
            match pipe.next_batch() {
                Ok(Some(_)) => {}
                Ok(None) => break None,
                Err(error) => break Some(error),
            }
        };
        match outcome {
            Ok(nominal_ns) => {
                assert!(accepted && of_pipe.is_none() && nominal_ns == (seconds * 1e9) as i64, "{seconds} {of_pipe:?}")
            }
            Err(error) => {
                assert!(!accepted && error.what.contains("the time column has a row every"), "{seconds}: {error}");
                assert_eq!(error.place.value, Some(seconds.to_string()));
                assert_eq!(of_pipe.unwrap().place.line, Some(18), "{seconds}");
            }
        }
    }
}

#[test]
fn tables_without_time_are_rows_of_one_interval() {
    let setup = Setup { sample_interval_s: Some(100.0), ..counts_setup() };
    let (batch, reader) = read("temperature_c,counts\n20,421\n25,424\n", &setup).unwrap();
    assert_eq!((batch.end_ns[1], reader.shape().timed), (200_000_000_000, false));
}

/// The content of a broken row can neither refuse the log nor invalidate the temperatures of other rows.
#[test]
fn a_ragged_row_is_only_that() {
    let mut log = "time_s,temperature_c,counts\n".to_owned();
    for t in 1..=200 {
        log += &format!("{t},{}.5,1\n", 20 + t / 10);
        if t == 100 {
            log += "99999999,22\n";
        }
    }
    for offset in [-2.0, 0.0, 2.0] {
        let setup = Setup { temperature_offset_s: offset, ..counts_setup() };
        let (batch, reader) = read(log.clone(), &setup).unwrap();
        assert_eq!(batch.len(), 200, "offset {offset}");
        assert_eq!(tallies(&reader), [(Reason::Ragged, 1, "log.csv:102".to_owned())]);
        assert!((batch.temperature_c[0][195] - 39.5).abs() <= 1.0, "offset {offset}: {}", batch.temperature_c[0][195]);
    }
}

/// A reader that gives a byte at a time, as a slow pipe may.
struct Drip(Cursor<Vec<u8>>);

impl std::io::Read for Drip {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let one = buffer.len().min(1);
        self.0.read(&mut buffer[..one])
    }
}

#[test]
fn a_format_is_known_even_byte_by_byte() {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(PLAIN.as_bytes()).unwrap();
    for bytes in [PLAIN.as_bytes().to_vec(), gzip.finish().unwrap()] {
        let drip = Box::new(Drip(Cursor::new(bytes)));
        let mut reader = LogReader::from_reader("log.csv", drip, &counts_setup(), ReadMode::Bulk).unwrap();
        assert_eq!(reader.next_batch().unwrap().unwrap().angle[0], [7.0, 8.0, -9.0]);
    }
}

/// A pipe that begins in the middle of a row, or repeats one.
#[test]
fn a_live_log_may_begin_with_a_broken_row() {
    for first in ["5,20\n", "11,20,1\n"] {
        let log = format!("time_s,temperature_c,counts\n{first}11,20,1\n12,20,1\n13,20,1\n");
        let reader =
            LogReader::from_reader("-", Box::new(Cursor::new(log)), &counts_setup(), ReadMode::LineByLine).unwrap();
        assert_eq!(reader.shape().nominal_ns, 1_000_000_000);
    }
}

/// Counts of 1 arcsec in rows of 1 s: 1e5 °/s are 3.6e8 of them, and half as many more in a row that lasts as much longer.
#[test]
fn a_rate_that_no_gyro_has_is_no_value() {
    let faults = |rows: &str, setup: &Setup| {
        let (batch, reader) = read(format!("time_s,temperature_c,{rows}"), setup).unwrap();
        (batch.len(), tallies(&reader))
    };
    let counts = |last: &str| faults(&format!("counts\n1,20,7\n2,20,8\n3,20,9\n4,20,{last}\n"), &counts_setup());
    assert_eq!(counts("540000000"), (4, vec![]));
    let refused = |first: &str| vec![(Reason::ValueOutOfRange, 1, first.to_owned())];
    assert_eq!(counts("540000001"), (3, refused("log.csv:5")));
    assert_eq!(counts("-540000001"), (3, refused("log.csv:5")));
    let rates = |last: &str| faults(&format!("rate_dps\n1,20,7\n2,20,8\n3,20,9\n4,20,{last}\n"), &Setup::default());
    assert_eq!(rates("-100000"), (4, vec![]));
    assert_eq!(rates("100001"), (3, refused("log.csv:5")));
    let totals = Setup { counter: Some(Counter::Cumulative), ..counts_setup() };
    let total = |last: &str| faults(&format!("counts\n1,20,7\n2,20,8\n3,20,9\n4,20,{last}\n"), &totals);
    assert_eq!(total("540000009"), (3, vec![]));
    assert_eq!(total("540000010").0, 2);
    // A rate of the table that is none is missing.
    let (batch, _) =
        read("time_s,rate_dps,reference_rate_dps\n1,7,1e5\n2,7,-100001\n3,7,1e300\n", &Setup::default()).unwrap();
    assert_eq!(batch.reference_dps[0], 1e5);
    assert!(batch.reference_dps[1..].iter().all(|rate| rate.is_nan()));
}

/// Binary data are known by their first block, not by the few bytes that tell a format.
#[test]
fn binary_data_are_no_text_however_they_begin() {
    let matlab = [b"MATLAB 7.3 MAT-file, Platform: GLNXA64".as_slice(), &[b' '; 80], b"\r\x00\x02IM"].concat();
    assert!(refused(matlab.clone(), &counts_setup()).what.contains("MATLAB 7.3"));
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(&matlab).unwrap();
    assert!(refused(gzip.finish().unwrap(), &counts_setup()).what.contains("MATLAB 7.3"));
    for odd in [b"\x00".as_slice(), b"\xff\x01\x02"] {
        let binary = [PLAIN.as_bytes(), odd, b"\n"].concat();
        assert!(refused(binary, &counts_setup()).what.contains("binary data"), "{odd:?}");
    }
}
