//! Lines of delimited text to rows.

use sagnac_log::Error;
use sagnac_log::Result;
use sagnac_log::ingest::{Content, LiveHeader, fields_of, parse_time_ns, time_text};
use sagnac_log::setup::Setup;
use sagnac_units::ns_from_s;

use crate::decode::clock::{ClockReport, RowClock};
use crate::decode::rows_made::Rows;

/// Longest line, bytes.
const MOST_LINE_BYTES: usize = 1 << 16;
/// Lines without headers after which it is said.
const MANY_LINES: u64 = 100;
/// Without times, a pause that is longer than this, and than three rows, is a gap, ns.
const PAUSE_NS: i64 = 2_500_000_000;
/// Header of the time that a source without one gets.
const TIME: &str = "time_ns";

/// A source of text.
pub(crate) struct Text {
    setup: Setup,
    header: Option<LiveHeader>,
    /// The source sends no headers: the setup has them.
    is_given: bool,
    carried: Vec<u8>,
    /// The rest of this line is dropped.
    skips: bool,
    /// The next line is the first of a connection, and on a line that may begin within a row.
    is_first: bool,
    may_be_cut: bool,
    before_header: u64,
    /// What is wrong with the last line of headers that could not be read.
    problem: Option<Error>,
    /// Rows are under other headers.
    is_foreign: bool,
    clock: RowClock,
    /// Without a column of times: interval of a row, and the time of the next one.
    interval_ns: Option<i64>,
    next_ns: i64,
    started_ns: i64,
}

impl Text {
    pub(crate) fn new(setup: &Setup, started_ns: i64, rows: &mut Rows) -> Result<Self> {
        let interval_ns = setup.sample_interval_s.and_then(ns_from_s);
        let mut text = Self {
            setup: setup.clone(),
            header: None,
            is_given: false,
            carried: Vec::new(),
            skips: false,
            is_first: true,
            may_be_cut: false,
            before_header: 0,
            problem: None,
            is_foreign: false,
            clock: RowClock::default(),
            interval_ns,
            next_ns: 0,
            started_ns,
        };
        if let Some(line) = &setup.bench.headers {
            text.is_given = text.begins(line.as_bytes(), rows).map_err(|e| e.column("bench.headers"))?;
            if !text.is_given {
                return Err(Error::input(
                    "the header line names no column of counts or rates",
                    "name one `counts` or `rate_dph` in headers under [bench]",
                )
                .column("bench.headers")
                .value(line));
            }
        }
        Ok(text)
    }

    /// Takes a line of headers over; false for a line that is none.
    fn begins(&mut self, line: &[u8], rows: &mut Rows) -> Result<bool> {
        let polled = rows.polled_names();
        let Some(header) = LiveHeader::of_line(line, &polled, &self.setup)? else { return Ok(false) };
        let layout = &header.layout;
        let own = layout.headers.len() - polled.len();
        let mut columns: Vec<(String, Content)> = layout
            .headers
            .iter()
            .take(own)
            .enumerate()
            .map(|(at, name)| (name.clone(), layout.content_of(at)))
            .collect();
        if layout.time.is_none() {
            let interval = "rows without times need a row interval";
            let help = "give sample_interval_s in the setup, or map the column of the time under [columns]";
            self.interval_ns.ok_or_else(|| Error::input(interval, help).column("sample_interval_s"))?;
            columns.insert(0, (TIME.to_owned(), Content::Nanoseconds));
        }
        rows.begin(columns, header.has_decimal_comma());
        self.header = Some(header);
        Ok(true)
    }

    /// A new connection.
    pub(crate) fn connected(&mut self, may_be_cut: bool, rows: &mut Rows) {
        self.may_be_cut = may_be_cut;
        rows.counts.lost_bytes += self.carried.len() as u64;
        self.carried.clear();
        (self.skips, self.is_first, self.is_foreign) = (false, true, false);
        self.clock.connected();
    }

    /// Bytes that came together.
    pub(crate) fn push(&mut self, bytes: &[u8], at_ns: i64, rows: &mut Rows) {
        let mut rest = bytes;
        while let Some(end) = memchr::memchr(b'\n', rest) {
            let (line, behind) = rest.split_at(end);
            rest = behind.get(1..).unwrap_or_default();
            if std::mem::take(&mut self.skips) {
                rows.counts.lost_bytes += line.len() as u64;
            } else if self.carried.is_empty() {
                self.line(line, at_ns, rows);
            } else {
                let mut whole = std::mem::take(&mut self.carried);
                whole.extend_from_slice(line);
                self.line(&whole, at_ns, rows);
                whole.clear();
                self.carried = whole;
            }
        }
        if self.skips || self.carried.len() + rest.len() > MOST_LINE_BYTES {
            rows.counts.lost_bytes += (self.carried.len() + rest.len()) as u64;
            self.carried.clear();
            self.skips = true;
        } else {
            self.carried.extend_from_slice(rest);
        }
        self.clock.arrived();
    }

    /// The source has ended: what was carried is its last line.
    pub(crate) fn ended(&mut self, at_ns: i64, rows: &mut Rows) {
        let last = std::mem::take(&mut self.carried);
        if !last.is_empty() && !self.skips {
            self.line(&last, at_ns, rows);
        }
    }

    /// Why there are no columns, where a line of headers could not be read.
    pub(crate) fn problem(&self) -> Option<&Error> {
        self.problem.as_ref().filter(|_| self.header.is_none())
    }

    /// Whether a line is one of headers. What is wrong with it is said, and ends nothing: a board may say anything when it starts. Behind other
    /// headers than before, rows are not read until the known ones come again.
    fn is_header(&mut self, line: &[u8], is_first: bool, at_ns: i64, rows: &mut Rows) -> bool {
        // Looking at each row for the words of headers would cost more than reading it.
        let may_be = self.header.is_none() || is_first || line.iter().any(u8::is_ascii_alphabetic);
        if !may_be {
            return false;
        }
        if self.is_given {
            // A source may send them too.
            let sent = LiveHeader::of_line(line, &rows.polled_names(), &self.setup);
            return sent.is_ok_and(|sent| sent == self.header);
        }
        let Some(known) = &self.header else {
            return self.begins(line, rows).unwrap_or_else(|refused| {
                if self.problem.is_none() {
                    rows.say(at_ns, format!("unreadable header line: {refused}"));
                }
                self.problem = Some(refused);
                false
            });
        };
        match LiveHeader::of_line(line, &rows.polled_names(), &self.setup) {
            Ok(Some(header)) if header == *known => {
                if std::mem::take(&mut self.is_foreign) {
                    rows.say(at_ns, "the earlier headers are back");
                }
                true
            }
            Ok(Some(_)) => {
                if !std::mem::replace(&mut self.is_foreign, true) {
                    let other = String::from_utf8_lossy(line);
                    rows.say(at_ns, format!("the headers changed, and rows below them are not read: {other}"));
                }
                true
            }
            Ok(None) | Err(_) => false,
        }
    }

    fn line(&mut self, line: &[u8], at_ns: i64, rows: &mut Rows) {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let is_first = std::mem::take(&mut self.is_first);
        if line.is_empty() || line.starts_with(b"#") {
            return;
        }
        if self.is_header(line, is_first, at_ns, rows) {
            return;
        }
        let Some(header) = self.header.as_ref().filter(|_| !self.is_foreign) else {
            self.before_header += u64::from(self.header.is_none());
            rows.counts.lost_bytes += line.len() as u64;
            if self.before_header == MANY_LINES && self.header.is_none() {
                rows.say(at_ns, format!("{MANY_LINES} lines without headers: set `headers` under [bench]"));
            }
            return;
        };
        let own = header.layout.headers.len() - rows.polled.len();
        let fields = fields_of(line, header.delimiter);
        // The first line of a connection may be the end of one, even with as many fields.
        if fields.len() != own || (is_first && self.may_be_cut) {
            rows.counts.lost_bytes += line.len() as u64;
            if !is_first {
                rows.counts.cut_lines += 1;
            }
            return;
        }
        match header.layout.time {
            Some((index, places)) => {
                let comma = header.has_decimal_comma();
                let time_ns = fields.get(index).and_then(|field| parse_time_ns(field, places, comma));
                let (counts_ns, anew) = time_ns.map_or((0, false), |time_ns| self.clock.at(time_ns, at_ns));
                if anew {
                    rows.say(at_ns, "the gyro's clock began again: its times go on by arrival");
                }
                if self.clock.offset_ns() == 0 || time_ns.is_none() {
                    rows.row(fields.iter(), at_ns);
                } else {
                    let time = time_text(counts_ns, places);
                    let cell = |(at, field)| if at == index { time.as_bytes() } else { field };
                    rows.row(fields.iter().enumerate().map(cell), at_ns);
                }
            }
            None => {
                let time = self.time_of_row(at_ns).to_string();
                rows.row(std::iter::once(time.as_bytes()).chain(fields.iter()), at_ns);
            }
        }
    }

    /// The time of a row that has none: an interval after the row before; after a gap, by arrival.
    fn time_of_row(&mut self, at_ns: i64) -> i64 {
        let interval_ns = self.interval_ns.unwrap_or(1);
        let since_ns = at_ns.saturating_sub(self.started_ns);
        let pause_ns = PAUSE_NS.max(interval_ns.saturating_mul(3));
        let paused = self.clock.last().is_none_or(|(_, before_ns)| at_ns.saturating_sub(before_ns) > pause_ns);
        let is_gap = self.clock.is_new_connection() || (paused && since_ns.saturating_sub(self.next_ns) > pause_ns);
        if is_gap {
            self.next_ns = self.next_ns.max(since_ns);
        }
        let time_ns = self.next_ns;
        self.next_ns = time_ns.saturating_add(interval_ns);
        self.clock.at(time_ns, at_ns);
        time_ns
    }

    pub(crate) fn clock(&self) -> ClockReport {
        self.clock.report()
    }
}
